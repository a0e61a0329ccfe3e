"""Narrow terminals, ``--quiet``, commands to copy, and what lies beside a path that is wrong."""

from __future__ import annotations

import io
import json
import shutil
import time
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from identification.show.blocks import TextTable
from tests.support.command import Tunnel
from tunnel_lab.terminal import progress
from tunnel_lab.terminal.table_layout import folded, is_too_wide, stacked
from tunnel_sim.files.reading import inside, nearest


def two_columns():
    second = ("second", "3", "a remark of more than thirty characters is a sentence")
    return TextTable("Title", ("run", "value\n[N m]", "remark"), (("first", "12.5 ± 0.1", ""), second))


def test_a_table_is_stacked_where_a_cell_would_be_broken() -> None:
    # 6 + 10 + 10 columns of content, two beside each, one between.
    assert [is_too_wide(two_columns(), width) for width in (33, 34)] == [True, False]


def test_a_stacked_table_has_every_cell_with_its_heading_and_wraps_sentences() -> None:
    assert stacked(two_columns(), 50).splitlines() == [
        "Title",
        " run first",
        "   value [N m]  12.5 ± 0.1",
        " run second",
        "   value [N m]  3",
        "   remark       a remark of more than thirty",
        "                characters is a sentence",
    ]


def test_a_stacked_table_of_two_columns_has_a_line_for_each_row() -> None:
    row = ("plugin", "/a/path/that/is/longer/than/the/terminal/is/wide")
    assert stacked(TextTable("Title", ("part", "found"), (row,)), 20).splitlines() == [
        "Title",
        " plugin:",
        " /a/path/that/is/longer/than/the/terminal/is/wide",
    ]


def test_what_was_finished_before_does_not_count_for_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Console(file=io.StringIO(), force_terminal=True, width=100, color_system=None)
    now = 0.0
    monkeypatch.setattr(terminal, "get_time", lambda: now)
    monkeypatch.setattr(progress, "console", lambda **_: terminal)
    with progress.bar("scoring") as advance:
        now = 5.0
        advance(90, 100)
        now = 25.0
        advance(92, 100, "drift")
    assert "92/100 0:00:25 left 0:01:20" in terminal.file.getvalue()


def test_work_of_minutes_says_where_it_is_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.bar_or_lines("diagnosing", 4, every=0.05) as advance:
        advance(3, 4)
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    assert lines
    assert all(line == "0 s: diagnosing, 3 of 4" for line in lines)
    with progress.bar_or_lines("diagnosing", 4):
        pass
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("width", [60, 70, 80])
def test_no_number_is_broken_in_a_narrow_terminal(
    tunnel: Tunnel, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    whole = json.loads(tunnel("springs", "--format", "json")[1].splitlines()[0])["rows"]
    monkeypatch.setenv("COLUMNS", str(width))
    status, out, _ = tunnel("springs")
    assert status == 0
    assert max(map(len, out.splitlines())) <= width
    for row in whole:
        assert "off the line" not in row["remark"] or "off the line" in out
        assert f"{row['ωn² [rad²/s²]']:.2f}" in out


def test_quiet_prints_nothing_but_errors_and_writes_all_the_same(
    tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path
) -> None:
    assert tunnel("identify", tiny_campaign, "--quiet", "--json", tmp_path / "e.json") == (0, "", "")
    assert json.loads((tmp_path / "e.json").read_text())["campaign"] == "tiny"
    status, out, err = tunnel("identify", tiny_campaign, "-q", "--json", "-")
    assert (status, json.loads(out)["campaign"], err) == (0, "tiny", "")
    status, out, err = tunnel("identify", tmp_path / "nowhere", "-q")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert tunnel("springs")[1] != ""


def test_a_note_shows_the_command_of_its_remedy(tunnel: Tunnel, tiny_campaign: Path, tmp_path: Path) -> None:
    spaced = tmp_path / "my rig"
    shutil.copytree(tiny_campaign, spaced)
    run = spaced / "runs" / "r01.csv"
    lines = run.read_text().splitlines()
    cubic = [
        f"{t},{float(y) * (1.0 + 3.0 * float(y) ** 2)}" for t, y in (line.split(",") for line in lines[1:])
    ]
    run.write_text("\n".join([lines[0], *cubic]))
    out = tunnel("identify", spaced)[1]
    assert f"run tunnel diagnose '{spaced}'" in out
    assert "run the diagnosis" not in out


def test_a_link_to_itself_is_not_what_was_meant(tmp_path: Path) -> None:
    (tmp_path / "rig").symlink_to("rig")
    assert nearest(tmp_path / "rig") == ""
    assert nearest(tmp_path / "rigs") == f"did you mean the file '{tmp_path / 'rig'}'?"
    assert inside(tmp_path) == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("identify", "tinny"), "no such folder; did you mean the folder 'tiny'?"),
        (("identify", "tiny/campain.toml"), "did you mean the file 'tiny/campaign.toml'?"),
        (("identify", "tiny/runs"), "no such file; did you mean the folder 'tiny'?"),
        (("identify", "plan.toml"), "if it is a plan: tunnel simulate plan.toml --out FOLDER"),
        (("simulate", "plam.toml", "--out", "x"), "no such file; did you mean the file 'plan.toml'?"),
        (
            ("simulate", "tiny", "--out", "x"),
            "it is a campaign, which tunnel identify and tunnel diagnose take",
        ),
        (("springs", "tiny/runs"), "name a file in it, such as 'tiny/runs/r01.csv'"),
    ],
)
def test_a_path_that_is_wrong_gets_the_one_beside_it(
    tunnel: Tunnel, tiny_campaign: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tiny_campaign.parent)
    Path("plan.toml").write_text("name = 'x'\n")
    status, out, err = tunnel(*words)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert said in err


def test_where_nothing_is_similar_nothing_is_suggested(tmp_path: Path) -> None:
    assert nearest(tmp_path / "anything") == nearest(tmp_path / "no" / "such") == inside(tmp_path) == ""


def test_a_long_name_is_broken_at_its_marks() -> None:
    table = TextTable("Runs", ("run", "wind"), (("test003_K16.12_V10", "a" * 20), ("r", "off")))
    narrow = folded(table, 42)
    assert narrow is not None
    assert narrow.rows[0][0].splitlines() == ["test003_K16.12_", "V10"]
    assert narrow.rows[1][0] == "r"
    unmarked = folded(replace(table, rows=(("x" * 20, "a" * 20),)), 42)
    assert unmarked is not None
    assert "".join(unmarked.rows[0][0].splitlines()) == "x" * 20
