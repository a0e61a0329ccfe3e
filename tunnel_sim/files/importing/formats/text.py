"""Tables as text in any dialect: delimiter, decimal sign, encoding and head are found from the content."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import polars as pl

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.condition_names import mentions_wind
from tunnel_sim.files.importing.formats.cells import (
    MISSING,
    as_numbers,
    in_parts,
    is_missing,
    is_number,
    like_number,
    seconds_of_day,
    unread_in,
    without_short_tables,
    without_thousands,
)
from tunnel_sim.files.importing.tables import LEAST_ROWS, Channel, Table, by_texts, hold_order, names_runs
from tunnel_sim.files.importing.units import UNITS, kind_of, known_unit, split_unit, unit_beside
from tunnel_sim.files.readers import Reader
from tunnel_sim.files.reading import check_count, check_lines, check_utf8, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, one_line, shown

_FACT = re.compile(
    r"(?:^|[,;|\t])\W*([^\W\d_](?:[^\d:=,;\t]|(?<=[^\W_])\d|(?<=\^)-?\d)*?)\s*[:=,;\t]\s*"
    r"(?:([^\s\d:=,;\t|][^:=,;\t|]{0,14}?)\s*[;,\t]\s*)?([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)"
    r"(?!\d|[.:/-]\d) *([;,\t]? *[^\s\d;,\t|=:][^;,\t|=:]*(?![^;,\t|]))?"
)
"""A name, perhaps a cell with its unit, a number, and its unit, perhaps in the next cell; not a date or time."""
_HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}
_SI = {kind: next(unit for unit, factor in units.items() if factor == 1.0) for kind, units in UNITS.items()}
_AXIS = re.compile(r"(?i)\W*(horizontal|vertical) units?\s*[,:;=\t]\s*(.+)$")
_COUNTS = ("sequence", "points")  # beside units: the column counts samples
_LONG_UNIT = 8  # characters: a longer text is a name


@dataclass(frozen=True)
class Layout:
    """The head of a sheet: its first row of numbers, its columns, and numbers stated above, in SI units.

    Args:
        beside: indices of columns that hold the header of others, as in the files of some oscilloscopes.
    """

    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    headed: bool
    facts: Mapping[str, float]
    beside: tuple[int, ...] = ()

    @property
    def runs(self) -> int | None:
        """Index of the column that gives the run of a row."""
        columns = enumerate(zip(self.names, self.units, strict=True))
        return next((i for i, (name, unit) in columns if names_runs(name) and not unit), None)


def facts_in(lines: Sequence[str]) -> dict[str, float]:
    """Numbers stated in lines, such as ``Sample rate: 1000 Hz`` or ``V = 54 km/h``, by name and unit.

    Returns:
        Values in SI units if the unit is known; the name then ends with it in brackets. NaN for a name with
        several numbers: which of them belongs to a run is not known.
    """
    facts: dict[str, float] = {}
    for line in (line.replace('"', "") for line in lines if len(line) <= _LONG_LINE):
        for name, before, number, behind in _FACT.findall(line):
            name = name.strip()
            if before and known_unit(before) is None:  # a cell with the name, after a heading
                name, before = before, ""
            text = (before or behind.lstrip(";,\t ")).strip("()[] ")
            unit, value = known_unit(text), float(number.replace(",", "."))
            if unit is not None:
                text, value = _SI[kind_of(unit)], value * UNITS[kind_of(unit)][unit]
            elif text.lower() in _HERTZ:
                text, value = "", value * _HERTZ[text.lower()]
            heading = f"{name} ({text})" if text else name
            facts[heading] = value if facts.get(heading, value) == value else float("nan")
    return facts


def find_layout(
    rows: Sequence[Sequence[str]], lines: Sequence[str], decimal: str, width: int
) -> Layout | None:
    """Names, units and the first row of numbers of a sheet, given the cells and lines of its head; or None."""
    tail = [row for row in rows[len(rows) // 2 :] if any(cell for cell in row)]
    # a column with both signs has no separators of thousands
    other = "." if decimal == "," else ","
    pointed = {
        i
        for row in rows
        for i, cell in enumerate(row)
        if is_number(cell, other) and not like_number(cell, decimal)
    }

    def is_read(cell: str, column: int) -> bool:
        return is_number(cell, decimal) or (column not in pointed and like_number(cell, decimal))

    numeric = [
        column
        for column in range(width)
        if 2 * sum(column < len(row) and is_read(row[column], column) for row in tail) > len(tail)
    ]

    def is_data(row: Sequence[str]) -> bool:
        cells = [(row[column] if column < len(row) else "", column) for column in numeric]
        filled = sum(is_read(*cell) for cell in cells)
        return filled > 0 and all(is_read(*cell) or is_missing(cell[0]) for cell in cells)

    starts = [i for i in range(len(rows)) if all(map(is_data, rows[i : i + 3]))]
    headings = [i for i, row in enumerate(rows) if len(row) > 1 and _is_heading(row, numeric, decimal)]
    first = next(iter(starts), None)
    if first is None:
        return None
    # a short table above the record has another heading below it
    for heading in (i for i in headings if i > first):
        following = next((i for i in starts if i > heading), None)
        if following is None or sum(map(is_data, rows[first:heading])) >= LEAST_ROWS:
            break
        first = following
    above = []  # the rows that may name every column
    for index, row in enumerate(rows[:first]):
        cells = [cell.strip().strip('"').strip() for cell in row]
        if cells:
            cells[0] = cells[0].lstrip("#%!*/;").strip()
        while len(cells) > width and not cells[-1]:
            cells.pop()
        texts = [cell for cell in cells if cell and not is_number(cell, decimal)]
        if len(cells) <= width and 2 * len(texts) >= width and (width <= 1 or len(texts) > 1):
            above.append((index, cells + [""] * (width - len(cells))))
    units, numbers = _units_row(above, width, decimal)
    names = list(above[-1][1]) if above else []
    split = [split_unit(name) for name in names]
    named = [name or f"column {i + 1}" for i, (name, _) in enumerate(split)]
    stated = list(lines[: above[-1][0] if above else first])
    beside: tuple[int, ...] = ()
    if not names:
        beside, found = _beside(rows, numeric)
        stated += found
    given = [one or own for (_, one), own in zip(split or [("", "")] * width, units, strict=True)]
    return Layout(
        first,
        tuple(distinct(named)) or tuple(f"column {i + 1}" for i in range(width)),
        tuple(_of_scope(stated, given, numeric)),
        bool(names),
        facts_in(stated) | numbers,
        beside,
    )


def _is_heading(row: Sequence[str], numeric: Sequence[int], decimal: str) -> bool:
    """Whether a row names every column of numbers."""
    cells = [row[i].strip(' "') if i < len(row) else "" for i in numeric]
    return len(set(cells)) > 1 and all(cell and not like_number(cell, decimal) for cell in cells)


def _units_row(
    above: list[tuple[int, list[str]]], width: int, decimal: str
) -> tuple[list[str], dict[str, float]]:
    """The units in the last of the rows that may name columns, and numbers there; it is removed if it states them.

    Known units, or others in brackets; or more known units than short texts. Numbers stand below their names.
    """
    units = [""] * width
    stated = [cell for cell in above[-1][1] if cell.strip("-")] if len(above) > 1 else []
    numbers = [cell for cell in stated if is_number(cell, decimal)]
    stated = [cell for cell in stated if cell not in numbers and cell.lower() not in _COUNTS]
    known = [cell for cell in stated if known_unit(cell) is not None]
    bare = [cell for cell in stated if cell not in known and not re.fullmatch(r"[\[({].*[\])}]", cell)]
    few = len(known) > len(bare) and all(len(cell) <= _LONG_UNIT for cell in bare)
    if not known or (bare and not few):
        return units, {}
    beside = above.pop()[1]
    pairs = list(zip(above[-1][1], beside, strict=True))
    facts = {name: float(cell.replace(",", ".")) for name, cell in pairs if name and cell in numbers}
    return ["" if cell in numbers else unit_beside(name, cell) for name, cell in pairs], facts


def _beside(rows: Sequence[Sequence[str]], numeric: Sequence[int]) -> tuple[tuple[int, ...], list[str]]:
    """Columns that hold a header beside the first rows of numbers, and their lines; empty: there are none."""
    columns = [i for i in range(numeric[-1]) if i not in numeric]
    blocks = [[i for i in columns if i < end] for end in (i for i in numeric if i - 1 in columns)]
    found: list[int] = []
    lines = []
    for block in blocks:
        block = [i for i in block if i not in found]
        texts = [[row[i].strip() for i in block if i < len(row)] for row in rows]
        filled = [index for index, cells in enumerate(texts) if any(cells)]
        pairs = [cells for cells in texts if len(cells) > 1 and cells[0] and any(cells[1:])]
        if filled and 2 * filled[-1] < len(rows) and 2 * len(pairs) >= len(filled):
            lines += [",".join(filter(None, cells)) for cells in pairs]
            found += block
    return tuple(found), lines


def _of_scope(lines: Sequence[str], units: Sequence[str], numeric: Sequence[int]) -> list[str]:
    """The units of columns; if they have none, from an oscilloscope's statements for both axes."""
    stated: dict[str, list[str]] = {}
    for line in lines:
        found = _AXIS.match(line.replace('"', ""))
        if found is not None:
            cells = [cell.strip() for cell in re.split(r"[,;\t]", found[2]) if cell.strip()]
            stated.setdefault(found[1].lower(), []).extend(cells)
    result = list(units)
    if not {"horizontal", "vertical"} <= set(stated) or any(units[i] for i in numeric):
        return result
    after = 0
    for column in numeric:
        first = column - 1 not in numeric and column + 1 in numeric  # of a block: the times
        cells = stated["horizontal"] if first else stated["vertical"]
        text = cells[0] if first else cells[min(after, len(cells) - 1)] if cells else ""
        after += not first
        result[column] = known_unit(text) or text
    return result


