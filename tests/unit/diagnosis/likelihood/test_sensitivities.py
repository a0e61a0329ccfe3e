"""Sensitivities without finite differences of motions: what they agree with, and where there are none."""

import dataclasses

import numpy as np
import pytest

from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.sensitivities import motion_changes, moves
from diagnosis.model.parameters import Point
from tests.unit.diagnosis.likelihood.test_least_squares import SIX, prepared
from tunnel_sim.effects import ALL_EFFECTS, effect_class
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.vocabulary.input_kinds import INPUTS

NOMINAL = {"yaw_inertia": 0.1014, "mechanical_damping": 0.012, "cn_beta": 0.49, "cn_r": -0.11, "zero": 0.004}
#: Parameters that take finite differences: a law, or samples of the wind, that exist on one side only.
BY_DIFFERENCES = {
    "coulomb_friction": {"exponent", "saturation", "peak", "load"},
    "wind_speed_drift": {"settling"},
}
#: Readings at times of their own: all parameters take differences.
READ_BY_DIFFERENCES = {"dropped_samples"}


@pytest.fixture(scope="module")
def data():
    return prepared(settings=SIX[:2])


def at_example(data, kind, forms=()):
    """A fit of an effect, and the point of its example."""
    problem = Problem(data, (kind,), free_forms=tuple(f"{kind.name}.{name}" for name in forms))
    infos = kind.parameters()
    example = dict(zip((info.name for info in infos), kind.example, strict=False))
    values = {f"{kind.name}.{info.name}": example.get(info.name, info.default) for info in infos}
    own = {"release_angle": 0.3, "release_rate": 0.1}
    owns = [{name: own.get(name, 0.5) for name in problem.parameters.own_names} for _ in data.runs]
    return problem, problem.parameters.point(NOMINAL | values, owns)


def without_derivative(problem, point):
    """Names of the parameters by which a motion has no derivative."""
    found = motion_changes(problem, point, moves(problem, point)[0])
    names = [*problem.names, *problem.parameters.own_names]
    return {
        name.rpartition(".")[2]
        for i, name in enumerate(names)
        if any(np.isnan(change[i]).any() for change in found)
    }


@pytest.mark.parametrize("kind", [kind for kind in ALL_EFFECTS if kind.fitted], ids=lambda kind: kind.name)
def test_these_parameters_and_no_others_take_finite_differences(data, kind):
    forms = [info.name for info in kind.parameters() if info.form and info.name != "presliding"]
    problem, point = at_example(data, kind, forms)
    every = {name.rpartition(".")[2] for name in (*problem.names, *problem.parameters.own_names)}
    expected = every if kind.name in READ_BY_DIFFERENCES else BY_DIFFERENCES.get(kind.name, set())
    assert without_derivative(problem, point) == expected


@pytest.mark.parametrize(
    "form", [{"presliding": 0.01}, {"exponent": 0.5}, {"load": 0.1}], ids=["presliding", "root", "load"]
)
def test_friction_without_derivatives_takes_finite_differences(data, form):
    problem, point = at_example(data, effect_class("coulomb_friction"), form)
    common = point.common.copy()
    for name, value in form.items():
        common[problem.names.index(f"coulomb_friction.{name}")] = value
    moved = Point(common, point.per_run)
    assert len(without_derivative(problem, moved)) == common.size + point.per_run.shape[1]


def test_a_rod_that_is_not_separated_takes_finite_differences(data):
    """One that is followed, and one that rings almost as slowly as the body swings."""
    problem, point = at_example(data, effect_class("rod_flexibility"))
    every = point.common.size + point.per_run.shape[1]
    assert not without_derivative(problem, point)
    assert len(without_derivative(dataclasses.replace(problem, resolve_rod_mode=True), point)) == every
    soft = point.common.copy()
    soft[problem.names.index("rod_flexibility.compliance")] = 0.05
    assert len(without_derivative(problem, Point(soft, point.per_run))) == every


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("cubic_stiffness", 2e-4),
        ("unsteady_aero_lag", 2e-4),
        ("coulomb_friction", 2e-4),
        ("rod_flexibility", 2e-4),
        ("wind_speed_offset", 2e-4),
        ("wind_speed_drift", 2e-4),
        ("sensor_nonlinearity", 2e-4),
        ("sensor_drift", 2e-4),
        # the step of a parameter of the reading shows that it is not linear in it
        ("second_mode", 2e-2),
    ],
)
def test_first_order_changes_are_those_of_predictions(data, name, tolerance):
    kind = effect_class(name)
    problem, point = at_example(data, kind)
    points, _ = moves(problem, point)
    found = motion_changes(problem, point, points)
    for i, there in enumerate(points):
        common, release = there.common - point.common, there.per_run - point.per_run
        ends = [Point(point.common + s * common, point.per_run + s * release) for s in (4.0, -4.0)]
        after, before = problem.predict(ends)
        for r, change in enumerate(found):
            expected = (after[r] - before[r]) / 8.0
            error = np.linalg.norm(change[i] - expected)
            assert error <= tolerance * np.linalg.norm(expected) + 1e-12, (i, r)


def driven(data, *, on_body, even):
    """The same runs with an input at the times of their samples, or at others."""
    runs, rng = [], np.random.default_rng(8)
    for number, run in enumerate(data.runs):
        size, interval = run.reading.size * run.block, run.interval / run.block
        times = (np.arange(size) + (0.0 if even else rng.uniform(-0.4, 0.4, size))) * interval
        values = (0.5 if on_body else 0.1) * np.sin((3.0 + number) * times + times**2)
        kind = INPUTS["moment_nm" if on_body else "base_rad"]
        runs.append(dataclasses.replace(run, drive=InputMoment(times, values, kind=kind)))
    return data.with_runs(tuple(runs))


DRIVEN = [
    *((name, body) for name in (
        "spring_miscalibration", "cubic_stiffness", "coulomb_friction", "second_mode", "rod_flexibility",
    )
      for body in (True, False)),
    *((name, True) for name in ("input_delay", "actuator_lag", "actuator_saturation", "actuator_rate_limit")),
]  # fmt: skip


@pytest.mark.parametrize("even", [True, False], ids=["even", "jittered"])
@pytest.mark.parametrize(("name", "on_body"), DRIVEN)
def test_driven_runs_have_derivatives(data, name, on_body, even):
    """Also by what changes the samples of the input, and where they are not at the starts of steps."""
    problem, point = at_example(driven(data, on_body=on_body, even=even), effect_class(name))
    points, _ = moves(problem, point)
    found = motion_changes(problem, point, points)
    expected = problem.predict([point, *points])
    for i, there in enumerate(expected[1:]):
        for change, after, before in zip(found, there, expected[0], strict=True):
            error = np.linalg.norm(change[i] - (after - before))
            assert error <= 2e-2 * np.linalg.norm(after - before) + 1e-12, i
