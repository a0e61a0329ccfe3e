"""Campaigns whose runs differ by chance. Truth: the plan, and the nominal rig at the numbers in ``truth.json``."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.support.plans import planned
from tunnel_sim.engine.simulate import simulate_motions
from tunnel_sim.engine.virtual_campaign import run_settings, simulate_campaign, truth_document
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.between_runs import SCATTERED, WIDEST_SCATTER, Repeatability, Scatter, along
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, EffectSetting, SensorModel

WIDE = Scatter(0.02, 0.01, 0.1, 0.003, spring_stiffness_drift=-0.02, wind_speed_drift_between_runs=0.03)
QUIET = SensorModel(noise_std=0.0, resolution=0.0, zero=0.001)
PLAN = """
name = "scatter"
seed = 4
springs = [5, 8]
wind_speeds = [0.0, 15.0]
release_angles_deg = [20.0]
duration = 0.5
truth = { cn_beta = 0.5, cn_r = -0.11, yaw_inertia = 0.098, mechanical_damping = 0.02 }
"""
DRIVE = """
[drive]
kind = "sine"
frequency_hz = 2.0
amplitudes_rad = [0.1]
"""
TABLES = """
[scatter]
wind_speed = 0.003
zero = 0.002
wind_speed_drift_between_runs = -0.01
[repeatability]
wind_speed = 0.003
mechanical_damping = 0.01
"""


@pytest.fixture
def plan(tmp_path) -> CampaignPlan:
    return planned(tmp_path, PLAN)


def readings(plan: CampaignPlan) -> np.ndarray:
    return np.array([run.record.yaw_rad for run in simulate_campaign(plan, nthread=1).runs])


@pytest.mark.parametrize("drive", ["", DRIVE], ids=["free", "driven"])
def test_every_run_moves_as_the_rig_with_its_own_numbers(tmp_path, drive: str) -> None:
    plan = replace(planned(tmp_path, PLAN, drive), scatter=WIDE, sensor=QUIET)
    true = []
    truth = truth_document(plan)
    for condition in plan.conditions:
        own = truth["runs"][condition.id]
        changed = replace(
            condition,
            wind_speed=condition.wind_speed * (1.0 + own["wind_speed"]),
            spring_stiffness=condition.spring_stiffness * (1.0 + own["spring_stiffness"]),
        )
        damping = plan.truth.mechanical_damping * (1.0 + own["mechanical_damping"])
        settings = run_settings(replace(plan.truth, mechanical_damping=damping), changed, sample_rate=1000.0)
        if settings.drive is not None:
            settings = replace(settings, drive=replace(settings.drive, scale=settings.spring_stiffness))
        true.append(settings)
    zeros = [QUIET.zero + truth["runs"][condition.id]["zero"] for condition in plan.conditions]
    motions = simulate_motions(load_rig(), true, 1000.0, nthread=1)
    expected = np.array([motion.angle + zero for motion, zero in zip(motions, zeros, strict=True)])
    np.testing.assert_allclose(readings(plan), expected, rtol=0.0, atol=1e-12)
    repeating = readings(replace(plan, scatter=Scatter()))
    assert np.all(np.max(np.abs(expected - repeating), axis=1) > 1e-4)


def test_the_labels_stay_as_stated(plan: CampaignPlan) -> None:
    scattered, repeating = (simulate_campaign(one, nthread=1) for one in (replace(plan, scatter=WIDE), plan))
    assert [replace(run, record=None) for run in scattered.runs] == [
        replace(run, record=None) for run in repeating.runs
    ]
    assert scattered.repeatability is None


def test_scatter_leaves_all_other_draws(plan: CampaignPlan) -> None:
    """Noise, hum and turbulence: a zero of its own is all that differs."""
    fine = replace(
        plan,
        sensor=SensorModel(resolution=0.0),
        effects=(
            EffectSetting("buffeting", {"intensity": 0.02}),
            EffectSetting("mains_hum", {"amplitude": 0.003}),
        ),
    )
    zeros = replace(fine, scatter=Scatter(zero=0.003))
    own = np.array([run["zero"] for run in truth_document(zeros)["runs"].values()])
    np.testing.assert_allclose(
        readings(zeros) - readings(fine), np.tile(own, (500, 1)).T, rtol=0.0, atol=1e-12
    )
    assert np.min(np.abs(np.diff(own))) > 1e-5


def test_a_wider_scatter_draws_the_same_runs(plan: CampaignPlan) -> None:
    one, other = (truth_document(replace(plan, scatter=Scatter(wind_speed=w)))["runs"] for w in (0.001, 0.01))
    for name, run in one.items():
        assert set(run) == {"wind_speed"}
        assert other[name]["wind_speed"] == pytest.approx(10.0 * run["wind_speed"], rel=1e-12)


def test_an_effect_and_the_table_are_told_alike(plan: CampaignPlan) -> None:
    effect = EffectSetting("damping_scatter", {"spread": 0.05})
    truth = truth_document(replace(plan, effects=(effect,), scatter=Scatter(wind_speed=0.01)))
    assert (truth["effects"], truth["parameters"]) == ([], {})
    assert truth["scatter"] == {"wind_speed": 0.01, "mechanical_damping": 0.05}
    assert all(set(run) == {"wind_speed", "mechanical_damping"} for run in truth["runs"].values())
    json.dumps(truth, allow_nan=False)


def test_an_effect_drifts_with_the_table(plan: CampaignPlan) -> None:
    effect = EffectSetting("stiffness_scatter", {"spread": 0.01})
    drift = Scatter(spring_stiffness_drift=0.1)
    alone, both = (
        truth_document(replace(plan, effects=(effect,), scatter=s))["runs"] for s in (Scatter(), drift)
    )
    for share, one, two in zip(along(4), alone.values(), both.values(), strict=True):
        expected = (1.0 + one["spring_stiffness"]) * (1.0 + 0.1 * share) - 1.0
        assert two["spring_stiffness"] == pytest.approx(expected, abs=1e-15)


def test_what_repeats_tells_nothing_of_scatter(plan: CampaignPlan) -> None:
    null = EffectSetting("damping_scatter", {"spread": 0.0})
    assert {"scatter", "runs"} & truth_document(replace(plan, effects=(null,))).keys() == set()


def test_the_same_number_scatters_once(plan: CampaignPlan) -> None:
    twice = replace(
        plan,
        effects=(EffectSetting("wind_speed_scatter", {"spread": 0.01}),),
        scatter=Scatter(wind_speed=0.01),
    )
    with pytest.raises(TunnelError, match=r"wind_speed scatters twice, .* in \[scatter\]; give one of them"):
        simulate_campaign(twice)


def test_deviations_are_normal_and_drift_along_the_runs() -> None:
    """Truth: their moments, within five standard errors; the drift exactly."""
    count = 4000

    def rng() -> np.random.Generator:
        return np.random.default_rng(3)

    wide = Scatter(0.003, 0.0005, 0.01, 0.002)
    found = wide.deviations(rng(), along(count))
    assert wide.deviations(rng(), along(5)) == found[:5]
    for name, width in zip((*SCATTERED, "zero"), (0.003, 0.0005, 0.01, 0.002), strict=True):
        values = np.array([run[name] for run in found]) / width
        assert abs(np.mean(values)) < 5.0 / np.sqrt(count)
        assert abs(np.mean(values**2) - 1.0) < 5.0 * np.sqrt(2.0 / count)
    drift = Scatter(spring_stiffness_drift=-0.01).deviations(rng(), along(count))
    assert drift[0] == {"spring_stiffness": 0.0}
    assert drift[-1] == {"spring_stiffness": -0.01}
    assert Scatter().deviations(rng(), along(count)) == [{}] * count
    assert along(1).tolist() == [0.0]


def test_a_plan_states_both_tables(tmp_path) -> None:
    plan = planned(tmp_path, PLAN, TABLES)
    assert plan.scatter == Scatter(wind_speed=0.003, zero=0.002, wind_speed_drift_between_runs=-0.01)
    assert plan.repeatability == Repeatability(wind_speed=0.003, mechanical_damping=0.01)
    assert simulate_campaign(plan, nthread=1).repeatability == plan.repeatability


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("wind_sped = 0.01", "unknown key 'wind_sped'; did you mean 'wind_speed'"),
        ("wind_speed = 0.5", "give wind_speed as a relative standard deviation from 0 to 0.2"),
        ("mechanical_damping = -0.1", "give mechanical_damping as a relative standard deviation"),
        (
            "spring_stiffness_drift = 0.6",
            "give spring_stiffness_drift as the relative change from the first to",
        ),
        ("zero = nan", "give zero as a standard deviation from 0 to 1 rad"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path, line: str, said: str) -> None:
    with pytest.raises(TunnelError) as refusal:
        planned(tmp_path, PLAN, f"[scatter]\n{line}\n")
    assert said in str(refusal.value)
    assert "plan.toml, [scatter]: " in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "given",
    [
        {"wind_speed": 2.0 * WIDEST_SCATTER},
        {"spring_stiffness": True},
        {"zero": np.inf},
        {"mechanical_damping": "0.1"},
        {"wind_speed_drift_between_runs": -0.51},
    ],
)
def test_bad_widths_are_refused(given: dict) -> None:
    with pytest.raises(
        TunnelError, match=rf"scatter: {next(iter(given))} = .* is out of range; give a number from"
    ):
        Scatter(**given)
