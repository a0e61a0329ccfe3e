"""Bayesian: the posterior of each run's decay, and of the campaign's coefficients under all of them.

Initial angle and rate and the sensor's zero enter linearly, so they are integrated out in closed form. An unknown
noise level is also integrated out, which gives Student's form (Bretthorst, Bayesian Spectrum Analysis and Parameter
Estimation (1988), doi 10.1007/978-1-4684-9399-3). The prior is Jeffreys' rule over all unknowns, whose intervals
have the stated coverage and do not depend on the choice of parameters (Proc. R. Soc. A 186 (1946) 453–461, doi
10.1098/rspa.1946.0056):

    p(a, k | y) ∝ RSS(a, k)^(−ν/2) √|I(a, k)|,   or  exp(−RSS/2S²) √|I|  where the noise S is known,

with RSS the sum of squares at the best state and zero, and I the information on (a, k) there. Both are summed
over a grid. The logarithm of the likelihood therefore need not be a parabola, which it is not in records of one
to three cycles. The gain of the input of a driven run is one more linear unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import RectBivariateSpline

from identification.campaign.combination import Combination, Found, RunByRun, RunDecay
from identification.campaign.derivatives import Design
from identification.estimate import Status
from identification.show.quantity import Quantity
from identification.signal.decay_fit import Reading, block_means, mean_of_blocks, project_run
from identification.signal.forcing import Forced
from identification.signal.free_decay import Decay, response_rows
from identification.signal.run_fit import NO_WINDOWS, Gained, decay_covariance_of, describe_run, identify_run
from identification.statistics import determined, inner
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.input_kinds import KnownGain
from tunnel_sim.vocabulary.record import Array

# Half width and step in standard deviations: for a normal distribution the sum is exact to 1e-7.
_FIRST = (5.6, 0.8)
_FINER = (7.0, 0.35)
_WIDENING = 1.25  # factor on the half width in each refinement after the first: Student's tails are long
_MOST_REFINEMENTS = 7
_BORDER_MASS = 1e-4
_SCALE_BAND = (0.7, 1.4)  # ratio of the estimated standard deviations to those assumed for the grid
_FLOOR = -60.0  # logarithm of the likelihood relative to its peak: smaller values are neglected
_STEEPEST = 50.0  # |a| times the record's length: beyond it the record would not show the motion
_RIDGE = 1e-13  # ridge on a scaled Gram matrix, which is singular for a motion of only a few samples
_FINE = 121  # number of points on each side for the quantiles
# number of points on each side for the response to an input: it is nearly linear over the posterior
_NODES = 5
TAIL = 0.025


@dataclass(frozen=True)
class NoiseKnowledge:
    """Knowledge of the noise.

    Args:
        variance: S² of one value of the reading, rad²; None where it is unknown and integrated out.
        within: sum of squares within the blocks, rad², which averaging removes from the residual.
        freedom: ν, number of samples less number of linear unknowns.
    """

    variance: float | None
    samples: int
    within: float
    freedom: float


@dataclass(frozen=True, eq=False)
class DecayPosterior:
    """A posterior of (a, k).

    Args:
        centre: centre of the grid, shape (2,), 1/s and 1/s².
        scale: lower triangular: (a, k) = centre + scale z, shape (2, 2).
        axis: values of both coordinates z, shape (m,), dimensionless.
        log_likelihood: logarithm of the likelihood over the grid, its maximum at 0, shape (m, m).
        log_posterior: the same with the prior, shape (m, m).
    """

    centre: Array
    scale: Array
    axis: Array
    log_likelihood: Array
    log_posterior: Array

    def moments(self) -> tuple[Array, Array]:
        """Mean (2,) and covariance (2, 2) of (a, k)."""
        weights = np.exp(self.log_posterior - self.log_posterior.max())
        weights /= weights.sum()
        points = _points(self.axis)
        mean = inner(points, weights.ravel())
        spread = points - mean[:, None]
        covariance = inner((spread * weights.ravel())[:, None], spread)
        return self.centre + self.scale @ mean, self.scale @ covariance @ self.scale.T

    def log_likelihood_at(self, decays: Array) -> Array:
        """ℓ of decays (a, k), shape (n, 2), 1/s and 1/s²; outside the grid it falls like a normal distribution."""
        z = np.linalg.solve(self.scale, (decays - self.centre).T)
        edge = float(self.axis[-1])
        inside = np.clip(z, -edge, edge)
        spline = _spline(self.axis, self.log_likelihood)
        beyond = np.sum(z**2 - inside**2, axis=0)
        return np.asarray(spline.ev(inside[0], inside[1]) - 0.5 * beyond)

    def modal(self) -> tuple[tuple[float, float, float, float], tuple[float, float, float, float]]:
        """ωn in rad/s and ζ: mean, standard deviation, lower and upper end of the 95 % interval of each."""
        fine = np.linspace(self.axis[0], self.axis[-1], _FINE)
        spline = _spline(self.axis, self.log_posterior)
        weights = np.exp(np.minimum(spline(fine, fine) - self.log_posterior.max(), 1.0)).ravel()
        decays = self.centre[:, None] + self.scale @ _points(fine)
        real = decays[1] > 0.0
        omega = np.sqrt(decays[1][real])
        return (_summary(omega, weights[real]), _summary(decays[0][real] / omega, weights[real]))


@dataclass(frozen=True, eq=False)
class InputResponse:
    """The response of a run to its input, over a grid.

    Args:
        response: to unit gain and its derivatives with respect to a and k, at the values of the reading, shape
            (3, n), as a function of the decay.
        known: the gain over the inertia, if the motion determines it; None if it is a linear unknown.
    """

    response: Callable[[Decay], Array]
    known: KnownGain | None

    def over(self, centre: Array, scale: Array, axis: Array) -> Array:
        """The response at all points of a grid, shape (m², 3, n), by Chebyshev interpolation between a few of them.

        Args:
            centre: centre of the grid, shape (2,), 1/s and 1/s².
            scale: as in `DecayPosterior`, shape (2, 2).
            axis: values of both coordinates, shape (m,), dimensionless.
        """
        nodes = chebyshev.chebpts1(_NODES)
        decays = centre[:, None] + scale @ _points(axis[-1] * nodes)
        rows = np.array([self.response(Decay(float(a), float(k))) for a, k in decays.T])
        weights = chebyshev.chebvander(axis / axis[-1], _NODES - 1) @ np.linalg.inv(
            chebyshev.chebvander(nodes, _NODES - 1)
        )
        return np.asarray(np.tensordot(np.kron(weights, weights), rows, axes=1), np.float64)


def posterior_of(
    thin: Reading,
    start: Decay,
    covariance: Array,
    knowledge: NoiseKnowledge,
    forced: InputResponse | None,
) -> DecayPosterior | None:
    """Compute the posterior on a grid, and move the grid until it covers the posterior.

    None where the record is too short to bound the decay.

    Args:
        covariance: an estimate of the covariance of (a, k), shape (2, 2).
        forced: response of a driven run to its input.
    """
    centre, spread = np.array([start.rate, start.stiffness]), covariance
    width, step = _FIRST
    for _ in range(_MOST_REFINEMENTS):
        try:
            scale = np.asarray(np.linalg.cholesky(spread), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
        axis = np.arange(-width, width + 0.5 * step, step, dtype=np.float64)
        decays = centre[:, None] + scale @ _points(axis)
        rows = None if forced is None else forced.over(centre, scale, axis)
        known = None if forced is None else forced.known
        # Log-likelihood and log-prior at each (a, k), in slices that stay in the cache.
        count = decays.shape[1]
        likelihood, prior = np.empty(count), np.empty(count)
        slice_size = max(1, 60_000 // thin.time.size)
        for begin in range(0, count, slice_size):
            part = slice(begin, begin + slice_size)
            driven = None if rows is None else rows[part]
            squares, prior[part] = _squares_and_prior(thin, decays[0, part], decays[1, part], driven, known)
            # Positive stiffness, and neither decay nor growth within a sample.
            real = (decays[1, part] > 0.0) & (np.abs(decays[0, part]) * float(thin.time[-1]) < _STEEPEST)
            squares = np.where(real & np.isfinite(squares), squares, np.inf)
            total = knowledge.samples * squares + knowledge.within
            if knowledge.variance is None:
                likelihood[part] = -0.5 * knowledge.freedom * np.log(total)
            else:
                likelihood[part] = -0.5 * total / knowledge.variance
        prior = np.where(np.isfinite(prior), prior, 0.0)
        shape = (axis.size, axis.size)
        if not np.isfinite(likelihood.max()):
            return None
        likelihood = np.maximum(likelihood - likelihood.max(), _FLOOR)
        found = DecayPosterior(
            centre, scale, axis, likelihood.reshape(shape), (likelihood + prior).reshape(shape)
        )
        mean, spread = found.moments()
        # The grid covers it if hardly any weight is at the border, and place and size are about right.
        weights = np.exp(found.log_posterior - found.log_posterior.max())
        inner = weights[1:-1, 1:-1].sum()
        inverse = np.linalg.inv(scale)
        own = np.sqrt(np.linalg.eigvalsh(inverse @ spread @ inverse.T))
        off = np.abs(inverse @ (mean - centre)).max()
        low, high = _SCALE_BAND
        border = weights.sum() - inner
        if border <= _BORDER_MASS * weights.sum() and low < own[0] and own[1] < high and off < 1.0:
            return found
        centre = mean
        width, step = _FINER if width == _FIRST[0] else (_WIDENING * width, _FINER[1])
    return None


def _spline(axis: Array, values: Array) -> RectBivariateSpline:
    # A spline overshoots where the prior cuts off the posterior; linear interpolation does not.
    degree = 1 if np.any(np.abs(np.diff(values, axis=0)) > -_FLOOR / 4.0) else 3
    return RectBivariateSpline(axis, axis, values, kx=degree, ky=degree)


def _squares_and_prior(
    thin: Reading, rate: Array, stiffness: Array, driven: Array | None, known: KnownGain | None
) -> tuple[Array, Array]:
    # As `response_rows`, for many decays; complex, so one formula covers all but exactly critical damping.
    time, limit = thin.time, _STEEPEST / float(thin.time[-1])
    damping, spring = np.clip(rate, -limit, limit), np.abs(stiffness)
    delta = (spring - damping**2).astype(np.complex128)
    delta[np.abs(delta) < 1e-9 * np.abs(spring)] += 1e-9 * np.abs(spring).max()
    root = np.sqrt(delta)
    decaying = np.exp(-np.outer(damping, time))
    turning = np.exp(1j * np.outer(root, time))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        cosine = decaying * (0.5 * (turning + 1.0 / turning)).real
        sine = decaying * (0.5 * (turning - 1.0 / turning) / (1j * root[:, None])).real
    slope = (time * cosine - sine) / (2.0 * delta.real[:, None])
    start = cosine + damping[:, None] * sine
    linear = np.stack((start, sine, np.ones_like(start)), axis=1)  # (points, 3, n)
    a, k = rate[:, None], stiffness[:, None]
    values = np.broadcast_to(thin.yaw, start.shape)
    if driven is not None and known is not None:
        values = values - known.at(k) * driven[:, 0]
    elif driven is not None:
        linear = np.concatenate((linear, driven[:, :1]), axis=1)
    gram = linear @ linear.transpose(0, 2, 1)
    unit = np.sqrt(np.einsum("gii->gi", gram))
    moments = np.einsum("gin,gn->gi", linear, values)
    scaled = gram / (unit[:, :, None] * unit[:, None, :]) + _RIDGE * np.eye(linear.shape[1])
    solution = np.linalg.solve(scaled, (moments / unit)[:, :, None])[:, :, 0] / unit
    residual = values - np.einsum("gi,gin->gn", solution, linear)
    squares = np.einsum("gn,gn->g", residual, residual)
    angle, speed = solution[:, 0, None], solution[:, 1, None]
    by_rate = -2.0 * (k * angle + a * speed) * slope - speed * time * sine
    by_stiffness = (a * angle + speed) * slope - 0.5 * angle * time * sine
    if driven is not None:
        gain = solution[:, 3, None] if known is None else known.at(k)
        slope_of_gain = 0.0 if known is None else known.per_stiffness
        by_rate = by_rate + gain * driven[:, 1]
        by_stiffness = by_stiffness + gain * driven[:, 2] + slope_of_gain * driven[:, 0]
    full = np.concatenate((linear, by_rate[:, None], by_stiffness[:, None]), axis=1)
    information = full @ full.transpose(0, 2, 1)
    with np.errstate(invalid="ignore"):  # a motion of only a few samples gives no information
        return squares, 0.5 * (np.linalg.slogdet(information)[1] - np.linalg.slogdet(gram)[1])


def _points(axis: Array) -> Array:
    return np.array(np.meshgrid(axis, axis, indexing="ij")).reshape(2, -1)


def _summary(values: Array, weights: Array) -> tuple[float, float, float, float]:
    order = np.argsort(values)
    values, weights = values[order], weights[order] / weights.sum()
    mean = float(inner(weights, values))
    std = float(np.sqrt(inner(weights, (values - mean) ** 2)))
    reached = np.cumsum(weights) - 0.5 * weights
    low, high = np.interp((TAIL, 1.0 - TAIL), reached, values)
    return mean, std, float(low), float(high)


_PAIRS = 3000
_TAILS = 6.0  # degrees of freedom of the proposal
_ROUNDS = 4
_LEAST_SHARE = 0.3  # minimum effective number of draws, as a share


def shared_moments(
    posteriors: Sequence[DecayPosterior],
    links: Sequence[Array],
    centre: Array,
    covariance: Array,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Mean, shape (p,), and covariance, shape (p, p), of φ, with a flat prior on it.

    Draws from the product of the runs' likelihoods: importance sampling from Student's distribution about the
    normal approximation, in pairs of opposite sign, repeated if it misses the posterior (Kloek & van Dijk,
    Econometrica 46 (1978) 1–19, doi 10.2307/1913641).

    Args:
        links: one (2, p) matrix per run: (a, k) = L φ.
        centre: centre of the normal approximation, shape (p,).
        covariance: covariance of the normal approximation, shape (p, p).
    """
    size = centre.size
    half = rng.standard_normal((_PAIRS, size))
    half /= np.sqrt(rng.chisquare(_TAILS, (_PAIRS, 1)) / _TAILS)
    draws = np.concatenate((half, -half))
    proposal = -0.5 * (_TAILS + size) * np.log1p(np.sum(draws**2, axis=1) / _TAILS)
    for _ in range(_ROUNDS):
        if not determined(covariance):  # all the weight is on a few draws: the caller reports it
            break
        unit = np.sqrt(np.diag(covariance))
        factor = unit[:, None] * np.linalg.cholesky(covariance / np.outer(unit, unit))
        points = centre + draws @ factor.T
        logs = sum(
            (p.log_likelihood_at(points @ link.T) for p, link in zip(posteriors, links, strict=True)),
            np.zeros(draws.shape[0]),
        )
        logs = logs - proposal
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        mean = inner(draws.T, weights)
        spread = draws - mean
        own = inner((spread * weights[:, None]).T[:, None], spread.T)
        centre, covariance = centre + factor @ mean, factor @ own @ factor.T
        if 1.0 / float(inner(weights, weights)) > _LEAST_SHARE * draws.shape[0]:
            break
    return centre, covariance


