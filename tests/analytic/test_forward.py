"""The forward integrator against the MuJoCo model at the same step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.analytic.law_cases import CASES, REVERSING, RIG, SAMPLE_RATE, Case
from tests.marks import slow
from tests.reference.free_decays import damped_cosine
from tunnel_sim.engine.model import build_model
from tunnel_sim.engine.simulate import simulate_motion
from tunnel_sim.physics.forward import backlash, forward_motion, forward_run, integrate
from tunnel_sim.physics.moment_law import parameter_vector
from tunnel_sim.physics.run_settings import RodTwist, RunSettings
from tunnel_sim.physics.steps import compensated


def _difference(settings: RunSettings) -> float:
    model = simulate_motion(build_model(RIG, settings), SAMPLE_RATE)
    forward = forward_motion(RIG, settings, SAMPLE_RATE)
    assert np.array_equal(model.time_s, forward.time_s)
    return float(np.max(np.abs(model.angle - forward.angle)))


@pytest.mark.parametrize("case", [c for c in CASES if c not in REVERSING], ids=lambda case: case.name)
@pytest.mark.parametrize("timestep", [1e-3, slow(5e-4)])
def test_equals_the_model(case: Case, timestep: float) -> None:
    # the same law and the same method: what is left is rounding
    assert _difference(case.settings(timestep)) < 1e-11


@pytest.mark.parametrize("case", REVERSING, ids=lambda case: case.name)
def test_differs_from_the_model_by_its_treatment_of_reversals_only(case: Case) -> None:
    assert _difference(case.settings()) < case.tolerance + case.forward_tolerance
    assert _difference(case.settings(5e-4)) < 0.5 * (case.tolerance + case.forward_tolerance)


def test_rate_is_that_of_the_model() -> None:
    settings = replace(Case("", {"aero_lag": 2.0}, twist=RodTwist(2e-3, 0.3)).settings(), release_rate=0.5)
    model = simulate_motion(build_model(RIG, settings), SAMPLE_RATE)
    assert np.max(np.abs(model.rate - forward_motion(RIG, settings, SAMPLE_RATE).rate)) < 1e-11


def test_a_run_that_grows_without_bound_is_named() -> None:
    steady, wild = (
        Case("").settings(),
        replace(Case("", {"quadratic_damping": -0.5}).settings(), duration=10.0),
    )
    prepared = [forward_run(one) for one in (steady, wild)]
    law = np.array([parameter_vector(one.law(RIG)) for one in (steady, wild)])
    assert integrate(law, np.concatenate([run for run, _ in prepared]), 10_000)[2] == 2
    with pytest.raises(ValueError, match="without bound"):
        forward_motion(RIG, wild, SAMPLE_RATE)


def test_law_of_the_wrong_shape_is_refused() -> None:
    run, _ = forward_run(Case("").settings())
    with pytest.raises(ValueError, match="law has shape"):
        integrate(np.zeros((1, 3)), run, 10)


def test_backlash_follows_only_when_pushed() -> None:
    angle = np.array([0.0, 1.0, 2.0, 1.5, 0.5, -1.0, -0.5, 0.4])
    assert backlash(angle, 0.5, 0.0) == pytest.approx([0.0, 0.5, 1.5, 1.5, 1.0, -0.5, -0.5, -0.1])
    assert np.array_equal(backlash(angle, 0.0, 7.0), angle)


def _compensated(step: float, spring: float) -> tuple[np.ndarray, np.ndarray]:
    """Ten seconds in compensated steps, and the closed form."""
    settings = replace(Case("", spring=spring, speed=0.0).settings(), duration=10.0, release_rate=1.0)
    run, keep = forward_run(settings)
    given = parameter_vector(settings.law(RIG))[None]
    law, (longer,) = compensated(given, np.zeros(1), np.array([step]))
    run["step"], run["steps"] = longer, 1
    time = np.arange(round(10.0 / step)) * step
    angle, _, _ = integrate(law, run, time.size)
    del keep
    rig = RIG.dynamics
    stiffness, damping = spring / rig.yaw_inertia, rig.mechanical_damping / rig.yaw_inertia
    return angle[0], damped_cosine(time, damping, stiffness, settings.release_angle, settings.release_rate)


def test_compensation_takes_the_leading_error_of_long_steps_away() -> None:
    errors = [np.max(np.abs(np.subtract(*_compensated(step, 67.98)))) for step in (4e-3, 2e-3)]
    assert errors[0] < 5e-7  # rad; 4e-6 without it
    assert np.log2(errors[0] / errors[1]) > 4.7  # the method's own order is four
