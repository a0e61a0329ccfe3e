"""The columns of times and angles, and their numbers in seconds and radians."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np

from tunnel_sim.files.importing.cleaning import without_overflow
from tunnel_sim.files.importing.condition_names import condition_of
from tunnel_sim.files.importing.conditions import ImportChoices
from tunnel_sim.files.importing.tables import Channel, Table, is_input
from tunnel_sim.files.importing.units import UNITS, claims, kind_of, known_unit, written_unit
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, shown
from tunnel_sim.vocabulary.record import Array

RUN_MARK = re.compile(
    r"[\s_,;.#(\[-]*(?:run|trial|test|swing|rep|versuch|messung|lauf)[\s_#.-]*(\d+)[)\]]?\s*$", re.IGNORECASE
)
_TIME = re.compile(
    r"(?<![a-z])(t|time|times|timestamp|zeit|temps|tiempo|tempo|tijd|tid|elapsed|uhrzeit|x_value)(?![a-z])",
    re.IGNORECASE,
)
_ANGLE = re.compile(
    r"angle|winkel|angolo|yaw|(?<![a-z])(theta|beta|psi|phi|alpha|pitch|roll|pos|position|encoder|rotation|deg|rad)"
    r"(?![a-z])|[θβψφα]",
    re.IGNORECASE,
)
_RATE = re.compile(
    r"velocity|geschwindigkeit|ω|[βθψφ]̇|(?<![a-z])(omega|[xyz]?gyr[oa]?|gyro[a-z]+|speed)(?![a-z])"
    r"|(rate|vel|dot)(?![a-z])",
    re.IGNORECASE,
)
_ACCELERATION = re.compile(
    r"acceleration|beschleunigung|ddot|[βθψφ]̈|(?<![a-z])(angacc|acc|acce?l)(?![a-z])", re.IGNORECASE
)
_JOINED = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
"""Between the words of a name that are joined, such as ``xGyro`` or ``ZGyro``."""
_OTHER = re.compile(
    r"(?<![a-z])(index|idx|sample|samples|nr|no|row|#|frame|temperature|current|force)(?![a-z])", re.I
)
_HEAD = 20_000  # samples of a column without a name that are inspected
_STEADY = 0.5  # of the usual step: the steps of a clock differ by less
_HARDLY = 0.02  # of the span of another column in the same unit
_DERIVATIVE = 0.9  # correlation with the derivative of another column, from which a column is its rate


@dataclass(frozen=True, eq=False)
class ColumnPair:
    """The columns of one run and its name in the table; without times the samples follow at a sample rate."""

    run: str
    time: Channel | None
    reading: Channel
    said: tuple[str, ...] = ()


def named_kind(name: str) -> str:
    """The kind of quantity, ``rate`` or ``acceleration``, stated by a column's name; empty: neither."""
    words = _JOINED.sub("_", name)
    if _ACCELERATION.search(words):
        return "acceleration"
    return "rate" if _RATE.search(words) else ""


def stem(name: str) -> str:
    """The name of a column without the number of its run."""
    return RUN_MARK.sub("", name)


