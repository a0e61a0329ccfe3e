"""From the tables of a file to records of times and angles, cleaned but not yet cut, and their inputs."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
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
)
from tunnel_sim.files.importing.conditions import ImportChoices
from tunnel_sim.files.importing.inputs import at_times, find_input
from tunnel_sim.files.importing.source import Source
from tunnel_sim.files.importing.stated import Stated, of_short_table, stated_in
from tunnel_sim.files.importing.tables import INPUT_FACTS, LEAST_ROWS, Table
from tunnel_sim.files.importing.units import UNITS, kind_of, names_a_time
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.errors import TunnelError, counted, one_line, shown
from tunnel_sim.vocabulary.inputs import InputColumn
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.turning_points import HoldsTurningPoints, TurningPoints, are_turning_points

_STD = re.compile(
    r"(?i)(d|delta|δ|Δ|σ|sigma|s|u|e|err|error|std|sd|unc|uncertainty|fehler)[ _.(]?(?=[^\W\d_])"
)
"""Begins the name of a column of uncertainties."""
_LONGEST_SWING = 60.0  # s: longer half periods are in milliseconds


@dataclass(frozen=True, eq=False)
class RawRecord:
    """A record of a file, cleaned but not yet cut.

    Args:
        stated: the conditions stated in the file, in numbers and in the rows of the record.
        clock: of these rows, from the first sample on, shape (n,), s; NaN where there is no time.
        whole: whether the file itself states that it is one run.
        input: of a driven record: its kind, and its values at the cleaned times, shape (n,); None for free decays.
        input_facts: the order of its hold (0 or 1) and its gain in N m per unit, by key of the format.
    """

    id: str
    source: Path
    column: str
    cleaned: Cleaned
    quantity: Quantity
    unit: str
    stated: Stated
    named: dict[str, float]
    said: tuple[str, ...]
    clock: Array
    whole: bool
    input: tuple[InputColumn, Array] | None = None
    input_facts: Mapping[str, float] = field(default_factory=dict)

    def rows(self, first: float, last: float) -> NDArray[np.bool_]:
        """Which rows of the record belong to a run, shape (n,).

        Args:
            first: time of its first sample, s.
            last: time of its last sample, s.
        """
        return (self.clock >= first) & (self.clock <= last)


def raw_records(
    source: Source,
    choices: ImportChoices,
    calibration: Calibration | None,
    named: dict[str, float],
    *,
    several: bool,
) -> list[RawRecord]:
    """The records of a file; ``several``: ids must name the file, because there are others."""
    # A short table beside longer ones contains conditions or sizes.
    long = [table for table in source.tables if table.channels[0].values.size >= LEAST_ROWS]
    short = [hint for table in source.tables if long and table not in long for hint in of_short_table(table)]
    found = []
    for table in long or source.tables:
        where = shown(source.path) + (f", {one_line(table.part)}" if table.part else "")
        facts = {key: value for key in INPUT_FACTS if np.isfinite(value := table.facts.get(key, np.nan))}
        for pair in find_pairs(table, choices, where):
            said = [*pair.said]
            time = in_seconds(pair, table.facts, choices, said, where)
            reading = replace(pair.reading, values=without_overflow(pair.reading.values, said))
            readings, quantity, unit = in_radians(reading, choices, calibration, said, where)
            kept = np.ones(time.shape, dtype=bool)
            if choices.start is not None or choices.end is not None:
                first = -np.inf if choices.start is None else choices.start
                last = np.inf if choices.end is None else choices.end
                # Stamps are decimals: a start at one of them includes it.
                slack = 1e-9 * max(abs(end) for end in (choices.start, choices.end) if end is not None)
                kept = (time >= first - slack) & (time <= last + slack)
                said.append(f"{int(kept.sum())} of {counted(time.size, 'sample')} from --start to --end")
            driven = find_input(table.channels, (pair.time, pair.reading), readings, choices, said, where)
            time, readings = time[kept], readings[kept]
            beside = (pair.time, pair.reading, None if driven is None else driven.channel)
            stated = stated_in(table, beside, kept, choices, said, where)
            stated = replace(stated, hints=(*stated.hints, *short))
            file = source.path.stem if several or not (table.part or pair.run) else ""
            name = one_line("-".join(part for part in (file, table.part, pair.run) if part))
            said += [f"{key} = {value:g} from the file's name" for key, value in named.items()]
            starts = [0, *restarts(time), time.size]
            if len(starts) > 2:
                said.append(f"the clock starts anew {counted(len(starts) - 2, 'time')}: another run each")
            for place, (a, b) in enumerate(itertools.pairwise(starts), 1):
                clean = cleaned(time[a:b], readings[a:b])
                if quantity == "angle" and driven is None and are_turning_points(clean.time_s, clean.reading):
                    rows = np.flatnonzero(kept)[a:b]
                    raise HoldsTurningPoints(
                        _turning_points(name, table, pair, rows, clean, unit, said, choices), where
                    )
                if clean.time_s.size < 2:
                    raise TunnelError("fewer than two samples", where=where, remedy="leave it out")
                given = None
                if driven is not None:
                    values = at_times(driven.values[kept][a:b], time[a:b], readings[a:b], clean.time_s)
                    missing = int(np.count_nonzero(~np.isfinite(values)))
                    if missing:
                        raise TunnelError(
                            f"the input {driven.column} has no number at {missing} of {values.size} samples",
                            where=where,
                            remedy="give one value for each sample of the reading, on the same clock, "
                            "or --input none",
                        )
                    given = driven.column, values
                found.append(
                    RawRecord(
                        id=name if len(starts) == 2 else f"{name}-{place}",
                        source=source.path,
                        column=pair.reading.name,
                        cleaned=clean,
                        quantity=quantity,
                        unit=unit,
                        stated=stated.of_rows(a, b),
                        named=named,
                        said=(*said, *clean.said),
                        clock=time[a:b] - np.nanmin(np.where(np.isfinite(readings[a:b]), time[a:b], np.nan)),
                        whole=table.named and len(starts) == 2,
                        input=given,
                        input_facts=facts,
                    )
                )
    return found


def _turning_points(
    name: str,
    table: Table,
    pair: ColumnPair,
    rows: NDArray[np.intp],
    clean: Cleaned,
    unit: str,
    said: Sequence[str],
    choices: ImportChoices,
) -> TurningPoints:
    """The turning points in a table, with the standard deviations in its columns.

    Args:
        unit: of the angle, for a column of uncertainties without a known unit.
    """
    time, said = clean.time_s, [*table.said, *said]
    if pair.time is not None and not pair.time.unit and choices.time_unit is None:
        # The step of a clock is short, and half a period of a swing is not.
        size = float(np.median(np.diff(np.sort(pair.time.values[rows]))))
        own = "s" if size < _LONGEST_SWING else "ms"
        time = time * size * UNITS["time"][own] / float(np.median(np.diff(time)))
        said = [line for line in said if "no unit of the times" not in line]
        said.append(f"no unit of the times in the file: half periods of {size:.4g} are taken as {own}")
    found: dict[str, Array] = {}
    for channel in table.channels:
        mark = _STD.match(channel.name)
        values = channel.values[rows]
        if mark is None or values.shape != time.shape or not (values > 0.0).all():
            continue
        kind = kind_of(channel.unit) or ("time" if names_a_time(channel.name[mark.end() :]) else "angle")
        if kind in ("time", "angle"):
            factor = UNITS[kind].get(channel.unit) or (1.0 if kind == "time" else UNITS[kind].get(unit, 1.0))
            found.setdefault(kind, values * factor)
    return TurningPoints(name, time, clean.reading, found.get("time"), found.get("angle"), tuple(said))
