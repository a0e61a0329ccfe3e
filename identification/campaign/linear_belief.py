"""The belief of a campaign by linear theory: runs are replaced by what estimating them gives to first order.

With the initial state eliminated, the maximum-likelihood estimate of a run's θ = (a, k, zero) is, to first order in
the noise, θ̂ = θ + S⁻¹ s: S is the Schur complement of JᵀJ and s that of the score Jᵀ noise, both at the true decay.
The posterior of φ and the zero is then a linear system. Its weights are Fisher's information at the likeliest φ,
as in the joint fit of `belief.update_belief`. Source: S. M. Kay, Fundamentals of Statistical Signal Processing:
Estimation Theory (1993), ch. 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.campaign.belief import Belief
from identification.decay.damped_oscillation import Decay
from identification.decay.decay_fit import information_at, linearised_at
from identification.policy import LEAST_ENERGY
from identification.statistics.information import determined, eliminate, embed, scaled_solve
from tunnel_sim.vocabulary.record import Array

_NO_SCORE = np.zeros(5)


@dataclass(frozen=True, eq=False)
class LinearRun:
    """What a run adds to the estimate, to first order.

    Args:
        link: from φ to (a, k), shape (2, 4); see `belief.run_link`.
        time: its sample times since the release, shape (n,), s.
        angle: of the release, rad; the model is released at rest.
        found: the estimate of a [1/s], k [1/s²] and the sensor's zero [rad], shape (3,).
        weight: S, shape (3, 3).
    """

    link: Array
    time: Array
    angle: float
    found: Array
    weight: Array


def linear_run(
    link: Array, time: Array, decay: Decay, angle: float, zero: float, noise: Array
) -> LinearRun | None:
    """The estimate of a run to first order in its noise.

    Args:
        link: from φ to (a, k), shape (2, 4).
        time: its sample times since the release, shape (n,), s.
        decay: the true one.
        angle: of the release, rad.
        zero: the true one, rad.
        noise: of the reading, shape (n,), rad.

    Returns:
        None where the run does not determine its unknowns.
    """
    information, score = linearised_at(time, decay, angle, 0.0, noise)
    if not determined(information):
        return None
    weight, reduced = eliminate(information, score, 3)
    found = np.array([decay.rate, decay.stiffness, zero]) + scaled_solve(weight, reduced)
    return LinearRun(link, time, angle, found, weight)


def shows_a_decay(motion: Array, noise_std: float) -> bool:
    """Whether a motion stands out from the noise, as `identify_run` demands.

    Args:
        motion: angle from the sensor's zero, shape (n,), rad.
        noise_std: of the reading, rad.
    """
    return float(motion @ motion) >= LEAST_ENERGY * noise_std**2


def linear_belief(prior: Belief, runs: Sequence[LinearRun], noise_std: float) -> Belief:
    """The posterior after runs.

    Args:
        prior: the belief before the first run.
        noise_std: of the reading, quantisation included, rad.

    Returns:
        The belief; ``prior`` itself where there is no run.
    """
    if not runs:
        return prior
    near = _posterior(prior, runs, [run.weight for run in runs], noise_std)
    return _posterior(prior, runs, [_weight(run, near.shared) for run in runs], noise_std)


def _weight(run: LinearRun, shared: Array) -> Array:
    """S at the decay that φ gives the run."""
    decay = Decay(*map(float, run.link @ shared))
    return eliminate(information_at(run.time, decay, run.angle, 0.0), _NO_SCORE, 3)[0]


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
