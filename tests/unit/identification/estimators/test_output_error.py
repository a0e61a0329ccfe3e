"""Output error's own statuses, noise statements, separability and convergence."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Status, identify
from identification.estimators.output_error import OutputError
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.free_decay import Decay, free_decay
from identification.signal.frequency import starting_decay
from tests.marks import slow
from tests.reference.free_decays import RESOLUTION, TWELVE, Setting, Truth, campaign, with_records
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("unexamined")


@pytest.mark.parametrize("stiffness", [0.0, 1e-30, 1e-300])
def test_a_motion_that_is_a_constant_cannot_be_distinguished_from_the_zero(stiffness):
    time = np.arange(64) / 64.0  # sums of these are exact: what is left of the constant is zero
    fit = fit_run(Reading(time, 0.3 + 0.01 * np.sin(9.0 * time)), Decay(0.0, stiffness))
    assert fit.runs == ()
    assert not fit.converged


@pytest.mark.parametrize("zeta", [-0.002, 0.0, 0.001, 0.02, 0.2, 0.7, 1.0, 1.6])
@pytest.mark.parametrize("omega", [1.5, 12.0, 26.0])
def test_one_record_converges_from_data_alone(zeta, omega):
    clock = np.arange(8000) / 1000.0
    truth = Decay.from_modal(omega, zeta)
    record = Record(clock + 3.7, 0.02 + free_decay(clock, truth, 0.3, -0.4))
    start = starting_decay(record)
    fit = fit_run(Reading.from_record(record), start)
    assert fit.converged
    assert fit.runs[0].decay.stiffness == pytest.approx(truth.stiffness, rel=1e-9)
    assert fit.runs[0].decay.rate == pytest.approx(truth.rate, rel=1e-9, abs=1e-9 * omega)
    assert fit.zero == pytest.approx(0.02, abs=1e-9)
    assert fit.runs[0].angle == pytest.approx(0.3, abs=1e-9)
    assert fit.runs[0].rate == pytest.approx(-0.4, abs=1e-8)


def test_joint_fit_converges_to_rounding():
    estimate = identify(campaign())
    for name in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping"):
        assert getattr(estimate, name).value == pytest.approx(getattr(Truth(), name), rel=1e-10)
    assert estimate.sensor_zero.value == pytest.approx(0.004, abs=1e-12)


def test_a_long_record_of_many_cycles_converges():
    data = campaign(
        (Setting(67.98, 0.0),), duration=120.0, rate=200.0, noise=5e-4, rng=np.random.default_rng(1)
    )
    run = identify(data).runs[0]
    assert run.omega_n.value == pytest.approx(np.sqrt(67.98 / Truth().yaw_inertia), rel=1e-4)


def test_stated_noise_is_used_when_borne_out():
    data = campaign(noise=5e-4, resolution=RESOLUTION, rng=np.random.default_rng(4))
    level = identify(data).noise
    assert level.source == "stated"
    assert level.std == pytest.approx(np.hypot(5e-4, RESOLUTION / np.sqrt(12.0)))
    assert not level.departs
    assert not level.disagrees


@pytest.mark.parametrize("factor", [slow(0.5), 0.8, 1.25, slow(2.0)])
def test_a_wrong_noise_statement_is_caught(factor):
    data = campaign(noise=5e-4, stated_noise=5e-4 * factor, rng=np.random.default_rng(4))
    estimate = identify(data)
    assert estimate.statuses == (Status.NOISE_DISAGREES,)
    assert estimate.noise.source == "residual"
    assert estimate.noise.std == pytest.approx(5e-4, rel=0.02)


def test_unstated_noise_is_had_from_the_residual():
    data = campaign(noise=5e-4, stated_noise=None, rng=np.random.default_rng(4))
    estimate = identify(data)
    assert estimate.status is Status.OK
    assert estimate.noise.source == "residual"
    assert estimate.noise.std == pytest.approx(5e-4, rel=0.02)


def drifting_stiffness(data, share):
    """Each reading with its phase running ahead: a gap of the linear model, which the examination would refuse."""
    return with_records(
        data, lambda clock, yaw: np.interp(clock * (1.0 + share * clock / clock[-1]), clock, yaw)
    )


@pytest.fixture(scope="module")
def honest():
    """The estimate where the model does not depart."""
    return identify(campaign(noise=5e-4, rng=np.random.default_rng(6)))


@pytest.mark.parametrize("stated", [5e-4, None])
def test_a_departing_model_is_flagged_and_the_intervals_widened(stated, honest):
    rng = np.random.default_rng(6)
    clean = campaign(noise=0.0, stated_noise=stated)
    curved = with_records(
        drifting_stiffness(clean, -2e-3), lambda clock, yaw: yaw + 5e-4 * rng.standard_normal(clock.size)
    )
    estimate = OutputError().estimate(curved)
    assert Status.MODEL_DEPARTS in estimate.statuses
    assert estimate.noise.slow_ratio > 2.0
    assert estimate.cn_beta.std > 1.4 * honest.cn_beta.std
    # The widened interval holds the truth although the fit is off by many nominal deviations.
    assert abs(estimate.mechanical_damping.value - Truth().mechanical_damping) < (
        4.0 * estimate.mechanical_damping.std
    )


@pytest.mark.slow
def test_a_departing_model_with_a_zero_in_every_run_is_as_uncertain_as_with_one():
    curved = drifting_stiffness(campaign(noise=5e-4, rng=np.random.default_rng(6)), -2e-3)
    shift = np.random.default_rng(7)
    moved = with_records(curved, lambda _, yaw: yaw + 0.01 * shift.standard_normal())
    one = OutputError().estimate(curved)
    each = OutputError().estimate(replace(moved, sensor=replace(moved.sensor, zero="per_run")))
    assert Status.MODEL_DEPARTS in each.statuses
    assert each.sensor_zero is None
    for name in ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping"):
        first, other = getattr(one, name), getattr(each, name)
        assert other.value == pytest.approx(first.value, abs=0.1 * first.std)
        assert other.std == pytest.approx(first.std, rel=0.05)


def test_wind_on_alone_separates_by_spring_and_speed():
    def given(*settings):
        return identify(campaign(settings, noise=5e-4, rng=np.random.default_rng(7)))

    one = given(Setting(16.12, 20.0))
    assert {Status.STIFFNESS_NOT_SEPARABLE, Status.DAMPING_NOT_SEPARABLE} <= set(one.statuses)
    assert one.parameters == ()
    springs = given(Setting(16.12, 20.0), Setting(44.84, 20.0))
    assert springs.statuses == (Status.DAMPING_NOT_SEPARABLE,)
    assert springs.parameters == ("cn_beta", "yaw_inertia")
    assert springs.cn_beta.value == pytest.approx(Truth().cn_beta, abs=5.0 * springs.cn_beta.std)
    speeds = given(Setting(16.12, 10.0), Setting(16.12, 25.0))
    assert speeds.status is Status.OK
    assert speeds.cn_r.value == pytest.approx(Truth().cn_r, abs=5.0 * speeds.cn_r.std)


def test_growing_oscillation_is_identified():
    truth = Truth(cn_r=0.1)  # damping changes sign with speed
    data = campaign((Setting(16.12, 0.0), Setting(16.12, 25.0, 0.02)), truth=truth)
    estimate = identify(data)
    assert estimate.runs[1].zeta.value < 0.0
    assert estimate.cn_r.value == pytest.approx(0.1, rel=1e-6)


def test_few_cycles_are_said():
    data = campaign((Setting(0.98, 0.0),), duration=4.0)
    estimate = identify(data)
    assert Status.FEW_CYCLES in estimate.statuses
    assert estimate.yaw_inertia.value == pytest.approx(Truth().yaw_inertia, rel=1e-6)


def test_settings_reach_the_windows():
    data = campaign(TWELVE[:1])
    three = identify(data).runs[0].windows
    five = identify(data, OutputError(cycles_per_window=5)).runs[0].windows
    assert five[0].cycles == 5
    assert five[0].duration_s == pytest.approx(5.0 / 3.0 * three[0].duration_s, rel=0.01)


def test_where_the_clock_starts_is_no_matter():
    data = campaign(TWELVE[:4])
    late = replace(
        data,
        runs=tuple(
            replace(run, record=Record(run.record.time_s + 100.0, run.record.yaw_rad)) for run in data.runs
        ),
    )
    assert identify(late).cn_beta.value == pytest.approx(identify(data).cn_beta.value, rel=1e-9)
