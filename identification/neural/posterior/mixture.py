"""Quantiles and covariance of mixtures of normal distributions."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from tunnel_sim.vocabulary.record import Array

LEVELS = (0.025, 0.5, 0.975)
NORMAL_WIDTH = 3.92  # of a normal distribution's 95 % interval, in standard deviations
_HALVINGS = 36
_FAR = 12.0  # standard deviations beyond which no component has weight
_NEGLIGIBLE = 1e-9  # weight of a component that moves no quantile


def distribution(weights: Array, means: Array, stds: Array, values: Array) -> Array:
    """Cumulative probability of mixtures.

    Args:
        weights: shape (b, r), each row sums to 1.
        means: shape (b, r, d).
        stds: shape (b, r, d).
        values: shape (b, q, d).

    Returns:
        Shape (b, q, d).
    """
    away = (values[:, :, None, :] - means[:, None]) / stds[:, None]
    return np.asarray((weights[:, None, :, None] * ndtr(away)).sum(axis=2))


def quantiles(weights: Array, means: Array, stds: Array) -> Array:
    """The quantiles at `LEVELS`, by bisection.

    Args:
        weights: shape (b, r).
        means: shape (b, r, d).
        stds: shape (b, r, d).

    Returns:
        Shape (b, 3, d).
    """
    there = (weights > _NEGLIGIBLE)[..., None]
    low = np.where(there, means - _FAR * stds, np.inf).min(axis=1)[:, None, :]
    high = np.where(there, means + _FAR * stds, -np.inf).max(axis=1)[:, None, :]
    levels = np.array(LEVELS)[None, :, None]
    low, high = (
        np.broadcast_to(end, (len(weights), len(LEVELS), means.shape[2])).copy() for end in (low, high)
    )
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = distribution(weights, means, stds, middle) < levels
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


def correlation(weights: Array, means: Array, covariances: Array, extras: Array) -> Array:
    """Correlations of one mixture.

    Args:
        weights: shape (r,).
        means: shape (r, d).
        covariances: of each component, shape (r, d, d).
        extras: variances added to them, shape (r, d).

    Returns:
        Shape (d, d).
    """
    centred = means - weights @ means
    spread = covariances + np.einsum("ri,rj->rij", centred, centred)
    total = np.einsum("r,rij->ij", weights, spread) + np.diag(weights @ extras)
    sizes = np.sqrt(np.diag(total))
    return np.asarray(total / np.outer(sizes, sizes))
