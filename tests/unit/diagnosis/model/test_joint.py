"""The diagnosis of a joint's law: a pendulum integrated by SciPy is no gap to its own model, whatever its swing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose, read_model, vocabulary
from diagnosis.model.blocks import prepare
from diagnosis.model.joint import reach, with_law
from diagnosis.model.similar import similar_campaign
from diagnosis.patch.written_model import NativeClosure
from diagnosis.search.investigate import investigate
from diagnosis.search.prepared import fit_nominal
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.vocabulary.campaign import Campaign, Quantity, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("models_in_this_process")

NOISE, RATE, ZERO = 1e-3, 200.0, 0.03
MASS, LENGTH, GRAVITY = 0.2, 0.25, 9.81
INERTIA = MASS * LENGTH**2 + 0.4 * MASS * 0.01**2
WEIGHT = MASS * GRAVITY * LENGTH
XML = f"""<mujoco><option timestep="0.001"/><worldbody><body><joint name="hinge" axis="0 1 0" ref="{{}}"/>
<geom type="sphere" size="0.01" mass="{MASS}" pos="0 0 {-LENGTH}"/></body></worldbody></mujoco>"""


def record(
    angle: float, seed: int, *, inertia: float, damping: float, friction: float = 0.0, rest: float = 0.0
) -> Record:
    """A swing of the pendulum as its sensor reads it; friction changes sign within 1e-3 rad/s."""
    time = np.arange(0.0, 8.0, 1.0 / RATE)

    def slope(_: float, state: np.ndarray) -> tuple[float, float]:
        b, r = state
        return r, (-WEIGHT * math.sin(b) - damping * r - friction * math.tanh(r / 1e-3)) / inertia

    method = "LSODA" if friction else "DOP853"
    moved = solve_ivp(slope, (0.0, time[-1]), (angle, 0.0), method, time, rtol=1e-9, atol=1e-11)
    return Record(time, moved.y[0] + rest + ZERO + np.random.default_rng(seed).normal(0.0, NOISE, time.size))


def campaign(*, rest: float = 0.0, **truth: float) -> Campaign:
    records = [record(angle, seed, rest=rest, **truth) for seed, angle in enumerate((2.0, 1.2, 0.6))]
    runs = tuple(Run(f"r{i}", one, 0.0) for i, one in enumerate(records))
    return Campaign("pendulum", RigProperties(), SensorProperties(RATE), runs)


def own_model(
    folder: Path, data: Campaign, ref: float = 0.0, free: tuple[str, ...] | None = None
) -> JointModel:
    path = folder / "pendulum.xml"
    path.write_text(XML.format(ref))
    return read_model(path, "hinge", data, free)


@pytest.mark.parametrize("quantity", ["angle", "rate", "acceleration"])
def test_the_reach_of_a_sensor_of_any_quantity_is_in_radians(quantity: Quantity) -> None:
    """0.4 cos ωt has the rate 0.4 ω and the acceleration 0.4 ω²; a smaller run does not matter."""
    omega, time = 7.0, np.arange(2000) / RATE
    size = 0.4 * omega ** ("angle", "rate", "acceleration").index(quantity)
    runs = tuple(
        Run(name, Record(time, ZERO + share * size * np.cos(omega * time)), 0.0)
        for name, share in (("large", 1.0), ("small", 0.5))
    )
    data = Campaign("swing", RigProperties(), SensorProperties(RATE, quantity=quantity), runs)
    assert reach(data) == pytest.approx(0.4, rel=0.02)  # the frequency of ten cycles is known to 1 %


@pytest.mark.parametrize("ref", [0.0, 180.0])
def test_a_pendulum_is_no_gap_to_its_own_model(tmp_path: Path, ref: float) -> None:
    data = campaign(inertia=1.04 * INERTIA, damping=0.001, rest=math.radians(ref))
    model = own_model(tmp_path, data, ref)
    stated, joint = with_law(data, model.law)
    similar, change = similar_campaign(stated, joint)
    joint = joint.of(stated).similar(change)
    found = fit_nominal(prepare(similar, {run.id: NOISE**2 for run in data.runs}, change, model=joint))
    assert abs(found.excess) < 0.15
    for name, unit, truth in (
        ("yaw_inertia", "kg m2", 1.04 * INERTIA),
        ("mechanical_damping", "N m s/rad", 0.001),
        ("zero", "rad", ZERO - change.rest + math.radians(ref)),
    ):
        place = found.problem.names.index(name)
        std = change.own(math.sqrt(found.covariance[place, place]), unit)
        assert abs(change.own(found.value(name), unit) - truth) < 4.0 * std + 1e-6 * abs(truth), name


def test_without_its_model_the_same_pendulum_is_a_gap() -> None:
    data = campaign(inertia=INERTIA, damping=0.001)
    assert investigate(data, ()).gap.test.detected


def test_what_is_not_free_is_held_at_the_models_value(tmp_path: Path) -> None:
    data = campaign(inertia=INERTIA, damping=0.001)
    model = own_model(tmp_path, data, free=("damping",))
    stated, joint = with_law(data, model.law)
    similar, change = similar_campaign(stated, joint)
    joint = joint.of(stated).similar(change)
    found = fit_nominal(prepare(similar, {run.id: NOISE**2 for run in data.runs}, change, model=joint))
    assert found.problem.names == ("mechanical_damping",)
    stated = found.problem.stated(found.point.common, found.point.per_run[0], found.problem.data.runs[0])
    assert change.own(stated.yaw_inertia, "kg m2") == pytest.approx(INERTIA)
    assert found.problem.zero(found.point.common, found.point.per_run[0]) == pytest.approx(-change.rest)


def test_wind_needs_the_rigs_sizes(tmp_path: Path) -> None:
    data = campaign(inertia=INERTIA, damping=0.001)
    windy = Campaign(
        data.name, data.rig, data.sensor, (Run("w", data.runs[0].record, 10.0, air_density=1.2),)
    )
    with pytest.raises(TunnelError, match="need the rig's sizes beside the model; state frontal_area"):
        with_law(windy, own_model(tmp_path, data).law)


def test_two_springs_are_not_one_model(tmp_path: Path) -> None:
    data = campaign(inertia=INERTIA, damping=0.001)
    runs = tuple(
        Run(run.id, run.record, 0.0, spring) for run, spring in zip(data.runs, (1.0, 2.0, 2.0), strict=True)
    )
    with pytest.raises(TunnelError, match="the runs state 2 springs"):
        with_law(Campaign(data.name, data.rig, data.sensor, runs), own_model(tmp_path, data).law)


def test_a_closure_is_a_share() -> None:
    closure = NativeClosure(101.0, 2.0, 11.0, "on held-out runs")
    assert (closure.fit_closed, closure.native_closed) == pytest.approx((0.99, 0.9))
    assert NativeClosure(101.0, 0.5, 300.0, "").native_closed == 0.0


@pytest.mark.slow
def test_friction_is_found_and_the_patched_model_closes_the_gap_by_itself(tmp_path: Path) -> None:
    data = campaign(inertia=0.97 * INERTIA, damping=0.001, friction=0.004)
    model = own_model(tmp_path, data)
    answer = diagnose(data, kinds=vocabulary(["coulomb_friction", "quadratic_damping"]), model=model)
    assert answer.causes == ("coulomb_friction",)
    assert answer.model is not None
    assert answer.model.closed > 0.9 * answer.model.closed_by_fit > 0.89
    law = read_model(answer.model.write(tmp_path / "out.xml"), "hinge", data).law
    assert law.friction == pytest.approx(0.004, rel=0.01)
    assert law.inertia == pytest.approx(0.97 * INERTIA, rel=0.002)
    assert law.damping == pytest.approx(0.001, rel=0.1)
