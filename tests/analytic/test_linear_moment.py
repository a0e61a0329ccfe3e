"""The linear moment against MuJoCo's own spring and damper, and against the closed form (issue: 1e-8 rad)."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from tests.analytic.decay_oracle import AREA, LENGTH, closed_form
from tunnel_sim.engine.model import build_model, load_plugin
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives, aerodynamic_damping, aerodynamic_stiffness

RIG = load_rig()
DERIVATIVES = AeroDerivatives(cn_beta=0.35, cn_r=-0.7)
DENSITY, SPEED, RELEASE, DURATION = 1.204, 20.0, 0.3, 20.0
FLOW = {"air_density": DENSITY, "wind_speed": SPEED, "frontal_area": AREA, "reference_length": LENGTH}
KA = aerodynamic_stiffness(DERIVATIVES.cn_beta, **FLOW)
CA = aerodynamic_damping(DERIVATIVES.cn_r, **FLOW)
INERTIA, DAMPING = RIG.dynamics.yaw_inertia, RIG.dynamics.mechanical_damping

TWO_RIGS = """
<mujoco>
  <option integrator="RK4" timestep="0.001"/>
  <extension><plugin plugin="vwt.yaw_moment">
    <instance name="air"><config key="joint" value="with_plugin"/></instance>
  </plugin></extension>
  <custom>
    <numeric name="air_density" data="{density}"/><numeric name="frontal_area" data="{area}"/>
    <numeric name="reference_length" data="{length}"/><numeric name="wind_speed" data="{speed}"/>
    <numeric name="cn_beta" data="{cn_beta}"/><numeric name="cn_r" data="{cn_r}"/>
  </custom>
  <worldbody>
    <body><joint name="with_plugin" axis="0 0 1" stiffness="{k}" damping="{c}"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 {i}"/></body>
    <body pos="2 0 0"><joint name="native" axis="0 0 1" stiffness="{k_native}" damping="{c_native}"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 {i}"/></body>
  </worldbody>
</mujoco>"""


def _settings(spring: float, **changes: float) -> RunSettings:
    given = {"wind_speed": SPEED, "air_density": DENSITY, "release_angle": RELEASE, "duration": DURATION}
    return RunSettings(spring, DERIVATIVES, INERTIA, DAMPING, **{**given, **changes})


def _largest_error(spring: float, timestep: float) -> float:
    motion = simulate_motion(build_model(RIG, _settings(spring, timestep=timestep)), 1.0 / 8e-3)
    exact = closed_form(motion.time_s, RELEASE, spring - KA, DAMPING - CA, INERTIA)
    return float(np.max(np.abs(motion.angle - exact)))


@pytest.mark.parametrize("spring", [2.38, 16.12, 67.98])
def test_plugin_equals_native_spring_and_damper_in_one_model(spring: float) -> None:
    load_plugin()
    numbers = {"density": DENSITY, "area": AREA, "length": LENGTH, "speed": SPEED, "i": INERTIA}
    numbers |= {"cn_beta": DERIVATIVES.cn_beta, "cn_r": DERIVATIVES.cn_r, "k": spring, "c": DAMPING}
    numbers |= {"k_native": spring - KA, "c_native": DAMPING - CA}
    model = mujoco.MjModel.from_xml_string(TWO_RIGS.format(**{k: repr(v) for k, v in numbers.items()}))
    data = mujoco.MjData(model)
    data.qpos[:] = RELEASE
    difference = 0.0
    for _ in range(2000):
        mujoco.mj_step(model, data, 10)
        difference = max(difference, abs(data.qpos[0] - data.qpos[1]))
    assert data.time == pytest.approx(DURATION)
    assert difference < 1e-11  # rounding only: the issue asks for 1e-8


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5, 6])
def test_decay_equals_closed_form(number: int) -> None:
    spring = RIG.spring(number)
    speed = SPEED if spring > KA else 0.0  # spring 1 cannot hold the model at this speed
    motion = simulate_motion(build_model(RIG, _settings(spring, wind_speed=speed)), 1000.0)
    air = (KA, CA) if speed else (0.0, 0.0)
    exact = closed_form(motion.time_s, RELEASE, spring - air[0], DAMPING - air[1], INERTIA)
    assert np.max(np.abs(motion.angle - exact)) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("number", [7, 8, 9, 10])
def test_stiffest_springs_need_half_the_step_for_the_same_error(number: int) -> None:
    # RK4's phase error grows with (omega h)^5: 26 rad/s at 1 ms leaves 1e-7 rad, at 0.5 ms 1e-8
    spring = RIG.spring(number)
    assert _largest_error(spring, 1e-3) < 2e-7
    assert _largest_error(spring, 5e-4) < 1e-8


def test_order_of_convergence_is_four() -> None:
    steps = np.array([8e-3, 4e-3, 2e-3, 1e-3])
    errors = [_largest_error(16.12, step) for step in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.1)


def test_sensor_shows_the_aerodynamic_moment() -> None:
    model = build_model(RIG, _settings(16.12, release_rate=0.4))
    data = model.release_state()
    mujoco.mj_forward(model.mj, data)
    expected = KA * RELEASE + CA * 0.4
    assert data.sensor("aerodynamic_moment").data[0] == pytest.approx(expected, rel=1e-14)
    assert data.sensor("yaw_angle").data[0] == RELEASE
    assert data.sensor("yaw_rate").data[0] == 0.4
