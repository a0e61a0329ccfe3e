"""Tables of JSON files: arrays by name, lists of records, rows below a list of names, and a record on each line."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tunnel_sim.files.importing.formats.arrays import NamedArrays, check_size, tables_of_arrays
from tunnel_sim.files.importing.formats.layout import Layout
from tunnel_sim.files.importing.formats.text import tables_of
from tunnel_sim.files.importing.tables import LEAST_ROWS, Table, by_texts, names_runs
from tunnel_sim.files.importing.units import kind_of, known_unit, names_a_time, split_unit
from tunnel_sim.files.readers import Reader, faults
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError

_UNITS = ("unit", "units", "einheit", "einheiten")
_NAMES = ("columns", "names", "fields", "channels", "header", "spalten")
"""Members that name the columns of a matrix beside them."""


@dataclass(frozen=True)
class _Document(NamedArrays):
    """The content of a document so far.

    Args:
        labels: name and cells of a column that names the runs, by path.
        stated: unit that a group states for its readings.
    """

    labels: dict[str, tuple[str, pl.Series]] = field(default_factory=dict)
    stated: dict[str, str] = field(default_factory=dict)


def _read(content: bytes, where: str) -> list[Table]:
    """The tables of a JSON document."""
    with faults("a JSON file", where):
        return _tables(json.loads(content.decode("utf-8-sig")), where)


def _read_lines(content: bytes, where: str) -> list[Table]:
    """The tables of a file with a JSON record on each line."""
    with faults("a file of JSON lines", where):
        return _tables(
            [json.loads(line) for line in content.decode("utf-8-sig").splitlines() if line.strip()], where
        )


def _tables(document: Any, where: str) -> list[Table]:
    content = _Document()
    _visit(document, "", content)
    check_count(len(content.arrays), limits.COLUMNS, "arrays", where, "leave out arrays that are not needed")
    check_size(sum(array.size for array in content.arrays.values()), where)
    tables = tables_of_arrays(content, "JSON file")
    if not any(table.channels and table.channels[0].values.size >= LEAST_ROWS for table in tables):
        remedy = "write times and angles as arrays by name, or as a list of records"
        raise TunnelError("no arrays of numbers", where=where, remedy=remedy)
    return [part for table in tables for part in _labelled(_in_stated_unit(table, content), content)]


def _visit(value: Any, path: str, content: _Document) -> None:
    """Find arrays, numbers and texts in a value of the document."""
    if isinstance(value, dict):
        if (indexed := _indexed(value)) is not None:
            _visit(indexed, path, content)
            return
        _visit_members(value, path, content)
    elif isinstance(value, list):
        _visit_list(value, path, content)
    elif isinstance(value, str):
        group, _, name = path.rpartition("/")
        if name.lower() in _UNITS:
            content.stated[group] = known_unit(value) or ""
        else:
            content.add_text(path, value)
    elif isinstance(value, int | float):
        content.arrays[path or "value"] = np.array(float(value))


def _visit_members(value: Mapping[str, Any], path: str, content: _Document) -> None:
    units = next(
        (entry for key, entry in value.items() if key.lower() in _UNITS and isinstance(entry, dict)), {}
    )
    names = next((entry for key, entry in value.items() if key.lower() in _NAMES and _are_texts(entry)), None)
    arrays = [key for key, entry in value.items() if isinstance(entry, list) and _are_numbers(entry)]
    for key, member in value.items():
        below = f"{path}/{key}" if path else key
        if member is units or member is names:
            continue
        matrix = isinstance(member, list) and member and all(isinstance(row, list) for row in member)
        if names is not None and matrix and all(len(row) == len(names) for row in member):
            _visit_list([dict(zip(names, row, strict=True)) for row in member], below, content)
        elif isinstance(value.get("name"), str) and arrays == [key]:  # a channel with its own description
            group = path.rpartition("/")[0]
            own = f"{group}/{value['name']}" if group else value["name"]
            _visit(member, own, content)
            texts = {k.lower(): entry for k, entry in value.items() if isinstance(entry, str)}
            own_unit = next((texts[k] for k in _UNITS if k in texts), "")
            content.units[own] = known_unit(own_unit) or own_unit
        else:
            _visit(member, below, content)
            if isinstance(unit := units.get(key), str):
                content.units[below] = known_unit(unit) or unit


def _visit_list(value: Sequence[Any], path: str, content: _Document) -> None:
    if _are_numbers(value):
        if len(value) > 1:
            content.arrays[path or "column"] = _numbers(value)
    elif value and all(
        isinstance(row, list) and _are_numbers(row) and len(row) == len(value[0]) for row in value
    ):
        content.arrays[path or "column"] = np.stack([_numbers(row) for row in value])
    elif value and all(isinstance(row, dict) and _is_flat(row) for row in value):
        _visit_records(value, path, content)
    else:
        # members of the group above: channels with their own descriptions, or a group for each run
        for i, member in enumerate(value, 1):
            described = isinstance(member, dict) and isinstance(member.get("name"), str)
            _visit(member, f"{path}/{i}" if described else f"{path}[{i}]", content)


def _visit_records(rows: Sequence[Mapping[str, Any]], path: str, content: _Document) -> None:
    """Records with equal members: a column for each member."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    series = []
    for name in names:
        cells = [row.get(name) for row in rows]
        texts = any(isinstance(cell, str) for cell in cells)
        kind = pl.String if texts else pl.Float64
        given = [None if cell is None else str(cell) if texts else float(cell) for cell in cells]
        series.append(pl.Series(name, given, dtype=kind))
    split = [split_unit(name) for name in names]
    layout = Layout(0, tuple(name for name, _ in split), tuple(unit for _, unit in split), True, {})
    (table,) = tables_of(pl.DataFrame(series), layout, ".", None, Table((), remarks=("",)))
    for channel in table.channels:
        own = f"{path}/{channel.name}" if path else channel.name
        content.arrays[own] = channel.values
        content.units[own] = channel.unit
    for column in series:
        if names_runs(column.name) and column.dtype == pl.String:
            content.labels[path] = column.name, column


