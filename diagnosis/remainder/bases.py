"""Bases of what may be missing: moments of the state, with the wind and in time, and errors of the reading."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from diagnosis.remainder.paths import Path
from tunnel_sim.vocabulary.record import Array

_FINE, _MEDIUM, _COARSE = 33, 15, 7  # splines over the range of the motion
_SLOW = 16  # splines over the time of a run
_PER_CYCLE = 6.0  # splines in time that follow a blow
_SETTLED = 0.02  # of the greatest rate: within it, dry friction may be any moment


class Motion(Protocol):
    """What a basis depends on: `Path` has it, and so has `Places`."""

    @property
    def angle(self) -> Array:
        """rad, shape (n,)."""

    @property
    def rate(self) -> Array:
        """rad/s, shape (n,)."""

    @property
    def time(self) -> Array:
        """s, shape (n,)."""

    @property
    def stiffness(self) -> float:
        """Of the spring, N m/rad."""

    @property
    def speed(self) -> float:
        """Of the wind, m/s."""


@dataclass(frozen=True, eq=False)
class Places:
    """Some places at which a basis is evaluated, as in `Motion`.

    Args:
        angle: rad, shape (n,).
        rate: rad/s, shape (n,).
        time: s, shape (n,).
        stiffness: of the spring, N m/rad.
        speed: of the wind, m/s.
    """

    angle: Array
    rate: Array
    time: Array
    stiffness: float
    speed: float


@dataclass(frozen=True)
class Ranges:
    """What the runs visit.

    Args:
        angle: greatest, rad.
        rate: greatest, rad/s.
        time: latest, s.
        cycle: of the motion, s.
        stiffness: median over the runs, N m/rad.
        speed: greatest wind speed, m/s; 1 where there is no wind.
    """

    angle: float
    rate: float
    time: float
    cycle: float
    stiffness: float
    speed: float


def ranges(runs: Sequence[Path]) -> Ranges:
    """The ranges of some runs.

    Args:
        runs: their paths.
    """
    return Ranges(
        angle=max(float(np.max(np.abs(path.angle))) for path in runs),
        rate=max(float(np.max(np.abs(path.rate))) for path in runs),
        time=max(float(path.time[-1]) for path in runs),
        cycle=float(np.median([2.0 * np.pi / path.omega for path in runs])),
        stiffness=float(np.median([path.stiffness for path in runs])),
        speed=max(max(path.speed for path in runs), 1.0),
    )


def splines(values: Array, low: float, high: float, count: int) -> Array:
    """Cubic B-splines on even knots.

    Args:
        values: shape (n,); those outside the range are taken at its end.
        low: end of the range, in the unit of the values.
        high: other end, in the same unit.
        count: number of splines, 4 or more.

    Returns:
        Shape (n, count).
    """
    inner = np.linspace(low, high, count - 2)
    knots = np.concatenate([[low] * 3, inner, [high] * 3])
    return np.asarray(BSpline.design_matrix(np.clip(values, low, high), knots, 3).toarray())


def _times(one: Array, other: Array) -> Array:
    """All products of two sets of columns."""
    return np.asarray((one[:, :, None] * other[:, None, :]).reshape(one.shape[0], -1))


def _spring(at: Motion, r: Ranges) -> float:
    """How far the run's spring is from the median, a share."""
    return at.stiffness / r.stiffness - 1.0


def _of_angle(at: Motion, r: Ranges, count: int) -> Array:
    return splines(at.angle, -r.angle, r.angle, count)


def _of_rate(at: Motion, r: Ranges, count: int) -> Array:
    return splines(at.rate, -r.rate, r.rate, count)


def _wide(values: Array, reach: float) -> Array:
    """Wide splines, which a law uses before narrow ones: without them the prior would prefer a rough law."""
    found = [splines(values, -reach, reach, count) * (_FINE / count) for count in (_MEDIUM, _COARSE)]
    return np.column_stack(found)


def _rate_shapes(at: Motion, r: Ranges) -> Array:
    u = at.rate / r.rate
    return np.column_stack([u, np.tanh(u / _SETTLED), np.abs(u)])


