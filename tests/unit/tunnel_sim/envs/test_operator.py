"""The operator's wind and moment, against an integration of their own equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.support.env_episodes import episode, make
from tunnel_sim.envs.engines import WindAnswer
from tunnel_sim.envs.episode_conditions import FreeDecayConfig
from tunnel_sim.files.rig_file import load_rig

TRUTH = {"cn_beta": 0.47, "cn_r": -0.1, "yaw_inertia": 0.1, "mechanical_damping": 0.02, "sensor_zero": 0.0}
STATED: dict[str, Any] = {"spring": 5, "wind_speed": 10.0, "release_angle": 0.2, "truth": TRUTH}
EXACT: dict[str, Any] = {"noise_std": 1e-6, "resolution": 0.0, "preset": "operator"}


def expected(times: np.ndarray, set_point: float, moment: float, constant: float) -> np.ndarray:
    """Izz β̈ + (Cr − Ca(V)) β̇ + (Kr − Ka(V)) β = M and τ V̇ = Vs − V."""
    rig = load_rig()
    area, length, density = rig.body.frontal_area, rig.body.length, rig.air.density

    def slope(_: float, state: np.ndarray) -> list[float]:
        angle, rate, speed = state
        stiffness = 16.12 - 0.5 * density * speed**2 * area * length * TRUTH["cn_beta"]
        damping = TRUTH["mechanical_damping"] - 0.5 * density * speed * area * length**2 * TRUTH["cn_r"]
        acceleration = (moment - damping * rate - stiffness * angle) / TRUTH["yaw_inertia"]
        return [rate, acceleration, (set_point - speed) / constant]

    span = (0.0, float(times[-1]))
    return solve_ivp(slope, span, [0.2, 0.0, 10.0], "DOP853", times, rtol=1e-11, atol=1e-13).y


@pytest.mark.parametrize(
    ("set_point", "moment", "constant"),
    [(30.0, 0.0, 1.0), (10.0, 0.3, 2.0), (0.0, -0.5, 0.2), (40.0, 0.2, 4.0)],
)
def test_the_motion_is_that_of_the_equations(set_point: float, moment: float, constant: float) -> None:
    env = make(duration=2.0, wind_time_constant=constant, **EXACT).unwrapped
    action = env.operator_action(wind_speed=set_point, moment=moment)
    observations, poses, over = [env.reset(seed=1, options=STATED)[0]], [0.2], False
    while not over:
        observation, _, _, over, info = env.step(action)
        observations.append(observation)
        poses.append(env._engine.pose(0)[0])
    record, log = info["record"], info["operator_log"]
    angle, _, speed = expected(np.linspace(0.0, 2.0, 201), set_point, moment, constant)
    assert poses == pytest.approx(angle, abs=1e-7)
    assert record.yaw_rad[::10] == pytest.approx(angle[:-1], abs=6e-6)
    assert log.wind_speed == pytest.approx(speed[1:], rel=1e-6, abs=1e-6)
    assert [shown[-1] for shown in observations[1:]] == pytest.approx(log.wind_speed)
    assert log.moment == pytest.approx(moment, rel=1e-6)
    assert log.time_s[-1] == pytest.approx(1.99)


def test_holding_the_stated_speed_is_the_plain_preset_to_the_bit() -> None:
    options = STATED | {"wind_speed": 20.0}  # halfway to the limit, which single precision has exactly
    held = episode(
        make(duration=0.5, preset="operator"), np.zeros(2, dtype=np.float32), seed=4, options=options
    )
    plain = episode(make(duration=0.5), seed=4, options=options)
    assert np.array_equal(held[0], plain[0])
    assert np.array_equal(held[1], plain[1])


def test_a_static_moment_turns_the_body_by_what_spring_and_air_leave() -> None:
    options = STATED | {"truth": TRUTH | {"mechanical_damping": 2.0}, "wind_speed": 20.0}
    env = make(duration=6.0, **EXACT)
    action = env.unwrapped.operator_action(wind_speed=20.0, moment=0.4)
    *_, info = episode(env, action, seed=1, options=options)
    body = load_rig().body
    air = 0.5 * load_rig().air.density * 400.0 * body.frontal_area * body.length * TRUTH["cn_beta"]
    assert info["record"].yaw_rad[-1] == pytest.approx(0.4 / (16.12 - air), abs=6e-6)


def test_the_moment_acts_against_friction() -> None:
    env = make(duration=3.0, **EXACT)
    stuck = STATED | {"release_angle": 0.001, "wind_speed": 0.0}
    stuck["effects"] = {"coulomb_friction": {"friction_moment": 0.2}}
    action = env.unwrapped.operator_action(wind_speed=0.0, moment=0.15)
    *_, info = episode(env, action, seed=1, options=stuck)
    assert info["record"].yaw_rad == pytest.approx(0.001, abs=6e-6)


def test_means_of_the_answer_are_its_integral() -> None:
    answer = WindAnswer(0.01, 10, 0.05)
    mean, end = answer.speeds(np.array([5.0]), np.array([20.0]))
    fine = np.linspace(0.0, 0.01, 100_001)
    speed = 20.0 - 15.0 * np.exp(-fine / 0.05)
    trapezoid = [np.trapezoid(part, fine[: len(part)]) / 0.001 for part in np.split(speed[:-1], 10)]
    assert mean[0] == pytest.approx(trapezoid, rel=2e-4)
    assert end[0] == pytest.approx(speed[-1])
    assert FreeDecayConfig(preset="operator").wind_limit == 40.0
