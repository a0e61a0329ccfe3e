"""Runs in wider blocks: what they keep, when they are used, and how they are predicted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.findings.next_run import planned_run, separation
from diagnosis.likelihood.compression import compressed, in_shorter_blocks, slow
from diagnosis.likelihood.least_squares import Fit, fit, fit_at
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import resonance
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.settings import SelectionSettings, Settings
from tests.reference import free_decays
from tests.reference.free_decays import SIX
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.record import Array

NOISE = 4e-4
CHOSEN = SelectionSettings()


def prepared(noise: float = NOISE, seed: int = 1) -> Data:
    rng = np.random.default_rng(seed)
    data = free_decays.campaign(SIX, noise=noise, rate=1000.0, duration=6.0, rng=rng)
    return prepare(data, {run.id: NOISE**2 for run in data.runs})


@pytest.fixture(scope="module")
def nominal() -> Fit:
    data = prepared()
    return fit(Problem(data), nominal_start(data))


def test_wider_blocks_keep_the_information_on_every_coefficient(nominal: Fit) -> None:
    wider = compressed(nominal)
    assert wider.count < 0.5 * nominal.count
    for index, (run, given) in enumerate(
        zip(wider.problem.data.runs, nominal.problem.data.runs, strict=True)
    ):
        assert run.merges == run.block / given.block > 1
        assert 1.0 / (resonance(nominal, index) * run.interval) >= CHOSEN.blocks_in_cycle
    # variances of one minus the loss of information; at 24 blocks in a cycle that is 0.57 %
    lost = 1.0 - np.diag(nominal.covariance) / np.diag(wider.covariance)
    assert np.all(np.abs(lost) < 0.01)
    moved = np.abs(wider.point.common - nominal.point.common)
    assert np.all(moved < 0.1 * np.sqrt(np.diag(nominal.covariance)))


def test_a_wider_block_is_predicted_as_the_mean_of_its_shorter_ones(nominal: Fit) -> None:
    """Better than a fiftieth of the noise of a block, for laws with and without kinks."""
    wider = compressed(nominal).problem.data
    for name, values in {
        "coulomb_friction": [0.02],
        "cubic_stiffness": [0.5],
        "sensor_clipping": [0.25],
        "rod_flexibility": [1e-3, 0.3],
        "sensor_nonlinearity": [0.2],
    }.items():
        kinds = (effect_class(name),)
        point = Point(np.concatenate([nominal.point.common, values]), nominal.point.per_run)
        found = Problem(wider, kinds).predict([point])[0]
        shorter = Problem(wider.with_runs(tuple(run.fine for run in wider.runs)), kinds).predict([point])[0]
        for run, one, many in zip(wider.runs, found, shorter, strict=True):
            means = many.reshape(one.size, run.merges).mean(axis=1)
            assert np.max(np.abs(one - means)) < 0.02 * run.noise.scale, name


def test_shorter_blocks_come_back(nominal: Fit) -> None:
    back = in_shorter_blocks(compressed(nominal))
    for run, given in zip(back.problem.data.runs, nominal.problem.data.runs, strict=True):
        np.testing.assert_array_equal(run.reading, given.reading[: run.reading.size])
        assert (run.block, run.merges) == (given.block, 1)
        assert run.interval == pytest.approx(given.interval)
        assert run.noise.variance == pytest.approx(given.noise.variance)
    assert back.total == pytest.approx(nominal.total, rel=0.02)
    assert in_shorter_blocks(nominal) is nominal


def test_a_part_of_a_run_in_wider_blocks_has_its_shorter_ones(nominal: Fit) -> None:
    run = compressed(nominal).problem.data.runs[0]
    part = run.part(5, 25)
    np.testing.assert_array_equal(part.fine.reading, run.fine.part(5 * run.merges, 25 * run.merges).reading)
    np.testing.assert_allclose(part.reading, part.fine.reading.reshape(20, -1).mean(axis=1))


def white(seed: int) -> list[Array]:
    rng = np.random.default_rng(seed)
    return [rng.normal(size=1500) for _ in range(6)]


def test_noise_alone_keeps_no_blocks_short() -> None:
    """At a rate of one campaign in a thousand; of a hundred, three would occur once in 6000."""
    kept = sum(not slow(white(seed), [4] * 6, CHOSEN) for seed in range(100))
    assert kept <= 2


@pytest.mark.parametrize("cycles", [0.13, 0.2, 0.4])
def test_a_fast_line_keeps_blocks_short(cycles: float) -> None:
    """Of χ² 120 in one of the runs, of which a window keeps two thirds: wider blocks would hide it."""
    residuals = white(1)
    residuals[2] = residuals[2] + np.sqrt(240.0 / 1500.0) * np.sin(2.0 * np.pi * cycles * np.arange(1500))
    assert slow(white(1), [4] * 6, CHOSEN)
    assert not slow(residuals, [4] * 6, CHOSEN)


def test_a_slow_gap_does_not_keep_blocks_short_and_a_rough_one_does() -> None:
    along = np.arange(1500) / 125.0
    smooth = [r + 3.0 * np.sin(2.0 * np.pi * along) for r in white(2)]
    assert slow(smooth, [4] * 6, CHOSEN)
    rough = [r + 3.0 * np.sign(np.sin(2.0 * np.pi * along)) for r in white(2)]
    assert not slow(rough, [4] * 6, CHOSEN)


def test_runs_that_wider_blocks_do_not_serve_stay_as_they_are(nominal: Fit) -> None:
    data, finer = nominal.problem.data, Settings().changed({"selection.blocks_in_cycle": 200})
    of_rates = data.with_runs(tuple(replace(run, derivative=1) for run in data.runs))
    for other in (
        replace(nominal, problem=Problem(of_rates)),
        replace(
            nominal,
            problem=Problem(replace(data, settings=finer)),
        ),
    ):
        assert compressed(other) is other


def test_a_run_not_yet_made_is_predicted_in_the_shorter_blocks_too(nominal: Fit) -> None:
    """Of effects on the reading, whose predictions are in shorter blocks."""
    wider = compressed(nominal)
    (kind,) = (effect_class("sensor_nonlinearity"),)
    point = Point(np.append(wider.point.common, 0.2), wider.point.per_run)
    seen = fit_at(Problem(wider.problem.data, (kind,)), point)
    run = planned_run(wider, spring_stiffness=30.0, wind_speed=0.0, air_density=1.2, duration=4.0)
    assert run.fine.reading.size == run.merges * run.reading.size
    apart = separation(seen, wider, run, 0.3)
    assert apart is not None
    assert apart > 1.0