def distinct(names: Sequence[str]) -> list[str]:
    """Names of columns, with the position added to an ambiguous name."""
    counts = Counter(names)
    return [name if counts[name] == 1 else f"{name} #{i + 1}" for i, name in enumerate(names)]


TEXT = Reader("a table of text", limits.CSV_BYTES)
"""Any file without a reader of its own; `read_text_tables` takes known properties of its dialect."""
_DAY = 86400.0  # s
_HEAD, _MIDDLE = 2**18, 2**14  # number of inspected bytes
_MINUS = re.compile("(?:\N{MINUS SIGN}|\N{EN DASH})(?=[0-9.,])".encode())
"""A minus that programs write as in print."""
_LOOKED_AT = 1000  # number of texts of a column that show whether they are times of day
_LONG_LINE = 1000  # characters: a longer line above a table does not state a number
_HEAD_LINES = 400
_NAMES = {"tab": "\t", ";": ";", ",": ",", "|": "|", "blank": " "}
_SAID = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "blanks"}


@dataclass(frozen=True)
class Dialect:
    """The separation of a line and the form of a number; a blank matches any number of blanks and tabs."""

    delimiter: str
    decimal: str
    width: int

    def split(self, line: str) -> list[str]:
        """The cells of a line, without blanks and quotes around them."""
        if self.delimiter == " ":
            cells = re.findall(r'"[^"]*"(?!\S)|\S+', line)
        else:
            sign = re.escape(self.delimiter)
            cells = re.findall(rf'(?:^|{sign})([ \t]*"[^"]*"[ \t]*(?={sign}|$)|[^{sign}]*)', line)
        return [cell.strip(' \t"') for cell in cells]


