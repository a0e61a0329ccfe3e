"""Driven joints of a model of one's own: what is read of an actuator, and what is diagnosed and written.

The truth is simulated by MuJoCo's own steps with the control of its actuator (``tests/reference/robot_joints.py``).
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import refuse_undiagnosable
from diagnosis.model.joint import with_law
from tests.marks import slow
from tests.reference.robot_joints import (
    GEAR,
    LEVEL,
    MOTOR,
    NOISE,
    RATE,
    UPRIGHT,
    positions,
    robot,
    robot_campaign,
)
from tests.support.robots import KINDS, RUBS, TRUE, inertia, near, own_model
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Hold

pytestmark = pytest.mark.usefixtures("models_in_this_process")


@pytest.fixture(scope="module")
def swung() -> Campaign:
    return robot_campaign(robot(TRUE))


@pytest.mark.parametrize(
    ("actuator", "gain", "stiffness", "damping", "servo"),
    [
        (MOTOR, GEAR, 0.0, 0.0, (0.0, 0.0)),
        ('<general joint="elbow" gear="-3" gainprm="2"/>', -6.0, 0.0, 0.0, (0.0, 0.0)),
        ('<position name="motor" joint="elbow" kp="8" kv="0.5"/>', 8.0, 8.0, 0.5, (0.0, -8.0)),
        ('<velocity name="motor" joint="elbow" kv="0.7" gear="2"/>', 1.4, 0.0, 2.8, (0.0, 0.0)),
        ('<general joint="elbow" biastype="affine" biasprm="3 -5 -0.1"/>', 1.0, 5.0, 0.1, (3.0, -5.0)),
    ],
)
def test_the_gain_of_an_actuator_and_what_a_servo_adds_to_the_law(
    tmp_path: Path,
    swung: Campaign,
    actuator: str,
    gain: float,
    stiffness: float,
    damping: float,
    servo: tuple[float, float],
) -> None:
    law = own_model(tmp_path, swung, robot(actuators=actuator)).law
    assert law.actuator is not None
    assert law.actuator.gain == pytest.approx(gain)
    assert law.actuator.servo == pytest.approx(servo)
    assert (law.stiffness, law.damping) == pytest.approx((stiffness, damping))
    assert law.inertia == pytest.approx(inertia(robot()), rel=1e-9)
    run = with_law(swung, law)[0].runs[0]
    assert run.input_gain == pytest.approx(gain)


def test_a_joint_that_nothing_holds_rests_in_the_middle_of_its_records(
    tmp_path: Path, swung: Campaign
) -> None:
    law = own_model(tmp_path, swung, robot()).law
    assert law.stiffness == 0.0
    assert law.terms == ()
    assert law.rest == pytest.approx(np.median([np.mean(run.record.yaw_rad) for run in swung.runs]))
    assert law.free == ("inertia", "damping", "rest")
    assert (
        replace(law, free=("inertia",)).held.items()
        >= {"mechanical_damping": 0.0, "moment_offset": 0.0}.items()
    )


def test_gravity_and_a_spring_of_a_driven_joint_are_free_with_its_inertia(
    tmp_path: Path, swung: Campaign
) -> None:
    hangs = own_model(tmp_path, swung, robot(axis=LEVEL)).law
    assert hangs.hangs
    assert hangs.rest == pytest.approx(math.pi / 2)
    assert hangs.free == ("inertia", "damping", "rest")
    sprung = own_model(tmp_path, swung, robot('stiffness="5"')).law
    assert not sprung.hangs
    assert sprung.free == ("inertia", "damping", "stiffness", "rest")


def test_a_slide_that_nothing_holds_has_its_weight(tmp_path: Path, swung: Campaign) -> None:
    law = own_model(tmp_path, swung, robot('type="slide"', axis=UPRIGHT)).law
    assert law.slide
    assert [(term.expression, term.unit) for term in law.terms] == [("1", "N m")]
    assert law.terms[0].coefficient == pytest.approx(2.0 * 9.81, rel=1e-9)


TWO = MOTOR + '<motor name="second" joint="elbow"/>'


@pytest.mark.parametrize(
    ("xml", "rest", "said"),
    [
        (robot(actuators=TWO), {}, "several actuators: motor, second; name the actuator whose"),
        (robot(actuators=TWO), {"actuator": "motors"}, "no actuator 'motors'; did you mean 'motor'"),
        (robot(actuators=""), {}, "the model has no actuator of the joint"),
        (robot(actuators=MOTOR.replace("/>", ' ctrlrange="-0.1 0.1"/>')), {}, "outside -0.1 to 0.1 of its ctrl"),
        (robot(actuators=MOTOR.replace("/>", ' forcerange="-0.1 9"/>')), {}, "outside -2 to 180 N m of its force"),
        (robot('actuatorfrcrange="-3 3"'), {}, "outside -3 to 3 N m of its force range"),
        (robot(actuators='<position joint="elbow" kp="9" timeconst="0.1"/>'), {}, "actuators with states"),
        (robot(actuators=MOTOR.replace("/>", ' delay="0.01" nsample="10"/>')), {}, "delays its control"),
        (robot(actuators='<general joint="elbow" gaintype="affine" gainprm="1 2 0"/>'), {}, "not in proportion"),
        (robot('range="-0.01 0.01"'), {}, "a limit or another constraint acts"),
        (robot(), {"free": ("stiffness",)}, "no spring whose stiffness could be fitted"),
    ],
)  # fmt: skip
def test_what_no_control_can_be_taken_from_is_refused_in_one_line(
    tmp_path: Path, swung: Campaign, xml: str, rest: dict, said: str
) -> None:
    with pytest.raises(TunnelError) as refusal:
        with_law(swung, own_model(tmp_path, swung, xml, **rest).law)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert refusal.value.remedy


def changed(data: Campaign, **drive: object) -> Campaign:
    return replace(data, runs=tuple(replace(r, drive=replace(r.drive, **drive)) for r in data.runs))  # type: ignore[type-var]


def test_inputs_that_are_not_the_joints_are_refused_in_one_line(tmp_path: Path, swung: Campaign) -> None:
    law = own_model(tmp_path, swung, robot()).law
    with pytest.raises(
        TunnelError, match=r"drive_gain = 3 is stated, but actuator 'motor' gives 20 N m per unit"
    ):
        with_law(changed(swung, gain=3.0), law)
    assert with_law(changed(swung, gain=GEAR), law)[0].runs[0].input_gain == GEAR
    with pytest.raises(TunnelError, match="the joint of a model has no moving root"):
        with_law(changed(swung, column="base_rad"), law)
    loose = own_model(tmp_path, swung, robot(actuators="")).law
    assert with_law(changed(swung, gain=3.0), loose)[0].runs[0].input_gain == 3.0
    free = replace(swung, runs=(*swung.runs, replace(swung.runs[0], id="free", drive=None)))
    with pytest.raises(TunnelError, match="the joint of the model has no restoring moment, and free"):
        refuse_undiagnosable(*with_law(free, law))
    rates = replace(swung, sensor=replace(swung.sensor, quantity="rate"))
    sprung = replace(law, stiffness=5.0)  # else the spring is missing
    with pytest.raises(TunnelError, match="do not determine the position of the model's joint"):
        refuse_undiagnosable(*with_law(rates, sprung))


def test_a_step_has_the_mean_of_the_input_over_it() -> None:
    times, values = np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 0.0])
    held = InputMoment(times, values, held=True)
    assert held.means(np.array([0.0, 0.5, 1.5, 3.0])) == pytest.approx([1.0, 2.0, 1.0])
    linear = replace(held, held=False)
    assert linear.means(np.array([0.0, 0.5, 1.5, 3.0])) == pytest.approx([1.5, 2.5 - 0.125, 0.1875 * 4 / 3])
    late = replace(held, delay=0.5)
    assert late.means(np.array([0.0, 0.5, 1.0, 2.0])) == pytest.approx([1.0, 1.0, 2.0])


def left_by_plain_mujoco(xml: str, data: Campaign, key: bool, column: str = "drive") -> float:
    """Greatest root mean square over the runs of reading less simulation, rad."""
    found = []
    for k, run in enumerate(data.runs):
        assert run.drive is not None
        model = mujoco.MjModel.from_xml_string(xml)
        start = float(run.record.yaw_rad[0]), 0.0
        if key:
            start = float(model.key_qpos[k, 0]), float(model.key_qvel[k, 0])
        moved = positions(xml, run.drive.values, run.drive.hold, start=start, column=column)  # type: ignore[arg-type]
        found.append(float(np.sqrt(np.mean((moved - run.record.yaw_rad) ** 2))))
    return max(found)


@pytest.mark.parametrize("hold", ["zero", pytest.param("linear", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("axis", "start"), [pytest.param(UPRIGHT, 0.0, marks=pytest.mark.slow), (LEVEL, math.pi / 2)]
)
def test_a_joint_that_lacks_nothing_but_armature_and_damping_has_no_gap(
    tmp_path: Path, axis: str, start: float, hold: Hold
) -> None:
    truth = robot(TRUE, axis=axis)
    data = robot_campaign(truth, hold=hold, start=start)
    model = own_model(tmp_path, data, robot(axis=axis))
    answer = diagnose(data, kinds=vocabulary(KINDS), model=model)
    assert answer.causes == ()
    assert near(answer, "yaw_inertia", inertia(truth))
    assert near(answer, "mechanical_damping", 0.4)
    assert answer.confirmation.agrees
    assert answer.model is not None
    xml = answer.model.write(tmp_path / "out.xml").read_text()
    assert left_by_plain_mujoco(xml, data, key=True) < 1.1 * NOISE
    assert left_by_plain_mujoco(robot(axis=axis), data, key=False) > 100.0 * NOISE
    written = mujoco.MjModel.from_xml_string(xml)
    assert written.dof_armature[0] == pytest.approx(0.05, rel=0.01)
    assert written.dof_damping[0] == pytest.approx(0.4, rel=0.01)


SERVO = '<position name="motor" joint="elbow" kp="60" kv="4"/>'


@pytest.mark.parametrize(
    ("axis", "start", "actuators", "peaks", "damping"),
    [
        pytest.param(UPRIGHT, 0.0, MOTOR, (0.3, 0.2, 0.25), 0.4, marks=pytest.mark.slow),
        slow(LEVEL, math.pi / 2, MOTOR, (0.3, 0.2, 0.25), 0.4),  # so has test_diagnose_own_model.py
        pytest.param(LEVEL, 0.0, SERVO, (0.8, 0.5, 0.6), 4.4, marks=pytest.mark.slow),
    ],
)
def test_dry_friction_is_named_and_the_model_with_it_closes_the_gap_by_itself(
    tmp_path: Path, axis: str, start: float, actuators: str, peaks: tuple[float, ...], damping: float
) -> None:
    truth, given = robot(RUBS, axis=axis, actuators=actuators), robot(axis=axis, actuators=actuators)
    data = robot_campaign(truth, peaks, start=start)
    answer = diagnose(data, kinds=vocabulary(KINDS), model=own_model(tmp_path, data, given))
    assert answer.causes == ("coulomb_friction",)
    # MuJoCo's friction is soft, which costs a thousandth of each number
    assert near(answer, "friction_moment", 0.6, 2e-3)
    assert near(answer, "yaw_inertia", inertia(truth), 2e-3)
    assert near(answer, "mechanical_damping", damping, 2e-3)
    assert answer.model is not None
    assert answer.model.closed > 0.99
    xml = answer.model.write(tmp_path / "out.xml").read_text()
    before = left_by_plain_mujoco(given, data, key=False)
    assert left_by_plain_mujoco(xml, data, key=True) < 0.02 * before > 2.0 * NOISE
    written = mujoco.MjModel.from_xml_string(xml)
    assert written.dof_frictionloss[0] == pytest.approx(0.6, rel=0.01)
    assert written.dof_armature[0] == pytest.approx(0.05, rel=0.02)
    assert written.dof_damping[0] == pytest.approx(0.4, rel=0.02)


@pytest.mark.slow
def test_a_payload_is_an_error_of_gravity(tmp_path: Path) -> None:
    truth, given = robot(TRUE, axis=LEVEL, tip=0.6), robot(TRUE, axis=LEVEL)
    data = robot_campaign(truth, start=math.pi / 2)
    answer = diagnose(data, kinds=vocabulary(KINDS), model=own_model(tmp_path, data, given))
    assert answer.causes == ("gravity_stiffness",)
    assert near(answer, "stiffness", 0.1 * 9.81 * 0.4)
    assert near(answer, "yaw_inertia", inertia(truth))
    assert answer.model is not None
    xml = answer.model.write(tmp_path / "out.xml").read_text()
    assert left_by_plain_mujoco(xml, data, key=True) < 1.5 * NOISE


@pytest.mark.slow
def test_a_constant_moment_is_the_bias_of_the_actuator(tmp_path: Path) -> None:
    biased = '<general name="motor" joint="elbow" gear="20" biastype="affine" biasprm="0.004 0 0"/>'
    data = robot_campaign(robot(TRUE, actuators=biased))
    answer = diagnose(data, kinds=vocabulary(KINDS), model=own_model(tmp_path, data, robot()))
    assert answer.causes == ()
    assert near(answer, "moment_offset", 0.08)
    assert answer.model is not None
    xml = answer.model.write(tmp_path / "out.xml").read_text()
    written = mujoco.MjModel.from_xml_string(xml)
    assert written.actuator_biasprm[0, 0] == pytest.approx(0.004, rel=0.01)
    assert left_by_plain_mujoco(xml, data, key=True) < 1.1 * NOISE


@pytest.mark.slow
def test_a_known_moment_needs_no_actuator(tmp_path: Path) -> None:
    biased = '<general joint="elbow" biastype="affine" biasprm="0.08 0 0"/>'
    data = robot_campaign(robot(TRUE, actuators=biased), (6.0, 4.0, 5.0), column="moment_nm")
    answer = diagnose(data, kinds=vocabulary(KINDS), model=own_model(tmp_path, data, robot(actuators="")))
    assert answer.causes == ()
    assert near(answer, "yaw_inertia", inertia(robot(TRUE)))
    assert answer.model is not None
    xml = answer.model.write(tmp_path / "out.xml").read_text()
    assert (
        mujoco.MjModel.from_xml_string(xml).actuator(0).name == "elbow_moment"
    )  # it has the constant moment
    assert left_by_plain_mujoco(xml, data, key=True, column="moment_nm") < 1.1 * NOISE


@pytest.mark.slow
def test_gear_play_before_a_spring_is_written_for_the_plugin(tmp_path: Path) -> None:
    spring = '<fixed springlength="-0.02 0.02" stiffness="40"><joint joint="elbow" coef="1"/></fixed>'
    truth = robot('damping="0.4"').replace("<actuator>", f"<tendon>{spring}</tendon><actuator>")
    data = robot_campaign(truth, (0.5, 0.3, 0.4))
    model = own_model(tmp_path, data, robot('stiffness="40"'))
    answer = diagnose(data, kinds=vocabulary([*KINDS, "free_play", "cubic_stiffness"]), model=model)
    assert answer.causes == ("free_play",)
    assert near(answer, "half_width", 0.02)
    assert answer.model is not None
    assert answer.model.closed > 0.99
    assert any("vwt.yaw_moment adds it" in note for note in answer.model.notes)
    nearest = answer.model.native
    assert nearest is not None
    assert nearest.closed < answer.model.closed
    mujoco.MjModel.from_xml_string(nearest.write(tmp_path / "native.xml").read_text())  # without the plugin
    assert "yaw_moment" not in (tmp_path / "native.xml").read_text()


@pytest.mark.slow
def test_a_delay_of_the_input_is_named_and_written_into_the_actuator(tmp_path: Path) -> None:
    data = robot_campaign(robot(TRUE), delay=2)
    answer = diagnose(data, kinds=vocabulary(KINDS), model=own_model(tmp_path, data, robot()))
    assert answer.causes == ("input_delay",)
    assert near(answer, "delay", 2.0 / RATE)
    assert answer.model is not None
    assert answer.model.closed > 0.999
    assert not any("delay of the input" in note for note in answer.model.notes)
    xml = answer.model.write(tmp_path / "out.xml").read_text()
    assert mujoco.MjModel.from_xml_string(xml).actuator_delay[0] == pytest.approx(2.0 / RATE, rel=0.02)


@pytest.mark.slow
def test_a_lag_of_the_actuator_is_named_and_written_as_its_filter(tmp_path: Path) -> None:
    lagging = MOTOR.replace("/>", ' dyntype="filterexact" dynprm="0.03"/>').replace("<motor", "<general")
    data = robot_campaign(robot(TRUE, actuators=lagging))
    kinds = vocabulary((*KINDS, "actuator_lag", "actuator_saturation"))
    answer = diagnose(data, kinds=kinds, model=own_model(tmp_path, data, robot()))
    assert answer.causes == ("actuator_lag",)
    assert near(answer, "lag", 0.03, 0.02)
    assert answer.model is not None
    assert answer.model.closed > 0.998
    written = mujoco.MjModel.from_xml_string(answer.model.write(tmp_path / "out.xml").read_text())
    assert written.actuator_dynprm[0, 0] == pytest.approx(0.03, rel=0.02)
    assert written.key_act[:, 0] == pytest.approx(
        [run.drive.values[0] for run in data.runs if run.drive], rel=1e-4
    )


@pytest.mark.parametrize("integrator", [slow("implicitfast"), "Euler"])
def test_half_a_step_of_the_models_integrator_is_not_a_cause(tmp_path: Path, integrator: str) -> None:
    option = f'timestep="0.002" integrator="{integrator}"'
    data = robot_campaign(robot(TRUE, option=option), start=0.1)
    model = own_model(tmp_path, data, robot(option=option))
    assert model.law.step == 0.002
    answer = diagnose(data, kinds=vocabulary(KINDS), model=model)
    assert answer.causes == ()
    said = "leads its input by 1 ms. MuJoCo's first-order integrators cause a lead of up to half the step of 2 ms"
    assert any(said in caution for caution in answer.cautions)
    assert answer.model is not None
    assert any("half a step, 1 ms, before its input" in note for note in answer.model.notes)
    xml = answer.model.write(tmp_path / "out.xml").read_text()
    assert left_by_plain_mujoco(xml, data, key=True) < 1.5 * NOISE
    written = mujoco.MjModel.from_xml_string(xml)
    assert written.dof_armature[0] == pytest.approx(0.05, rel=0.01)
