"""Help texts are shown as written, options are named alike in all commands, files have the format of their name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main

from tests.support.command import Tunnel
from tunnel_lab.cli import app

ROOT = Path(__file__).parents[4]
PACKAGES = ("tunnel_lab", "tunnel_sim", "identification", "diagnosis")
BRACKETS = re.compile(r"\[[^\[\]\n]*\]")
HEADINGS = ("[bold]", "[/bold]")


def commands(command: Any = None, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command and its path, that of ``tunnel`` itself empty."""
    command = command or typer.main.get_command(app)
    yield path, command
    for name, own in getattr(command, "commands", {}).items():
        yield from commands(own, (*path, name))


COMMANDS = dict(commands())
"""As declared: what a help text has to show."""


def bracketed(command: Any) -> list[str]:
    """Words in brackets of a command's help and of the help of its options, without headings."""
    texts = [command.help or "", *(getattr(parameter, "help", None) or "" for parameter in command.params)]
    return [found for text in texts for found in BRACKETS.findall(text) if found not in HEADINGS]


def option_names(*, hidden: bool) -> set[str]:
    return {
        name
        for command in COMMANDS.values()
        for parameter in command.params
        if parameter.param_type_name == "option" and parameter.hidden == hidden
        for name in (*parameter.opts, *parameter.secondary_opts)
    } | {"--help"}


def test_some_help_has_brackets() -> None:
    assert "[drive]" in bracketed(COMMANDS["simulate",])
    assert "[repeatability]" in bracketed(COMMANDS["blind", "make"])


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_every_bracket_in_a_help_text_is_shown(
    tunnel: Tunnel, path: tuple[str, ...], monkeypatch: Any
) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    _, out, _ = tunnel(*path, "--help")
    assert [found for found in bracketed(COMMANDS[path]) if found not in out] == []
    assert "\\[" not in out
    assert not any(heading in out for heading in HEADINGS)


def test_no_option_is_hidden() -> None:
    assert option_names(hidden=True) == {"--help"}


OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+\b(?!-?[*{])")


def named_options() -> Iterator[tuple[str, str]]:
    """File and option of every option that a text of the program names; docstrings of commands are among them."""
    for package in PACKAGES:
        for file in (ROOT / package).rglob("*.py"):
            text = file.read_text(encoding="utf-8")
            for node in ast.walk(ast.parse(text)) if OPTION.search(text) else ():
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    for name in OPTION.findall(node.value):
                        yield file.relative_to(ROOT).as_posix(), name


def test_every_option_that_a_text_names_is_in_a_help() -> None:
    named = set(named_options())
    assert len(named) > 100
    foreign = {
        "tunnel_lab/report/page.py": {"--"},  # all: of Chromium
        "tunnel_lab/commands/about.py": {"--keep-going", "--version"},  # of Sphinx and of a compiler
        "tunnel_lab/bench/parts.py": {"--link"},  # a variable of the style sheet
    }
    known = option_names(hidden=False)
    assert {
        (file, name)
        for file, name in named
        if name not in known and not foreign.get(file, set()) & {name, "--"}
    } == set()


def test_a_format_is_that_of_tables_in_every_command() -> None:
    helps = {
        parameter.help
        for command in COMMANDS.values()
        for parameter in command.params
        if "--format" in parameter.opts
    }
    assert len(helps) == 1
    assert "Format of the tables" in helps.pop()


def test_a_number_of_processes_is_called_jobs() -> None:
    helps = {
        name: parameter.help
        for command in COMMANDS.values()
        for parameter in command.params
        for name in parameter.opts
        if re.search(r"[Pp]rocesses|at the same time", getattr(parameter, "help", None) or "")
    }
    assert set(helps) == {"--jobs"}


def test_a_bench_of_a_folder_that_is_not_there_makes_none(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: Any
) -> None:
    served: list[Any] = []
    monkeypatch.setattr("tunnel_lab.bench.server.serve", lambda *given, **_: served.append(given))
    status, out, err = tunnel("bench", tmp_path / "nofolder", "--no-browser")
    assert (status, out, served) == (2, "", [])
    assert f"mkdir -p {tmp_path / 'nofolder'}" in err
    assert list(tmp_path.iterdir()) == []
    assert tunnel("bench", tmp_path, "--no-browser")[0] == 0
    assert len(served) == 1
