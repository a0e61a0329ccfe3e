"""Combination of runs: mean and covariance of the shared parameters under the product of the runs' likelihoods.

Importance sampling from Student's distribution about the normal approximation, drawn in pairs of opposite
sign, and repeated where it misses the posterior (Kloek & van Dijk, Econometrica 46 (1978) 1–19,
doi 10.2307/1913641).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.decay.posterior import Posterior
from identification.statistics.information import determined
from tunnel_sim.vocabulary.record import Array

_PAIRS = 3000
_TAILS = 6.0  # degrees of freedom of the proposal
_ROUNDS = 4
_LEAST_SHARE = 0.3  # of the draws: least effective number


def shared_moments(
    posteriors: Sequence[Posterior],
    links: Sequence[Array],
    centre: Array,
    covariance: Array,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Mean and covariance of φ, with a flat prior on it.

    Args:
        links: one (2, p) matrix per run: (a, k) = L φ.
        centre: of the normal approximation, shape (p,).
        covariance: of the same, shape (p, p).

    Returns:
        Mean, shape (p,), and covariance, shape (p, p).
    """
    size = centre.size
    half = rng.standard_normal((_PAIRS, size))
    half /= np.sqrt(rng.chisquare(_TAILS, (_PAIRS, 1)) / _TAILS)
    draws = np.concatenate((half, -half))
    proposal = -0.5 * (_TAILS + size) * np.log1p(np.sum(draws**2, axis=1) / _TAILS)
    for _ in range(_ROUNDS):
        if not determined(covariance):  # all the weight is on a few draws: the caller finds it not determined
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
        mean = weights @ draws
        spread = draws - mean
        own = (spread * weights[:, None]).T @ spread
        centre, covariance = centre + factor @ mean, factor @ own @ factor.T
        if 1.0 / float(weights @ weights) > _LEAST_SHARE * draws.shape[0]:
            break
    return centre, covariance
