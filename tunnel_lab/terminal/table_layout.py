"""Tables in a terminal, in columns, or row by row if it is too narrow; or as CSV, Markdown or JSON."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby, zip_longest
from textwrap import wrap

from rich import box
from rich.cells import cell_len
from rich.table import Table as RichTable
from rich.text import Text

from identification.show.blocks import TextTable, as_markdown
from tunnel_lab.terminal.encoding import printable_json
from tunnel_lab.terminal.table_format import TableFormat
from tunnel_sim.vocabulary.text_cells import as_text_cell

PROSE = 30
"""Maximum width of a cell in columns: a longer cell is a sentence, which may be wrapped."""
_PADDING, _BETWEEN = 2, 1  # columns beside a cell, and between two cells
_FOLDED = 16  # minimum width of a folded first cell, in columns
_UNIT = re.compile(r"\[([^]]+)\]$")  # at the end of a heading
_NUMBER = re.compile(r"[+-]?\d+(\.\d+)?(e[+-]?\d+)?")


def rendered(table: TextTable, kind: TableFormat) -> str:
    """A table of texts as CSV, Markdown or JSON with a final line feed.

    In JSON numeric cells become numbers, and empty cells in columns of numbers become null.
    """
    if kind is TableFormat.MD:
        return as_markdown([table])
    title = _on_one_line(table.title)
    heads, *rows = [list(map(_on_one_line, row)) for row in (table.columns, *table.rows)]
    if kind is TableFormat.JSON:
        from tunnel_sim.files.writing import json_line

        numeric = [heading in table.right for heading in table.columns]
        records = [dict(zip(heads, map(_json_value, row, numeric), strict=True)) for row in rows]
        return printable_json(json_line({"table": title, "rows": records})) + "\n"
    stream = io.StringIO()
    stream.write(f"# {title}\n")
    texts = ([as_text_cell(cell) for cell in line] for line in (heads, *rows))
    csv.writer(stream, lineterminator="\n").writerows(texts)
    return stream.getvalue()


def _json_value(cell: str, numeric: bool) -> str | float | None:
    if not _NUMBER.fullmatch(cell):
        return None if numeric and not cell else cell
    return int(cell) if cell.isdecimal() else float(cell)


def _on_one_line(text: str) -> str:
    return " ".join(text.split())


def in_columns(table: TextTable, width: int) -> RichTable:
    """A table in columns, wide enough that only headings and sentences are wrapped; see `is_too_wide`."""
    natural = [
        max(cell_len(line) for cell in column for line in cell.split("\n"))
        for column in zip(table.columns, *table.rows, strict=True)
    ]
    fits = sum(natural) <= _room(table, width)
    result = RichTable(
        title=Text(table.title),
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_edge=False,
    )
    for heading, least in zip(table.columns, _least_widths(table), strict=True):
        head = (
            heading if fits else "\n".join(wrap(heading, least))
        )  # Rich would narrow columns of numbers as well
        # As text, not markup: units are in brackets. Folded, not cut, so that no digit is lost.
        result.add_column(
            Text(head),
            justify="right" if heading in table.right else "left",
            overflow="fold",
            min_width=least,
            no_wrap=heading in table.names,  # for copying
        )
    for row, after in zip_longest(table.rows, table.rows[1:]):
        is_end = after is not None and row[: table.sections] != after[: table.sections]
        result.add_row(*map(Text, row), end_section=is_end)
    return result


def is_too_wide(table: TextTable, width: int) -> bool:
    """Whether cells other than sentences, or words of a heading, would be broken at this width."""
    return _spare(table, width) < 0


def _spare(table: TextTable, width: int) -> int:
    """Columns left at this width; negative: number of missing columns."""
    return _room(table, width) - sum(_least_widths(table))


def _room(table: TextTable, width: int) -> int:
    """Columns for the cells of a row at this width."""
    return width - _PADDING * len(table.columns) - _BETWEEN * (len(table.columns) - 1)


def without_shared(table: TextTable) -> tuple[TextTable, str]:
    """A table without the columns whose cells are equal in all rows, and these in words; the first column stays."""
    if len(table.rows) < 2:
        return table, ""
    cells = list(zip(*table.rows, strict=True))
    kept = [at for at, column in enumerate(cells) if at == 0 or len(set(column)) > 1]
    shared = [
        f"{_on_one_line(table.columns[at])} {_on_one_line(max(column))}"
        for at, column in enumerate(cells)
        if at not in kept and max(column)
    ]
    rows = tuple(tuple(row[at] for at in kept) for row in table.rows)
    words = f"In all rows: {', '.join(shared)}" if shared else ""
    columns, sections = tuple(table.columns[at] for at in kept), sum(at < table.sections for at in kept)
    return replace(table, columns=columns, rows=rows, sections=sections), words


def sectioned(table: TextTable) -> TextTable | None:
    """A table with the names of each section in lines above its rows; None if no section has several rows."""
    places = list(range(table.sections))
    parts = [list(rows) for _, rows in groupby(table.rows, lambda row: row[: table.sections])]
    if not places or all(len(part) == 1 for part in parts):
        return None
    rows: list[tuple[str, ...]] = []
    for part in parts:
        for at in places:
            name = _named(table, at, part[0][at])
            rows.append((name, *[""] * (len(table.columns) - table.sections - 1)))
        rows += [(f"  {first}", *others) for first, *others in (row[table.sections :] for row in part)]
        rows.append(("",) * (len(table.columns) - table.sections))
    return replace(
        table, columns=("", *table.columns[table.sections + 1 :]), rows=tuple(rows[:-1]), sections=0
    )


def _named(table: TextTable, at: int, cell: str) -> str:
    """A cell above the others: a name, or a value with the unit of its heading."""
    unit = _UNIT.search(table.columns[at])
    if table.columns[at] in table.names:
        return cell
    return f"{cell} {unit[1]}" if unit else f"{_on_one_line(table.columns[at])} {cell}"


def folded(table: TextTable, width: int) -> TextTable | None:
    """A table with long first cells broken into lines to fit the width; None if that is not enough."""
    least = _least_widths(table)[0]
    room = least + _spare(table, width)
    if room < _FOLDED or table.columns[0] in table.names:
        return None
    rows = tuple(("\n".join(_broken(row[0], room)), *row[1:]) for row in table.rows)
    return replace(table, rows=rows)


def _broken(cell: str, room: int) -> list[str]:
    """A cell in lines of some width, broken at blanks; a longer word is broken at the last fitting mark."""
    lines = []
    for line in wrap(cell, room, break_long_words=False, break_on_hyphens=False) or [""]:
        left = line
        while cell_len(left) > room:
            marks = [mark.end() for mark in _MARK.finditer(left[:room])]
            at = marks[-1] if marks else room
            lines.append(left[:at])
            left = left[at:]
        lines.append(left)
    return lines


_MARK = re.compile(r"[-_./]")


def _least_widths(table: TextTable) -> list[int]:
    """Least width of each column: the longest word of its heading, line of a cell or word of a sentence."""
    return [
        max(
            (
                *map(cell_len, heading.split()),
                *(cell_len(part) for cell in cells for part in _unbroken(cell)),
            ),
            default=0,
        )
        for heading, *cells in zip(table.columns, *table.rows, strict=True)
    ]


def _unbroken(cell: str) -> list[str]:
    """The parts of a cell that are not wrapped: its lines, or the words of a sentence."""
    is_prose = any(cell_len(line) > PROSE for line in cell.splitlines())
    return cell.split() if is_prose else cell.splitlines()


def stacked(table: TextTable, width: int) -> str:
    """A table row by row: its first cell, and below it the others with their headings; empty cells are left out.

    Sentences are wrapped to the width of the terminal; words are never broken.
    """
    heads = list(map(_on_one_line, table.columns))
    lines = [table.title]
    for first, *others in table.rows:
        named = [(head, cell) for head, cell in zip(heads[1:], others, strict=True) if cell]
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
    """Lines of a text after a prefix; later lines are indented by the length of the prefix."""
    room = max(width - cell_len(prefix), PROSE)
    lines = [part for line in text.splitlines() for part in wrap(line, room, break_long_words=False)]
    for number, line in enumerate(lines or [""]):
        yield f"{prefix if number == 0 else ' ' * cell_len(prefix)}{line}".rstrip()
