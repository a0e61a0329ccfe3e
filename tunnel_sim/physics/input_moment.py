"""The input of a driven run: its samples, and how they act between the steps of an integrator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.actuator import DIRECT, ActuatorLimits, InputSamples, recurrence
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.input_kinds import INPUTS, InputKind
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.quantities import (
    Moments,
    Number,
    PerSample,
    RadPerS,
    Seconds,
    Times,
)
from tunnel_sim.vocabulary.record import Array, read_only

_EVEN = 1e-6  # share of an interval: a smaller departure from even samples is rounding
_ULPS = 8.0  # in units of a time's last digit: the rounding of a difference of times


@dataclass(frozen=True, eq=False)
class Lines:
    """An input as straight lines, in the form in which runs are integrated side by side.

    Args:
        time_s: times of the samples, evenly spaced, each at the start of a step.
        values: values at these times, in the unit of the input.
        slopes: slopes from these times on, per s.
        interval: interval between the samples, s.
        delay: time by which the input acts later, s.
    """

    time_s: Times
    values: PerSample
    slopes: PerSample
    interval: float
    delay: float = 0.0


@dataclass(frozen=True, eq=False)
class InputMoment:
    """The moment of an input: linear or constant between its samples, constant before the first and after the last.

    Args:
        time_s: times of the samples since the run's start, increasing.
        values: at these times, in any unit.
        scale: N m per unit.
        delay: time by which the moment acts later than its samples, s.
        kind: kind of the input.
        actuator: limits and lag between the samples and the body.
        offset: an added constant moment, which does not pass through the actuator, N m.
        at_sensor: whether a moment acts at the end of the rod that carries the sensor, as a motor with an encoder
            does, and not on the body at the other end.
    """

    time_s: Times
    values: PerSample
    scale: float = 1.0
    delay: float = 0.0
    held: bool = False
    kind: InputKind = INPUTS["moment_nm"]
    actuator: ActuatorLimits = DIRECT
    offset: float = 0.0
    at_sensor: bool = False

    def __post_init__(self) -> None:
        """Copy and check the samples."""
        for name in ("time_s", "values"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        finite = all(map(isfinite, (self.scale, self.delay, self.offset)))
        finite = finite and _is_finite(Same(self.time_s)) and _is_finite(Same(self.values))
        if self.time_s.shape != self.values.shape or not self.time_s.size or not finite:
            what = "an input needs as many finite values as times, and at least one"
            raise TunnelError(what, remedy="correct the sampled input")

    @classmethod
    def of(cls, given: Input, time_s: Times, scale: float, delay: Seconds = 0.0) -> InputMoment:
        """The moment of a run's input with samples at some times since the run's start."""
        return cls(time_s, given.values, scale, delay, given.held, given.kind)

    @property
    def on_body(self) -> bool:
        """Whether the moment acts on the body; else on the rod's upper end, like the spring."""
        return not (self.kind.of_spring or self.at_sensor)

    @cached_property
    def exerted(self) -> InputMoment:
        """The moment behind the actuator, as samples and an offset; none if the scale is 0."""
        offset = self.offset if self.scale else 0.0
        if self.actuator == DIRECT and offset == self.offset:
            return self
        given = _exerted(Same(self.time_s), Same(self.values), self.held, self.actuator, self.scale)
        return replace(
            self, time_s=given.time_s, values=given.values, held=given.held, actuator=DIRECT, offset=offset
        )

    @cached_property
    def acting(self) -> InputMoment:
        """The acting moment, as samples without an actuator or an offset."""
        exerted = self.exerted
        if not exerted.offset:
            return exerted
        return replace(exerted, values=exerted.values + exerted.offset / exerted.scale, offset=0.0)

    @property
    def interval(self) -> Seconds:
        """Time between the samples; 0 if they are not evenly spaced."""
        return _interval(Same(self.time_s))

    @property
    def as_sampled(self) -> bool:
        """Whether it acts at the times and with the values of its samples; a constant moment may be added."""
        return self.delay == 0.0 and self.actuator == DIRECT

    @property
    def greatest(self) -> tuple[float, float]:
        """Greatest magnitudes of the moment (N m) and of its rate of change from sample to sample (N m/s)."""
        size = abs(self.scale)
        rates = np.abs(np.diff(self.values)) / np.diff(self.time_s)
        return size * float(np.max(np.abs(self.values))), size * float(np.max(rates, initial=0.0))

    def on_steps(self, step: Seconds) -> bool:
        """Whether the moment acts from sample to sample at even times, each a whole number of steps from 0."""
        apart, first = self.interval / step, (self.time_s[0] + self.delay) / step
        within = _EVEN * apart
        return (
            round(apart) >= 1 and abs(apart - round(apart)) <= within and abs(first - round(first)) <= within
        )

    def at_steps(self, step: Seconds) -> bool:
        """Whether the samples are at even times from 0 on, a whole number of steps apart, without a delay."""
        return self.delay == 0.0 and abs(self.time_s[0]) <= _EVEN * self.interval and self.on_steps(step)

    def at(self, time: Times) -> Moments:
        """The moment at some times since the run's start, N m, shape (n,)."""
        acting = self.acting
        at = time - acting.delay
        if not acting.held:
            return np.asarray(acting.scale * np.interp(at, acting.time_s, acting.values))
        places = np.clip(np.searchsorted(acting.time_s, at, side="right") - 1, 0, None)
        return np.asarray(acting.scale * acting.values[places])

    def means(self, ends: Times) -> PerSample:
        """Means of the delayed input between successive times since the run's start, which preserve its impulse."""
        means: Array = _impulses(self.acting, ends)[0] / np.diff(ends)
        return means

    def lines(self, step: Seconds, steps: int, *, sampled: bool) -> Lines:
        """The samples without an actuator as lines; equal samples give one object.

        Args:
            step: step of the integration.
            steps: number of steps.
            sampled: whether a line runs from sample to sample, which are at the starts of steps. Else there is
                a line for each step, with the impulse and the first moment of the input there. The motion of a
                body then differs by less than the order of step².
        """
        of = Same(self.time_s), Same(self.values), self.held, self.delay
        return _lines_of_samples(*of) if sampled else _lines_of_steps(*of, step, steps)

    def oscillation(
        self, frequency: RadPerS, damping_ratio: Number, time_s: Times, derivative: int = 0
    ) -> Moments:
        """The response of an oscillator at rest to the moment u: q̈ + 2ζω q̇ + ω² q = ω² u, exact for both holds.

        Args:
            frequency: undamped angular frequency ω.
            damping_ratio: ζ below 1.
            time_s: times since the run's start, at which the oscillator is at rest.
            derivative: order of the returned derivative of q, per s or s²: 0, 1 or 2.
        """
        ringing = np.sqrt(1.0 - damping_ratio**2)
        pole = frequency * complex(-damping_ratio, ringing)
        response = (pole**derivative * self.mode(pole, time_s)).imag
        if derivative == 2:
            response = response + pole.imag * self.scale * _pieces(self.acting, np.maximum(time_s, 0.0))[0]
        moment: Moments = frequency / ringing * response
        return moment

    def mode(self, root: complex, time_s: Times) -> np.ndarray:
        """The state z of a mode that is at rest at first and excited by the moment u: ż = root · z + u, N m s.

        Exact for both holds.

        Args:
            root: root, 1/s.
            time_s: since the run's start, s, shape (n,).

        Returns:
            Complex, shape (n,).
        """
        acting = self.acting
        of = Same(acting.time_s), Same(acting.values), acting.held, acting.delay
        return self.scale * _mode(*of, root, Same(time_s))


