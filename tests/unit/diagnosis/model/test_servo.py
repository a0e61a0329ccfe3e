"""Joints held by a position servo and driven by its command; the records are of MuJoCo's own ``<position>``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import kinds_for, refuse_undiagnosable
from diagnosis.model.choose import nominal_model
from diagnosis.model.servo import Servo, ServoPerInertia
from identification import identify
from tests.reference.robot_joints import LEVEL, UPRIGHT, robot, robot_campaign
from tests.support import robots
from tests.support.robots import RUBS, TRUE, near, own_model
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input

pytestmark = pytest.mark.usefixtures("models_in_this_process", "causes_alone_throughout")

KP, KV, DAMPING = 60.0, 4.0, 0.4
KINDS = vocabulary(robots.KINDS)
SERVO = f'<position name="motor" joint="elbow" kp="{KP:g}" kv="{KV:g}"/>'
PEAKS = (0.8, 0.5, 0.6)  # rad


def commanded(
    joint: str = TRUE, kp: float | None = KP, kv: float | None = KV, axis: str = UPRIGHT
) -> Campaign:
    """Runs of the servo; with the gains that the campaign states."""
    data = robot_campaign(robot(joint, axis=axis, actuators=SERVO), PEAKS)
    runs = []
    for run in data.runs:
        assert run.drive is not None
        drive = Input("command_rad", run.drive.values, run.drive.hold, servo_kv=kv)
        runs.append(replace(run, drive=drive, spring_stiffness=kp))
    return replace(data, runs=tuple(runs))


@pytest.fixture(scope="module")
def known() -> Campaign:
    return commanded()


@pytest.fixture(scope="module")
def inertia() -> float:
    return robots.inertia(robot(TRUE, actuators=SERVO))


def test_with_stated_gains_a_servo_has_no_gap_and_shows_inertia_and_damping(
    known: Campaign, inertia: float
) -> None:
    answer = diagnose(known, kinds=KINDS)
    assert answer.causes == ()
    assert near(answer, "yaw_inertia", inertia)
    assert near(answer, "mechanical_damping", DAMPING)  # beside the kv
    assert any("an error of the servo's kv" in spot for spot in answer.blind_spots)
    assert "yaw_inertia" in answer.coefficients.after
    assert not any("cn_" in name for name in answer.coefficients.after)


def test_without_gains_it_is_normalised_and_its_frequency_is_that_of_kp_over_inertia(inertia: float) -> None:
    answer = diagnose(commanded(kp=None, kv=None), kinds=KINDS)
    omega = np.sqrt(KP / inertia)
    assert answer.causes == ()
    assert near(answer, "omega_n", omega)
    assert near(answer, "zeta", (KV + DAMPING) / (2.0 * inertia * omega))
    assert any("which part of the damping is the servo's kv" in spot for spot in answer.blind_spots)


@pytest.mark.slow
def test_friction_of_a_servo_is_named_with_and_without_its_gains(inertia: float) -> None:
    answer = diagnose(commanded(RUBS), kinds=KINDS)
    assert answer.causes == ("coulomb_friction",)
    assert near(answer, "friction_moment", 0.6, 2e-3)
    free = diagnose(commanded(RUBS, None, None), kinds=KINDS)
    assert free.causes == ("coulomb_friction",)
    assert near(free, "friction_moment", 0.6 / inertia, 2e-3)


def test_identify_takes_commands(known: Campaign, inertia: float) -> None:
    estimate = identify(known)
    for found, truth in ((estimate.yaw_inertia, inertia), (estimate.mechanical_damping, KV + DAMPING)):
        assert found is not None
        assert found.value == pytest.approx(truth, rel=2e-3)


@pytest.mark.slow
def test_a_kp_of_the_model_that_is_off_is_fitted_and_written(tmp_path: Path) -> None:
    wrong = SERVO.replace(f'kp="{KP:g}"', 'kp="50"')
    data = commanded(axis=LEVEL, kp=None, kv=None)
    xml = robot('damping="0.4"', axis=LEVEL, actuators=wrong)
    held = diagnose(data, kinds=KINDS, model=own_model(tmp_path, data, xml))
    free = ("inertia", "damping", "rest", "gain")
    fitted = diagnose(data, kinds=KINDS, model=own_model(tmp_path, data, xml, free))
    assert held.causes != ()
    assert fitted.causes == ()
    assert near(fitted, "servo_kp", KP)
    assert fitted.model is not None
    written = mujoco.MjModel.from_xml_string(fitted.model.write(tmp_path / "out.xml").read_text())
    assert written.actuator_gainprm[0, 0] == pytest.approx(KP, rel=5e-3)
    assert written.actuator_biasprm[0, 1] == pytest.approx(-written.actuator_gainprm[0, 0])
    assert written.jnt_stiffness[0] == pytest.approx(0.0, abs=1e-6)


def test_the_format_keeps_the_command_and_the_gains(tmp_path: Path, known: Campaign) -> None:
    write_campaign(known, tmp_path / "servo")
    again = read_campaign(tmp_path / "servo")
    for one, other in zip(known.runs, again.runs, strict=True):
        assert one.drive is not None
        assert other.drive is not None
        assert (other.drive.column, other.drive.servo_kv, other.spring_stiffness) == ("command_rad", KV, KP)
        np.testing.assert_array_equal(one.drive.values, other.drive.values)
    text = (tmp_path / "servo" / "campaign.toml").read_text()
    (tmp_path / "servo" / "campaign.toml").write_text(text.replace("servo_kv", "drive_gain"))
    with pytest.raises(TunnelError, match="drive_gain = 4 with the column command_rad"):
        read_campaign(tmp_path / "servo")


def test_the_kind_of_rig_is_chosen_by_the_column_and_the_gains(known: Campaign) -> None:
    assert type(nominal_model(known)) is Servo
    assert type(nominal_model(commanded(kp=None, kv=None))) is ServoPerInertia
    moments = replace(known, runs=tuple(replace(run, drive=None) for run in known.runs))
    assert type(nominal_model(moments)) is not Servo


def test_why_play_and_effects_of_a_spring_are_not_tried_is_said(known: Campaign) -> None:
    kinds = vocabulary(("free_play", "cubic_stiffness", "spring_miscalibration", "coulomb_friction"))
    kept, said = kinds_for(known, kinds, nominal_model(known))
    assert [kind.name for kind in kept] == ["coulomb_friction"]
    play, others = said
    assert "between motor and link" in play
    assert play.endswith("not tried: free_play.")
    assert others.endswith("is not a spring: cubic_stiffness, spring_miscalibration.")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"drive": None}, "has no command_rad, but other runs do"),
        ({"spring_stiffness": 61.0}, "servos of several gains"),
        ({"spring_stiffness": 0.0}, "the kp of the servo as spring_stiffness"),
    ],
)
def test_what_is_no_campaign_of_one_servo_is_refused_in_one_line(
    known: Campaign, change: dict[str, object], said: str
) -> None:
    first, *others = known.runs
    mixed = replace(known, runs=(replace(first, **change), *others))  # type: ignore[arg-type]
    with pytest.raises(TunnelError, match=said):
        refuse_undiagnosable(mixed)
    with pytest.raises(TunnelError, match="kv is stated without kp"):
        refuse_undiagnosable(commanded(kp=None))


@pytest.mark.parametrize(
    ("actuators", "free", "said"),
    [
        ('<motor name="motor" joint="elbow" gear="20"/>', None, "does not hold a position"),
        ('<motor name="motor" joint="elbow" gear="20"/>', ("gain",), "no position servo drives the joint"),
        (SERVO, ("inertia", "gain"), "where the servo alone holds the joint"),
        (SERVO, ("stiffness", "gain"), "only one of them can be fitted"),
    ],
)
def test_gains_that_cannot_be_had_are_refused_in_one_line(
    tmp_path: Path, known: Campaign, actuators: str, free: tuple[str, ...] | None, said: str
) -> None:
    with pytest.raises(TunnelError, match=said):
        diagnose(known, kinds=KINDS, model=own_model(tmp_path, known, robot(TRUE, actuators=actuators), free))
