"""Values do not change: every dataclass is frozen, but for the few whose arrays an integrator steps in place."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.sources import ROOT, parsed

PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["root_packages"]
STEPPED_IN_PLACE = 2
STILL_COMPARED = {"diagnosis/likelihood/problem.py: Point", "diagnosis/likelihood/residuals.py: SpectralLine"}
"""Nobody compares these with ==, which would raise."""


def dataclasses_of(path: Path) -> Iterator[tuple[str, tuple[ast.ClassDef, dict[str, str]]]]:
    """Name of every dataclass of a module, its class, and the options it is made with."""
    for node in ast.walk(parsed(path)):
        for mark in getattr(node, "decorator_list", []) if isinstance(node, ast.ClassDef) else []:
            call = mark if isinstance(mark, ast.Call) else ast.Call(mark, [], [])
            if ast.unparse(call.func).rpartition(".")[2] == "dataclass":
                options = {str(k.arg): ast.unparse(k.value) for k in call.keywords}
                yield f"{path.relative_to(ROOT)}: {node.name}", (node, options)


@pytest.fixture(scope="module")
def found() -> dict[str, tuple[ast.ClassDef, dict[str, str]]]:
    return dict(
        item for name in PACKAGES for path in (ROOT / name).rglob("*.py") for item in dataclasses_of(path)
    )


def test_values_are_frozen(found: dict[str, tuple[ast.ClassDef, dict[str, str]]]) -> None:
    assert len(found) > 200
    loose = sorted(name for name, (_, options) in found.items() if options.get("frozen") != "True")
    assert len(loose) == STEPPED_IN_PLACE, loose
    assert all("reference" in name for name in loose)


def test_values_that_hold_arrays_are_not_compared(
    found: dict[str, tuple[ast.ClassDef, dict[str, str]]],
) -> None:
    """Two arrays compared with == are an array, of which a dataclass cannot make a truth value."""
    holding = {name: options for name, (node, options) in found.items() if any(map(holds_array, node.body))}
    assert len(holding) > 50
    compared = {name for name, options in holding.items() if options.get("eq") != "False"}
    assert compared <= STILL_COMPARED


def holds_array(statement: ast.stmt) -> bool:
    """Whether a field is an array, or perhaps none."""
    return isinstance(statement, ast.AnnAssign) and not {"Array", "Row", "Rows"}.isdisjoint(
        ast.unparse(statement.annotation).split(" | ")
    )
