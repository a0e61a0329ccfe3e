"""Tables of binary formats: Parquet, MATLAB, HDF5 and TDMS."""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Literal, cast

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tunnel_sim.files.importing.formats.arrays import NamedArrays, check_size, tables_of_arrays
from tunnel_sim.files.importing.formats.layout import facts_in
from tunnel_sim.files.importing.formats.waveforms import Waveform, aligned_tables
from tunnel_sim.files.importing.tables import Channel, Table, by_texts, names_runs
from tunnel_sim.files.importing.units import known_unit, split_unit
from tunnel_sim.files.readers import FileTable, Reader, faults
from tunnel_sim.files.reading import check_count, frame_schema, read_frame
from tunnel_sim.files.run_files import USED_COLUMNS
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, library, one_line

_REMEDY = "write the file again, as Parquet or as text"
_TDMS_UNITS = ("unit_string", "NI_UnitDescription")
_TDMS_CLOCK = (
    "wf_start_time", "wf_start_offset", "wf_increment", "wf_samples", "wf_xname", "wf_xunit_string",
    "wf_time_pref",
)  # fmt: skip
"""Properties of a channel that state its unit, and its clock."""


def _read_run(content: bytes, where: str, most: int) -> FileTable:
    """The used columns of a run file."""
    remedy = "write the file again, as Parquet or as CSV"
    schema = frame_schema(content, where, remedy, rows=most, counted="samples")
    used = [name for name in schema if name in USED_COLUMNS]
    for name in used:
        if not schema[name].is_numeric():
            what = f"the column {name} holds {one_line(schema[name], 30)}, not numbers"
            raise TunnelError(what, where=where, remedy=f"write {name} as floating-point numbers")
    return FileTable(read_frame(content, where, remedy, used), tuple(schema))


def _read_tables(content: bytes, where: str) -> list[Table]:
    """The table of a Parquet file, split into runs if a column names them."""
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
    said = f"Parquet file: {counted(len(channels), 'column')} of {counted(frame.height, 'sample')}"
    table = Table(tuple(channels), remarks=(said,))
    return [table] if runs is None else by_texts(table, runs, frame.get_column(runs))


PARQUET = Reader("a Parquet file", limits.DATA_BYTES, (b"PAR1",), _read_run, _read_tables, run_apart=True)
_PACKING = ("scale_factor", "add_offset", "_FillValue")
_COMPRESSED = 15  # data type of an element compressed by zlib
_HEADER = 128  # bytes before the first element of version 5


def _read_hdf5(content: bytes, where: str) -> list[Table]:
    """The tables of an HDF5 file."""
    h5py = library("h5py", "HDF5 (also MAT 7.3)", "import", where)
    with faults("an HDF5 file", where), h5py.File(io.BytesIO(content), "r") as file:
        datasets: dict[str, Any] = {}
        found = NamedArrays()

        def visit(path: str, item: Any) -> None:
            remedy = "leave out datasets that are not needed"
            check_count(len(datasets), limits.COLUMNS, "datasets", where, remedy)
            if (
                isinstance(item, h5py.Dataset)
                and not path.startswith("#refs#")
                and not (item.attrs.get("MATLAB_class") in (b"char", "char") or "MATLAB_empty" in item.attrs)
            ):
                datasets[path] = item
            group = isinstance(item, h5py.Group)
            for name in item.attrs:
                held = item.attrs.get_id(name)  # other texts are not read: a text may be in a damaged heap
                if held.dtype.kind in "iuf" and held.get_space().get_simple_extent_npoints() == 1:
                    folder = path if group else path.rpartition("/")[0]
                    found.arrays[f"{folder}/{name}".lstrip("/")] = np.asarray(item.attrs[name])
                elif group and isinstance(text := item.attrs[name], str):
                    found.add_text(f"{path}/{name}".lstrip("/"), text)

        visit("", file)
        file.visititems(visit)  # links are not followed, so nothing outside the file is opened
        check_size(sum(int(np.prod(item.shape, dtype=float)) for item in datasets.values()), where)
        for path, item in datasets.items():
            if item.external or item.is_virtual or item.shape is None:
                continue
            if item.dtype.names:  # one array for each field
                table = item[()]
                found.arrays.update({f"{path}/{name}": table[name] for name in item.dtype.names})
            elif item.dtype.kind in "iufb":
                found.arrays[path] = _unpacked(item)
        found.units.update({path: unit for path, item in datasets.items() if (unit := _hdf5_unit(item))})
    return tables_of_arrays(found, "HDF5 file")


def _unpacked(item: Any) -> NDArray[np.generic]:
    """The numbers of a dataset, by the attributes with which netCDF packs them into integers."""
    numbers: NDArray[np.generic] = item[()]
    stated = {name: np.asarray(item.attrs[name]) for name in _PACKING if name in item.attrs}
    stated = {name: value.reshape(-1)[0] for name, value in stated.items() if value.dtype.kind in "iuf"}
    if not stated:
        return numbers
    values = numbers.astype(np.float64)
    if "_FillValue" in stated:
        values[numbers == stated["_FillValue"]] = np.nan
    return values * stated.get("scale_factor", 1.0) + stated.get("add_offset", 0.0)


def _hdf5_unit(item: Any) -> str:
    """The unit stated by an attribute of a dataset."""
    for name in ("unit", "units", "Unit", "Units"):
        text = item.attrs.get(name, "")
        if found := known_unit(text.decode(errors="replace") if isinstance(text, bytes) else str(text)):
            return found
    return ""


