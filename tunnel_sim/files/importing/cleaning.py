"""Clean-up of times and readings; every change is said."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10, pi

import numpy as np

from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_COUNTERS = (2.0**8, 2.0**10, 2.0**12, 2.0**14, 2.0**16, 2.0**24, 2.0**32)
_TURNS = (2.0 * pi, 360.0)
_NEAR_END = 4.0  # other steps: a jump leads from one end of the range to the other
_MOST_JUMPS = 10  # samples per jump, at least
_NEARLY = 0.75  # of a counter's range: a step between two samples as long as that is an overflow
_SMALL = 0.25  # of the range: no other step is longer
_COARSE = 0.1  # share of samples with the stamp of the one before, above which the stamps are too coarse
_UNEVEN = 0.01  # of a step
_FINEST = 1e-12  # s
_RESTARTS = 0.01  # share of steps backwards, up to which the clock restarts and the rows are not out of order
_LEVELS_OF = 200_000  # samples of each run are looked at
_MOST_LEVELS = 20_000
_ON_LEVEL = 0.2  # of a level's height


@dataclass(frozen=True, eq=False)
class Cleaned:
    """Times and readings without what cannot be used.

    Args:
        time_s: shape (n,), s, increasing, from zero on.
        reading: shape (n,).
        said: what was changed, in words.
    """

    time_s: Array
    reading: Array
    said: tuple[str, ...]


def without_overflow(values: Array, said: list[str]) -> Array:
    """Readings of a counter or a single-turn sensor without the jumps at the ends of its range.

    Args:
        values: as recorded, shape (n,); NaN where there is no number.
        said: a remark is added where something is changed.

    Returns:
        The continuous reading, shape (n,).
    """
    known = np.flatnonzero(np.isfinite(values))
    numbers = values[known]
    steps = np.diff(numbers)
    longest = float(np.abs(steps).max(initial=0.0))
    counts = longest >= _NEARLY * _COUNTERS[0] and bool((numbers == np.round(numbers)).all())
    for full in (*_TURNS, *(_COUNTERS if counts else ())):
        if not _NEARLY * full < longest <= full or np.ptp(numbers) > full:
            continue
        jumps = np.abs(steps) > _NEARLY * full
        if _MOST_JUMPS * jumps.sum() > jumps.size:
            continue
        others = float(np.abs(steps[~jumps]).max())
        if others > _SMALL * full or (full - np.abs(steps[jumps]) > _NEAR_END * others).any():
            continue
        said.append(f"{int(jumps.sum())} jumps by {full:.6g} taken out (overflow of the counter)")
        turns = np.concatenate([[0.0], np.cumsum(np.where(jumps, -np.sign(steps), 0.0))])
        result = values.copy()
        result[known] = numbers + full * turns
        return result
    return values


def restarts(time: Array) -> list[int]:
    """Where the clock of a record begins anew because another run follows.

    Args:
        time: as recorded, shape (n,).

    Returns:
        Index of the first sample of every further run; empty where rows are only out of order.
    """
    with np.errstate(invalid="ignore"):  # rows without a finite time are left out later
        back = np.flatnonzero(np.diff(time) < 0.0) + 1
    if not back.size or back.size > max(1.0, _RESTARTS * time.size):
        return []
    starts = [0, *back.tolist(), time.size]
    parts = [time[a:b] for a, b in itertools.pairwise(starts)]
    # Another run begins near the time at which the first one began, and not a little earlier than the row above.
    early = [part[0] - time[0] <= 0.1 * np.ptp(parts[0]) for part in parts[1:]]
    return back.tolist() if all(early) else []


def cleaned(time: Array, reading: Array) -> Cleaned:
    """Times and readings that a campaign can hold.

    Args:
        time: as recorded, shape (n,), s.
        reading: shape (n,), in radians or what the sensor measures.

    Returns:
        Increasing times from zero on, and the readings at them.
    """
    said: list[str] = []
    good = np.isfinite(time) & np.isfinite(reading)
    if not good.all():
        first, last = (int(np.argmax(good)), good.size - int(np.argmax(good[::-1]))) if good.any() else (0, 0)
        inside = int((~good[first:last]).sum())
        if inside:
            said.append(f"{inside} samples without a number left out")
        time, reading = time[good], reading[good]
    if (np.diff(time) < 0.0).any():
        order = np.argsort(time, kind="stable")
        time, reading = time[order], reading[order]
        said.append("rows out of order sorted by time")
    time, reading = _without_repeats(time, reading, said)
    if time.size and time[0] != 0.0:
        said.append(f"times count from the first sample, which the file has at {time[0]:.6g} s")
    time = from_zero(time)
    said += _about_the_clock(time)
    return Cleaned(time, reading, tuple(said))


def from_zero(time: Array) -> Array:
    """Times from the first sample on, shape (n,), s, without the digits that a subtraction adds."""
    if time.size < 2 or time[0] == 0.0:
        return time
    step = float(np.ptp(time)) / (time.size - 1)
    counted: Array = np.round(
        time - time[0], 6 - floor(log10(max(step, _FINEST)))
    )  # a millionth of a step is kept
    return counted


def from_rest(reading: Array, rest: float, unit: str, said: list[str], where: str) -> Array:
    """A reading without its value at rest.

    Args:
        reading: of a run, shape (n,), in the unit.
        rest: as stated, in the unit.
        unit: of the reading.
        said: a remark is added.
        where: file and run, for messages.

    Returns:
        Shape (n,), in the unit.

    Raises:
        TunnelError: when the reading never passes the rest, as that of a body that swings must.
    """
    least, most = float(reading.min()), float(reading.max())
    if not least <= rest <= most:
        raise TunnelError(
            f"never passes the stated rest of {rest:.4g} {unit}: it lies from {least:.4g} to {most:.4g} {unit}",
            where=where,
            remedy=f"state the reading at rest in {unit}, for each run where they differ",
        )
    said.append(f"the stated reading at rest, {rest:.6g} {unit}, is subtracted")
    return reading - rest


def _without_repeats(time: Array, reading: Array, said: list[str]) -> tuple[Array, Array]:
    """Leave out repeated samples; stamps that several samples share are spread evenly."""
    same = np.diff(time) == 0.0
    if not same.any():
        return time, reading
    repeated = np.concatenate([[False], same & (np.diff(reading) == 0.0)])
    differing = np.count_nonzero(same & ~repeated[1:])
    if differing > _COARSE * time.size and time[0] < time[-1]:
        said.append(
            f"{differing} stamps equal the one before though the readings differ: the stamps are coarser than "
            f"the sampling, and evenly spaced times take their place"
        )
        return np.linspace(time[0], time[-1], time.size), reading
    keep = np.concatenate([[True], ~same])
    said.append(
        f"{np.count_nonzero(repeated)} repeated samples left out"
        + (f", and {differing} further readings at the time of the one before" if differing else "")
    )
    return time[keep], reading[keep]


def _about_the_clock(time: Array) -> list[str]:
    """What an examination will find in the time stamps; they are kept as they are."""
    steps = np.diff(time)
    if steps.size < 2:
        return []
    usual = float(np.median(steps))
    if not usual > 0.0:  # beyond the resolution of floating-point numbers; the run is refused later
        return []
    gaps = steps > 1.75 * usual
    said = []
    if gaps.any():
        missing = int(np.round(steps[gaps] / usual - 1.0).sum())
        said.append(
            f"about {missing} samples are missing in {int(gaps.sum())} gaps, up to {steps.max():.4g} s long"
        )
    spread = float(np.abs(steps[~gaps] - usual).max())
    if spread > _UNEVEN * usual:
        said.append(
            f"time stamps differ from an even clock by up to {100.0 * spread / usual:.0f} % of a step; kept"
        )
    return said


def resolution(readings: Sequence[Array]) -> float | None:
    """The step of a sensor whose readings lie on evenly spaced levels.

    Args:
        readings: of the runs, each of shape (n,).

    Returns:
        The step, in the unit of the reading; None where the readings do not repeat.
    """
    some = np.concatenate([reading[:_LEVELS_OF] for reading in readings])
    levels = np.unique(some)
    if not 3 <= levels.size <= min(_MOST_LEVELS, some.size // 2):
        return None
    # Rounded readings are off their levels, but the steps between neighbours are whole numbers of the sensor's.
    steps = np.diff(levels)
    place = np.concatenate([[0.0], np.cumsum(np.round(steps / np.median(steps)))])
    step, first = np.polyfit(place, levels, 1)
    away = float(np.abs(levels - first - step * place).max())
    return float(step) if step > 0.0 and away <= _ON_LEVEL * step else None
