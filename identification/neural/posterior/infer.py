"""From features to posteriors, many samples at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.estimate import Quantity
from identification.neural.posterior.features import LEVEL, Features
from identification.neural.posterior.files import Trained
from identification.neural.posterior.mixture import NORMAL_WIDTH, correlation, quantiles
from identification.neural.posterior.network import forward, variances
from tunnel_sim.vocabulary.record import Array

_NOISY = float(
    np.log(0.5)
)  # of χ² over its freedom: less is a record with hardly any noise, which nothing contradicts


@dataclass(frozen=True, eq=False)
class Posterior:
    """The posterior of one record or campaign.

    Args:
        values: medians, SI, shape (d,).
        intervals: 95 % intervals, SI, shape (d, 2).
        covariance: of normal distributions with these intervals and the mixture's correlations, SI, shape (d, d).
        effects: probability of each effect by name.
        unlike: whether the sample is unlike anything trained on.
    """

    values: Array
    intervals: Array
    covariance: Array
    effects: dict[str, float]
    unlike: bool

    def quantity(self, place: int, unit: str) -> Quantity:
        """One of the values with its interval."""
        low, high = self.intervals[place]
        std = float(np.sqrt(self.covariance[place, place]))
        return Quantity(float(self.values[place]), std, unit, (float(low), float(high)))


def posteriors(samples: Sequence[Features], network: Trained) -> list[Posterior]:
    """Put samples of one kind through its network."""
    if not samples:
        return []
    shifts = np.stack([one.shifts for one in samples])
    covariances = np.stack([one.covariances for one in samples])
    known = np.stack([one.known for one in samples])
    output = forward(
        np,
        network.weights,
        np.stack([one.rivals for one in samples]),
        padded([one.runs for one in samples]),
        np.stack([one.valid for one in samples]).astype(np.float64),
        shifts,
    )
    widths = np.sqrt(np.maximum(np.diagonal(covariances, axis1=2, axis2=3), 1e-12))
    widths = np.where(known[:, None, :], np.minimum(widths, 1e9), 1.0)
    weights, variance = np.exp(output.logarithms), variances(output, widths)
    found = quantiles(weights, output.means, np.sqrt(variance))
    distances = network.distance(output.context)
    chances = 1.0 / (1.0 + np.exp(-np.clip(output.effects, -30.0, 30.0)))
    result = []
    for place, one in enumerate(samples):
        low, middle, high = one.values + one.stds * found[place]
        stds = (high - low) / NORMAL_WIDTH
        scaled = covariances[place] * output.scales[place, :, :, None] ** 2
        scaled = np.where(np.outer(one.known, one.known), scaled, np.eye(one.known.size))
        related = correlation(weights[place], output.means[place], scaled, output.extras[place])
        result.append(
            Posterior(
                middle,
                np.column_stack((low, high)),
                related * np.outer(stds, stds),
                dict(zip(network.effects, chances[place].tolist(), strict=True)),
                bool(distances[place] > network.threshold and one.rivals[0, LEVEL] > _NOISY),
            )
        )
    return result


def padded(runs: Sequence[Array]) -> Array:
    """Features of the runs of several campaigns in one array, with 1 after those of a run and 0 after padding.

    Args:
        runs: shape (n, k) each.

    Returns:
        Shape (b, largest n, k + 1).
    """
    table = np.zeros((len(runs), max(len(one) for one in runs), runs[0].shape[1] + 1))
    for place, one in enumerate(runs):
        table[place, : len(one), :-1], table[place, : len(one), -1] = one, 1.0
    return table
