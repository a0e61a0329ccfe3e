"""An inertia that differs from spring to spring. Truth: MuJoCo campaigns with chosen differences."""

from __future__ import annotations

from itertools import product
from math import radians

import pytest

from diagnosis import diagnose
from tests.marks import slow
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.effects.parameters import Circumstances
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth

pytestmark = pytest.mark.usefixtures("unexamined")
NAMES = ("inertia_by_spring", "spring_miscalibration", "rod_flexibility", "gravity_stiffness")
KINDS = [effect_class(name) for name in NAMES]
TRUTH = Truth(0.47, -0.12, 0.1014, 0.018)
SPRINGS = (16.12, 30.5, 44.84)


def campaign(springs, speeds, name="inertia_by_spring", **values):
    conditions = tuple(
        Condition(f"s{spring:g}-v{speed:g}", spring, speed, 1.204, radians(12.0), 10.0)
        for spring, speed in product(springs, speeds)
    )
    effects = (EffectSetting(name, values),)
    plan = CampaignPlan("adapters", 3, TRUTH, conditions, SensorModel(sample_rate=250.0), effects=effects)
    return simulate_campaign(plan)


def adapters(springs, speeds):
    """The inertia with the softest spring −0.3 %, with the last +0.4 %, of the others'."""
    return campaign(
        springs, speeds, first=-0.003, first_spring=springs[0], second=0.004, second_spring=springs[-1]
    )


def test_two_wind_speeds_tell_it_from_wrong_springs_with_every_difference():
    found = diagnose(adapters(SPRINGS, (0.0, 20.0)), kinds=KINDS)
    assert found.causes == ("inertia_by_spring",)
    given = found.candidates[0].parameters
    numbers = {given[f"{which}_spring"].value: given[which] for which in ("first", "second")}
    # relative to the spring that is not named
    known = {16.12: -0.003, 30.5: 0.0, 44.84: 0.004}
    (reference,) = set(known) - set(numbers)
    for spring, number in numbers.items():
        truth = (1.0 + known[spring]) / (1.0 + known[reference]) - 1.0
        assert abs(number.value - truth) < 4.0 * number.std
    after = found.coefficients.after["cn_beta"]
    assert abs(after.value - TRUTH.cn_beta) < 4.0 * after.std
    assert not any("inertia that differs" in one for one in found.blind_spots)


@pytest.mark.parametrize("name", ["inertia_by_spring", slow("spring_miscalibration")])
def test_still_air_does_not_tell_it_from_a_wrong_spring_and_that_is_said(name):
    values = {
        "inertia_by_spring": {"first": 0.005, "first_spring": 16.12},
        "spring_miscalibration": {"error": 0.005, "spring_stiffness": 16.12},
    }[name]
    found = diagnose(campaign((16.12, 44.84), (0.0,), name, **values), kinds=KINDS)
    assert not found.decision.decided
    likely = {effect for effect, _ in found.decision.credible}
    assert {"inertia_by_spring", "spring_miscalibration"} <= likely
    assert any("inertia that differs" in one for one in found.blind_spots)


def test_a_wrong_spring_of_three_is_named_in_two_winds():
    given = campaign(SPRINGS, (0.0, 20.0), "spring_miscalibration", error=0.005, spring_stiffness=30.5)
    assert diagnose(given, kinds=KINDS).causes == ("spring_miscalibration",)


@pytest.mark.parametrize("springs", [(), (16.12,), (12.0, 16.0, 20.0, 24.0, 28.0, 32.0)])
def test_one_spring_cannot_show_it_and_more_than_five_are_not_tried(springs):
    assert effect_class("inertia_by_spring").trials(Circumstances(springs, 0.3, False, ())) == ()


def test_a_spring_that_no_run_has_is_refused():
    with pytest.raises(TunnelError, match="no run has a spring_stiffness of 20"):
        campaign((16.12,), (0.0,), first=0.01, first_spring=20.0)


def test_its_size_is_said_spring_by_spring():
    kind = effect_class("inertia_by_spring")
    values = {"first": 0.004, "first_spring": 16.12, "second": -0.003, "second_spring": 44.84}
    text = lambda value, _std, unit: f"{value:.2f} {unit}"  # noqa: E731
    said = kind.phrase(values, dict.fromkeys(values), text)
    assert said == "an inertia that differs by spring: 0.40 % with 16.12 N m/rad, -0.30 % with 44.84 N m/rad"
    assert not effect_from("inertia_by_spring", {"second": 0.1, "second_spring": 16.12}).is_null
