"""Tables and paragraphs as plain text for a console and as HTML for a notebook."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from itertools import zip_longest

WIDTH = 88
"""Paragraphs are wrapped to this many characters."""


@dataclass(frozen=True)
class TextTable:
    """A table whose cells are texts.

    Args:
        columns: headings, with their units.
        rows: one text for each column; lines of a cell are separated by line ends.
        right: those headings whose columns are aligned to the right.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    right: tuple[str, ...] = ()

    def text(self) -> str:
        """The table in columns of a fixed width, with a rule below the headings."""
        widths = [
            max(len(line) for cell in column for line in cell.split("\n"))
            for column in zip(self.columns, *self.rows, strict=True)
        ]
        rule = "-" * (sum(widths) + 2 * (len(widths) - 1))
        body = [self._lines(row, widths) for row in self.rows]
        return "\n".join([self.title, self._lines(self.columns, widths), rule, *body])

    def html(self) -> str:
        """The table as an HTML element."""
        head = "".join(self._cell("th", heading, heading) for heading in self.columns)
        rows = ("".join(map(self._cell, ("td",) * len(row), row, self.columns)) for row in self.rows)
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return (
            f"<table><caption>{escape(self.title)}</caption>"
            f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        )

    def _lines(self, row: tuple[str, ...], widths: list[int]) -> str:
        """One row, on as many lines as its tallest cell has."""
        lines = zip_longest(*(cell.split("\n") for cell in row), fillvalue="")
        return "\n".join(
            "  ".join(
                text.rjust(width) if heading in self.right else text.ljust(width)
                for text, width, heading in zip(line, widths, self.columns, strict=True)
            ).rstrip()
            for line in lines
        )

    def _cell(self, tag: str, text: str, heading: str) -> str:
        side = "right" if heading in self.right else "left"
        style = f"text-align: {side}; padding: 0.15em 0.8em"
        return f'<{tag} style="{style}">{escape(text).replace(chr(10), "<br>")}</{tag}>'


def as_text(parts: Iterable[str | TextTable]) -> str:
    """Paragraphs and tables as plain text, with an empty line around each table.

    Args:
        parts: in their order; tables without rows are left out.

    Returns:
        The text, without a line end at its end.
    """
    blocks = [
        f"\n{part.text()}\n" if isinstance(part, TextTable) else textwrap.fill(part, WIDTH)
        for part in _filled(parts)
    ]
    return "\n".join(blocks).strip("\n").replace("\n\n\n", "\n\n")


def as_html(parts: Iterable[str | TextTable]) -> str:
    """Paragraphs and tables as HTML.

    Args:
        parts: in their order; tables without rows are left out.

    Returns:
        One ``div``.
    """
    blocks = [
        part.html() if isinstance(part, TextTable) else f"<p>{escape(part)}</p>" for part in _filled(parts)
    ]
    return f"<div>{''.join(blocks)}</div>"


def _filled(parts: Iterable[str | TextTable]) -> list[str | TextTable]:
    return [part for part in parts if (part.rows if isinstance(part, TextTable) else part)]
