"""Run files: tables of times, readings and inputs, in CSV, Parquet or the format of an installed reader."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tunnel_sim.files.kept_process import check_polars, read_apart
from tunnel_sim.files.readers import RUN_ENDINGS, FileTable, Reader, load_reader, run_endings
from tunnel_sim.files.reading import check_count, check_lines, check_utf8, is_blank, read_regular
from tunnel_sim.files.writing import encoded
from tunnel_sim.forks import polars_works
from tunnel_sim.sandbox import Message, Work
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.errors import TunnelError, one_line, one_of
from tunnel_sim.vocabulary.freedom import ANGLE, FREEDOMS, Freedom
from tunnel_sim.vocabulary.input_kinds import WITHOUT_UNIT, InputColumn
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.quantities import PerSample, Readings, Times
from tunnel_sim.vocabulary.record import Array, Record

USED_COLUMNS = (
    "time_s",
    *(name for one in FREEDOMS.values() for names in one.columns.values() for name in names),
    *dict.fromkeys(name for one in FREEDOMS.values() for name in one.inputs),
)
"""The columns that are read from a run file; others are ignored."""

RUN_FORMATS = ("parquet", "csv")
"""Formats for writing."""


@dataclass(frozen=True, eq=False)
class RunTableValues:
    """The content of a run file.

    Args:
        time_s: times; None without a column time_s.
        input: input in the unit of its column; None for a free decay.
    """

    time_s: Times | None
    reading: Readings
    column: str
    input_column: InputColumn | None = None
    input: PerSample | None = None


def read_table(
    path: Path,
    where: str,
    *,
    timed: bool = False,
    quantity: Quantity = "angle",
    freedom: Freedom = ANGLE,
    most: int = limits.RUN_SAMPLES,
) -> RunTableValues:
    """Read finite times, readings and an input from a run file; ``timed``: the times are required."""
    missing = "put the file there or correct 'file' in campaign.toml"
    columns = freedom.columns[quantity]
    holds = f"give it a column {' or '.join(columns)}, and time_s unless [sensor] sample_rate is given"
    given = {"timed": timed, "quantity": quantity, "motion": freedom.motion, "most": most}
    found, values = _read(_table, given, path, where, missing, holds)
    arrays = dict(zip(found["values"], values, strict=True))
    column, driven = found["column"], found["input_column"]
    reading = arrays[column] if columns[column] == 1.0 else columns[column] * arrays[column]
    kind = driven and freedom.inputs[driven]
    return RunTableValues(arrays.get("time_s"), reading, column, kind, driven and arrays[driven])


def read_input(path: Path, where: str) -> tuple[Times, InputColumn, PerSample]:
    """Read the input of a driven run, and its increasing times, from a file that need not contain a reading."""
    missing, holds = "put the file beside the plan or correct 'file'", "give it a header line and samples"
    found, (time, values) = _read(_input, {"most": limits.RUN_SAMPLES}, path, where, missing, holds)
    if time.size < 2 or not np.all(np.diff(time) > 0.0):
        raise TunnelError("time_s does not increase", where=where, remedy="give two or more increasing times")
    return time, found["input_column"], values


def _read(
    work: Work, given: dict[str, Any], path: Path, where: str, missing: str, holds: str
) -> tuple[dict[str, Any], list[Array]]:
    """The columns of a run file, read here, or in the kept process if its reader or Polars requires that."""
    ending = path.suffix.lower()
    readable = f"name a readable {' or '.join(RUN_ENDINGS)} file"
    reader, _ = _reader(ending, where)
    contents = [read_regular(path, reader.limit, where=where, missing=missing, readable=readable)]
    if is_blank(contents[0]):
        raise TunnelError("the file is empty", where=where, remedy=holds)
    given = {**given, "ending": ending, "where": where}
    here = polars_works() and not reader.run_apart
    found, arrays = work(given, contents) if here else read_apart(work, given, contents[0], where)
    return found, [np.frombuffer(array) for array in arrays]


def _reader(ending: str, where: str) -> tuple[Reader, Callable[[bytes, str, int], FileTable]]:
    reader = load_reader(ending)
    if reader is None or reader.read_run is None:
        what = f"unsupported file type '{one_line(ending)}'"
        raise TunnelError(what, where=where, remedy=f"use {' or '.join(run_endings())}")
    return reader, reader.read_run


def _held(given: dict[str, Any], contents: list[bytes]) -> FileTable:
    _, read_run = _reader(given["ending"], given["where"])
    return read_run(contents.pop(), given["where"], given["most"])


def _table(given: dict[str, Any], contents: list[bytes]) -> Message:
    """The columns of times, readings and input of a run file, for `read_table`."""
    held = _held(given, contents)
    timed, where, quantity = given["timed"], given["where"], given["quantity"]
    freedom = FREEDOMS[given["motion"]]
    known, names = freedom.columns[quantity], held.names
    driven = _input_column(names, where, freedom)
    found = [name for name in known if name in names]
    if len(found) > 1:
        raise TunnelError(f"both {' and '.join(found)}", where=where, remedy="leave one of them out")
    if not found:
        other = next(
            (
                f"quantity = '{kind}'" if one is freedom else f"motion = '{one.motion}'"
                for one in (freedom, *FREEDOMS.values())
                for kind, columns in one.columns.items()
                if not set(columns).isdisjoint(names)
            ),
            None,
        )
        raise TunnelError(
            f"no column {' or '.join(known)} (columns found: {one_line(', '.join(names) or 'none', 60)})",
            where=where,
            remedy=f"name the {freedom.words(quantity)}'s column {' or '.join(known)}"
            + (f", or state {other} under [sensor]" if other else ""),
        )
    column = found[0]
    stray = next((name for name in names if name != "time_s" and re.match(r"(?i)t$|time", name)), None)
    if timed and "time_s" not in names and stray is not None:
        what = f"no column time_s and no sample_rate, but a column '{one_line(stray, 40)}'"
        remedy = "did you mean 'time_s' (in seconds)? Otherwise state sample_rate in Hz under [sensor]"
        raise TunnelError(what, where=where, remedy=remedy)
    used = [name for name in ("time_s", column, driven) if name in names and name is not None]
    table = held.frame.select(used)
    if held.text:
        # a text table without the blank lines at its end
        blank = table.select(pl.all_horizontal(pl.all().is_null())).to_series().to_numpy()
        filled = np.flatnonzero(~blank)
        table = table.head(int(filled[-1]) + 1 if filled.size else 0)
    if table.height == 0:
        remedy = "record the run again or leave it out"
        raise TunnelError("the file has no samples", where=where, remedy=remedy)
    values = {name: _numbers(table.get_column(name), held.text, where) for name in used}
    return {"column": column, "input_column": driven, "values": used}, _parts(values.values())


def _input(given: dict[str, Any], contents: list[bytes]) -> Message:
    """The times and the input of a file, for `read_input`."""
    held = _held(given, contents)
    where = given["where"]
    column = _input_column(held.names, where, ANGLE)
    if column is None or "time_s" not in held.names:
        what = f"no column {'time_s' if column else ' or '.join(ANGLE.inputs)}"
        raise TunnelError(what, where=where, remedy="give it time_s in s and one input column")
    values = (_numbers(held.frame.get_column(name), held.text, where) for name in ("time_s", column))
    return {"input_column": column}, _parts(values)


def _parts(values: Iterable[Array]) -> list[memoryview]:
    return [np.ascontiguousarray(array).data for array in values]


def table_bytes(
    record: Record,
    path: Path,
    quantity: Quantity = "angle",
    drive: Input | None = None,
    freedom: Freedom = ANGLE,
) -> bytes:
    """The content of a run file, in the format of the path, with readings in SI units, to the last digit."""
    check_polars()
    given: dict[str, Array] = {} if drive is None else {freedom.own_input(drive.column): drive.values}
    reading = next(iter(freedom.columns[quantity]))
    table = pl.DataFrame({"time_s": record.time_s, reading: record.yaw_rad, **given})
    # CSV values have as few digits as identify the float
    return encoded(path, table.write_csv if path.suffix == ".csv" else table.write_parquet)


def _input_column(names: Sequence[str], where: str, freedom: Freedom) -> str | None:
    for bare, columns in WITHOUT_UNIT.items():
        if bare in names:
            remedy = f"name it {one_of(columns)}"
            raise TunnelError(f"the input column {bare} does not say its unit", where=where, remedy=remedy)
    found = [name for name in freedom.inputs if name in names]
    if len(found) > 1:
        remedy = "a run has one input: keep its column and rename the others"
        raise TunnelError(f"{len(found)} input columns: {' and '.join(found)}", where=where, remedy=remedy)
    return found[0] if found else None


def _numbers(series: pl.Series, text: bool, where: str) -> Array:
    """The values of a column as finite floats, or a message naming the first that is not finite."""
    if series.dtype == pl.String and text:
        numbers = series.str.strip_chars(' \t\r"').cast(pl.Float64, strict=False)
    else:
        numbers = series.cast(pl.Float64)
    values: NDArray[np.float64] = numbers.fill_null(np.nan).to_numpy()
    bad = np.flatnonzero(~(np.abs(values) <= limits.LARGEST_NUMBER))  # also true for NaN
    if bad.size:
        at = int(bad[0])
        cell = series[at]
        said = "no value" if cell is None or not str(cell).strip() else one_line(cell, 30)
        raise TunnelError(
            f"{series.name} is {said}{'' if said == 'no value' else ', not a finite number,'} in "
            f"{f'line {at + 2}' if text else f'row {at + 1}'} ({bad.size} such)",
            where=where,
            remedy="cut the record before it, or leave the run out",
        )
    return values


def _read_csv(content: bytes, where: str, most: int) -> FileTable:
    """A table as text."""
    check_utf8(content, where)
    check_lines(content, where, "save it again as text, or remove the damaged end")
    head = content[: content.find(b"\n") + 1] or content
    columns, lines = head.count(b",") + 1, content.count(b"\n")
    check_count(columns, limits.COLUMNS, "columns", where, "leave out columns that are not needed")
    check_count(lines - 1, most, "samples", where, "split the file, or thin it out")
    check_count(lines * columns, limits.CELLS, "cells", where, "leave out columns that are not needed")
    try:
        # all columns, though few are used: Polars does not detect an extra value in a line that it reads in
        # part
        rows = pl.read_csv(content, has_header=False, infer_schema=False, quote_char=None)
    except pl.exceptions.PolarsError as error:
        what = f"not a comma-separated table ({one_line(error, 60)})"
        remedy = "give every line one value for each column, with commas between and decimal points"
        raise TunnelError(what, where=where, remedy=remedy) from None
    names = [str(name or "").strip().strip('"').strip() for name in rows.row(0)]
    for name in names:
        with suppress(ValueError):
            float(name)
            remedy = "name the columns in the first line, such as time_s,yaw_rad"
            raise TunnelError("no header line", where=where, remedy=remedy)
    if len(names) == 1 and re.search(r"[;\t]", names[0]):
        raise TunnelError("not comma-separated", where=where, remedy="put commas between the columns")
    twice = next((name for name in names if name in USED_COLUMNS and names.count(name) > 1), None)
    if twice is not None:
        raise TunnelError(f"the column {twice} occurs twice", where=where, remedy="leave one of them out")
    # other columns without a name, or with a duplicate name, are named by their position
    names = [name if name and names.count(name) == 1 else f"(column {i + 1})" for i, name in enumerate(names)]
    used = [i for i, name in enumerate(names) if name in USED_COLUMNS]
    frame = rows[1:, used]
    frame.columns = [names[i] for i in used]
    return FileTable(frame, names, text=True)


CSV = Reader("a comma-separated table", limits.CSV_BYTES, read_run=_read_csv)
"""Run files as comma-separated text."""
