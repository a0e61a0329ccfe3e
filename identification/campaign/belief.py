"""The belief in Cnβ, Cnr, Izz and Cr after each run of a campaign, and the information of a further run.

In φ = (1/Izz, Cnβ/Izz, Cr/Izz, Cnr/Izz) every run's decay rate and stiffness are linear (see `derivatives`), so a
normal prior of φ and the likelihood of the runs give a posterior for any number of runs. The initial state of
every run and the sensor's zero are unknown and eliminated. The information of a future run is Fisher's: Bayesian
D-optimal design (Chaloner & Verdinelli, Statist. Sci. 10 (1995) 273–304, doi 10.1214/ss/1177009939, sec. 2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from identification.campaign.derivatives import Design, derivatives, loads
from identification.estimate import PARAMETERS
from identification.policy import LEAST_ENERGY, SAFE_DEVIATIONS
from identification.signal.decay_fit import Reading, SharedPrior, fit_decays, information_at, linearised_at
from identification.signal.free_decay import Decay
from identification.signal.run_unknowns import RunFit
from identification.statistics import determined, eliminate, embed, inverse, scaled_solve
from tunnel_sim.vocabulary.campaign import RigProperties, Run
from tunnel_sim.vocabulary.record import Array

# All four columns of φ; the prior determines the columns that the runs do not separate.
_DESIGN = Design((np.zeros((2, 4)),), {"g": 0, "n": 1, "d": 2, "m": 3}, np.zeros(0), np.zeros(0), True)
_NO_SCORE = np.zeros(5)
_COEFFICIENTS = [PARAMETERS.index("cn_beta"), PARAMETERS.index("cn_r")]


@dataclass(frozen=True, eq=False)
class Belief:
    """A normal distribution of the coefficients.

    Args:
        shared: most probable φ, shape (4,), SI.
        information: inverse covariance of φ and the sensor's zero, shape (5, 5); the zero's row is zero where
            the zero is unknown.
    """

    shared: Array
    information: Array

    @cached_property
    def values(self) -> Array:
        """Cnβ [1/rad], Cnr [1/rad], Izz [kg m²], Cr [N m s/rad], shape (4,)."""
        return derivatives(_DESIGN, self.shared).values

    @cached_property
    def covariance(self) -> Array:
        """Covariance of ``values``, in the products of their units, shape (4, 4)."""
        jacobian = derivatives(_DESIGN, self.shared).jacobian
        return np.asarray(jacobian @ self.shared_covariance @ jacobian.T)

    @cached_property
    def shared_covariance(self) -> Array:
        """Covariance of φ with the zero eliminated, shape (4, 4)."""
        known = self.information[4, 4] > 0.0
        return inverse(eliminate(self.information, _NO_SCORE, 4)[0] if known else self.information[:4, :4])

    def std(self, name: str) -> float:
        """Standard deviation of a coefficient of `identification.estimate.PARAMETERS`, in its unit."""
        place = PARAMETERS.index(name)
        return float(np.sqrt(self.covariance[place, place]))

    def relative_std(self, name: str) -> float:
        """Standard deviation over the size of the value of a coefficient (1); infinite at a value of zero."""
        value = abs(float(self.values[PARAMETERS.index(name)]))
        return self.std(name) / value if value > 0.0 else inf


def prior_belief(mean: Mapping[str, float], std: Mapping[str, float]) -> Belief:
    """Independent normal distributions of the four coefficients, transformed to φ to first order, before any run.

    Args:
        mean: by name, in the units of `identification.estimate.UNITS`.
        std: standard deviations by name, in the same units, above 0.
    """
    shared = shared_parameters(mean)
    jacobian = derivatives(_DESIGN, shared).jacobian
    variance = np.array([std[name] ** 2 for name in PARAMETERS])
    information = np.zeros((5, 5))
    information[:4, :4] = jacobian.T @ (jacobian / variance[:, None])
    return Belief(shared, information)


def shared_parameters(values: Mapping[str, float]) -> Array:
    """φ, shape (4,), SI, from coefficients by name, in the units of `identification.estimate.UNITS`."""
    scaled = [1.0, values["cn_beta"], values["mechanical_damping"], values["cn_r"]]
    return np.array(scaled) / values["yaw_inertia"]


def run_link(run: Run, rig: RigProperties) -> Array:
    """Dependence of a run's decay rate a [1/s] and stiffness k [1/s²] on φ: (a, k) = L φ, shape (2, 4).

    Raises:
        ValueError: when the run states no spring stiffness.
        TunnelError: when a wind-on run states no air density.
    """
    if run.spring_stiffness is None:
        raise ValueError(f"run {run.id} states no spring stiffness")
    stiffness_load, damping_load = loads(run, rig)
    return np.array([[0.0, 0.0, 0.5, -0.5 * damping_load], [run.spring_stiffness, -stiffness_load, 0.0, 0.0]])


def update_belief(
    prior: Belief, links: Sequence[Array], runs: Sequence[tuple[Reading, RunFit]], noise_std: float
) -> Belief:
    """The posterior after all runs of a campaign: one joint fit with the prior, not run by run.

    Args:
        runs: readings and their single-run fits, which only start the joint fit.
        noise_std: noise of the reading, quantisation included, rad.

    Raises:
        ValueError: when the joint fit does not converge.
    """
    if not runs:
        return prior
    variance = noise_std**2
    known = prior.information[:4, :4] * variance
    # the start: the (a, k) of the runs, weighted by their information, and the prior
    normal, right = known.copy(), known @ prior.shared
    for link, (_, own) in zip(links, runs, strict=True):
        weight = eliminate(own.information, own.score, 2)[0]
        normal = normal + link.T @ weight @ link
        right = right + link.T @ weight @ np.array([own.decay.rate, own.decay.stiffness])
    readings, start = [reading for reading, _ in runs], scaled_solve(normal, right)
    fit = fit_decays(readings, links, start, prior=SharedPrior(prior.shared, known))
    if not fit.converged:
        raise ValueError("the joint fit does not converge")
    return Belief(fit.parameters, fit.normal / variance)


def expected_belief(
    belief: Belief, link: Array, time: Array, angle: float, noise_std: float
) -> Belief | None:
    """The belief after one more run, released at rest: the same values with more information.

    Args:
        link: link of the run, see `run_link`, shape (2, 4).
        time: sample times since the release, shape (n,), s.
        angle: release angle, rad.
        noise_std: noise of the reading, quantisation included, rad.

    Returns:
        None where the stiffness or the damping of the run might not be positive, within three standard
        deviations.
    """
    rate, stiffness = map(float, link @ belief.shared)
    spread = np.sqrt(np.diag(link @ belief.shared_covariance @ link.T))
    if rate <= SAFE_DEVIATIONS * spread[0] or stiffness <= SAFE_DEVIATIONS * spread[1]:
        return None
    information = information_at(time, Decay(rate, stiffness), angle, 0.0) / noise_std**2
    reduced, _ = eliminate(information, _NO_SCORE, 3)
    extended = embed(link, with_zero=True)
    return Belief(belief.shared, belief.information + extended.T @ reduced @ extended)


def information_gain(before: Belief, after: Belief) -> float:
    """Information gained on (Cnβ, Cnr): ½ ln(det Σ before / det Σ after), in nats, the others marginalised.

    It is negative where ``after`` is wider.
    """
    return 0.5 * (_log_volume(before) - _log_volume(after))


def _log_volume(belief: Belief) -> float:
    block = belief.covariance[np.ix_(_COEFFICIENTS, _COEFFICIENTS)]
    scale = np.sqrt(np.diag(block))
    return float(np.linalg.slogdet(block / np.outer(scale, scale))[1] + 2.0 * np.sum(np.log(scale)))


@dataclass(frozen=True, eq=False)
class LinearRun:
    """The contribution of a run to the estimate, to first order.

    Args:
        link: from φ to (a, k), shape (2, 4); see `run_link`.
        time: sample times since the release, shape (n,), s.
        angle: release angle, rad; the model is released at rest.
        found: the estimate of a [1/s], k [1/s²] and the sensor's zero [rad], shape (3,).
        weight: S, the information on ``found``, shape (3, 3).
    """

    link: Array
    time: Array
    angle: float
    found: Array
    weight: Array


def linear_run(
    link: Array, time: Array, decay: Decay, angle: float, zero: float, noise: Array
) -> LinearRun | None:
    """The estimate of a run to first order in its noise; None where the run does not determine its unknowns.

    With the initial state eliminated, it is θ̂ = θ + S⁻¹ s of θ = (a, k, zero), with S the Schur complement of JᵀJ
    and s the Schur complement of the score Jᵀ noise, both at the true decay (S. M. Kay, Fundamentals of Statistical
    Signal Processing: Estimation Theory (1993), ch. 7).

    Args:
        link: from φ to (a, k), shape (2, 4).
        time: sample times since the release, shape (n,), s.
        angle: release angle, rad.
        zero: true zero of the sensor, rad.
        noise: noise of the reading, shape (n,), rad.
    """
    information, score = linearised_at(time, decay, angle, 0.0, noise)
    if not determined(information):
        return None
    weight, reduced = eliminate(information, score, 3)
    found = np.array([decay.rate, decay.stiffness, zero]) + scaled_solve(weight, reduced)
    return LinearRun(link, time, angle, found, weight)


def shows_a_decay(motion: Array, noise_std: float) -> bool:
    """Whether a motion exceeds the noise, as `identify_run` requires.

    Args:
        motion: angle from the sensor's zero, shape (n,), rad.
        noise_std: noise of the reading, rad.
    """
    return float(motion @ motion) >= LEAST_ENERGY * noise_std**2


def linear_belief(prior: Belief, runs: Sequence[LinearRun], noise_std: float) -> Belief:
    """The posterior after runs, weighted by Fisher's information at the most likely φ, as in `update_belief`.

    Args:
        noise_std: noise of the reading, quantisation included, rad.
    """
    if not runs:
        return prior
    near = _posterior(prior, runs, [run.weight for run in runs], noise_std)
    weights = []
    for run in runs:
        decay = Decay(*map(float, run.link @ near.shared))
        information = information_at(run.time, decay, run.angle, 0.0)
        weights.append(eliminate(information, _NO_SCORE, 3)[0])
    return _posterior(prior, runs, weights, noise_std)


def _posterior(
    prior: Belief, runs: Sequence[LinearRun], weights: Sequence[Array], noise_std: float
) -> Belief:
    information = prior.information.copy()
    right = information @ np.append(prior.shared, 0.0)
    for run, weight in zip(runs, weights, strict=True):
        extended = embed(run.link, with_zero=True)
        carried = extended.T @ weight / noise_std**2
        information += carried @ extended
        right += carried @ run.found
    return Belief(scaled_solve(information, right)[:4], information)