def find_pairs(table: Table, choices: ImportChoices, where: str) -> list[ColumnPair]:
    """The columns of each run, at least one run."""
    starts = [i for i, c in enumerate(table.channels) if _matches(c, choices.time or "") or is_time(c)]
    stems = {stem(table.channels[i].name) for i in starts}
    blocks = [table.channels]
    # Several blocks of columns side by side, each of which begins with its own times.
    if len(starts) > 1 and (len(stems) == 1 or all("#" in table.channels[i].name for i in starts)):
        ends = [*starts[1:], len(table.channels)]
        blocks = [table.channels[start:end] for start, end in zip(starts, ends, strict=True)]
    pairs = []
    for block in blocks:
        said: list[str] = []
        named = [channel for channel in block if is_time(channel)]
        time = None  # where the samples follow at a stated rate
        if choices.time is not None:
            time = _chosen(block, choices.time, "--time", where)[0]
        elif named:
            time = named[0]
            if len(named) > 1:
                said.append(f"times from '{time.name}', the first of {len(named)} columns of times")
        elif choices.rate is None:
            for channel in _unconditional(block, choices):
                numbers = channel.values[np.isfinite(channel.values)][:_HEAD]
                steps = np.diff(np.sort(numbers))
                if channel.unit or _OTHER.search(channel.name) or steps.size < 8 or not steps.max() > 0.0:
                    continue
                usual = float(np.median(steps))
                count = usual == 1.0 and bool((numbers == np.round(numbers)).all())
                if not count and float(np.mean(np.abs(steps - usual) < _STEADY * usual)) > 0.9:
                    time = channel
                    why = "evenly stepped numbers" + (
                        "" if table.headed else ", and the file names no columns"
                    )
                    said.append(f"times from '{time.name}': {why}")
                    break
        readings = _readings(block, time, choices, said, where)
        for reading in readings:
            mark = RUN_MARK.search(reading.name)
            run = f"run-{mark[1]}" if mark else reading.name if len(readings) > 1 else ""
            pairs.append(ColumnPair(run, time, reading, tuple(said)))
    if not pairs:
        what = f"no column of angles (columns found: {_listed(table.channels)})"
        _refuse_without_unit(table.channels, where)
        raise TunnelError(what, where=where, remedy="give --angle NAME and its --unit")
    return pairs


def is_time(channel: Channel) -> bool:
    """Whether a column contains times, by its unit or its name."""
    kind = kind_of(channel.unit)
    if condition_of(channel.name, channel.unit) is not None:
        return False
    return kind == "time" or (kind == "" and _TIME.search(channel.name) is not None)


def stated_input(channels: Sequence[Channel], choices: ImportChoices) -> Channel | None:
    """The column stated as the input, by name, with or without its unit, or by number; None: there is none."""
    found = [] if choices.input is None else _named(channels, choices.input)
    return found[0] if found else None


def _named(channels: Sequence[Channel], wanted: str) -> list[Channel]:
    """The columns of a name, with or without its unit as written in the file, or of a number from 1 on."""
    found = [channel for channel in channels if _matches(channel, wanted)]
    if not found and wanted.isdigit() and 1 <= int(wanted) <= len(channels):
        found = [channels[int(wanted) - 1]]
    return found


def _matches(channel: Channel, wanted: str) -> bool:
    return claims(wanted, channel.name, channel.unit) or claims(wanted, stem(channel.name), channel.unit)


def _chosen(block: Sequence[Channel], wanted: str, option: str, where: str) -> list[Channel]:
    found = _named(block, wanted)
    if not found:
        what = f"no column '{one_line(wanted, 40)}' (columns found: {_listed(block)})"
        remedy = f"{option}: {did_you_mean(wanted, {channel.name for channel in block})}"
        raise TunnelError(what, where=where, remedy=remedy)
    return found