def _in_stated_unit(table: Table, found: _Document) -> Table:
    """A table with one reading without a unit; it takes the unit stated by its group, or the document."""
    unit = found.stated.get(table.part) or found.stated.get("", "")
    bare = [c for c in table.channels if not c.unit and not names_a_time(c.name) and not names_runs(c.name)]
    if kind_of(unit) in ("", "time") or len(bare) != 1:
        return table
    said = f"'{bare[0].name}' is in {unit}, the unit that the file states"
    channels = tuple(replace(c, unit=unit) if c is bare[0] else c for c in table.channels)
    return replace(table, channels=channels, remarks=(*table.remarks, said))


def _labelled(table: Table, found: _Document) -> list[Table]:
    """A table of records run by run where a member names the runs in words."""
    for name, labels in found.labels.values():
        if table.channels and labels.len() == table.channels[0].values.size:
            return by_texts(table, name, labels)
    return [table]


def _indexed(value: Mapping[str, Any]) -> list[Any] | None:
    """The values of a mapping from row numbers, as some programs write a column; None for any other."""
    numbered = len(value) >= LEAST_ROWS and all(key.isdigit() for key in value)
    return list(value.values()) if numbered else None


def _is_flat(row: Mapping[str, Any]) -> bool:
    return all(cell is None or isinstance(cell, int | float | str) for cell in row.values())


def _are_numbers(value: Sequence[Any]) -> bool:
    return bool(value) and all(cell is None or isinstance(cell, int | float) for cell in value)


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(cell, str) for cell in value)


def _numbers(value: Sequence[Any]) -> NDArray[np.float64]:
    return np.array([np.nan if cell is None else float(cell) for cell in value])


JSON = Reader("a JSON file", limits.CSV_BYTES, read_tables=_read)
JSON_LINES = Reader("a file of JSON lines", limits.CSV_BYTES, read_tables=_read_lines)
