"""Tables of MDF 4 files (ASAM), channel group by channel group."""

from __future__ import annotations

import io
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np

from tunnel_sim.files.importing.formats.arrays import check_size
from tunnel_sim.files.importing.formats.stamps import StampedColumns, in_order, stamped_tables
from tunnel_sim.files.importing.tables import Channel, Table
from tunnel_sim.files.importing.units import known_unit, split_unit
from tunnel_sim.files.readers import Reader, faults
from tunnel_sim.files.reading import check_count
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, library, one_line

_MAGIC = b"MDF     "
_REMEDY = "export it again as MDF 4, or as text"


def _read(content: bytes, where: str) -> list[Table]:
    """The tables of an MDF file, one for each clock."""
    asammdf = library("asammdf", "MDF", "import", where)
    clocks: list[StampedColumns] = []
    left_out: list[str] = []
    with faults("an MDF file", where), closing(asammdf.MDF(io.BytesIO(content))) as file:
        count = sum(len(group.channels) for group in file.groups)
        check_count(count, limits.COLUMNS, "channels", where, "leave out channels that are not needed")
        check_size(sum(len(group.channels) * group.channel_group.cycles_nr for group in file.groups), where)
        for number, group in enumerate(file.groups):
            name = (
                _text(group.channel_group.acq_name)
                or _text(group.channel_group.comment)
                or f"group {number + 1}"
            )
            clock = file.masters_db.get(number)
            if clock is None:
                left_out.append(f"'{one_line(name, 40)}' is left out: no channel of it has times")
                continue
            clocks.append(_columns(file, number, name, clock, where))
    tables = stamped_tables(clocks, "MDF file", where)
    return [replace(table, remarks=(*table.remarks, *left_out)) for table in tables]


def _text(stated: Any) -> str:
    """A name or a comment in one line; empty if it is XML."""
    text = str(stated or "").strip()
    return "" if text.startswith("<") else one_line(text, 40)


def _columns(file: Any, number: int, name: str, clock: int, where: str) -> StampedColumns:
    """The numeric channels of a group in physical units, on the times of its master channel; one sample is a fact.

    Args:
        name: name of the group.
        clock: index of the master channel.
    """
    group = file.groups[number]
    channels: dict[str, Channel] = {}
    facts: dict[str, float] = {}
    time_s = np.empty(0)
    for index, stated in enumerate(group.channels):
        if index == clock:
            continue
        signal = file.get(group=number, index=index)
        size = group.channel_group.cycles_nr
        if len(signal.samples) != size or len(signal.timestamps) != size:
            has = f"{len(signal.samples)} of {counted(size, 'sample')}"
            what = f"is cut off: '{one_line(stated.name, 40)}' has {has}"
            raise TunnelError(what, where=where, remedy=_REMEDY)
        if signal.samples.dtype.kind not in "iufb" or signal.samples.ndim != 1:
            continue
        values = signal.samples.astype(np.float64)
        if signal.invalidation_bits is not None:
            values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
        label, unit = split_unit(stated.name)
        unit = known_unit(signal.unit or "") or (signal.unit or "").strip() or unit
        if size == 1:
            facts[f"{label} [{unit}]" if unit else label] = float(values[0])
            continue
        label = label if label not in channels else f"{label} {index}"
        channels[label] = Channel(label, values, unit)
        time_s = signal.timestamps.astype(np.float64)
    time_s, ordered, repeated = in_order(time_s, list(channels.values()))
    remarks = [f"'{name}': {counted(repeated, 'sample')} at a repeated time left out"] if repeated else []
    return StampedColumns(name, time_s, ordered, tuple(remarks), facts)


MDF = Reader("an MDF file", limits.DATA_BYTES, (_MAGIC, b"UnFinMF "), read_tables=_read)
