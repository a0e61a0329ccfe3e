"""Patterns in the differences between runs. Truth: the deviations with which the runs are drawn."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import binom

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.search.patterns import Trend, has_a_cause, trends
from diagnosis.search.scatter import usual, with_deviations
from tests.support.gap_campaigns import campaign, nominal
from tunnel_sim.effects import effect_class

CONDITIONS = tuple((spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 15.0, 25.0)) * 2
RUNS = len(CONDITIONS)
SPRING = "stiffness_scatter"
RATE = 0.05
"""Rate of the test in the draws; at the usual 0.001 they would show nothing."""


@cache
def base(conditions: tuple[tuple[float, float], ...] = CONDITIONS) -> Fit:
    """Runs that repeat, fitted with the spring and the damper of each run."""
    fitted = nominal(campaign(conditions=conditions, duration=6.0))
    kinds = [effect_class(name) for name in (SPRING, "damping_scatter")]
    return fit(*with_deviations(fitted.problem, fitted.point, tuple(usual(fitted, one) for one in kinds)))


def with_springs(
    deviations: np.ndarray, rng: np.random.Generator, *, rate: float = 0.001, fitted: Fit | None = None
) -> Fit:
    """The runs by linear theory, with given relative deviations of their springs and noise of unit variance."""
    fitted = fitted or base()
    place = fitted.problem.parameters.places(fitted.problem.scatter)[0]
    residuals = [
        rng.standard_normal(old.size) + own[:, place] * deviation
        for old, (_, own), deviation in zip(fitted.residuals, fitted.jacobian, deviations, strict=True)
    ]
    data, settings = fitted.problem.data, fitted.settings
    scatter = replace(settings.scatter, trend_rate=rate)
    problem = replace(fitted.problem, data=replace(data, settings=replace(settings, scatter=scatter)))
    point = replace(fitted.point, per_run=np.zeros_like(fitted.point.per_run))
    return replace(fitted, problem=problem, point=point, residuals=residuals)


def the_trend(deviations: np.ndarray) -> Trend:
    (trend,) = trends(with_springs(deviations, np.random.default_rng(5)))
    assert trend.effect == SPRING
    return trend


@pytest.mark.parametrize("pattern", ["order", "spring_stiffness", "wind", "groups"])
def test_a_pattern_is_named_with_its_size(pattern: str) -> None:
    springs, speeds = np.array(CONDITIONS).T
    second = np.isin(np.arange(RUNS), (1, 4, 5, 8, 9))
    values = {
        "order": np.linspace(-0.5, 0.5, RUNS),
        "spring_stiffness": np.where(springs > 20.0, 0.5, -0.5),
        "wind": np.where(speeds > 0.0, 0.5, -0.5),
        "groups": np.where(second, 0.5, -0.5),
    }[pattern]
    by_chance = np.random.default_rng(6).normal(0.0, 2e-5, RUNS)
    trend = the_trend(3e-3 * values + by_chance)
    assert trend.along == pattern
    assert trend.change == pytest.approx(3e-3, abs=4.0 * trend.std)
    assert trend.std < 1e-4
    assert trend.of_condition == (pattern in ("spring_stiffness", "wind"))
    named = [f"r{number + 1}" for number in np.flatnonzero(second)]
    assert list(trend.runs) == (named if pattern == "groups" else [])


def test_the_smaller_group_is_named_with_its_sign() -> None:
    values = np.where(np.isin(np.arange(RUNS), (2, 7, 9)), -2e-3, 0.0)
    trend = the_trend(values + np.random.default_rng(7).normal(0.0, 1e-5, RUNS))
    assert trend.runs == ("r3", "r8", "r10")
    assert trend.change == pytest.approx(-2e-3, abs=4.0 * trend.std)


@pytest.mark.parametrize(("share", "along"), [(0.0, "spring_stiffness"), (1.0, "order")])
def test_a_drift_is_named_only_where_no_condition_explains_it_as_well(share: float, along: str) -> None:
    """Springs that are changed in order: the difference follows the spring, or the order within each spring too."""
    springs = np.repeat((16.12, 30.0, 44.84), 3)
    rng, order = np.random.default_rng(12), np.linspace(-0.5, 0.5, springs.size)
    values = share * order + (1.0 - share) * (springs - springs.mean()) / np.ptp(springs)
    fitted = base(tuple(zip(springs.tolist(), (0.0, 15.0, 25.0) * 3, strict=True)))
    (trend,) = trends(with_springs(3e-3 * values + rng.normal(0.0, 2e-5, springs.size), rng, fitted=fitted))
    assert trend.along == along


def test_one_run_apart_is_no_group() -> None:
    values = np.where(np.arange(RUNS) == 4, 3e-3, 0.0)
    assert not trends(
        with_springs(values + np.random.default_rng(8).normal(0.0, 1e-5, RUNS), np.random.default_rng(9))
    )


def test_a_pattern_beside_scatter_has_a_cause_only_where_it_follows_a_condition() -> None:
    rng, order = np.random.default_rng(10), np.linspace(-0.5, 0.5, RUNS)
    speeds = np.array(CONDITIONS)[:, 1]
    chance = rng.normal(0.0, 2e-4, RUNS)
    assert not has_a_cause(with_springs(chance, rng))
    assert not has_a_cause(with_springs(5e-3 * order + chance, rng))
    assert has_a_cause(with_springs(5e-3 * order, rng))
    assert has_a_cause(with_springs(5e-3 * np.where(speeds > 0.0, 0.5, -0.5) + chance, rng))


@pytest.mark.slow
def test_chance_is_taken_for_a_pattern_at_the_stated_rate() -> None:
    """Bounds at 1 in 1,000 from both sides: too many by chance, and fewer than half the rate.

    The widths of the runs are estimated, patterns resemble each other, and two groups pay for every partition, so
    the rate is an upper limit.
    """
    draws, rng = 300, np.random.default_rng(11)
    taken = sum(bool(trends(with_springs(rng.normal(0.0, 5e-4, RUNS), rng, rate=RATE))) for _ in range(draws))
    assert binom.ppf(0.001, draws, RATE / 2.0) <= taken <= binom.ppf(0.999, draws, RATE)
