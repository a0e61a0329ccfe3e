"""A coefficient that depends on the speed. Truth: MuJoCo campaigns with chosen k, and the definition."""

from __future__ import annotations

from itertools import product
from math import log, radians

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.search.investigate import investigate
from tests.support.acting import acting
from tests.support.gap_campaigns import nominal
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.effects.parameters import Circumstances, WindOnRun
from tunnel_sim.engine.virtual_campaign import plan_effects, run_settings, simulate_campaign
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth

pytestmark = pytest.mark.usefixtures("unexamined", "causes_alone")
KINDS = [
    effect_class(name)
    for name in ("reynolds_dependence", "wind_speed_offset", "wind_speed_drift", "gravity_stiffness")
]
TRUTH = Truth(0.47, -0.12, 0.1014, 0.018)


def plan(speeds, name="reynolds_dependence", **values):
    conditions = tuple(
        Condition(f"s{spring:g}-v{speed:g}", spring, speed, 1.204, radians(12.0), 7.0)
        for spring, speed in product((16.12, 44.84), speeds)
    )
    effects = (EffectSetting(name, values),) if values else ()
    return CampaignPlan("speeds", 3, TRUTH, conditions, SensorModel(sample_rate=250.0), effects=effects)


def test_three_speeds_name_it_with_its_size_and_with_cn_beta_at_the_mean_speed():
    found = diagnose(
        simulate_campaign(plan((0.0, 12.0, 18.0, 25.0), per_e_fold=0.05)), kinds=KINDS, rivals=()
    )
    assert found.causes == ("reynolds_dependence",)
    size = found.candidates[0].parameters["per_e_fold"]
    assert abs(size.value - 0.05) < 4.0 * size.std
    after = found.coefficients.after["cn_beta"]
    assert abs(after.value - TRUTH.cn_beta) < 4.0 * after.std


@pytest.mark.slow
def test_three_speeds_tell_it_from_an_offset_of_the_speed():
    data = simulate_campaign(plan((0.0, 12.0, 18.0, 25.0), "wind_speed_offset", offset=0.3))
    assert investigate(data, KINDS, rivals=()).causes == ("wind_speed_offset",)


def test_two_speeds_are_said_to_tell_them_apart_by_the_damping_alone():
    data = nominal(simulate_campaign(plan((0.0, 15.0, 25.0)))).problem.data
    (said,) = [one for one in data.model.blind_spots(data) if "two wind speeds" in one]
    assert "offset as opposed to a dependence" in said


def test_the_mean_is_over_the_runs_with_the_wind_on():
    campaign = plan((0.0, 10.0, 30.0), per_e_fold=0.5)
    (effect,) = plan_effects(campaign)
    for condition in campaign.conditions:
        stated = run_settings(TRUTH, condition, mean_speed=20.0)
        seen = acting(effect, stated).derivatives
        speed = condition.wind_speed
        factor = 1.0 + 0.5 * log(speed / 20.0) if speed else 1.0
        assert seen.cn_beta == pytest.approx(factor * TRUTH.cn_beta, rel=1e-15)
        assert seen.cn_r == TRUTH.cn_r


@pytest.mark.parametrize("speeds", [(), (20.0,)])
def test_one_speed_cannot_show_it(speeds):
    assert (
        effect_from("reynolds_dependence", {"per_e_fold": 0.1}).trials(
            Circumstances((16.12,), 0.3, False, speeds)
        )
        == ()
    )


@pytest.mark.parametrize("rate", [0.3, -0.3])
def test_the_form_between_two_speeds_counts_in_the_coefficient_at_the_mean(rate):
    """Closed form: a line through a power law at x1 and x2 misses it at 0 by k² |x1 x2|/2 to second order."""
    speeds = np.array([15.0, 25.0])
    runs = [WindOnRun(16.0, 12.0, 13.0, 0.0135 * speed**2, 0.0085 * speed) for speed in speeds]
    of_beta, of_r = effect_from("reynolds_dependence", {"per_e_fold": rate}).unseen_form(0.47, runs)
    first, second = np.log(speeds / 20.0)
    assert of_beta == pytest.approx(0.47 * 0.5 * rate**2 * abs(first * second) / np.sqrt(3.0), rel=0.1)
    assert of_r == 0.0


def test_one_run_has_no_form_between_speeds():
    run = WindOnRun(16.0, 12.0, 13.0, 5.4, 0.17)
    assert effect_from("reynolds_dependence", {"per_e_fold": 0.3}).unseen_form(0.47, [run]) == (0.0, 0.0)