def _pieces(drive: InputMoment, starts: Times) -> tuple[PerSample, PerSample]:
    """Level and slope, per s, of an input's delayed samples from given times since the run's start on."""
    kinks = drive.time_s + drive.delay
    return _levels(drive, kinks, np.searchsorted(kinks, starts, side="right") - 1, starts)


def _levels(
    drive: InputMoment, kinks: Times, piece: NDArray[np.intp], starts: Times
) -> tuple[PerSample, PerSample]:
    """As `_pieces`, given the pieces between the delayed samples; −1 before the first sample."""
    at = np.clip(piece, 0, kinks.size - 1)
    slope = np.append(np.diff(drive.values) / np.diff(drive.time_s), 0.0)[at]
    slope = np.where((piece < 0) | drive.held, 0.0, slope)
    return drive.values[at] + slope * (starts - kinks[at]), slope


def _impulses(drive: InputMoment, ends: Times) -> tuple[Array, Array]:
    """Impulses of an input's delayed samples between times, and their first moments about the earlier time."""
    kinks = drive.time_s + drive.delay
    inside = kinks[(kinks > ends[0]) & (kinks < ends[-1])]
    last, both = ends.size - 1, np.concatenate([ends[:-1], inside])
    order = np.argsort(both, kind="stable")  # of two sorted parts, which is fast
    starts, begins = both[order], order < last
    within = np.cumsum(begins) - 1
    piece = np.searchsorted(kinks, ends[0], side="right") - 1 + np.cumsum(~begins)
    level, slope = _levels(drive, kinks, piece, starts)
    length = np.diff(np.append(starts, ends[-1]))
    impulse = length * (level + slope * length / 2.0)
    product = (starts - ends[within]) * impulse + length**2 * (level / 2.0 + slope * length / 3.0)
    integrals = (np.bincount(within, values, last) for values in (impulse, product))
    first, second = (np.asarray(values, np.float64) for values in integrals)
    return first, second


class Same:
    """An array as a key of a cache: equal to itself only."""

    def __init__(self, array: Array) -> None:
        self.array = array

    def __hash__(self) -> int:
        return id(self.array)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and other.array is self.array


@lru_cache(maxsize=128)
def _is_finite(values: Same) -> bool:
    return bool(np.isfinite(values.array).all())


@lru_cache(maxsize=64)
def _interval(time_s: Same) -> Seconds:
    """As `InputMoment.interval`."""
    times = time_s.array
    interval = float(times[-1] - times[0]) / max(1, times.size - 1)
    even = times[0] + interval * np.arange(times.size)
    return interval if np.max(np.abs(times - even)) <= _EVEN * interval else 0.0