def _readings(
    block: Sequence[Channel], time: Channel | None, choices: ImportChoices, said: list[str], where: str
) -> list[Channel]:
    if choices.angle:
        chosen = [c for name in choices.angle for c in _chosen(block, name, "--angle", where)]
        return [channel for channel in chosen if channel is not time]
    free = [c for c in _unconditional(block, choices) if c is not time]
    driving = stated_input(block, choices)
    others = [c for c in free if not is_input(c) and c is not driving]
    levels: list[list[Channel]] = [[] for _ in range(7)]  # the most certain first
    for c in others:
        kind, named = kind_of(c.unit), _ANGLE.search(c.name) and not named_kind(c.name)
        if not _span(c) > 0.0:
            continue
        if kind == "angle" or (named and kind in ("counts", "voltage")):
            levels[0].append(c)
        elif c.unit == "" and named:
            levels[1].append(c)
        elif c.unit and kind == "" and named:  # in an unknown unit, which the user is asked for
            levels[2].append(c)
        elif kind == "counts":
            levels[3].append(c)
        elif c.unit == "" and not _OTHER.search(c.name) and not named_kind(c.name):
            levels[4].append(c)
        elif kind == "voltage":
            levels[5].append(c)
        elif kind in ("rate", "acceleration"):
            levels[6].append(c)
    found = next((level for level in levels if level), [])
    widest = {unit: max(_span(c) for c in found if c.unit == unit) for unit in {c.unit for c in found}}
    still = [c for c in found if _span(c) < _HARDLY * widest[c.unit]]
    said += [f"'{stem(channel.name)}' is left out: it hardly moves" for channel in still]
    found = [channel for channel in found if channel not in still]
    while len(found) > 1 and (rate := _a_rate(found, time)) is not None:
        said.append(f"'{stem(rate.name)}' is left out: it is the rate of another column")
        found.remove(rate)
    of_runs = len({stem(c.name) for c in found}) == 1 and all(RUN_MARK.search(c.name) for c in found)
    if len(found) > 1 and not of_runs:
        what = f"{len(found)} columns may be the angle: {_listed(found)}"
        raise TunnelError(what, where=where, remedy=f'give --angle "{found[0].name}", or another of them')
    said += [f"angle from '{stem(channel.name)}'" for channel in found if len(others) > 1]
    return found


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


def _a_rate(channels: Sequence[Channel], time: Channel | None) -> Channel | None:
    """A column that follows the derivative of another one; None if there is none."""
    if time is None:
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


def _listed(channels: Sequence[Channel]) -> str:
    names = [f"'{channel.name}'" for channel in channels]
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")


_SLOWEST_STEP = 0.5  # s: a longer step between samples is in milliseconds, or in microseconds
_HALF_TURN = pi  # half the span of an angle: a greater one is in degrees
_NUMBER = r"([+-]?\s*\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)"
_FORMULA = re.compile(rf"^\s*(?:{_NUMBER}\s*(?=[+-]))?\s*{_NUMBER}?\s*\*?\s*[VvXx]\s*(?:{_NUMBER})?\s*$")
_RATE_FACTS = re.compile(
    r"(?i)(^|[^a-z])(fs|sample[ _]?rate|sampling[ _]?(rate|frequency)|samplerate|rate[ _]*\(?hz)($|[^a-z])"
)
_STEP_FACTS = re.compile(
    r"(?i)(^|[^a-z])(ts|dt|delta_?t|sample[ _]?(time|interval)|sampling[ _]?(time|interval)|wf_increment)($|[^a-z])"
)

_STEPS = (1.0 / limits.FASTEST_RATE, 1.0 / limits.SLOWEST_RATE)  # s

Calibration = tuple[Array, Array] | tuple[float, float]
"""Voltages and readings of a table, each of shape (n,); or offset and factor of a straight line."""


def stated_unit(text: str | None, kinds: Sequence[str], option: str) -> str | None:
    """The unit of certain kinds, keys of `UNITS`, named by an option; None if the option is not given."""
    unit = known_unit(text) if text is not None else None
    if text is not None and (unit is None or kind_of(unit) not in kinds):
        names = ", ".join(name for kind in kinds for name in UNITS[kind])
        raise TunnelError(f"unknown unit '{one_line(text, 20)}'", where=option, remedy=f"use one of {names}")
    return unit


def sample_interval(facts: Mapping[str, float], choices: ImportChoices) -> tuple[float | None, str]:
    """The interval of samples without times, s, None if it is not stated; and its source."""
    if choices.rate is not None:
        return 1.0 / choices.rate, f"{choices.rate:g} Hz as stated"
    for pattern, is_rate in ((_RATE_FACTS, True), (_STEP_FACTS, False)):
        least, most = (limits.SLOWEST_RATE, limits.FASTEST_RATE) if is_rate else _STEPS
        for name, value in facts.items():
            if pattern.search(name) and least <= value <= most:
                return 1.0 / value if is_rate else float(value), f"'{name}' = {value:g} in the file"
    return None, ""


