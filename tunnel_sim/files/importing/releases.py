"""The start and end of runs in a record.

A free decay crosses its centre every half cycle and never grows much from one half cycle to the next. If a
crossing takes longer and the excursions after it are larger than before, a hand has moved or held the body. Any
other record is one run.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.choices import Stretch
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.quantities import Angles, PerSample, Rates, Times

_BAND = 0.05  # of the largest excursion: a smaller one counts as rest
_NOISES = 5.0  # standard deviations: smaller excursions are noise
_NOISE_OF = 200_000  # samples for the estimate of the noise
_CENTRED = 2  # estimates of the centre
_LONGER = 1.8  # usual half cycles: no free motion takes as long from crossing to crossing
_SLOWER = 1.25  # times the way back: a pull at the start of a record takes longer
_GROWN = 1.5  # times the previous excursion: no free decay grows as much within half a cycle
_STILL_GROWING = 1.1  # times the previous excursion: the hand has not let go
_LEAST_HALVES = 6  # half cycles: a shorter motion is not a run
_AT_TURN = 0.005  # of an excursion: the reading stays as near the turning point while the body is held
_HELD = 0.5  # of a half cycle: a free turning point is not that flat for longer


@dataclass(frozen=True)
class RecordPiece:
    """A run in a record: the index of its first sample, and the index after its last one."""

    first: int
    last: int


def find_runs(time_s: Times, reading: PerSample, drift: float = 0.0) -> list[RecordPiece]:
    """The runs of a record: one for each release; the whole record if no hand is detected in it.

    Args:
        drift: greatest drift of its centre, in the unit of the reading.
    """
    whole = [RecordPiece(0, reading.size)]
    noise = max(_noise_of(reading), drift)
    centred = _centred(reading, noise)
    if centred is None:
        return whole
    away, starts, ends = centred
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
    spans: list[tuple[int, int]] = []
    for k in np.flatnonzero(lengths[:-1] > _LONGER * usual).tolist():
        before = peaks[k - 1] if k else 0.0
        if max(peaks[k], peaks[k + 1]) <= _GROWN * before:
            continue
        at = k
        while at + 1 < peaks.size and peaks[at + 1] > _STILL_GROWING * peaks[at]:
            at += 1
        if not spans or at > spans[-1][1]:
            spans.append((k, at))
    if spans and spans[0][0] >= _LEAST_HALVES:  # the record begins in free motion
        spans.insert(0, (0, 0))
    until = [*(k for k, _ in spans), peaks.size][1:]
    spans = [
        (k, at)
        for (k, at), end in zip(spans, until, strict=True)
        if peaks[at:end].max() <= _STILL_GROWING * peaks[at]
    ]
    if not spans:
        return [RecordPiece(0, _without_long_rest(time_s, 0, moved, clear=clear))]
    pieces = []
    for place, (_, released) in enumerate(spans):
        # From the first sample of the largest reading, or from the last one of a hold.
        size = np.abs(away[starts[released] : ends[released]])
        near = int(starts[released]) + np.flatnonzero(size >= (1.0 - _AT_TURN) * size.max())
        held = time_s[near[-1]] - time_s[near[0]] > _HELD * usual
        first = int(near[-1]) if held else int(starts[released]) + int(np.argmax(size))
        if place + 1 < len(spans):
            hand = spans[place + 1][0]
            last = max(int(ends[hand - 1]), int(np.searchsorted(time_s, time_s[starts[hand]] - usual)))
            halves = hand - released
        else:
            last = _without_long_rest(time_s, first, moved, clear=clear)
            halves = peaks.size - released
        if halves >= _LEAST_HALVES:
            pieces.append(RecordPiece(first, last))
    return pieces or whole


def find_runs_of_rate(time_s: Times, rate: Rates) -> list[RecordPiece]:
    """The runs of a record of rates: from the largest rate after each release, which cannot be due to a hand."""
    whole = [RecordPiece(0, rate.size)]
    noise = _noise_of(rate)
    centred = _centred(rate, noise)
    if centred is None:
        return whole
    # A hand shows in the angle: the body is held, or pulled aside for longer than it takes to swing back.
    rate, starts, ends = centred
    angle = _without_drift(
        time_s,
        np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s))]),
        starts,
        ends,
    )
    drift = noise * sqrt(float(time_s[-1] - time_s[0]) * float(np.median(np.diff(time_s))))  # of summed noise
    found = []
    for piece in find_runs(time_s, angle, drift):
        inside = np.flatnonzero((ends > piece.first) & (starts < piece.last))
        peaks = np.array([np.abs(rate[starts[i] : ends[i]]).max() for i in inside])
        if piece.first == 0 or peaks.size < _LEAST_HALVES:
            found.append(piece)
            continue
        later = np.append(np.maximum.accumulate(peaks[::-1])[::-1][1:], 0.0)
        free = int(inside[np.flatnonzero(later <= _STILL_GROWING * peaks)[0]])
        first = int(starts[free]) + int(np.argmax(np.abs(rate[starts[free] : ends[free]])))
        found.append(RecordPiece(first, piece.last))
    return found


def stated_piece(time_s: Times, found: RecordPiece, stated: Stretch, where: str) -> RecordPiece:
    """A run with stated start and end; refused if fewer than two samples are in between."""
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


def _without_drift(time_s: Times, angle: Angles, starts: NDArray[np.intp], ends: NDArray[np.intp]) -> Angles:
    """An angle integrated from rates without the drift due to the sensor's bias.

    The body turns between the excursions of the rate, from their starts to their ends.
    """
    at = (ends[:-1] + starts[1:]) // 2
    if at.size < _LEAST_HALVES:
        return angle
    turns = angle[at]
    # From three consecutive turning points, so that a decay cancels.
    centres, times = 0.25 * (turns[:-2] + 2.0 * turns[1:-1] + turns[2:]), time_s[at[1:-1]]
    half = times.size // 2
    slopes = (centres[half:] - centres[: times.size - half]) / (times[half:] - times[: times.size - half])
    drifted: Angles = angle - float(np.median(slopes)) * time_s
    return drifted


def _noise_of(reading: PerSample) -> float:
    """A bound of the noise, by fourth differences, which hardly contain a swing."""
    some = np.abs(np.diff(reading[:_NOISE_OF], 4))
    return _NOISES * (float(np.median(some)) / (0.6745 * sqrt(70.0))) if some.size else 0.0


def _centred(reading: PerSample, noise: float) -> tuple[PerSample, NDArray[np.intp], NDArray[np.intp]] | None:
    """A reading relative to its centre, and its excursions; None if it has too few."""
    away: PerSample = reading - np.median(reading)
    for _ in range(_CENTRED):
        starts, ends = _excursions(away, noise)
        if starts.size < _LEAST_HALVES:
            return None
        # A hold or a pull shifts the median; most swings have their centre between two turning points.
        swings = (away[a:b] for a, b in zip(starts, ends, strict=True))
        turns = np.array([swing[int(np.argmax(np.abs(swing)))] for swing in swings])
        away = away - np.median(0.5 * (turns[1:] + turns[:-1]))
    starts, ends = _excursions(away, noise)
    return None if starts.size < _LEAST_HALVES else (away, starts, ends)


def _excursions(away: PerSample, noise: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The stretches of one sign outside the band around the centre: first samples, and indices after the last."""
    outside = np.flatnonzero(np.abs(away) > max(_BAND * float(np.abs(away).max()), noise))
    change = np.flatnonzero(np.diff(np.sign(away[outside])) != 0.0)
    if not outside.size:
        return outside, outside
    return outside[np.concatenate([[0], change + 1])], outside[np.concatenate([change, [-1]])] + 1


def _without_long_rest(time_s: Times, first: int, end: int, *, clear: bool) -> int:
    """The end of a record that rests for longer than it moves: as much rest as motion is kept."""
    if not clear:  # the motion continues in the noise
        return time_s.size
    return int(np.searchsorted(time_s, 2.0 * time_s[end - 1] - time_s[first], side="right"))
