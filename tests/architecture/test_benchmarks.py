"""The commands of the benchmarks' page start."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = {"benchmarks.causes"}  # with commands of its own; tests/unit/benchmarks/test_causes.py
NAMED = re.findall(r"^python -m (benchmarks\.\w+)", (ROOT / "benchmarks/README.md").read_text(), re.MULTILINE)
COMMANDS = [name for name in NAMED if name not in PACKAGES]


def test_every_benchmark_is_on_the_page() -> None:
    files = {f"benchmarks.{path.stem}" for path in (ROOT / "benchmarks").glob("*.py")}
    assert set(COMMANDS) == files - {"benchmarks.peers", "benchmarks.golden_rigs"}  # used by another


@pytest.mark.parametrize("module", COMMANDS)
def test_each_says_how_it_is_run(module: str) -> None:
    """A file's own path would put its folder first on Python's, where ``diagnosis`` is a benchmark."""
    text = (ROOT / f"{module.replace('.', '/')}.py").read_text()
    assert f'prog="python -m {module}"' in text
    assert f"``python -m {module}" in text.split('"""')[1]


@pytest.mark.slow
@pytest.mark.parametrize("module", COMMANDS)
def test_it_starts(module: str) -> None:
    subprocess.run([sys.executable, "-m", module, "--help"], cwd=ROOT, check=True, capture_output=True)
