"""From the tables of a file to records of times and angles, cleaned but not yet cut."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.cleaning import Cleaned, cleaned, restarts, without_overflow
from tunnel_sim.files.importing.columns import (
    Calibration,
    ColumnPair,
    find_pairs,
    in_radians,
    in_seconds,
    sample_interval,
)
from tunnel_sim.files.importing.conditions import ImportChoices, condition_of, from_column, from_facts
from tunnel_sim.files.importing.inputs import at_times, find_input
from tunnel_sim.files.importing.source import Source
from tunnel_sim.files.importing.tables import INPUT_FACTS, Channel, Table, kind_of
from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.drive import InputColumn
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_LEAST_ROWS = 16


@dataclass(frozen=True, eq=False)
class RawRecord:
    """A record of a file, cleaned but not yet cut.

    Args:
        cleaned: times and readings.
        quantity: what the readings are.
        columns: of conditions, by key, with the rows of the record.
        clock: of these rows, from the first sample on, shape (n,), s; NaN where there is no time.
        whole: whether the file itself says that it is one run.
        input: of a driven record: what it is, and its values at the cleaned times, shape (n,); None of free decays.
        input_facts: the order of its hold (0 or 1) and its gain in N m per unit, by key of the format.
    """

    id: str
    source: Path
    column: str
    cleaned: Cleaned
    quantity: Quantity
    unit: str
    stated: dict[str, float]
    named: dict[str, float]
    said: tuple[str, ...]
    columns: Mapping[str, Channel]
    clock: Array
    whole: bool
    input: tuple[InputColumn, Array] | None = None
    input_facts: Mapping[str, float] = field(default_factory=dict)

    def measured(self, first: float, last: float, said: list[str]) -> dict[str, float]:
        """Conditions that columns of the file state.

        Args:
            first: time of a run's first sample, s.
            last: time of its last sample, s.
            said: remarks are added.
        """
        rows = (self.clock >= first) & (self.clock <= last)
        found = {
            key: value
            for key, column in self.columns.items()
            if (value := from_column(key, column, rows, said)) is not None
        }
        names = [(key, self.columns[key].name) for key in found]
        if names:
            listed = ", ".join(
                key if key == name else f"{key} ('{one_line(name, 40)}')" for key, name in names
            )
            said.append(f"from columns: {listed}")
        return found


def raw_records(
    source: Source,
    choices: ImportChoices,
    calibration: Calibration | None,
    named: dict[str, float],
    *,
    several: bool,
) -> list[RawRecord]:
    """The records of a file; ``several``: ids must name the file, because there are others."""
    # A short table beside longer ones holds conditions or sizes.
    long = [table for table in source.tables if table.channels[0].values.size >= _LEAST_ROWS]
    found = []
    for table in long or source.tables:
        where = shown(source.path) + (f", {one_line(table.part)}" if table.part else "")
        facts = {key: value for key in INPUT_FACTS if np.isfinite(value := table.facts.get(key, np.nan))}
        for pair in find_pairs(table, choices, where):
            said = [*pair.said]
            if pair.time is not None:
                values = without_overflow(pair.time.values, said)
                time = in_seconds(replace(pair.time, values=values), choices, said, where)
            else:
                interval, origin = sample_interval(table.facts, choices)
                if interval is None:
                    remedy = "give --time NAME, or --rate in Hz"
                    raise TunnelError("no column of times", where=where, remedy=remedy)
                said.append(f"times at {1.0 / interval:.6g} Hz: {origin}")
                time = np.arange(pair.reading.values.size, dtype=np.float64) * interval
            reading = replace(pair.reading, values=without_overflow(pair.reading.values, said))
            readings, quantity, unit = in_radians(reading, choices, calibration, said, where)
            kept = _within(time, choices, said)
            driven = find_input(table.channels, (pair.time, pair.reading), readings, choices, said, where)
            time, readings = time[kept], readings[kept]
            conditions = _condition_columns(table, pair, kept, said)
            names = [
                source.path.stem if several or not (table.part or pair.run) else "",
                table.part,
                pair.run,
            ]
            name = one_line("-".join(part for part in names if part))
            stated = from_facts(table.facts, said)
            said += [f"{key} = {value:g} from the file's name" for key, value in named.items()]
            starts = [0, *restarts(time), time.size]
            if len(starts) > 2:
                said.append(f"the clock starts anew {len(starts) - 2} times: another run each")
            for place, (a, b) in enumerate(itertools.pairwise(starts), 1):
                clean = cleaned(time[a:b], readings[a:b])
                if clean.time_s.size < 2:
                    raise TunnelError("fewer than two samples", where=where, remedy="leave it out")
                given = None
                if driven is not None:
                    values = at_times(driven[1][kept][a:b], time[a:b], readings[a:b], clean.time_s)
                    missing = int(np.count_nonzero(~np.isfinite(values)))
                    if missing:
                        raise TunnelError(
                            f"the input {driven[0]} has no number at {missing} of {values.size} samples",
                            where=where,
                            remedy="give one value for each sample of the reading, on the same clock, "
                            "or --input none",
                        )
                    given = driven[0], values
                found.append(
                    RawRecord(
                        id=name if len(starts) == 2 else f"{name}-{place}",
                        source=source.path,
                        column=pair.reading.name,
                        cleaned=clean,
                        quantity=quantity,
                        unit=unit,
                        stated=stated,
                        named=named,
                        said=(*said, *clean.said),
                        columns={key: replace(c, values=c.values[a:b]) for key, c in conditions.items()},
                        clock=time[a:b] - np.nanmin(np.where(np.isfinite(readings[a:b]), time[a:b], np.nan)),
                        whole=table.named and len(starts) == 2,
                        input=given,
                        input_facts=facts,
                    )
                )
    return found


def _condition_columns(
    table: Table, pair: ColumnPair, kept: NDArray[np.bool_], said: list[str]
) -> dict[str, Channel]:
    """The columns that state conditions, by key; of several that state the same, the first."""
    found: dict[str, Channel] = {}
    for channel in table.channels:
        key = condition_of(channel.name, channel.unit)
        if channel is pair.time or channel is pair.reading:
            continue
        if key is not None:
            found.setdefault(key, replace(channel, values=channel.values[kept]))
        elif kind_of(channel.unit) in ("speed", "stiffness", "density"):
            said.append(
                f"'{one_line(channel.name, 60)}' in {channel.unit} is left out: its name is not that of a condition"
            )
    return found


def _within(time: Array, choices: ImportChoices, said: list[str]) -> NDArray[np.bool_]:
    """Which samples lie between the stated start and end, shape (n,)."""
    first = -np.inf if choices.start is None else choices.start
    last = np.inf if choices.end is None else choices.end
    if choices.start is None and choices.end is None:
        return np.ones(time.shape, dtype=bool)
    # Stamps are decimals: a start at one of them includes it.
    slack = 1e-9 * max(abs(first) if np.isfinite(first) else 0.0, abs(last) if np.isfinite(last) else 0.0)
    kept = (time >= first - slack) & (time <= last + slack)
    said.append(f"{int(kept.sum())} of {time.size} samples lie from --start to --end")
    return kept
