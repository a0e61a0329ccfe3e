"""Run files as comma-separated text."""

from __future__ import annotations

import re

import polars as pl

from tunnel_sim.files.reading import check_count, decoded
from tunnel_sim.files.run_table import USED_COLUMNS, FileTable
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, one_line

LIMIT = limits.CSV_BYTES
"""Largest file, bytes."""


def read(content: bytes, where: str, most: int) -> FileTable:
    """The table as text.

    Args:
        most: how many samples it may hold (a count).

    Returns:
        All columns; those without a name, or with a name used twice, under their position.

    Raises:
        TunnelError: when it is no comma-separated table with one line of headings, or too large.
    """
    if not content.isascii():  # which needs no second copy of a large file
        decoded(content, where)
    columns = content.partition(b"\n")[0].count(b",") + 1
    check_count(columns, limits.COLUMNS, "columns", where, "leave out columns that are not needed")
    check_count(content.count(b"\n") - 1, most, "samples", where, "split the file, or thin it out")
    try:
        rows = pl.read_csv(content, has_header=False, infer_schema=False, quote_char=None)
    except pl.exceptions.PolarsError as error:
        raise TunnelError(
            f"not a comma-separated table ({one_line(error, 60)})",
            where=where,
            remedy="give every line one value for each column, with commas between and decimal points",
        ) from None
    names = [str(name or "").strip().strip('"').strip() for name in rows.row(0)]
    if any(_is_number(name) for name in names):
        raise TunnelError(
            "no header line", where=where, remedy="name the columns in the first line, such as time_s,yaw_rad"
        )
    if len(names) == 1 and re.search(r"[;\t]", names[0]):
        raise TunnelError("not comma-separated", where=where, remedy="put commas between the columns")
    twice = next((name for name in names if name in USED_COLUMNS and names.count(name) > 1), None)
    if twice is not None:
        raise TunnelError(f"the column {twice} occurs twice", where=where, remedy="leave one of them out")
    # Other columns that have no name, or share one, are kept apart by their position; nobody asks for them.
    rows.columns = [
        name if name and names.count(name) == 1 else f"(column {i + 1})" for i, name in enumerate(names)
    ]
    return FileTable(rows.slice(1), rows.columns, text=True)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
