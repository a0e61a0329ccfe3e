"""Where output goes: files first, then words; links, devices and readers that go away."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from identification.show.blocks import Paragraph, TextTable
from tests.skips import PLATFORM
from tests.support.command import Tunnel
from tests.support.gone_reader import unheard
from tunnel_lab.terminal.outputs import say_written, show
from tunnel_lab.terminal.table_layout import without_shared

ROOT = Path(__file__).parents[4]


@pytest.mark.slow
def test_diagnose_writes_before_it_prints(tiny_campaign: Path, tmp_path: Path) -> None:
    page, answer = tmp_path / "a.html", tmp_path / "a.json"
    words = ("diagnose", tiny_campaign, "--effects", "mains_hum", "--report", page)
    assert unheard(*words, "--json", answer) == 0
    assert page.exists()
    assert answer.exists()
    assert unheard("identify", tiny_campaign, "--json", "-") == 0


def test_identify_plot_and_effects_write_before_they_print(
    tiny_campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Figure, "savefig", lambda _, stream, **_form: stream.write(b"drawn"))
    assert unheard("identify", tiny_campaign, "--json", tmp_path / "e.json") == 0
    assert (tmp_path / "e.json").exists()
    assert unheard("plot", tiny_campaign, "--out", tmp_path) == 0
    assert len(list((tmp_path / "tiny").glob("*.png"))) == 3
    page = tmp_path / "e.md"
    assert unheard("effects", "--markdown", page, "--json", tmp_path / "effects.json") == 0
    assert page.exists()


def test_in_a_terminal_a_written_path_is_a_link_and_sentences_are_wrapped_at_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, sentence = tmp_path / "a b.png", "A sentence of many words. " * 8
    monkeypatch.setenv("COLUMNS", "40")
    say_written(path, more="3 runs", picture=path)
    show([Paragraph(sentence.strip())])
    assert capsys.readouterr().out == f"Written: {path} (3 runs, {path} shows them)\n{sentence.strip()}\n"
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    say_written(path)
    out = capsys.readouterr().out
    assert f"{path.as_uri()}\x1b\\{path}\x1b]8;;\x1b\\" in out
    show([Paragraph(sentence.strip())])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 40
    assert " ".join(lines).split() == sentence.split()


@pytest.mark.parametrize("words", [("--help",), ("identify", "--help"), ("effects",)])
def test_a_reader_that_goes_away_is_not_an_error(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert unheard(*words) == 0  # tunnel --help | head -1
    assert capsys.readouterr().err == ""


def started(*words: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tunnel_lab.cli", *map(str, words)],
        cwd=ROOT, text=True, stderr=subprocess.PIPE, check=False, **options,
    )  # fmt: skip


def test_a_real_pipe_that_is_closed_at_once() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = started("effects", stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


def test_without_standard_output(tmp_path: Path) -> None:
    done = started("effects", "--json", tmp_path / "e.json", preexec_fn=lambda: os.close(1))
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "e.json").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason=f"{PLATFORM}: there is no /dev/full")
def test_a_full_disk_below_standard_output_is_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        done = started("effects", stdout=full)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "no space left" in done.stderr


@pytest.mark.parametrize("command", ["identify", "diagnose", "effects"])
def test_a_folder_is_refused_before_the_work(tunnel: Tunnel, tmp_path: Path, command: str) -> None:
    words = [command] if command == "effects" else [command, tmp_path / "no campaign"]
    status, out, err = tunnel(*words, "--json", tmp_path)
    assert (status, out) == (2, "")
    assert err == f"tunnel: {tmp_path}: is a folder, not a file; name a file\n"


def test_a_column_with_an_empty_cell_is_not_said_of_all_rows() -> None:
    table = TextTable("Runs", ("run", "note", "rate"), (("a", "odd", "100 Hz"), ("b", "", "100 Hz")))
    narrow, shared = without_shared(table)
    assert narrow.columns == ("run", "note")
    assert narrow.rows == (("a", "odd"), ("b", ""))
    assert shared == "In all rows: rate 100 Hz"
