"""Intervals of campaigns that scatter hold, and those of campaigns that repeat are what they are without scatter.

Campaigns are drawn in closed form; the model of the runs is not used to draw them. The planted cases are
estimators without the mechanism: they must be caught. (Output error widens by the scatter of its residuals there.)
"""

from functools import cache

import numpy as np
import pytest
from scipy.stats import binom

from identification import identify
from identification.campaign import linked_runs
from identification.estimators import ALL_ESTIMATORS
from tests.marks import slow
from tests.reference.free_decays import Setting, Truth, campaign
from tests.reference.scattering import THREE_SPRINGS, USUAL, scattering

pytestmark = pytest.mark.usefixtures("unexamined")
NAMES = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")
FALSE_ALARM = 1e-3  # of one verdict on four quantities
TRIALS = 60
SHAPE = {"noise": 5e-4, "duration": 8.0, "rate": 100.0}
FOUR = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 20.0))
SIX = tuple(Setting(spring, speed) for spring in (16.12, 21.02, 44.84) for speed in (0.0, 20.0))


@cache
def drawn(settings, scale, seed=7):
    """Campaigns that scatter by some of the usual widths; by none of them for 0."""
    rng = np.random.default_rng([seed, len(settings), round(1000 * scale)])
    widths = scale * np.array(USUAL)
    return [scattering(settings, rng, widths=widths, **SHAPE) for _ in range(TRIALS)]


def inside(campaigns, estimator):
    """Intervals of 95 % that hold the truth, by quantity, and how many there are."""
    held = []
    for data in campaigns:
        estimate = identify(data, estimator, throw=False)
        found = [(getattr(estimate, name), getattr(Truth(), name)) for name in NAMES]
        if all(quantity is not None for quantity, _ in found):
            held.append([abs(quantity.value - truth) <= 1.959964 * quantity.std for quantity, truth in found])
    return np.sum(held, axis=0), len(held)


def objections(counts, trials):
    """Quantities whose intervals hold less often than 95 % beyond chance."""
    least = binom.ppf(FALSE_ALARM / len(NAMES), trials, 0.95)
    return [
        f"{name}: {count} of {trials}" for name, count in zip(NAMES, counts, strict=True) if count < least
    ]


def without_scatter(patch):
    """Every estimator as it is where no run scatters."""
    patch.setattr(linked_runs, "scatter_between", lambda *_: None)


REFUSES = "neural_posterior"  # what is unlike its training


@pytest.mark.parametrize(
    "estimator", ["matrix_pencil", *(slow(n) for n in ALL_ESTIMATORS if n not in ("matrix_pencil", REFUSES))]
)
def test_intervals_hold_where_runs_scatter(estimator):
    counts, trials = inside(drawn(THREE_SPRINGS, 1.0), estimator)
    assert trials == TRIALS
    assert not objections(counts, trials)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("settings", [FOUR, SIX], ids=["four", "six"])
def test_intervals_hold_with_few_runs_and_other_widths(settings, scale):
    counts, trials = inside(drawn(settings, scale), "output_error")
    assert not objections(counts, trials)


@pytest.mark.parametrize("estimator", ["matrix_pencil", slow("conventional")])
def test_intervals_without_the_scatter_are_caught(estimator, monkeypatch):
    without_scatter(monkeypatch)
    assert objections(*inside(drawn(THREE_SPRINGS, 1.0)[:40], estimator))


@pytest.mark.slow
@pytest.mark.parametrize("estimator", [n for n in ALL_ESTIMATORS if n != REFUSES])
def test_runs_that_repeat_are_answered_as_without_it(estimator, monkeypatch):
    rng = np.random.default_rng(31)
    campaigns = [campaign(THREE_SPRINGS, rng=rng, **SHAPE) for _ in range(60)]
    found = [identify(data, estimator) for data in campaigns]
    scatter = sum(one.repeatability is not None for one in found)
    assert scatter <= binom.isf(FALSE_ALARM, len(found), 0.01)
    without_scatter(monkeypatch)
    same = [identify(data, estimator) == one for data, one in zip(campaigns, found, strict=True)]
    assert sum(same) == len(found) - scatter
