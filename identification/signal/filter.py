"""A decay driven by a random moment: its likelihood by a steady Kalman filter, and its maximum.

The state is (β, β̇) with β̈ + 2aβ̇ + kβ = w(t). w is white with ⟨w(t)w(t′)⟩ = q δ(t − t′), or has a corner
frequency fb, ẇ = −2πfb (w − white), with the same q at low frequency. The reading adds white noise of variance
R. In discrete time the reading obeys D(z) y = C(z) e: D is the characteristic polynomial of the motion; C and
the variance of the innovations e follow by spectral factorisation of R D(z)D(1/z) + γ(z), where γ is the
covariance of the driven part. Innovations therefore need one call of a recursive filter over the record, and no
loop in Python.

The initial state and the sensor's zero enter linearly: their responses are filtered like the reading and fitted
to it by least squares. The steady filter's assumed covariance of the initial state then has no influence. Where
q is 0, C is D and the innovations are the residual of output error. Sources: Maine & Iliff, SIAM J. Appl. Math.
41 (1981) 558–579, doi 10.1137/0141046 (also the scoring); Åström, Automatica 16 (1980) 551–574, doi
10.1016/0005-1098(80)90078-3; Jategaonkar, Flight Vehicle System Identification, 2nd ed. (2015), ch. 5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

from identification.policy import LEAST_CORNER_DROP, LEAST_MOMENT_DROP, MOMENT_DROP_FOR_CORNER
from identification.signal.free_decay import Decay, response_rows
from identification.statistics import inner, inverse, scaled_solve
from tunnel_sim.vocabulary.input_kinds import KnownGain
from tunnel_sim.vocabulary.quantities import Angles
from tunnel_sim.vocabulary.record import Array

_GREATEST = 1e60  # maximum growth or variance over one interval: beyond it no filter is made
_DOUBLINGS = 30  # doublings of the Riccati equation: 2^30 steps of the filter


def discretised(dynamics: Array, drive: Array, interval: float | Array) -> tuple[Array, Array]:
    """Transition and disturbance covariance of linear dynamics driven by white noise, over one sample interval.

    One system, or many at once. Van Loan, IEEE Trans. Automat. Contr. 23 (1978) 395–404, doi
    10.1109/TAC.1978.1101743.

    Args:
        dynamics: matrix of the state, shape (n, n) or (systems, n, n), 1/s in SI units of the state.
        drive: spectral intensity of the noise on the state, of the same shape, in SI units squared per s.
        interval: sample interval, s; shape (systems,) for many.
    """
    size = dynamics.shape[-1]
    block = np.zeros((*dynamics.shape[:-2], 2 * size, 2 * size))
    block[..., :size, :size], block[..., :size, size:] = -dynamics, drive
    block[..., size:, size:] = np.swapaxes(dynamics, -1, -2)
    exponential = expm(block * np.asarray(interval)[..., None, None])
    transition = np.swapaxes(exponential[..., size:, size:], -1, -2)
    disturbance = transition @ exponential[..., :size, size:]
    return transition, 0.5 * (disturbance + np.swapaxes(disturbance, -1, -2))


def steady_filters(
    transition: Array, disturbance: Array, variance: Array
) -> list[tuple[Array, Array, float]]:
    """The steady Kalman filters of systems with a measured first state, as recursive filters.

    Args:
        transition: transition over one interval, shape (systems, n, n), in SI units.
        disturbance: covariance of the disturbance over one interval, shape (systems, n, n), in SI units.
        variance: variance of the noise of a reading, shape (systems,), rad².

    Returns:
        For each system, the numerator and denominator, shape (n + 1,) each, of the filter from readings to
        innovations, and the variance of the innovations, rad²; infinite if the filter does not converge.
    """
    # Prediction covariance of the filters: their Riccati equation by doubling (Anderson, Int. J. Control 28 (1978)
    # 295–306, doi 10.1080/00207177808922455).
    a = np.swapaxes(transition, 1, 2).copy()
    g = np.zeros_like(a)
    g[:, 0, 0] = 1.0 / variance
    covariance = disturbance
    identity = np.eye(transition.shape[1])
    with np.errstate(all="ignore"):  # a diverging trial is rejected by its spread
        for _ in range(_DOUBLINGS):
            inverted, turned = np.linalg.inv(identity + g @ covariance), a.swapaxes(1, 2)
            left = a @ inverted
            grown = covariance + turned @ covariance @ inverted @ a
            done = np.abs(grown - covariance).max() <= 1e-12 * np.abs(grown).max()
            covariance = 0.5 * (grown + grown.swapaxes(1, 2))
            if done:
                break
            g = g + left @ g @ turned
            a = left @ a
    spread = covariance[:, 0, 0] + variance
    gain = np.einsum("rij,rj->ri", transition, covariance[:, :, 0]) / spread[:, None]
    closed = transition.copy()
    closed[:, :, 0] -= gain
    numerators, denominators = np.split(_characteristic(np.concatenate((transition, closed))), 2)
    return [
        (numerators[i], denominators[i], float(spread[i]))
        if np.isfinite(spread[i])
        else (np.ones(1), np.ones(1), np.inf)
        for i in range(variance.size)
    ]


def _characteristic(matrices: Array) -> Array:
    """Coefficients of the characteristic polynomials, shape (systems, n + 1), by Faddeev and Le Verrier."""
    count, size, _ = matrices.shape
    found, identity = np.ones((count, size + 1)), np.eye(size)
    product = matrices
    for k in range(1, size + 1):
        if k > 1:
            product = matrices @ (product + found[:, k - 1, None, None] * identity)
        found[:, k] = -product.trace(axis1=1, axis2=2) / k
    return found


@dataclass(frozen=True)
class Driven:
    """A decay and the random moment that drives it.

    Args:
        intensity: q, spectral intensity of the moment per inertia, rad²/s³; 0 without a moment.
        corner: fb, corner frequency of the moment's spectrum, Hz; None if it is white.
    """

    decay: Decay
    intensity: float
    corner: float | None = None

    @property
    def intensity_at_resonance(self) -> float:
        """The moment's spectral intensity at ωn, where the motion is most sensitive: q/(1 + (ωn/2πfb)²) rad²/s³."""
        if self.corner is None:
            return self.intensity
        return self.intensity / (1.0 + self.decay.stiffness / (2.0 * np.pi * self.corner) ** 2)


