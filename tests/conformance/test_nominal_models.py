"""Every nominal model through one suite, on records that a general-purpose integrator makes from its equation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose
from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.blocks import prepare
from diagnosis.model.choose import nominal_model
from diagnosis.model.data import Data
from diagnosis.model.joint import Joint, with_law
from diagnosis.model.nominal import NominalModel
from diagnosis.model.rig import SpringModel
from diagnosis.model.similar import similar_campaign
from diagnosis.model.similarity import Similarity
from diagnosis.search.prepared import fit_nominal
from tests.reference.linear_rig import response_of_a_loose_body
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import JointLaw, Term

INERTIA, DAMPING, NOISE, RATE = 0.1, 0.05, 3e-4, 200.0
WEIGHT, HARDENING = 12.0, 0.8
TIME = np.arange(0.0, 10.0, 1.0 / RATE)


@dataclass(frozen=True)
class Hardening(SpringModel):
    """Springs of a stated characteristic."""

    further: float = HARDENING

    @property
    def moment(self) -> str:
        """Beside the linear spring."""
        return f"-({self.further!r})*Kr*b^3"


def run(number: int, spring: float | None, restoring: Callable[[float], float]) -> Run:
    def slope(_: float, state: Array) -> tuple[float, float]:
        return state[1], (-DAMPING * state[1] - restoring(state[0])) / INERTIA

    found = solve_ivp(slope, (0.0, TIME[-1]), (0.3, 0.0), "DOP853", TIME, rtol=1e-10, atol=1e-12)
    angle = found.y[0] + np.random.default_rng(number).normal(0.0, NOISE, TIME.size)
    return Run(f"r{number}", Record(TIME, angle), 0.0, spring_stiffness=spring)


def driven_run(number: int) -> Run:
    """A run of a body that nothing holds."""
    rng = np.random.default_rng(number)
    lines = 2.0 * np.pi * np.outer(TIME, np.arange(0.3, 5.0, 0.1))
    given = np.sin(lines + rng.uniform(0.0, 2.0 * np.pi, lines.shape[1])).sum(axis=1)
    given *= 0.5 / given.std()
    angle = response_of_a_loose_body(given, 1.0 / RATE, INERTIA, DAMPING) + rng.normal(0.0, NOISE, TIME.size)
    return Run(f"r{number}", Record(TIME, angle), 0.0, drive=Input("moment_nm", given))


def campaign(*runs: Run) -> Campaign:
    return Campaign("own", RigProperties(), SensorProperties(RATE), runs)


Case = tuple[Campaign, NominalModel, dict[str, float]]


def rig() -> Case:
    runs = (run(i, k, lambda b, k=k: k * b) for i, k in enumerate((16.0, 30.0, 44.0)))
    found = campaign(*runs)
    return found, nominal_model(found), {"yaw_inertia": INERTIA, "mechanical_damping": DAMPING}


def per_inertia() -> Case:
    found = campaign(*(run(i, None, lambda b: 16.0 * b) for i in range(2)))
    omega = math.sqrt(16.0 / INERTIA)
    return found, nominal_model(found), {"omega_n": omega, "zeta": 0.5 * DAMPING / INERTIA / omega}


def loose_body() -> Case:
    found = campaign(*(replace(driven_run(i), spring_stiffness=0.0) for i in range(2)))
    truth = {"yaw_inertia": INERTIA, "mechanical_damping": DAMPING, "moment_offset": 0.0}
    return found, nominal_model(found), truth


def joint() -> Case:
    law = JointLaw(1.1 * INERTIA, WEIGHT, terms=(Term("sin(b)-b", WEIGHT, "N m"),))
    stated, model = with_law(campaign(*(run(i, None, lambda b: WEIGHT * math.sin(b)) for i in range(2))), law)
    return stated, nominal_model(stated, model), {"yaw_inertia": INERTIA, "mechanical_damping": DAMPING}


def loose_joint() -> Case:
    stated, model = with_law(campaign(driven_run(0), driven_run(1)), JointLaw(1.1 * INERTIA, 0.0))
    return stated, nominal_model(stated, model), {"yaw_inertia": INERTIA, "mechanical_damping": DAMPING}


def hardening() -> Case:
    springs = enumerate((16.0, 30.0, 44.0))
    found = campaign(*(run(i, k, lambda b, k=k: k * (b + HARDENING * b**3)) for i, k in springs))
    truth = {"yaw_inertia": INERTIA, "mechanical_damping": DAMPING}
    return found, nominal_model(found, Hardening()), truth


CASES = {one.__name__: one for one in (rig, per_inertia, loose_body, joint, loose_joint, hardening)}


def prepared(case: Case) -> Data:
    stated, model, _ = case
    similar, change = similar_campaign(stated, model)
    noise = {one.id: change.similar(NOISE, "rad") ** 2 for one in stated.runs}
    return prepare(similar, noise, change, model=model.similar(change))


@pytest.fixture(scope="module", params=CASES)
def fitted(request: pytest.FixtureRequest) -> tuple[Case, Fit]:
    case = CASES[request.param]()
    return case, fit_nominal(prepared(case))


def test_its_own_records_leave_noise_and_give_its_parameters(fitted: tuple[Case, Fit]) -> None:
    (_, _, truth), found = fitted
    assert abs(found.excess) < 5.0 * math.sqrt(2.0 / found.count)
    data, names = found.problem.data, found.problem.names
    model = data.model
    for name, value in truth.items():
        unit = model.coefficient_units.get(name) or next(
            one.unit for one in found.problem.parameters.common if one.name == name
        )
        gradient = model.gradient(names, found.point.common, name)
        std = math.sqrt(gradient @ found.covariance @ gradient)
        known = model.coefficient(names, found.point.common, name)
        assert known is not None
        assert abs(data.similarity.own(known, unit) - value) < 4.0 * data.similarity.own(std, unit), name


def test_parameters_are_stated_once_with_units_and_a_start_inside_their_range(
    fitted: tuple[Case, Fit],
) -> None:
    problem = fitted[1].problem
    parameters = problem.parameters
    every = [one.name for one in parameters.parameters]
    assert len(set(every)) == len(every)
    for one in parameters.parameters:
        dimension(one.unit)
        assert one.lower < one.upper
        assert one.size > 0.0
    model = problem.data.model
    assert not set(every) & {name for name in model.held if name != "zero"}
    start = next(iter(model.starts(problem.data)))
    point = parameters.point(start.common, start.own)
    low, high = parameters.bounds
    assert np.all((low <= point.common) & (point.common <= high))
    assert point.per_run.shape == (len(problem.data.runs), len(parameters.own))


def test_gradients_of_its_coefficients_are_their_slopes(fitted: tuple[Case, Fit]) -> None:
    problem, common = fitted[1].problem, fitted[1].point.common
    model, names = problem.data.model, problem.names
    for name in model.coefficient_names(names):
        if model.coefficient(names, common, name) is None:
            continue
        slopes = []
        for step in np.diag(1e-6 * np.maximum(np.abs(common), 1.0)):
            up, down = (model.coefficient(names, common + sign * step, name) for sign in (1.0, -1.0))
            assert up is not None
            assert down is not None
            slopes.append((up - down) / (2.0 * step.sum()))
        np.testing.assert_allclose(model.gradient(names, common, name), slopes, rtol=1e-5, atol=1e-8)


def test_what_it_says_is_said_of_its_runs(fitted: tuple[Case, Fit]) -> None:
    data = fitted[1].problem.data
    spots = data.model.blind_spots(data)
    assert spots
    assert all(spot and not spot.endswith(".") for spot in spots)
    for said, kinds in data.model.untried(fitted[0][0], ALL_EFFECTS).items():
        assert "{}" in said
        assert set(kinds) <= set(ALL_EFFECTS)
    springs = data.model.planned_springs(data)
    assert list(springs) == sorted(springs)


def test_a_rig_of_ones_own_needs_the_spring_of_every_run() -> None:
    stated, _, _ = hardening()
    bare = replace(stated, runs=(replace(stated.runs[0], spring_stiffness=None), *stated.runs[1:]))
    with pytest.raises(TunnelError, match=r"Hardening needs the spring of every run.*: r0"):
        diagnose(bare, model=Hardening())


SLOWER, HEAVIER = 10.0, 3.0


@pytest.mark.parametrize("name", CASES)
def test_it_knows_no_scale(name: str) -> None:
    """A rig whose times are longer and whose moments are larger is the same similar rig."""
    stated, model, _ = CASES[name]()
    runs = tuple(
        replace(
            one,
            record=Record(SLOWER * one.record.time_s, one.record.yaw_rad),
            spring_stiffness=one.spring_stiffness and HEAVIER * one.spring_stiffness,
            drive=one.drive and replace(one.drive, values=HEAVIER * one.drive.values),
        )
        for one in stated.runs
    )
    slow = replace(stated, runs=runs, sensor=replace(stated.sensor, sample_rate=RATE / SLOWER))
    # a change of units does to the model's own constants what the change of the rig does
    changed = model.similar(Similarity(SLOWER, HEAVIER))
    one, other = similar_campaign(stated, model), similar_campaign(slow, changed)
    for before, after in zip(one[0].runs, other[0].runs, strict=True):
        np.testing.assert_allclose(before.record.time_s, after.record.time_s, rtol=1e-9)
        assert after.spring_stiffness == pytest.approx(before.spring_stiffness)
        if before.drive is not None and after.drive is not None:
            np.testing.assert_allclose(before.drive.values, after.drive.values, rtol=1e-6)
    if isinstance(model, Joint):
        mine, theirs = model.similar(one[1]), changed.similar(other[1])
        assert isinstance(mine, Joint)
        assert isinstance(theirs, Joint)
        assert theirs.law.stiffness == pytest.approx(mine.law.stiffness)
        assert theirs.law.inertia == pytest.approx(mine.law.inertia)
        assert theirs.law.terms[0].coefficient == pytest.approx(mine.law.terms[0].coefficient)
