"""Calibration of stated probabilities, in bins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.statistics import Proportion

BINS = 10


@dataclass(frozen=True)
class CalibrationBin:
    """Answers of about one probability.

    Args:
        low: end of the bin, probability.
        high: other end, probability.
        mean: their mean probability.
        right: how many are right.
    """

    low: float
    high: float
    mean: float
    right: Proportion


def calibration(
    probabilities: Sequence[float], right: Sequence[bool]
) -> tuple[float, tuple[CalibrationBin, ...]]:
    """Expected calibration error and its table.

    Args:
        probabilities: of the answers given.
        right: whether each is.

    Returns:
        Mean over answers of |share right − mean probability| by bins of equal width, 0 for no answers, and the bins
        that hold any.
    """
    p, hit = np.asarray(probabilities, dtype=float), np.asarray(right, dtype=bool)
    if p.size == 0:
        return 0.0, ()
    which = np.minimum((p * BINS).astype(int), BINS - 1)
    found = []
    error = 0.0
    for number in np.unique(which):
        inside = which == number
        mean, hits = float(p[inside].mean()), Proportion(int(hit[inside].sum()), int(inside.sum()))
        found.append(CalibrationBin(number / BINS, (number + 1) / BINS, mean, hits))
        error += hits.total / p.size * abs(hits.count / hits.total - mean)
    return error, tuple(found)
