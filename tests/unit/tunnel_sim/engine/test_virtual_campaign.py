"""From a plan with effects to a campaign and its truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.plans import planned
from tunnel_sim.engine.virtual_campaign import plan_effects, simulate_campaign, truth_document
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, EffectSetting

PLAN = """
name = "two-effects"
seed = 4
springs = [5, 8]
wind_speeds = [0.0, 15.0]
release_angles_deg = [20.0]
duration = 0.5
truth = { cn_beta = 0.5, cn_r = -0.11, yaw_inertia = 0.098, mechanical_damping = 0.02 }
sensor = { zero = 0.002, noise_std = 0.0004 }

[[effects]]
name = "mains_hum"
parameters = { amplitude = 0.003 }

[[effects]]
name = "coulomb_friction"
parameters = { friction_moment = 0.05 }
"""


@pytest.fixture
def plan(tmp_path: Path) -> CampaignPlan:
    return planned(tmp_path, PLAN)


def same(one: Campaign, other: Campaign) -> bool:
    return all(
        a.id == b.id and np.array_equal(a.record.yaw_rad, b.record.yaw_rad)
        for a, b in zip(one.runs, other.runs, strict=True)
    )


def with_effects(plan: CampaignPlan, *effects: tuple[str, dict[str, float]]) -> CampaignPlan:
    return replace(plan, effects=tuple(EffectSetting(name, values) for name, values in effects))


def test_the_campaign_states_the_rig_not_the_truth(plan: CampaignPlan) -> None:
    campaign = simulate_campaign(plan, nthread=1)
    assert [run.id for run in campaign.runs] == [condition.id for condition in plan.conditions]
    assert campaign.rig.yaw_inertia == load_rig().dynamics.yaw_inertia != plan.truth.yaw_inertia
    assert campaign.sensor.noise_std == 0.0004
    for run, condition in zip(campaign.runs, plan.conditions, strict=True):
        assert run.spring_stiffness == condition.spring_stiffness
        assert run.wind_speed == condition.wind_speed
        assert (run.air_density is None) == (condition.wind_speed == 0.0)
        assert run.record.time_s.size == 500


def test_the_same_plan_gives_the_same_bits_at_any_thread_count(plan: CampaignPlan) -> None:
    assert same(simulate_campaign(plan, nthread=1), simulate_campaign(plan, nthread=2))
    assert not same(simulate_campaign(plan), simulate_campaign(replace(plan, seed=5)))


def test_effects_act_and_their_order_in_the_plan_does_not_matter(plan: CampaignPlan) -> None:
    campaign = simulate_campaign(plan)
    assert same(campaign, simulate_campaign(replace(plan, effects=plan.effects[::-1])))
    for fewer in (plan.effects[:1], plan.effects[1:], ()):
        assert not same(campaign, simulate_campaign(replace(plan, effects=fewer)))
    nulls = with_effects(
        plan, ("coulomb_friction", {"friction_moment": 0.0}), ("mains_hum", {"amplitude": 0.0})
    )
    assert same(simulate_campaign(nulls), simulate_campaign(replace(plan, effects=())))


def test_backlash_acts_ahead_of_the_sensors_own_effects(plan: CampaignPlan) -> None:
    stated = with_effects(
        plan,
        ("sensor_nonlinearity", {"coefficient": 0.1}),
        ("coulomb_friction", {"friction_moment": 0.05}),
        ("sensor_hysteresis", {"half_width": 0.002}),
        ("sensor_clipping", {"limit": 0.3}),
    )
    names = [effect.name for effect in plan_effects(stated)]
    assert names == ["sensor_hysteresis", "coulomb_friction", "sensor_nonlinearity", "sensor_clipping"]


def test_the_truth_holds_what_was_injected(plan: CampaignPlan) -> None:
    truth = json.loads(json.dumps(truth_document(plan), allow_nan=False))
    assert {key: truth[key] for key in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")} == {
        "cn_beta": 0.5, "cn_r": -0.11, "yaw_inertia": 0.098, "mechanical_damping": 0.02,
    }  # fmt: skip
    assert (truth["noise_std"], truth["sensor_zero"], truth["seed"]) == (0.0004, 0.002, 4)
    assert truth["effects"] == ["coulomb_friction", "mains_hum"]
    assert truth["parameters"] == {
        "coulomb_friction": {
            "friction_moment": 0.05, "presliding": 0.0,
            "exponent": 0.0, "saturation": 0.0, "peak": 0.0, "peak_rate": 0.2, "load": 0.0,
        },
        "mains_hum": {"amplitude": 0.003, "frequency": 50.0},
    }  # fmt: skip
    assert set(truth["versions"]) == {"mujoco", "numpy"}


def test_an_effect_at_its_null_is_no_truth(plan: CampaignPlan) -> None:
    truth = truth_document(with_effects(plan, ("coulomb_friction", {"friction_moment": 0.0})))
    assert truth["effects"] == []
    assert truth["parameters"] == {}


def test_the_written_campaign_does_not_betray_its_effects(plan: CampaignPlan, tmp_path: Path) -> None:
    long = tuple(replace(condition, duration=2.5) for condition in plan.conditions)  # three cycles
    campaign = simulate_campaign(replace(plan, conditions=long))
    folder = write_campaign(campaign, tmp_path / "c", truth=truth_document(plan))
    assert same(read_campaign(folder), campaign)
    assert "friction" not in (folder / "campaign.toml").read_text(encoding="utf-8")
    assert json.loads((folder / "truth.json").read_text(encoding="utf-8"))["effects"]


@pytest.mark.parametrize(
    ("effects", "parts"),
    [
        ([("coulomb_fricton", {})], ["did you mean 'coulomb_friction'?"]),
        ([("coulomb_friction", {"friction_momen": 0.1})], ["did you mean 'friction_moment'?"]),
        ([("coulomb_friction", {"friction_moment": -0.1})], ["-0.1 is out of range", "N m"]),
        ([("coulomb_friction", {})], ["friction_moment is missing", "N m"]),
        (
            [("free_play", {"half_width": 0.01}), ("free_play", {"half_width": 0.02})],
            ["free_play", "given twice"],
        ),
        (
            [("spring_miscalibration", {"error": 0.1, "spring_stiffness": 16.0})],
            ["no run has a spring_stiffness of 16", "16.12, 44.84"],
        ),
    ],
)
def test_effects_that_cannot_be_meant_are_refused_in_one_line(
    plan: CampaignPlan, effects: list[tuple[str, dict[str, float]]], parts: list[str]
) -> None:
    for refused in (plan_effects, simulate_campaign, truth_document):
        with pytest.raises(TunnelError) as refusal:
            refused(with_effects(plan, *effects))
        assert "\n" not in str(refusal.value)
        for part in parts:
            assert part in str(refusal.value)


def test_one_spring_is_miscalibrated_and_the_others_are_not(plan: CampaignPlan) -> None:
    nominal = simulate_campaign(replace(plan, effects=()))
    wrong = simulate_campaign(
        with_effects(plan, ("spring_miscalibration", {"error": 0.1, "spring_stiffness": 16.12}))
    )
    for one, other in zip(nominal.runs, wrong.runs, strict=True):
        equal = np.array_equal(one.record.yaw_rad, other.record.yaw_rad)
        assert equal == (one.spring_stiffness != 16.12)
        assert other.spring_stiffness == one.spring_stiffness  # as stated
