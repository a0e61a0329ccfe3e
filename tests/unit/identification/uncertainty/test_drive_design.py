"""Planned drives: the limits hold in the simulator, and estimates scatter as the bound says; truth by the plan."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from docs.studies.planned_drives import compare
from identification import identify
from identification.signal.forcing import driven_rows
from identification.uncertainty.cramer_rao import campaign_bound
from identification.uncertainty.drive_design import (
    Goal,
    Limits,
    peak_response,
    plan_bound,
    propose_drive,
    within_limits,
)
from tests.marks import slow
from tests.reference.free_decays import campaign
from tunnel_sim.effects import effect_class
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.plan_file import EffectTable, PlanDocument, plan_from, read_plan
from tunnel_sim.files.plan_input import InputTable
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, Truth

PLAN = """
name = "free"
seed = 1
springs = [5]
wind_speeds = [0.0, 15.0]
release_angles_deg = [15.0]
duration = 20.0
truth = { cn_beta = 0.495, cn_r = -0.114 }
sensor.sample_rate = 100.0
"""
RIG = load_rig()
LIMITS = (Limits(0.02, 1.0), Limits(5.0, 0.2))  # the moment limits, and the angle
BUFFETED = [EffectTable(name="buffeting", parameters={"intensity": 0.02})]


@pytest.fixture
def free(tmp_path: Path) -> PlanDocument:
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    return read_plan(tmp_path / "plan.toml")


def expanded(document: PlanDocument) -> CampaignPlan:
    return plan_from(document, RIG, "plan.toml")


def size(document: PlanDocument, goal: Goal) -> float:
    """What the goal makes small."""
    bound = plan_bound(expanded(document), RIG)
    if goal == "cn_r":
        return bound.std("cn_r")
    places = [bound.parameters.index(name) for name in ("cn_beta", "cn_r")]
    return float(np.linalg.det(np.array(bound.covariance)[np.ix_(places, places)])) ** 0.25


@pytest.mark.parametrize("limits", LIMITS)
def test_the_proposal_keeps_to_both_limits_and_nearly_reaches_one(free: PlanDocument, limits: Limits) -> None:
    best = propose_drive(free, RIG, limits)
    exact = free.sensor.model_copy(update={"noise_std": 0.0, "resolution": 0.0})
    runs = simulate_campaign(expanded(best.model_copy(update={"sensor": exact}))).runs
    moment = max(np.abs(run.drive.values).max() for run in runs if run.drive is not None)
    angle = max(np.abs(run.record.yaw_rad).max() for run in runs)
    assert len(runs) == 2
    assert moment <= limits.moment
    assert angle <= limits.angle
    assert max(moment / limits.moment, angle / limits.angle) > 0.98
    assert angle == pytest.approx(peak_response(expanded(best), RIG), rel=1e-3)


@pytest.mark.parametrize(
    ("effects", "goal"), [([], "cn_r"), (BUFFETED, "d"), slow([], "d"), slow(BUFFETED, "cn_r")]
)
def test_no_plain_drive_and_no_free_decay_has_a_lower_bound(
    free: PlanDocument, goal: Goal, effects: list[EffectTable]
) -> None:
    given = free.model_copy(update={"effects": effects, "springs": [5, 8]})
    limits = Limits(5.0, np.deg2rad(15.0))
    best = size(propose_drive(given, RIG, limits, goal=goal), goal)
    for plain in (
        InputTable(kind="multisine", from_hz=0.5, to_hz=5.0),
        InputTable(kind="sine", frequency_hz=float(np.sqrt(RIG.spring(5) / 0.1014) / (2.0 * np.pi))),
    ):
        rival = within_limits(given, plain, RIG, limits, given.duration)
        assert best <= size(rival, goal) * 1.01  # inputs are compared with fewer samples
    assert best < size(given, goal)


@pytest.mark.slow
def test_estimates_scatter_as_the_bound_says(free: PlanDocument) -> None:
    plan = expanded(propose_drive(free, RIG, LIMITS[1]))
    bound = plan_bound(plan, RIG)
    covariance, distance = np.array(bound.covariance), 0.0
    for seed in range(8):
        found = identify(simulate_campaign(replace(plan, seed=seed)))
        error = [getattr(found, name).value - asdict(plan.truth)[name] for name in bound.parameters]
        distance += float(error @ np.linalg.solve(covariance, error))
    # χ² of 32 values: outside this range once in ten thousand
    assert 9.9 < distance < 75.0


def test_a_random_moment_costs_information_and_none_costs_nothing() -> None:
    given = campaign()
    truth = Truth(0.49, -0.11, 0.1014, 0.012)
    plain, none, some = (
        campaign_bound(given, truth, noise_std=1e-3, random_moments=q)
        for q in (None, [0.0] * len(given.runs), [1e-2] * len(given.runs))
    )
    assert np.array(none.covariance) == pytest.approx(np.array(plain.covariance), rel=1e-6)
    assert some.std("cn_r") > 3.0 * plain.std("cn_r")


def test_without_sensor_noise_the_bound_is_that_of_a_regression(free: PlanDocument) -> None:
    # The moment w = β̈ + 2aβ̇ + kβ − gu is then observed, and the variance of 2a is q/∫β̇² dt.
    plan = expanded(propose_drive(free, RIG, LIMITS[1]))
    given = simulate_campaign(plan)
    run, inertia, damping, q = given.runs[0], plan.truth.yaw_inertia, plan.truth.mechanical_damping, 1e-2
    assert run.drive is not None
    time = run.record.time_s
    decay = 0.5 * damping / inertia, RIG.spring(5) / inertia
    rate = np.gradient(driven_rows(time, run.drive.values / inertia, *decay, held=False)[0], time)
    truth = Truth(0.0, 0.0, inertia, damping)
    found = campaign_bound(replace(given, runs=(run,)), truth, noise_std=1e-7, random_moments=[q])
    expected = inertia * np.sqrt(q / np.trapezoid(rate**2, time))
    assert found.std("mechanical_damping") == pytest.approx(expected, rel=0.05)


def test_the_density_is_that_of_the_drawn_moment() -> None:
    # its integral over all frequencies (Hz, both signs) is the variance
    rates = 2.0 * np.pi * np.linspace(-4000.0, 4000.0, 40_001)
    for effect, pressure, std in (
        (effect_class("buffeting")(intensity=0.02, bandwidth=8.0), 5.0, 0.1),
        (effect_class("buffeting")(intensity=0.02, bandwidth=8.0), 0.0, 0.0),  # with the wind off
        (effect_class("ambient_vibration")(moment=0.02, bandwidth=8.0), 5.0, 0.02),
        (effect_class("ambient_vibration")(moment=0.02, bandwidth=8.0), 0.0, 0.02),
    ):
        density = [effect.moment_density(rate, pressure) for rate in rates]
        assert np.trapezoid(density, rates) / (2.0 * np.pi) == pytest.approx(std**2, rel=2e-3)
    assert effect_class("vortex_shedding")(0.01).moment_density(10.0, 5.0) == 0.0


def test_what_cannot_be_planned_is_refused(free: PlanDocument) -> None:
    quiet = free.sensor.model_copy(update={"noise_std": 0.0, "resolution": 0.0})
    for changed, message in (
        ({"sensor": quiet}, "without noise"),
        ({"wind_speeds": [0.0]}, "do not determine"),
        ({"wind_speeds": [0.0, 80.0]}, "overcomes the spring"),
    ):
        with pytest.raises(TunnelError, match=message):
            propose_drive(free.model_copy(update=changed), RIG, LIMITS[0])


@pytest.mark.parametrize(
    ("releases", "air"),
    [("one", "buffeting"), slow("one", "still"), slow("five", "still"), slow("five", "buffeting")],
)
def test_the_page_shows_the_bounds_of_the_code(releases: str, air: str) -> None:
    page = (Path(__file__).parents[4] / "docs" / "campaign-design.md").read_text(encoding="utf-8")
    name = f"spring 5, 0 and 15 m/s, {releases} release{'s' if releases == 'five' else ''}"
    case = compare(name, buffeted=air == "buffeting", seeds=0)
    (row,) = [line for line in page.splitlines() if line.startswith(f"| {name} | {air} | {case.drive} |")]
    assert f"| {case.bounds[1]:.2g} (" in row
    assert f"| {case.bounds[3]:.2g} (" in row
