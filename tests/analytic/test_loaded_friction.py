"""Friction in proportion to the load: the closed form for a pendulum, its null law, and a drive as the load.

A pendulum without a spring loses μ Kg ∫|sin β| dβ = μ Kg (2 − cos a − cos b) in a swing from a to b, so that
1 − cos β at the reversals falls by the factor (1 − μ)/(1 + μ), whatever the amplitude.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.reference.effect_cases import settings
from tests.reference.effect_oracle import Setting
from tests.reference.rigs import rig
from tests.support.acting import acting
from tunnel_reference import moments
from tunnel_reference.integrator import BoundLaw, Phase, integrate
from tunnel_sim.effects import effect_from
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.input_moment import InputMoment

RIG = load_rig()
FREE = dataclasses.replace(
    settings(Setting(duration=8.0)), spring_stiffness=0.0, mechanical_damping=0.0, wind_speed=0.0,
    release_angle=1.0, parameters={"gravity_stiffness": 2.0},
)  # fmt: skip


def loaded(load: float, moment: float = 0.0, **changes):
    run = dataclasses.replace(FREE, **changes)
    return acting(effect_from("coulomb_friction", {"friction_moment": moment, "load": load}), run)


@pytest.mark.parametrize("load", [0.02, 0.2])
def test_a_pendulum_swings_down_by_the_closed_form(load):
    found = forward_motion(RIG, loaded(load), 1000.0)
    turns = np.flatnonzero(np.diff(np.sign(found.rate[1:])) != 0) + 1
    heights = 1.0 - np.cos([1.0, *(np.max(np.abs(found.angle[at : at + 2])) for at in turns)])
    assert heights.size > 8
    assert heights[1:] / heights[:-1] == pytest.approx((1.0 - load) / (1.0 + load), rel=3e-4)


def test_a_load_of_no_friction_is_no_friction_and_no_load_the_textbooks():
    plain = dataclasses.replace(FREE, parameters={**FREE.parameters, "friction_moment": 0.02})
    assert loaded(0.0, 0.02) == plain
    null = loaded(0.0)
    assert np.array_equal(forward_motion(RIG, null, 1000.0).angle, forward_motion(RIG, FREE, 1000.0).angle)
    hung = dataclasses.replace(
        plain, parameters={**plain.parameters, "load_stiffness": 3.0, "load_angle": 0.2}
    )
    assert np.array_equal(forward_motion(RIG, plain, 1000.0).angle, forward_motion(RIG, hung, 1000.0).angle)


def test_the_error_falls_with_the_square_of_the_step():
    def angle(step):
        return forward_motion(RIG, loaded(0.2, 0.01, timestep=step), 125.0).angle

    exact = angle(1.25e-4)
    errors = [np.max(np.abs(angle(step) - exact)) for step in (4e-3, 2e-3, 1e-3)]
    assert errors[0] < 1e-5
    assert errors[2] < errors[0] / 8.0


def test_a_body_without_gravity_is_held_by_the_drives_own_friction():
    """A constant moment M accelerates the body by (1 − μ) M: the load is the drive's."""
    drive = InputMoment(np.array([0.0, 9.0]), np.array([0.5, 0.5]), 1.0)
    run = loaded(0.2, parameters={}, drive=drive, release_angle=0.0, duration=1.0)
    angle = forward_motion(RIG, run, 1000.0).angle
    time = np.arange(angle.size) / 1000.0
    assert angle == pytest.approx(0.5 * 0.8 * 0.5 / run.yaw_inertia * time**2, rel=1e-9, abs=1e-12)


def test_the_plugin_and_the_integrator_agree_under_gravity_and_a_drive():
    time = np.arange(0.0, 8.0, 0.01)
    drive = InputMoment(time, 0.8 * np.sin(5.0 * time), 1.0)
    run = loaded(0.1, 0.01, drive=drive)
    engine = simulate_motion(build_model(RIG, run), 1000.0).angle
    assert np.max(np.abs(engine - forward_motion(RIG, run, 1000.0).angle)) < 1e-5


def test_the_reference_simulator_agrees():
    c = rig(duration=1.5)
    given = ({"stiffness": 3.0, "angle": 0.1, "second": 0.0}, {"moment": 0.004, "share": 0.05})
    gravity, friction = ({name: np.full(c.runs, value) for name, value in one.items()} for one in given)
    terms = [
        BoundLaw(moments.gravity, Phase.MOMENT, gravity),
        BoundLaw(moments.loaded_level, Phase.FRICTION, friction),
    ]
    (found,) = integrate([c], [terms], substeps=4)
    (run,) = np.flatnonzero(c.wind_speed == 0.0)[:1]
    law = {"gravity_stiffness": 3.0, "gravity_angle": 0.1, "friction_moment": 0.004, "friction_load": 0.05}
    same = dataclasses.replace(
        FREE, spring_stiffness=float(c.true_stiffness[run]), mechanical_damping=c.mechanical_damping,
        yaw_inertia=c.yaw_inertia, release_angle=float(c.start_angle[run]), duration=1.5, parameters=law,
    )  # fmt: skip
    angle = forward_motion(RIG, same, c.sample_rate).angle
    assert found.angle[:, run] == pytest.approx(angle, abs=1e-6)
