"""Where the motion near a release is free: from where on the nominal model, a free decay about a centre, holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.quantities import PerSample, Times
from tunnel_sim.vocabulary.record import Array

_HALVES = 7  # number of half cycles to which the model is fitted
_LEAST = 5  # minimum number of extremes
_SAMPLES = 300
_STEPS = 12
_MOST = 300.0  # exponent: a model that grows further is not extended
_SETTLED = 1e-9
_NOISES = 6.0  # maximum deviation of a sample of a free motion, in standard deviations
_ERRORS = 3.0  # multiple of the error half a cycle later: a nonlinearity grows with the swing
_CLEARLY = 2.0  # multiple of that error: below it nothing is left out
_OF_SWING = 0.01  # share of the amplitude: slight nonlinearities change a half cycle by less


def free_from(time_s: Times, reading: PerSample, first: int, turns: NDArray[np.intp], noise: float) -> int:
    """The first sample from which on the motion is free; ``first`` itself, or later.

    A free decay is fitted to the half cycles after the first extreme that is certainly free, and extended back.

    Args:
        turns: indices of the extremes after ``first``, starting with the first extreme that is certainly free;
            at least four.
        noise: standard deviation of the reading's noise.
    """
    turns = turns[: _HALVES + 1]
    if turns.size <= _LEAST:
        return first
    return _from(time_s, reading, first, turns, noise)


def free_until(time_s: Times, reading: PerSample, last: int, turns: NDArray[np.intp], noise: float) -> int:
    """The index after the last sample of a free motion that is then disturbed; ``last`` itself, or earlier.

    Args:
        turns: indices of the extremes before ``last``, the latest one last; at least four.
    """
    end = reading.size - 1
    mirrored = (end - turns)[::-1][: _HALVES + 1]
    if mirrored.size <= _LEAST:
        return last
    return reading.size - _from(-time_s[::-1], reading[::-1], reading.size - last, mirrored, noise)


def _from(time: Times, reading: PerSample, first: int, turns: NDArray[np.intp], noise: float) -> int:
    """The first sample of a free motion: the model extended back is as far off as one half cycle later, or less."""
    away = _away(time, reading, first, turns[:-1])
    later = _away(time, reading, int(turns[0]), turns[1:])
    if away is None or later is None:
        return first
    swing = 0.5 * float(np.ptp(reading[turns[:2]]))
    error = float(np.abs(later).max(initial=0.0))
    most = max(_NOISES * noise, _ERRORS * error, _OF_SWING * swing)
    if np.abs(away).max(initial=0.0) <= _CLEARLY * most:
        return first
    return first + int(np.flatnonzero(np.abs(away) > most)[-1]) + 1


def _away(time: Times, reading: PerSample, first: int, turns: NDArray[np.intp]) -> PerSample | None:
    """Readings before some turning points less the free decay fitted between these points."""
    a, b = int(turns[0]), int(turns[-1]) + 1
    stride = max(1, (b - a) // _SAMPLES)
    halves_per_s = (turns.size - 1) / float(time[b - 1] - time[a])
    decay = _fitted(time[a:b:stride] - time[a], reading[a:b:stride], halves_per_s)
    if decay is None:
        return None
    rates, state = decay
    return reading[first:a] - np.asarray(_rows(time[first:a] - time[a], rates) @ state)


def _fitted(time: Array, values: Array, halves_per_s: float) -> tuple[Array, Array] | None:
    """A free decay about a centre, by least squares: its rates and its state; None where it does not converge."""
    rates = np.array([0.0, np.pi * halves_per_s])  # decay rate and angular frequency
    for _ in range(_STEPS):
        rows = _rows(time, rates)
        if not np.isfinite(rows).all():
            return None
        state = np.linalg.lstsq(rows, values, rcond=None)[0]
        motion = rows[:, 1:] @ state[1:]
        turned = rows[:, 1] * state[2] - rows[:, 2] * state[1]
        tangent = np.column_stack([rows, -time * motion, time * turned])
        step = np.linalg.lstsq(tangent, values - rows @ state, rcond=None)[0][3:]
        if not np.isfinite(step).all() or np.abs(step).max() > 0.5 * rates[1]:
            return None
        rates = rates + step
        if np.abs(step).max() <= _SETTLED * rates[1]:
            break
    rows = _rows(time, rates)
    if not np.isfinite(rows).all():
        return None
    return rates, np.asarray(np.linalg.lstsq(rows, values, rcond=None)[0])


def _rows(time: Array, rates: Array) -> Array:
    with np.errstate(over="ignore"):
        fading = np.exp(np.minimum(-rates[0] * time, _MOST))
    return np.column_stack(
        [np.ones_like(time), fading * np.cos(rates[1] * time), fading * np.sin(rates[1] * time)]
    )
