"""Least squares of motions by variable projection: one run or many with shared parameters, free and driven.

Every run i has (aᵢ, kᵢ, gᵢ) = Lᵢ φ + cᵢ, with the gain gᵢ of its input (`identification.signal.forcing`). The
initial angle and rate and the sensor's zero enter linearly, so they are eliminated in closed form and only φ is
iterated. With white Gaussian noise this is maximum likelihood. Sources: Golub & Pereyra, SIAM J. Numer. Anal. 10
(1973) 413–432, doi 10.1137/0710036; Kaufman, BIT 15 (1975) 49–57, doi 10.1007/BF01932995 (Jacobian).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.policy import LEAST_SAMPLES
from identification.signal.forcing import FREE, Free, Rows, forcing_of
from identification.signal.free_decay import Decay
from identification.signal.run_unknowns import (
    GAIN,
    RunFit,
    RunUnknowns,
    ZeroKind,
)
from identification.statistics import eliminate, embed, inner, scaled_solve
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.quantities import Angles, Gain, PerParameter, Vector
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced, read_only

_ZERO_FIRST = np.ix_([4, 0, 1], [4, 0, 1])  # order of the rows: the zero, unit angle, unit rate
_TOLERANCE = 1e-12  # relative step of k, and step of a in units of ωn, at which the iteration ends
_ROUNDING = 1e-9  # a step this small that no longer lowers the cost is limited by rounding
_MAX_ITERATIONS = 100
# Where the model fits badly, Gauss–Newton converges slowly. At the last iteration a fall of the cost by less than
# this share of a sample's residual variance (a hundredth of a standard deviation) is accepted.
_SETTLED = 1e-4


@dataclass(frozen=True, eq=False)
class Reading:
    """A stretch of one record, with its clock set to zero at the first sample.

    Args:
        time: time since the first sample, shape (n,), s.
        yaw: sensor reading, shape (n,), rad.
    """

    time: Array
    yaw: Array
    forcing: Free = FREE

    @classmethod
    def from_run(cls, run: Run, derivative: int) -> Reading:
        """The whole record of a run, with its input.

        Args:
            derivative: 0 where the readings are angles, 1 where they are rates.
        """
        return replace(cls.from_record(run.record), forcing=forcing_of(run, derivative))

    def residual(self, state: RunUnknowns, rows: Rows) -> Angles:
        """Reading less model; ``rows`` are the rows of the forcing at the decay."""
        free = self.forcing.freed(self.yaw, rows, state.gain)
        return np.asarray(free - state.zero * rows[4] - state.angle * rows[0] - state.rate * rows[1])

    def freed(self, decay: Decay, gain: Gain) -> Reading:
        """The reading less the response to the input, which is a free decay."""
        rows = self.forcing.rows(self.time, decay)
        return Reading(self.time, self.forcing.freed(self.yaw, rows, gain))

    @classmethod
    def from_record(cls, record: Record) -> Reading:
        """The whole record."""
        return cls(read_only(record.time_s - record.time_s[0]), record.yaw_rad)


@dataclass(frozen=True, eq=False)
class DecayFit:
    """Runs fitted together.

    Args:
        zero: the sensor's zero, rad; the mean if every run has its own.
        normal: information on φ, and last on the zero if it was estimated, shape (p, p) or (p + 1, p + 1).
    """

    parameters: PerParameter
    zero: float
    runs: tuple[RunFit, ...]
    normal: Array
    converged: bool


@dataclass(frozen=True, eq=False)
class SharedPrior:
    """Prior of the shared parameters, a normal distribution.

    Args:
        mean: mean of φ, shape (p,).
        information: inverse covariance of φ times the noise variance of the readings, shape (p, p): the weight of
            the prior against one squared residual.
    """

    mean: Array
    information: Array

    def cost(self, parameters: Array) -> float:
        """The prior's contribution to the sum of squares at φ, shape (p,): rad²."""
        away = parameters - self.mean
        return float(away @ self.information @ away)