def angle(at: Motion, r: Ranges) -> Array:
    """Moments of the angle alone, the same for all springs or in proportion to the spring."""
    wide = _wide(at.angle, r.angle)
    return np.column_stack([_of_angle(at, r, _FINE), wide, _spring(at, r) * wide])


def rate(at: Motion, r: Ranges) -> Array:
    """Moments of the rate alone."""
    wide = _wide(at.rate, r.rate)
    return np.column_stack([_of_rate(at, r, _FINE), _rate_shapes(at, r), wide, _spring(at, r) * wide])


def state(at: Motion, r: Ranges) -> Array:
    """Moments of angle and rate."""
    both = [
        _times(_of_angle(at, r, 21), _rate_shapes(at, r)),
        _times(_of_angle(at, r, _COARSE), _of_rate(at, r, _COARSE)),
    ]
    return np.column_stack([angle(at, r), rate(at, r), *both])


def wind(at: Motion, r: Ranges) -> Array:
    """Moments of angle and rate in proportion to the dynamic pressure, or to the wind speed if of the rate."""
    share = at.speed / r.speed
    still = [
        share * _of_angle(at, r, _FINE),
        _times(_of_angle(at, r, _COARSE), _of_rate(at, r, _COARSE)) * share,
        _times(_of_angle(at, r, _COARSE), _rate_shapes(at, r)[:, :1]),
    ]
    return np.column_stack(still) * share


def time(at: Motion, r: Ranges) -> Array:
    """Moments that change in time, alike in all runs: alone, as a stiffness, damping or friction."""
    slow = splines(at.time, 0.0, r.time, _SLOW)
    fine = splines(at.time, 0.0, r.time, max(4, round(_PER_CYCLE * r.time / r.cycle)))
    stiffness = at.angle / r.angle * np.array([[1.0], [_spring(at, r)], [(at.speed / r.speed) ** 2]])
    share = np.column_stack([*stiffness, at.rate / r.rate, _rate_shapes(at, r)[:, 1]])
    return np.column_stack([fine, _times(slow, share)])


def reading(at: Motion, r: Ranges) -> Array:
    """Errors of the reading, as shares of the greatest angle: of angle, rate and time, alike in all runs."""
    slow = splines(at.time, 0.0, r.time, _SLOW)
    columns = [
        _of_angle(at, r, 2 * _FINE),
        _of_rate(at, r, _MEDIUM),
        _times(_of_angle(at, r, _COARSE), _of_rate(at, r, _COARSE)),
        splines(at.time, 0.0, r.time, 4 * _SLOW),
        slow * (at.angle / r.angle)[:, None],
    ]
    return np.column_stack(columns)


def event(at: Motion, r: Ranges) -> Array:
    """Moments that change in time, different in every run."""
    return splines(at.time, float(at.time[0]), float(at.time[-1]),
                   max(4, round(_PER_CYCLE * (at.time[-1] - at.time[0]) / r.cycle)))  # fmt: skip


def between(at: Motion, r: Ranges) -> Array:
    """A steady moment, stiffness and damping of its own in every run."""
    return np.column_stack([np.ones(at.angle.size), at.angle / r.angle, at.rate / r.rate])


def wander(at: Motion, r: Ranges) -> Array:
    """A zero of the reading that wanders or jumps, different in every run: steps, whose sum is a random walk."""
    knots = np.linspace(at.time[0], at.time[-1], max(4, round(_PER_CYCLE * r.time / r.cycle)))[1:-1]
    return np.asarray((at.time[:, None] > knots[None, :]).astype(np.float64))


Basis = Callable[[Motion, Ranges], Array]

#: Kinds whose law holds in every run, so that it predicts a run left out; the simpler first.
COMMON: Mapping[str, Basis] = {
    "angle": angle, "rate": rate, "wind": wind, "state": state, "time": time, "reading": reading,
}  # fmt: skip

#: Kinds that are different in every run, so that only short gaps in it can be predicted.
SINGLE: Mapping[str, Basis] = {"between": between, "wander": wander, "event": event}

#: Kinds that are errors of the reading; the others are moments.
OF_READING = frozenset({"reading", "wander"})
