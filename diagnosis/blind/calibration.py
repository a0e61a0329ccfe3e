"""Calibration of stated probabilities: in bins, and the smooth error with its interval and its curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


Array = NDArray[np.float64]

_POINTS = 401
_WIDTHS = (0.005, 1.0)
_HALVINGS = 20
_RESAMPLES = 500
_LEAST_WEIGHT = 1.0  # the curve is drawn where the kernel holds at least one statement


@dataclass(frozen=True, eq=False)
class SmoothCalibration:
    """The calibration of some statements without bins (Błasiok and Nakkiran 2023, arXiv:2309.12236).

    Args:
        error: smooth calibration error, a probability.
        interval: of 95 %, by resampling campaigns at the width found.
        width: standard deviation of the kernel, the one that equals the error it gives, a probability.
        stated: probabilities of the curve, shape (points,).
        observed: share that is true there, shape (points,).
        low: lower end of its interval of 95 %, shape (points,).
        high: upper end, shape (points,).
        statements: number of statements.
        campaigns: number of campaigns.
    """

    error: float
    interval: tuple[float, float]
    width: float
    stated: Array
    observed: Array
    low: Array
    high: Array
    statements: int
    campaigns: int

    def to_json_dict(self) -> dict[str, Any]:
        """All figures but the curve."""
        return {
            "error": self.error, "interval_95": list(self.interval), "width": self.width,
            "statements": self.statements, "campaigns": self.campaigns,
        }  # fmt: skip


def smooth_calibration(groups: Sequence[tuple[Sequence[float], Sequence[bool]]]) -> SmoothCalibration | None:
    """Smooth calibration error of statements that come in groups.

    Args:
        groups: by campaign, stated probabilities and whether each is true.

    Returns:
        The calibration; None without statements.
    """
    if not groups:
        return None
    grid = np.linspace(0.0, 1.0, _POINTS)
    counts, surplus = (np.stack(column) for column in zip(*(_binned(p, y) for p, y in groups), strict=True))
    # The error falls with the width, so that exactly one width equals its error.
    low, high = _WIDTHS
    for _ in range(_HALVINGS):
        width = float(np.sqrt(low * high))
        too_narrow = _error(_kernel(grid, width), surplus.sum(axis=0), counts.sum()) > width
        low, high = (width, high) if too_narrow else (low, width)
    kernel = _kernel(grid, high)
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(len(groups), np.full(len(groups), 1.0 / len(groups)), _RESAMPLES)
    errors = [_error(kernel, w @ surplus, float((w @ counts).sum())) for w in drawn]
    weight = kernel @ counts.sum(axis=0) * high * np.sqrt(2.0 * np.pi)
    shown = weight >= _LEAST_WEIGHT
    observed = _curve(kernel, counts.sum(axis=0), surplus.sum(axis=0), grid)
    curves = np.stack([_curve(kernel, w @ counts, w @ surplus, grid) for w in drawn])
    ends = np.quantile(curves, (0.025, 0.975), axis=0)
    return SmoothCalibration(
        _error(kernel, surplus.sum(axis=0), float(counts.sum())),
        (float(np.quantile(errors, 0.025)), float(np.quantile(errors, 0.975))),
        high, grid[shown], observed[shown], ends[0][shown], ends[1][shown],
        int(counts.sum()), len(groups),
    )  # fmt: skip


def _binned(probabilities: Sequence[float], true: Sequence[bool]) -> tuple[Array, Array]:
    """Number of statements and sum of (truth − probability) at the nearest point of the grid."""
    p, y = np.asarray(probabilities, dtype=float), np.asarray(true, dtype=float)
    at = np.rint(p * (_POINTS - 1)).astype(int)
    counts = np.bincount(at, minlength=_POINTS).astype(float)
    return counts, np.bincount(at, weights=y - p, minlength=_POINTS).astype(float)


def _kernel(grid: Array, width: float) -> Array:
    """Gaussian density between points of the grid, reflected at 0 and 1, shape (points, points)."""
    a, b = grid[:, None], grid[None, :]
    images = (sign * b + 2.0 * shift for shift in range(-2, 3) for sign in (1.0, -1.0))
    density = sum(np.exp(-0.5 * ((a - image) / width) ** 2) for image in images)
    return np.asarray(density / (width * np.sqrt(2.0 * np.pi)))


def _error(kernel: Array, surplus: Array, number: float) -> float:
    """∫ |mean of K (truth − probability)| over the probability."""
    return float(np.trapezoid(np.abs(kernel @ surplus), dx=1.0 / (_POINTS - 1)) / number)


def _curve(kernel: Array, counts: Array, surplus: Array, grid: Array) -> Array:
    """Share that is true by kernel regression: the probability plus the mean surplus there."""
    return np.clip(grid + kernel @ surplus / np.maximum(kernel @ counts, 1e-300), 0.0, 1.0)