@lru_cache(maxsize=64)
def _exerted(time_s: Same, values: Same, held: bool, actuator: ActuatorLimits, scale: float) -> InputSamples:
    """The samples behind an actuator: one object, so that their lines and responses are cached."""
    given = actuator.exerted(InputSamples(time_s.array, values.array, held), scale)
    return InputSamples(read_only(given.time_s), read_only(given.values), given.held)


@lru_cache(maxsize=64)
def _lines_of_samples(time_s: Same, values: Same, held: bool, delay: float) -> Lines:
    drive = InputMoment(time_s.array, values.array, delay=delay, held=held)
    rise = 0.0 if held else np.diff(drive.values) / drive.interval
    slopes = np.append(np.broadcast_to(rise, drive.values.size - 1), 0.0)
    return Lines(drive.time_s, drive.values, read_only(slopes), drive.interval, delay)


@lru_cache(maxsize=64)
def _lines_of_steps(time_s: Same, values: Same, held: bool, delay: float, step: Seconds, steps: int) -> Lines:
    ends = np.asarray(step * np.arange(steps + 1), np.float64)
    impulse, product = _impulses(InputMoment(time_s.array, values.array, delay=delay, held=held), ends)
    slopes = 12.0 * (product - impulse * step / 2.0) / step**3
    return Lines(
        read_only(ends[:-1]), read_only(impulse / step - slopes * step / 2.0), read_only(slopes), step
    )


@dataclass(frozen=True, eq=False)
class _Course:
    """An input as straight lines from the run's start on, and the places of some times on them.

    Args:
        lengths: lengths of the lines, s, or the three lengths that alternate, shape (lengths,).
        length: index of every line's length among these, except the last line's, shape (lines − 1,).
        alternate: whether the lines after the first have two alternating lengths.
        level, slope: of the lines, in the unit of the samples, and per s, shape (lines,).
        line: index of the line for each time, shape (n,).
        between: places of the times that are not at a line's start, shape (m,).
        since: for these times, time since their line's start, s, shape (m,).
    """

    lengths: Array
    length: NDArray[np.intp]
    alternate: bool
    level: PerSample
    slope: PerSample
    line: NDArray[np.intp]
    between: NDArray[np.intp]
    since: Times


@lru_cache(maxsize=64)
def _course(times: Same, values: Same, held: bool, delay: float, at: Same) -> _Course:
    drive, time_s = InputMoment(times.array, values.array, delay=delay, held=held), at.array
    within = _EVEN * drive.interval
    kinks = drive.time_s + delay
    starts = np.concatenate([[0.0], kinks[kinks > within]])
    level, slope = _pieces(drive, starts + within)
    lengths = np.diff(starts)
    number = np.arange(lengths.size)
    # as for the samples of an input with a lag, and for even ones
    in_turn = np.where(number > 0, 2 - number % 2, 0)
    rounding = max(within, _ULPS * float(np.spacing(starts[-1])))
    alternate = bool(lengths.size > 2 and np.all(np.abs(lengths - lengths[in_turn]) <= rounding))
    if alternate and drive.interval:
        lengths[1:] = drive.interval
    line = np.maximum(np.searchsorted(starts, time_s + within, side="right") - 1, 0)
    since = np.maximum(time_s - starts[line], 0.0)
    between = np.flatnonzero(since > rounding)
    return _Course(
        lengths[:3] if alternate else lengths,
        in_turn if alternate else number,
        alternate,
        level - slope * within,
        slope,
        line,
        between,
        since[between],
    )


@lru_cache(maxsize=64)
def _mode(times: Same, values: Same, held: bool, delay: float, root: complex, at: Same) -> np.ndarray:
    """As `InputMoment.mode`, in the unit of the samples and s."""
    course = _course(times, values, held, delay, at)

    def weights(since: Array) -> tuple[np.ndarray, np.ndarray]:  # of level and slope, from z = 0
        turn = root * since
        grown = np.expm1(turn)
        return grown / root, (grown - turn) / root**2

    by_level, by_slope = (weight[course.length] for weight in weights(course.lengths))
    factor, added = np.exp(root * course.lengths), by_level * course.level[:-1] + by_slope * course.slope[:-1]
    state = np.zeros(added.size + 1, np.complex128)  # at the starts of lines
    if course.alternate:  # over two lines at once
        one, other = factor[1], factor[2]
        pairs = other * added[1:-1:2] + added[2::2]
        state[1::2] = recurrence(one * other, np.append(added[:1], pairs))[: state[1::2].size]
        state[2::2] = one * state[1:-1:2] + added[1::2]
    else:
        state[1:] = recurrence(factor, added)
    found = state[course.line]
    if course.between.size:
        line, (by_level, by_slope) = course.line[course.between], weights(course.since)
        beyond = by_level * course.level[line] + by_slope * course.slope[line]
        found[course.between] = np.exp(root * course.since) * found[course.between] + beyond
    found.flags.writeable = False
    return found
