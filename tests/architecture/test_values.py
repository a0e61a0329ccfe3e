"""Values do not change: every dataclass is frozen, but for the few whose arrays an integrator steps in place."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["root_packages"]
STEPPED_IN_PLACE = 2


def dataclasses_of(path: Path) -> Iterator[tuple[str, bool]]:
    """Name of every dataclass of a module, and whether it is frozen."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        for mark in getattr(node, "decorator_list", []) if isinstance(node, ast.ClassDef) else []:
            call = mark if isinstance(mark, ast.Call) else ast.Call(mark, [], [])
            if ast.unparse(call.func).rpartition(".")[2] == "dataclass":
                frozen = any(k.arg == "frozen" and ast.unparse(k.value) == "True" for k in call.keywords)
                yield f"{path.relative_to(ROOT)}: {node.name}", frozen


def test_values_are_frozen() -> None:
    found = dict(
        item for name in PACKAGES for path in (ROOT / name).rglob("*.py") for item in dataclasses_of(path)
    )
    assert len(found) > 200
    loose = sorted(name for name, frozen in found.items() if not frozen)
    assert len(loose) == STEPPED_IN_PLACE, loose
    assert all("reference" in name for name in loose)
