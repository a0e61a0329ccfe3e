"""Run files: tables of times and angles in CSV or Parquet."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tunnel_sim.files.reading import check_count, decoded, frame_schema, read_frame, read_regular
from tunnel_sim.files.toml_input import one_line
from tunnel_sim.files.writing import encoded
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array, Record

RUN_FORMATS = ("parquet", "csv")
_USED = ("time_s", "yaw_rad", "yaw_deg")
_COLUMNS = "a column yaw_rad or yaw_deg, and time_s unless [sensor] sample_rate is given"


def read_table(
    path: Path, where: str, *, timed: bool = False, most: int = limits.RUN_SAMPLES
) -> tuple[Array | None, Array, str]:
    """Read times and angles from a run file; other columns are ignored.

    Args:
        path: a ``.csv`` or ``.parquet`` file.
        where: file and run, for messages.
        timed: whether times are required because no ``sample_rate`` is stated.
        most: greatest number of samples.

    Returns:
        Times in s (None without a column time_s), the reading as written, and the name of its column:
        ``yaw_rad`` or ``yaw_deg``. All values are finite.

    Raises:
        TunnelError: no such file, not a regular file, too large, not a table, a missing or repeated column, a
            value that is missing or not a number.
    """
    readers = {".csv": _read_csv, ".parquet": _read_parquet}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise TunnelError(
            f"unsupported file type '{one_line(path.suffix)}'", where=where, remedy="use .csv or .parquet"
        )
    content = read_regular(
        path,
        limits.CSV_BYTES if reader is _read_csv else limits.DATA_BYTES,
        where=where,
        missing="put the file there or correct 'file' in campaign.toml",
        readable="name a readable .csv or .parquet file",
    )
    if not content.strip():
        raise TunnelError("the file is empty", where=where, remedy=f"give it {_COLUMNS}")
    return _columns(reader(content, where, most), where, timed=timed)


def table_bytes(record: Record, path: Path) -> bytes:
    """The content of a run file with columns time_s and yaw_rad; reading it gives the same numbers.

    Args:
        record: what to write.
        path: the ``.csv`` or ``.parquet`` file, for the format and for messages.

    Raises:
        TunnelError: when the table cannot be encoded.
    """
    table = pl.DataFrame({"time_s": record.time_s, "yaw_rad": record.yaw_rad})
    # CSV values have the fewest digits that read back as the same float.
    return encoded(path, table.write_csv if path.suffix == ".csv" else table.write_parquet)


@dataclass(frozen=True)
class _Table:
    """A run file: at least the columns that are used, the names of all columns, and the number of the first row."""

    frame: pl.DataFrame
    names: Sequence[str]
    first_line: int


def _read_csv(content: bytes, where: str, most: int) -> _Table:
    """The table as text; rows are numbered as lines of the file."""
    if not content.isascii():  # ASCII is checked first because it needs no second copy of a large file
        decoded(content, where)
    columns = content.partition(b"\n")[0].count(b",") + 1
    check_count(columns, limits.COLUMNS, "columns", where, "leave out unused columns")
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
    twice = next((name for name in names if name in _USED and names.count(name) > 1), None)
    if twice is not None:
        raise TunnelError(f"the column {twice} is there twice", where=where, remedy="leave one of them out")
    # Unused columns without a name, or with a repeated one, are named by position.
    rows.columns = [
        name if name and names.count(name) == 1 else f"(column {i + 1})" for i, name in enumerate(names)
    ]
    return _Table(rows.slice(1), rows.columns, 2)


def _read_parquet(content: bytes, where: str, most: int) -> _Table:
    """The columns that are used; rows are numbered from 1."""
    remedy = "write the file again, as Parquet or as CSV"
    schema = frame_schema(content, where, remedy, rows=most, counted="samples")
    used = [name for name in schema if name in _USED]
    for name in used:
        if not schema[name].is_numeric():
            raise _not_numbers(name, schema[name], where)
    return _Table(read_frame(content, where, remedy, used), tuple(schema), 1)


def _columns(held: _Table, where: str, *, timed: bool) -> tuple[Array | None, Array, str]:
    names, first_line = held.names, held.first_line
    if "yaw_rad" in names and "yaw_deg" in names:
        raise TunnelError("both yaw_rad and yaw_deg", where=where, remedy="leave one of them out")
    column = next((name for name in ("yaw_rad", "yaw_deg") if name in names), None)
    if column is None:
        found = one_line(", ".join(names) or "none", 60)
        raise TunnelError(
            f"no column yaw_rad or yaw_deg (columns found: {found})",
            where=where,
            remedy="name the angle's column yaw_rad (radians) or yaw_deg (degrees)",
        )
    stray = next((name for name in names if name != "time_s" and re.match(r"(?i)t$|time", name)), None)
    if timed and "time_s" not in names and stray is not None:
        raise TunnelError(
            f"no column time_s and no sample_rate, but a column '{one_line(stray, 40)}'",
            where=where,
            remedy="did you mean 'time_s' (in seconds)? Otherwise state sample_rate in Hz under [sensor]",
        )
    used = [name for name in ("time_s", column) if name in names]
    table = held.frame.select(used)
    if first_line == 2:
        table = _without_blank_end(table)
    if table.height == 0:
        raise TunnelError(
            "the file has no samples", where=where, remedy="record the run again or leave it out"
        )
    values = {name: _numbers(table.get_column(name), first_line, where) for name in used}
    return values.get("time_s"), values[column], column


def _without_blank_end(table: pl.DataFrame) -> pl.DataFrame:
    """A text table without the blank lines at its end."""
    blank = table.select(pl.all_horizontal(pl.all().is_null())).to_series().to_numpy()
    filled = np.flatnonzero(~blank)
    return table.head(int(filled[-1]) + 1 if filled.size else 0)


def _numbers(series: pl.Series, first_line: int, where: str) -> Array:
    """The values of a column as finite floats; the message names the first value that is not."""
    if series.dtype == pl.String and first_line == 2:
        numbers = series.str.strip_chars(' \t\r"').cast(pl.Float64, strict=False)
    else:
        numbers = series.cast(pl.Float64)
    values: NDArray[np.float64] = numbers.fill_null(np.nan).to_numpy()
    bad = np.flatnonzero(~(np.abs(values) <= limits.LARGEST_NUMBER))  # true for NaN as well
    if bad.size:
        at = int(bad[0])
        cell = series[at]
        said = "no value" if cell is None or not str(cell).strip() else one_line(cell, 30)
        raise TunnelError(
            f"{series.name} is {said}{'' if said == 'no value' else ', not a finite number,'} in "
            f"{'line' if first_line == 2 else 'row'} {at + first_line} ({bad.size} such)",
            where=where,
            remedy="cut the record before it, or leave the run out",
        )
    return values


def _not_numbers(name: str, dtype: pl.DataType, where: str) -> TunnelError:
    return TunnelError(
        f"the column {name} holds {one_line(dtype, 30)}, not numbers",
        where=where,
        remedy=f"write {name} as floating-point numbers",
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
