"""From the tables of a file to records of times and angles, cleaned but not yet cut, and the inputs of driven runs.

Which column is an input is found by name, unit and correlation with the motion.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
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
    is_stated,
)
from tunnel_sim.files.importing.conditions import ImportChoices, condition_of, from_column, from_facts
from tunnel_sim.files.importing.source import Source
from tunnel_sim.files.importing.tables import INPUT_FACTS, Channel, Table, heading, is_input
from tunnel_sim.files.importing.units import UNITS, kind_of
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.drive import Drive, InputColumn, checked_drive
from tunnel_sim.vocabulary.errors import TunnelError, counted, did_you_mean, one_line, shown
from tunnel_sim.vocabulary.record import Array, Record

_LEAST_ROWS = 16


@dataclass(frozen=True, eq=False)
class RawRecord:
    """A record of a file, cleaned but not yet cut.

    Args:
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
            conditions = _condition_columns(table, pair, kept, said)
            file = source.path.stem if several or not (table.part or pair.run) else ""
            name = one_line("-".join(part for part in (file, table.part, pair.run) if part))
            stated = from_facts(table.facts, said)
            said += [f"{key} = {value:g} from the file's name" for key, value in named.items()]
            starts = [0, *restarts(time), time.size]
            if len(starts) > 2:
                said.append(f"the clock starts anew {counted(len(starts) - 2, 'time')}: another run each")
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


_MOMENTS = ("nm", "n-m", "n*m", "n·m", "newton metre", "newton meter", "n_m")
_NAMES = re.compile(
    r"(?<![a-z])(torque|moment|drehmoment|drive|input|excitation|anregung|command|cmd|control|motor|shaker|actuator|"
    r"tau|effort|u|base|root)(?![a-z])",
    re.IGNORECASE,
)
_BASE = re.compile(r"(?<![a-z])(base|root)(?![a-z])", re.IGNORECASE)
_CORRELATED = 0.3  # greatest correlation at any lag, from which on a column drives the motion


def find_input(
    channels: Sequence[Channel],
    beside: Sequence[Channel | None],
    reading: Array,
    choices: ImportChoices,
    said: list[str],
    where: str,
) -> tuple[InputColumn, Array] | None:
    """The input of a run: what it is, and its values, shape (n,), N m, any unit or rad; None of a free decay.

    ``beside`` holds the columns of times and reading.

    Args:
        reading: shape (n,), rad, rad/s or rad/s².
    """
    if choices.input == "none":
        return None
    others = [channel for channel in channels if all(channel is not one for one in beside)]
    if choices.input is not None:
        named = [c for c in others if is_stated(c, choices)]
        if not named:
            what = f"no column '{one_line(choices.input, 40)}' for the input"
            remedy = f"--input: {did_you_mean(choices.input, {c.name for c in others})}"
            raise TunnelError(what, where=where, remedy=remedy)
        return _as_input(named[0], reading, choices, said)
    # a column that is empty here is the input of other runs of the file
    exact = [channel for channel in others if is_input(channel) and np.isfinite(channel.values).any()]
    found = exact
    for channel in () if exact else others:
        good = np.isfinite(channel.values) & np.isfinite(reading)
        plausible = _moment_unit(channel) or _NAMES.search(channel.name)
        conditional = condition_of(channel.name, channel.unit) is not None
        if conditional or not plausible or np.count_nonzero(good) < 16:
            continue
        record = Record(np.arange(np.count_nonzero(good), dtype=np.float64), reading[good])
        with suppress(TunnelError):  # it correlates with the motion, and is not the motion itself
            checked_drive(Drive("drive", channel.values[good]), record, "", judged=False)
            if correlation(channel.values, reading)[0] >= _CORRELATED:
                found.append(channel)
    if len(found) > 1:
        listed = ", ".join(f"'{one_line(c.name, 40)}'" for c in found)
        remedy = f'give --input "{one_line(found[0].name, 40)}", another of them, or --input none'
        raise TunnelError(f"{len(found)} columns may be the input: {listed}", where=where, remedy=remedy)
    return _as_input(found[0], reading, choices, said) if found else None


def _as_input(
    channel: Channel, reading: Array, choices: ImportChoices, said: list[str]
) -> tuple[InputColumn, Array]:
    name = heading(channel)
    guessed: InputColumn = (
        "moment_nm"
        if name == "moment_nm" or _moment_unit(channel)
        else "base_rad"
        if kind_of(channel.unit) == "angle" and (name == "base_rad" or _BASE.search(channel.name))
        else "drive"
    )
    column = choices.input_as or guessed
    factor = UNITS["angle"].get(channel.unit, 1.0) if column == "base_rad" else 1.0
    meaning = {
        "moment_nm": "a known moment in N m",
        "drive": "an input of unknown gain",
        "base_rad": "the angle of the spring's root",
    }[column]
    size, lag = correlation(channel.values, reading)
    said.append(
        f"driven by '{one_line(channel.name, 40)}', {meaning} ({column}): its correlation with the reading is "
        f"{size:.2f} at a lag of {lag} samples; --input none if it is a free decay"
    )
    return column, channel.values * factor


def _moment_unit(channel: Channel) -> bool:
    return channel.unit.strip().lower() in _MOMENTS


def correlation(values: Array, reading: Array) -> tuple[float, int]:
    """The greatest correlation of an input with a later reading, from 0 to 1, and its lag in samples.

    The lag is a quarter of the record at most.

    Args:
        values: of the input, any unit, shape (n,).
        reading: shape (n,), any unit.
    """
    good = np.isfinite(values) & np.isfinite(reading)
    x, y = values[good] - values[good].mean(), reading[good] - reading[good].mean()
    scale = float(np.sqrt((x @ x) * (y @ y)))
    if not scale > 0.0:
        return 0.0, 0
    size = 2 * x.size
    lags = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)[: max(1, x.size // 4)]
    best = int(np.argmax(np.abs(lags)))
    return float(min(1.0, abs(lags[best]) / scale)), best


def at_times(values: Array, time: Array, reading: Array, kept: Array) -> Array:
    """The input at the times that the clean-up of a record has kept: that of the nearest row, shape (n,).

    Args:
        values: of the input at every row, shape (m,).
        time: of the rows, shape (m,), s.
        reading: of the rows, shape (m,).
        kept: times from the first sample on, shape (n,), s, increasing.
    """
    good = np.flatnonzero(np.isfinite(time) & np.isfinite(reading))
    order = good[np.argsort(time[good], kind="stable")]
    if order.size == kept.size:
        return values[order]
    since = time[order] - time[order[0]]
    after = np.clip(np.searchsorted(since, kept), 1, since.size - 1)
    return values[order[np.where(kept - since[after - 1] < since[after] - kept, after - 1, after)]]
