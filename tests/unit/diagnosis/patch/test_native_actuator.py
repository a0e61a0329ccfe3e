"""Lag, delay and limit of an actuator in MuJoCo's own elements move a joint as the laws of the effects do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnosis.findings.cautions import PATCH, sentence_of
from diagnosis.likelihood.problem import Problem
from diagnosis.model.blocks import prepare
from diagnosis.model.fact import Fact
from diagnosis.model.joint import with_law
from diagnosis.model.similar import similar_campaign
from diagnosis.patch.elements import Control, DryFriction, FoundLaw
from diagnosis.patch.fitted_law import FittedLaw
from diagnosis.patch.patched_model import controlled
from tests.reference.robot_joints import MOTOR, NOISE, TIME, multisine, robot, robot_campaign
from tests.support.robots import own_model
from tunnel_sim.effects import effect_class
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.engine.joint_patch import (
    Start,
    history_of,
    patched,
    patched_xml,
    simulate_joint,
)
from tunnel_sim.physics.actuator import ActuatorLimits
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary.campaign import Campaign

pytestmark = pytest.mark.usefixtures("models_in_this_process")

TRUE = 'armature="0.05" damping="0.4"'
SERVO = '<position name="motor" joint="elbow" kp="60" kv="4"/>'


@pytest.fixture(scope="module")
def swung() -> Campaign:
    return robot_campaign(robot(TRUE))


def moved(model: JointModel, patch: Control | None, drive: InputMoment) -> Motion:
    spec, _ = patched(model, [patch] if patch else [])
    return simulate_joint(spec.compile(), model.law.rest, Start("r1", 0.0, 0.0, 0.0, drive), 4.0, 0)


@pytest.mark.parametrize(
    ("made", "delay"),
    [
        (ActuatorLimits(limit=3.0), 0.0),
        (ActuatorLimits(lag=0.03), 0.0),
        (ActuatorLimits(), 0.013),
        (ActuatorLimits(), 0.0135),  # between two steps
        (ActuatorLimits(limit=3.0, lag=0.03), 0.013),
    ],
)
@pytest.mark.parametrize("integrator", ["RK4", "Euler", "implicitfast"])
@pytest.mark.parametrize("actuators", [MOTOR, SERVO])
def test_a_native_actuator_moves_the_joint_as_its_law(
    tmp_path: Path,
    swung: Campaign,
    made: ActuatorLimits,
    delay: float,
    integrator: str,
    actuators: str,
) -> None:
    xml = robot(TRUE, option=f'timestep="0.001" integrator="{integrator}"', actuators=actuators)
    model = own_model(tmp_path, swung, xml)
    assert model.law.actuator is not None
    gain = model.law.actuator.gain
    asked = InputMoment(TIME, multisine(3, 6.0 / gain), gain)
    patch = Control(0, made.limit / gain, made.lag, delay)
    native, plain = moved(model, patch, asked), moved(model, None, asked)
    law = moved(model, None, replace(asked, actuator=made, delay=delay).acting)
    size = np.max(np.abs(law.angle - plain.angle))
    assert size > 0.003  # the actuator matters
    # a control that is held over a step acts half a step late, or early, of a swing of up to 4 Hz
    half_a_step = 2.0 * np.pi * 4.0 * 0.5e-3
    assert np.max(np.abs(native.angle - law.angle)) < half_a_step * np.max(np.abs(law.angle))
    assert np.max(np.abs(native.angle - law.angle)) < 0.2 * size


def test_a_delay_replays_from_a_key_frame_with_the_history_that_its_note_fills(
    tmp_path: Path, swung: Campaign
) -> None:
    model = own_model(tmp_path, swung, robot(TRUE, option='timestep="0.001" integrator="Euler"'))
    assert model.law.actuator is not None
    drive = InputMoment(TIME, 0.2 + multisine(3, 0.3), model.law.actuator.gain)
    start = Start("r1", 0.0, 0.1, 0.5, drive)
    patch = [Control(0, lag=0.02, delay=0.0125)]
    engine = mujoco.MjModel.from_xml_string(patched_xml(patched(model, patch, [start])[0], model, tmp_path))
    wanted = simulate_joint(engine, model.law.rest, start, 0.5, 0).angle

    samples = history_of(0.0125, engine.opt.timestep)
    note = sentence_of(PATCH, Fact("delayed control", {"index": 0, "samples": samples}))
    call = note[note.index("mujoco.mj_init") :].rstrip(".")

    def replayed(*, filled: bool) -> np.ndarray:
        data, found = mujoco.MjData(engine), []
        mujoco.mj_resetDataKeyframe(engine, data, 0)
        if filled:
            exec(call, {"mujoco": mujoco, "numpy": np, "model": engine, "data": data})
        for control in drive.means(engine.opt.timestep * np.arange(wanted.size + 1)):
            found.append(data.qpos[0] - model.law.rest)
            data.ctrl[0] = control
            mujoco.mj_step(engine, data)
        return np.array(found[: wanted.size])

    assert engine.actuator_history[0, 0] == samples
    left = [np.max(np.abs(replayed(filled=filled) - wanted)) for filled in (True, False)]
    assert left[1] > 3e-3
    assert left[0] < 0.1 * left[1]  # the first control is that at the start, not the mean over the first step


def test_what_is_written_is_read_by_mujoco_and_stated(tmp_path: Path, swung: Campaign) -> None:
    model = own_model(tmp_path, swung, robot(TRUE))
    spec, written = patched(model, [Control(0, 0.5, 0.02, 0.013)])
    engine = mujoco.MjModel.from_xml_string(patched_xml(spec, model, tmp_path))
    assert engine.actuator_ctrlrange[0] == pytest.approx([-0.5, 0.5])
    assert engine.actuator_dynprm[0, 0] == pytest.approx(0.02)
    assert engine.actuator_dyntype[0] == mujoco.mjtDyn.mjDYN_FILTEREXACT
    assert engine.actuator_delay[0] == pytest.approx(0.013)
    said = {one.name: (one.after, one.unit) for one in written}
    assert said["actuator motor ctrlrange"] == (pytest.approx((-0.5, 0.5)), "1")
    assert said["actuator motor time constant"] == (pytest.approx((0.02,)), "s")
    assert said["actuator motor delay"] == (pytest.approx((0.013,)), "s")


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"actuator_saturation": 2.0, "actuator_lag": 0.02, "input_delay": 0.01}, (2.0, 0.02, 0.01)),
        ({"actuator_rate_limit": 5.0, "actuator_lag": 0.02}, None),  # MuJoCo limits no rate
        ({"input_delay": -0.01}, None),  # nor is an input early
        ({"coulomb_friction": 0.1}, None),
    ],
)
def test_what_a_fit_found_of_the_actuator_is_written_in_the_units_of_the_rig(
    tmp_path: Path, swung: Campaign, values: dict[str, float], expected: tuple[float, float, float] | None
) -> None:
    model = own_model(tmp_path, swung, robot(TRUE))
    stated, joint = with_law(swung, model.law)
    similar, change = similar_campaign(stated, joint)
    joint = joint.of(stated).similar(change)
    prepared = prepare(similar, {run.id: NOISE**2 for run in swung.runs}, change, model=joint)
    kinds = tuple(effect_class(name) for name in values)
    sizes = {kind.name: (kind.parameters()[0].name, kind.parameters()[0].unit) for kind in kinds}
    fixed = tuple((f"{n}.{sizes[n][0]}", change.similar(v, sizes[n][1])) for n, v in values.items())
    problem = Problem(prepared, kinds, fixed)
    common, own = np.zeros(len(problem.names)), np.zeros(len(problem.parameters.own))
    common[problem.names.index("yaw_inertia")] = 1.0
    assert model.law.actuator is not None
    law = FittedLaw(problem, common, own, controlled=(own, 0))
    patch = Control.fit(law)
    said = {one.kind for one in FoundLaw.of(law).differences}
    if expected is None:
        assert patch is None
        assert bool(said & {"actuator", "delayed input"}) == any(kind.driven for kind in kinds)
        return
    soft = Problem(
        prepared, kinds, (*fixed, ("actuator_saturation.softness", 0.4)), ("actuator_saturation.softness",)
    )
    if "actuator_saturation" in values:  # a control range is hard
        assert Control.fit(replace(law, problem=soft)) is None
    assert patch is not None
    limit, lag, delay = expected
    assert (patch.limit * model.law.actuator.gain, patch.lag, patch.delay) == pytest.approx(
        (limit, lag, delay)
    )
    assert not said & {"actuator", "delayed input"}


def test_only_a_control_goes_through_the_actuator(tmp_path: Path, swung: Campaign) -> None:
    model = own_model(tmp_path, swung, robot(TRUE))
    assert controlled(swung, model.law.actuator) == {"r1", "r2", "r3"}
    moments = robot_campaign(robot(TRUE), (1.0,), column="moment_nm")
    assert controlled(moments, model.law.actuator) == frozenset()
    assert controlled(swung, None) == frozenset()


def test_the_mean_load_of_a_held_input_is_that_of_its_values(tmp_path: Path, swung: Campaign) -> None:
    """A control that alternates between ±u from sample to sample is ±u at every time: the mean size is u."""
    model = own_model(tmp_path, swung, robot(TRUE))
    stated, joint = with_law(swung, model.law)
    similar, change = similar_campaign(stated, joint)
    joint = joint.of(stated).similar(change)
    prepared = prepare(similar, {run.id: NOISE**2 for run in swung.runs}, change, model=joint)
    alternating = 0.3 * (-1.0) ** np.arange(TIME.size)
    prepared = prepared.with_runs(tuple(run.with_input(values=alternating) for run in prepared.runs))
    fixed = {
        "coulomb_friction.friction_moment": change.similar(0.1, "N m"),
        "coulomb_friction.load": 0.05,
        "input_delay.delay": change.similar(0.3 * (TIME[1] - TIME[0]), "s"),
    }
    kinds = effect_class("coulomb_friction"), effect_class("input_delay")
    problem = Problem(prepared, kinds, tuple(fixed.items()))
    common, own = np.zeros(len(problem.names)), np.zeros(len(problem.parameters.own))
    common[problem.names.index("yaw_inertia")] = 1.0
    law = FittedLaw(problem, common, own, controlled=(own, 0), native_only=True)
    friction = DryFriction.fit(law)
    assert model.law.actuator is not None
    assert friction.moment == pytest.approx(0.1 + 0.05 * 0.3 * model.law.actuator.gain, rel=1e-3)
    assert not friction.own
