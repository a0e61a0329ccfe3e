"""TDMS files of LabVIEW."""

from __future__ import annotations

import io

import numpy as np

from tunnel_sim.files.importing.arrays import check_size
from tunnel_sim.files.importing.faults import faults
from tunnel_sim.files.importing.tables import Channel, Table, known_unit, split_unit
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import library

LIMIT = limits.DATA_BYTES
"""Largest file, bytes."""
MAGIC = (b"TDSm",)
"""How such a file begins."""
KIND = "a TDMS file"
"""As messages name it."""


def read(content: bytes, where: str) -> list[Table]:
    """The tables of a TDMS file, one for each group; arguments as in `source.LibraryReader`."""
    nptdms = library("nptdms", "TDMS", "import", where)
    tables = []
    with faults(KIND, where), nptdms.TdmsFile.open(io.BytesIO(content)) as file:
        groups = file.groups()
        channels = [channel for group in groups for channel in group.channels()]
        check_count(
            len(channels), limits.COLUMNS, "channels", where, "leave out channels that are not needed"
        )
        check_size(sum(len(channel) for channel in channels), where)
        for group in groups:
            numeric = [c for c in group.channels() if len(c) and np.dtype(c.dtype).kind in "iufb"]
            for length in dict.fromkeys(len(channel) for channel in numeric):
                facts = _numbers(file.properties) | _numbers(group.properties)
                columns = []
                for channel in numeric:
                    if len(channel) == length:
                        name, unit = split_unit(channel.name)
                        stated = str(channel.properties.get("unit_string", ""))
                        facts |= _numbers(channel.properties)
                        columns.append(
                            Channel(name, channel[:].astype(np.float64), known_unit(stated) or unit)
                        )
                part = group.name if len(groups) > 1 else ""
                said = (f"TDMS file: group '{group.name}', {len(columns)} channels of {length} samples",)
                tables.append(Table(tuple(columns), part, facts, said))
    return tables


def _numbers(properties: dict[str, object]) -> dict[str, float]:
    return {
        name: float(value) for name, value in properties.items() if isinstance(value, int | float | np.number)
    }
