"""Plausibility of a run: plausible ranges, increasing times, angles in radians, three cycles.

Outside the plausible ranges of a rig, its air and its clock a wrong unit is more likely than such a rig. The
ranges are wide enough for towing carriages, pressurised tunnels and models of a few centimetres. Stiffness
and inertia have no range, because both scale with the fifth power of a rig's size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input, checked_input
from tunnel_sim.vocabulary.quantities import Hertz, Rad, Readings, Times
from tunnel_sim.vocabulary.record import Record, count_cycles

KEEP = "state plausible = false under [sensor] to keep it"
#: With fewer samples per cycle a fit can hardly distinguish the motion from its alias above half the sample
#: rate.
LEAST_SAMPLES_PER_CYCLE = 4.0
#: With fewer samples per cycle the peaks are only resolved to 5 %. A fit needs no more, so they are accepted
#: with a remark.
FEW_SAMPLES_PER_CYCLE = 10.0
_LOOKS = "it looks like"
_TWO_TURNS = 4.0 * np.pi
# If milliseconds are given as seconds, or kHz as Hz, time_s and sample_rate differ by a power of a thousand. Other
# differences are allowed: a run with times may have its own sample rate.
_TIME_SLIPS = (1e-6, 1e-3, 1e3, 1e6)
_SLIP_TOLERANCE = 0.1
# multiple of the usual step: a longer gap in a record without an oscillation is a jump of the clock
_JUMP = 50.0
_FIRST = 5  # number of samples that give the level of a hold
_HELD, _STILL = 0.1, 0.02  # share of the range that ends a hold; greatest range within its later part
_HOLD, _LATE = 0.2, (0.6, 0.9)  # least share of a record with a long hold; later part of a hold, as shares
_JOINED = 6  # number of samples on each side of a jump for the fit of a cubic,
_SHORT = 400  # or a 400th of the record
_NEAR = 20  # the body must move in a 20th of the record on each side
_MOVING = 0.1  # share of the range of the readings
_CONTINUES = 0.02  # share of the range near the jump
_BEYOND = 1.0  # ranges of the other readings: a value farther away stands for a missing one
MINIMUM_CYCLES = 3.0
# The count is uncertain, most with heavy damping or a drifting sensor; a run of three cycles must pass.
CYCLE_TOLERANCE = 0.25
# If degrees are given as radians or vice versa, swing and stated release angle differ by a factor of 57.3; of
# millimetres and metres by 1000. A release need not be the greatest swing: from 0.87 to 1.3 of that factor.
_SLIP_RATIO = (50.0 * np.pi / 180.0, 75.0 * np.pi / 180.0)


@dataclass(frozen=True)
class Range:
    """The plausible values of one quantity.

    Args:
        low, high: least and greatest plausible value, in the unit.
        above, below: likely unit of a value above and below the range.
    """

    low: float
    high: float
    unit: str
    above: str
    below: str
    reason: str


RANGES: Mapping[str, Range] = {
    "air_density": Range(
        0.05, 50.0, "kg/m3", "g/m3, or water", "g/cm3",
        "air at 20 km altitude has 0.09, a tunnel at 20 bar or heavy gas stays below 30; water has 1000",
    ),
    "wind_speed": Range(
        0.0, 120.0, "m/s", "km/h or mm/s", "",
        "above a Mach number of 0.35 compressibility changes the coefficients themselves",
    ),
    "frontal_area": Range(
        1e-5, 100.0, "m2", "cm2 or mm2", "km2",
        "a model 3 mm across up to a lorry or a ship of 10 m across",
    ),
    "reference_length": Range(
        3e-3, 50.0, "m", "cm or mm", "km",
        "a model of a few millimetres up to a lorry with its trailer",
    ),
    "width": Range(1e-3, 20.0, "m", "cm or mm", "km", "a third of the reference length"),
    "release_angle": Range(
        -_TWO_TURNS, _TWO_TURNS, "rad", "degrees", "degrees", "as for the swing",
    ),
    "swing": Range(
        0.0, _TWO_TURNS, "rad, or name the column yaw_deg", "degrees", "",
        "a pendulum stays below half a turn and a disc between springs below two; 13 degrees are a small swing",
    ),
    "step": Range(
        1e-7, 0.5, "s", "milliseconds", "minutes or hours",
        "no angle sensor reaches 10 MHz, and a rig is sampled more often than twice a second",
    ),
    "period": Range(
        1e-3, 100.0, "s", "milliseconds", "minutes or hours",
        "a period of minutes suits a ship, a frequency above 1 kHz a tuning fork",
    ),
}  # fmt: skip
"""By key of ``campaign.toml``; ``swing``, ``step`` and ``period`` are half the span of a run's angle, its mean time
step and its period of oscillation."""


def plausible_values(values: Mapping[str, Any], where: str) -> None:
    """Refuse stated values, by key of ``campaign.toml`` and in its units, that appear to be in a wrong unit."""
    for key, value in values.items():
        allowed = RANGES.get(key)
        if allowed is not None and value is not None:
            _check(f"{key} = {value:g} {allowed.unit}", value, allowed, where)


def checked_record(
    time_s: Times,
    reading: Readings,
    column: str,
    sensor: SensorProperties,
    release_angle: Rad | None,
    where: str,
    drive: Input | None = None,
) -> Record:
    """The record of a run, unless the record or its input is refused."""
    increasing_times(time_s, sensor.sample_rate, where)
    angle, judged = sensor.derivative == 0, sensor.plausible is not False
    swing = 0.5 * (float(reading.max()) - float(reading.min()))  # the sensor's zero is unknown
    if judged and angle and release_angle and swing != 0.0:
        slip = sensor.freedom.slip
        ratio, low, high = abs(release_angle) / swing, slip * _SLIP_RATIO[0], slip * _SLIP_RATIO[1]
        if not column.endswith(("_deg", "_mm")) and low <= 1.0 / ratio <= high:
            raise TunnelError(
                f"{column} swings by ±{swing:.4g}, about {slip:.0f} times the release_angle of "
                f"{release_angle:.4g} rad: it looks like degrees",
                where=where,
                remedy=f"name the column yaw_deg, or convert it to radians; {KEEP}",
            )
        if low <= ratio <= high:
            raise TunnelError(
                f"{column} swings by ±{swing:.4g} rad, about 1/{slip:.0f} of the release_angle of "
                f"{release_angle:.4g} rad: one of them is in the wrong unit",
                where=where,
                remedy="give release_angle in rad, name the column for its unit, or leave release_angle out; "
                f"{KEEP}",
            )
    record = Record(time_s, reading)
    cycles = _cycles_after_hold(record) if drive is None else 0.0
    if drive is None and not cycles >= MINIMUM_CYCLES - CYCLE_TOLERANCE:
        what = f"about {cycles:.1f} cycles of oscillation, fewer than three"
        remedy = "record for longer after the release, or leave the run out"
        if not cycles > 0.0:
            what = "no oscillation is visible in the record, so it has fewer than three cycles"
        if spoilt := _spoilt(record):
            what, remedy = spoilt
        raise TunnelError(what, where=where, remedy=remedy)
    step = record.sample_interval
    if judged and angle:  # rates and accelerations may have any size
        _check(f"the angle swings by ±{swing:.4g} rad", swing, RANGES["swing"], where)
    if judged:
        _check(f"time_s steps by {step:.3g} s", step, RANGES["step"], where)
    if drive is not None:
        checked_input(drive, record, where, judged=judged)
    if drive is not None or not judged:
        return record
    per_cycle = reading.size / cycles
    _check(f"a swing takes {step * per_cycle:.3g} s", step * per_cycle, RANGES["period"], where)
    if per_cycle < LEAST_SAMPLES_PER_CYCLE and (spoilt := _spoilt(record)):
        raise TunnelError(spoilt[0], where=where, remedy=spoilt[1])
    if per_cycle < LEAST_SAMPLES_PER_CYCLE:
        raise TunnelError(
            f"{per_cycle:.1f} samples per cycle: {_LOOKS} too low a sample rate, and the motion may be the alias "
            f"of a faster one",
            where=where,
            remedy=f"sample at {LEAST_SAMPLES_PER_CYCLE / (step * per_cycle):.3g} Hz or more; {KEEP}",
        )
    return record


def _cycles_after_hold(record: Record) -> float:
    """Number of cycles of a record, without a long hold before the motion: a hold has none."""
    cycles, reading = count_cycles(record), record.yaw_rad
    size = float(np.ptp(np.percentile(reading, [1.0, 99.0])))
    moved = np.flatnonzero(np.abs(reading - np.median(reading[:_FIRST])) > _HELD * size)
    begin = int(moved[0]) if moved.size else 0
    if begin < _HOLD * reading.size:
        return cycles
    # a motion that grows from rest is no hold
    still = np.percentile(reading[int(_LATE[0] * begin) : int(_LATE[1] * begin)], [5.0, 95.0])
    if float(np.ptp(still)) > _STILL * size:
        return cycles
    return min(cycles, count_cycles(Record(record.time_s[begin:], reading[begin:])))


def _spoilt(record: Record) -> tuple[str, str] | None:
    """The reason why an oscillation is hidden, and the remedy: a jump of the clock, or a code for a missing value.

    Each is confirmed by a trial: without it the record has three cycles.
    """
    at = clock_jump(record)
    if at is not None and _oscillates(without_jump(record, at)):
        return jump_words(
            record, at
        ), "correct the clock of the samples after it, or make two runs of the file"
    standing = standing_for_missing(record.yaw_rad)
    if standing is not None and _oscillates(Record(record.time_s[~standing], record.yaw_rad[~standing])):
        value = float(record.yaw_rad[standing][0])
        what = (
            f"{int(standing.sum())} of {standing.size} readings are {value:.6g}, far from all others: a value that "
            "stands for a missing one hides the oscillation"
        )
        return what, "leave these samples out, or repair the sensor"
    return None


def _oscillates(record: Record) -> bool:
    return bool(count_cycles(record) >= MINIMUM_CYCLES - CYCLE_TOLERANCE)


def clock_jump(record: Record) -> int | None:
    """The sample after which the times jump while the reading continues; None where there is none.

    across missing samples a swing does not continue with the same value and slope
    """
    steps = np.diff(record.time_s)
    at = int(np.argmax(steps))
    usual = float(np.median(steps))
    if not steps[at] > _JUMP * usual:
        return None
    joined, near = max(_JOINED, steps.size // _SHORT), max(_JOINED, steps.size // _NEAR)
    first, last = max(at + 1 - joined, 0), min(at + 1 + joined, steps.size + 1)
    before, after = record.yaw_rad[first : at + 1], record.yaw_rad[at + 1 : last]
    if min(before.size, after.size) < 3:
        return at if steps[at] > record.duration - _JUMP * usual * steps.size else None
    # a cubic through the samples on both sides, on a clock without the jump
    place = np.arange(last - first, dtype=np.float64)
    both = np.concatenate((before, after))
    left = both - np.polyval(np.polyfit(place, both, 3), place)
    moving = float(np.ptp(record.yaw_rad[max(at - near, 0) : at + near]))
    if moving < _MOVING * float(np.ptp(record.yaw_rad)):
        return None  # at rest any reading continues
    return at if float(np.abs(left).max()) < _CONTINUES * moving else None


def without_jump(record: Record, at: int) -> Record:
    """A record with continuous times: the jump after a sample is removed."""
    steps, time = np.diff(record.time_s), record.time_s.copy()
    time[at + 1 :] -= steps[at] - float(np.median(steps))
    return Record(time, record.yaw_rad)


def jump_words(record: Record, at: int) -> str:
    """The jump of the clock after a sample, in words."""
    steps = np.diff(record.time_s)
    return (
        f"time_s jumps by {steps[at]:.4g} s after {record.time_s[at]:.6g} s (sample {at + 2}), "
        f"{steps[at] / float(np.median(steps)):.3g} usual steps, while the reading continues"
    )


def standing_for_missing(reading: Readings) -> NDArray[np.bool_] | None:
    """Mask of readings far from all others, such as -9.99; None if there are none, or if most are.

    Args:
        reading: reading, shape (n,).
    """
    for value in (float(reading.min()), float(reading.max())):
        standing = np.asarray(reading == value)
        rest = reading[~standing]
        if 2 * rest.size < reading.size or rest.size < _JOINED:
            continue
        nearest = min(abs(value - float(rest.min())), abs(value - float(rest.max())))
        if nearest > _BEYOND * float(np.ptp(rest)) > 0.0:
            return standing
    return None


def few_samples(record: Record) -> str:
    """A remark on a free decay with few samples per cycle; empty if it has enough."""
    cycles = count_cycles(record)
    per_cycle = record.yaw_rad.size / cycles if cycles > 0.0 else np.inf
    if per_cycle >= FEW_SAMPLES_PER_CYCLE:
        return ""
    return f"{per_cycle:.1f} samples per cycle: a motion above half the sample rate would look the same"


def _check(said: str, value: float, allowed: Range, where: str) -> None:
    if allowed.low <= value <= allowed.high:
        return
    slip = allowed.above if value > allowed.high else allowed.below
    raise TunnelError(f"{said}: {_LOOKS} {slip}", where=where, remedy=f"give it in {allowed.unit}; {KEEP}")


def increasing_times(time_s: Times, sample_rate: Hertz | None, where: str) -> None:
    """Refuse times that do not increase, or are not in s. Steps may differ, and samples may be missing."""
    if time_s.size < 2:
        raise TunnelError("only one sample", where=where, remedy="record three cycles or more")
    steps = np.diff(time_s)
    back = np.flatnonzero(steps < 1.0 / limits.FASTEST_RATE)
    if back.size:
        at = int(back[0])
        raise TunnelError(
            f"time_s {'steps back' if steps[at] < 0.0 else 'stands still'} after {time_s[at]:.6g} s "
            f"(sample {at + 2})",
            where=where,
            remedy="sort the samples by time and leave out repeated ones",
        )
    step = float(np.median(steps))
    ratio = 1.0 if sample_rate is None else step * sample_rate
    if any(abs(ratio / slip - 1.0) < _SLIP_TOLERANCE for slip in _TIME_SLIPS):
        raise TunnelError(
            f"time_s steps by {step:.6g}, which is {1.0 / step:.6g} Hz if it is seconds, but [sensor] "
            f"sample_rate is {sample_rate:g} Hz",
            where=where,
            remedy="give time_s in seconds and sample_rate in Hz, or leave one of them out",
        )
