"""Standard deviations that remain valid when the model does not explain the data.

If it does, the covariance is the inverse of Fisher's information. If it does not, the residual is not white: the
variances are widened by its power in the band of the oscillation, or to the scatter of the runs, whichever is
larger. The diagnosis uses the same scatter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from identification.estimate import NoiseLevel
from identification.statistics.information import inverse
from tunnel_sim.vocabulary.record import Array


def widened_covariance(covariance: Array, least_std: Array) -> Array:
    """Raise standard deviations to a lower limit, keeping the correlations.

    Args:
        covariance: shape (p, p).
        least_std: shape (p,).

    Returns:
        Shape (p, p).
    """
    factor = np.maximum(1.0, least_std / np.sqrt(np.diag(covariance)))
    return np.asarray(covariance * np.outer(factor, factor))


def fisher_covariance(normal: Array, noise: NoiseLevel) -> Array:
    """Inverse information times the noise variance, widened by the slow ratio.

    Args:
        normal: JᵀJ, shape (p, p).
        noise: the level and its slow ratio.

    Returns:
        Shape (p, p).
    """
    return inverse(normal) * (noise.std**2 * noise.slow_ratio)


def scatter_of_runs(influences: Array, speaking: NDArray[np.int64]) -> Array:
    """Standard deviations of parameters from the scatter of the runs, whatever the spectrum of the residuals.

    The sandwich estimator with a run as the cluster (Liang & Zeger, Biometrika 73 (1986) 13,
    doi 10.1093/biomet/73.1.13), widened by Student's t for the small number of runs that determine a parameter.

    Args:
        influences: contribution of every run's residual to the parameters, shape (runs, q).
        speaking: number of runs that determine each parameter, shape (q,).

    Returns:
        Standard deviations, shape (q,): 1.96 of them on either side are a 95 % interval.
    """
    free = np.maximum(speaking - 2, 1)
    spread = np.sqrt(np.sum(influences**2, axis=0) * speaking / free)
    return np.asarray(spread * stdtrit(free, 0.975) / ndtri(0.975))
