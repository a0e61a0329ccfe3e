"""Parquet files: run files of a campaign, and files with columns of any names."""

from __future__ import annotations

import polars as pl

from tunnel_sim.files.importing.tables import Channel, Table, by_texts, names_runs, split_unit
from tunnel_sim.files.readers import USED_COLUMNS, FileTable, Reader
from tunnel_sim.files.reading import frame_schema, read_frame
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, one_line

_REMEDY = "write the file again, as Parquet or as text"


def _read_run(content: bytes, where: str, most: int) -> FileTable:
    """The columns of a run file that are used; arguments as in `Reader`."""
    remedy = "write the file again, as Parquet or as CSV"
    schema = frame_schema(content, where, remedy, rows=most, counted="samples")
    used = [name for name in schema if name in USED_COLUMNS]
    for name in used:
        if not schema[name].is_numeric():
            raise TunnelError(
                f"the column {name} holds {one_line(schema[name], 30)}, not numbers",
                where=where,
                remedy=f"write {name} as floating-point numbers",
            )
    return FileTable(read_frame(content, where, remedy, used), tuple(schema))


def _read_tables(content: bytes, where: str) -> list[Table]:
    """The table of a Parquet file; arguments as in `Reader`."""
    schema = frame_schema(content, where, _REMEDY, rows=limits.RUN_SAMPLES, counted="samples")
    runs = next((name for name, kind in schema.items() if names_runs(name) and kind == pl.String), None)
    used = [name for name, kind in schema.items() if kind.is_numeric() or kind.is_temporal() or name == runs]
    frame = read_frame(content, where, _REMEDY, used)
    channels = []
    for column in frame.get_columns():
        if column.name == runs:
            continue
        name, unit = split_unit(column.name)
        if column.dtype.is_temporal():
            if column.dtype not in (pl.Datetime, pl.Duration):
                continue
            column, unit = column.dt.cast_time_unit("ns").to_physical(), "ns"
            column = column - column.min()
        values = column.cast(pl.Float64).fill_null(float("nan")).to_numpy()
        channels.append(Channel(name, values, unit))
    said = f"Parquet file: {len(channels)} columns of {frame.height} samples"
    table = Table(tuple(channels), said=(said,))
    return [table] if runs is None else by_texts(table, runs, frame.get_column(runs))


PARQUET = Reader("a Parquet file", limits.DATA_BYTES, (b"PAR1",), _read_run, _read_tables)
"""Parquet files."""
