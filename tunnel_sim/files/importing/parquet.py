"""Parquet files with columns of any names."""

from __future__ import annotations

import polars as pl

from tunnel_sim.files.importing.tables import Channel, Table, by_texts, names_runs, split_unit
from tunnel_sim.files.reading import frame_schema, read_frame
from tunnel_sim.vocabulary import limits

LIMIT = limits.DATA_BYTES
"""Largest file, bytes."""
MAGIC = (b"PAR1",)
"""How such a file begins."""
KIND = "a Parquet file"
"""As messages name it."""
_REMEDY = "write the file again, as Parquet or as text"


def read(content: bytes, where: str) -> list[Table]:
    """The table of a Parquet file; arguments as in `source.LibraryReader`."""
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