_LINEAR = 3  # initial angle and rate, zero


@dataclass(frozen=True, eq=False)
class _PosteriorDecay(RunDecay):
    posterior: DecayPosterior = field(kw_only=True)
    driven: bool = field(kw_only=True)


@dataclass(frozen=True)
class Bayesian(RunByRun):
    """Posterior means, deviations and intervals.

    Args:
        blocks_per_cycle: minimum number of block means per period in the posterior.
    """

    name = "bayesian"
    takes_driven = True
    blocks_per_cycle: int = 20
    seed: int = 0

    def _together(self, found: Sequence[RunDecay]) -> Combination | None:
        if any(isinstance(one, _PosteriorDecay) and one.driven for one in found):
            return None  # only inputs that are moments give their gains together with (a, k)

        def together(
            design: Design, places: list[int], centre: Array, covariance: Array
        ) -> tuple[Array, Array]:
            posteriors = [one.posterior for i in places if isinstance(one := found[i], _PosteriorDecay)]
            rng = np.random.default_rng(self.seed)
            return shared_moments(posteriors, design.links, centre, covariance, rng)

        return together

    def _refusal(self, run: Run) -> str:
        return "has no spring, and so no stiffness to find" if run.drive and run.unrestrained else ""

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        bare = identify_run(run, sensor, cycles_per_window=NO_WINDOWS)
        fit, noise, fitted = bare.fit, bare.noise, bare.gained
        if fit is None or noise is None or fitted is None:
            return RunDecay(bare.estimate)
        reading, forcing, time = bare.reading, bare.reading.forcing, bare.reading.time
        variance = noise.std**2 * noise.slow_ratio
        guess = decay_covariance_of(fit) * variance
        decay, residual = fit.decay, fit.residual
        frequency = decay.omega_n / (2.0 * np.pi)
        thin, factor = block_means(reading, frequency, self.blocks_per_cycle)
        means, _ = block_means(Reading(time, residual), frequency, self.blocks_per_cycle)
        known = variance if noise.source == "stated" or noise.slow_ratio > 1.0 else None
        within = float(inner(residual, residual) - factor * inner(means.yaw, means.yaw))
        linear = _LINEAR + (forcing.known is None)
        knowledge = NoiseKnowledge(known, factor, max(within, 0.0), time.size - linear)
        forced = None
        if isinstance(forcing, Forced):

            def rows(decay: Decay) -> Array:
                """The response to the input and its derivatives, in the means of the blocks."""
                return np.array([mean_of_blocks(row, factor) for row in forcing.responses(time, decay)])

            forced = InputResponse(rows, forcing.known)
        posterior = posterior_of(thin, decay, guess, knowledge, forced)
        if posterior is None:
            return Status.NOT_CONVERGED
        mean, covariance = posterior.moments()
        decay = Decay(float(mean[0]), float(mean[1]))
        if forcing.known is not None:
            gain = forcing.known.at(decay.stiffness)
        else:
            of_input = forcing.rows(time, decay)[5]
            linear_rows = [of_input, *response_rows(time, decay)[:2], np.ones_like(time)]
            gain = float(np.linalg.lstsq(np.transpose(linear_rows), reading.yaw, rcond=None)[0][0])
        free = reading.freed(decay, gain)
        projected = project_run(free, decay)
        if projected is None:
            return Status.NOT_CONVERGED
        described = describe_run(run, free, *projected, covariance, variance, noise=noise)
        omega_n, zeta = posterior.modal()
        estimate = replace(
            described,
            omega_n=Quantity(omega_n[0], omega_n[1], "rad/s", omega_n[2:]),
            zeta=Quantity(zeta[0], zeta[1], "1", zeta[2:]),
        )
        # the gain given (a, k), as in least squares
        weight, jacobian = fitted.weight, np.eye(3)[:, :2]
        jacobian[2] = forcing.link[2] if forcing.known is not None else -weight[2, :2] / weight[2, 2]
        of_sought = jacobian @ covariance @ jacobian.T
        if forcing.known is None:
            of_sought[2, 2] += 1.0 / weight[2, 2]
        sought = forcing.sought
        moved = np.array([decay.rate, decay.stiffness]) - fitted.coefficients[:2]
        coefficients = fitted.coefficients + jacobian @ moved
        gained = Gained.of(coefficients, of_sought[np.ix_(sought, sought)], sought)
        return _PosteriorDecay(estimate, gained, posterior=posterior, driven=forcing.driven)
