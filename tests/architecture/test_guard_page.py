"""The page *guard your estimator*: its test passes, and fails for an estimator that has become worse."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from docs.studies.quotes import BLOCK, quotes
from tests.architecture.test_readme import HOW_TO, ROOT
from tunnel_lab.cli import main

PAGE = (HOW_TO / "guard-your-estimator.md").read_text(encoding="utf-8")
BLOCKS = {kind: text for kind, text in reversed(BLOCK.findall(PAGE))}
"""The first block of each language."""


def outcome(folder: Path) -> tuple[int, str]:
    """Status and output of the page's test in a folder."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_zero_crossings.py"]
    done = subprocess.run(
        words, cwd=folder, env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def test_the_test_has_ten_lines() -> None:
    assert len([line for line in BLOCKS["python"].splitlines() if line]) <= 10


@pytest.mark.slow
def test_the_test_passes_and_fails_where_the_estimator_is_worse(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = quotes((HOW_TO / "add-an-estimator.md").read_text(encoding="utf-8"))[0].source
    files = {"zero_crossings": own, "test_zero_crossings": BLOCKS["python"]}
    for name, text in files.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    (tmp_path / "grid.toml").write_text(BLOCKS["toml"], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])
    (command,) = [line for line in PAGE.splitlines() if line.startswith("tunnel score")]
    assert main(command.split()[1:]) == 0
    assert outcome(tmp_path)[0] == 0
    worse = own.replace("omega = np.pi / half", "omega = 1.002 * np.pi / half")
    assert worse != own
    (tmp_path / "zero_crossings.py").write_text(worse, encoding="utf-8")
    status, said = outcome(tmp_path)
    assert status == 1
    assert "Worse than the baseline" in said


def test_every_column_of_the_scores_is_on_the_page() -> None:
    from tunnel_lab.experiments.score import packaged_baseline
    from tunnel_lab.experiments.score_view import scores_frame

    results = packaged_baseline()
    names = pl.Series(scores_frame(replace(results, table=results.table.head(1))).columns)
    stems = names.str.replace("(_std_error|_low|_high)$", "").unique()
    assert [name for name in stems if f"`{name}`" not in PAGE] == []
