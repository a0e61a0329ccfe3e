"""Clean-up of times and readings, and where runs begin and end in a record; every change is said.

A free decay crosses its centre every half cycle and never grows much from one half cycle to the next. Where a
crossing takes longer and the excursions after it are larger than before, a hand has moved the body or held
it. Any other record is one run.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.conditions import Stretch
from tunnel_sim.vocabulary.errors import TunnelError, counted
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
    """

    time_s: Array
    reading: Array
    said: tuple[str, ...]


def without_overflow(values: Array, said: list[str]) -> Array:
    """Readings of a counter or a single-turn sensor without jumps at the ends of its range, which are said.

    Args:
        values: as recorded, shape (n,); NaN where there is no number.
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
        said.append(f"{counted(int(jumps.sum()), 'jump')} by {full:.6g} taken out (overflow of the counter)")
        turns = np.concatenate([[0.0], np.cumsum(np.where(jumps, -np.sign(steps), 0.0))])
        result = values.copy()
        result[known] = numbers + full * turns
        return result
    return values


def restarts(time: Array) -> list[int]:
    """Where the times, shape (n,), begin anew because another run follows: its first samples; empty: nowhere."""
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
    """
    said: list[str] = []
    good = np.isfinite(time) & np.isfinite(reading)
    if not good.all():
        known = np.flatnonzero(good)
        inside = int(known[-1] - known[0] + 1 - known.size) if known.size else 0
        if inside:
            said.append(f"{counted(inside, 'sample')} without a number left out")
        time, reading = time[good], reading[good]
    if (np.diff(time) < 0.0).any():
        order = np.argsort(time, kind="stable")
        time, reading = time[order], reading[order]
        said.append("rows out of order sorted by time")
    same = np.diff(time) == 0.0
    repeated = same & (np.diff(reading) == 0.0)
    differing = np.count_nonzero(same & ~repeated)
    if differing > _COARSE * time.size and time[0] < time[-1]:
        said.append(
            f"{differing} stamps equal the one before though the readings differ: the stamps are coarser than "
            f"the sampling, and evenly spaced times take their place"
        )
        time = np.linspace(time[0], time[-1], time.size)
    elif same.any():
        keep = np.concatenate([[True], ~same])
        further = (
            f", and {counted(int(differing), 'further reading')} at the time of the one before"
            if differing
            else ""
        )
        said.append(f"{counted(int(repeated.sum()), 'repeated sample')} left out{further}")
        time, reading = time[keep], reading[keep]
    if time.size and time[0] != 0.0:
        said.append(f"times count from the first sample, which the file has at {time[0]:.6g} s")
    time = from_zero(time)
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size > 1 else 0.0
    if usual > 0.0:  # else beyond the resolution of floating-point numbers; the run is refused later
        gaps = steps > 1.75 * usual
        if gaps.any():
            missing = int(np.round(steps[gaps] / usual - 1.0).sum())
            where = f"in {counted(int(gaps.sum()), 'gap')}, up to {steps.max():.4g} s long"
            said.append(f"about {counted(missing, 'sample')} missing {where}")
        spread = float(np.abs(steps[~gaps] - usual).max())
        if spread > _UNEVEN * usual:
            share = f"{100.0 * spread / usual:.0f} % of a step"
            said.append(f"time stamps differ from an even clock by up to {share}; kept")
    return Cleaned(time, reading, tuple(said))


def from_zero(time: Array) -> Array:
    """Times from the first sample on, shape (n,), s, without the digits that a subtraction adds."""
    if time.size < 2 or time[0] == 0.0:
        return time
    step = float(np.ptp(time)) / (time.size - 1)
    kept = 6 - floor(log10(max(step, _FINEST)))  # digits: a millionth of a step
    counted: Array = np.round(time - time[0], kept)
    return counted


