"""Step 1 of an import: read the tables of a file, by the reader of its format, in a process with limits."""

from __future__ import annotations

import hashlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.formats.labview import MAGIC, read_labview_tables
from tunnel_sim.files.importing.formats.text import TEXT, read_text_tables
from tunnel_sim.files.importing.tables import Channel, Table, by_run, with_input_facts
from tunnel_sim.files.kept_process import read_apart
from tunnel_sim.files.readers import load_reader, reader_place
from tunnel_sim.files.reading import PACKED, check_count, is_blank, read_regular, unpacked
from tunnel_sim.forks import polars_works
from tunnel_sim.sandbox import Message
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, shown


def read_guarded(
    reader: str | None, content: bytes, where: str, choices: ImportChoices
) -> tuple[list[Table], dict[str, str]]:
    """The tables of a file, read in the kept process, and the known properties of a table of text.

    Args:
        reader: place ``module:name`` of the reader; None: text.
    """
    dialect = {"delimiter": choices.delimiter, "decimal": choices.decimal}
    found, arrays = read_apart(_read, {"reader": reader, "where": where, "dialect": dialect}, content, where)
    values = (np.frombuffer(array) for array in arrays)
    tables = []
    for table in found["tables"]:
        channels = tuple(Channel(name, next(values), *more) for name, *more in table["channels"])
        listed = {key: tuple(table[key]) for key in ("remarks", "native")}
        apart = tuple(tuple(column) for column in table["apart"])
        tables.append(Table(**table | listed | {"channels": channels, "apart": apart}))
    return tables, found["known"]


def _read(request: dict[str, Any], contents: list[bytes]) -> Message:
    """The tables of a file, as JSON and the values of all columns."""
    known: dict[str, str] = {}
    content, where = contents.pop(), request["where"]
    if request["reader"] is None:
        tables, known = _text_tables(content, where, ImportChoices(**request["dialect"]))
    else:
        tables = pkgutil.resolve_name(request["reader"]).read_tables(content, where)
    described = [
        {field.name: getattr(table, field.name) for field in fields(Table)}
        | {"channels": [(c.name, c.unit, c.place, c.fault) for c in table.channels]}
        for table in tables
    ]
    columns = [np.ascontiguousarray(c.values, np.float64) for table in tables for c in table.channels]
    return {"tables": described, "known": known}, [column.data for column in columns]


def _text_tables(content: bytes, where: str, choices: ImportChoices) -> tuple[list[Table], dict[str, str]]:
    """The tables of a file of text, and its known properties; LabVIEW's files have headers of their own."""
    if content.startswith(MAGIC):
        return read_labview_tables(content, where)
    return read_text_tables(content, where, choices)


@dataclass(frozen=True, eq=False)
class Source:
    """A file that was read: its SHA-256, its tables in their order, and how it was read, for the recipe."""

    path: Path
    sha256: str
    tables: tuple[Table, ...]
    known: Mapping[str, str] = field(default_factory=dict)


_GZIP = b"\x1f\x8b"
_BEGINNINGS = {
    b"PK\x03\x04": "an Excel workbook or another archive",
    b"\x89HDF": "an HDF5 file",
    b"MATLAB": "a MAT file",
    b"TDSm": "a TDMS file",
    b"PAR1": "a Parquet file",
    b"\x89MCAP": "an MCAP log",
    b"SQLite format 3": "a log of ROS 2, or another SQLite database",
    b"MDF ": "an MDF file",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (.xls); save it as .xlsx",
    b"%PDF": "a PDF document",
    _GZIP: "a file compressed by gzip; end its name with .gz",
}


def read_source(path: Path, choices: ImportChoices) -> Source:
    """Read a file of any known format; the meaning of its columns is found later."""
    where = shown(path)
    packed = path.suffix.lower() == PACKED
    ending = Path(path.stem if packed else path.name).suffix.lower()
    reader, place = load_reader(ending), reader_place(ending)
    if reader is None or reader.read_tables is None:
        reader, place = TEXT, None
    content = read_regular(path, reader.limit)
    digest = hashlib.sha256(content).hexdigest()
    if packed and content.startswith(_GZIP):
        content = unpacked(content, reader.limit, where)
    if is_blank(content):
        raise TunnelError("the file is empty", where=where, remedy="name a file with a record")
    if not reader.magic or not content.startswith(reader.magic):
        really = next((kind for magic, kind in _BEGINNINGS.items() if content.startswith(magic)), None)
        if really is not None or reader.magic:
            what = f"is not {reader.kind}" + (f": it begins like {really}" if really else "")
            remedy = "give the file the ending of its format, or export it again"
            raise TunnelError(what, where=where, remedy=remedy)
    if place is None and polars_works():
        tables, known = _text_tables(content, where, choices)
    else:
        tables, known = read_guarded(place, content, where, choices)
    readable = []
    for table in (table for table in tables if table.channels):
        channels, said = [], [*table.remarks]
        for channel in table.channels:
            wild = np.abs(channel.values) > limits.LARGEST_NUMBER  # its powers would overflow
            if wild.any():
                said.append(
                    f"{counted(int(wild.sum()), 'number')} beyond {limits.LARGEST_NUMBER:g} taken as missing"
                )
                channel = replace(channel, values=np.where(wild, np.nan, channel.values))
            channels.append(channel)
        table = replace(table, channels=tuple(channels), remarks=tuple(said))
        parts = (with_input_facts(part) for part in by_run(table))
        # a column that names the runs, or states the input, may be alone in its table
        readable += [part for part in parts if part.channels]
    if not readable:
        remedy = "name a file with times and angles"
        raise TunnelError("no column of numbers", where=where, remedy=remedy)
    count = sum(table.channels[0].values.size for table in readable)
    check_count(count, limits.CAMPAIGN_SAMPLES, "samples", where, "split the file")
    return Source(path, digest, tuple(readable), known)
