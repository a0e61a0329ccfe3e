"""The forcing of a run: the effect of its input on the motion. A free decay is a run with zero input.

The motion is β̈ + 2aβ̇ + kβ = g u(t) + a constant, exact for an input that is held or linear between samples.
It is linear in the initial angle and rate, in the gain g per unit inertia and in the sensor's zero. A body
without a spring has k = 0, and its zero cannot be separated from its initial angle. Its third unknown is
instead a constant acceleration, due to a moment added to the input. With a spring, such a moment shifts the
zero.

The response from rest and its derivatives with respect to a and k form one linear system of order six, driven by
the input alone. Its exponential over a sample interval, with the input and its slope as further states (Van Loan,
IEEE Trans. Automat. Contr. 23 (1978) 395–404), gives the response and its sensitivities at the samples without
discretisation error, for any damping and any stiffness, zero included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
from scipy.linalg import expm

from identification.signal.free_decay import Decay, response_rows, sensitivity_weights
from identification.signal.run_unknowns import (
    ANGLE,
    ANGULAR_RATE,
    GAIN,
    RATE,
    STIFFNESS,
    ZERO,
    RunFit,
    RunUnknowns,
    Zero,
)
from identification.statistics import determined, eliminate
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.input_kinds import KnownGain
from tunnel_sim.vocabulary.quantities import Angles, Gain, Times, Vector
from tunnel_sim.vocabulary.record import Array, Record

_OWN = 3  # number of unknowns of each run apart from its coefficients
_LEAST_SAMPLES = 4  # samples per unknown; with fewer the residual does not show the noise
_STATE = 6  # β, β̇, and their derivatives with respect to a and to k
_LINES = 24  # minimum number of spectral lines for a start
_POWER = 0.999  # minimum share of the response's power in these lines
_ROUNDS = 8
_GROWTH = 5.0  # logarithm of the growth over the record beyond which a start overflows


_NO_GAIN = KnownGain()
Rows: TypeAlias = Annotated[Array, "shape (rows, n), SI"]
FreeStart: TypeAlias = Callable[[Record], Decay | None]
"""Finds a decay close enough for the fit of a free decay to converge; None if none fits or nothing moves."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Free:
    """No input: the coefficients of the motion are a and k.

    Args:
        known: the gain of the input over the inertia, if the motion gives it; None if it is an unknown.
    """

    known: KnownGain | None = _NO_GAIN

    driven: ClassVar[bool] = False
    """Whether there is an input."""
    coefficients: ClassVar[tuple[int, ...]] = (RATE, STIFFNESS)
    """Places of a, k and g in the local order."""

    @property
    def least_samples(self) -> int:
        """Minimum number of samples for a fit of the run alone to show the noise."""
        return 0

    @property
    def fixed(self) -> Array:
        """The known part c of (a, k, g), shape (3,), SI."""
        return np.array([0.0, 0.0, 0.0 if self.known is None else self.known.constant])

    @property
    def sought(self) -> list[int]:
        """Places in (a, k, g) of the unknowns in a fit of the run alone."""
        return [0, 1, 2] if self.known is None else [0, 1]

    @property
    def link(self) -> Array:
        """Link from these unknowns to the coefficients: L in (a, k, g) = L φ + c, shape (3, unknowns)."""
        link = np.eye(3)[:, self.sought]
        if self.known is not None:
            link[2, 1] = self.known.per_stiffness
        return link

    def start(self, record: Record, free_start: FreeStart) -> Array | None:
        """(a, k, g) from which a fit converges, shape (3,), in SI units; None without an oscillation.

        Args:
            free_start: finds the decay that starts the fit of a free decay.
        """
        decay = free_start(record)
        return None if decay is None else np.array([decay.rate, decay.stiffness, 0.0])

    def at(self, coefficients: Array) -> tuple[Decay, float]:
        """The decay and the gain from (a, k) or (a, k, g - c), shape (2,) or (3,), SI."""
        return Decay(float(coefficients[0]), float(coefficients[1])), 0.0

    def admits(self, decay: Decay, time: Times) -> bool:
        """Whether a fitted decay is possible with these sample times."""
        del time
        return decay.stiffness > 0.0

    def rows(self, time: Times, decay: Decay) -> Rows:
        """The terms of the motion and their derivatives, by row, at times since the initial state."""
        return response_rows(time, decay, constant=True)

    def weights(self, state: RunUnknowns) -> Array:
        """The run's Jacobian, transposed, as a combination of the rows, shape (5 or 6, m)."""
        weights = np.zeros((5, 5))
        weights[:2, :4] = sensitivity_weights(state.decay, state.angle, state.rate)
        weights[ZERO, 4] = weights[ANGLE, 0] = weights[ANGULAR_RATE, 1] = 1.0
        return weights

    def freed(self, values: Angles, rows: Rows, gain: Gain) -> Angles:
        """The reading less the response to the input."""
        del rows, gain
        return values

    def alone(self, fit: RunFit) -> RunFit | None:
        """A fit of this run alone, with information in the order of free decays; None if it is not determined."""
        return fit

    def level(self, values: Angles, fitted: Zero) -> float:
        """The level about which a reading moves, rad, from the fitted zero."""
        del values
        return fitted


