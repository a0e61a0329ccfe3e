"""The first page of the site and the gallery: their commands exist, their code runs, and no figure is left out."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer.main

from docs.studies.quotes import BLOCK, printed
from tunnel_lab.cli import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
IMAGE = re.compile(r"!\[[^]]*\]\((?:\.\./)*(?:docs/)?images/([\w.-]+)\)")
TYPED = [
    line
    for name in ("index.md", "gallery.md")
    for kind, text in BLOCK.findall((DOCS / name).read_text(encoding="utf-8"))
    if kind == "bash"
    for line in text.splitlines()
]


def unknown(typed: str) -> list[str]:
    """Words of a line that the command line does not know: the command, or one of its options."""
    program, *words = shlex.split(typed)
    command: Any = typer.main.get_command(app)
    assert program == "tunnel"
    while words and hasattr(command, "commands"):
        name = words.pop(0)
        if name not in command.commands:
            return [name]
        command = command.commands[name]
    known = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    return [word for word in words if word.startswith("-") and word not in known]


@pytest.mark.parametrize("typed", [line for line in TYPED if line.startswith("tunnel ")])
def test_the_commands_exist(typed: str) -> None:
    assert unknown(typed) == []


def test_a_command_that_does_not_exist_is_found() -> None:
    assert unknown("tunnel diagnoze x") == ["diagnoze"]
    assert unknown("tunnel blind make x --counts 3") == ["--counts"]


@pytest.mark.parametrize("typed", [line for line in TYPED if line.startswith("python -m ")])
def test_the_modules_exist(typed: str) -> None:
    module = ROOT.joinpath(*typed.split()[2].split("."))
    assert module.with_suffix(".py").is_file() or (module / "__main__.py").is_file()


def test_the_code_of_the_first_page_runs(tmp_path: Path) -> None:
    (code,) = [
        text for kind, text in BLOCK.findall((DOCS / "index.md").read_text("utf-8")) if kind == "python"
    ]
    assert printed([code], tmp_path) == [""]


def test_the_gallery_has_every_figure_that_a_page_shows() -> None:
    shown = {page: set(IMAGE.findall(page.read_text(encoding="utf-8"))) for page in DOCS.glob("**/*.md")}
    gallery = shown.pop(DOCS / "gallery.md")
    elsewhere = set().union(*shown.values())
    dark = {name for name in elsewhere if name.endswith("-dark.png")}
    assert elsewhere - dark - gallery == set()
    assert all((DOCS / "images" / name).is_file() for name in gallery)
