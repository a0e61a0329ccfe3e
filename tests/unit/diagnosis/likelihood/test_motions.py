"""Predictions of many runs at once: equal to those of each run alone, whatever is predicted beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.problem import Problem
from diagnosis.model.blocks import prepare
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.settings import Settings
from tests.reference import free_decays
from tests.reference.free_decays import Setting
from tunnel_sim.effects import Effect, effect_class

NOISE = 4e-4
KINDS = {
    "": [],
    "coulomb_friction": [0.02],
    "cubic_stiffness": [0.3],
    "unsteady_aero_lag": [0.5],
    "rod_flexibility": [1e-3, 0.3],
    "wind_speed_drift": [0.02],
    "sensor_clipping": [0.3],
}


@pytest.fixture(scope="module")
def data() -> Data:
    settings = tuple(Setting(spring, speed) for spring in (16.12, 44.84, 67.98) for speed in (0.0, 20.0))
    rng = np.random.default_rng(1)
    found = free_decays.campaign(settings, noise=NOISE, rate=500.0, duration=2.0, rng=rng)
    return prepare(found, {run.id: NOISE**2 for run in found.runs})


def points(values: list[float]) -> list[Point]:
    """Several of them, of which the third cannot be predicted."""
    common = np.array([0.1014, 0.012, 0.49, -0.11, 0.004, *values])
    release = np.column_stack([np.linspace(0.2, 0.4, 6), np.linspace(-0.1, 0.1, 6)])
    found = [Point(common * (1.0 + 1e-3 * i), release * (1.0 + 0.01 * i)) for i in range(8)]
    found[2] = Point(np.full(common.size, np.nan), release)
    return found


def kinds(name: str) -> tuple[type[Effect], ...]:
    return (effect_class(name),) if name else ()


@pytest.mark.parametrize("name", KINDS)
def test_a_run_has_the_same_bits_in_any_company_and_any_number_of_threads(data: Data, name: str) -> None:
    asked, problem = points(KINDS[name]), Problem(data, kinds(name))
    together = problem.predict(asked)
    for threads in (1, 3):
        settings = Settings().changed({"work.threads": threads})
        other = replace(problem, data=replace(data, settings=settings)).predict(asked)
        assert all(
            np.array_equal(a, b)
            for u, v in zip(together, other, strict=True)
            for a, b in zip(u, v, strict=True)
        )
    for i, r in ((0, 0), (5, 3), (7, 5)):
        alone = Problem(data.with_runs((data.runs[r],)), kinds(name))
        point = Point(asked[i].common, asked[i].per_run[r : r + 1])
        assert np.array_equal(alone.predict([point])[0][0], together[i][r])
    assert all(np.isinf(one).all() for one in together[2])


def test_a_motion_that_grows_leaves_the_others_as_they_are(data: Data) -> None:
    asked = points([])
    wild = asked[4].common.copy()
    wild[1] = -5.0  # N m s/rad: the damper drives the body
    found = Problem(data).predict([*asked[:4], Point(wild, asked[4].per_run), *asked[5:]])
    usual = Problem(data).predict(asked)
    assert all(np.isinf(one).all() for one in found[4])
    for i in (0, 1, 3, 5, 6, 7):
        assert all(np.array_equal(a, b) for a, b in zip(found[i], usual[i], strict=True))
