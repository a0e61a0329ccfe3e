"""The numbers of a column in seconds and radians: by its unit, or by a unit guessed from their size."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path

import numpy as np

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.column_names import ANGLE, listed, named_kind, names_voltage
from tunnel_sim.files.importing.remarks import doubt
from tunnel_sim.files.importing.source import read_source
from tunnel_sim.files.importing.tables import NO_CHANNEL, Channel, RunColumn
from tunnel_sim.files.importing.units import HERTZ, UNITS, kind_of, known_unit, written_unit
from tunnel_sim.files.plausible import standing_for_missing
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import Quantity
from tunnel_sim.vocabulary.errors import TunnelError, asking, counted, one_line, shown
from tunnel_sim.vocabulary.freedom import DISPLACEMENT, column_unit, linear_unit
from tunnel_sim.vocabulary.quantities import PerSample, Rows

_COUNTERS = (2.0**8, 2.0**10, 2.0**12, 2.0**14, 2.0**16, 2.0**24, 2.0**32)
_TURNS = (2.0 * pi, 360.0)
_NEAR_END = 4.0  # multiple of the other steps: a jump leads from one end of the range to the other
_MOST_JUMPS = 10  # minimum number of samples per jump
_NEARLY = 0.75  # share of a counter's range: a step this long between two samples is an overflow
_SMALL = 0.25  # share of the range: no other step is longer
_MOST_CODES = 3  # number of different codes for missing readings, such as one for each end of a range
_SLOWEST_STEP = 0.5  # s: a longer step between samples is in a smaller unit
_IN_USE = (1e9, 2.5e9)  # s: times since 1970, of the years 2001 to 2049, show their unit
_HALF_TURN = pi  # half the span of an angle in radians: a greater span is in degrees
_LONGEST_FORMULA = 200  # characters
_NUMBER = r"([+-]?\s*(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_VARIABLE = r"(?:[VvXxUu]|volts?)"
_LINE = re.compile(
    rf"(?i)\s*(?:{_NUMBER}\s*(?=[+-]))?\s*(?:{_NUMBER}\s*\*?|([+-])?)\s*{_VARIABLE}\s*"
    rf"(?:/\s*{_NUMBER})?\s*(?:{_NUMBER})?\s*"
)
"""``a + b*V``, ``b*V + a`` or ``V/d``: offset, factor or its sign, divisor and trailing offset."""
_BRACKET = re.compile(
    rf"(?i)\s*(?:{_NUMBER}\s*(?=[+-]))?\s*(?:{_NUMBER}\s*\*?|([+-])?)\s*\(([^()]*)\)\s*"
    rf"(?:([*/])\s*{_NUMBER})?\s*(?:{_NUMBER})?\s*"
)
"""``a + b*(…)`` or ``(…)/d + a``."""
_RATE_FACTS = re.compile(
    r"(?i)(^|[^a-z])(fs|sample[ _]?rate|sampling[ _]?(rate|frequency)|samplerate|rate[ _]*\(?hz|"
    r"(mess|abtast)(rate|frequenz))($|[^a-z])"
)
_STEP_FACTS = re.compile(
    r"(?i)(^|[^a-z])(ts|dt|delta[ _]?t|sample[ _]?(time|interval)|sampling[ _]?(time|interval))($|[^a-z])"
)
_OWN_STEP = re.compile(r"(?i)^(wf_increment|delta_x|(x[ _]?)?increment)( \(s\))?$")

_STEPS = (1.0 / limits.FASTEST_RATE, 1.0 / limits.SLOWEST_RATE)  # s
_RATE_AGREES = 0.05  # largest relative difference of a stated rate from the times; a rate may be rounded

Calibration = tuple[PerSample, PerSample] | tuple[float, float]
"""Voltages and readings of a table; or offset and factor of a straight line."""


def without_overflow(values: Rows, turn: float | None = None) -> tuple[Rows, list[str]]:
    """Readings of a counter or a single-turn sensor without jumps at the ends of its range; and remarks.

    Args:
        turn: a whole turn in the unit of the readings; None if it is not known.
    """
    known = np.flatnonzero(np.isfinite(values))
    numbers = values[known]
    steps = np.diff(numbers)
    longest = float(np.abs(steps).max(initial=0.0))
    counts = longest >= _NEARLY * _COUNTERS[0] and bool((numbers == np.round(numbers)).all())
    turns_by = _TURNS if turn is None else (turn,)
    for full in (*turns_by, *(_COUNTERS if counts else ())):
        if not _NEARLY * full < longest <= full or np.ptp(numbers) > full:
            continue
        jumps = np.abs(steps) > _NEARLY * full
        if _MOST_JUMPS * jumps.sum() > jumps.size:
            continue
        others = float(np.abs(steps[~jumps]).max())
        if others > _SMALL * full or (full - np.abs(steps[jumps]) > _NEAR_END * others).any():
            continue
        remark = f"{counted(int(jumps.sum()), 'jump')} by {full:.6g} taken out (overflow of the counter)"
        turns = np.concatenate([[0.0], np.cumsum(np.where(jumps, -np.sign(steps), 0.0))])
        result = values.copy()
        result[known] = numbers + full * turns
        return result, [remark]
    return values, []


def _turn_in(unit: str) -> float | None:
    """A whole turn in a unit of angles; None of another unit."""
    factor = UNITS["angle"].get(unit)
    return None if factor is None else 2.0 * pi / factor


def _continuous(values: Rows, turn: float | None) -> tuple[Rows, list[str]]:
    """Readings without the overflow of a sensor and without codes for missing ones, and remarks."""
    values, remarks = without_overflow(values, turn)
    if remarks:  # the other end of a counter's range may also be far from all other readings
        return values, remarks
    values, codes = without_codes(values)
    values, remarks = without_overflow(values, turn)
    return values, [*codes, *remarks]


def stated_unit(text: str | None, kinds: Sequence[str], option: str) -> str | None:
    """The unit of certain kinds, keys of `UNITS`, named by an option; None if the option is not given."""
    unit = known_unit(text) if text is not None else None
    if text is not None and (unit is None or kind_of(unit) not in kinds):
        linear = [DISPLACEMENT.units] * ("angle" in kinds)
        known = [*(UNITS[kind] for kind in kinds), *(units for one in linear for units in one.values())]
        names = ", ".join(name for units in known for name in units)
        raise TunnelError(f"unknown unit '{one_line(text, 20)}'", where=option, remedy=f"use one of {names}")
    return unit


def describes_samples(name: str) -> bool:
    """Whether a number in a file is the rate or the step of its samples, by its name."""
    return any(pattern.search(name) for pattern in (_OWN_STEP, _RATE_FACTS, _STEP_FACTS))


def sample_interval(facts: Mapping[str, float], choices: ImportChoices) -> tuple[float | None, str]:
    """The interval of samples without times, s, None if it is not stated; and its source."""
    if choices.rate is not None:
        return 1.0 / choices.rate, f"{choices.rate:g} Hz as stated"
    # first the step of these columns, then numbers that describe the whole file
    for pattern, is_rate in ((_OWN_STEP, False), (_RATE_FACTS, True), (_STEP_FACTS, False)):
        least, most = (limits.SLOWEST_RATE, limits.FASTEST_RATE) if is_rate else _STEPS
        for name, value in facts.items():
            word = re.split(r"[\s_(\[]+", name.rstrip(")] "))[-1]
            factor = (
                HERTZ.get(word.lower(), 1.0) if is_rate else UNITS["time"].get(known_unit(word) or "", 1.0)
            )
            if pattern.search(name) and least <= value * factor <= most:
                interval = 1.0 / (value * factor) if is_rate else float(value * factor)
                return interval, f"'{name}' = {value:g} in the file"
    return None, ""


def guessed_time_unit(values: Rows) -> tuple[str, float]:
    """The assumed unit of times without one, and the usual step in it."""
    known = np.sort(values[np.isfinite(values)])  # rows may be out of order
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    units = {unit: UNITS["time"][unit] for unit in ("s", "ms", "us", "ns")}
    first = float(known[0]) if known.size else 0.0
    since = (unit for unit, factor in units.items() if _IN_USE[0] <= first * factor <= _IN_USE[1])
    of_step = (unit for unit, factor in units.items() if step * factor <= _SLOWEST_STEP)
    return next(since, None) or next(of_step, "ns"), step


def guessed_angle_unit(values: Rows) -> tuple[str, float]:
    """The assumed unit of angles without one, and half their range in it."""
    swing = _swing(values)
    return "deg" if swing > _HALF_TURN else "rad", swing


def _swing(values: Rows) -> float:
    """Half the range of readings, without a single one far from all others."""
    known = values[np.isfinite(values)]
    standing = standing_for_missing(known) if known.size else None
    return 0.5 * float(np.ptp(known if standing is None else known[~standing]))


def without_codes(values: Rows) -> tuple[Rows, list[str]]:
    """Readings without a number that stands for a missing one, such as -9999, and remarks.

    A single reading far from all others may be one of the sensor, and is kept.
    """
    remarks = []
    for _ in range(_MOST_CODES):
        known = np.flatnonzero(np.isfinite(values))
        standing = standing_for_missing(values[known]) if known.size else None
        if standing is None or standing.sum() < 2:
            break
        code = float(values[known[standing][0]])
        many = counted(int(standing.sum()), "reading")
        remarks.append(f"{many} of {code:.6g}, far from all others, taken as missing")
        values = values.copy()
        values[known[standing]] = np.nan
    return values, remarks


def in_seconds(
    times: Channel, count: int, facts: Mapping[str, float], choices: ImportChoices, where: str
) -> RunColumn:
    """The times of a run, s: from their column, or by counting rows at the stated rate; guesses are reported."""
    if times is NO_CHANNEL:
        interval, origin = sample_interval(facts, choices)
        if interval is None:
            raise asking("--time NAME", "no column of times", where, ", or --rate in Hz")
        why = f"times at {1.0 / interval:.6g} Hz: {origin}"
        return RunColumn(NO_CHANNEL, np.arange(count, dtype=np.float64) * interval, "s", "time", (why,))
    _refuse_faulty(times, where)
    values, remarks = without_overflow(times.values)
    unit = stated_unit(choices.time_unit, ("time",), "--time-unit") or times.unit
    if unit and kind_of(unit) != "time":
        what = f"{times.quoted} is in '{one_line(unit, 20)}', which is not a unit of time"
        remedy = "give --time-unit, or --time with the name of another column"
        raise TunnelError(what, where=where, remedy=remedy)
    if not unit:
        _ask_for_unit(times, ("time",), "--time-unit", where)
        unit, step = guessed_time_unit(values)
        taken = f"the file states no unit of the times: steps of {step:.4g} are taken as {unit}"
        remarks.append(doubt(f"{taken}; --time-unit changes this"))
    values = values * UNITS["time"][unit] if unit != "s" else values
    remarks += _contradicted_rate(values, facts, choices)
    return RunColumn(times, values, unit, "time", tuple(remarks))


def _contradicted_rate(times: Rows, facts: Mapping[str, float], choices: ImportChoices) -> list[str]:
    """The remark that the file, or an option, states another rate than the times show; none where they agree.

    Gaps change the mean step and not the usual one; coarse stamps change the usual step and not the mean.

    Args:
        times: in s, not a number where a row has none.
    """
    interval, origin = sample_interval(facts, choices)
    known = times[np.isfinite(times)]
    steps = np.diff(known)
    if interval is None or not (steps > 0.0).any():
        return []
    usual, mean = float(np.median(steps[steps > 0.0])), float(known[-1] - known[0]) / steps.size
    if any(abs(step / interval - 1.0) <= _RATE_AGREES for step in (usual, mean)):
        return []
    rate = f"{1.0 / usual:.4g}"
    return [doubt(f"the times show {rate} Hz, not {origin}: the times are used; --rate {rate} confirms them")]


def _refuse_faulty(channel: Channel, where: str) -> None:
    """Refuse a column whose numbers are not those of one record."""
    if channel.fault:
        what, remedy = channel.fault
        raise TunnelError(f"{channel.quoted} {what}", where=where, remedy=remedy)


def _ask_for_unit(channel: Channel, kinds: Sequence[str], option: str, where: str) -> None:
    """Refuse to guess the unit of a column whose name may contain a unit."""
    word = written_unit(channel.name, kinds)
    if word:
        what = f"'{word}' in the name of {channel.quoted} may be its unit"
        allowed = ", ".join(name for kind in kinds for name in UNITS[kind])
        raise TunnelError(what, where=where, remedy=f"give {option}, one of {allowed}")


def refuse_without_unit(channels: Sequence[Channel], where: str) -> None:
    """Refuse columns named as rates or accelerations without a stated unit.

    The size of an angle shows whether it is in rad or deg. The size of a rate does not, since a rate has no
    greatest value.
    """
    kinds = {channel: named_kind(channel.name) for channel in channels if not channel.unit}
    first = next(filter(None, kinds.values()), "")
    found = [channel for channel, kind in kinds.items() if kind and kind == first]
    if not found:
        return
    noun = f"is {'an' if first == 'acceleration' else 'a'} {first} by its name, and nothing states its unit"
    chosen = ""
    if len(found) > 1:
        noun = f"are {first}s by their names, and nothing states their unit"
        chosen = ", or another of them,"
    known = ", ".join((*UNITS[first], *DISPLACEMENT.units[first]))
    units = f"{chosen} and --unit, one of {known}; or --unit deg if it is an angle"
    option = f'--angle "{one_line(found[0].name, 40)}"'
    raise asking(option, f"{listed(found)} {noun}", where, units)


def _refuse_rate(reading: Channel, where: str) -> None:
    """Refuse a column named as a rate or an acceleration with a unit of an angle."""
    rate = "" if ANGLE.search(reading.name) else named_kind(reading.name)
    if rate and kind_of(reading.unit) == "angle":
        noun = "an acceleration" if rate == "acceleration" else "a rate"
        what = f"{reading.quoted} is {noun} by its name, and in {reading.unit}, a unit of an angle"
        remedy = f"give --unit, one of {', '.join(UNITS[rate])}, or {reading.unit} if it is an angle"
        raise TunnelError(what, where=where, remedy=remedy)


def in_radians(
    reading: Channel, timed: Rows, choices: ImportChoices, calibration: Calibration | None, where: str
) -> RunColumn:
    """Readings in rad, rad/s or rad/s², or of a displacement in m, m/s or m/s²; the role is their quantity.

    Args:
        timed: the readings of the column, NaN where there is no time.
    """
    _refuse_faulty(reading, where)
    linear = linear_unit(choices.unit or reading.unit or column_unit(reading.name))
    if linear is not None and choices.counts_per_turn is None and calibration is None:
        of, unit, factor = linear
        values, codes = without_codes(timed)
        values = values if factor == 1.0 else factor * values
        return RunColumn(reading, values, unit, of, tuple(codes), motion=DISPLACEMENT.motion)
    kinds = ("angle", "counts", "voltage", "rate", "acceleration")
    unit = stated_unit(choices.unit, kinds, "--unit") or reading.unit
    if unit and kind_of(unit) not in kinds and choices.counts_per_turn is None and calibration is None:
        raise TunnelError(
            f"{reading.quoted} is in '{one_line(unit, 20)}', which is not a known unit of an angle",
            where=where,
            remedy=f"give --unit ({', '.join(UNITS['angle'])} or another), --counts-per-turn N or --calibration",
        )
    if choices.unit is None:
        _refuse_rate(reading, where)
    values, remarks = _continuous(timed, choices.counts_per_turn or _turn_in(unit))
    if not np.isfinite(values).any():
        what = f"{reading.quoted} holds no number where the file states a time"
        raise TunnelError(what, where=where, remedy="leave the file out, or name another column by --angle")
    if calibration is not None:
        own = unit if kind_of(unit) == "voltage" else reading.unit
        volts = values * UNITS["voltage"].get(own, 1.0)
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
        remarks.append(f"'{reading.name}' converted by the calibration")
        values, overflowed = without_overflow(values, _turn_in(unit))
        remarks += overflowed
    elif choices.counts_per_turn is not None:
        values, unit = values / choices.counts_per_turn, "turns"
        remarks.append(f"'{reading.name}' holds counts, {choices.counts_per_turn:g} per turn")
    if kind_of(unit) in ("counts", "voltage"):
        option = "--counts-per-turn N" if kind_of(unit) == "counts" else '--calibration "a + b*V"'
        raise asking(option, f"'{reading.name}' is in {unit}", where)
    if not unit:
        if calibration is None:
            _ask_for_unit(reading, kinds, "--unit", where)
            refuse_without_unit([reading], where)
            if names_voltage(reading.name):
                what = f"{reading.quoted} may be a voltage by its name, and nothing states its unit"
                raise asking('--calibration "a + b*V"', what, where, ", or --unit if it is an angle")
        unit, swing = guessed_angle_unit(values)
        no_unit, change = f"the file states no unit of '{reading.name}'", "--unit changes this"
        if calibration is not None:
            no_unit = f"the calibration of '{reading.name}' states no unit of the angle"
        remarks.append(
            doubt(
                f"{no_unit}: a swing of ±{swing:.4g} is taken as {unit}; {change}",
                f"{no_unit}: it is taken as {unit}; {change}",
            )
        )
    kind = kind_of(unit)
    factor = UNITS[kind][unit]
    quantity: Quantity = "rate" if kind == "rate" else "acceleration" if kind == "acceleration" else "angle"
    values = values if factor == 1.0 else values * factor
    swing = _swing(values)
    # a disc between springs swings as far, but counts look like degrees
    if unit == "deg" and choices.unit is None and calibration is None and swing > _HALF_TURN:
        what = f"{reading.quoted} would swing by more than half a turn in degrees"
        raise asking("--counts-per-turn N", what, where, " for an encoder, or --unit deg if it does")
    return RunColumn(reading, values, unit, quantity, tuple(remarks))


def _straight_line(text: str) -> tuple[float, float] | None:
    """Offset and factor of a formula such as ``0.1 + 20*V``, ``12*(V - 2.5)`` or ``(V - 2)/3``; None: not one."""
    text = text[:_LONGEST_FORMULA]
    found, bracket = _LINE.fullmatch(text), _BRACKET.fullmatch(text)
    if found is not None:
        before, factor, sign, divisor, behind = found.groups()
        offset, slope, product = 0.0, 1.0, "/"
    elif bracket is not None:
        before, factor, sign, inside, product, divisor, behind = bracket.groups()
        inner = _straight_line(inside) if "(" not in inside else None
        if inner is None:
            return None
        offset, slope = inner
    else:
        return None
    number = [
        None if part is None else float(part.replace(" ", "")) for part in (before, factor, divisor, behind)
    ]
    if None not in (number[0], number[3]) or (number[2] == 0.0 and product == "/"):
        return None
    scale = (-1.0 if sign == "-" else 1.0) if number[1] is None else number[1]
    scale *= 1.0 if number[2] is None else number[2] if product == "*" else 1.0 / number[2]
    return scale * offset + (number[0] or number[3] or 0.0), scale * slope


def read_calibration(text: str | None) -> Calibration | None:
    """The calibration from a formula such as ``0.1 + 20*V``, or from a text file of volts and angle."""
    if text is None:
        return None
    line = _straight_line(text)
    if line is not None:
        return line
    path = Path(text)
    if not path.is_file():
        raise TunnelError(
            "is not a formula", where=f"--calibration {one_line(text, 40)}",
            remedy="give 'a + b*V' or 'b*(V - c)' with numbers, or the name of a table of two columns",
        )  # fmt: skip
    channels = read_source(path, ImportChoices()).tables[0].channels
    if len(channels) != 2 or channels[0].values.size < 2:
        raise TunnelError("is not a table of two columns", where=shown(path), remedy="give volts and angle")
    order = np.argsort(channels[0].values)
    factor = UNITS["angle"].get(channels[1].unit, 1.0)
    return channels[0].values[order], channels[1].values[order] * factor
