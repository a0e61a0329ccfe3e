"""Tables as text in any dialect: delimiter, decimal sign, encoding and head are found from the content."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import polars as pl

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.condition_names import condition_of, mentions_wind
from tunnel_sim.files.importing.formats.cells import (
    MISSING,
    as_numbers,
    in_parts,
    is_missing,
    is_number,
    like_number,
    seconds_of_day,
    series_by,
    unread_in,
    without_short_tables,
    without_thousands,
)
from tunnel_sim.files.importing.formats.layout import (
    LONGEST_LINE,
    Layout,
    changed_columns,
    facts_in,
    find_layout,
)
from tunnel_sim.files.importing.tables import LEAST_ROWS, Channel, Table, by_texts, hold_order
from tunnel_sim.files.importing.units import kind_of, names_a_time, split_unit, unit_after_word
from tunnel_sim.files.readers import Reader
from tunnel_sim.files.reading import check_count, check_lines, check_utf8, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, one_line, shown

TEXT = Reader("a table of text", limits.CSV_BYTES)
"""Any file without a reader of its own; `read_text_tables` takes known properties of its dialect."""
_DAY = 86400.0  # s
_HEAD, _MIDDLE = 2**18, 2**14  # number of inspected bytes
_MINUS = re.compile("(?:\N{MINUS SIGN}|\N{EN DASH})(?=[0-9.,])".encode())
"""A minus that programs write as in print."""
_OF_SERIES = re.compile(r"(?i)variable|signal|channel|quantity|metric|topic|kanal|mess?gr(ö|oe)(ß|ss)e")
"""Names of a column that gives the quantity of each row."""
_MOST_BELOW = 1000  # number of inspected lines of texts below the first row of numbers
_LOOKED_AT = 1000  # number of texts of a column that show whether they are times of day
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
        if '"' not in line:  # the rule below, many times faster
            cells = line.split(None if self.delimiter == " " else self.delimiter)
        elif self.delimiter == " ":
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
    content = _without_doubled_ends(content)
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
    if _has_halves(body, dialect):
        what = "commas separate the columns, and are decimal signs as well"
        raise TunnelError(what, where=where, remedy="export it with semicolons or with decimal points")
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
        if len(line) <= LONGEST_LINE
        and (mentions_wind(line) or unit_after_word(line) is not None)
        and not facts_in([line])
    }
    below = _texts_below(content, layout.first)
    table = Table((), remarks=(remark,), facts=contested(layout.facts, below), texts=texts)
    return tables_of(frame, layout, dialect.decimal, labels, table), known


def _texts_below(content: bytes, first: int) -> list[str]:
    """Some lines of texts below the first row of numbers."""
    found = re.compile(rb"(?m)^[^\w\n]*[A-Za-z\x80-\xff][^\n]*").finditer(content, _start_of(content, first))
    return [line[0].decode(errors="replace") for line in islice(found, _MOST_BELOW)]


def contested(facts: Mapping[str, float], below: Sequence[str]) -> dict[str, float]:
    """Numbers above a table; NaN for a condition of which lines between its rows state another one."""
    stated = dict(facts)
    for heading, value in facts_in(below).items():
        if condition_of(*split_unit(heading), alone=True) is not None and stated.get(heading) != value:
            stated[heading] = float("nan")
    return stated


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
        quoted = dialect.delimiter == dialect.decimal
        body = _start_of(content, layout.first)
        exact = quoted or (dialect.decimal == "," and content.find(b".", body) >= 0)
        kinds = {name: pl.String if exact or i in texts else pl.Float64 for i, name in enumerate(names)}
        numbers = {**options, "decimal_comma": dialect.decimal == ","}
        if not (quoted or set(texts) - {layout.runs}):  # a text may contain delimiters in quotes
            numbers["quote_char"] = None
        try:
            return pl.read_csv(content, schema=kinds, null_values=missing, **numbers)
        except pl.exceptions.ComputeError:  # the column contains a text: cell by cell
            return pl.read_csv(content, schema=all_texts, null_values=missing, **options)
    except pl.exceptions.PolarsError as error:
        what = f"not a table of text ({one_line(error, 60)})"
        raise TunnelError(what, where=where, remedy="give every line one value for each column") from None


def _start_of(content: bytes, line: int) -> int:
    """The place at which a line begins."""
    start = 0
    for _ in range(line):
        start = content.find(b"\n", start) + 1
    return start


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
    """The dialect in which most cells of some lines are numbers; of several, the dialect with most columns.

    Three decimals may also be thousands: of two signs, the one without separators of thousands is decimal.
    """
    delimiters = _NAMES.values() if choices.delimiter is None else (_NAMES[choices.delimiter],)
    decimals = (".", ",") if choices.decimal is None else (choices.decimal,)
    best, score = None, (0.2, 0, 0.0)
    for delimiter in delimiters:
        rows = [Dialect(delimiter, ".", 0).split(line) for line in body]
        width = Counter(len(row) for row in rows).most_common(1)[0][0] if rows else 0
        cells = [cell for row in rows for cell in row if not is_missing(cell)]
        for decimal in decimals:
            if delimiter == "," == decimal and not any('"' in line for line in body):
                continue
            others = [cell for cell in cells if not is_number(cell, decimal)]
            numbers = len(cells) - len(others)
            alike = numbers + sum(like_number(cell, decimal) for cell in others)
            share, plain = (round(count / max(len(cells), 1), 1) for count in (alike, numbers))
            if (share, width, plain) > score:
                best, score = Dialect(delimiter, decimal, width), (share, width, plain)
    return best


def _without_doubled_ends(content: bytes) -> bytes:
    """Lines without the blank line after each of them that doubled line ends make."""
    content = content.replace(b"\r\r\n", b"\n")
    blank = len(re.findall(rb"\n\r?(?=\n)", content))
    return re.sub(rb"\n\r?(?=\n)", b"", content) if 5 * blank > 2 * content.count(b"\n") else content


def _has_halves(body: Sequence[str], dialect: Dialect) -> bool:
    """Whether the cells of lines are halves of numbers: whole numbers, then as many decimals in each line."""
    rows = [row for row in map(dialect.split, body) if len(row) == dialect.width]
    if dialect.delimiter != "," or dialect.width < 4 or dialect.width % 2 or len(rows) < LEAST_ROWS:
        return False
    columns = list(zip(*rows, strict=True))
    decimals = [cell for column in columns[1::2] for cell in column]
    return (
        all(re.fullmatch(r"[+-]?\d+", cell) for column in columns[::2] for cell in column)
        and all(cell.isdigit() for cell in decimals)
        and all(len(set(map(len, column))) == 1 for column in columns[1::2])
        and any(cell.startswith("0") and len(cell) > 1 for cell in decimals)
    )


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
    frame: pl.DataFrame,
    layout: Layout,
    decimal: str,
    labels: pl.Series | None,
    table: Table,
    written: pl.DataFrame | None = None,
) -> list[Table]:
    """The tables of a sheet with its columns of numbers or times of day: one, or one for each run of the labels.

    Args:
        written: the rows with all their texts; None: they are in the frame.
    """
    channels, notes = [], {-1: table.remarks[0]}
    texts: dict[str, pl.Series] = {}
    written = frame if written is None else written
    frame, headings, below = without_short_tables(frame, decimal, written)
    faults = {}
    for row in headings:
        for i, cell in changed_columns(layout, written.row(row)).items():
            what = f"has another heading below the first one, '{one_line(cell, 40)}'"
            faults[i] = (what, "write each table into a file of its own")
    for i, (name, unit, column) in enumerate(
        zip(layout.names, layout.units, frame.get_columns(), strict=True)
    ):
        if i in layout.beside:
            continue
        number, lost = column, 0
        fault: tuple[str, ...] = faults.get(i, ())
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
            fault = fault or unread_in(column, number)
        if number.null_count() < number.len():
            channels.append(Channel(name, number.fill_null(float("nan")).to_numpy(), unit, i + 1, fault))
        elif column.dtype == pl.String:
            texts[name] = column
    channels = [_with_series(channel, texts) for channel in channels]
    table = replace(table, channels=tuple(channels), headed=layout.headed)
    tables = [table]
    if labels is not None and layout.runs is not None and labels.len() == frame.height:
        tables = by_texts(table, layout.names[layout.runs], labels)
    said = tuple(note for i, note in notes.items() if not (tables[0].named and i == layout.runs))
    return [replace(one, remarks=(*said, *below, *one.remarks[1:])) for one in tables]


def _with_series(channel: Channel, texts: Mapping[str, pl.Series]) -> Channel:
    """A column, with the fault that it holds several series where a column of texts distinguishes them."""
    for name, labels in texts.items():
        named = labels.n_unique() if _OF_SERIES.fullmatch(name) else 1
        series = series_by(labels, channel.values) if named == 1 else named
        if (
            series > 1
            and not channel.fault
            and kind_of(channel.unit) != "time"
            and not names_a_time(channel.name)
        ):
            what = f"holds {series} series, by the column '{one_line(name, 40)}'"
            remedy = (
                "write each series into a column or a file of its own, or leave out the rows of the others"
            )
            return replace(channel, fault=(what, remedy))
    return channel


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
