"""Driven runs from a plan to an estimate. The truth is that of the plan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification import identify
from tests.support.plans import planned
from tunnel_sim.engine.virtual_campaign import plan_effects, simulate_campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, EffectSetting

PLAN = """
name = "driven"
seed = 3
springs = [5, 8]
wind_speeds = [0.0, 15.0]
duration = 12.0
truth = { cn_beta = 0.495, cn_r = -0.114 }
sensor.sample_rate = 100.0
[drive]
"""
MOMENT, ROOT = "amplitudes_nm = [0.3]", "amplitudes_rad = [0.03]"
BAND = "from_hz = 0.5\nto_hz = 5.0\n"
MULTISINE = f'{PLAN.replace("12.0", "8.0")}kind = "multisine"\n{BAND}amplitudes_nm = [0.2, 0.8]\n'


def with_effect(plan: CampaignPlan, name: str, **parameters: float) -> CampaignPlan:
    return replace(plan, effects=(EffectSetting(name, parameters),))


@pytest.mark.parametrize(
    "drive",
    [
        f'kind = "multisine"\n{BAND}{MOMENT}',
        f'kind = "multisine"\nseed = 1\n{BAND}{ROOT}\nhold = "zero"',
        f'kind = "random"\n{BAND}{MOMENT}\nhold = "zero"',
        f'kind = "chirp"\n{BAND}{ROOT}',
        f'kind = "stepped_sine"\nfrequencies_hz = [1.5, 2.0, 3.0]\n{MOMENT}',
        f'kind = "sine"\nfrequency_hz = 2.2\n{ROOT}',
        f'kind = "square"\nfrequency_hz = 0.7\nhold = "zero"\n{MOMENT}',
    ],
)
def test_the_chosen_coefficients_are_found(tmp_path: Path, drive: str) -> None:
    plan = planned(tmp_path, PLAN + drive)
    found = identify(simulate_campaign(plan))
    for name in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping"):
        quantity = getattr(found, name)
        # 28 values, three of four independent: one beyond 4.5 in four thousand suites
        assert abs(quantity.value - getattr(plan.truth, name)) < 4.5 * quantity.std, name


def test_a_wrong_hold_is_seen(tmp_path: Path) -> None:
    campaign = simulate_campaign(planned(tmp_path, f'{PLAN}kind = "random"\n{BAND}{MOMENT}\nhold = "zero"'))
    linear = tuple(replace(r, drive=replace(r.drive, hold="linear")) for r in campaign.runs if r.drive)
    found, wrong = identify(campaign), identify(replace(campaign, runs=linear))
    assert found.noise is not None
    assert wrong.noise is not None
    assert (found.noise.departs, wrong.noise.departs) == (False, True)


def test_the_root_pulls_with_the_true_spring(tmp_path: Path) -> None:
    plan = planned(tmp_path, f'{PLAN}kind = "chirp"\n{BAND}{ROOT}')
    stated = replace(plan, conditions=plan.conditions[:1])
    spring = stated.conditions[0].spring_stiffness
    wrong = with_effect(stated, "spring_miscalibration", error=0.2, spring_stiffness=spring)
    stiffer = replace(stated, conditions=(replace(stated.conditions[0], spring_stiffness=1.2 * spring),))
    found, expected = (simulate_campaign(p).runs[0].record.yaw_rad for p in (wrong, stiffer))
    assert np.max(np.abs(found - expected)) <= 1.01 * plan.sensor.resolution


def test_effects_without_a_meaning_for_the_drive_are_refused(tmp_path: Path) -> None:
    rooted = planned(tmp_path, f'{PLAN}kind = "chirp"\n{BAND}{ROOT}')
    with pytest.raises(TunnelError, match=r"a loss in the spring.*drive the body by amplitudes_nm"):
        plan_effects(with_effect(rooted, "structural_damping", loss_factor=0.01))
    assert plan_effects(with_effect(planned(tmp_path, MULTISINE), "structural_damping", loss_factor=0.01))
