"""The how-to pages: what they show is what the tool does."""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from identification import estimators
from tests.architecture.test_readme import BLOCK, HOW_TO, ROOT, assert_same, output_of, sessions, toml_block
from tests.architecture.test_tutorials import printed, steps
from tunnel_lab.cli import main
from tunnel_lab.experiments.score import packaged_baseline

PAGES = HOW_TO
INDEX = ROOT / "docs" / "README.md"


@pytest.mark.parametrize(
    ("page", "typed"),
    [
        pytest.param("run-the-demo", ["demo", "demo"], marks=pytest.mark.slow),
        ("identify-a-record", ["springs"]),
        pytest.param("diagnose-a-campaign", ["simulate", "diagnose"], marks=pytest.mark.slow),
        pytest.param("state-uncertainties", ["simulate", "identify"], marks=pytest.mark.slow),
        pytest.param(
            "from-a-data-logger-to-cn-beta",
            ["import", "identify", "simulate", "export", "import", "identify"],
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "add-an-effect",
            ["effects", "simulate", "diagnose", "diagnose", "diagnose"],
            marks=pytest.mark.slow,
        ),
        pytest.param("the-paper", ["paper"], marks=pytest.mark.slow),
    ],
)
def test_shown_output_is_real_output(page: str, typed: list[str], tmp_path: Path) -> None:
    text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
    (tmp_path / "plan.toml").write_text(toml_block("wind_speeds"), encoding="utf-8")
    for original in (PAGES / "data").glob("*.mat"):
        shutil.copy(original, tmp_path)
    for kind, known in BLOCK.findall(text):
        if kind == "csv":
            (tmp_path / "runs.csv").write_text(known, encoding="utf-8")
        if kind == "toml":
            name = "my.toml" if known.startswith("[[effects]]") else "known.toml"
            (tmp_path / name).write_text(known, encoding="utf-8")
    assert [command.split()[1] for command, _ in sessions(text)] == typed
    for command, shown in sessions(text):
        assert_same(shown, output_of(command, tmp_path))


def test_every_page_with_output_is_run() -> None:
    pages = [page.stem for page in PAGES.glob("*.md") if sessions(page.read_text(encoding="utf-8"))]
    assert sorted(pages) == [
        "add-an-effect",
        "diagnose-a-campaign",
        "from-a-data-logger-to-cn-beta",
        "identify-a-record",
        "run-the-demo",
        "state-uncertainties",
        "the-paper",
    ]


@pytest.mark.slow
def test_the_figures_for_choosing_are_those_of_the_packaged_score(tmp_path: Path) -> None:
    shown = steps(PAGES / "choose-an-estimator.md")
    real = printed([code for code, _ in shown], tmp_path)
    assert len(shown) == len(real) >= 3
    for (_, text), output in zip(shown, real, strict=True):
        assert_same(text.splitlines(), output.splitlines())


@pytest.mark.slow
def test_the_joint_of_a_robot_is_diagnosed_as_shown(tmp_path: Path) -> None:
    shown = steps(PAGES / "a-joint-of-your-robot.md")
    assert [text for _, text in shown] == printed([code for code, _ in shown], tmp_path)
    assert len(shown) == 4


def test_the_joints_files_are_there_before_a_command_takes_them() -> None:
    text = (PAGES / "a-joint-of-your-robot.md").read_text(encoding="utf-8")
    command = text.index("tunnel diagnose elbow --model arm.xml")
    for made in ('(folder / "campaign.toml").write_text', 'Path("arm.xml").write_text'):
        assert text.index(made) < command


@pytest.mark.slow
def test_a_kind_of_rig_is_added_in_one_class(tmp_path: Path) -> None:
    shown = steps(PAGES / "add-a-kind-of-rig.md")
    assert [text for _, text in shown] == printed([code for code, _ in shown], tmp_path)
    assert [bool(text) for _, text in shown] == [False, False, True, True]


@pytest.mark.slow
def test_a_rival_is_added_in_one_class(tmp_path: Path) -> None:
    shown = steps(PAGES / "add-a-rival.md")
    assert [text for _, text in shown] == printed([code for code, _ in shown], tmp_path)
    assert len(shown) == 3


def test_a_finding_is_added_in_one_class(tmp_path: Path) -> None:
    shown = steps(PAGES / "add-a-finding.md")
    assert [text for _, text in shown] == printed([code for code, _ in shown], tmp_path)
    assert [bool(text) for _, text in shown] == [False, False, True, True]


def test_an_estimator_is_added_in_one_class(tmp_path: Path) -> None:
    page = PAGES / "add-an-estimator.md"
    shown = steps(page)
    assert [text for _, text in shown] == printed([code for code, _ in shown], tmp_path)
    assert [bool(text) for _, text in shown] == [False, True, True, True]


def test_the_commands_of_the_added_estimator_take_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The commands of the page, but for their folders and grids: the class is found in the current folder."""
    page = PAGES / "add-an-estimator.md"
    (tmp_path / "zero_crossings.py").write_text(steps(page)[0][0], encoding="utf-8")
    given = re.findall(r"^tunnel (\w+) .*(?:-e|--estimator) (\S+:\S+)", page.read_text("utf-8"), re.MULTILINE)
    assert {word for _, word in given} == {"zero_crossings:ZeroCrossings", "zero_crossings:Springs"}
    assert {command for command, _ in given} == {"identify", "score", "sweep"}
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path[:])
    monkeypatch.setattr(estimators, "_registered", {})
    record = ROOT / "identification" / "data" / "measured" / "kvlcc2-roll-decay-0kn"
    assert main(["identify", str(record), "--estimator", given[0][1], "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["estimator"] == "zero_crossings"


@pytest.mark.slow
def test_the_class_of_ones_own_is_found(tmp_path: Path) -> None:
    shown = steps(PAGES / "add-an-effect.md")
    assert [text for _, text in shown] == printed([code for code, _ in shown], tmp_path) == ["", "stopper\n"]


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
