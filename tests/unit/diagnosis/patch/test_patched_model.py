"""A law written into a model moves MuJoCo as the fits' integrator moves with it, term by term, in real units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from diagnosis import read_model
from diagnosis.likelihood.least_squares import scaled_residuals
from diagnosis.likelihood.problem import Problem
from diagnosis.model.blocks import prepare
from diagnosis.model.joint import with_law
from diagnosis.model.parameters import Point
from diagnosis.model.similar import similar_campaign
from diagnosis.patch.elements import DryFriction, FoundLaw
from diagnosis.patch.fitted_law import FittedLaw
from diagnosis.patch.patched_model import engine_residual
from tunnel_sim.effects import Effect, effect_class
from tunnel_sim.effects.expression_effect import ExpressionParameter, expression_effect
from tunnel_sim.engine.joint_patch import Start, patched, simulate_joint
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

pytestmark = pytest.mark.usefixtures("models_in_this_process")

NOISE = 1e-3
XML = """<mujoco><option timestep="0.0005" integrator="RK4"/><worldbody><body>
<joint name="hinge" axis="0 1 0" ref="20" damping="0.002 0.001 0" frictionloss="{}"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.6" size="0.01" mass="0.7"/></body></worldbody></mujoco>"""

DETENT = expression_effect(
    "detent",
    channel="stiffness",
    moment="-k*(b*exp(-(b/w)^2)*(1+0.1*sin(omega*t))+c*r*abs(b))",
    parameters={
        "k": ExpressionParameter("N m/rad", 0.1, 0.0, 50.0, 0.0, "depth"),
        "w": ExpressionParameter("rad", 0.3, 0.01, 1.0, 0.3, "width"),
        "c": ExpressionParameter("s", 0.01, 0.0, 1.0, 0.01, "loss"),
    },
)


def pendulum(folder: Path, friction: float = 0.0) -> tuple[Campaign, Path]:
    time = np.arange(0.0, 6.0, 0.005)
    reading = 0.35 + 1.1 * np.exp(-0.1 * time) * np.cos(4.9 * time)
    path = folder / "pendulum.xml"
    path.write_text(XML.format(friction))
    runs = (Run("r1", Record(time, reading), 0.0),)
    return Campaign("pendulum", RigProperties(), SensorProperties(200.0), runs), path


@pytest.mark.parametrize(
    ("kind", "values", "tolerance", "said"),
    [
        ("cubic_stiffness", (0.4, 3.0), 0.05, ""),
        ("cubic_stiffness", (0.2, 4.2), 0.05, "no native element"),
        ("asymmetric_stiffness", (0.2, 2.0), 0.05, ""),
        ("free_play", (0.05,), 0.5, "no native element"),
        ("gravity_stiffness", (3.0, 0.4), 2.0, "polynomial"),
        ("quadratic_damping", (0.05, 2.0), 0.05, ""),
        ("quadratic_damping", (0.05, 2.4), 0.1, "no native element"),
        ("quadratic_damping", (0.02, 3.0), 0.05, ""),  # the cube of the rate is native
        ("structural_damping", (0.05,), 0.05, ""),
        ("coulomb_friction", (0.1,), 0.5, ""),
        ("coulomb_friction", (0.1, 0.01), 0.1, ""),
        ("coulomb_friction", (0.1, 0.01, 0.0, 0.0, 0.0, 0.2, 0.1), 0.1, "no native element"),  # under load
        ("coulomb_friction", (0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.1), 0.1, "no native element"),
        ("coulomb_friction", (0.1, 0.0, 0.3), 0.05, "no native element"),
        ("coulomb_friction", (0.1, 0.0, 0.0, 0.1), 0.05, "no native element"),
        ("coulomb_friction", (0.1, 0.0, 0.0, 0.0, 0.8, 0.3), 0.5, "no native element"),
        ("coulomb_friction", (0.1, 0.0, 0.0, 0.0, 0.1, 4.0), 0.5, "polynomial"),  # a wide peak is native
        ("sensor_nonlinearity", (0.05,), 0.5, "sensor"),
        (DETENT, (1.0, 0.3, 0.05), 0.1, ""),
    ],
)
def test_the_patched_model_moves_as_the_fit_does(
    tmp_path: Path, kind: str | type[Effect], values: tuple[float, ...], tolerance: float, said: str
) -> None:
    data, path = pendulum(tmp_path)
    model = read_model(path, "hinge", data)
    stated, joint = with_law(data, model.law)
    similar, change = similar_campaign(stated, joint)
    joint = joint.of(stated).similar(change)
    effect = effect_class(kind) if isinstance(kind, str) else kind
    prepared = prepare(similar, {"r1": NOISE**2}, change, model=joint)
    held = dict(zip((info.name for info in effect.parameters()), values, strict=False))
    fixed = tuple((f"{effect.name}.{key}", value) for key, value in held.items())
    problem = Problem(prepared, (effect,), fixed)
    at = {
        "yaw_inertia": change.similar(1.2 * model.law.inertia, "kg m2"),
        "mechanical_damping": change.similar(0.004, "N m s/rad"),
        "zero": 0.01,
    }
    common = np.array([at.get(key, 0.0) for key in problem.names])
    own = np.array([1.1, 0.2])
    patch = FoundLaw.of(FittedLaw(problem, common, own))
    kinds = {one.kind for one in patch.differences}
    assert said in kinds if said else kinds.isdisjoint({"no native element", "polynomial"})
    nearest = FoundLaw.of(FittedLaw(problem, common, own, native_only=True))
    assert not nearest.by_plugin
    assert {one.kind for one in nearest.differences}.isdisjoint({"no native element"})
    assert patch.by_plugin or nearest == patch  # what is native already stays as it is
    compiled = patched(model, patch.elements)[0].compile()

    def simulate(common: Array, start: Start, duration: float) -> Motion:
        del common
        return simulate_joint(compiled, model.law.rest, start, duration)

    forward = scaled_residuals(problem, Point(common, own[None]))[0]
    native = engine_residual(problem, common, own, 0, simulate)
    assert (
        np.max(np.abs(forward)) > 10.0
    )  # the motion is not the record, so that the comparison means something
    assert np.sqrt(np.mean((forward - native) ** 2)) < tolerance


def test_the_models_own_friction_is_part_of_the_nominal_model(tmp_path: Path) -> None:
    data, path = pendulum(tmp_path, friction=0.05)
    model = read_model(path, "hinge", data)
    stated, joint = with_law(data, model.law)
    similar, change = similar_campaign(stated, joint)
    joint = joint.of(stated).similar(change)
    prepared = prepare(similar, {"r1": NOISE**2}, change, model=joint)
    law = FittedLaw(Problem(prepared), np.array([0.1, 0.02, 0.0]), np.array([1.1, 0.0]))
    assert DryFriction.fit(law).moment == pytest.approx(0.05)