def read_text_tables(
    content: bytes, where: str, choices: ImportChoices
) -> tuple[list[Table], dict[str, str]]:
    """The table of a text file; and how it was read, for the recipe."""
    content, encoding = as_utf8(content, where)
    if b"\n" not in content:
        content = content.replace(b"\r", b"\n")
    nul = (
        "give the file the ending of its format (.xlsx, .mat, .tdms, .h5, .parquet), or save it again as text"
    )
    check_lines(content, where, nul)
    if not content.isascii():
        content = _MINUS.sub(b"-", content)
    head = content[:_HEAD].decode(errors="replace").splitlines()
    if len(content) > _HEAD:
        head.pop()
    head = head[:_HEAD_LINES]
    half = len(content) // 2
    middle = content[half : half + _MIDDLE].decode(errors="replace").splitlines()[1:-1]
    body = middle if len(middle) >= len(head) // 2 else head[len(head) // 2 :] or head
    dialect = find_dialect([line for line in body if line.strip() and line[0] not in "#%"], choices)
    if dialect is None:
        remedy = "give --delimiter and --decimal, or name a table"
        raise TunnelError("no columns of numbers", where=where, remedy=remedy)
    check_table(content, dialect.width, where)
    layout = find_layout([_cells(line, dialect) for line in head], head, dialect.decimal, dialect.width)
    sample = [dialect.split(line) for line in body if line.strip()]
    if layout is None:
        what = f"no numbers in the first {counted(len(head), 'line')}"
        raise TunnelError(what, where=where, remedy="remove the lines above the table")
    heading = "names in the line above the numbers" if layout.headed else "no names of columns"
    remark = (
        f"text ({encoding}), {counted(dialect.width, 'column')} separated by {_SAID[dialect.delimiter]}, decimal "
        f"{'comma' if dialect.decimal == ',' else 'point'}, numbers from line {layout.first + 1}, {heading}"
    )
    known = {
        "delimiter": next(name for name, sign in _NAMES.items() if sign == dialect.delimiter),
        "decimal": dialect.decimal,
    }
    if dialect.delimiter == " ":
        content = re.sub(rb"[ \t\r]+", b" ", content)  # first, so that a run of blanks is not scanned twice
        content = re.sub(rb"(?m)^ | $", b"", content)
    text_at = {i for i in range(dialect.width) if _holds_texts(sample, i, dialect.decimal)} - {layout.runs}
    labels = None
    if layout.runs is not None:  # the name of a run is kept, even if it is "nan"
        labels = frame_of(content, dialect, layout, text_at, layout.runs, where).to_series()
    frame = frame_of(content, dialect, layout, text_at | {layout.runs}, None, where)
    texts = {
        f"line {i}": line.strip()
        for i, line in enumerate(head[: layout.first], 1)
        if len(line) <= _LONG_LINE and mentions_wind(line) and not facts_in([line])
    }
    table = Table((), remarks=(remark,), facts=layout.facts, texts=texts)
    return tables_of(frame, layout, dialect.decimal, labels, table), known


