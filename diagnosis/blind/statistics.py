"""Shares with intervals, and calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

_Z = 1.959963984540054
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
        """Wilson's interval of 95 % (E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209–212)."""
        if self.total == 0:
            return 0.0, 1.0
        n, p = self.total, self.count / self.total
        centre = (p + _Z**2 / (2 * n)) / (1 + _Z**2 / n)
        half = _Z / (1 + _Z**2 / n) * math.sqrt(p * (1 - p) / n + _Z**2 / (4 * n**2))
        return max(0.0, centre - half), min(1.0, centre + half)

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