FREE = Free()
"""The forcing of all free decays: none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Forced(Free):
    """The input of a body on a spring.

    Args:
        values: values of the input at the samples.
        held: whether the input is constant from one sample to the next; else linear.
        derivative: 0 where the readings are angles, 1 where they are rates. Zero and initial state are then rates
            too, since the rates of free motion obey the equation of its angles.
    """

    values: Vector
    held: bool
    derivative: int
    known: KnownGain | None

    driven = True
    coefficients = (RATE, STIFFNESS, GAIN)

    @property
    def least_samples(self) -> int:
        """Minimum number of samples for a fit of the run alone to show the noise."""
        return _LEAST_SAMPLES * (len(self.sought) + _OWN)

    def responses(self, time: Times, decay: Decay) -> Array:
        """The response from rest to the input with unit gain and its derivatives, as `driven_rows`."""
        of_decay = decay.rate, decay.stiffness
        return driven_rows(time, self.values, *of_decay, held=self.held, derivative=self.derivative)

    def start(self, record: Record, free_start: FreeStart, *, sprung: bool = True) -> Array | None:
        """(a, k, g) from which a fit converges, shape (3,), in SI units; None without an oscillation."""
        del free_start
        reading = record.time_s, record.yaw_rad
        start = driven_start(*reading, self.values, sprung=sprung, derivative=self.derivative)
        return None if start is None or (sprung and not start[1] > 0.0) else np.array(start)

    def at(self, coefficients: Array) -> tuple[Decay, float]:
        """The decay and the gain from (a, k, g - c), shape (3,), SI."""
        return super().at(coefficients)[0], float(coefficients[2] + self.fixed[2])

    def admits(self, decay: Decay, time: Times) -> bool:
        """Whether the resonance is below half the sample rate: a record shows none above."""
        return 0.0 < decay.stiffness < (np.pi / float(np.diff(time).min())) ** 2

    def rows(self, time: Times, decay: Decay) -> Rows:
        """The rows of a free decay, then of the input."""
        return np.vstack([super().rows(time, decay), self.responses(time, decay)])

    def weights(self, state: RunUnknowns) -> Array:
        """The run's Jacobian, transposed, as a combination of the rows, shape (6, m)."""
        weights = np.zeros((6, 8))
        weights[:5, :5] = super().weights(state)
        weights[RATE, 6] = weights[STIFFNESS, 7] = state.gain
        weights[GAIN, 5] = 1.0
        return weights

    def freed(self, values: Angles, rows: Rows, gain: Gain) -> Angles:
        """The reading less the response to the input."""
        return np.asarray(values - gain * rows[5])

    def alone(self, fit: RunFit) -> RunFit | None:
        """The fit of this run alone: a known gain follows the stiffness, and an unknown gain is eliminated."""
        information, score = fit.information, fit.score
        if self.known is not None:
            moved = np.eye(6)[:, :GAIN]
            moved[GAIN, STIFFNESS] = self.known.per_stiffness
            information, score = moved.T @ information @ moved, moved.T @ score
        if not determined(information):
            return None
        information, score = (
            eliminate(information, score, GAIN) if self.known is None else (information, score)
        )
        return replace(fit, information=information, score=score)


@dataclass(frozen=True, eq=False, kw_only=True)
class Loose(Forced):
    """The input of a body without a spring."""

    @property
    def sought(self) -> list[int]:
        """Places in (a, k, g) of the unknowns in a fit of the run alone."""
        return [0, 2]

    def start(self, record: Record, free_start: FreeStart, *, sprung: bool = False) -> Array | None:
        """(a, 0, g) from which a fit converges, shape (3,), in SI units; None if nothing moves."""
        start = super().start(record, free_start, sprung=sprung)
        if start is not None:
            start[0] = max(start[0], -_GROWTH / record.duration)
        return start

    def admits(self, decay: Decay, time: Times) -> bool:
        """True: any decay rate is possible."""
        del decay, time
        return True

    def rows(self, time: Times, decay: Decay) -> Rows:
        """The rows, with the response to a constant acceleration for the zero; its derivatives come last."""
        rest = driven_rows(time, np.ones(time.size), decay.rate, decay.stiffness, held=True)
        rows = np.vstack([super().rows(time, decay), rest[1:]])
        rows[4] = rest[0]
        return rows

    def weights(self, state: RunUnknowns) -> Array:
        """The run's Jacobian, transposed, as a combination of the rows, shape (6, m)."""
        weights = np.zeros((6, 10))
        weights[:, :8] = super().weights(state)
        weights[RATE, 8] = weights[STIFFNESS, 9] = state.zero
        return weights

    def alone(self, fit: RunFit) -> RunFit | None:
        """The fit of this run alone: the stiffness is known, and has a row of its own."""
        information, score = fit.information.copy(), fit.score.copy()
        information[STIFFNESS] = information[:, STIFFNESS] = score[STIFFNESS] = 0.0
        information[STIFFNESS, STIFFNESS] = 1.0
        return super().alone(replace(fit, information=information, score=score))

    def level(self, values: Angles, fitted: Zero) -> float:
        """The mean of the reading."""
        del fitted
        return float(values.mean())