def check_table(content: bytes, width: int, where: str) -> None:
    """Refuse a text table with too many columns, lines or cells."""
    check_count(width, limits.COLUMNS, "columns", where, "leave out columns that are not needed")
    lines = content.count(b"\n")
    check_count(lines, limits.CAMPAIGN_SAMPLES, "lines", where, "split the file, or thin it out")
    check_count(lines * width, limits.CELLS, "cells", where, "leave out columns that are not needed")


def frame_of(
    content: bytes,
    dialect: Dialect,
    layout: Layout,
    texts: Collection[int | None],
    at: int | None,
    where: str,
) -> pl.DataFrame:
    """The columns of a table of text, from its first row of numbers on: numbers, or texts in columns with a text.

    Args:
        texts: indices of the columns of texts.
        at: index of the only column to read, as unchanged texts; None: all columns.
    """
    options: dict[str, Any] = {
        "separator": dialect.delimiter,
        "has_header": False,
        "skip_lines": layout.first,
        "truncate_ragged_lines": True,
    }
    names = [f"column_{i + 1}" for i in range(dialect.width)]
    all_texts = dict.fromkeys(names, pl.String)
    missing = sorted({*MISSING[1:], *map(str.upper, MISSING[1:]), "NaN", "Inf", "-Inf"})
    try:
        if at is not None:
            return pl.read_csv(content, schema=all_texts, columns=[at], **options)
        # where commas are decimal, points may separate thousands: each column shows whether they do
        exact = dialect.decimal == "," and _has_points(content, layout.first)
        kinds = {name: pl.String if exact or i in texts else pl.Float64 for i, name in enumerate(names)}
        numbers = {**options, "decimal_comma": dialect.decimal == ","}
        if not set(texts) - {layout.runs}:  # a text may contain delimiters in quotes
            numbers["quote_char"] = None
        try:
            return pl.read_csv(content, schema=kinds, null_values=missing, **numbers)
        except pl.exceptions.ComputeError:  # the column contains a text: cell by cell
            return pl.read_csv(content, schema=all_texts, null_values=missing, **options)
    except pl.exceptions.PolarsError as error:
        what = f"not a table of text ({one_line(error, 60)})"
        raise TunnelError(what, where=where, remedy="give every line one value for each column") from None


def _has_points(content: bytes, first: int) -> bool:
    """Whether a table has a point in a row of numbers, the first of which is given."""
    start = 0
    for _ in range(first):
        start = content.find(b"\n", start) + 1
    return content.find(b".", start) >= 0


def _cells(line: str, dialect: Dialect) -> list[str]:
    """The cells of a line of the head; its names may have other delimiters than the numbers below."""
    own = dialect.split(line)
    if len(own) != 1 or dialect.width < 2:
        return own
    others = (
        Dialect(sign, dialect.decimal, dialect.width).split(line) for sign in _NAMES.values() if sign != " "
    )
    return next((cells for cells in others if len(cells) == dialect.width and all(cells)), own)


def _holds_texts(rows: Sequence[Sequence[str]], column: int, decimal: str) -> bool:
    """Whether a column contains a text in some rows of a table; it is then read as texts from the first row on."""
    cells = (row[column] for row in rows if column < len(row))
    return any(not is_number(cell, decimal) and not is_missing(cell) for cell in cells)


