"""The command line: how it ends, what it says, and what it leaves behind."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.support.command import Outcome, Tunnel
from tunnel_lab import cli
from tunnel_sim.vocabulary.errors import TunnelError

COMMANDS = tuple(cli.COMMANDS)


def assert_refused(outcome: Outcome, *parts: str) -> None:
    """Exit status 2, one line on standard error with these parts, nothing on standard output."""
    status, out, err = outcome
    assert status == 2, err
    assert out == ""
    assert err.startswith("tunnel: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    for part in parts:
        assert part in err


def test_no_command_shows_the_help(tunnel: Tunnel) -> None:
    status, out, err = tunnel()
    assert (status, err) == (0, "")
    assert "tunnel COMMAND --help" in out


def test_the_help_shows_every_command_once_below_its_group(tunnel: Tunnel) -> None:
    _, out, _ = tunnel("--help")
    shown: dict[str, list[str]] = {}
    for line in out.splitlines():
        if heading := re.match(r"╭─ (.+?) ─", line):
            group = shown.setdefault(heading[1], [])
        elif row := re.match(r"│ ([a-z]+) +\S", line):
            group.append(row[1])
    assert shown.pop("Options") == []
    assert shown == {group: list(members) for group, members in cli.GROUPS.items()}
    assert next(iter(shown.items())) == ("Start here", ["demo", "bench", "import", "diagnose", "simulate"])
    names = [name for members in shown.values() for name in members]
    assert sorted(names) == sorted(set(names)) == sorted([*COMMANDS, "blind"])
    assert not any(re.search(rf"\btunnel {name}\b", out) for name in names)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(tunnel: Tunnel, command: str) -> None:
    status, out, err = tunnel(command, "--help")
    assert (status, err) == (0, "")
    assert re.search(r"Examples\s+tunnel " + command, out)
    assert re.search(r"Exit status\s+0 \w+, .*2 bad", " ".join(out.split()))


def test_the_version_is_the_distributions(tunnel: Tunnel) -> None:
    assert tunnel("--version") == (0, f"tunnel {version('virtual-wind-tunnel')}\n", "")


def test_the_package_runs_as_a_module_from_the_tree() -> None:
    tree = Path(cli.__file__).parents[1]
    words = [sys.executable, "-m", "tunnel_lab", "--version"]
    done = subprocess.run(words, cwd=tree, capture_output=True, text=True, check=True)
    assert done.stdout == f"tunnel {version('virtual-wind-tunnel')}\n"


def test_a_message_of_several_lines_becomes_one(tunnel: Tunnel, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise TunnelError("two\nlines", where="here", remedy="join\n\n them")

    monkeypatch.setattr("tunnel_lab.commands.paper.show_springs", refuse)
    assert_refused(tunnel("springs"), "here: two lines; join them")


def test_an_error_of_the_disk_is_one_line(tunnel: Tunnel, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied", "secret.csv")

    monkeypatch.setattr("tunnel_lab.commands.paper.show_springs", refuse)
    assert_refused(tunnel("springs"), "secret.csv: permission denied")


def test_ctrl_c_ends_with_130_and_one_line() -> None:
    """A real process, interrupted by a real signal once it is inside a command."""
    script = (
        "import sys, time\n"
        "from tunnel_lab import cli\n"
        "from tunnel_lab.commands import paper\n"
        "def wait(*_):\n"
        "    print('ready', flush=True)\n"
        "    time.sleep(60)\n"
        "paper.show_springs = wait\n"
        "sys.exit(cli.main(['springs']))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert out == ""
    assert err.strip().startswith("tunnel: interrupted")
    assert len(err.strip().splitlines()) == 1


def test_a_closed_pipe_is_no_error() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "tunnel_lab.cli", "springs"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        err = process.stderr.read()
    assert (process.returncode, err) == (0, "")


def processor_time(script: str) -> tuple[float, subprocess.CompletedProcess[str]]:
    """The least of three, s: what the machine does besides is not the script's."""
    seconds = []
    for _ in range(3):
        before = os.times()
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        after = os.times()
        seconds.append(sum(after[2:4]) - sum(before[2:4]))
    return min(seconds), done


def test_help_imports_nothing_heavy_and_takes_hardly_longer_than_any_help() -> None:
    heavy = "{'mujoco', 'torch', 'matplotlib', 'scipy', 'polars', 'pydantic', 'gymnasium', 'numpy'}"
    script = (
        "import sys\n"
        "from tunnel_lab.cli import main\n"
        "main(['--help'])\n"
        f"print(sorted({heavy} & set(sys.modules)), file=sys.stderr)\n"
    )
    bare = (
        "import typer\n"
        "app = typer.Typer()\n"
        "app.command()(lambda: None)\n"
        "app(['--help'], standalone_mode=False)\n"
    )
    seconds, done = processor_time(script)
    assert done.stderr == "[]\n"
    assert "Start here" in done.stdout
    assert seconds < 2.5 * processor_time(bare)[0]


def test_a_shell_completes_commands(tunnel: Tunnel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_TUNNEL_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "tunnel ident")
    monkeypatch.setenv("COMP_CWORD", "1")
    assert tunnel()[:2] == (0, "identify\n")


@pytest.mark.parametrize("command", ["import", "diagnose"])
def test_options_stand_in_groups_with_room_for_their_descriptions(
    tunnel: Tunnel, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    _, out, _ = tunnel(command, "--help")
    heads = [re.sub(r"[╭─╮ ]+", " ", line).strip() for line in out.splitlines() if line.startswith("╭")]
    assert len(heads) >= 5
    assert heads[-1] == "As for every command"
    panel: list[str] = []
    for line in out.splitlines():
        if line.startswith("│"):
            panel.append(line)
        elif panel:
            # every description of a panel begins in the column where that of its first option does
            blanked = re.sub(r"--\S+|<\S+>|[A-Z][\w,.]*(?=  )", lambda m: " " * len(m[0]), panel[0])
            begins = re.search(r"[A-Z]", blanked)
            assert begins is not None, panel
            assert len(panel[0]) - begins.start() - 2 > 30, panel
            panel = []
