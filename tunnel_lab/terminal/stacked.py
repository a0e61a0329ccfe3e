"""Tables for narrow terminals: every row as a block of lines, so that no number or word is broken."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap
from typing import TYPE_CHECKING

from rich.cells import cell_len

if TYPE_CHECKING:
    from rich.table import Column, Table

PROSE = 30
"""Columns: a longer cell is a sentence, which may go over several lines."""
_PADDING, _BETWEEN = 2, 1  # columns beside a cell, and between two


def is_too_wide(table: Table, width: int) -> bool:
    """Whether cells other than sentences, or words of a heading, would be broken.

    Args:
        width: of the terminal, columns (count).
    """
    needed = sum(_least_width(column) + _PADDING for column in table.columns)
    return needed + _BETWEEN * (len(table.columns) - 1) > width


def keep_whole(table: Table) -> Table:
    """The same table, with columns so wide that only headings and sentences are wrapped."""
    for column in table.columns:
        column.min_width = _least_width(column)
    return table


def _least_width(column: Column) -> int:
    words = map(cell_len, str(column.header).split())
    return max((*words, *map(_unbroken, column.cells)), default=0)


def _unbroken(cell: object) -> int:
    """Columns that a cell takes: its longest line, or the longest word of a sentence."""
    longest = max(map(cell_len, str(cell).splitlines()), default=0)
    return longest if longest <= PROSE else max(map(cell_len, str(cell).split()))


def stacked(table: Table, width: int) -> str:
    """A table row by row: its first cell, and below it the others with their headings; empty ones are left out.

    Args:
        width: of the terminal, columns (count); sentences are wrapped, words are never broken.
    """
    heads = [" ".join(str(column.header).split()) for column in table.columns]
    lines = [str(table.title or "")]
    for first, *others in zip(*(column.cells for column in table.columns), strict=True):
        named = [(head, str(cell)) for head, cell in zip(heads[1:], others, strict=True) if str(cell)]
        if len(heads) == 2:
            named, first = [], f"{first}: {others[0]}"
        else:
            first = f"{heads[0]} {first}"
        lines += _wrapped(first, " ", width)
        room = max((cell_len(head) for head, _ in named), default=0)
        for head, cell in named:
            lines += _wrapped(cell, f"   {head}{' ' * (room - cell_len(head))}  ", width)
    return "\n".join(lines)


def _wrapped(text: str, prefix: str, width: int) -> Iterator[str]:
    """Lines of a text after a prefix, the later ones indented as far."""
    room = max(width - cell_len(prefix), PROSE)
    lines = [part for line in text.splitlines() for part in wrap(line, room, break_long_words=False)]
    for number, line in enumerate(lines or [""]):
        yield f"{prefix if number == 0 else ' ' * cell_len(prefix)}{line}".rstrip()
