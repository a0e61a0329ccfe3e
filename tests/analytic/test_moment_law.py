"""Every term of the moment law, in MuJoCo and the forward integrator, against the equations of the vocabulary."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.analytic.decay_oracle import Oracle
from tests.analytic.law_cases import CASES, DURATION, FREE_PLAY, FRICTION, RIG, SAMPLE_RATE, Case
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.moment_law import parameter_names
from tunnel_sim.physics.run_settings import Series

_RUNS: dict[tuple[str, float], np.ndarray] = {}


def _simulated(case: Case, timestep: float = 1e-3) -> np.ndarray:
    key = (case.name, timestep)
    if not case.name or key not in _RUNS:
        _RUNS[key] = simulate_motion(build_model(RIG, case.settings(timestep)), SAMPLE_RATE).angle
    return _RUNS[key]


_LONG = (
    "narrow_presliding",
    "many",
    "presliding_flexible_rod",
    "presliding_and_turbulence",
    "loaded_friction_flexible_rod",
    "stribeck_friction_flexible_rod",
)  # their oracles are


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=pytest.mark.slow) if c.name in _LONG else c for c in CASES],
    ids=lambda case: case.name,
)
def test_term_matches_the_equation(case: Case) -> None:
    exact = case.oracle()
    assert np.max(np.abs(_simulated(case) - exact)) < case.tolerance
    forward = forward_motion(RIG, case.settings(), SAMPLE_RATE).angle
    assert np.max(np.abs(forward - exact)) < case.forward_tolerance


@pytest.mark.parametrize("case", CASES[2:], ids=lambda case: case.name)
def test_term_is_seen(case: Case) -> None:
    # the comparison above would pass a term that both sides leave out
    nominal = _simulated(Case("nominal"))
    assert np.max(np.abs(_simulated(case) - nominal)) > 1e-3


def test_every_parameter_is_in_a_case() -> None:
    common = {"air_density", "frontal_area", "reference_length", "width", "cn_beta", "cn_r"}
    common |= {"spring_stiffness", "mechanical_damping", "yaw_inertia"}
    assert set(parameter_names()) - common == {name for case in CASES for name in case.terms}


@pytest.mark.parametrize("case", [FREE_PLAY, *FRICTION[1:3]], ids=lambda case: case.name)
def test_kinks_and_jumps_leave_an_error_of_second_order(case: Case) -> None:
    steps = np.array([1e-3, 5e-4, 2.5e-4])
    exact = case.oracle()
    errors = [np.max(np.abs(_simulated(case, step) - exact)) for step in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order > 1.5


def test_friction_loses_a_fixed_angle_per_half_cycle_and_holds_at_rest() -> None:
    # exact for Coulomb friction with a linear spring alone: amplitude falls by 2 Tc/Kr every half cycle
    friction, spring, release = 0.05, 16.12, 0.1
    case = Case("", {"friction_moment": friction}, spring=spring, speed=0.0)
    settings = replace(case.settings(), release_angle=release, mechanical_damping=0.0, duration=6.0)
    angle = simulate_motion(build_model(RIG, settings), SAMPLE_RATE).angle
    loss, amplitudes = 2.0 * friction / spring, []
    amplitude, sign = release, 1.0
    while amplitude * spring > friction:
        amplitude, sign = amplitude - loss, -sign
        amplitudes.append(sign * amplitude)
    turning = np.flatnonzero(np.diff(np.sign(np.diff(angle))) != 0) + 1
    measured = angle[turning][: len(amplitudes) - 1]
    # a sampled peak lies below the true one by up to omega^2 A (dt/2)^2/2
    assert measured == pytest.approx(amplitudes[:-1], abs=5e-6)
    assert angle[-1] == pytest.approx(amplitudes[-1], abs=5e-6)
    assert angle[-1] == angle[-1000]  # at rest for the last seconds, without creep
    assert abs(spring * angle[-1]) <= friction


def test_held_body_does_not_start() -> None:
    case = Case("", {"friction_moment": 0.05}, speed=0.0)
    settings = replace(case.settings(), release_angle=0.003)  # 16.12 * 0.003 < 0.05
    angle = simulate_motion(build_model(RIG, settings), SAMPLE_RATE).angle
    assert np.all(angle == 0.003)


def test_wind_speed_series_matches_a_drifting_wind() -> None:
    # V(t) = V (1 + d t/T), the vocabulary's wind_speed_drift, as a series of two samples
    speed, drift, duration = 20.0, -0.1, DURATION
    series = {"wind_speed": Series((speed, speed * (1.0 + drift)), duration)}
    case = Case("", series=series)
    angle = _simulated(case)
    exact = Oracle(
        case.spring, RIG.dynamics.mechanical_damping, RIG.dynamics.yaw_inertia, 0.35, -0.7, 1.204,
        lambda t: speed * (1.0 + drift * t / duration), 0.3,
    ).solve(len(angle), SAMPLE_RATE)  # fmt: skip
    assert np.max(np.abs(angle - exact)) < 1e-8


def _with_live_wind(speed: float, live: np.ndarray) -> np.ndarray:
    model = build_model(RIG, Case("", speed=speed).settings())
    data, angle = model.release_state(), np.empty(len(live))
    for i, departure in enumerate(live):
        angle[i] = data.qpos[0]
        data.userdata[0] = departure
        mujoco.mj_step(model.mj, data)
    return angle


def test_live_wind_is_a_departure_from_the_stated_speed() -> None:
    assert np.array_equal(_with_live_wind(18.0, np.full(2000, 2.0)), _with_live_wind(20.0, np.zeros(2000)))


def test_live_wind_below_zero_is_no_wind() -> None:
    assert np.array_equal(_with_live_wind(18.0, np.full(2000, -25.0)), _with_live_wind(0.0, np.zeros(2000)))


def test_live_wind_may_change_during_a_run() -> None:
    change = 4.0  # s
    live = np.where(np.arange(6000) < change * SAMPLE_RATE, 0.0, 5.0)
    exact = Oracle(
        16.12, RIG.dynamics.mechanical_damping, RIG.dynamics.yaw_inertia, 0.35, -0.7, 1.204,
        lambda t: 20.0 if t < change else 25.0, 0.3, breaks=(change,),
    ).solve(len(live), SAMPLE_RATE)  # fmt: skip
    assert np.max(np.abs(_with_live_wind(20.0, live) - exact)) < 1e-8
