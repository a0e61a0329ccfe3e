"""Run files as Parquet."""

from __future__ import annotations

import polars as pl

from tunnel_sim.files.reading import frame_schema, read_frame
from tunnel_sim.files.run_table import USED_COLUMNS, FileTable
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, one_line

LIMIT = limits.DATA_BYTES
"""Largest file, bytes."""


def read(content: bytes, where: str, most: int) -> FileTable:
    """The columns that are used.

    Args:
        most: how many samples it may hold (a count).

    Raises:
        TunnelError: when it is no readable Parquet file, too large, or a column holds no numbers.
    """
    remedy = "write the file again, as Parquet or as CSV"
    schema = frame_schema(content, where, remedy, rows=most, counted="samples")
    used = [name for name in schema if name in USED_COLUMNS]
    for name in used:
        if not schema[name].is_numeric():
            raise _not_numbers(name, schema[name], where)
    return FileTable(read_frame(content, where, remedy, used), tuple(schema))


def _not_numbers(name: str, dtype: pl.DataType, where: str) -> TunnelError:
    return TunnelError(
        f"the column {name} holds {one_line(dtype, 30)}, not numbers",
        where=where,
        remedy=f"write {name} as floating-point numbers",
    )
