"""Step 2 of an import: find the columns of every run in a table, in seconds and radians, and its input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.column_names import (
    ANGLE,
    OTHER,
    RUN_MARK,
    is_time,
    listed,
    matches,
    named,
    named_kind,
    stem,
)
from tunnel_sim.files.importing.column_numbers import in_radians, in_seconds, refuse_without_unit
from tunnel_sim.files.importing.condition_names import condition_of, resembles
from tunnel_sim.files.importing.import_statements import ImportStatements
from tunnel_sim.files.importing.inputs import (
    find_input,
    moves_before,
    names_command,
    names_input,
    stated_input,
)
from tunnel_sim.files.importing.remarks import doubt
from tunnel_sim.files.importing.tables import NO_CHANNEL, Channel, RunColumn, Table, is_input
from tunnel_sim.files.importing.units import UNITS, claims, kind_of, unit_after_word
from tunnel_sim.vocabulary.errors import TunnelError, asking, attempt, did_you_mean, joined, one_line
from tunnel_sim.vocabulary.freedom import DISPLACEMENT, FREEDOMS, column_unit, freedom_of_column, linear_unit
from tunnel_sim.vocabulary.input_kinds import without_command

_HEAD = 20_000  # number of inspected samples of a column without a name
_STEADY = 0.5  # share of the usual step: the steps of a clock differ by less
_JUDGED = 200_000  # number of samples of an unused column, for testing its effect on the angle
_MOST_JUDGED = 8  # maximum number of columns
_LEAST_JUDGED = 16  # minimum number of samples
_UNNAMED = 4  # level of `_likeliest`: neither name nor unit is an angle's
# levels of `_likeliest` with the unit of a displacement, of its rate or acceleration, or of a base's acceleration
_LINEAR = range(7, 11)
_HARDLY = 0.02  # share of the span of another column in the same unit
_DERIVATIVE = 0.9  # correlation with the derivative of another column from which a column is its rate


@dataclass(frozen=True, eq=False)
class RunColumns:
    """The columns of one run: as in the file, and then as numbers; NaN for a missing number.

    Args:
        run: name of the run in the table.
        input: input of a driven run; None for a free decay.
        remarks: remarks on the choice of the columns, then on their numbers.
    """

    run: str
    time: RunColumn
    reading: RunColumn
    input: RunColumn | None = None
    remarks: tuple[str, ...] = ()

    @property
    def used(self) -> tuple[Channel, ...]:
        """The columns of times, reading and input."""
        rows = (self.time, self.reading, self.input)
        return tuple(row.channel for row in rows if row is not None)


class Unread(TunnelError):
    """Open questions about the columns of a run: units, a rate, or which of several columns is meant."""

    def __init__(self, fault: TunnelError, columns: RunColumns) -> None:
        reading = columns.reading.channel
        own = freedom_of_column(reading.name, reading.unit).refusal(fault, [c.quoted for c in columns.used])
        super().__init__(own.what, where=own.where, remedy=own.remedy, options=own.options, parts=own.parts)
        self.columns = columns


def find_columns(table: Table, beside: ImportStatements, where: str) -> list[RunColumns]:
    """The columns of each run of a table, at least one run; guesses are reported.

    Raises:
        Unread: with all questions about the columns of a run.
    """
    several: list[TunnelError] = []  # all questions about a file are asked at once
    try:
        runs = find_pairs(table, beside.choices, where)
    except Unread as fault:  # the first of several columns that may be the angle, and its questions
        several, runs = [fault], [fault.columns]
    found = [_as_numbers(table, run, beside, where, several) for run in runs]
    if len(found) == 1:  # beside several runs, other columns belong to other runs
        found = [replace(found[0], remarks=(*found[0].remarks, *_unused(table, found[0], beside.choices)))]
    return found


def _as_numbers(
    table: Table, run: RunColumns, beside: ImportStatements, where: str, asked: Sequence[TunnelError]
) -> RunColumns:
    """The columns of a run in seconds and radians, and its input; ``asked``: questions that are already open."""
    faults, choices, calibration = [*asked], beside.choices, beside.calibration
    clock, channel = run.time.channel, run.reading.channel
    rows, facts = channel.values.size, table.facts
    time = attempt(faults, lambda: in_seconds(clock, rows, facts, choices, where))
    # A row without a time is not a sample: a heading between two runs may hold other numbers.
    timed = channel.values if time is None else np.where(np.isfinite(time.values), channel.values, np.nan)
    reading = attempt(faults, lambda: in_radians(channel, timed, choices, calibration, where))
    if reading is not None and not channel.unit and choices.unit is None and calibration is None:
        attempt(faults, partial(_refuse_other_unit, reading, table, where))
    driven = None
    if reading is not None:
        driven = attempt(faults, partial(find_input, table.channels, clock, reading, choices, where))
    if time is None or reading is None or faults:
        raise Unread(joined(faults), run)
    remarks = [*run.remarks, *time.why, *reading.why, *(() if driven is None else driven.why)]
    if table.native:
        remarks += _apart(table, reading, driven, choices, where)
        if driven is not None and (how := table.aligned.get(driven.channel.name)) is not None:
            remarks.append(how)
        if driven is not None and (outside := _without_input(reading, driven)).any():
            remarks.append(f"{driven.channel.quoted} has no sample at {outside.sum()} of {rows}: left out")
            reading = replace(reading, values=np.where(outside, np.nan, reading.values))
    return RunColumns(run.run, time, reading, driven, tuple(remarks))


def _refuse_other_unit(reading: RunColumn, table: Table, where: str) -> None:
    """Refuse a guessed unit of an angle beside a text that states another one."""
    for name, text in table.texts.items():
        line = text if name.startswith("line ") else f"{name.rpartition('/')[2]}: {text}"
        unit = unit_after_word(line)
        if unit is not None and kind_of(unit) == "angle" and unit != reading.unit:
            what = f"'{one_line(line, 40)}' may state the unit of {reading.channel.quoted}"
            raise asking(f"--unit {unit}", what, where, f", or --unit {reading.unit}")


def _unused(table: Table, columns: RunColumns, choices: ImportChoices) -> list[str]:
    """The unused columns, and those of them that move before or with the reading."""
    named_before = " ".join(columns.remarks)
    others = [
        channel
        for channel in _unconditional(table.channels, choices)
        if not any(channel is one for one in columns.used)
        and not is_time(channel)
        and channel.quoted not in named_before
        and resembles(channel.name, channel.unit) is None
        and _span(channel) > 0.0
    ]
    reading = columns.reading.values[:_JUDGED]
    moving = []
    for channel in others[:_MOST_JUDGED]:
        values = channel.values[:_JUDGED]
        good = np.isfinite(values) & np.isfinite(reading)
        if np.count_nonzero(good) >= _LEAST_JUDGED and moves_before(values[good], reading[good]):
            moving.append(channel)
    remarks: list[str] = [
        doubt(
            f"{c.quoted} moves before or with the angle and is not used; "
            "--input uses it if it drives the body"
        )
        for c in moving
        if columns.input is None
    ]
    rest = [channel for channel in others if channel not in moving or columns.input is not None]
    if rest:
        use = "--set KEY=NAME uses one that states a condition"
        remarks.append(doubt(f"columns that are not used: {listed(rest)}; {use}"))
    return remarks


def with_readings(tables: Sequence[Table], choices: ImportChoices, where: str) -> list[Table]:
    """The tables of a file, without tables on the clocks of columns other than the angle.

    Args:
        tables: in their order; a part with several clocks has its tables one after another.
    """
    remaining = []
    for _, group in groupby(tables, key=lambda table: (table.part, bool(table.native))):
        part = list(group)
        if part[0].native:
            block = [c for table in part for c in table.channels if c.name in table.native and not is_time(c)]
            found, _ = _readings(block, NO_CHANNEL, choices, where)
            if not found:
                _refuse_without_angle(block, where)
            part = [table for table in part if any(c.name in table.native for c in found)]
        remaining += part
    return remaining


def _apart(
    table: Table, reading: RunColumn, driven: RunColumn | None, choices: ImportChoices, where: str
) -> list[str]:
    """The columns that cannot be aligned with the reading; refused if one of them may be the input."""
    remarks, freedom = [], FREEDOMS[reading.motion]
    for name, unit, why in table.apart:
        column = Channel(name, np.empty(0), unit)
        stated = choices.input is not None and matches(column, choices.input)
        if stated or (choices.input is None and driven is None and names_input(column, freedom)):
            what = f"'{one_line(name, 40)}' cannot be aligned with {reading.channel.quoted}: {why}"
            option = "--input none"
            remedy = f"record both on one clock, or give {option} if it is a free decay"
            raise TunnelError(what, where=where, remedy=remedy, options=(option,))
        remarks.append(f"'{one_line(name, 40)}' is left out: {why}")
    return remarks


def _without_input(reading: RunColumn, driven: RunColumn) -> NDArray[np.bool_]:
    """Mask of the readings before or after the record of the input."""
    known = np.flatnonzero(np.isfinite(driven.values))
    outside = np.isfinite(reading.values)
    if known.size:
        outside[known[0] : known[-1] + 1] = False
    return outside


def find_pairs(table: Table, choices: ImportChoices, where: str) -> list[RunColumns]:
    """The columns of each run as in the file, at least one run."""
    starts = [i for i, c in enumerate(table.channels) if matches(c, choices.time or "") or is_time(c)]
    stems = {stem(table.channels[i].name) for i in starts}
    blocks = [table.channels]
    # Several blocks of columns side by side; each begins with its own times.
    if len(starts) > 1 and (len(stems) == 1 or all("#" in table.channels[i].name for i in starts)):
        ends = [*starts[1:], len(table.channels)]
        blocks = [table.channels[start:end] for start, end in zip(starts, ends, strict=True)]
    pairs = []
    if table.native:  # the reading has the clock of the table
        own = (
            name for name in choices.angle if any(c.name in table.native for c in named(table.channels, name))
        )
        choices = choices.model_copy(update={"angle": tuple(own)})
    for block in blocks:
        remarks: list[str] = []
        clocks = [channel for channel in block if is_time(channel)]
        time = NO_CHANNEL  # from samples at a stated rate
        if choices.time is not None:
            time = _chosen(block, choices.time, "--time", where)[0]
        elif clocks:
            time = clocks[0]
            _refuse_split_clock(clocks, where)
            if len(clocks) > 1:
                which = f"times from '{time.name}', the first of {len(clocks)} columns of times"
                remarks.append(doubt(f"{which}; --time names another"))
        elif choices.rate is None:
            for channel in _unconditional(block, choices):
                numbers = channel.values[np.isfinite(channel.values)][:_HEAD]
                steps = np.diff(np.sort(numbers))
                if channel.unit or OTHER.search(channel.name) or steps.size < 8 or not steps.max() > 0.0:
                    continue
                usual = float(np.median(steps))
                count = usual == 1.0 and bool((numbers == np.round(numbers)).all())
                if not count and float(np.mean(np.abs(steps - usual) < _STEADY * usual)) > 0.9:
                    time = channel
                    why = "evenly stepped numbers" + (
                        "" if table.headed else ", and the file names no columns"
                    )
                    remarks.append(f"times from '{time.name}': {why}")
                    break
        own_clock = [c for c in block if not table.native or c.name in table.native]
        readings, chosen = _readings(own_clock, time, choices, where)
        for reading in readings:
            mark = RUN_MARK.search(reading.name)
            run = f"run-{mark[1]}" if mark else reading.name if len(readings) > 1 else ""
            pairs.append(_pair(time, reading, run, (*remarks, *chosen)))
    if not pairs:
        _refuse_without_angle(table.channels, where)
    return pairs


def _refuse_split_clock(clocks: Sequence[Channel], where: str) -> None:
    """Refuse a clock of whole units beside a column of their fractions, such as seconds and milliseconds."""
    first = clocks[0]
    for other in clocks[1:]:
        whole, part = (UNITS["time"].get(c.unit, 0.0) for c in (first, other))
        known = np.isfinite(first.values) & np.isfinite(other.values)
        stamps, rest = first.values[known], other.values[known] * part
        within = 0.0 < part < whole and rest.size and rest.min() >= 0.0 and rest.max() < whole
        if within and (stamps == np.round(stamps)).all() and (np.diff(stamps) == 0.0).any():
            what = f"the times are in two columns, {listed((first, other))}"
            remedy = f"write one column of times, or give --time, one of {listed((first, other))}"
            raise TunnelError(what, where=where, remedy=remedy)


def _pair(time: Channel, reading: Channel, run: str = "", said: tuple[str, ...] = ()) -> RunColumns:
    """The columns of a run as in the file."""
    clock = RunColumn(time, time.values, time.unit, "time")
    return RunColumns(run, clock, RunColumn(reading, reading.values, reading.unit, "angle"), remarks=said)


def _refuse_without_angle(channels: Sequence[Channel], where: str) -> NoReturn:
    refuse_without_unit(channels, where)
    what = f"no column of angles (columns found: {listed(channels)})"
    raise asking("--angle NAME", what, where, " and its --unit")


def _chosen(block: Sequence[Channel], wanted: str, option: str, where: str) -> list[Channel]:
    found = named(block, wanted)
    if not found:
        what = f"no column '{one_line(wanted, 40)}' (columns found: {listed(block)})"
        remedy = f"{option}: {did_you_mean(wanted, {channel.name for channel in block})}"
        raise TunnelError(what, where=where, remedy=remedy)
    return found


def _readings(
    block: Sequence[Channel], time: Channel, choices: ImportChoices, where: str
) -> tuple[list[Channel], list[str]]:
    """The columns of readings, and remarks on them."""
    if choices.angle:
        chosen = [c for name in choices.angle for c in _chosen(block, name, "--angle", where)]
        return [channel for channel in chosen if channel is not time], []
    free = [c for c in _unconditional(block, choices) if c is not time]
    driving = stated_input(block, choices)
    others = [c for c in free if not is_input(c) and c is not driving]
    measured = [c for c in others if not names_command(c)]
    level, readings = _likeliest(measured)
    if level >= _UNNAMED and level not in _LINEAR and len(measured) < len(others):
        twins = {without_command(c.name) for c in others if c not in measured}
        own = [c for c in measured if c.name.strip().lower() in twins]
        if readings and not own:
            command = next(one_line(c.name, 40) for c in others if c not in measured)
            what = f"'{command}' is a command by its name, and no column beside it is named as the angle"
            raise TunnelError(what, where=where, remedy=f"give --angle, one of {listed(measured)}")
        readings = own or _likeliest(others)[1]
    widest = {unit: max(_span(c) for c in readings if c.unit == unit) for unit in {c.unit for c in readings}}
    still = [c for c in readings if _span(c) < _HARDLY * widest[c.unit] and not _of_others(c, readings, time)]
    remarks = [f"'{stem(channel.name)}' is left out: it hardly moves" for channel in still]
    readings = [channel for channel in readings if channel not in still]
    while len(readings) > 1 and (rate := _a_rate(readings, time)) is not None:
        remarks.append(f"'{stem(rate.name)}' is left out: it is the rate of another column")
        readings.remove(rate)
    of_runs = len({stem(c.name) for c in readings}) == 1 and all(RUN_MARK.search(c.name) for c in readings)
    if len(readings) > 1 and not of_runs:
        what = f"{len(readings)} columns may be the angle: {listed(readings)}"
        several = asking(f'--angle "{readings[0].name}"', what, where, ", or another of them")
        raise Unread(several, _pair(time, readings[0]))
    remarks += [f"angle from '{stem(channel.name)}'" for channel in readings if len(others) > 1]
    return readings, remarks


def _likeliest(channels: Sequence[Channel]) -> tuple[int, list[Channel]]:
    """The most likely columns of readings, and the level of evidence: from 0, most certain, to 11, not at all."""
    levels: list[list[Channel]] = [[] for _ in range(11)]
    for c in channels:
        kind, by_name = kind_of(c.unit), ANGLE.search(c.name) and not named_kind(c.name)
        if not _span(c) > 0.0:
            continue
        if kind == "angle" or (by_name and kind in ("counts", "voltage")):
            levels[0].append(c)
        elif c.unit == "" and by_name:
            levels[1].append(c)
        elif c.unit and kind == "" and by_name:  # in an unknown unit; the user is asked
            levels[2].append(c)
        elif kind == "counts":
            levels[3].append(c)
        elif (linear := linear_unit(c.unit or column_unit(c.name))) is not None:
            of_base = DISPLACEMENT.input_kind(c.name, linear[1]) is not None
            levels[_LINEAR[-1 if of_base else tuple(DISPLACEMENT.units).index(linear[0])]].append(c)
        elif c.unit == "" and not (OTHER.search(c.name) or named_kind(c.name) or resembles(c.name, "")):
            levels[_UNNAMED].append(c)
        elif kind == "voltage":
            levels[5].append(c)
        elif kind in ("rate", "acceleration"):
            levels[6].append(c)
    if any(levels[at] for at in _LINEAR[:-1]):
        # beside a column in mm, a column that may drive is not the reading
        for at in (_UNNAMED, _UNNAMED + 1):
            levels[at] = [c for c in levels[at] if not names_input(c, DISPLACEMENT)]
    return next(((at, level) for at, level in enumerate(levels) if level), (len(levels), []))


def _unconditional(block: Sequence[Channel], choices: ImportChoices) -> list[Channel]:
    stated = [text for text in choices.stated_by.model_dump().values() if text is not None]
    return [
        channel
        for channel in block
        if condition_of(channel.name, channel.unit) is None
        and not any(claims(text, channel.name, channel.unit) for text in stated)
    ]


def _span(channel: Channel) -> float:
    """Difference of the greatest and the least number."""
    numbers = channel.values[np.isfinite(channel.values)]
    return float(np.ptp(numbers)) if numbers.size else 0.0


def _of_others(channel: Channel, channels: Sequence[Channel], time: Channel) -> bool:
    """Whether a column without a unit is the motion of which another one is the rate or the acceleration."""
    others = [c for c in channels if c is not channel and c.unit == "" and _span(c) > _span(channel)]
    if channel.unit or time is NO_CHANNEL:
        return False
    for other in others:
        values = np.stack([c.values[:_HEAD] for c in (channel, other)])
        first, second = values[:, np.isfinite(values).all(axis=0)]
        if first.size >= _LEAST_JUDGED and np.ptp(first) > 0.0 < np.ptp(second):
            alike = (np.corrcoef(one, second)[0, 1] for one in (first, np.gradient(first)))
            if max(map(abs, alike)) > _DERIVATIVE:
                return True
    return False


def _a_rate(channels: Sequence[Channel], time: Channel) -> Channel | None:
    """A column that follows the derivative of another column; None if there is none."""
    if time is NO_CHANNEL:
        return None
    for angle in channels:
        for rate in channels:
            values = np.stack([c.values[:_HEAD] for c in (time, angle, rate)])
            clock, first, second = values[:, np.isfinite(values).all(axis=0)]
            if angle is rate or clock.size < 8 or not (np.diff(clock) > 0.0).all():
                continue
            slope = np.gradient(first, clock)
            if np.ptp(slope) > 0.0 < np.ptp(second) and np.corrcoef(slope, second)[0, 1] > _DERIVATIVE:
                return rate
    return None
