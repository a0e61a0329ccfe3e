"""What a run has of its own may have a prior: a spring that comes back a little different is no gap."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.partial import refit_releases
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.parameters import Parameter, Point, RunParameterPrior
from diagnosis.model.rig import SpringModel
from diagnosis.model.run_noise import WhiteNoise
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

if TYPE_CHECKING:
    from collections.abc import Mapping

    from diagnosis.model.data import Data
    from diagnosis.model.run_data import RunData

INERTIA, DAMPING, NOISE, RATE = 0.1, 0.05, 2e-4, 200.0
SPRINGS = (16.0, 16.0, 30.0, 30.0, 44.0, 44.0)
SCATTER = 1e-3  # of the springs, relative


@dataclass(frozen=True)
class ClampedAgain(SpringModel):
    """Springs whose stiffness differs a little each time that they are clamped."""

    scatter: float = SCATTER

    def parameters(self, data: Data) -> tuple[Parameter, ...]:
        deviation = Parameter(
            "spring_deviation", "1", size=self.scatter, owner="per_run", prior=RunParameterPrior(self.scatter)
        )
        return *super().parameters(data), deviation

    def spring(self, values: Mapping[str, float], run: RunData) -> float:
        return super().spring(values, run) * (1.0 + values["spring_deviation"])


def campaign(scatter: float, seed: int) -> tuple[Campaign, np.ndarray]:
    """Closed-form decays of springs that scatter, and by how much they do."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 10.0, 1.0 / RATE)
    deviations = scatter * rng.standard_normal(len(SPRINGS))
    runs = []
    for number, (spring, deviation) in enumerate(zip(SPRINGS, deviations, strict=True)):
        rate = 0.5 * DAMPING / INERTIA
        omega = np.sqrt(spring * (1.0 + deviation) / INERTIA - rate**2)
        swing = 0.3 * np.exp(-rate * time) * np.cos(omega * time)
        record = Record(time, swing + rng.normal(0.0, NOISE, time.size))
        runs.append(Run(f"r{number}", record, 0.0, spring_stiffness=spring))
    return Campaign("clamped", RigProperties(), SensorProperties(RATE), tuple(runs)), deviations


def fitted(model: SpringModel, scatter: float, seed: int):  # type: ignore[no-untyped-def]
    data, deviations = campaign(scatter, seed)
    prepared = prepare(data, {run.id: NOISE**2 for run in data.runs}, model=model.of(data))
    return fit(Problem(prepared), nominal_start(prepared), tolerance=1e-9), deviations


def test_a_scatter_of_springs_is_a_gap_without_its_prior_and_none_with_it() -> None:
    data, _ = campaign(SCATTER, 1)
    assert diagnose(data, kinds=()).causes == ("unknown",)
    found = diagnose(data, kinds=(), model=ClampedAgain())
    assert found.causes == ()


def test_deviations_and_inertia_are_within_their_standard_deviations() -> None:
    z, apart = [], []
    for seed in range(8):
        found, deviations = fitted(ClampedAgain(), SCATTER, seed)
        z.append((found.value("yaw_inertia") - INERTIA) / found.std("yaw_inertia"))
        own = found.point.per_run[:, found.problem.parameters.own_names.index("spring_deviation")]
        apart.append(own - deviations)
        # the springs' scatter, not the noise, limits the inertia
        assert found.std("yaw_inertia") == pytest.approx(INERTIA * SCATTER / np.sqrt(len(SPRINGS)), rel=0.05)
    assert (
        np.mean(np.square(z)) < 3.0
    )  # χ² of 8: beyond 2.6 in one of a hundred, and beyond 3.0 in one of 400
    assert np.std(np.concatenate(apart)) < 0.6 * SCATTER


def test_a_narrow_prior_holds_and_a_wide_one_does_not() -> None:
    base = fitted(SpringModel(), 0.0, 3)[0]
    held = fitted(ClampedAgain(scatter=1e-9), 0.0, 3)[0]
    assert held.total == pytest.approx(base.total, rel=1e-6)
    assert held.std("yaw_inertia") == pytest.approx(base.std("yaw_inertia"), rel=1e-3)
    wide = fitted(ClampedAgain(scatter=0.1), SCATTER, 3)[0]
    assert wide.total < fitted(ClampedAgain(scatter=1e-5), SCATTER, 3)[0].total


def test_a_run_that_is_not_seen_returns_to_its_prior() -> None:
    """Refitted to readings of no weight, a run's own deviation is the prior's mean."""
    found, _ = fitted(ClampedAgain(), SCATTER, 5)
    data = found.problem.data
    blind = replace(data, runs=tuple(replace(run, noise=WhiteNoise(1e12)) for run in data.runs))
    problem = replace(found.problem, data=blind)
    place = problem.parameters.own_names.index("spring_deviation")
    moved = found.point.per_run.copy()
    moved[:, place] = 5.0 * SCATTER
    start = Point(found.point.common, moved)
    slopes = [1e-9 * own for _, own in found.jacobian]
    back, _ = refit_releases(problem, start, slopes)
    assert np.abs(back.per_run[:, place]).max() < 1e-3 * SCATTER


def test_a_prior_is_a_part_of_chi2() -> None:
    found, _ = fitted(ClampedAgain(), SCATTER, 7)
    parameters = found.problem.parameters
    own = found.point.per_run[:, parameters.own_names.index("spring_deviation")]
    assert found.total - found.chi2.sum() == pytest.approx(np.sum((own / SCATTER) ** 2))
    assert parameters.surprise(found.point) == pytest.approx(np.sum((own / SCATTER) ** 2))
    assert Problem(replace(found.problem.data, model=SpringModel())).parameters.surprise(found.point) == 0.0
