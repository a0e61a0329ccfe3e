"""Runs with zeros of their own are known from zeros that differ beyond what the conditions shift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import diagnosable
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.noise.sensor_noise import campaign_noise
from diagnosis.settings import Settings
from identification import identify
from identification.examination.examine import examine
from identification.examination.free_motion import centre_of, with_zeros
from tests.support.decays import CN_BETA, INERTIA, campaign, reading, run
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

REPEATS = tuple((f"{letter}-v{speed:g}", speed) for letter in "abc" for speed in (0.0, 25.0))


def repeats(zeros, **how):
    """Three runs at either speed, the spring the same, each moved by a zero of its own, rad."""
    runs = [run(name, 16.0, speed, **how) for name, speed in REPEATS]
    return campaign([reading(one, one.record.yaw_rad + z) for one, z in zip(runs, zeros, strict=True)])


OWN = (0.0, 0.02, -0.01, 0.03, 0.05, -0.02)


def test_zeros_that_differ_are_given_to_every_run_and_said():
    data = repeats(OWN)
    kept, (remark,) = with_zeros(data)
    assert kept.sensor.zero == "per_run"
    assert remark.runs == tuple(name for name, _ in REPEATS)
    assert "up to 3.4° under" in remark.what
    assert identify(data).remarks == (remark,)


def test_a_diagnosis_fits_the_zeros_that_it_says_it_fits():
    data = repeats(OWN)
    for judged in (True, False):
        assert diagnosable(data, judged=judged).campaign.sensor == replace(data.sensor, zero="per_run")
    found = diagnose(data, kinds=vocabulary(["cubic_stiffness", "sensor_drift"]))
    assert found.causes == ()
    assert "separate zero" in " ".join(remark.what for remark in found.remarks)


@pytest.mark.parametrize("zero", ["common", "per_run"])
def test_what_is_stated_is_not_decided(zero):
    data = repeats(OWN)
    stated = replace(data, sensor=replace(data.sensor, zero=zero))
    assert with_zeros(stated) == (stated, ())


@pytest.mark.parametrize("zeros", [(0.0,) * 6, (0.0, 0.03) * 3])
def test_a_common_zero_and_one_that_the_wind_moves_stay(zeros):
    data = repeats(zeros)
    assert with_zeros(data) == (data, ())


def of_two_swings(zero=0.0, seed=0, springs=(16.0,)):
    """A large and a small swing with every spring, without wind, the small ones moved by a zero, rad."""
    runs = []
    for spring in springs:
        small = run(f"small-{spring:g}", spring, 0.0, angle=0.1, seed=seed)
        runs += [
            run(f"large-{spring:g}", spring, 0.0, seed=seed),
            reading(small, small.record.yaw_rad + zero),
        ]
    return campaign(runs)


def test_zeros_of_unequal_swings_are_compared_as_well_as_each_run_bounds_a_shift_by_its_amplitude():
    kept, (remark,) = with_zeros(of_two_swings(0.01))
    assert kept.sensor.zero == "per_run"
    assert "differ by up to 0.57° under equal conditions" in remark.what


@pytest.mark.parametrize("coefficient", [0.05, 0.5])
def test_what_an_asymmetric_spring_shifts_stays_common(coefficient):
    """By the engine's integrator: the centre of the larger swing is off, and moves back as the swing decays."""
    conditions = [Condition(f"r{i}", 16.0, 0.0, 1.2, angle, 10.0) for i, angle in enumerate((0.35, 0.1))]
    asymmetric = EffectSetting("asymmetric_stiffness", {"coefficient": coefficient})
    truth, sensor = Truth(CN_BETA, -0.15, INERTIA, 0.01), SensorModel(250.0)
    plan = CampaignPlan("asymmetric", 7, truth, tuple(conditions), sensor, (asymmetric,))
    data = simulate_campaign(plan, nthread=1)
    assert with_zeros(data) == (data, ())


def test_four_runs_without_wind_show_zeros_that_a_constant_moment_does_not_shift():
    springs = (16.0, 45.0)
    assert with_zeros(of_two_swings(0.01, springs=springs))[0].sensor.zero == "per_run"
    data = of_two_swings(springs=springs)
    shifted = [reading(one, one.record.yaw_rad + 0.1 / one.spring_stiffness) for one in data.runs]
    moved = replace(data, runs=tuple(shifted))
    assert with_zeros(moved) == (moved, ())


GRID = tuple((spring, speed) for spring in (16.0, 45.0, 80.0) for speed in (0.0, 15.0, 25.0))


