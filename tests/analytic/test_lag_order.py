"""Order of convergence with the aerodynamic lag state, and of the damping recovered from a run."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

from tests.analytic.decay_oracle import AREA, LENGTH
from tests.analytic.law_cases import DURATION, RIG, SAMPLE_RATE, Case, Oracle
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.physics.moment_law import state_names, state_vector
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness

STEPS = np.array([8e-3, 4e-3, 2e-3])


def _order(errors: list[float]) -> float:
    return float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


def _exact(case: Case, samples: int, rate: float) -> np.ndarray:
    dynamics = RIG.dynamics
    return Oracle(
        case.spring, dynamics.mechanical_damping, dynamics.yaw_inertia, 0.35, -0.7, 1.204,
        lambda _: case.speed, 0.3, dict(case.terms),
    ).solve(samples, rate)  # fmt: skip


@pytest.mark.parametrize("lag", [0.3, 2.0, 20.0, -0.3, -2.0])
def test_angle_converges_with_order_four(lag: float) -> None:
    case, rate = Case("", {"aero_lag": lag}), 1.0 / 8e-3
    exact = _exact(case, round(rate * DURATION), rate)
    errors = []
    for step in STEPS:
        angle = simulate_motion(build_model(RIG, case.settings(step)), rate).angle
        errors.append(float(np.max(np.abs(angle - exact))))
    assert _order(errors) == pytest.approx(4.0, abs=0.25)


def _system(lag: float, speed: float, spring: float) -> np.ndarray:
    """The linear rig with lag as d(angle, rate, x)/dt = matrix times (angle, rate, x)."""
    flow = {"air_density": 1.204, "wind_speed": speed, "frontal_area": AREA, "reference_length": LENGTH}
    ka, ca = aerodynamic_stiffness(0.35, **flow), aerodynamic_damping(-0.7, **flow)
    inertia, tau = RIG.dynamics.yaw_inertia, abs(lag) * LENGTH / speed
    on_angle, on_lagged = (-spring, ka) if lag > 0 else (-spring + 2 * ka, -ka)
    damping = ca - RIG.dynamics.mechanical_damping
    second = np.array([on_angle, damping, on_lagged]) / inertia
    return np.array([[0.0, 1.0, 0.0], second, [1.0 / tau, 0.0, -1.0 / tau]])


def _one_step_map(lag: float, step: float) -> np.ndarray:
    """The simulator's own map of (angle, rate, x) over one step, column by column."""
    model = build_model(RIG, Case("", {"aero_lag": lag}).settings(step))
    columns = []
    for angle, rate, lagged in np.eye(3):
        data = mujoco.MjData(model.mj)
        data.qpos[0], data.qvel[0] = angle, rate
        data.plugin_state[:] = state_vector({"lagged": lagged, "angle": angle, "rate": rate, "started": 1.0})
        mujoco.mj_step(model.mj, data)
        columns.append((data.qpos[0], data.qvel[0], data.plugin_state[state_names().index("lagged")]))
    return np.array(columns).T


def _damping_and_frequency(step_map: np.ndarray, step: float) -> tuple[float, float]:
    modes = np.log(np.linalg.eigvals(step_map).astype(complex)) / step
    mode = modes[np.argmax(modes.imag)]
    return float(-mode.real), float(abs(mode))


@pytest.mark.parametrize("lag", [0.3, 2.0, -2.0])
def test_recovered_damping_converges(lag: float) -> None:
    system = _system(lag, 20.0, 16.12)
    exact, _ = _damping_and_frequency(expm(system * 1e-3), 1e-3)
    errors = []
    for step in STEPS:
        found, _ = _damping_and_frequency(_one_step_map(lag, step), step)
        errors.append(abs(found - exact))
    assert _order(errors) > 3.5
    at_1_ms, _ = _damping_and_frequency(_one_step_map(lag, 1e-3), 1e-3)
    assert abs(at_1_ms / exact - 1.0) < 1e-8


def test_lag_of_zero_is_no_lag_to_the_bit() -> None:
    without = simulate_motion(build_model(RIG, Case("").settings()), SAMPLE_RATE)
    zero = simulate_motion(build_model(RIG, Case("", {"aero_lag": 0.0}).settings()), SAMPLE_RATE)
    assert np.array_equal(without.angle, zero.angle)


def test_wind_off_has_no_lag() -> None:
    without = simulate_motion(build_model(RIG, Case("", speed=0.0).settings()), SAMPLE_RATE)
    lagging = simulate_motion(
        build_model(RIG, Case("", {"aero_lag": 5.0}, speed=0.0).settings()), SAMPLE_RATE
    )
    assert np.array_equal(without.angle, lagging.angle)


@pytest.mark.parametrize("step", [1e-3, 1e-9])
def test_lag_propagation_is_exact_for_a_cubic_path(step: float) -> None:
    # through one mj_step whose path is known: a body without moments moves straight, x by the lag's formula
    speed, lag = 20.0, 2.0
    model = build_model(RIG, Case("", {"aero_lag": lag}, spring=0.0).settings(step))
    model.mj.joint("yaw").damping = 0.0
    for name in ("cn_beta", "cn_r"):
        model.mj.numeric(name).data[0] = 0.0
    data = mujoco.MjData(model.mj)
    angle, rate, lagged = 0.2, 0.7, 0.15
    data.qpos[0], data.qvel[0] = angle, rate
    data.plugin_state[:] = state_vector({"lagged": lagged, "angle": angle, "rate": rate, "started": 1.0})
    mujoco.mj_step(model.mj, data)
    tau = lag * LENGTH / speed
    exact = lagged + (angle - lagged - rate * tau) * -np.expm1(-step / tau) + rate * step
    assert data.plugin_state[state_names().index("lagged")] == pytest.approx(exact, rel=1e-15, abs=1e-16)
