"""The start and end of runs in a record.

A run is a free decay: a series of swings, none much larger than the previous one. It begins where a hand has
held or pulled the body, or where a tap has made the swings grow at once. Every candidate is judged by its own
largest swing and by the noise, never by the largest swing of the record. A record without a release is one run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.choices import Stretch
from tunnel_sim.files.importing.free_motion import free_from, free_until
from tunnel_sim.files.importing.swings import Swings, noise_of, swings_of
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.quantities import Angles, PerSample, Rates, Times
from tunnel_sim.vocabulary.record import running_integral

_BAND = 0.05  # share of the largest excursion of a run: a smaller one counts as rest
_NOISES = 5.0  # standard deviations: smaller excursions are noise
_CENTRED = 2  # number of estimates of the centre
_LONGER = 1.8  # usual half cycles: no free motion takes as long from crossing to crossing
_RESTED = 3.0  # usual half cycles: a rest, a hold or a pull, whatever the following swings
_GROWN = 1.5  # multiple of the previous swings: no free decay grows as much within half a cycle
_TAPPED = 2.0  # multiple of the largest previous swing: growth without a pause that is not chance
_BEFORE = 10  # number of swings before a release that are compared with it
_GROWS_FOR = 3  # number of swings: a tap acts no longer
_STILL_GROWING = 1.1  # multiple of the previous swing: the hand has not let go
_LEAST_HALVES = 6  # half cycles: a shorter motion is not a run
_VISIBLE = 2.0  # multiple of the least swing: noise alone does not reach it
_ROUGH = 0.25  # median second difference of the logarithms of swings: a free decay is smoother
_EVEN = 0.05  # the same for a decay that random motion does not imitate
_ODD = 8.0  # multiple of the median of random swings: none is larger
# share of an excursion: the reading stays this close to the turning point while the body is held
_AT_TURN = 0.005
_HELD = 0.5  # share of a half cycle: a free turning point is not as flat for longer
_FALLING = 0.75  # share of swings that are smaller than the previous one: half of random swings
_GOING_ON = 0.3  # share of a swing: the next one would be larger unless the body was stopped
_CUT_SHORT = 0.7  # share of the expected swing: something other than friction has ended the motion
_OVER = 0.3  # share of the expected swing: a different motion follows
_UNSETTLED = 0.2  # share of the swings after a release in which another motion may die out
_LITTLE = 0.3  # share of the first swing: a random moment may make smaller swings grow again
_DIED_OUT = 0.1  # share of the largest swing
_OTHER = 1.5  # ratio of half periods: the motion of something else
_SMALL = 0.2  # share of the swing of the longest run
_BRIEF = 0.5  # share of the duration of the longest run: a knock is shorter


@dataclass(frozen=True)
class RecordPiece:
    """A run in a record: the index of its first sample, and the index after its last one.

    Args:
        doubt: why the piece is left out although the motion decays; empty: it is a run.
        held: time for which a hand held the body after the largest reading, s; these samples are left out.
        stopped: whether the free motion is ended before the record ends.
        again: index of a second release within a run that the file names as one; 0: there is none.
    """

    first: int
    last: int
    doubt: str = ""
    held: float = 0.0
    stopped: bool = False
    again: int = 0


def find_runs(time_s: Times, reading: PerSample, drift: float = 0.0) -> list[RecordPiece]:
    """The runs of a record: one for each release; the whole record if no hand is detected in it.

    Args:
        drift: greatest drift of the centre, in the unit of the reading.
    """
    noise = max(_NOISES * noise_of(reading), drift)
    centred = _centred(reading, noise)
    half, end = 0.0, reading.size
    if centred is not None:
        away, starts, ends = centred
        crossings = 0.5 * (time_s[ends[:-1] - 1] + time_s[starts[1:]])
        half = float(np.median(np.diff(crossings)))
        # dry friction may hold the body off the centre: a last stretch of one sign this long is a rest
        moved = starts[-1] if time_s[ends[-1] - 1] - time_s[starts[-1]] > _LONGER * half else ends[-1]
        if noise <= _BAND * float(np.abs(away).max()):  # else the motion continues in the noise
            end = _without_long_rest(time_s, 0, int(moved))
    swings = swings_of(time_s, reading, half, drift)
    found = [] if swings is None else _judged(_decays(swings), swings, reading)
    if swings is None or not found:
        return [RecordPiece(0, end)]
    if len(found) == 1 and found[0].whole and found[0].stopped(swings) is None:  # nothing acts on the body
        return [RecordPiece(0, end)]
    return [_piece(time_s, reading, swings, *pair) for pair in zip(found, [*found[1:], None], strict=True)]


@dataclass(frozen=True)
class _Decay:
    """A series of swings that decay, by the indices of extremes.

    Args:
        hand: the extreme at which a hand begins to act before the decay.
        start: the extreme of the release.
        count: number of swings that exceed the noise and a share of the largest one.
        until: the extreme at which another motion begins, or the last one.
        doubt: why the decay is not a run; empty: it is a run.
        pushed: whether a push ends the decay, after which the body continues to swing.
    """

    hand: int
    start: int
    count: int
    until: int
    doubt: str = ""
    pushed: bool = False

    @property
    def whole(self) -> bool:
        """Whether no hand acts before the decay."""
        return self.hand < 0

    def stopped(self, swings: Swings) -> int | None:
        """The last extreme before the motion is ended while still swinging; None if it dies out."""
        size, until = swings.size, self.until
        usual = float(np.median(swings.usual[self.start : self.start + self.count]))
        rests = swings.stay[until] > _RESTED * usual
        # The last swing of a record that ends in motion is not whole.
        shown = size[self.start : until] if until < size.size or rests else size[self.start : -1]
        sizes = np.append(shown, [0.0] if until < size.size or rests else [])
        # if nothing follows, a motion that has almost died out may rest
        least = _DIED_OUT * float(shown.max()) if until >= size.size else 0.0
        for k in range(max(2, self.count - 2), sizes.size):
            expected = 2.0 * sizes[k - 1] - sizes[k - 2]
            if sizes[k - 1] <= max(_VISIBLE * swings.least, least):
                break
            if self.start + k == until < size.size and not rests and size[until] < _GROWN * expected:
                sizes[k] = size[until]  # another motion was seen there, and the motion goes on
            ends_here = (
                sizes[k] < _CUT_SHORT * expected and sizes[k + 1 : k + 4].max(initial=0.0) < _OVER * expected
            )
            if ends_here and expected > _GOING_ON * sizes[k - 1]:
                return self.start + k
        return None

    def lasts(self, swings: Swings) -> float:
        """Duration of the visible swings, s."""
        return float(swings.lasts[self.start : self.start + self.count].sum())


def _decays(swings: Swings) -> list[_Decay]:
    """Every series of decaying swings, in their order."""
    size, count = swings.size, swings.size.size
    breaks: list[tuple[int, int]] = []
    since, k = 0, 0
    while k < count:
        released = _release_at(swings, k, since)
        if released is None:
            k += 1
            continue
        breaks.append((k - 1 if k - 1 > since and swings.slow[k - 1] else k, released))
        since = released
        k = released + 1
    if not breaks or breaks[0][0] > 0:
        breaks.insert(0, (0, 0) if swings.begins_late else (-1, 0))
    found = []
    for (hand, start), until in zip(breaks, [*(k for k, _ in breaks[1:]), count], strict=True):
        if hand >= 0:
            start += _settled(swings, start, until)
        sizes = size[start:until]
        if not sizes.size:
            continue
        still = np.flatnonzero(sizes <= max(_BAND * float(sizes.max()), swings.least))
        moving = int(still[0]) if still.size else sizes.size
        followed = until < count
        push = _pushed(sizes[:moving], swings) if hand >= 0 else 0
        if push:
            sizes, moving, until, followed = sizes[:push], push, start + push, True
        if moving >= _LEAST_HALVES and _is_decay(sizes[:moving], sizes, swings, start, followed=followed):
            found.append(_Decay(hand, start, moving, until, pushed=push > 0))
    return found


def _pushed(sizes: PerSample, swings: Swings) -> int:
    """The first swing that a push enlarges within an even decay; 0 if there is none.

    Slowly growing swings belong to a second mode, and randomly varying swings to the wind.
    """
    smallest = np.minimum.accumulate(sizes)
    grown = sizes > np.maximum(_GROWN * swings.sampled * smallest, smallest + swings.least)
    for k in np.flatnonzero(grown & (sizes > _LITTLE * sizes[0])):
        before = int(np.argmin(sizes[:k]))
        return before + 1 if k - before <= _GROWS_FOR and _is_even(sizes[:before]) else 0
    return 0


def _settled(swings: Swings, start: int, until: int) -> int:
    """The number of swings until another motion, on top of a longer one, has died out."""
    sizes, slow = swings.size[start:until], swings.slow[start:until]
    later = np.maximum.accumulate(sizes[::-1])[::-1]
    even = np.flatnonzero((later[1:] <= _STILL_GROWING * swings.sampled * sizes[:-1]) & ~slow[:-1])
    first = int(even[0]) if even.size else 0
    grown = first == 0 or sizes[first] > sizes[:first].max()
    return 0 if grown or first > _UNSETTLED * sizes.size else first


def _release_at(swings: Swings, k: int, since: int) -> int | None:
    """The extreme of a release, if a motion other than a free one acts at an extreme; None if not.

    Args:
        since: the extreme of the previous release.
    """
    size, stay, usual = swings.size, swings.stay, swings.usual
    pulled = swings.across[k - 1] / usual[k - 1] if k > since else 0.0
    paused = bool(swings.held[k]) or (k > since and bool(swings.slow[k - 1]))
    rested = stay[k] > _RESTED * usual[k] or pulled > _RESTED or (k == 1 and bool(swings.slow[0]))
    begins = swings.begins_between and since == 0  # the first swing is incomplete
    earlier = size[max(since, k - _BEFORE) : k].max(initial=0.0)
    latest = size[max(since, k - 2) : k].max(initial=0.0)
    if begins and k <= 2:
        earlier = latest = max(earlier, size[: k + 1].max())
    at, most = k, size.size if paused or rested else k + _GROWS_FOR
    while at + 1 < min(size.size, most) and size[at + 1] > _STILL_GROWING * swings.sampled * size[at]:
        at += 1
    # random motion pauses by chance; a decaying swing does not
    if k and size[at] <= _TAPPED * _random_before(swings, k):
        return None
    if rested or (paused and size[at] > _GROWN * earlier):
        return at
    long = k > since and bool(swings.slow[k - 1] or swings.lasts[k - 1] > _LONGER * usual[k - 1])
    if long and at == k and _is_even(size[max(since, k - _BEFORE) : k - 1]):
        return at
    after = size[at + 1 : at + 3]
    tapped = k > since and size[k] > _GROWN * swings.sampled * latest and size[at] > _TAPPED * earlier
    return at if tapped and after.size == 2 and after.min() > size[at] / _TAPPED else None


def _random_before(swings: Swings, k: int) -> float:
    """The largest swing before an extreme if these swings vary at random; 0 if they decay, or a hand acts."""
    part = slice(max(0, k - _BEFORE), k)
    sizes = swings.size[part][~swings.slow[part]]
    if sizes.size < _LEAST_HALVES or _bend(sizes) <= _ROUGH or np.mean(np.diff(sizes) < 0.0) >= _FALLING:
        return 0.0
    return float(min(sizes.max(), _ODD * np.median(sizes)))  # a single larger one is a pull


def _is_even(sizes: PerSample) -> bool:
    """Whether swings decay so evenly that a single slow swing, however short, is a pull."""
    falling = float(np.mean(np.diff(sizes) < 0.0)) if sizes.size > 1 else 0.0
    return sizes.size >= _LEAST_HALVES and _bend(sizes) <= _EVEN and falling >= _FALLING


def _bend(sizes: PerSample) -> float:
    """The median second difference of the logarithms of successive swings: 0 for an exponential decay."""
    return float(np.median(np.abs(np.diff(np.log(np.maximum(sizes, 1e-300)), 2))))


def _is_decay(moving: PerSample, sizes: PerSample, swings: Swings, start: int, *, followed: bool) -> bool:
    """Whether swings decay evenly, and no later swing is larger than the first one, or grows much again.

    Args:
        followed: whether another release follows. A single large swing may then be the pull towards it.
    """
    first = max(moving[:2]) if start == 0 else moving[0]
    large = sizes > _LITTLE * first
    smallest = np.minimum.accumulate(sizes)
    regrown = large & (sizes > np.maximum(_GROWN * swings.sampled * smallest, smallest + swings.least))
    if followed:
        regrown[:-1] &= large[1:]
        regrown[-1] = False
    return bool(
        sizes.max() <= _STILL_GROWING * swings.sampled * first
        and first > _VISIBLE * swings.least
        and (start == 0 or not regrown.any())
        and _bend(moving) <= _ROUGH + swings.least / max(float(np.median(moving)), swings.least)
    )


def _piece(
    time_s: Times, reading: PerSample, swings: Swings, decay: _Decay, following: _Decay | None
) -> RecordPiece:
    """The samples of a decay, from the release until another moment acts, the body rests, or the record ends."""
    noise, usual = noise_of(reading), float(np.median(swings.usual[decay.start : decay.start + decay.count]))
    turns = swings.at[decay.start : decay.start + decay.count + 1]
    first, held = 0, 0.0
    if not decay.whole:
        # from the first sample of the largest reading, or from the last sample of a hold
        turn, size = int(turns[0]), 0.5 * float(swings.size[decay.start])
        part = slice(int(swings.reached[decay.start]), int(swings.departs[decay.start]) + 1)
        most = max(_AT_TURN * size, swings.least)
        near = part.start + np.flatnonzero(np.abs(reading[part] - reading[turn]) <= most)
        still = near.size and time_s[near[-1]] - time_s[near[0]] > _HELD * usual
        first = max(turn, int(near[-1])) if still else turn
        free = free_from(time_s, reading, first, turns[1:], noise)
        first, held = free, float(time_s[free] - time_s[first])
    moved = int(turns[-1])
    if decay.pushed:
        last = free_until(time_s, reading, moved + 1, turns[1:-1], noise)
        return RecordPiece(first, last, decay.doubt, held, stopped=True)
    if (stop := decay.stopped(swings)) is not None:
        last = int(swings.reached[min(stop + 1, swings.at.size - 1)]) + 1
        before = swings.at[decay.start + 1 : stop + 1]
        last = free_until(time_s, reading, max(last, int(before[-1]) + 1), before, noise)
        return RecordPiece(first, last, decay.doubt, held, stopped=following is None)
    last = reading.size
    if noise * _NOISES <= _BAND * 0.5 * swings.size[decay.start]:  # else the motion continues in the noise
        last = _without_long_rest(time_s, first, moved + 1)
    if following is not None:
        # the hand acts from the first extreme at which it moves the body noticeably
        after = slice(decay.until, following.start + 1)
        acts = np.flatnonzero(swings.size[after] > _BAND * swings.size[following.start])
        at = int(swings.departs[decay.until + int(acts[0])])
        last = min(last, max(moved + 1, int(np.searchsorted(time_s, time_s[at] - usual))))
        if decay.start + decay.count >= decay.until - 1:  # it still swings when the hand acts
            last = free_until(time_s, reading, last, swings.at[decay.start + 1 : decay.until], noise)
    return RecordPiece(first, last, decay.doubt, held)


def _judged(decays: Sequence[_Decay], swings: Swings, reading: PerSample) -> list[_Decay]:
    """The decays that are runs; with a doubt also the motion of something else.

    A brief motion is not a run if its frequency differs from the longest one's. Neither is a small motion off
    the centre of the longest one, just before a release: a hand holds the body there.
    """
    if len(decays) < 2:
        return list(decays)
    lasts = np.array([decay.lasts(swings) for decay in decays])
    halves = lasts / [decay.count for decay in decays]
    sizes = np.array([swings.size[decay.start] for decay in decays])
    at = [reading[swings.at[decay.start : decay.start + decay.count + 1]] for decay in decays]
    centres = np.array([float(np.median(0.5 * (turns[1:] + turns[:-1]))) for turns in at])
    most = int(np.argmax(lasts))
    brief = lasts < _BRIEF * lasts[most]
    other = (halves > _OTHER * halves[most]) | (halves < halves[most] / _OTHER)
    small = sizes < _SMALL * sizes[most]
    following = np.append([decays[k + 1].hand <= decays[k].until for k in range(len(decays) - 1)], [False])
    beside = (np.abs(centres - centres[most]) > sizes) & following
    judged = []
    for k, decay in enumerate(decays):
        if brief[k] and small[k] and (beside[k] or other[k]):
            continue
        if brief[k] and other[k]:
            own, usual = 0.5 / halves[k], 0.5 / halves[most]
            what = f"it swings at {own:.3g} Hz for {lasts[k]:.3g} s, and the longest run at {usual:.3g} Hz"
            decay = replace(decay, doubt=what)
        judged.append(decay)
    return judged


def find_runs_of_rate(time_s: Times, rate: Rates) -> list[RecordPiece]:
    """The runs of a record of rates: from the largest rate after each release, which cannot be due to a hand."""
    whole = [RecordPiece(0, rate.size)]
    noise = _NOISES * noise_of(rate)
    centred = _centred(rate, noise)
    if centred is None:
        return whole
    # a hand shows in the angle: the body is held, or pulled aside for longer than it takes to swing back
    rate, starts, ends = centred
    angle = _without_drift(time_s, running_integral(rate, time_s), starts, ends)
    drift = noise * sqrt(float(time_s[-1] - time_s[0]) * float(np.median(np.diff(time_s))))  # of summed noise
    found = []
    for piece in find_runs(time_s, angle, drift):
        let_go = (
            piece.first if piece.first == 0 else _let_go(angle, piece, max(_NOISES * noise_of(angle), drift))
        )
        inside = np.flatnonzero((ends > let_go) & (starts < piece.last))
        peaks = np.array([np.abs(rate[starts[i] : ends[i]]).max() for i in inside])
        if piece.first == 0 or peaks.size < _LEAST_HALVES:
            found.append(piece)
            continue
        later = np.append(np.maximum.accumulate(peaks[::-1])[::-1][1:], 0.0)
        free = int(inside[np.flatnonzero(later <= _STILL_GROWING * peaks)[0]])
        first = int(starts[free]) + int(np.argmax(np.abs(rate[starts[free] : ends[free]])))
        found.append(replace(piece, first=first, held=0.0))
    return found


def _let_go(angle: Angles, piece: RecordPiece, noise: float) -> int:
    """The first largest angle after which the excursions no longer grow."""
    centred = _centred(angle[: piece.last], noise)
    if centred is None:
        return piece.first
    away, starts, ends = centred
    tops = [int(a) + int(np.argmax(np.abs(away[a:b]))) for a, b in zip(starts, ends, strict=True)]
    tops = [top for top, end in zip(tops, ends, strict=True) if end > piece.first]
    growing = (abs(away[after]) > _STILL_GROWING * abs(away[top]) for top, after in pairwise(tops))
    free = next((k for k, grows in enumerate(growing) if not grows), 0)
    return max(piece.first, tops[free]) if tops else piece.first


def with_added(
    time_s: Times, found: Mapping[str, RecordPiece], stated: Sequence[Stretch]
) -> dict[str, RecordPiece]:
    """The runs of a record by name, with the user's additions; an added release ends the previous run.

    Args:
        stated: the added runs, with their start, s.
    """
    pieces = dict(found)
    for one in stated:
        start = time_s[0] if one.start is None else one.start
        first = int(np.searchsorted(time_s, start - _slack(time_s)))
        last = min((piece.first for piece in pieces.values() if piece.first > first), default=time_s.size)
        for name, piece in pieces.items():
            if piece.first < first < piece.last:
                pieces[name] = replace(piece, last=first, stopped=False)
        pieces[one.run] = RecordPiece(min(first, last - 1), last)
    return dict(sorted(pieces.items(), key=lambda item: item[1].first))


def stated_piece(time_s: Times, found: RecordPiece, stated: Stretch, where: str) -> RecordPiece:
    """A run with stated start and end; refused if it contains fewer than two samples."""
    if stated.start is None and stated.end is None:
        return found
    start = time_s[found.first] if stated.start is None else stated.start
    end = time_s[found.last - 1] if stated.end is None else stated.end
    slack = _slack(time_s)
    first, last = (int(place) for place in np.searchsorted(time_s, [start - slack, end + slack]))
    if last - first < 2:
        remedy = "state a start before the end, within the record"
        raise TunnelError(f"no samples from {start:g} to {end:g} s", where=where, remedy=remedy)
    return RecordPiece(first, last)


def _slack(time_s: Times) -> float:
    """Half a step, s: a marker between two samples belongs to the closer one."""
    return 0.5 * float(np.median(np.diff(time_s)))


def _without_drift(time_s: Times, angle: Angles, starts: NDArray[np.intp], ends: NDArray[np.intp]) -> Angles:
    """An angle integrated from rates without the drift due to the sensor's bias.

    The body turns between the excursions of the rate, from their starts to their ends.
    """
    at = (ends[:-1] + starts[1:]) // 2
    if at.size < _LEAST_HALVES:
        return angle
    turns = angle[at]
    # from three consecutive turning points, so that a decay cancels
    centres, times = 0.25 * (turns[:-2] + 2.0 * turns[1:-1] + turns[2:]), time_s[at[1:-1]]
    half = times.size // 2
    slopes = (centres[half:] - centres[: times.size - half]) / (times[half:] - times[: times.size - half])
    drifted: Angles = angle - float(np.median(slopes)) * time_s
    return drifted


def _centred(reading: PerSample, noise: float) -> tuple[PerSample, NDArray[np.intp], NDArray[np.intp]] | None:
    """A reading relative to its centre, and its excursions; None if it has too few."""
    away: PerSample = reading - np.median(reading)
    for _ in range(_CENTRED):
        starts, ends = _excursions(away, noise)
        if starts.size < _LEAST_HALVES:
            return None
        # a hold or a pull shifts the median; most swings have their centre between two turning points
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


def _without_long_rest(time_s: Times, first: int, end: int) -> int:
    """The end of a record that rests for longer than it moves: as much rest as motion is kept."""
    return int(np.searchsorted(time_s, 2.0 * time_s[end - 1] - time_s[first], side="right"))
