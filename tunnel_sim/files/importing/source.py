"""Files of any known format as tables, before anybody knows what their columns mean."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tunnel_sim.files.importing.conditions import ImportChoices
from tunnel_sim.files.importing.guard import read_guarded
from tunnel_sim.files.importing.tables import Table, by_run, with_input_facts
from tunnel_sim.files.importing.text import TEXT, read_text_tables
from tunnel_sim.files.readers import Reader, load_reader, reader_place
from tunnel_sim.files.reading import check_count, read_regular
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, shown


@dataclass(frozen=True, eq=False)
class Source:
    """A file that was read.

    Args:
        path: of the file.
        sha256: of its content.
        tables: in the order of the file.
        known: how it was read, for the recipe.
    """

    path: Path
    sha256: str
    tables: tuple[Table, ...]
    known: Mapping[str, str] = field(default_factory=dict)


_BEGINNINGS = {
    b"PK\x03\x04": "an Excel workbook or another archive",
    b"\x89HDF": "an HDF5 file",
    b"MATLAB": "a MAT file",
    b"TDSm": "a TDMS file",
    b"PAR1": "a Parquet file",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (.xls); save it as .xlsx",
    b"%PDF": "a PDF document",
    b"\x1f\x8b": "a compressed file; unpack it",
}


def read_source(path: Path, choices: ImportChoices) -> Source:
    """Read a file of any known format.

    Returns:
        Its tables. Nothing is known yet about the meaning of their columns.

    Raises:
        TunnelError: no such file, too large, or not of the format that its name says.
    """
    where = shown(path)
    ending = path.suffix.lower()
    reader, place = load_reader(ending), reader_place(ending)
    if reader is None or reader.read_tables is None:
        reader, place = TEXT, None
    content = read_regular(path, reader.limit)
    if not content.strip():
        raise TunnelError("the file is empty", where=where, remedy="name a file that holds a record")
    _check_beginning(content, reader, where)
    known: dict[str, str] = {}
    if place is None:
        tables, known = read_text_tables(content, where, choices)
    else:
        tables = read_guarded(place, content, where)
    tables = [
        with_input_facts(part) for table in tables if table.channels for part in by_run(_computable(table))
    ]
    if not tables:
        raise TunnelError(
            "no column of numbers", where=where, remedy="name a file that holds times and angles"
        )
    count = sum(table.channels[0].values.size for table in tables)
    check_count(count, limits.CAMPAIGN_SAMPLES, "samples", where, "split the file")
    return Source(path, hashlib.sha256(content).hexdigest(), tuple(tables), known)


def _computable(table: Table) -> Table:
    """The table without infinities and numbers whose powers would overflow."""
    channels, said = [], []
    for channel in table.channels:
        wild = np.abs(channel.values) > limits.LARGEST_NUMBER
        if wild.any():
            said.append(f"{int(wild.sum())} numbers beyond {limits.LARGEST_NUMBER:g} are taken as missing")
            channel = replace(channel, values=np.where(wild, np.nan, channel.values))
        channels.append(channel)
    return replace(table, channels=tuple(channels), said=(*table.said, *said)) if said else table


def _check_beginning(content: bytes, reader: Reader, where: str) -> None:
    if reader.magic and content.startswith(reader.magic):
        return
    really = next((kind for magic, kind in _BEGINNINGS.items() if content.startswith(magic)), None)
    if really is not None or reader.magic:
        remedy = "give the file the ending of its format, or export it again"
        raise TunnelError(
            f"is not {reader.kind}" + (f": it begins like {really}" if really else ""),
            where=where,
            remedy=remedy,
        )
