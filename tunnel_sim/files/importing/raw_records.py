"""From the tables of a file to records of times and angles, cleaned but not yet cut."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.cleaning import Cleaned, cleaned, restarts, without_overflow
from tunnel_sim.files.importing.columns import Pair, find_pairs
from tunnel_sim.files.importing.conditions import from_facts
from tunnel_sim.files.importing.conversion import Calibration, in_radians, in_seconds, sample_interval
from tunnel_sim.files.importing.source import Channel, Source, Table
from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_LEAST_ROWS = 16


@dataclass(frozen=True, eq=False)
class Raw:
    """A record of a file, cleaned but not yet cut.

    Args:
        id: of its runs, without their number.
        source: the file.
        column: the reading's column.
        cleaned: times and readings.
        quantity: what the readings are.
        unit: that the readings had in the file.
        stated: conditions in the file.
        said: how it was read, and what was changed.
    """

    id: str
    source: Path
    column: str
    cleaned: Cleaned
    quantity: Quantity
    unit: str
    stated: dict[str, float]
    said: tuple[str, ...]


def raw_records(
    source: Source,
    choices: ImportChoices,
    calibration: Calibration | None,
    named: dict[str, float],
    *,
    several: bool,
) -> list[Raw]:
    """The records of a file.

    Args:
        source: the file.
        calibration: of a voltage.
        named: conditions in the file's name.
        several: whether ids must name the file, because there are others.

    Raises:
        TunnelError: when columns or units must be stated, or a record has fewer than two samples.
    """
    # A short table beside longer ones holds conditions or sizes.
    long = [table for table in source.tables if table.channels[0].values.size >= _LEAST_ROWS]
    tables = long or source.tables
    return [
        raw for table in tables for raw in _raws(source, table, choices, calibration, named, several=several)
    ]


def _raws(
    source: Source,
    table: Table,
    choices: ImportChoices,
    calibration: Calibration | None,
    named: dict[str, float],
    *,
    several: bool,
) -> list[Raw]:
    """The records of a table."""
    where = shown(source.path) + (f", {one_line(table.part)}" if table.part else "")
    found = []
    for pair in find_pairs(table, choices, where):
        said = [*pair.said]
        time = _times(pair, table, choices, said, where)
        values = without_overflow(pair.reading.values, said)
        reading = Channel(pair.reading.name, values, pair.reading.unit)
        readings, quantity, unit = in_radians(reading, choices, calibration, said, where)
        time, readings = _within(time, readings, choices, said)
        names = [source.path.stem if several or not (table.part or pair.run) else "", table.part, pair.run]
        name = one_line("-".join(part for part in names if part))
        stated = from_facts(table.facts) | named
        said += [f"{key} = {value:g} from the file" for key, value in stated.items()]
        starts = [0, *restarts(time), time.size]
        if len(starts) > 2:
            said.append(f"the clock starts anew {len(starts) - 2} times: another run each")
        for place, (a, b) in enumerate(itertools.pairwise(starts), 1):
            clean = cleaned(time[a:b], readings[a:b])
            label = name if len(starts) == 2 else f"{name}-{place}"
            if clean.time_s.size < 2:
                raise TunnelError("fewer than two samples", where=where, remedy="leave it out")
            found.append(
                Raw(
                    label, source.path, pair.reading.name, clean, quantity, unit, stated, (*said, *clean.said)
                )
            )
    return found


def _times(pair: Pair, table: Table, choices: ImportChoices, said: list[str], where: str) -> Array:
    """The times of a run, s."""
    if pair.time is not None:
        values = without_overflow(pair.time.values, said)
        return in_seconds(Channel(pair.time.name, values, pair.time.unit), choices, said)
    interval, origin = sample_interval(table.facts, choices)
    if interval is None:
        raise TunnelError("no column of times", where=where, remedy="give --time NAME, or --rate in Hz")
    said.append(f"times at {1.0 / interval:.6g} Hz: {origin}")
    return np.arange(pair.reading.values.size, dtype=np.float64) * interval


def _within(time: Array, reading: Array, choices: ImportChoices, said: list[str]) -> tuple[Array, Array]:
    """The samples between the stated start and end."""
    first = -np.inf if choices.start is None else choices.start
    last = np.inf if choices.end is None else choices.end
    if choices.start is None and choices.end is None:
        return time, reading
    # Stamps are decimals: a start at one of them includes it.
    slack = 1e-9 * max(abs(first) if np.isfinite(first) else 0.0, abs(last) if np.isfinite(last) else 0.0)
    kept = (time >= first - slack) & (time <= last + slack)
    said.append(f"{int(kept.sum())} of {time.size} samples lie from --start to --end")
    return time[kept], reading[kept]
