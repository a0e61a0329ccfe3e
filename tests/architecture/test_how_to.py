"""The how-to pages: what they show is what the tool does."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from docs.studies.quotes import BLOCK, printed, quotes
from identification import estimators
from tests.architecture.test_readme import HOW_TO, ROOT
from tunnel_lab.cli import main
from tunnel_lab.experiments.score import packaged_baseline

PAGES = HOW_TO
INDEX = ROOT / "docs" / "README.md"


def test_the_joints_files_are_there_before_a_command_takes_them() -> None:
    text = (PAGES / "a-joint-of-your-robot.md").read_text(encoding="utf-8")
    command = text.index("tunnel diagnose elbow --model arm.xml")
    for made in ('(folder / "campaign.toml").write_text', 'Path("arm.xml").write_text'):
        assert text.index(made) < command


def test_the_commands_of_the_added_estimator_take_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The commands of the page, but for their folders and grids: the class is found in the current folder."""
    page = PAGES / "add-an-estimator.md"
    (tmp_path / "zero_crossings.py").write_text(quotes(page.read_text("utf-8"))[0].source, encoding="utf-8")
    given = re.findall(r"^tunnel (\w+) .*(?:-e|--estimator) (\S+:\S+)", page.read_text("utf-8"), re.MULTILINE)
    assert {word for _, word in given} == {"zero_crossings:ZeroCrossings", "zero_crossings:Springs"}
    assert {command for command, _ in given} == {"identify", "score", "sweep"}
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])
    monkeypatch.setattr(estimators, "_registered", {})
    record = ROOT / "identification" / "data" / "measured" / "kvlcc2-roll-decay-0kn"
    assert main(["identify", str(record), "--estimator", given[0][1], "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["estimator"] == "zero_crossings"


def test_the_import_from_python_runs(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "reference" / "import.md").read_text(encoding="utf-8")
    (code,) = [code for kind, code in BLOCK.findall(page) if kind == "python"]
    time = np.arange(1000) / 100.0
    rows = zip(time, 12.0 * np.exp(-0.1 * time) * np.cos(9.0 * time), strict=True)
    text = "".join(f"{t:.2f},{angle:.4f}\n" for t, angle in rows)
    (tmp_path / "log.csv").write_text("time,angle\n" + text, encoding="utf-8")
    (out,) = printed([code], tmp_path)
    assert out.startswith("100.0\n")
    assert (tmp_path / "rig" / "campaign.toml").exists()


def test_every_estimator_that_is_scored_has_its_line() -> None:
    page = (PAGES / "choose-an-estimator.md").read_text(encoding="utf-8")
    scored = packaged_baseline().estimators
    assert len(scored) >= 8
    assert [name for name in scored if f"| `{name}` |" not in page] == []


def test_the_index_names_every_page() -> None:
    links = re.findall(r"\]\(([^)#]+)\)", INDEX.read_text(encoding="utf-8"))
    folders = [INDEX.parent / name for name in ("how-to", "tutorials", "reference", "theory", "explanation")]
    pages = [*INDEX.parent.glob("*.md"), *(page for folder in folders for page in folder.rglob("*.md"))]
    assert {page.relative_to(INDEX.parent).as_posix() for page in pages} - {
        "README.md",
        "index.md",
        "overview.md",
    } <= set(links)
