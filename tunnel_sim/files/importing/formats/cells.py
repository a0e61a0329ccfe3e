"""Cells of a table of text: numbers, missing ones, numbers in an unknown form, and times of day."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from functools import partial

import numpy as np
import polars as pl

from tunnel_sim.files.importing.tables import LEAST_ROWS
from tunnel_sim.vocabulary.errors import counted

MISSING = ("", "nan", "-nan", "#n/a", "n/a", "na", "null", "none", "-", "--", "inf", "-inf", "#num!")
"""Texts, in lower case, that stand for a missing number."""
_NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_GROUPED = {
    ".": re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d+)?"),
    ",": re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d+)?"),
}
"""Numbers with separators of thousands: they show the decimal sign of a file, and are not read."""
_CLOCK = r"(?:^|[ T])(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)(?:\s*([AaPp])\.?[Mm]\.?|Z|[+-]\d{2}:?\d{2})?$"
_LIKE_A_NUMBER = r"^\W{0,3}\d"
_PART = 2**20  # number of texts converted at once
_WORD = r"^\W*[^\W\d_]{2}"
_MOST_SHORT = 0.1  # share of rows: more of them are not the tables beside a record
_FEW_UNREAD = 0.05  # share of a column: damaged lines of a serial log are fewer


def is_number(text: str, decimal: str = ".") -> bool:
    """Whether a text is a number."""
    return _NUMBER[decimal].fullmatch(text) is not None


def is_missing(text: str) -> bool:
    """Whether a text stands for a missing number."""
    return text.lower() in MISSING


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


def without_short_tables(frame: pl.DataFrame, decimal: str) -> tuple[pl.DataFrame, list[str]]:
    """Rows of texts without the numbers of short tables between them, such as one of peaks, and a remark.

    The rows remain, so that the others can be counted.
    """
    strings = [column for column in frame.get_columns() if column.dtype == pl.String]
    if frame.width < 2 or not strings:
        return frame, []
    words = np.any([c.str.contains(_WORD).fill_null(value=False).to_numpy() for c in strings], axis=0)
    if not words.any():
        return frame, []
    convert = partial(as_numbers, decimal=decimal)
    cells = [in_parts(c, convert) if c.dtype == pl.String else c for c in frame.get_columns()]
    numbers = np.sum([column.is_not_null().to_numpy() for column in cells], axis=0)
    texts = np.flatnonzero(words & (numbers == 0))
    short = np.zeros(frame.height, dtype=bool)
    for a, b in itertools.pairwise([*texts.tolist(), frame.height]):
        filled = a + np.flatnonzero(numbers[a:b] > 0)
        short[filled] = filled.size < LEAST_ROWS
    if not short.any() or short.sum() > _MOST_SHORT * frame.height:
        return frame, []
    kept = pl.Series(~short)
    frame = frame.select(pl.when(kept).then(pl.col(name)).alias(name) for name in frame.columns)
    rows = counted(int(short.sum()), "row")
    return frame, [f"{rows} below other headings left out: a table of fewer than {LEAST_ROWS} rows"]


def unread_in(column: pl.Series, number: pl.Series) -> str:
    """One of the texts that are numbers in an unknown form, such as ``(0.35)`` or ``1'204``; empty if few are."""
    texts = column.filter(number.is_null() & column.is_not_null()).str.strip_chars(' \t\r"')
    numbers = texts.filter(texts.str.contains(_LIKE_A_NUMBER) & ~texts.str.contains("#", literal=True))
    return str(numbers[0]) if numbers.len() > _FEW_UNREAD * column.len() else ""


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
