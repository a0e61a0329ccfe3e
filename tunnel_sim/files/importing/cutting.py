"""Where runs begin and end in a record: the releases, and the rest after the motion.

A free decay crosses its centre every half cycle and never grows much from one half cycle to the next. Where a
crossing takes longer and the excursions after it are larger than before, a hand has moved the body or held it, and
a run begins at the turning point before the free motion. Any other record is one run: motion that grows or does not
decay is left whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.choices import Stretch
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

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
class Piece:
    """A run in a record.

    Args:
        first: index of its first sample.
        last: index behind its last sample.
    """

    first: int
    last: int


def find_runs(time_s: Array, reading: Array) -> list[Piece]:
    """The runs of a record.

    Args:
        time_s: increasing, shape (n,), s.
        reading: shape (n,).

    Returns:
        One piece for each release; the whole record where no hand is seen in it.
    """
    whole = [Piece(0, reading.size)]
    away = reading - np.median(reading)
    noise = _NOISES * _noise(reading[:_NOISE_OF])
    for _ in range(_CENTRED):
        starts, ends = _excursions(away, noise)
        if starts.size < _LEAST_HALVES:
            return whole
        # A hold or a pull draws the median aside; most swings have their centre between two turning points.
        turns = np.array(
            [away[a + int(np.argmax(np.abs(away[a:b])))] for a, b in zip(starts, ends, strict=True)]
        )
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
    found = _released(lengths, peaks, usual)
    if not found:
        return [Piece(0, _without_long_rest(time_s, 0, moved, clear=clear))]
    pieces = []
    for place, (_, released) in enumerate(found):
        first = _turning_point(time_s, away, starts[released], ends[released], usual)
        if place + 1 < len(found):
            hand = found[place + 1][0]
            last = max(int(ends[hand - 1]), int(np.searchsorted(time_s, time_s[starts[hand]] - usual)))
            halves = hand - released
        else:
            last, halves = (
                _without_long_rest(time_s, first, moved, clear=clear),
                peaks.size - released,
            )
        if halves >= _LEAST_HALVES:
            pieces.append(Piece(first, last))
    return pieces or whole


def stated_piece(time_s: Array, found: Piece, stated: Stretch, where: str) -> Piece:
    """A run with the start and the end that are stated.

    Args:
        time_s: of the record, shape (n,), s.
        found: the run as it was found.
        stated: what is stated about it.
        where: file and run, for messages.

    Raises:
        TunnelError: when fewer than two samples lie between start and end.
    """
    if stated.start is None and stated.end is None:
        return found
    start = time_s[found.first] if stated.start is None else stated.start
    end = time_s[found.last - 1] if stated.end is None else stated.end
    # Half a step of slack: a marker between two samples belongs to the closer one.
    slack = 0.5 * float(np.median(np.diff(time_s)))
    first, last = (int(place) for place in np.searchsorted(time_s, [start - slack, end + slack]))
    if last - first < 2:
        raise TunnelError(
            f"no samples from {start:g} to {end:g} s",
            where=where,
            remedy="state a start before the end, within the record",
        )
    return Piece(first, last)


def _noise(reading: Array) -> float:
    """Standard deviation of white noise, by fourth differences, in which a swing hardly shows."""
    return float(np.median(np.abs(np.diff(reading, 4)))) / (0.6745 * sqrt(70.0)) if reading.size > 4 else 0.0


def _excursions(away: Array, noise: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The stretches of one sign outside the band around the centre: first samples, and those behind the last."""
    outside = np.flatnonzero(np.abs(away) > max(_BAND * float(np.abs(away).max()), noise))
    change = np.flatnonzero(np.diff(np.sign(away[outside])) != 0.0)
    if not outside.size:
        return outside, outside
    return outside[np.concatenate([[0], change + 1])], outside[np.concatenate([change, [-1]])] + 1


def _released(lengths: Array, peaks: Array, usual: float) -> list[tuple[int, int]]:
    """The excursions in which a hand moves the body, each with the one from which on the motion is free."""
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
    ends = [*(k for k, _ in found), peaks.size][1:]
    return [
        (k, at)
        for (k, at), end in zip(found, ends, strict=True)
        if peaks[at:end].max() <= _STILL_GROWING * peaks[at]
    ]


def _turning_point(time_s: Array, away: Array, start: int, end: int, usual: float) -> int:
    """The first sample of the largest reading, or the last one of a hold."""
    size = np.abs(away[start:end])
    near = start + np.flatnonzero(size >= (1.0 - _AT_TURN) * size.max())
    first, last = int(start) + int(np.argmax(size)), int(near[-1])
    return last if time_s[last] - time_s[near[0]] > _HELD * usual else first


def _without_long_rest(time_s: Array, first: int, end: int, *, clear: bool) -> int:
    """Where a record ends that rests for longer than it moves: as much rest as motion is kept."""
    if not clear:  # the motion goes on in the noise
        return time_s.size
    return int(np.searchsorted(time_s, 2.0 * time_s[end - 1] - time_s[first], side="right"))
