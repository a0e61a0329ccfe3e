"""Least squares of free decays: variable projection, one run or many with shared parameters.

Every run i decays with (aᵢ, kᵢ) = Lᵢ φ; its initial angle and rate and the sensor's zero enter linearly, so they
are eliminated in closed form and only φ is iterated. With white Gaussian noise this is maximum likelihood.
Sources: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432, doi 10.1137/0710036; Kaufman, BIT 15 (1975)
49–57, doi 10.1007/BF01932995 (Jacobian).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.policy import LEAST_SAMPLES
from identification.signal.free_decay import Decay, response_rows, sensitivity_weights
from identification.statistics import eliminate, embed, inner, scaled_solve
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced, read_only

# Local order of one run's unknowns throughout: decay rate, stiffness | zero | initial angle, initial rate.
RATE, STIFFNESS, ZERO, ANGLE, ANGULAR_RATE = range(5)
_TOLERANCE = 1e-12  # relative step of k, and of a in units of ωn, at which the iteration ends
_ROUNDING = 1e-9  # a step this small that no longer lowers the cost is limited by rounding
_MAX_ITERATIONS = 100
# Where the model fits badly, Gauss–Newton converges slowly. At the last iteration a fall of the cost by less than
# this share of a sample's residual variance (a hundredth of a standard deviation) is accepted.
_SETTLED = 1e-4


@dataclass(frozen=True, eq=False)
class Reading:
    """A stretch of one record, with its clock set to zero at the first sample.

    Args:
        time: since the first sample, shape (n,), s.
        yaw: sensor reading, shape (n,), rad.
    """

    time: Array
    yaw: Array

    @classmethod
    def from_record(cls, record: Record) -> Reading:
        """The whole record."""
        return cls(read_only(record.time_s - record.time_s[0]), record.yaw_rad)


@dataclass(frozen=True, eq=False)
class RunFit:
    """One run at the optimum.

    Args:
        angle: initial angle from the sensor's zero, rad.
        rate: initial rate, rad/s.
        residual: reading less model, shape (n,), rad.
        information: JᵀJ in the local order, shape (5, 5); divide by the noise variance for Fisher's.
        score: Jᵀ residual, shape (5,).
    """

    decay: Decay
    angle: float
    rate: float
    residual: Array
    information: Array
    score: Array

    def reduced(self, keep: int = 3) -> tuple[Array, Array]:
        """Information and score of the first ``keep`` of (a, k, zero), with all other unknowns eliminated."""
        return eliminate(self.information, self.score, keep)


@dataclass(frozen=True, eq=False)
class DecayFit:
    """Runs fitted together.

    Args:
        parameters: φ, shape (p,).
        zero: the sensor's zero, rad; the mean where every run has its own.
        normal: information of φ, and of the zero last where it was estimated, shape (p, p) or (p + 1, p + 1).
    """

    parameters: Array
    zero: float
    runs: tuple[RunFit, ...]
    normal: Array
    converged: bool


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of the shared parameters, a normal distribution.

    Args:
        mean: of φ, shape (p,).
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
    prior: Prior | None = None,
    tolerance: float = _TOLERANCE,
) -> DecayFit:
    """Fit runs whose decay rate and stiffness are linear in shared parameters.

    Args:
        links: one (2, p) matrix Lᵢ per run: (aᵢ, kᵢ) = Lᵢ φ.
        start: φ to start from, shape (p,).
        zero: the sensor's zero where it is known, rad; None: estimated.
        own_zeros: whether each run has its own estimated zero; otherwise it is common to the runs.
        prior: the fit then maximises the posterior, and ``normal`` includes the information of the prior.
        tolerance: step of k as a ratio, and of a in units of ωn, at which the iteration ends.

    Returns:
        The fit. ``converged`` is False where the iteration stalled: the values are then the best found, and
        ``runs`` is empty where even the start was out of range or contained no motion.
    """
    best = _project(readings, links, np.asarray(start, dtype=np.float64), zero, prior, own_zeros)
    samples = sum(reading.time.size for reading in readings)
    damping, converged, iteration = 0.0, False, 0
    while best.runs and not converged and iteration < _MAX_ITERATIONS:
        iteration += 1
        try:
            normal, gradient = _shared_system(best, links, zero is None, prior, own_zeros)
            step = scaled_solve(normal + damping * np.diag(np.diag(normal)), gradient)
        except np.linalg.LinAlgError:  # no motion in a run: nothing can be identified
            break
        size = 0.0
        for link, run in zip(links, best.runs, strict=True):
            rate, stiffness = np.abs(link @ step[: best.parameters.size])
            scale = max(abs(run.decay.stiffness), run.decay.rate**2)
            size = max(size, float(rate / np.sqrt(scale)), float(stiffness / scale))
        trial = _project(
            readings, links, best.parameters + step[: best.parameters.size], zero, prior, own_zeros
        )
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
        normal, _ = _shared_system(best, links, zero is None, prior, own_zeros)
    except np.linalg.LinAlgError:
        return nothing
    return DecayFit(best.parameters, best.zero, best.runs, normal, converged)


def fit_run(
    reading: Reading, start: Decay, *, zero: float | None = None, tolerance: float = _TOLERANCE
) -> DecayFit:
    """Fit one run by itself, φ = (a, k): arguments as in `fit_decays`."""
    decay = np.array([start.rate, start.stiffness])
    return fit_decays([reading], [np.eye(2)], decay, zero=zero, tolerance=tolerance)


def project_run(reading: Reading, decay: Decay) -> tuple[RunFit, float] | None:
    """The best initial state and zero of a run for a given decay, such as one from another method.

    Returns:
        The run at that decay and its sensor zero in rad; None where the decay overflows.
    """
    point = _project([reading], [np.eye(2)], np.array([decay.rate, decay.stiffness]), None)
    return (point.runs[0], point.zero) if point.runs else None


def projected_cost(reading: Reading, decay: Decay) -> float:
    """Sum of squared residuals, rad², of a decay at the best initial state and zero; infinite out of range."""
    return _project([reading], [np.eye(2)], np.array([decay.rate, decay.stiffness]), None).cost


def information_at(time: Array, decay: Decay, angle: float, rate: float) -> Array:
    """JᵀJ of one run's reading in the local order (a, k, zero, angle, rate): arguments as in `linearised_at`."""
    return linearised_at(time, decay, angle, rate, np.zeros(time.size))[0]