def forcing_of(run: Run, derivative: int) -> Free:
    """The forcing of a run.

    Args:
        derivative: 0 where the readings are angles, 1 where they are rates.
    """
    if run.drive is None:
        return FREE
    kind, drive = Loose if run.unrestrained else Forced, run.drive
    return kind(values=drive.values, held=drive.held, derivative=derivative, known=run.known_gain)


def driven_rows(
    time: Array, values: Array, rate: float, stiffness: float, *, held: bool, derivative: int = 0
) -> Array:
    """The response from rest to an input of unit gain, and its derivatives.

    Args:
        time: time since the first sample, shape (n,), s, increasing.
        values: values of the input at these times, shape (n,), rad/s² per unit gain.
        rate: a, 1/s.
        stiffness: k, 1/s².
        held: whether the input is constant from one sample to the next; else linear.
        derivative: 0 for the angle, 1 for its rate.

    Returns:
        Angle (rad), its derivative with respect to a (rad s) and to k (rad s²), shape (3, n); for the rate, per
        s.
    """
    steps = np.diff(time)
    if np.ptp(steps) <= 1e-6 * steps.mean():
        steps = steps[:1]
    dynamics = np.zeros((_STATE + 2, _STATE + 2))
    for first in (0, 2, 4):
        dynamics[first, first + 1] = 1.0
        dynamics[first + 1, first], dynamics[first + 1, first + 1] = -stiffness, -2.0 * rate
    dynamics[3, 1], dynamics[5, 0] = -2.0, -1.0
    dynamics[1, 6], dynamics[6, 7] = 1.0, 1.0  # the input, and its slope
    whole = expm(dynamics * steps[:, None, None])
    transition, constant, ramp = whole[:, :_STATE, :_STATE], whole[:, :_STATE, 6], whole[:, :_STATE, 7]
    slope = np.zeros(time.size - 1) if held else np.diff(values) / np.diff(time)
    pushed = constant * values[:-1, None] + ramp * slope[:, None]
    state = np.zeros((time.size, _STATE))
    if steps.size == 1:
        state[1:] = pushed
        power, reach = transition[0], 1
        while reach < time.size:  # in each round, a state includes the input of the last `reach` intervals
            state[reach:] += state[:-reach] @ power.T
            power, reach = power @ power, 2 * reach
    else:
        for i, (matrix, push) in enumerate(zip(transition, pushed, strict=True)):
            state[i + 1] = matrix @ state[i] + push
    return np.asarray(state[:, derivative::2].T, np.float64)


def driven_start(
    time: Array, reading: Array, values: Array, *, sprung: bool = True, derivative: int = 0
) -> tuple[float, float, float] | None:
    """Decay rate, stiffness and gain from the spectra of input and response.

    The equation of motion is satisfied line by line, with a polynomial for the ends of the record; the weights of
    its residuals come from the response of the previous iteration (Sanathanan and Koerner, IEEE Trans. Automat.
    Contr. 8 (1963) 56–58).

    Args:
        time: times of the samples, shape (n,), s.
        reading: reading of the response, shape (n,), rad, or rad/s for its rate.
        values: values of the input, shape (n,).
        derivative: 0 where the reading is the angle, 1 where it is the rate.

    Returns:
        a (1/s), k (1/s²) and g (rad/s² per unit); None if the response contains no motion.
    """
    count = time.size
    response, moved = np.fft.rfft(reading - reading.mean()), np.fft.rfft(values - values.mean())
    power = np.cumsum(np.abs(response[1:]) ** 2)
    if not power[-1] > 0.0:
        return None
    used = slice(1, 1 + min(max(_LINES, int(np.searchsorted(power, _POWER * power[-1])) + 1), power.size))
    turn = 2.0 * np.pi / (count * (time[-1] - time[0]) / (count - 1)) * np.arange(response.size)[used]
    y, u, s = response[used], moved[used], 1j * turn
    unit = float(turn[-1])
    columns = np.column_stack([s / unit * y, y, -((s / unit) ** derivative) * u, -np.ones_like(y), -s / unit])
    sought = [0, 1, 2, 3, 4] if sprung else [0, 2, 3, 4]
    weight = np.ones(turn.size)
    found = np.zeros(5)
    for _ in range(_ROUNDS):
        left = columns[:, sought] * weight[:, None]
        right = -((s / unit) ** 2) * y * weight
        size = np.linalg.norm(left, axis=0)
        if not size.min() > 0.0:
            return None
        stacked = np.vstack([left.real, left.imag]) / size
        solved = np.linalg.lstsq(stacked, np.concatenate([right.real, right.imag]), rcond=None)[0]
        found[sought] = solved / size
        weight = 1.0 / np.maximum(np.abs((s / unit) ** 2 + found[0] * s / unit + found[1]), 1e-9)
    return 0.5 * float(found[0]) * unit, float(found[1]) * unit**2, float(found[2]) * unit ** (2 - derivative)
