"""Output of commands: blocks and lines, unchanged and in the chosen format."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from textwrap import fill

from rich.console import Console
from rich.style import Style
from rich.text import Text

from identification.show.blocks import Block, TextTable, brief, lines
from tunnel_lab.terminal.table_format import TableFormat, chosen, quiet
from tunnel_lab.terminal.table_layout import (
    folded,
    in_columns,
    is_too_wide,
    rendered,
    sectioned,
    stacked,
    without_shared,
)


class _Console(Console):
    """A console that leaves a closed pipe to ``main``."""

    def on_broken_pipe(self) -> None:
        """Pass the error on; Rich itself would exit with status 1."""
        raise BrokenPipeError


def console(*, stderr: bool = False) -> Console:
    """A console that prints text unchanged, without highlighting and markup, or not at all with ``--quiet``."""
    return _Console(stderr=stderr, quiet=quiet.get(), highlight=False, markup=False, emoji=False)


def say(line: str, *, stderr: bool = False) -> None:
    """Print one line unchanged, so that paths can be copied; on standard error if tables are not text."""
    console(stderr=stderr or chosen.get() is not TableFormat.TEXT).print(line, soft_wrap=True)


def say_sentence(line: str) -> None:
    """Print one line, wrapped at words in a terminal; no word is broken, so that paths can be copied."""
    out = console(stderr=chosen.get() is not TableFormat.TEXT)
    if out.is_terminal:
        line = fill(line, out.width, break_long_words=False, break_on_hyphens=False)
    out.print(line, soft_wrap=True)


def say_written(*paths: Path | None, more: str = "", picture: Path | None = None) -> None:
    """Print the paths of the written files, in a terminal as links that open them.

    Args:
        paths: paths; None is left out.
        more: words after a path, in brackets.
        picture: path of a file that shows the content; it ends the line.
    """
    for path in filter(None, paths):
        line = Text("Written: ").append_text(_link(path))
        if more or picture:
            line.append(f" ({more}")
            if picture is not None:
                line.append(", ").append_text(_link(picture)).append(" shows them")
            line.append(")")
        console(stderr=chosen.get() is not TableFormat.TEXT).print(line, soft_wrap=True)


def _link(path: Path) -> Text:
    """A path as a link (OSC 8); a terminal without support for links prints the path alone."""
    return Text(str(path), Style(link=path.resolve().as_uri()))


def show(blocks: Iterable[Block]) -> None:
    """Print blocks without figures and details; an empty line stands before and after a table."""
    after_line = False
    for block in brief(blocks):
        if isinstance(block, TextTable):
            if after_line:
                say("")
            _show_table(block)
        for line in lines(block):
            say_sentence(line)
        after_line = not isinstance(block, TextTable)


def _show_table(table: TextTable) -> None:
    """Print a table in the format of ``--format``; a text table wider than the terminal is printed row by row."""
    out, kind = console(), chosen.get()
    if kind is not TableFormat.TEXT:
        out.print(rendered(table, kind), soft_wrap=True, end="")
    elif not is_too_wide(table, out.width):
        out.print(in_columns(table, out.width))
    else:
        narrow, shared = without_shared(table)
        fitting = next(
            (one for one in (narrow, sectioned(narrow)) if one and not is_too_wide(one, out.width)),
            folded(narrow, out.width),
        )
        if fitting is None:
            out.print(stacked(table, out.width), soft_wrap=True)
        else:
            out.print(in_columns(fitting, out.width))
            out.print(shared, end="\n" if shared else "")
    if kind is not TableFormat.JSON:
        out.print()