def find_dialect(body: Sequence[str], choices: ImportChoices) -> Dialect | None:
    """The dialect in which most cells of some lines are numbers; of several, the dialect with most columns."""
    delimiters = _NAMES.values() if choices.delimiter is None else (_NAMES[choices.delimiter],)
    decimals = (".", ",") if choices.decimal is None else (choices.decimal,)
    best, score = None, (0.2, 0)
    for delimiter in delimiters:
        for decimal in decimals:
            if delimiter == "," == decimal:
                continue
            rows = [Dialect(delimiter, decimal, 0).split(line) for line in body]
            width = Counter(len(row) for row in rows).most_common(1)[0][0] if rows else 0
            cells = [cell for row in rows for cell in row if not is_missing(cell)]
            share = sum(like_number(cell, decimal) for cell in cells) / max(len(cells), 1)
            if (round(share, 1), width) > score:
                best, score = Dialect(delimiter, decimal, width), (round(share, 1), width)
    return best


def as_utf8(content: bytes, where: str) -> tuple[bytes, str]:
    """The text as UTF-8, and its encoding."""
    encoding = "ASCII"
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "UTF-16"
    elif not content.isascii():
        encoding = "UTF-8 with a byte-order mark" if content.startswith(b"\xef\xbb\xbf") else "UTF-8"
    try:
        if encoding == "UTF-16":
            content = content.decode("utf-16").encode()
        else:
            check_utf8(content, where)
    except UnicodeDecodeError:
        raise TunnelError("not UTF-16 text", where=where, remedy="save the file as UTF-8") from None
    except TunnelError:
        content, encoding = content.decode("latin-1").encode(), "Latin-1"
    return content.removeprefix(b"\xef\xbb\xbf"), encoding


def tables_of(
    frame: pl.DataFrame, layout: Layout, decimal: str, labels: pl.Series | None, table: Table
) -> list[Table]:
    """The tables of a sheet with its columns of numbers or times of day: one, or one for each run of the labels."""
    channels, notes = [], {-1: table.remarks[0]}
    frame, below = without_short_tables(frame, decimal)
    for i, (name, unit, column) in enumerate(
        zip(layout.names, layout.units, frame.get_columns(), strict=True)
    ):
        if i in layout.beside:
            continue
        number, lost, unread = column, 0, ""
        if column.dtype == pl.String and name == "drive_hold":
            number = column.map_elements(hold_order, return_dtype=pl.Float64).fill_nan(None)
            lost = number.null_count() - column.null_count()
        elif column.dtype == pl.String:
            cells = without_thousands(column) if decimal == "," else column
            number = in_parts(cells, partial(as_numbers, decimal=decimal))
            lost = number.null_count() - column.null_count()
        if lost and number.null_count() == column.len():
            notes[i] = f"the column '{name}' holds text and is left out"
            some = seconds_of_day(column.drop_nulls().head(_LOOKED_AT))
            if 2 * some.null_count() <= some.len():
                seconds = in_parts(column, seconds_of_day)
                midnights = (seconds.forward_fill().diff() < -_DAY / 2).fill_null(value=False).cum_sum()
                number, unit = seconds + _DAY * midnights, "s"
                notes[i] = f"the column '{name}' holds times of day, taken as seconds"
        elif lost:
            notes[i] = f"{counted(lost, 'text')} in the column '{name}' taken as missing"
            unread = unread_in(column, number)
        if number.null_count() < number.len():
            channels.append(Channel(name, number.fill_null(float("nan")).to_numpy(), unit, i + 1, unread))
    table = replace(table, channels=tuple(channels), headed=layout.headed)
    tables = [table]
    if labels is not None and layout.runs is not None and labels.len() == frame.height:
        tables = by_texts(table, layout.names[layout.runs], labels)
    said = tuple(note for i, note in notes.items() if not (tables[0].named and i == layout.runs))
    return [replace(one, remarks=(*said, *below, *one.remarks[1:])) for one in tables]


def read_cells(path: Path) -> tuple[list[str], list[list[str]]]:
    """A small table of texts, such as a table of conditions: its names, and the cells of every further line."""
    where = shown(path)
    content, _ = as_utf8(read_regular(path, limits.DOCUMENT_BYTES), where)
    lines = [line for line in content.decode(errors="replace").splitlines() if line.strip()]
    if len(lines) < 2:
        raise TunnelError("no rows", where=where, remedy="give a line of names and a line for each run")
    delimiter = max("\t;,", key=lines[0].count)
    rows = [Dialect(delimiter, ".", 0).split(line) for line in lines]
    wrong = next((i for i, row in enumerate(rows) if len(row) != len(rows[0])), None)
    if wrong is not None:
        cells = counted(len(rows[wrong]), "cell")
        what = f"{cells} in line {wrong + 1}, but {counted(len(rows[0]), 'name')} of columns"
        remedy = f"give every line one cell for each column, with {_SAID[delimiter]} between"
        raise TunnelError(what, where=where, remedy=remedy)
    return rows[0], rows[1:]
