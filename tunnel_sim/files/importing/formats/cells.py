"""Cells of a table of text: numbers, missing ones, numbers in an unknown form, and times of day."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from functools import partial

import numpy as np
import polars as pl

from tunnel_sim.files.importing.tables import LEAST_ROWS, are_series
from tunnel_sim.vocabulary.errors import counted, one_line
from tunnel_sim.vocabulary.quantities import Rows

MISSING = ("", "nan", "-nan", "#n/a", "n/a", "na", "null", "none", "-", "--", "inf", "-inf", "#num!")
"""Texts, in lower case, that stand for a missing number."""
_MISSING = frozenset(MISSING)
_NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_GROUPED = {
    ".": re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d+)?"),
    ",": re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d+)?"),
}
"""Numbers with separators of thousands: they show the decimal sign of a file, and are not read."""
_CLOCK = (
    r"(?:^|[ T])(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)"
    r"(?:\s*([AaPp])\.?[Mm]\.?|Z|\s*(?:UTC|GMT)|[+-]\d{2}:?\d{2})?$"
)
_LIKE_A_NUMBER = r"^\W{0,3}\d"
_PART = 2**20  # number of texts converted at once
_WORD = r"^\W*[^\W\d_]{2}"
_MOST_SERIES = 16  # number of series that a column of texts may distinguish
_MOST_SHORT = 0.1  # share of rows: more of them are not the tables beside a record
_FEW_UNREAD = 0.05  # share of a column: damaged lines of a serial log are fewer


def is_number(text: str, decimal: str = ".") -> bool:
    """Whether a text is a number."""
    return _NUMBER[decimal].fullmatch(text) is not None


def is_missing(text: str) -> bool:
    """Whether a text stands for a missing number."""
    return text.lower() in _MISSING


def like_number(text: str, decimal: str) -> bool:
    """Whether a text is a number, or would be one without separators of thousands."""
    return is_number(text, decimal) or _GROUPED[decimal].fullmatch(text) is not None


def without_thousands(column: pl.Series) -> pl.Series:
    """A column without points that may separate thousands, unless other points in it are decimal points."""
    pointed = column.str.contains(".", literal=True)
    grouped = column.str.contains(rf'^[ \t"]*{_GROUPED[","].pattern}[ \t\r"]*$')
    if not grouped.any() or (pointed & ~grouped).any():
        return column
    return pl.select(pl.when(grouped).then(None).otherwise(column)).to_series()


def without_short_tables(
    frame: pl.DataFrame, decimal: str, texts: pl.DataFrame
) -> tuple[pl.DataFrame, list[int], list[str]]:
    """Rows without the numbers of short tables below other headings, such as one of peaks.

    The rows remain, so that the others can be counted.

    Args:
        texts: the rows with their texts, which a workbook does not have in columns of numbers.

    Returns:
        The rows, the indices of rows of texts above long tables, and a remark.
    """
    strings = [column for column in texts.get_columns() if column.dtype == pl.String]
    if frame.width < 2 or not strings or texts.height != frame.height:
        return frame, [], []
    words = np.any([c.str.contains(_WORD).fill_null(value=False).to_numpy() for c in strings], axis=0)
    if not words.any():
        return frame, [], []
    convert = partial(as_numbers, decimal=decimal)
    cells = [in_parts(c, convert) if c.dtype == pl.String else c for c in frame.get_columns()]
    numbers = np.sum([column.is_not_null().to_numpy() for column in cells], axis=0)
    named = np.flatnonzero(words & (numbers == 0))
    short = np.zeros(frame.height, dtype=bool)
    headings = []
    for a, b in itertools.pairwise([*named.tolist(), frame.height]):
        filled = a + np.flatnonzero(numbers[a:b] > 0)
        short[filled] = filled.size < LEAST_ROWS
        headings += [a] if filled.size >= LEAST_ROWS else []
    if not short.any() or short.sum() > _MOST_SHORT * frame.height:
        return frame, headings, []
    kept = pl.Series(~short)
    frame = frame.select(pl.when(kept).then(pl.col(name)).alias(name) for name in frame.columns)
    rows = counted(int(short.sum()), "row")
    remark = f"{rows} below other headings left out: a table of fewer than {LEAST_ROWS} rows"
    return frame, headings, [remark]


def series_by(labels: pl.Series, values: Rows) -> int:
    """The number of series in a column of numbers that a column of texts distinguishes; 1: it is one series."""
    labels = labels.fill_null("")
    groups = [
        labels.eq(name).to_numpy() & np.isfinite(values) for name in labels.unique().head(_MOST_SERIES + 1)
    ]
    groups = [rows for rows in groups if np.count_nonzero(rows) >= LEAST_ROWS]
    changes = int((labels != labels.shift()).sum())
    if not 1 < len(groups) <= _MOST_SERIES or changes < 2 * LEAST_ROWS:  # else runs one after another
        return 1
    column = values[np.any(groups, axis=0)]
    return len(groups) if are_series(column, (values[rows] for rows in groups)) else 1


def unread_in(column: pl.Series, number: pl.Series) -> tuple[str, ...]:
    """The fault of a column of which many texts are numbers in an unknown form, such as ``(0.35)`` or ``1'204``."""
    texts = column.filter(number.is_null() & column.is_not_null()).str.strip_chars(' \t\r"')
    numbers = texts.filter(texts.str.contains(_LIKE_A_NUMBER) & ~texts.str.contains("#", literal=True))
    if numbers.len() <= _FEW_UNREAD * column.len():
        return ()
    return (
        f"has numbers such as '{one_line(numbers[0], 20)}', in an unknown form",
        "write them without brackets, units and separators of thousands, or state --decimal",
    )


def as_numbers(column: pl.Series, decimal: str) -> pl.Series:
    """Numbers of a column of texts; null where a text is not a number."""
    cells = column.str.strip_chars(' \t\r"')
    cells = cells.str.replace(",", ".", literal=True) if decimal == "," else cells
    return cells.cast(pl.Float64, strict=False)


def seconds_of_day(column: pl.Series) -> pl.Series:
    """Times of day such as 14:03:07.25, with or without a date, in s since midnight; null if there is none."""
    text = column.str.strip_chars(' \t\r"')
    parts = (text.str.extract(_CLOCK, group).str.replace(",", ".") for group in (1, 2, 3))
    hours, minutes, rest = (part.cast(pl.Float64) for part in parts)
    half = text.str.extract(_CLOCK, 4).str.to_lowercase()  # the twelfth hour is the first of its half day
    hours = pl.select(pl.when(half.is_null()).then(hours).otherwise(hours % 12.0)).to_series()
    hours += (half == "p").fill_null(value=False).cast(pl.Float64) * 12.0
    return 3600.0 * hours + 60.0 * minutes + rest


def in_parts(column: pl.Series, convert: Callable[[pl.Series], pl.Series]) -> pl.Series:
    """Numbers of a column of texts, part by part: a conversion temporarily takes ten times the memory."""
    parts = [convert(column.slice(start, _PART)) for start in range(0, max(column.len(), 1), _PART)]
    return pl.concat(parts)