def _read_mat(content: bytes, where: str) -> list[Table]:
    """The tables of a MAT file."""
    if content.startswith((b"MATLAB 7.3", b"\x89HDF")):
        return _read_hdf5(content, where)
    from scipy.io import loadmat

    with faults("a MAT file", where):
        total = 0 if content.startswith(b"MATLAB") else len(content)
        at = len(content) if total else _HEADER
        order: Literal["little", "big"] = "little" if content[126:128] == b"IM" else "big"
        while at + 8 <= len(content):  # each element states its size in its first eight bytes
            kind, size = (int.from_bytes(content[at + i : at + i + 4], order) for i in (0, 4))
            if kind == _COMPRESSED:
                start = zlib.decompressobj().decompress(content[at + 8 : at + 8 + size], 8)
                total += int.from_bytes(start[4:8], order)
            else:
                total += size
            at += 8 + size
        check_size(total // 8, where)
        held = loadmat(cast(Any, io.BytesIO(content)), simplify_cells=True)  # the stubs know only paths
    found = NamedArrays()
    for path, value in _leaves({name: one for name, one in held.items() if not name.startswith("__")}):
        if isinstance(value, str):
            found.add_text(path, value)
        else:
            found.arrays[path] = value
    return tables_of_arrays(found, "MAT file")


def _leaves(value: object, path: str = "") -> Iterator[tuple[str, NDArray[np.generic] | str]]:
    """Arrays and texts of structures and cells, by path."""
    if isinstance(value, dict):
        for name, member in value.items():
            yield from _leaves(member, f"{path}/{name}" if path else str(name))
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
        for i, member in enumerate(np.ravel(value) if isinstance(value, np.ndarray) else value, 1):
            yield from _leaves(member, f"{path}[{i}]")
    elif isinstance(value, str):
        yield path, value
    elif isinstance(value, int | float | np.ndarray | np.generic):
        yield path, np.asarray(value)


def _read_tdms(content: bytes, where: str) -> list[Table]:
    """The tables of a TDMS file, one for each group."""
    nptdms = library("nptdms", "TDMS", "import", where)
    tables = []
    with faults("a TDMS file", where), nptdms.TdmsFile.open(io.BytesIO(content)) as file:
        groups = file.groups()
        channels = [channel for group in groups for channel in group.channels()]
        remedy = "leave out channels that are not needed"
        check_count(len(channels), limits.COLUMNS, "channels", where, remedy)
        check_size(sum(len(channel) for channel in channels), where)
        for group in groups:
            part = group.name if len(groups) > 1 else ""
            waves = [
                _tdms_wave(place, channel)
                for place, channel in enumerate(group.channels(), 1)
                if len(channel) and np.dtype(channel.dtype).kind in "iufb"
            ]
            stated = file.properties | group.properties
            numbers, texts = _tdms_stated(stated)
            for table in aligned_tables(waves, f"TDMS file: group '{group.name}'", "wf_increment"):
                facts = {**numbers, **table.facts}
                tables.append(replace(table, part=part, facts=facts, texts={**texts, **table.texts}))
    return tables


def _tdms_wave(place: int, channel: Any) -> Waveform:
    """A channel with the clock and the unit stated by its properties."""
    properties = channel.properties
    name, unit = split_unit(channel.name)
    stated = next((str(properties[key]).strip() for key in _TDMS_UNITS if properties.get(key)), "")
    clock = {key: properties[key] for key in _TDMS_CLOCK if key in properties}
    offset, increment = (
        float(value) if isinstance(value := clock.get(key), int | float | np.number) else 0.0
        for key in ("wf_start_offset", "wf_increment")
    )
    start = clock.get("wf_start_time")
    since = int(start.astype("datetime64[ns]").astype(np.int64)) if isinstance(start, np.datetime64) else None
    others = {key: value for key, value in properties.items() if key not in (*_TDMS_CLOCK, *_TDMS_UNITS)}
    column = Channel(name, channel[:].astype(np.float64), known_unit(stated) or stated or unit, place)
    return Waveform(column, increment, offset, since, *_tdms_stated(others))


def _tdms_stated(properties: Mapping[str, object]) -> tuple[dict[str, float], dict[str, str]]:
    """The numbers that properties state, also in texts such as ``12 m/s``, and the other texts."""
    numbers: dict[str, float] = {}
    texts: dict[str, str] = {}
    for name, value in properties.items():
        if isinstance(value, int | float | np.number):
            numbers[name] = float(value)
        elif isinstance(value, str) and (found := facts_in([f"{name}: {value}"])):
            numbers |= found
        elif isinstance(value, str) and value.strip():
            texts[name] = value
    return numbers, texts


HDF5 = Reader("an HDF5 file", limits.DATA_BYTES, (b"\x89HDF",), read_tables=_read_hdf5)

MAT = Reader(
    "a MAT file",
    limits.DATA_BYTES,
    # Version 5, version 7.3 without its first block, and version 4.
    (b"MATLAB", b"\x89HDF", b"\x00\x00\x00\x00", b"\x0a\x00\x00\x00"),
    read_tables=_read_mat,
)

TDMS = Reader("a TDMS file", limits.DATA_BYTES, (b"TDSm",), read_tables=_read_tdms)