def linearised_at(
    time: Array, decay: Decay, angle: float, rate: float, residual: Array
) -> tuple[Array, Array]:
    """JᵀJ in the local order, shape (5, 5), and the score Jᵀ residual, shape (5,).

    Args:
        time: since the initial state, shape (n,), s.
        angle: initial angle, rad.
        rate: initial rate, rad/s.
        residual: reading less model, shape (n,), rad.
    """
    rows = response_rows(time, decay, constant=True)
    weights = _local_weights(decay, angle, rate)
    return weights @ (rows @ rows.T) @ weights.T, weights @ inner(rows, residual)


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
    zero: float | None,
    prior: Prior | None = None,
    own_zeros: bool = False,
) -> _Point:
    decays = [Decay(*map(float, link @ parameters)) for link in links]
    with np.errstate(over="ignore", invalid="ignore"):  # a distant trial may overflow; it is then rejected
        rows = [
            response_rows(r.time, decay, constant=True) for r, decay in zip(readings, decays, strict=True)
        ]
        grams = [block @ block.T for block in rows]
    if not all(np.isfinite(gram).all() for gram in grams):
        return _Point(parameters, 0.0, ())
    moments = [inner(block, reading.yaw) for block, reading in zip(rows, readings, strict=True)]
    try:
        if own_zeros and zero is None:
            zeros = [_common_zero([gram], [moment]) for gram, moment in zip(grams, moments, strict=True)]
        else:
            zeros = [_common_zero(grams, moments) if zero is None else zero] * len(grams)
        states = [
            scaled_solve(gram[:2, :2], moment[:2] - gram[:2, 4] * best)
            for gram, moment, best in zip(grams, moments, zeros, strict=True)
        ]
    except np.linalg.LinAlgError:
        return _Point(parameters, 0.0, ())
    runs, cost = [], 0.0 if prior is None else prior.cost(parameters)
    for reading, decay, block, gram, (angle, rate), best in zip(
        readings, decays, rows, grams, states, zeros, strict=True
    ):
        residual = reading.yaw - best - angle * block[0] - rate * block[1]
        weights = _local_weights(decay, float(angle), float(rate))
        score = weights @ inner(block, residual)
        runs.append(RunFit(decay, float(angle), float(rate), residual, weights @ gram @ weights.T, score))
        cost += float(inner(residual, residual))
    mean = zeros[0] if len(set(zeros)) == 1 else float(np.mean(zeros))
    return _Point(parameters, mean, tuple(runs), cost)