def guessed_time_unit(values: Array) -> tuple[str, float]:
    """The assumed unit of times without one, shape (n,), and the usual step in it."""
    steps = np.diff(np.sort(values[np.isfinite(values)]))  # rows may be out of order
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    return "s" if step <= _SLOWEST_STEP else "ms" if step <= 1e3 * _SLOWEST_STEP else "us", step


def guessed_angle_unit(values: Array) -> tuple[str, float]:
    """The assumed unit of angles without one, shape (n,), and half their range in it."""
    swing = 0.5 * float(np.nanmax(values) - np.nanmin(values))
    return "deg" if swing > _HALF_TURN else "rad", swing


def in_seconds(
    pair: ColumnPair, facts: Mapping[str, float], choices: ImportChoices, said: list[str], where: str
) -> Array:
    """The times of a run, s, shape (n,): from their column, or at the stated rate; guesses are reported."""
    if pair.time is None:
        interval, origin = sample_interval(facts, choices)
        if interval is None:
            raise TunnelError("no column of times", where=where, remedy="give --time NAME, or --rate in Hz")
        said.append(f"times at {1.0 / interval:.6g} Hz: {origin}")
        return np.arange(pair.reading.values.size, dtype=np.float64) * interval
    values = without_overflow(pair.time.values, said)
    unit = stated_unit(choices.time_unit, ("time",), "--time-unit") or pair.time.unit
    if unit and kind_of(unit) != "time":
        what = f"'{one_line(pair.time.name, 40)}' is in '{one_line(unit, 20)}', which is not a unit of time"
        remedy = "give --time-unit, or --time with the name of another column"
        raise TunnelError(what, where=where, remedy=remedy)
    if not unit:
        _ask_for_unit(pair.time, ("time",), "--time-unit", where)
        unit, step = guessed_time_unit(values)
        said.append(f"no unit of the times in the file: steps of {step:.4g} are taken as {unit}")
    return values * UNITS["time"][unit] if unit != "s" else values


def _ask_for_unit(channel: Channel, kinds: Sequence[str], option: str, where: str) -> None:
    """Refuse to guess the unit of a column whose name may contain a unit."""
    word = written_unit(channel.name, kinds)
    if word:
        what = f"'{word}' in the name of '{one_line(channel.name, 40)}' may be its unit"
        allowed = ", ".join(name for kind in kinds for name in UNITS[kind])
        raise TunnelError(what, where=where, remedy=f"give {option}, one of {allowed}")


def _refuse_without_unit(channels: Sequence[Channel], where: str) -> None:
    """Refuse columns named as rates or accelerations whose unit is not stated.

    Their size does not separate rad/s from deg/s, as an angle's separates rad from deg: a rate has no greatest
    value.
    """
    kinds = {channel: named_kind(channel.name) for channel in channels if not channel.unit}
    first = next(filter(None, kinds.values()), "")
    found = [channel for channel, kind in kinds.items() if kind and kind == first]
    if not found:
        return
    noun = f"is {'an' if first == 'acceleration' else 'a'} {first} by its name, and nothing states its unit"
    chosen = f'--angle "{one_line(found[0].name, 40)}"'
    if len(found) > 1:
        noun = f"are {first}s by their names, and nothing states their unit"
        chosen += ", or another of them,"
    raise TunnelError(
        f"{_listed(found)} {noun}",
        where=where,
        remedy=f"give {chosen} and --unit, one of {', '.join(UNITS[first])}; or --unit deg if it is an angle",
    )