def fit_decays(
    readings: Sequence[Reading],
    links: Sequence[Array],
    start: Array,
    *,
    zero: float | None = None,
    own_zeros: bool = False,
    prior: SharedPrior | None = None,
    tolerance: float = _TOLERANCE,
) -> DecayFit:
    """Fit runs with a decay rate, stiffness and gain that are linear in shared parameters.

    Args:
        links: one matrix Lᵢ per run, shape (3, p), or (2, p) for a free decay: (aᵢ, kᵢ, gᵢ) = Lᵢ φ + cᵢ, where
            cᵢ is the known part of the gain.
        start: starting values of φ, shape (p,).
        zero: the sensor's zero, rad, if known; None: estimated.
        own_zeros: whether each run has its own estimated zero; otherwise it is common to the runs. Needed if a
            run has no spring.
        prior: the fit then maximises the posterior, and ``normal`` includes the information of the prior.
        tolerance: step of k as a ratio, and of a in units of ωn, at which the iteration ends.

    Returns:
        The fit. ``converged`` is False if the iteration stalled: the values are then the best found, and
        ``runs`` is empty if even the start was out of range or contained no motion.
    """
    kind: ZeroKind = "known" if zero is not None else "own" if own_zeros else "shared"
    best = _project(readings, links, np.asarray(start, dtype=np.float64), kind, zero, prior)
    samples = sum(reading.time.size for reading in readings)
    damping, converged, iteration = 0.0, False, 0
    while best.runs and not converged and iteration < _MAX_ITERATIONS:
        iteration += 1
        try:
            normal, gradient = shared_system(best.runs, links, kind, best.parameters, prior)
            step = scaled_solve(normal + damping * np.diag(np.diag(normal)), gradient)
        except np.linalg.LinAlgError:  # no motion in a run: nothing can be identified
            break
        moved = step[: best.parameters.size]
        size = max(
            _relative_step(one, link @ moved, run)
            for one, link, run in zip(readings, links, best.runs, strict=True)
        )
        trial = _project(readings, links, best.parameters + moved, kind, zero, prior)
        expected_gain = float(step @ (2.0 * gradient - normal @ step))
        gain = (best.cost - trial.cost) / max(expected_gain, 1e-300)
        converged = size <= tolerance or (size <= _ROUNDING and trial.cost >= best.cost)
        if iteration == _MAX_ITERATIONS:
            converged = converged or expected_gain <= _SETTLED * best.cost / samples
        # Marquardt's damping, set by the ratio of the actual to the predicted fall of the cost: Gauss–Newton where
        # the residual is small, shorter steps where it is large and Gauss–Newton overshoots.
        if gain < 0.25:
            damping = max(4.0 * damping, 0.01)
        elif not gain < 0.75:
            damping = damping / 8.0 if damping > 1e-4 else 0.0
        if trial.runs and trial.cost <= best.cost:
            best = trial
    nothing = DecayFit(best.parameters, best.zero, (), np.zeros((0, 0)), False)
    if not best.runs:
        return nothing
    try:
        normal, _ = shared_system(best.runs, links, kind, best.parameters, prior)
    except np.linalg.LinAlgError:
        return nothing
    return DecayFit(best.parameters, best.zero, best.runs, normal, converged)


def _relative_step(reading: Reading, step: Array, run: RunFit) -> float:
    """A step of (a, k) or (a, k, g) as a ratio: of k, of a in units of ωn, of the motion by the input."""
    rate, stiffness, *gain = np.abs(step)
    scale = max(abs(run.decay.stiffness), run.decay.rate**2, float(reading.time[-1]) ** -2)
    size = max(float(rate / np.sqrt(scale)), float(stiffness / scale))
    if GAIN not in run.coefficients:
        return size
    power = float(inner(reading.yaw - run.residual, reading.yaw))
    return max(size, float(gain[0]) * float(np.sqrt(run.information[GAIN, GAIN] / max(power, 1e-300))))