def from_rest(reading: Array, rest: float, unit: str, said: list[str], where: str) -> Array:
    """A reading without its value at rest.

    Args:
        reading: of a run, shape (n,), in the unit.
        rest: as stated, in the unit.
        unit: of the reading.
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


def resolution(readings: Sequence[Array]) -> float | None:
    """The step of a sensor whose readings, each of shape (n,), lie on evenly spaced levels; None: they do not."""
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


_BAND = 0.05  # of the largest excursion: a smaller one counts as rest
_NOISES = 5.0  # standard deviations: smaller excursions are noise
_NOISE_OF = 200_000  # samples in which the noise is looked for
_CENTRED = 2  # times the centre is estimated
_LONGER = 1.8  # usual half cycles: no free motion takes as long from crossing to crossing
_SLOWER = 1.25  # times the way back: a pull at the start of a record takes longer
_GROWN = 1.5  # times the excursion before: no free decay grows as much within half a cycle
_STILL_GROWING = 1.1  # times the excursion before: the hand has not let go
_LEAST_HALVES = 6  # half cycles: a shorter motion is not a run
_AT_TURN = 0.005  # of an excursion: the reading stays as near the turning point while the body is held
_HELD = 0.5  # of a half cycle: a free turning point is not that flat for longer


@dataclass(frozen=True)
class RecordPiece:
    """A run in a record: the index of its first sample, and that behind its last one."""

    first: int
    last: int


def find_runs(time_s: Array, reading: Array) -> list[RecordPiece]:
    """The runs of a record: one for each release; the whole record where no hand is seen in it.

    Args:
        time_s: increasing, shape (n,), s.
        reading: shape (n,).
    """
    whole = [RecordPiece(0, reading.size)]
    away = reading - np.median(reading)
    # White noise by fourth differences, in which a swing hardly shows.
    some = np.abs(np.diff(reading[:_NOISE_OF], 4))
    noise = _NOISES * (float(np.median(some)) / (0.6745 * sqrt(70.0))) if some.size else 0.0
    for _ in range(_CENTRED):
        starts, ends = _excursions(away, noise)
        if starts.size < _LEAST_HALVES:
            return whole
        # A hold or a pull draws the median aside; most swings have their centre between two turning points.
        swings = (away[a:b] for a, b in zip(starts, ends, strict=True))
        turns = np.array([swing[int(np.argmax(np.abs(swing)))] for swing in swings])
        away = away - np.median(0.5 * (turns[1:] + turns[:-1]))
    starts, ends = _excursions(away, noise)
    if starts.size < _LEAST_HALVES:
        return whole
    clear = noise <= _BAND * float(np.abs(away).max())
    peaks = np.array([np.abs(away[a:b]).max() for a, b in zip(starts, ends, strict=True)])
    middle = 0.5 * (time_s[ends[:-1] - 1] + time_s[starts[1:]])
    crossings = np.concatenate([[time_s[0]], middle, [time_s[-1]]])
    lengths = np.diff(crossings)
    usual = float(np.median(lengths[:-1]))
    turn = time_s[starts[0] + int(np.argmax(np.abs(away[starts[0] : ends[0]])))]
    if turn - time_s[0] > _SLOWER * (crossings[1] - turn) + (time_s[1] - time_s[0]):
        lengths[0] = np.inf  # pulled aside: a free swing takes no longer out than back
    # Dry friction may hold the body beside the centre: a last stretch of one sign that long is a rest.
    moved = int(starts[-1] if time_s[ends[-1] - 1] - time_s[starts[-1]] > _LONGER * usual else ends[-1])
    # the excursions in which a hand moves the body, each with the one from which on the motion is free
    found: list[tuple[int, int]] = []
    for k in np.flatnonzero(lengths[:-1] > _LONGER * usual).tolist():
        before = peaks[k - 1] if k else 0.0
        if max(peaks[k], peaks[k + 1]) <= _GROWN * before:
            continue
        at = k
        while at + 1 < peaks.size and peaks[at + 1] > _STILL_GROWING * peaks[at]:
            at += 1
        if not found or at > found[-1][1]:
            found.append((k, at))
    if found and found[0][0] >= _LEAST_HALVES:  # the record begins in free motion
        found.insert(0, (0, 0))
    until = [*(k for k, _ in found), peaks.size][1:]
    found = [
        (k, at)
        for (k, at), end in zip(found, until, strict=True)
        if peaks[at:end].max() <= _STILL_GROWING * peaks[at]
    ]
    if not found:
        return [RecordPiece(0, _without_long_rest(time_s, 0, moved, clear=clear))]
    pieces = []
    for place, (_, released) in enumerate(found):
        # From the first sample of the largest reading, or from the last one of a hold.
        size = np.abs(away[starts[released] : ends[released]])
        near = int(starts[released]) + np.flatnonzero(size >= (1.0 - _AT_TURN) * size.max())
        held = time_s[near[-1]] - time_s[near[0]] > _HELD * usual
        first = int(near[-1]) if held else int(starts[released]) + int(np.argmax(size))
        if place + 1 < len(found):
            hand = found[place + 1][0]
            last = max(int(ends[hand - 1]), int(np.searchsorted(time_s, time_s[starts[hand]] - usual)))
            halves = hand - released
        else:
            last = _without_long_rest(time_s, first, moved, clear=clear)
            halves = peaks.size - released
        if halves >= _LEAST_HALVES:
            pieces.append(RecordPiece(first, last))
    return pieces or whole


def stated_piece(time_s: Array, found: RecordPiece, stated: Stretch, where: str) -> RecordPiece:
    """A run with the start and the end that are stated; refused where fewer than two samples lie between.

    Args:
        time_s: of the record, shape (n,), s.
    """
    if stated.start is None and stated.end is None:
        return found
    start = time_s[found.first] if stated.start is None else stated.start
    end = time_s[found.last - 1] if stated.end is None else stated.end
    # Half a step of slack: a marker between two samples belongs to the closer one.
    slack = 0.5 * float(np.median(np.diff(time_s)))
    first, last = (int(place) for place in np.searchsorted(time_s, [start - slack, end + slack]))
    if last - first < 2:
        remedy = "state a start before the end, within the record"
        raise TunnelError(f"no samples from {start:g} to {end:g} s", where=where, remedy=remedy)
    return RecordPiece(first, last)


def _excursions(away: Array, noise: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The stretches of one sign outside the band around the centre: first samples, and those behind the last."""
    outside = np.flatnonzero(np.abs(away) > max(_BAND * float(np.abs(away).max()), noise))
    change = np.flatnonzero(np.diff(np.sign(away[outside])) != 0.0)
    if not outside.size:
        return outside, outside
    return outside[np.concatenate([[0], change + 1])], outside[np.concatenate([change, [-1]])] + 1


def _without_long_rest(time_s: Array, first: int, end: int, *, clear: bool) -> int:
    """Where a record ends that rests for longer than it moves: as much rest as motion is kept."""
    if not clear:  # the motion goes on in the noise
        return time_s.size
    return int(np.searchsorted(time_s, 2.0 * time_s[end - 1] - time_s[first], side="right"))