@dataclass(frozen=True, eq=False)
class Innovations:
    """The prediction errors of a model.

    Args:
        variance: their expected variance, rad².
        cost: −2 ln L up to a constant, dimensionless.
        gain: gain of a known input, rad/s² per unit; 0 without an input.
        gain_variance: variance of the gain with the other parameters fixed, in the square of its unit.
    """

    values: Angles
    variance: float
    cost: float
    gain: float = 0.0
    gain_variance: float = 0.0


def innovations(
    values: Array, interval: float, model: Driven, noise_variance: float, response: Array | None = None
) -> Innovations | None:
    """One-step prediction errors, with the best initial state, zero and gain of a known input.

    Args:
        values: readings or block means, shape (n,), rad.
        interval: interval between the values, s.
        noise_variance: R, noise variance of one value, rad².
        response: response to a known input of unit gain, shape (n,), rad per unit of gain; None without an
            input.

    Returns:
        None where the model is out of range.
    """
    time = interval * np.arange(values.size, dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        motion = response_rows(time, model.decay)[:2]
    known = [] if response is None else [response]
    if model.corner is not None and model.intensity != 0.0:
        # A moment that is not white has an unknown initial value. The response to it is e^(−ct) less a free
        # motion; the columns already include the free motion.
        known.insert(0, np.exp(-2.0 * np.pi * model.corner * time))
    columns = np.vstack((values, motion, np.ones_like(time), *known))
    if not np.isfinite(columns).all():
        return None
    variance = noise_variance
    if model.intensity > 0.0:
        from scipy.signal import lfilter  # imported here because it is slow to load

        factors = _factored(interval, model, noise_variance)
        if factors is None:
            return None
        motion_polynomial, filter_polynomial, variance = factors
        columns = lfilter(motion_polynomial, filter_polynomial, columns, axis=1)
    lengths = np.linalg.norm(columns[1:], axis=1, keepdims=True)
    if not (np.isfinite(columns[0]).all() and lengths.min() > 0.0 and lengths.max() < np.inf):
        return None
    regressors = columns[1:] / lengths
    gram = regressors @ regressors.T
    try:
        solution = np.linalg.solve(gram, inner(regressors, columns[0]))
    except np.linalg.LinAlgError:
        return None
    left = columns[0] - solution @ regressors
    cost = float(left.size * np.log(variance) + inner(left, left) / variance)
    if response is None:
        return Innovations(left, variance, cost)
    length = float(lengths[-1, 0])
    gain_variance = float(np.linalg.inv(gram)[-1, -1]) * variance / length**2
    return Innovations(left, variance, cost, float(solution[-1]) / length, gain_variance)


def _factored(interval: float, model: Driven, noise_variance: float) -> tuple[Array, Array, float] | None:
    # D, C and the innovations' variance.
    a, k = model.decay.rate, model.decay.stiffness
    if model.corner is None:
        dynamics = np.array([[0.0, 1.0], [-k, -2.0 * a]])
        drive = np.diag([0.0, model.intensity])
    else:
        c = 2.0 * np.pi * model.corner
        dynamics = np.array([[0.0, 1.0, 0.0], [-k, -2.0 * a, 1.0], [0.0, 0.0, -c]])
        drive = np.diag([0.0, 0.0, model.intensity * c**2])
    transition, disturbance = discretised(dynamics, drive, interval)
    if not max(np.abs(transition).max(), np.abs(disturbance).max()) < _GREATEST:
        return None
    size = transition.shape[0]
    characteristic = np.real(np.poly(transition))
    # D(z) y = Σ mᵢ w(t−1−i) with mᵢ the first row of Φⁱ + d₁Φⁱ⁻¹ + … + dᵢ (Faddeev and LeVerrier).
    matrix, rows = np.eye(size), []
    for i in range(size):
        rows.append(matrix[0])
        matrix = transition @ matrix + characteristic[i + 1] * np.eye(size)
    moving = np.array(rows)
    covariance = moving @ disturbance @ moving.T
    gammas = [float(np.trace(covariance, offset=j)) for j in range(size)] + [0.0]
    own = np.correlate(characteristic, characteristic, "full")[size:]
    lags = noise_variance * own + np.array(gammas)
    roots = np.roots(np.concatenate((lags[:0:-1], lags)))
    stable = roots[np.argsort(np.abs(roots))[:size]]
    if not np.isfinite(roots).all() or roots.size != 2 * size or np.abs(stable).max() >= 1.0:
        return None
    filtering = np.real(np.poly(stable))
    variance = float(lags[0] / (filtering @ filtering))
    return (characteristic, filtering, variance) if variance > 0.0 else None


_DECADES = np.arange(-7.0, 3.1, 1.0)  # decades of q over R ω³; at R ω³ the moment doubles R within a radian
_CORNERS = (8.0, 3.0, 1.0, 0.3)  # Hz; above the first, the moment of a rig of a few Hz looks white
_MAX_STEPS = 25
_SETTLED = 0.01  # step, in standard deviations, at which the iteration ends
_NUDGE = 0.1  # step of a and k for differences, in standard deviations; of ln q directly


@dataclass(frozen=True, eq=False)
class DrivenFit:
    """A driven decay at the maximum of its likelihood.

    Args:
        covariance: of (a, k, ln q), shape (3, 3).
        gained: covariance of (a, k, g) with the gain g of a known input, shape (3, 3); zeros for g without an
            input, or if g is k or a known number.
    """

    model: Driven
    covariance: Array
    innovations: Innovations

    gained: Array


@dataclass(frozen=True, eq=False)
class KnownInput:
    """The input of a driven run.

    Args:
        response: response to unit gain at the values of the fit, shape (n,), as a function of the decay.
        gain: gain over the inertia, if the motion gives it; None if it is estimated.
    """

    response: Callable[[Decay], Array]
    gain: KnownGain | None = None


def fit_driven(
    values: Array,
    interval: float,
    start: Decay,
    deviations: Array,
    noise_variance: float,
    known: KnownInput | None = None,
) -> DrivenFit | None:
    """Fit a driven decay; None where no random moment is needed to explain the run.

    The start is the optimum of output error with the best of a range of intensities. Each step solves Fisher's
    information, from central differences of the innovations and of their variance, against the gradient of the
    likelihood.

    Args:
        values: block means of one run, shape (n,), rad.
        interval: interval between the block means, s.
        deviations: standard deviations of (a, k) of the start, shape (2,), in 1/s and 1/s².
        noise_variance: noise variance of one block mean, rad².
    """
    fit = _DrivenLikelihood(values, interval, noise_variance, deviations, known)
    bare = fit.at(Driven(start, 0.0))
    unit = noise_variance * start.omega_n**3
    best = fit.best(Driven(start, float(unit * 10.0**decade)) for decade in _DECADES)
    if bare is None or best is None:
        return None
    found = fit.maximise(best)
    if found is None or bare.cost - found.innovations.cost < LEAST_MOMENT_DROP:
        return None
    if bare.cost - found.innovations.cost > MOMENT_DROP_FOR_CORNER:
        found = fit.with_corner(found)
    return replace(found, gained=fit.with_gain(found))


class _DrivenLikelihood:
    """The likelihood of one run, and its maximisation."""

    def __init__(
        self,
        values: Array,
        interval: float,
        noise_variance: float,
        deviations: Array,
        known: KnownInput | None,
    ) -> None:
        self.values, self.interval, self.noise_variance, self.known = values, interval, noise_variance, known
        self.nudges = np.append(_NUDGE * deviations, _NUDGE)

    def at(self, model: Driven) -> Innovations | None:
        if self.known is None:
            return innovations(self.values, self.interval, model, self.noise_variance)
        with np.errstate(all="ignore"):  # a distant trial is rejected by its columns
            row = self.known.response(model.decay)
        if self.known.gain is not None:
            left = self.values - self.known.gain.at(model.decay.stiffness) * row
            return innovations(left, self.interval, model, self.noise_variance)
        return innovations(self.values, self.interval, model, self.noise_variance, row)

    def with_gain(self, found: DrivenFit) -> Array:
        """Covariance of (a, k, g), shape (3, 3): g's variance for a fixed model plus the model's contribution."""
        jacobian = np.diag([1.0, 1.0, 0.0])
        for i, nudge in enumerate(self.nudges):
            away = nudge * np.eye(3)[i]
            ahead, back = self.at(_moved(found.model, away)), self.at(_moved(found.model, -away))
            if ahead is not None and back is not None:
                jacobian[2, i] = (ahead.gain - back.gain) / (2.0 * nudge)
        own = np.diag([0.0, 0.0, found.innovations.gain_variance])
        return np.asarray(jacobian @ found.covariance @ jacobian.T + own)

    def best(self, models: Iterable[Driven]) -> Driven | None:
        costs = [(found.cost, model) for model in models if (found := self.at(model)) is not None]
        return min(costs, key=lambda item: item[0])[1] if costs else None

    def with_corner(self, white: DrivenFit) -> DrivenFit:
        decay, intensity = white.model.decay, white.model.intensity
        ladder = [
            Driven(decay, intensity * factor, corner)
            for corner in _CORNERS
            for factor in (0.5, 1.0, 2.0, 5.0, 20.0)
        ]
        best = self.best(ladder)
        found = None if best is None else self.maximise(best)
        if found is None or white.innovations.cost - found.innovations.cost < LEAST_CORNER_DROP:
            return white
        return found

    def maximise(self, model: Driven) -> DrivenFit | None:
        here = self.at(model)
        for _ in range(_MAX_STEPS):
            if here is None:
                return None
            # Fisher's information and minus half the gradient of −2 ln L.
            slopes, logs = [], []
            for i, nudge in enumerate(self.nudges):
                away = nudge * np.eye(3)[i]
                ahead, back = self.at(_moved(model, away)), self.at(_moved(model, -away))
                if ahead is None or back is None:
                    return None
                slopes.append((ahead.values - back.values) / (2.0 * nudge))
                logs.append(np.log(ahead.variance / back.variance) / (2.0 * nudge))
            slope, log = np.array(slopes), np.array(logs)
            count, power = here.values.size, float(inner(here.values, here.values)) / here.variance
            information = slope @ slope.T / here.variance + 0.5 * count * np.outer(log, log)
            gradient = -inner(slope, here.values) / here.variance + 0.5 * (power - count) * log
            try:
                step = scaled_solve(information, gradient)
                covariance = inverse(information)
            except np.linalg.LinAlgError:
                return None
            step[2] = np.clip(step[2], -2.0, 2.0)
            size = float(np.max(np.abs(step) / np.sqrt(np.diag(covariance))))
            lower = False
            for factor in (1.0, 0.5, 0.25, 0.0625):
                trial = _moved(model, factor * step)
                there = self.at(trial)
                if there is not None and there.cost < here.cost:
                    model, here, lower = trial, there, True
                    break
            if not lower or size < _SETTLED:
                return DrivenFit(model, covariance, here, np.zeros((3, 3)))
        return None


def _moved(model: Driven, step: Array) -> Driven:
    decay = Decay(model.decay.rate + float(step[0]), model.decay.stiffness + float(step[1]))
    return Driven(decay, model.intensity * float(np.exp(step[2])), model.corner)
