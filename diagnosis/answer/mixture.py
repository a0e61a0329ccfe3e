"""A mixture of normal distributions: what is known of a coefficient when several answers are possible."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tunnel_sim.vocabulary.record import Array

_REACH = 8.5  # standard deviations beyond which a normal distribution has no probability in 64 bits
_HALVINGS = 60


@dataclass(frozen=True, eq=False)
class Mixture:
    """A mixture of normal distributions.

    Args:
        weights: their probabilities, which sum to 1, shape (n,).
        means: in the quantity's unit, shape (n,).
        variances: about their means, in the unit squared, shape (n,).
    """

    weights: Array
    means: Array
    variances: Array

    @property
    def mean(self) -> float:
        """Mean of the mixture."""
        return float(self.weights @ self.means)

    @property
    def between(self) -> float:
        """Variance of the means."""
        return float(self.weights @ (self.means - self.mean) ** 2)

    @property
    def std(self) -> float:
        """Standard deviation, by the law of total variance: within and between the distributions."""
        return math.sqrt(float(self.weights @ self.variances) + self.between)

    def quantile(self, share: float) -> float:
        """The value below which the mixture has a given probability.

        Args:
            share: the probability, above 0 and below 1.
        """
        stds = np.sqrt(self.variances)
        low, high = float(np.min(self.means - _REACH * stds)), float(np.max(self.means + _REACH * stds))
        widths = np.maximum(stds, 1e-300)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            below = float(self.weights @ ndtr((middle - self.means) / widths))
            low, high = (middle, high) if below < share else (low, middle)
        return 0.5 * (low + high)