def fit_run(
    reading: Reading, start: Decay, *, zero: float | None = None, tolerance: float = _TOLERANCE
) -> DecayFit:
    """Fit one free decay by itself, φ = (a, k): arguments as in `fit_decays`."""
    decay = np.array([start.rate, start.stiffness])
    return fit_decays([reading], [np.eye(2)], decay, zero=zero, tolerance=tolerance)


def project_run(reading: Reading, decay: Decay) -> tuple[RunFit, float] | None:
    """The best initial state and zero of a free decay for given parameters, such as another method's.

    Returns:
        The run at that decay and its sensor zero in rad; None if the decay overflows.
    """
    point = _project([reading], [np.eye(2)], np.array([decay.rate, decay.stiffness]), "shared")
    return (point.runs[0], point.zero) if point.runs else None


def projected_cost(reading: Reading, decay: Decay) -> float:
    """Sum of squared residuals, rad², of a decay at the best initial state and zero; infinite out of range."""
    return _project([reading], [np.eye(2)], np.array([decay.rate, decay.stiffness]), "shared").cost


def information_at(time: Array, decay: Decay, angle: float, rate: float) -> Array:
    """JᵀJ of one free run in the local order (a, k, zero, angle, rate): arguments as in `linearised_at`."""
    return linearised_at(time, decay, angle, rate, np.zeros(time.size))[0]


def linearised_at(
    time: Array, decay: Decay, angle: float, rate: float, residual: Array
) -> tuple[Array, Array]:
    """JᵀJ of one free run in the local order, shape (5, 5), and the score Jᵀ residual, shape (5,).

    Args:
        time: time since the initial state, shape (n,), s.
        angle: initial angle, rad.
        rate: initial rate, rad/s.
        residual: reading less model, shape (n,), rad.
    """
    found = run_at(FREE, RunUnknowns(decay, 0.0, angle, rate), FREE.rows(time, decay), residual)
    return found.information, found.score


def run_at(
    forcing: Free, state: RunUnknowns, rows: Array, residual: Array, gram: Array | None = None
) -> RunFit:
    """A run linearised about a state.

    Args:
        rows: rows of the forcing, whitened if the noise is not white, shape (m, n).
        residual: reading less model, shape (n,), rad.
        gram: products of the rows if known, shape (m, m).
    """
    weights = forcing.weights(state)
    return RunFit(
        state.decay,
        state.zero,
        state.angle,
        state.rate,
        state.gain,
        residual=residual,
        information=weights @ (rows @ rows.T if gram is None else gram) @ weights.T,
        score=weights @ inner(rows, residual),
    )


@dataclass(frozen=True, eq=False)
class _Point:
    """The runs at one φ, with the best linear unknowns."""

    parameters: Array
    zero: float
    runs: tuple[RunFit, ...]
    cost: float = np.inf


def _project(
    readings: Sequence[Reading],
    links: Sequence[Array],
    parameters: Array,
    kind: ZeroKind,
    zero: float | None = None,
    prior: SharedPrior | None = None,
) -> _Point:
    nothing = _Point(parameters, 0.0, ())
    at_decay = [r.forcing.at(link @ parameters) for r, link in zip(readings, links, strict=True)]
    with np.errstate(over="ignore", invalid="ignore"):  # a distant trial may overflow; it is then rejected
        rows = [r.forcing.rows(r.time, decay) for r, (decay, _) in zip(readings, at_decay, strict=True)]
        grams = [block @ block.T for block in rows]
    if not all(np.isfinite(gram).all() for gram in grams):
        return nothing
    values = [
        r.forcing.freed(r.yaw, block, gain)
        for r, block, (_, gain) in zip(readings, rows, at_decay, strict=True)
    ]
    moments = [inner(block[:5], value) for block, value in zip(rows, values, strict=True)]
    try:
        if kind == "own":
            zeros = [_common_zero([gram], [moment]) for gram, moment in zip(grams, moments, strict=True)]
        else:
            zeros = [_common_zero(grams, moments) if zero is None else zero] * len(grams)
        states = [
            scaled_solve(gram[:2, :2], moment[:2] - gram[:2, 4] * best)
            for gram, moment, best in zip(grams, moments, zeros, strict=True)
        ]
    except np.linalg.LinAlgError:
        return nothing
    runs, cost = [], 0.0 if prior is None else prior.cost(parameters)
    for reading, block, gram, (decay, gain), (angle, rate), best in zip(
        readings, rows, grams, at_decay, states, zeros, strict=True
    ):
        state = RunUnknowns(decay, best, float(angle), float(rate), gain)
        residual = reading.residual(state, block)
        runs.append(run_at(reading.forcing, state, block, residual, gram))
        cost += float(inner(residual, residual))
    mean = zeros[0] if len(set(zeros)) == 1 else float(np.mean(zeros))
    return _Point(parameters, mean, tuple(runs), cost)


