"""Standard deviations that stay honest when the model does not explain the data.

Where it does, the covariance is the inverse of Fisher's information. Where it does not, the residual is not
white: the variances are widened by its power in the band of the oscillation, and by how much the answer moves
when one run after the other is left out (delete-one jackknife, linearised; Efron & Stein, Ann. Statist. 9
(1981) 586–596, doi 10.1214/aos/1176345462), whichever is more.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.decay_fit import RunFit
from identification.estimate import NoiseLevel
from identification.information import embed, inverse, scaled_solve
from tunnel_sim.record import Array

_LEAST_RUNS = 3
_WORST_CONDITION = 1e10


def widened_covariance(covariance: Array, jackknife_std: Array | None) -> Array:
    """Raise the standard deviations that fall short of the jackknife's, keeping the correlations.

    Args:
        covariance: shape (p, p).
        jackknife_std: shape (p,); None where there is none.

    Returns:
        Shape (p, p).
    """
    if jackknife_std is None:
        return covariance
    factor = np.maximum(1.0, jackknife_std / np.sqrt(np.diag(covariance)))
    return np.asarray(covariance * np.outer(factor, factor))


def fisher_covariance(normal: Array, noise: NoiseLevel) -> Array:
    """Inverse information times the noise variance, widened by the slow ratio.

    Args:
        normal: JᵀJ, shape (p, p).
        noise: the level it rests on.

    Returns:
        Shape (p, p).
    """
    return inverse(normal) * (noise.std**2 * noise.slow_ratio)


def jackknife_std(runs: Sequence[RunFit], links: Sequence[Array], jacobian: Array) -> Array | None:
    """How much parameters move when one run is left out, as standard deviations.

    Args:
        runs: of the joint fit, with the zero common to them.
        links: one (2, p) matrix per run.
        jacobian: of the wanted parameters to φ, shape (q, p).

    Returns:
        Shape (q,); None where the campaign cannot spare a run.
    """
    if len(runs) < _LEAST_RUNS:
        return None
    informations, scores = [], []
    for run, link in zip(runs, links, strict=True):
        information, score = run.reduced()
        extended = embed(link, with_zero=True)
        informations.append(extended.T @ information @ extended)
        scores.append(extended.T @ score)
    total = np.sum(informations, axis=0)
    moves = []
    for information, score in zip(informations, scores, strict=True):
        rest = total - information
        scale = np.sqrt(np.diag(total))
        if np.linalg.cond(rest / np.outer(scale, scale)) > _WORST_CONDITION:
            return None
        moves.append(jacobian @ -scaled_solve(rest, score)[:-1])
    spread = np.array(moves) - np.mean(moves, axis=0)
    return np.asarray(np.sqrt((len(runs) - 1) / len(runs) * np.sum(spread**2, axis=0)))
