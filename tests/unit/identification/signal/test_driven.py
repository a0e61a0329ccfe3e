"""The motion of a driven run against closed forms, and what output error finds in driven and mixed campaigns."""

import numpy as np
import pytest

from identification import identify
from identification.signal.forcing import driven_rows, driven_start
from tests.reference.free_decays import damped_cosine
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.input_kinds import INPUTS
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.record import Record

RATE, INERTIA, DAMPING, NOISE = 100.0, 0.1, 0.02, 5e-4
TIME = np.arange(1500) / RATE
A, K = 0.5 * DAMPING / INERTIA, 16.0 / INERTIA


def ramp_response(time: np.ndarray) -> np.ndarray:
    """From rest to u = t, in closed form: β = (t − 2a/k)/k + a free motion."""
    return (time - 2.0 * A / K) / K + damped_cosine(time, 2.0 * A, K, 2.0 * A / K**2, -1.0 / K)


def step_response(time: np.ndarray) -> np.ndarray:
    """From rest to u = 1 from time 0 on."""
    return np.where(
        time > 0.0, 1.0 / K + damped_cosine(np.maximum(time, 0.0), 2.0 * A, K, -1.0 / K, 0.0), 0.0
    )


def test_a_linear_hold_is_the_sum_of_ramps() -> None:
    values = np.zeros(TIME.size)
    values[100:] = TIME[100:] - TIME[100]
    values[400:] = values[400]
    closed = ramp_response(np.maximum(TIME - TIME[100], 0.0)) * (TIME[100] < TIME)
    closed -= ramp_response(np.maximum(TIME - TIME[400], 0.0)) * (TIME[400] < TIME)
    found = driven_rows(TIME, values, A, K, held=False)[0]
    assert np.max(np.abs(found - closed)) < 1e-13


def test_a_zero_hold_is_the_sum_of_steps() -> None:
    values = np.where((np.arange(TIME.size) >= 50) & (np.arange(TIME.size) < 300), 2.0, 0.0)
    closed = 2.0 * (step_response(TIME - TIME[50]) - step_response(TIME - TIME[300]))
    assert np.max(np.abs(driven_rows(TIME, values, A, K, held=True)[0] - closed)) < 1e-13


