"""Straight lines through points of known variance, with a test of their scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from identification.policy import MISFIT_RATE
from identification.statistics.information import inverse, scaled_solve
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class WeightedFit:
    """Linear least squares.

    Args:
        values: of the unknowns, shape (p,).
        covariance: shape (p, p); widened where the scatter is beyond chance.
        residual: shape (n,).
    """

    values: Array
    covariance: Array
    residual: Array


def weighted_fit(columns: Array, target: Array, variance: Array) -> WeightedFit:
    """Least squares with known variances, which are raised where the scatter is beyond chance.

    Args:
        columns: one per unknown, shape (n, p) with n above p.
        target: shape (n,).
        variance: of the target's points, shape (n,).
    """
    weights = 1.0 / variance
    normal = columns.T @ (columns * weights[:, None])
    values = scaled_solve(normal, columns.T @ (weights * target))
    residual = target - columns @ values
    freedom = target.size - values.size
    scatter = float(residual @ (weights * residual))
    beyond = scatter > float(chdtri(freedom, MISFIT_RATE))
    return WeightedFit(values, inverse(normal) * (scatter / freedom if beyond else 1.0), residual)


def decay_covariance(rate: float, omega_d: float, rate_variance: float, omega_variance: float) -> Array:
    """Covariance of (a, k) from independent decay rate and damped frequency: k = ωd² + a².

    Args:
        rate: a, 1/s.
        omega_d: damped angular frequency, rad/s.
        rate_variance: of a, (1/s)², square of a standard deviation in 1/s.
        omega_variance: of ωd, square of a standard deviation in rad/s.

    Returns:
        Shape (2, 2).
    """
    slope = np.array([[1.0, 0.0], [2.0 * rate, 2.0 * omega_d]])
    return np.asarray(slope @ np.diag([rate_variance, omega_variance]) @ slope.T)


def deviations(rate: float, omega_d: float, covariance: Array) -> tuple[float, float]:
    """Standard deviations of decay rate and damped frequency, the inverse of `decay_covariance`.

    Args:
        rate: a, 1/s.
        omega_d: damped angular frequency, rad/s, above 0.
        covariance: of (a, k), shape (2, 2), in 1/s and 1/s².

    Returns:
        Of a in 1/s and of ωd in rad/s.
    """
    slope = np.array([-rate, 0.5]) / omega_d
    return float(np.sqrt(covariance[0, 0])), float(np.sqrt(slope @ covariance @ slope))