def _local_weights(decay: Decay, angle: float, rate: float) -> Array:
    # The run's Jacobian, transposed, as a combination of the rows u, s, w, t·s, 1.
    weights = np.zeros((5, 5))
    weights[:2, :4] = sensitivity_weights(decay, angle, rate)
    weights[ZERO, 4] = weights[ANGLE, 0] = weights[ANGULAR_RATE, 1] = 1.0
    return weights


def _common_zero(grams: Sequence[Array], moments: Sequence[Array]) -> float:
    numerator = denominator = 0.0
    order = [4, 0, 1]
    for gram, moment in zip(grams, moments, strict=True):
        information, score = eliminate(gram[np.ix_(order, order)], moment[order], 1)
        denominator += float(information[0, 0])
        numerator += float(score[0])
    if not denominator > 0.0:  # motions so slow that they cannot be separated from the zero
        raise np.linalg.LinAlgError("the zero cannot be distinguished from the motion")
    return numerator / denominator


def _shared_system(
    point: _Point, links: Sequence[Array], with_zero: bool, prior: Prior | None, own_zeros: bool
) -> tuple[Array, Array]:
    shared = with_zero and not own_zeros
    keep = 3 if shared else 2
    normal: Array | float = 0.0
    gradient: Array | float = 0.0
    for run, link in zip(point.runs, links, strict=True):
        order = [RATE, STIFFNESS, *([ZERO] if with_zero else []), ANGLE, ANGULAR_RATE]
        information, score = eliminate(run.information[np.ix_(order, order)], run.score[order], keep)
        extended = embed(link, with_zero=shared)
        normal = normal + extended.T @ information @ extended
        gradient = gradient + extended.T @ score
    normal, gradient = np.asarray(normal), np.asarray(gradient)
    if prior is not None:
        size = point.parameters.size
        normal[:size, :size] += prior.information
        gradient[:size] += prior.information @ (prior.mean - point.parameters)
    return normal, gradient


def even_reading(reading: Reading) -> Reading:
    """A reading on a uniform raster, as by `evenly_spaced`; the reading itself where its times are uniform."""
    record = Record(reading.time, reading.yaw)
    return reading if record.uniform else Reading.from_record(evenly_spaced(record))


def block_means(reading: Reading, frequency: float, per_cycle: float) -> tuple[Reading, int]:
    """Thin a reading to means of equal blocks, with their middle times, and the number of samples per block.

    The means keep the rate and frequency of a decay and reduce its amplitude a little.

    Args:
        frequency: of its oscillation, Hz.
        per_cycle: least number of blocks per period; the record itself gives at least eight.
    """
    rate = (reading.time.size - 1) / float(reading.time[-1])
    factor = max(1, int(min(rate / (per_cycle * frequency), reading.time.size / LEAST_SAMPLES)))
    return Reading(mean_of_blocks(reading.time, factor), mean_of_blocks(reading.yaw, factor)), factor


def mean_of_blocks(values: Array, factor: int) -> Array:
    """Means of consecutive values, shape (n // factor,); the remainder at the end is dropped.

    Args:
        values: shape (n,).
    """
    if factor == 1:
        return values
    usable = values.size // factor * factor
    # Along the first axis NumPy adds whole rows at once: for short blocks, ten times as fast as along the last.
    return np.asarray(np.ascontiguousarray(values[:usable].reshape(-1, factor).T).mean(axis=0))
