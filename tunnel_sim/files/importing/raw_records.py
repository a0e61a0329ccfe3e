"""Steps 2 to 4 for one file: its columns, its conditions, and its records, cleaned but not yet cut."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.cleaning import Cleaned, cleaned, restarts
from tunnel_sim.files.importing.columns import RunColumns, Unread, find_columns, with_readings
from tunnel_sim.files.importing.conditions import (
    Stated,
    ask_conditions,
    find_conditions,
    of_short_table,
    stated_remark,
)
from tunnel_sim.files.importing.import_statements import ImportStatements
from tunnel_sim.files.importing.source import Source
from tunnel_sim.files.importing.tables import INPUT_FACTS, LEAST_ROWS, NO_CHANNEL, RunColumn, Table
from tunnel_sim.files.importing.units import UNITS, kind_of, names_a_time
from tunnel_sim.files.reading import stem_of
from tunnel_sim.vocabulary.campaign import Quantity, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError, attempt, counted, joined, one_line, shown
from tunnel_sim.vocabulary.freedom import FREEDOMS
from tunnel_sim.vocabulary.quantities import PerSample, Rows, Seconds
from tunnel_sim.vocabulary.turning_points import HoldsTurningPoints, TurningPoints, are_turning_points

_STD = re.compile(
    r"(?i)(d|delta|δ|Δ|σ|sigma|s|u|e|err|error|std|sd|unc|uncertainty|fehler)[ _.(]?(?=[^\W\d_])"
)
"""Prefix of the name of a column of uncertainties."""
_LONGEST_SWING = 60.0  # s: longer half periods are in milliseconds


@dataclass(frozen=True, eq=False)
class RawRecord:
    """A record of a file, cleaned but not yet cut.

    Args:
        reading: column of the reading, at the cleaned times.
        stated: conditions stated in the record's table.
        table_rows: rows of the record in that table.
        clock: times of these rows, from the first sample on, s; NaN where there is no time.
        whole: whether the file itself states that it is one run.
        input: input of a driven record, at the cleaned times; None for free decays.
        input_facts: the order of its hold (0 or 1) and its gain in N m per unit, by key of the format.
    """

    id: str
    source: Path
    reading: RunColumn
    cleaned: Cleaned
    stated: Stated
    remarks: tuple[str, ...]
    table_rows: NDArray[np.intp]
    clock: Rows
    whole: bool
    input: RunColumn | None = None
    input_facts: Mapping[str, float] = field(default_factory=dict)

    @property
    def quantity(self) -> Quantity:
        """The quantity of the reading."""
        return cast(Quantity, self.reading.role)

    @property
    def sensor(self) -> SensorProperties:
        """The statement of the reading about the sensor; none for an angle."""
        motion, quantity = self.reading.motion, self.quantity
        return SensorProperties(
            quantity=None if quantity == "angle" else quantity, motion=None if motion == "angle" else motion
        )

    def rows(self, first: Seconds, last: Seconds) -> NDArray[np.intp]:
        """The rows of the table that belong to a run, from its first to its last sample."""
        return self.table_rows[(self.clock >= first) & (self.clock <= last)]


def raw_records(source: Source, beside: ImportStatements) -> list[RawRecord]:
    """The records of a file, with the conditions stated in it and in its name."""
    choices, path, named = beside.choices, source.path, beside.named(source.path)
    # A short table beside longer ones contains conditions or sizes.
    long = [table for table in source.tables if table.channels[0].values.size >= LEAST_ROWS]
    short = [hint for table in source.tables if long and table not in long for hint in of_short_table(table)]
    found = []
    faults: list[TunnelError] = []  # all questions about a file are asked at once
    for table in with_readings(long or source.tables, choices, shown(path)):
        where = shown(path) + (f", {one_line(table.part)}" if table.part else "")
        try:
            runs = find_columns(table, beside, where)
        except TunnelError as fault:
            faults.append(fault)
            if not isinstance(fault, Unread):
                break
            attempt(faults, partial(ask_conditions, table, fault.columns.used, path, beside, where))
            continue
        for columns in runs:
            freedom = FREEDOMS[columns.reading.motion]
            stated, remarks = find_conditions(table, columns.used, choices, where, freedom)
            stated = replace(stated, named=named, hints=(*stated.hints, *short))
            file = stem_of(path) if beside.several or not (table.part or columns.run) else ""
            name = one_line("-".join(part for part in (file, table.part, columns.run) if part))
            remarks += [stated_remark(key, value, "the file's name") for key, value in named.items()]
            found += _records(name, path, table, columns, stated, remarks, choices, where)
    if faults:
        raise joined(faults)
    return found


def _from_start_to_end(time: Rows, choices: ImportChoices) -> tuple[NDArray[np.bool_], list[str]]:
    """Mask of the used rows of a table, and a remark."""
    if choices.start is None and choices.end is None:
        return np.ones(time.shape, dtype=bool), []
    first = -np.inf if choices.start is None else choices.start
    last = np.inf if choices.end is None else choices.end
    # stamps are decimals: a start at a stamp includes it
    slack = 1e-9 * max(abs(end) for end in (choices.start, choices.end) if end is not None)
    kept: NDArray[np.bool_] = (time >= first - slack) & (time <= last + slack)
    return kept, [f"{int(kept.sum())} of {counted(time.size, 'sample')} from --start to --end"]


def _records(
    name: str,
    path: Path,
    table: Table,
    columns: RunColumns,
    stated: Stated,
    said: Sequence[str],
    choices: ImportChoices,
    where: str,
) -> list[RawRecord]:
    """The cleaned records of the columns of a run: one, or one from each start of the clock.

    Args:
        said: remarks on the conditions of the run.
    """
    records = []
    kept, remarks = _from_start_to_end(columns.time.values, choices)
    remarks = [*columns.remarks, *remarks, *said]
    driven = columns.input
    time, readings = columns.time.values[kept], columns.reading.values[kept]
    facts = {key: value for key in INPUT_FACTS if np.isfinite(value := table.facts.get(key, np.nan))}
    starts = [0, *restarts(time, readings), time.size]
    if len(starts) > 2:
        remarks.append(f"the clock restarts {counted(len(starts) - 2, 'time')}: a new run each time")
    for place, (a, b) in enumerate(itertools.pairwise(starts), 1):
        try:
            clean = cleaned(time[a:b], readings[a:b])
        except TunnelError as error:
            raise TunnelError(error.what, where=where, remedy=error.remedy) from None
        rows = np.flatnonzero(kept)[a:b]
        angles = columns.reading.role == "angle" and driven is None
        if angles and are_turning_points(clean.time_s, clean.reading):
            told = [*table.remarks, *remarks]
            raise HoldsTurningPoints(_turning_points(name, table, columns, rows, clean, told, choices), where)
        if clean.time_s.size < 2:
            raise TunnelError("fewer than two samples", where=where, remedy="leave it out")
        given = None
        if driven is not None:
            given = replace(driven, values=driven.values[rows[clean.rows]])
            missing = int(np.count_nonzero(~np.isfinite(given.values)))
            if missing:
                name = FREEDOMS[columns.reading.motion].own_input(driven.role)
                raise TunnelError(
                    f"the input {name} has no number at {missing} of {given.values.size} samples",
                    where=where,
                    remedy="give one value for each sample of the reading, on the same clock, or --input none",
                )
        records.append(
            RawRecord(
                id=name if len(starts) == 2 else f"{name}-{place}",
                source=path,
                reading=replace(columns.reading, values=clean.reading),
                cleaned=clean,
                stated=stated,
                remarks=(*remarks, *clean.remarks),
                table_rows=rows,
                clock=time[a:b] - np.nanmin(np.where(np.isfinite(readings[a:b]), time[a:b], np.nan)),
                whole=table.named and len(starts) == 2,
                input=given,
                input_facts=facts,
            )
        )
    return records


def _turning_points(
    name: str,
    table: Table,
    columns: RunColumns,
    rows: NDArray[np.intp],
    clean: Cleaned,
    remarks: Sequence[str],
    choices: ImportChoices,
) -> TurningPoints:
    """The turning points in some rows of a table, with the standard deviations in its columns."""
    unit = columns.reading.unit  # also of uncertainties without a known unit
    time, clock = clean.time_s, columns.time.channel
    if clock is not NO_CHANNEL and not clock.unit and choices.time_unit is None:
        # the step of a clock is short, and half a period of a swing is not
        size = float(np.median(np.diff(np.sort(clock.values[rows]))))
        own = "s" if size < _LONGEST_SWING else "ms"
        time = time * size * UNITS["time"][own] / float(np.median(np.diff(time)))
        remarks = [line for line in remarks if "no unit of the times" not in line]
        remarks.append(f"the file states no unit of the times: half periods of {size:.4g} are taken as {own}")
    found: dict[str, PerSample] = {}
    for channel in table.channels:
        mark = _STD.match(channel.name)
        values = channel.values[rows]
        if mark is None or values.shape != time.shape or not (values > 0.0).all():
            continue
        kind = kind_of(channel.unit) or ("time" if names_a_time(channel.name[mark.end() :]) else "angle")
        if kind in ("time", "angle"):
            factor = UNITS[kind].get(channel.unit) or (1.0 if kind == "time" else UNITS[kind].get(unit, 1.0))
            found.setdefault(kind, values * factor)
    return TurningPoints(name, time, clean.reading, found.get("time"), found.get("angle"), tuple(remarks))