def test_a_body_without_a_spring_or_a_damper_moves_by_the_integral() -> None:
    found = driven_rows(TIME, np.ones(TIME.size), 0.0, 0.0, held=False)[0]
    assert np.allclose(found, 0.5 * TIME**2, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("held", [False, True])
def test_sensitivities_are_the_derivatives(held: bool) -> None:
    values = excitation(3)
    rows = driven_rows(TIME, values, A, K, held=held)
    for row, (da, dk) in zip(rows[1:], ((1e-4, 0.0), (0.0, 1e-2)), strict=True):
        more, less = (driven_rows(TIME, values, A + s * da, K + s * dk, held=held)[0] for s in (1.0, -1.0))
        slope = (more - less) / (2.0 * (da + dk))
        assert np.max(np.abs(slope - row)) < 1e-5 * np.max(np.abs(row))


def test_uneven_times_give_the_motion_of_even_ones() -> None:
    values = np.interp(TIME, TIME[::10], excitation(5)[::10])  # linear between every tenth sample
    kept = np.sort(np.r_[np.arange(0, TIME.size, 10), np.arange(3, TIME.size - 10, 20)])
    even = driven_rows(TIME, values, A, K, held=False)[:, kept]
    uneven = driven_rows(TIME[kept], values[kept], A, K, held=False)
    assert np.max(np.abs(even[0] - uneven[0])) < 1e-12


def excitation(seed: int) -> np.ndarray:
    return np.convolve(np.random.default_rng(seed).standard_normal(TIME.size), np.ones(6) / 6.0, "same")


def integrated(steps: int, drive: InputMoment) -> np.ndarray:
    run = RunSettings(
        16.0,
        AeroDerivatives(0.0, 0.0),
        INERTIA,
        DAMPING,
        duration=TIME.size / RATE,
        timestep=1.0 / (RATE * steps),
        drive=drive,
    )
    return forward_motion(load_rig(), run, RATE).angle


@pytest.mark.parametrize("held", [False, True])
def test_the_integrator_is_of_fourth_order_for_an_input_with_kinks(held: bool) -> None:
    drive = InputMoment(TIME, excitation(1), held=held)
    exact = driven_rows(TIME, drive.values, A, K, held=held)[0] / INERTIA
    coarse, fine = (np.max(np.abs(integrated(steps, drive) - exact)) for steps in (4, 8))
    assert fine < 1e-8
    assert coarse / fine == pytest.approx(16.0, rel=0.1)


@pytest.mark.parametrize("held", [False, True])
def test_a_delay_that_is_not_a_whole_number_of_steps_loses_no_order(held: bool) -> None:
    values, delay = excitation(2), 0.0037
    values[:3] = 0.0
    fine = np.arange(10 * TIME.size) / (10.0 * RATE)
    drive = InputMoment(TIME, values, delay=delay, held=held)
    later = TIME + delay
    finest = np.sort(np.r_[fine, later[later < fine[-1]]])
    at = np.searchsorted(later, finest + 1e-12) - 1
    held_values = np.where(at >= 0, values[np.maximum(at, 0)], 0.0)
    given = held_values if held else np.interp(finest, later, values)
    exact = driven_rows(finest, given, A, K, held=held)[0][np.searchsorted(finest, TIME - 1e-9)] / INERTIA
    coarse, finer = (np.max(np.abs(integrated(steps, drive) - exact)) for steps in (4, 8))
    assert finer < 2e-8
    assert coarse / finer > 12.0


def test_a_moment_by_the_root_and_on_the_body_are_one_with_a_rigid_rod() -> None:
    drive = InputMoment(TIME, excitation(1))
    by_root = InputMoment(TIME, excitation(1), kind=INPUTS["base_rad"])
    assert np.max(np.abs(integrated(4, drive) - integrated(4, by_root))) < 1e-13


def test_the_start_is_near_the_truth() -> None:
    values = excitation(4)
    reading = 10.0 * driven_rows(TIME, values, A, K, held=False)[0] + 0.02
    reading += NOISE * np.random.default_rng(1).standard_normal(TIME.size)
    start = driven_start(TIME, reading, values)
    assert start is not None
    assert start[1] == pytest.approx(K, rel=0.01)
    assert start[2] == pytest.approx(10.0, rel=0.05)


@pytest.mark.parametrize("seed", [4, 7, 12, 18, 19])
def test_a_resonance_above_half_the_sample_rate_is_no_estimate(seed: int) -> None:
    # a moment on the body, said to be the angle of the root: without a limit these fits end at 1e7 rad/s and more
    rng, time = np.random.default_rng(seed), np.arange(3000) / 100.0
    given = np.sin(2.0 * np.pi * 1.5 * time) + 0.3 * rng.normal(size=time.size)
    reading = 10.0 * driven_rows(time, given, 0.25, 100.0, held=True)[0] + 1e-4 * rng.normal(size=time.size)
    wrong = Run("r", Record(time, reading), 0.0, 10.0, drive=Input("base_rad", given))
    with pytest.raises(TunnelError, match="no run could be identified"):
        identify(Campaign("wrong", RigProperties(), SensorProperties(), (wrong,)))


@pytest.mark.parametrize("held", [True, False])
def test_the_rate_is_the_slope_of_the_angle(held: bool) -> None:
    fine = np.arange(10 * TIME.size) / (10.0 * RATE)
    values = np.repeat(excitation(0), 10) if held else np.interp(fine, TIME, excitation(0))
    rows = [driven_rows(fine, values, 0.25, 160.0, held=held, derivative=d) for d in (0, 1)]
    slopes = (rows[0][:, 2:] - rows[0][:, :-2]) / (fine[2:] - fine[:-2])
    for slope, rate in zip(slopes, rows[1][:, 1:-1], strict=True):
        assert np.max(np.abs(slope - rate)) < 2e-3 * np.max(np.abs(rate))


def test_the_spectra_give_decay_stiffness_and_gain_of_a_rate() -> None:
    values = excitation(3)
    reading = 10.0 * driven_rows(TIME, values, 0.25, 160.0, held=False, derivative=1)[0]
    found = driven_start(TIME, reading, values, derivative=1)
    assert found is not None
    assert found == pytest.approx((0.25, 160.0, 10.0), rel=0.02)
