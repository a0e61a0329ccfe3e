"""The swings of a reading, from extreme to extreme, whatever their size.

A swing needs no centre and no reference swing of its record: an extreme counts if the reading returns from it
by more than the noise, and by more than a share of the motion near it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.quantities import PerSample, Seconds, Times
from tunnel_sim.vocabulary.record import Array

_NOISE_OF = 200_000  # number of samples for the estimate of the noise
_STRETCH = 64  # number of samples with one estimate of the noise, by their mean fourth difference
_NOISES = 6.0  # standard deviations: white noise returns by as much in one of 1e4 half cycles
_ROUNDING = 1e-12  # share of the range: rounding alone
_TINY = 1e-200  # s, or the unit of the reading: below it quotients overflow
_LEVELS = 1.5  # steps of a rounding sensor: its last digit toggles
_STEPPED = 0.2  # share of unchanged readings from which a sensor rounds
_SHARE = 0.1  # share of the range near an extreme: a smaller return is a ripple on the swing
_FINE, _COARSE = 64, 12  # number of blocks in a half cycle: for a clean reading, and for a noisy one
_FINE_ENOUGH = 0.02  # share of the range of a record: less noise needs no wider blocks
_NEAR = 0.05  # share of a swing: the body is still, or already, at the extreme
_NEAREST = 0.25  # maximum share of a swing, for large noise
_AHEAD = 7  # number of swings after an extreme for the median that is the usual half period there
_USUAL_ACROSS = 0.713  # share of a half period: a sinusoid from 5 % to 95 % of its swing
_SLOW = 1.8  # multiple of the usual time across: a hand pulls, and no free motion takes as long
_SLOWER = 1.5  # multiple of the time of a free motion: a pull at the start of a record takes longer
_BETWEEN = 0.6  # half periods before the first extreme: the record may begin within a swing
_LATE = 1.2  # half periods before the first extreme: not one swing fits into them, with some slack
_HELD = 1.0  # half periods at an extreme: a sinusoid stays for 0.29


def noise_of(reading: PerSample) -> float:
    """The standard deviation of the white noise, by fourth differences, which hardly contain a swing.

    The median over short stretches ignores sudden changes; their means are exact for rounded readings, too.
    """
    some = np.abs(np.diff(reading[:_NOISE_OF], 4))
    if not some.size:
        return 0.0
    starts = np.arange(0, max(1, some.size - _STRETCH // 2), _STRETCH)
    counts = np.diff(np.append(starts, some.size))
    return float(np.median(np.add.reduceat(some, starts) / counts)) / (sqrt(2.0 / pi) * sqrt(70.0))


@dataclass(frozen=True, eq=False)
class Swings:
    """The extremes of a reading and the swings between them.

    Args:
        at: index of each extreme, shape (m,).
        departs: index of the last sample near the extreme before the swing away from it, shape (m,).
        reached: index of the first sample near the extreme, shape (m,).
        size: size of the swing from each extreme to the next, in the unit of the reading, shape (m - 1,).
        lasts: time of the swing, shape (m - 1,), s.
        usual: median of that time over the following swings, shape (m - 1,), s.
        across: time of the swing from leaving one extreme to reaching the next, converted to the time of a
            whole swing of a sinusoid, shape (m - 1,), s.
        stay: time near each extreme, shape (m,), s.
        slow: whether the swing takes too long for a free motion, shape (m - 1,).
        held: whether the body stays too long at the extreme for a free motion, shape (m,).
        least: smallest size that the noise cannot produce.
        sampled: greatest ratio of two equal swings due to sampling.
        begins_between: whether the record may begin between two extremes.
        begins_late: whether the record begins with something other than the first swing.
    """

    at: NDArray[np.intp]
    departs: NDArray[np.intp]
    reached: NDArray[np.intp]
    size: Array
    lasts: Array
    usual: Array
    across: Array
    stay: Array
    slow: NDArray[np.bool_]
    held: NDArray[np.bool_]
    least: float
    sampled: float
    begins_between: bool
    begins_late: bool


def swings_of(time_s: Times, reading: PerSample, half: Seconds, drift: float = 0.0) -> Swings | None:
    """The swings of a reading; None if it has fewer than two.

    Args:
        half: half a period of the strongest motion; 0: not known.
        drift: greatest drift of the centre, in the unit of the reading.
    """
    noise, step = noise_of(reading), float(np.median(np.diff(time_s)))
    span = float(np.ptp(reading))
    if not (step > _TINY and span > _TINY):
        return None
    usual = min(half / step, float(reading.size))
    wanted = ceil((_NOISES * noise / (_FINE_ENOUGH * span)) ** 2)
    block = int(max(1, usual / _FINE, min(wanted, usual / _COARSE)))
    count = reading.size // block
    means = reading[: count * block].reshape(count, block).mean(axis=1)
    least = max(_NOISES * noise / sqrt(block), _LEVELS * _level(reading), drift, _ROUNDING * span)
    turns = _turns(means, np.maximum(least, _SHARE * _ranges(means, max(3, int(usual / block)))))
    if turns.size < 3:
        return None
    clock = _without_gaps(time_s)
    at = _in_reading(turns, block, means, reading)
    left, reached = _ends(turns, means, block, least)
    size, lasts = np.abs(np.diff(reading[at])), np.diff(clock[at])
    padded = np.concatenate([lasts, np.full(_AHEAD - 1, np.nan)])
    ahead = np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, _AHEAD), axis=1)
    ahead = np.maximum(ahead, step)
    across = clock[reached[1:]] - clock[left[:-1]]
    slack = 2.0 * block * step  # the ends of a swing are known to a block
    stays = clock[left] - clock[reached]
    held = stays > _HELD * np.append(ahead, ahead[-1]) + slack
    slow = across > _SLOW * _USUAL_ACROSS * ahead + slack
    if (
        not held[0] and size.size > 1
    ):  # the record may begin within a swing, and a sinusoid needs a part of it
        part = np.arccos(1.0 - 2.0 * min(1.0, size[0] / max(size[1], least))) / np.pi
        slow[0] |= lasts[0] > _SLOWER * part * ahead[0] + block * step
    return Swings(
        at=at,
        departs=left,
        reached=reached,
        size=size,
        lasts=lasts,
        usual=ahead,
        across=across / _USUAL_ACROSS,
        stay=stays,
        slow=slow,
        held=held,
        least=least,
        sampled=1.0 / np.cos(0.5 * np.pi * min(0.9, block * step / max(float(np.median(lasts)), step))),
        begins_between=bool(clock[at[0]] < _BETWEEN * ahead[0] and not (held[0] or slow[0])),
        begins_late=bool(clock[at[0]] > _LATE * ahead[0]),
    )


def _level(reading: PerSample) -> float:
    """The step of a sensor that often repeats its reading; 0 for other sensors."""
    steps = np.abs(np.diff(reading[:_NOISE_OF]))
    moved = steps[steps > 0.0]
    return float(moved.min()) if moved.size and moved.size < (1.0 - _STEPPED) * steps.size else 0.0


def _without_gaps(time_s: Times) -> Array:
    """The times, without gaps of missing samples: the motion during a gap is unknown."""
    steps = np.diff(time_s)
    usual = float(np.median(steps))
    kept = np.where(steps > 8.0 * usual, usual, steps)
    return np.concatenate([[0.0], np.cumsum(kept)])


def _ranges(values: Array, width: int) -> Array:
    """The range of values near each value, over three blocks of a width."""
    blocks = np.arange(0, values.size, width)
    top, bottom = np.maximum.reduceat(values, blocks), np.minimum.reduceat(values, blocks)
    top = np.max([top, np.append(top[1:], top[-1]), np.append(top[0], top[:-1])], axis=0)
    bottom = np.min([bottom, np.append(bottom[1:], bottom[-1]), np.append(bottom[0], bottom[:-1])], axis=0)
    return np.repeat(top - bottom, width)[: values.size]


def _turns(values: Array, least: Array) -> NDArray[np.intp]:
    """Indices of alternate extremes; the values return from each by more than its threshold."""
    steps = np.flatnonzero(np.diff(values))
    signs = np.sign(np.diff(values)[steps])
    inner = steps[1:][signs[1:] != signs[:-1]]
    places = np.concatenate([[0], inner, [values.size - 1]])
    found: list[int] = []
    rising = 0
    top = bottom = 0
    high = low = float(values[0])
    for place, value, enough in zip(
        places.tolist(), values[places].tolist(), least[places].tolist(), strict=True
    ):
        if value > high:
            top, high = place, value
        if value < low:
            bottom, low = place, value
        if rising >= 0 and high - value > enough:
            found.append(top)
            rising, bottom, low = -1, place, value
        elif rising <= 0 and value - low > enough:
            found.append(bottom)
            rising, top, high = 1, place, value
    if rising:
        found.append(top if rising > 0 else bottom)
    return np.array(found, dtype=np.intp)


def _in_reading(turns: NDArray[np.intp], block: int, means: Array, reading: PerSample) -> NDArray[np.intp]:
    """The first sample of the greatest or the least reading near each extreme of block means."""
    found = []
    for k, turn in enumerate(turns.tolist()):
        first, last = max(0, turn - 1) * block, min(reading.size, (turn + 2) * block)
        beside = turns[k + 1] if k + 1 < turns.size else turns[k - 1]
        near = reading[first:last] if block > 1 else reading[turn : turn + 1]
        first = first if block > 1 else turn
        found.append(first + int(np.argmax(near) if means[turn] > means[beside] else np.argmin(near)))
    return np.maximum.accumulate(np.array(found, dtype=np.intp))


def _ends(
    turns: NDArray[np.intp], means: Array, block: int, least: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The last sample near each extreme, and the first one; "near" is limited by the noise."""
    first, last = int(turns[0]), int(turns[-1])
    swing = np.repeat(np.arange(turns.size - 1), np.diff(turns))
    place = np.arange(first, last)
    start, end = means[turns[:-1]][swing], means[turns[1:]][swing]
    near = np.minimum(np.maximum(_NEAR, least / np.abs(end - start)), _NEAREST)
    done = (means[first:last] - start) / (end - start)
    left = np.maximum.reduceat(np.where(done <= near, place, 0), turns[:-1] - first)
    arrived = np.minimum.reduceat(np.where(done >= 1.0 - near, place, means.size), turns[:-1] - first)
    arrived = np.minimum(arrived, turns[1:])
    # before the first extreme and after the last: as far as the reading stays near
    away = np.flatnonzero(np.abs(means[:first] - means[first]) > near[0] * abs(end[0] - start[0]))
    reached = int(away[-1]) + 1 if away.size else 0
    away = np.flatnonzero(np.abs(means[last:] - means[last]) > near[-1] * abs(end[-1] - start[-1]))
    ended = last + (int(away[0]) - 1 if away.size else means.size - 1 - last)
    lefts = np.append(np.maximum(left, turns[:-1]), ended) * block
    return lefts, np.insert(arrived, 0, reached) * block