def in_radians(
    reading: Channel, choices: ImportChoices, calibration: Calibration | None, said: list[str], where: str
) -> tuple[Array, Quantity, str]:
    """Readings in rad, rad/s or rad/s², shape (n,), their quantity, and their assumed unit."""
    kinds = ("angle", "counts", "voltage", "rate", "acceleration")
    unit = stated_unit(choices.unit, kinds, "--unit") or reading.unit
    if unit and kind_of(unit) not in kinds and choices.counts_per_turn is None and calibration is None:
        raise TunnelError(
            f"'{one_line(reading.name, 40)}' is in '{one_line(unit, 20)}', which is not a known unit of an angle",
            where=where,
            remedy=f"give --unit ({', '.join(UNITS['angle'])} or another), --counts-per-turn N or --calibration",
        )
    values = reading.values
    if calibration is not None:
        volts = values * UNITS["voltage"].get(unit, 1.0)
        first, second = calibration
        if isinstance(first, float):
            values = first + second * volts
        elif np.nanmin(volts) < first[0] or np.nanmax(volts) > first[-1]:
            raise TunnelError(
                f"readings from {np.nanmin(volts):.4g} to {np.nanmax(volts):.4g} V go beyond the calibration table",
                where=where,
                remedy=f"calibrate beyond {first[0]:.4g} to {first[-1]:.4g} V, or give a formula",
            )
        else:
            values = np.interp(volts, first, second)
        unit = unit if kind_of(unit) == "angle" else ""
        said.append(f"'{reading.name}' converted by the calibration")
    elif choices.counts_per_turn is not None:
        values, unit = values / choices.counts_per_turn, "turns"
        said.append(f"'{reading.name}' holds counts, {choices.counts_per_turn:g} per turn")
    if kind_of(unit) in ("counts", "voltage"):
        option = "--counts-per-turn N" if kind_of(unit) == "counts" else '--calibration "a + b*V"'
        raise TunnelError(f"'{reading.name}' is in {unit}", where=where, remedy=f"give {option}")
    if not unit:
        if calibration is None:
            _ask_for_unit(reading, kinds, "--unit", where)
            _refuse_without_unit([reading], where)
        unit, swing = guessed_angle_unit(values)
        said.append(
            f"no unit of '{reading.name}': a swing of ±{swing:.4g} is taken as {unit}; --unit says otherwise"
        )
    kind = kind_of(unit)
    factor = UNITS[kind][unit]
    quantity: Quantity = "rate" if kind == "rate" else "acceleration" if kind == "acceleration" else "angle"
    values = values if factor == 1.0 else values * factor
    swing = 0.5 * float(np.nanmax(values) - np.nanmin(values))
    # A disc between springs swings as far, but counts look like degrees.
    if unit == "deg" and choices.unit is None and calibration is None and swing > _HALF_TURN:
        what = f"'{one_line(reading.name, 40)}' would swing by ±{swing / factor:.4g}°, more than half a turn"
        remedy = "give --unit deg if it does; of an encoder --counts-per-turn N"
        raise TunnelError(what, where=where, remedy=remedy)
    return values, quantity, unit


def read_calibration(text: str | None) -> Calibration | None:
    """The calibration: a formula such as ``0.1 + 20*V``, or from a text file of volts and angle."""
    if text is None:
        return None
    formula = _FORMULA.match(text)
    if formula:
        before, factor, behind = (part and float(part.replace(" ", "")) for part in formula.groups())
        if not (before is not None and behind is not None):
            return float(before or behind or 0.0), float(1.0 if factor is None else factor)
    from tunnel_sim.files.importing.source import read_source

    path = Path(text)
    if formula or not path.is_file():
        raise TunnelError(
            "is not a formula", where=f"--calibration {one_line(text, 40)}",
            remedy="give 'a + b*V' with numbers for a and b, or the name of a table of two columns",
        )  # fmt: skip
    channels = read_source(path, ImportChoices()).tables[0].channels
    if len(channels) != 2 or channels[0].values.size < 2:
        raise TunnelError("is not a table of two columns", where=shown(path), remedy="give volts and angle")
    order = np.argsort(channels[0].values)
    factor = UNITS["angle"].get(channels[1].unit, 1.0)
    return channels[0].values[order], channels[1].values[order] * factor
