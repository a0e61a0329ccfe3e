"""Widths of scatter: their intervals hold, and runs that repeat show none, at the stated rates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import chdtri
from scipy.stats import binom

from identification.campaign.random_effects import (
    RunProducts,
    UsualWidths,
    likeliest_widths,
    marginal,
    width_quantiles,
)

NAMES = ("spring_stiffness", "mechanical_damping")
WIDTHS = np.array([1.5e-3, 3e-2])  # three times the usual ones: the prior's median is not the truth
SENSITIVITY = np.array(
    [2e5, 3e3]
)  # noise standard deviations per unit: widths are thirty to a hundred of them
RUNS, ROWS, TRIALS = 12, 8, 120
PRIOR = UsualWidths().prior(NAMES, {})


def products(rng: np.random.Generator, widths: np.ndarray) -> RunProducts:
    """Runs in closed form: two numbers deviate, and two common parameters are fitted."""
    own, common, seen = [], [], []
    for _ in range(RUNS):
        basis = np.linalg.qr(rng.normal(size=(ROWS, 2)))[0]
        columns = basis * SENSITIVITY
        shared = columns @ rng.normal(size=(2, 2)) * 1e-3
        deviations = widths * rng.standard_normal(2)
        own.append(columns)
        common.append(shared)
        seen.append(columns @ deviations + shared @ np.array([1.0, -2.0]) + rng.standard_normal(ROWS))
    return RunProducts.of(own, common, seen)


@pytest.fixture(scope="module")
def quantiles() -> np.ndarray:
    """Of both widths in every trial, shape (trials, levels, 2)."""
    rng = np.random.default_rng(20261126)
    return np.array([width_quantiles(products(rng, WIDTHS), PRIOR, (0.05, 0.5, 0.95)) for _ in range(TRIALS)])


@pytest.mark.parametrize("place", [0, 1])
def test_nine_of_ten_intervals_hold_the_width(quantiles: np.ndarray, place: int) -> None:
    low, _, high = quantiles[:, :, place].T
    inside = int(np.sum((low < WIDTHS[place]) & (WIDTHS[place] < high)))
    assert inside >= binom.ppf(1e-3, TRIALS, 0.9)


def test_intervals_of_half_the_width_would_not_hold(quantiles: np.ndarray) -> None:
    low, middle, high = quantiles[:, :, 0].T
    inside = int(np.sum((np.sqrt(low * middle) < WIDTHS[0]) & (WIDTHS[0] < np.sqrt(middle * high))))
    assert inside < binom.ppf(5e-4, TRIALS, 0.9)


def test_runs_that_repeat_show_no_scatter_at_the_stated_rate() -> None:
    rng, rate, shown = np.random.default_rng(7), 0.01, 0
    for _ in range(TRIALS):
        runs = products(rng, np.zeros(2))
        widths = likeliest_widths(runs, PRIOR)
        gain = marginal(runs, PRIOR.least).restricted - marginal(runs, widths).restricted
        shown += gain > chdtri(2.0, rate)
    assert shown <= binom.ppf(1.0 - 1e-3, TRIALS, rate)


def test_the_slope_is_that_of_the_restricted_likelihood() -> None:
    runs, widths, step = products(np.random.default_rng(3), WIDTHS), 1.7 * WIDTHS, 1e-5
    slope = marginal(runs, widths).slope
    for place in range(2):
        moved = [widths * np.exp(sign * step * (np.arange(2) == place)) for sign in (1.0, -1.0)]
        up, down = (marginal(runs, one).restricted for one in moved)
        assert slope[place] == pytest.approx((up - down) / (2.0 * step), rel=1e-4)