def grid(zeros, seed=0):
    """Nine runs of which no two have the same conditions, each moved by a zero of its own, rad."""
    runs = [run(f"s{s:g}-v{v:g}", s, v, seed=seed) for s, v in GRID]
    return campaign([reading(one, one.record.yaw_rad + z) for one, z in zip(runs, zeros, strict=True)])


def test_zeros_that_differ_are_known_from_runs_of_different_conditions():
    own = np.random.default_rng(4).normal(0.0, 0.005, len(GRID))
    kept, (remark,) = with_zeros(grid(own))
    assert kept.sensor.zero == "per_run"
    assert "°, more than wind, spring and amplitude shift them; " in remark.what
    assert len(remark.runs) == len(GRID)


@pytest.mark.parametrize("speed_error", [0.0, 0.003])
def test_what_a_stream_at_an_angle_and_a_constant_moment_shift_stays_common(speed_error):
    """In closed form: the centre is where the spring holds both, with Cn0 of 0.004 and 0.01 N m."""
    rng, area, zeros = np.random.default_rng(2), 0.5 * 1.2 * 0.036 * 0.625, []
    for spring, speed in GRID:
        pressure = area * (speed * (1.0 + rng.normal(0.0, speed_error))) ** 2
        zeros.append((0.01 + 0.004 * pressure) / (spring - area * speed**2 * CN_BETA))
    assert max(zeros) - min(zeros) > 0.0005
    data = grid(zeros)
    assert with_zeros(data) == (data, ())


@pytest.mark.slow
def test_a_common_zero_is_called_several_as_seldom_as_stated():
    """The rate of each test is one in a thousand: of 600 campaigns of pure chance hardly one is expected."""
    flagged = 0
    for seed in range(150):
        flagged += bool(with_zeros(of_two_swings(seed=seed))[1])
        flagged += bool(with_zeros(of_two_swings(seed=seed, springs=(16.0, 45.0, 80.0)))[1])
        flagged += bool(with_zeros(repeats((0.0,) * 6, seed=seed))[1])
        flagged += bool(with_zeros(grid((0.0,) * 9, seed=seed))[1])
    assert flagged <= 4


def test_the_centre_is_not_where_dry_friction_holds_the_body():
    """Half cycles of a dry-friction decay are cosines about ±d; the motion ends off the centre."""
    dead, omega, rate, ends = 0.012, 9.0, 400.0, []
    swing, side, parts = 0.35, 1.0, []
    while swing > dead:
        clock = np.arange(round(np.pi / omega * rate)) / rate
        parts.append(side * (dead + (swing - dead) * np.cos(omega * clock)))
        ends.append(swing)
        swing, side = swing - 2.0 * dead, -side
    yaw = np.concatenate([*parts, np.full(2000, side * swing)])
    assert abs(yaw[-1]) > 0.003
    one = run("a", 16.0, 0.0)
    found = centre_of(replace(one, record=Record(np.arange(yaw.size) / rate, yaw + 0.2)), 0.0)
    assert found is not None
    assert abs(found.zero - 0.2) < 3.0 * found.std + 5e-4
    assert found.swing == pytest.approx(0.33, abs=0.02)


def test_each_run_is_fitted_with_its_own_zero():
    data = repeats(OWN)
    estimate = identify(data)
    assert estimate.sensor_zero is None
    assert abs(estimate.cn_beta.value - CN_BETA) < 4.0 * estimate.cn_beta.std
    # one spring leaves inertia and stiffness apart only by what is stated
    assert abs(estimate.yaw_inertia.value / INERTIA - 1.0) < 1e-3
    for own, one in zip(OWN, estimate.runs, strict=True):
        assert abs(one.sensor_zero.value - own - 0.003) < 4.0 * one.sensor_zero.std
    assert not estimate.noise.departs
    common = identify(replace(data, sensor=replace(data.sensor, zero="common")))
    assert common.noise.departs


def test_the_diagnosis_fits_the_zeros_among_the_runs_own_parameters():
    kept = examine(repeats(OWN)).campaign
    prepared = prepare(kept, campaign_noise(kept, Settings().noise).variance)
    found = fit(Problem(prepared), nominal_start(prepared))
    assert "zero" not in found.problem.names
    assert found.point.per_run.shape == (6, 3)
    assert found.excess == pytest.approx(0.0, abs=5.0 * np.sqrt(2.0 / found.count))
    for i, own in enumerate(OWN):
        assert found.zero(i) == pytest.approx(own + 0.003, abs=1e-4)
