"""What stands at a bound says so and carries no standard deviation; a hum's frequency carries its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from diagnosis.noise.mains import refine_frequency, remove_hum
from diagnosis.settings import Settings
from identification.show.numbers import estimated
from identification.show.quantity import Quantity
from tests.support.gap_campaigns import INTERVAL, NOISE, campaign, nominal
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.record import Record


def _at(value: float) -> Fit:
    fit = nominal(campaign())
    problem = Problem(fit.problem.data, (effect_class("coulomb_friction"),))
    point = Point(np.append(fit.point.common, value), fit.point.per_run)
    return replace(fit, problem=problem, point=point)


def test_a_parameter_at_the_end_of_its_range_says_so():
    name = "coulomb_friction.friction_moment"
    lower, upper = (limits[-1] for limits in _at(0.0).problem.bounds)
    assert _at(lower).bound(name) == "lower"
    assert _at(upper).bound(name) == "upper"
    assert _at(0.5 * (lower + upper)).bound(name) is None


def test_a_bound_is_shown_and_written_without_a_deviation():
    data = Quantity(0.5, None, "N m", bound="upper").to_json_dict()
    assert data == {"value": 0.5, "std": None, "unit": "N m", "bound": "upper"}
    assert estimated(Quantity(0.5, None, "N m", bound="upper"), "N m") == "0.5000 N m (at its upper bound)"


def test_the_frequency_of_a_hum_scatters_as_stated():
    rng = np.random.default_rng(0)
    time = np.arange(2500) * INTERVAL
    errors, stds = [], []
    sound = campaign()
    for _ in range(12):
        runs = tuple(
            replace(
                run,
                record=Record(
                    time,
                    2e-4 * np.sin(2.0 * np.pi * 50.003 * time + rng.uniform(0.0, 6.0))
                    + NOISE * rng.standard_normal(time.size),
                ),
            )
            for run in sound.runs[:2]
        )
        humming = replace(sound, runs=runs)
        found = refine_frequency(humming, 50.0)
        errors.append(found - 50.003)
        stds.append(remove_hum(humming, found, NOISE**2, Settings().read_off)[1].frequency_std)
    ratio = float(np.std(errors)) / float(np.median(stds))
    assert ratio == pytest.approx(1.0, abs=0.7)  # 12 draws know it to a fifth; 3.5 of these


@pytest.mark.parametrize("name", ["quadratic_damping", "structural_damping"])
def test_damping_that_would_feed_the_motion_stays_at_none(name):
    """A campaign that is driven: the fit stays at the bound and says so."""
    kind = effect_class(name)
    severity = kind.parameters()[0]
    driven = kind(**{severity.name: -0.5 * severity.scale})
    base = nominal(campaign(driven))
    problem = Problem(base.problem.data, (kind,))
    start = Point(np.append(base.point.common, severity.scale), base.point.per_run)
    found = fit(problem, start)
    assert found.value(f"{name}.{severity.name}") == 0.0
    assert found.bound(f"{name}.{severity.name}") == "lower"
