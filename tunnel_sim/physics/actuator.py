"""An actuator between the stated input and the body: its greatest moment, its greatest rate of change, its lag.

They act in this order: a clipped command changes at a limited rate, and the moment follows it with a lag. The
moment therefore obeys both limits for any lag. Before the first sample the input has been constant for long.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tunnel_sim.vocabulary.quantities import PerSample, Times
from tunnel_sim.vocabulary.record import Array

# duration of a jump, as a share of an interval: the integrator cannot separate a shorter part from rounding
_JUMP = 1e-8
_ULPS = 8.0  # minimum duration in units of a time's last digit: times still increase in other units
_EVEN = 1e-9  # share of an interval: a smaller departure from even samples is rounding
_SERIES = 0.01  # interval over time constant below which a series is more accurate
_FIRST_LOOK = 32  # number of intervals of the first search for the end of a ramp
# change of an input over the greatest moment, or over itself, for which a soft limit is nearly a line
_BENT = 0.03
_BEYOND = 1e6  # multiple of the greatest moment at which a soft limit is reached to one part in a million


@dataclass(frozen=True, eq=False)
class InputSamples:
    """An input at increasing times: constant from each to the next, or linear between them.

    Args:
        values: in one unit throughout.
    """

    time_s: Times
    values: PerSample
    held: bool

    @property
    def after(self) -> Array:
        """The value just after the start of every interval, shape (n − 1,)."""
        return self.values[:-1]

    @property
    def before(self) -> Array:
        """The value just before the end of every interval, shape (n − 1,)."""
        return self.values[:-1] if self.held else self.values[1:]

    def clipped(self, limit: float) -> Self:
        """The input limited to ±``limit``, in the unit of the values; exact for both holds."""
        if not np.max(np.abs(self.values)) > limit:
            return self
        time, values = self.time_s, self.values
        if not self.held:  # the clipped line has a kink wherever it crosses a limit
            places = []
            for level in (-limit, limit):
                over = values > level
                at = np.flatnonzero(over[1:] != over[:-1])
                share = (level - values[at]) / (values[at + 1] - values[at])
                places.append(time[at] + share * (time[at + 1] - time[at]))
            kinks = np.setdiff1d(np.concatenate(places), time)
            both = np.concatenate([time, kinks])
            order = np.argsort(both, kind="stable")
            time, values = both[order], np.interp(both, time, values)[order]
        return type(self)(time, np.clip(values, -limit, limit), self.held)

    def saturated(self, limit: float, softness: float) -> Self:
        """The input v limited softly: v / (1 + |v/L|^(1/s))^s, which approaches ±L (Rapp 1991).

        Exact for a held input. A linear input is followed at points between which it changes by at most `_BENT`
        of the limit, or of itself beyond the limit.

        Args:
            limit: limit L, above 0, in the unit of the values.
            softness: s, dimensionless; at 0 it is `clipped`, and near 0.4 a hyperbolic tangent.
        """
        if softness == 0.0:
            return self.clipped(limit)
        time, values = self.time_s, self.values
        if not self.held and time.size > 1:
            place = _stretched(values / limit)
            count = np.ceil(np.abs(np.diff(place)) / _BENT).astype(np.intp).clip(1)
            at = np.repeat(np.arange(count.size), count)
            part = (np.arange(at.size) - np.repeat(np.cumsum(count) - count, count)) / count[at]
            change = np.diff(values)[at]
            moved = limit * _compressed(place[at] + part * np.diff(place)[at]) - values[at]
            inside = (part > 0.0) & (change != 0.0)
            part = np.where(inside, np.clip(moved / np.where(inside, change, 1.0), 0.0, 1.0), 0.0)
            time = np.append(time[at] + part * np.diff(time)[at], time[-1])
            values = np.append(values[at] + part * change, values[-1])
            new = np.append(True, np.diff(time) > 0.0)
            time, values = time[new], values[new]
        size = np.abs(values) / limit
        less = np.minimum(size, 1.0 / np.maximum(size, 1.0))  # neither power overflows
        with np.errstate(under="ignore"):
            bent = np.minimum(size, 1.0) * (1.0 + less ** (1.0 / softness)) ** -softness
        return type(self)(time, np.copysign(limit * bent, values), self.held)

    def at_rate(self, rate: float) -> Self:
        """The input followed at a limited rate, in the unit per s; exact for both holds."""
        time, width = self.time_s, np.diff(self.time_s)
        jump = np.diff(self.values)
        if self.held:
            jump = np.append(0.0, jump[:-1])  # at the start of the interval
        if not np.any(np.abs(jump) > (0.0 if self.held else rate * width)):
            return self
        ramps = _Ramps(self, rate)
        steep = np.flatnonzero(np.abs(jump) > rate * width)
        # intervals at the end of which the input is reached without a ramp
        free = np.ones(width.size, np.bool_)
        at = 0
        while at < steep.size:
            end = ramps.follow(int(steep[at]), float(self.after[steep[at] - self.held]))
            free[steep[at] : end] = False
            at = int(np.searchsorted(steep, end))
        nodes = [time[:1], time[1:][free], *ramps.time]
        values = [self.values[:1], self.before[free], *ramps.values]
        if self.held:  # the start of every ramp that ends within its interval, and its end
            short = free & (jump != 0.0)
            lasting = np.maximum(np.abs(jump[short]) / rate, _shortest(time[:-1][short], width[short]))
            nodes += [time[:-1][short] + lasting]
            values += [self.values[:-1][short]]
        both, given = np.concatenate(nodes), np.concatenate(values)
        both, first = np.unique(both, return_index=True)
        return type(self)(both, given[first], False)

    def lagged(self, lag: float) -> Self:
        """The input followed with a first-order lag.

        In every interval the response is a line and an exponential; the exponential is replaced by a line of equal
        impulse and first moment.

        Args:
            lag: time constant, s.
        """
        if lag == 0.0 or self.time_s.size < 2:
            return self
        width = np.diff(self.time_s)
        slope = (self.before - self.after) / width
        even = np.ptp(width) <= _EVEN * width[0]
        ratio = (np.mean(width, keepdims=True) if even else width) / lag
        left, missed = np.exp(-ratio), -np.expm1(-ratio)
        line = self.after - slope * lag  # asymptote of the response, at the interval's start
        added = np.concatenate([self.values[:1], line * missed + slope * width])
        state = recurrence(left[0] if even else np.append(0.0, left), added)
        departure = state[:-1] - line
        mean, tilt = missed / ratio, _tilt(ratio, left, missed)
        begun = line + departure * (mean - 0.5 * tilt)
        ended = line + slope * width + departure * (mean + 0.5 * tilt)
        end = self.time_s[1:] - _shortest(self.time_s[1:], width)
        time = np.stack([self.time_s[:-1], end], axis=1).ravel()
        values = np.stack([begun, ended], axis=1).ravel()
        return type(self)(np.append(time, self.time_s[-1]), np.append(values, state[-1]), False)


class _Ramps:
    """The stretches in which an input is followed at the greatest rate, as nodes with lines in between."""

    def __init__(self, given: InputSamples, rate: float) -> None:
        self.given, self.rate = given, rate
        self.time: list[Array] = []
        self.values: list[Array] = []

    def _node(self, time: float, value: float) -> None:
        self.time.append(np.array([time]))
        self.values.append(np.array([value]))

    def follow(self, first: int, value: float) -> int:
        """Follow the input from the start of an interval until it is reached at an interval's end.

        Args:
            first: the interval.
            value: value reached before it.

        Returns:
            The first interval with the input reached at its start.
        """
        given, time = self.given, self.given.time_s
        at, look = first, _FIRST_LOOK
        while at < time.size - 1:
            some = slice(at, min(at + look, time.size - 1))
            ahead = given.after[at] - value or given.before[at] - value
            way = float(np.sign(ahead)) * self.rate
            ramp = value + way * (time[some.start : some.stop + 1] - time[at])
            reached = way * (given.before[some] - ramp[1:]) <= 0.0
            passed = way * (given.after[some] - ramp[:-1]) < 0.0  # the input has jumped across
            passed[0] = False
            found = np.flatnonzero(reached | passed)
            if not found.size:
                at, value, look = some.stop, float(ramp[-1]), 2 * look
                self._node(float(time[at]), value)
                continue
            step = int(found[0])
            at, value, look = at + step, float(ramp[step]), _FIRST_LOOK
            if passed[step]:
                self._node(float(time[at]), value)
                continue
            width = float(time[at + 1] - time[at])
            slope = float(given.before[at] - given.after[at]) / width
            gap = float(given.after[at]) - value
            since = min(max(gap / (way - slope), 0.0), width) if gap else 0.0
            value += way * since
            self._node(float(time[at]) + since, value)
            if abs(slope) <= self.rate:
                if since < width:
                    self._node(float(time[at + 1]), float(given.before[at]))
                return at + 1
            value -= way * (width - since)  # the input moves away in the opposite direction
            at += 1
            self._node(float(time[at]), value)
        return at


@dataclass(frozen=True)
class ActuatorLimits:
    """The limits of an actuator on the demanded moment.

    Args:
        limit: greatest moment, N m; 0: none.
        rate: greatest rate of change of the moment, N m/s; 0: none.
        lag: time constant, s.
        softness: softness of the limit, dimensionless (`InputSamples.saturated`); 0: a hard limit.
    """

    limit: float = 0.0
    rate: float = 0.0
    lag: float = 0.0
    softness: float = 0.0

    def exerted(self, asked: InputSamples, scale: float) -> InputSamples:
        """The moment exerted for the demanded samples.

        Args:
            scale: N m per unit of the samples.
        """
        size = abs(scale)
        if size == 0.0:
            return asked
        found = asked.saturated(self.limit / size, self.softness) if self.limit else asked
        found = found.at_rate(self.rate / size) if self.rate else found
        return found.lagged(self.lag)


DIRECT = ActuatorLimits()
"""An ideal actuator, which exerts every demanded moment."""


def _shortest(time: Array, width: Array) -> Array:
    """The duration of a jump at these times in intervals of these widths, s, shape (n,)."""
    return np.maximum(_JUMP * width, _ULPS * np.spacing(np.abs(time)))


def recurrence(factor: np.ndarray, added: np.ndarray) -> np.ndarray:
    """States of x_k = factor_k x_(k−1) + added_k from x_(−1) = 0, real or complex.

    Args:
        factor: shape (n,), or one number for all.
        added: shape (n,).

    Returns:
        Shape (n,).
    """
    if factor.ndim == 0:
        from scipy.signal import lfilter  # imported here because it is slow to load

        return np.asarray(lfilter(np.ones(1), np.array([1.0, -factor.item()]), added))
    factor, state, reach = factor.copy(), added.copy(), 1
    while reach < state.size:  # each round covers twice as many steps
        state[reach:] += factor[reach:] * state[:-reach]
        factor[reach:] *= factor[:-reach]
        reach *= 2
    return state


def _stretched(ratio: Array) -> Array:
    """A ratio to a limit on a scale that is linear up to 1 and logarithmic beyond, to `_BEYOND`, shape (n,)."""
    size = np.abs(ratio)
    return np.copysign(np.where(size > 1.0, 1.0 + np.log(np.clip(size, 1.0, _BEYOND)), size), ratio)


def _compressed(place: Array) -> Array:
    """The ratio at a place on the scale of `_stretched`, shape (n,)."""
    size = np.abs(place)
    return np.copysign(np.where(size > 1.0, np.exp(np.maximum(size, 1.0) - 1.0), size), place)


def _tilt(ratio: Array, left: Array, missed: Array) -> Array:
    """Rise of the line that replaces exp(−r v), 0 ≤ v ≤ 1, for every r, shape (n,)."""
    small = ratio < _SERIES
    r = np.where(small, 1.0, ratio)
    exact = (missed - r * left) / r**2 - 0.5 * missed / r
    series = ratio * (-1.0 / 12.0 + ratio * (1.0 / 24.0 + ratio * (-1.0 / 80.0 + ratio / 360.0)))
    return 12.0 * np.where(small, series, exact)
