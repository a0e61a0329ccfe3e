"""The README: its excerpts are those of the how-to pages, and its files can be read."""

from __future__ import annotations

import io
import re
import shlex
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from docs.studies.quotes import BLOCK, difference, last_digit, outputs, quotes, refreshed
from tunnel_lab.cli import main

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
HOW_TO = ROOT / "docs" / "how-to"
BLOCKS = BLOCK.findall(README)


def blocks(kind: str) -> list[str]:
    return [text for language, text in BLOCKS if language == kind]


def toml_block(key: str) -> str:
    (found,) = [text for text in blocks("toml") if key in text]
    return found


def output_of(command: str, folder: Path) -> list[str]:
    program, *arguments = shlex.split(command)
    assert program == "tunnel"
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setenv("COLUMNS", "80")
        patch.setenv("NO_COLOR", "1")
        patch.chdir(folder)
        status = main(arguments)
    assert status == 0, err.getvalue()
    return out.getvalue().splitlines()


def sessions(text: str) -> list[tuple[str, list[str]]]:
    """What is typed and shown in the console blocks of a page."""
    return [(one.source, one.shown.splitlines()) for one in quotes(text) if one.console]


def test_excerpts_are_the_beginning_of_what_the_how_to_pages_show() -> None:
    whole = dict(session for page in HOW_TO.glob("*.md") for session in sessions(page.read_text("utf-8")))
    typed = [command.split()[1] for command, _ in sessions(README)]
    assert sorted(typed) == ["diagnose", "simulate"]
    for command, shown in sessions(README):
        assert shown[-1] == "…" or shown == whole[command]
        shown = [line for line in shown if line != "…"]
        assert shown == whole[command][: len(shown)]


def test_the_readme_shows_no_number_of_other_answers() -> None:
    """It grows with every effect that is added."""
    assert not any("more, together" in line for _, shown in sessions(README) for line in shown)


def as_printed(shown: list[str], real: list[str]) -> bool:
    """Whether lines are the same, up to the last digit of decimals, which another processor may round otherwise."""
    decimal = re.compile(r"[-+]?\d+\.\d+(?:e[-+]\d+)?")
    shown, real = ([line.rstrip() for line in lines] for lines in (shown, real))
    if [decimal.sub("#", line) for line in shown] != [decimal.sub("#", line) for line in real]:
        return False
    pairs = zip(decimal.findall("\n".join(shown)), decimal.findall("\n".join(real)), strict=True)
    return all(abs(float(a) - float(b)) <= 1.001 * max(last_digit(a), last_digit(b)) for a, b in pairs)


def test_the_console_shows_what_the_program_prints(tmp_path: Path) -> None:
    """Where it fails, its message holds the lines to put into the README and the page that shows the whole."""
    (tmp_path / "plan.toml").write_text(toml_block("wind_speeds"), encoding="utf-8")
    for command, shown in sessions(README):
        real = output_of(command, tmp_path)
        lines = shown[: shown.index("…")] if "…" in shown else shown
        wanted = real[: len(lines)] if "…" in shown else real
        text = "\n".join(line.rstrip() for line in wanted)
        assert as_printed(lines, wanted), f"README.md, and docs/how-to: `{command}` now prints\n{text}"


def test_that_comparison_can_fail() -> None:
    assert as_printed([" gap  0.184 ", "12 more"], [" gap  0.185", "12 more"])
    for other in (
        [" gap  0.186", "12 more"],
        [" gap  0.184", "11 more"],
        [" gap 0.184", "12 more"],
        [" gap  0.184"],
    ):
        assert not as_printed([" gap  0.184", "12 more"], other)


@pytest.mark.slow
def test_the_script_for_a_newcomer_runs_and_prints_what_is_shown(tmp_path: Path) -> None:
    (script,) = blocks("python")
    assert len(script.splitlines()) <= 10
    assert refreshed(README, outputs(README, tmp_path)) == README
    assert (tmp_path / "fit.png").stat().st_size > 10_000
    assert "</html>" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_readme_is_two_screens_long() -> None:
    assert len(README.splitlines()) <= 120


def test_the_comparison_can_fail() -> None:
    assert not difference(["Cnr -0.1033 ± 0.0012"], ["Cnr   -0.1034 ± 0.0011  "])
    for other in ("Cnr -0.1043 ± 0.0012", "Cnb -0.1033 ± 0.0012", "Cnr -0.1033 ± 0.0012 1"):
        assert difference(["Cnr -0.1033 ± 0.0012"], [other])
    assert difference(["one"], ["one", "two"])


def test_there_are_two_set_up_commands_of_one_line() -> None:
    commands = [text.strip() for text in blocks("bash") if ".venv" in text]
    assert len(commands) == 2
    assert all(
        "\n" not in command and command.startswith("python3 -m venv .venv && ") for command in commands
    )
    assert commands[0].endswith(" && .venv/bin/tunnel demo")
    assert commands[1].endswith(" && .venv/bin/python -m pytest")


def test_ci_takes_the_test_command_from_here() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    pattern = re.search(r"grep -E '(.*)' README\.md", script)
    assert pattern is not None
    assert len(re.findall(pattern[1], README, re.MULTILINE)) == 1
    others = script.replace(pattern[1], "").replace('"-m pytest" is the command', "").splitlines()
    assert all(line.endswith(" tests/fuzz") for line in others if "-m pytest" in line)  # none runs the suite


def test_the_plan_shown_can_be_simulated(tmp_path: Path) -> None:
    from tunnel_sim.files.plan_file import load_plan

    (tmp_path / "plan.toml").write_text(toml_block("wind_speeds"), encoding="utf-8")
    assert len(load_plan(tmp_path / "plan.toml").conditions) == 4


def test_the_measured_campaign_shown_can_be_read(tmp_path: Path) -> None:
    from tunnel_sim.files.campaign_folder import read_campaign

    (tmp_path / "campaign.toml").write_text(toml_block("first-swing"), encoding="utf-8")
    (tmp_path / "runs").mkdir()
    time = np.arange(0.0, 6.0, 0.01)
    rows = (f"{t:.2f},{0.2 * np.exp(-0.1 * t) * np.cos(6.0 * t):.5f}" for t in time)
    (tmp_path / "runs" / "first-swing.csv").write_text("time_s,yaw_rad\n" + "\n".join(rows) + "\n")
    assert [run.id for run in read_campaign(tmp_path).runs] == ["first-swing"]