def _common_zero(grams: Sequence[Array], moments: Sequence[Array]) -> float:
    numerator = denominator = 0.0
    for gram, moment in zip(grams, moments, strict=True):
        information, score = eliminate(gram[_ZERO_FIRST], moment[[4, 0, 1]], 1)
        denominator += float(information[0, 0])
        numerator += float(score[0])
    if not denominator > 0.0:  # motions too slow to be separated from the zero
        raise np.linalg.LinAlgError("the zero cannot be distinguished from the motion")
    return numerator / denominator


def shared_system(
    runs: Sequence[RunFit],
    links: Sequence[Array],
    zero: ZeroKind,
    parameters: PerParameter,
    prior: SharedPrior | None = None,
) -> tuple[Array, Array]:
    """Information, shape (m, m), and score, shape (m,), of shared parameters φ, shape (p,), and a shared zero last.

    Args:
        links: links from φ to the coefficients, as in `fit_decays`.
    """
    normal: Array | float = 0.0
    gradient: Array | float = 0.0
    for run, link in zip(runs, links, strict=True):
        information, score = run.reduced(zero)
        extended = embed(link[: len(run.coefficients)], with_zero=zero == "shared")
        normal = normal + extended.T @ information @ extended
        gradient = gradient + extended.T @ score
    normal, gradient = np.asarray(normal), np.asarray(gradient)
    if prior is not None:
        size = parameters.size
        normal[:size, :size] += prior.information
        gradient[:size] += prior.information @ (prior.mean - parameters)
    return normal, gradient


def even_reading(reading: Reading) -> Reading:
    """A reading on a uniform raster, as by `evenly_spaced`; the reading itself where its times are uniform."""
    record = Record(reading.time, reading.yaw)
    return reading if record.uniform else Reading.from_record(evenly_spaced(record))


def block_means(reading: Reading, frequency: float, per_cycle: float) -> tuple[Reading, int]:
    """Thin a reading to means of equal blocks, with their middle times, and the number of samples per block.

    The means keep the rate and frequency of a decay and reduce its amplitude a little.

    Args:
        frequency: frequency of the oscillation, Hz.
        per_cycle: least number of blocks per period; the record itself gives at least eight.
    """
    rate = (reading.time.size - 1) / float(reading.time[-1])
    factor = max(1, int(min(rate / (per_cycle * frequency), reading.time.size / LEAST_SAMPLES)))
    return Reading(mean_of_blocks(reading.time, factor), mean_of_blocks(reading.yaw, factor)), factor


def mean_of_blocks(values: Vector, factor: int) -> Array:
    """Means of consecutive values, shape (n // factor,); the remainder at the end is dropped."""
    if factor == 1:
        return values
    usable = values.size // factor * factor
    # Along the first axis NumPy adds whole rows at once: for short blocks, ten times as fast as along the last.
    return np.asarray(np.ascontiguousarray(values[:usable].reshape(-1, factor).T).mean(axis=0))
