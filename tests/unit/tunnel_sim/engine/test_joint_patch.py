"""What the engine makes of a patched joint."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis.patch.elements import Control, DryFriction, Spring
from tunnel_sim.engine.joint_model import Recorded, read_joint_model
from tunnel_sim.engine.joint_patch import Start, creep_rate, patched, patched_xml, simulate_joint
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.vocabulary.record import Array

HUNG = """<mujoco><worldbody><body><joint name="elbow" axis="0 1 0" frictionloss="{}"/>
<geom type="sphere" size="0.01" mass="0.2" pos="0 0 -0.25"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("friction", "creeps"), [(0.01, True), (1e-6, False)])
def test_friction_below_the_moment_at_the_rest_has_no_rate_of_creep(friction: float, creeps: bool) -> None:
    """At 0.001 rad the weight's moment is 0.5 mN m."""
    assert (creep_rate(mujoco.MjModel.from_xml_string(HUNG.format(friction)), 1e-3) > 0.0) == creeps


SWUNG = """<mujoco><compiler angle="radian"/><option timestep="0.0005" integrator="{}"/><worldbody><body>
<joint name="elbow" axis="0 1 0" type="{}" armature="0.1" stiffness="4" damping="0.02"/>
<geom type="sphere" size="0.05" mass="0.2"/></body></worldbody>
<actuator><motor name="motor" joint="elbow"/></actuator></mujoco>"""
MOMENT, RANGE, END = 0.1, 0.02, 4.0


def contact(inertia: float, times: Array) -> Array:
    """A body on a spring with Dahl's friction, solved by an integrator of controlled error."""

    def rates(_: float, state: Array) -> Array:
        angle, rate, deflection = state
        moment = -4.0 * angle - 0.02 * rate - MOMENT * deflection / RANGE
        return np.array([rate, moment / inertia, rate - abs(rate) * deflection / RANGE])

    found = solve_ivp(rates, (0.0, END), [0.5, 0.0, 0.0], rtol=1e-9, atol=1e-11, t_eval=times, max_step=1e-3)
    return np.asarray(found.y[0])


@pytest.mark.usefixtures("models_in_this_process")
@pytest.mark.parametrize(
    ("kind", "integrator", "allowed"), [("hinge", "RK4", 5e-4), ("slide", "implicitfast", 4e-3)]
)
def test_presliding_friction_is_native(tmp_path: Path, kind: str, integrator: str, allowed: float) -> None:
    """Also as a file, which plain MuJoCo reads; MuJoCo moves the bristles once a step, by its first order."""
    path = tmp_path / "model.xml"
    gravity = '<option gravity="0 0 0"/>'
    path.write_text(SWUNG.format(integrator, kind).replace("<worldbody>", gravity + "<worldbody>"))
    model = read_joint_model(path, "elbow", Recorded(0.5))
    patch = [DryFriction(MOMENT, RANGE), Control(0, lag=0.01)]
    drive = InputMoment(np.array([0.0, END]), np.zeros(2))
    spec, written = patched(model, patch, [Start("r1", 0.0, 0.5, 0.0, drive)])
    assert {one.name: one.after for one in written} == {
        "actuator motor time constant": (0.01,),
        "dcmotor lugre friction": (MOMENT,),
        "dcmotor lugre stiffness": (pytest.approx(MOMENT / RANGE),),
    }
    compiled = mujoco.MjModel.from_xml_string(patched_xml(spec, model, tmp_path))
    assert compiled.nu == 1  # the motor's control alone
    found = simulate_joint(compiled, model.law.rest, Start("r1", 0.0, 0.5, 0.0), END)
    kept = found.time_s <= END
    np.testing.assert_allclose(
        found.angle[kept], contact(model.law.inertia, found.time_s[kept]), atol=allowed, rtol=0.0
    )


@pytest.mark.usefixtures("models_in_this_process")
def test_a_constant_moment_without_an_actuator_is_the_bias_of_an_added_one(tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    path.write_text(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="elbow" axis="0 1 0" damping="0.02"/>
<geom type="sphere" size="0.05" mass="0.2"/></body></worldbody></mujoco>"""
    )
    model = read_joint_model(path, "elbow", Recorded(0.5, 0.0))
    spec, written = patched(model, [Spring((0.1, 0.0, 0.0, 0.0))])
    (one,) = written
    assert (one.name, one.before) == ("actuator moment without control", (0.0,))
    assert one.after == pytest.approx((-0.1,))
    data = mujoco.MjData(compiled := spec.compile())
    mujoco.mj_forward(compiled, data)
    assert data.qfrc_actuator[0] == pytest.approx(-0.1)
