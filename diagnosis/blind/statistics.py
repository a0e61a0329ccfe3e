"""Shares with intervals, and calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.statistics.wilson import wilson_interval

BINS = 10


@dataclass(frozen=True)
class Share:
    """How many of how many.

    Args:
        count: number that have it.
        total: number of all.
    """

    count: int
    total: int

    @property
    def value(self) -> float | None:
        """The share; None of none."""
        return self.count / self.total if self.total else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval of 95 %, as shares; 0 to 1 of none."""
        return wilson_interval(self.count, self.total) if self.total else (0.0, 1.0)

    def to_json_dict(self) -> dict[str, Any]:
        """Count, total, share and interval."""
        return {
            "count": self.count,
            "total": self.total,
            "share": self.value,
            "wilson_95": list(self.interval),
        }


def share_of(flags: Sequence[bool]) -> Share:
    """How many are true."""
    return Share(sum(map(bool, flags)), len(flags))


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
    right: Share


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
        mean, hits = float(p[inside].mean()), Share(int(hit[inside].sum()), int(inside.sum()))
        found.append(CalibrationBin(number / BINS, (number + 1) / BINS, mean, hits))
        error += hits.total / p.size * abs(hits.count / hits.total - mean)
    return error, tuple(found)
