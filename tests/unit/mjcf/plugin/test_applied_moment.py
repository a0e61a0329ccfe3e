"""Friction holds against moments of the user, of actuators and of gravity, and grows with them."""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import pytest

from tunnel_sim.engine.model import build_model, load_plugin
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RodTwist, RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives

FRICTION = 0.05  # N m
STILL = RunSettings(
    16.12,
    AeroDerivatives(0.0, 0.0),
    0.1014,
    0.05,
    parameters={"friction_moment": FRICTION},
    release_angle=0.0,
)


def angle_under(settings: RunSettings, moment: float, steps: int) -> float:
    model = build_model(load_rig(), settings)
    data = model.release_state()
    data.qfrc_applied[model.yaw_address] = moment
    mujoco.mj_step(model.mj, data, steps)
    return float(data.qpos[model.yaw_address])


@pytest.mark.parametrize("moment", [0.8 * FRICTION, -0.99 * FRICTION])
def test_friction_holds_a_body_at_rest_against_a_smaller_moment(moment: float) -> None:
    assert angle_under(STILL, moment, 1000) == 0.0


@pytest.mark.parametrize("moment", [10.0 * FRICTION, -10.0 * FRICTION])
def test_a_larger_moment_brings_it_to_rest_within_the_band_of_friction(moment: float) -> None:
    rest = STILL.spring_stiffness * angle_under(STILL, moment, 30_000)
    assert abs(rest - moment) <= FRICTION * (1.0 + 1e-9)
    assert rest != pytest.approx(moment, rel=1e-3)  # it came to rest off the balance: friction holds


def test_the_moment_acts_on_the_springs_end_of_a_rod_that_twists() -> None:
    twisting = replace(STILL, parameters={}, rod_twist=RodTwist(1e-3, 0.3), timestep=5e-4)
    assert STILL.spring_stiffness * angle_under(twisting, 0.5, 60_000) == pytest.approx(0.5, rel=1e-3)


LINK = """<mujoco><option timestep="0.001" integrator="RK4"/>
<extension><plugin plugin="vwt.yaw_moment">
<instance name="joint"><config key="joint" value="joint"/></instance></plugin></extension>
<custom>{numerics}</custom>
<worldbody><body><joint name="joint" type="{kind}" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="0.5"/></body></worldbody>
<actuator><motor joint="joint" gear="2"/></actuator></mujoco>"""


def moved(kind: str, control: float, start: float = 0.0, **friction: float) -> float:
    """The displacement of a driven link in a second, rad, or m of a slide, which gravity does not move."""
    load_plugin()
    air = ("air_density", "wind_speed", "frontal_area", "reference_length", "cn_beta", "cn_r")
    given = {**dict.fromkeys(air, 0.0), **friction}
    numerics = "".join(f'<numeric name="{name}" data="{value}"/>' for name, value in given.items())
    model = mujoco.MjModel.from_xml_string(LINK.format(numerics=numerics, kind=kind))
    data = mujoco.MjData(model)
    data.qpos[0], data.ctrl[0] = start, control
    mujoco.mj_step(model, data, 1000)
    return float(data.qpos[0]) - start


@pytest.mark.parametrize("start", [math.pi / 2 - 0.1, math.pi / 2 + 0.1])
def test_friction_holds_a_link_against_the_models_gravity_and_actuator(start: float) -> None:
    """Near its rest below, gravity's moment is 0.5 g 0.2 sin 0.1 = 0.098 N m."""
    assert abs(moved("hinge", 0.0, start, friction_moment=0.11)) < 1e-12
    assert abs(moved("hinge", 0.0, start, friction_moment=0.05)) > 0.01
    assert abs(moved("hinge", 0.05, start, friction_moment=0.25)) < 1e-12  # 0.1 N m of the motor more


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_friction_grows_with_the_moment_of_an_actuator(share: float) -> None:
    """Closed form of a slide: a force F accelerates the mass by (1 − μ) F/m."""
    found = moved("slide", 0.4, friction_moment=0.0, friction_load=share)
    mass = 0.5
    assert found == pytest.approx(0.5 * (1.0 - share) * 0.8 / mass, rel=1e-9)
