"""Block means, and what is kept of a campaign when runs are left out."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.model.blocks import prepare, without_start
from diagnosis.model.run_data import hermite_basis
from tests.reference import free_decays
from tests.reference.free_decays import Setting, angle_of, with_records

SETTINGS = (Setting(16.12, 0.0), Setting(44.84, 20.0), Setting(44.84, 0.0))


@pytest.mark.parametrize("block", [1, 2, 4, 7])
def test_weights_give_the_exact_mean_of_a_cubic_over_the_samples(block):
    rng = np.random.default_rng(block)
    h = 0.3
    cubic = np.polynomial.Polynomial(rng.normal(size=4))
    samples = cubic(h * np.arange(block) / block)
    ends = np.array([cubic(0.0), cubic(h), h * cubic.deriv()(0.0), h * cubic.deriv()(h)])
    weights = hermite_basis(np.arange(block) / block).mean(axis=1)
    assert weights @ ends == pytest.approx(samples.mean(), abs=1e-13)


def test_blocks_are_means_of_the_samples():
    data = free_decays.campaign(SETTINGS, duration=5.001, rate=1000.0)
    prepared = prepare(data, {run.id: 1e-6 for run in data.runs})
    for given, run in zip(data.runs, prepared.runs, strict=True):
        assert (run.block, run.interval) == (4, pytest.approx(4e-3))
        assert run.reading.size == 1250  # the last sample alone makes no block
        assert run.reading[7] == pytest.approx(given.record.yaw_rad[28:32].mean(), abs=1e-15)
        assert run.noise.variance == pytest.approx(0.25e-6)


def test_slow_records_are_taken_sample_by_sample():
    data = free_decays.campaign(SETTINGS, duration=6.0, rate=100.0)
    run = prepare(data, {run.id: 1e-6 for run in data.runs}).runs[0]
    assert (run.block, run.noise.variance) == (1, 1e-6)
    assert run.interval == pytest.approx(0.01)


def test_a_run_without_stiffness_makes_the_campaign_normalised():
    data = free_decays.campaign((Setting(None, 0.0), Setting(16.12, 0.0)))
    assert prepare(data, {run.id: 1e-6 for run in data.runs}).model.per_inertia


def test_wind_off_runs_of_a_windy_campaign_keep_its_model():
    data = free_decays.campaign(SETTINGS)
    prepared = prepare(data, {run.id: 1e-6 for run in data.runs})
    still = prepared.subset(("r01", "r03"))
    assert [run.id for run in still.runs] == ["r01", "r03"]
    assert still.wind_on
    assert not any(run.wind_on for run in still.runs)
    assert not prepare(replace(data, runs=data.runs[:1]), {"r01": 1e-6}).wind_on


def test_the_start_is_cut_at_the_second_passage_through_the_middle():
    """A decay from rest passes through zero at a quarter and three quarters of its period."""
    data = free_decays.campaign(SETTINGS[:1], duration=8.0, zero=0.0)
    prepared = prepare(data, {"r01": 1e-6})
    cut = without_start(prepared).runs[0]
    gone = prepared.runs[0].reading.size - cut.reading.size
    np.testing.assert_array_equal(cut.reading, prepared.runs[0].reading[gone:])
    assert cut.duration == pytest.approx(8.0 - gone * cut.interval)
    angle = angle_of(SETTINGS[0], free_decays.Truth(), np.arange(8000) / 1000.0)
    passages = np.flatnonzero(np.diff(np.signbit(angle))) / 1000.0
    assert np.min(np.abs(passages[:2] - gone * cut.interval)) < 2.0 * cut.interval


def test_a_run_that_would_lose_much_stays_whole():
    data = free_decays.campaign(SETTINGS[:1], duration=8.0)
    slow = with_records(data, lambda t, _y: np.cos(2.0 * np.pi * t / 12.0))
    prepared = prepare(slow, {"r01": 1e-6})
    assert without_start(prepared).runs[0].reading.size == prepared.runs[0].reading.size


def test_the_mean_block_turns_an_excess_of_block_means_into_one_of_samples():
    """A slow error of one power in all runs, sampled at different rates."""
    fast = free_decays.campaign(SETTINGS, duration=5.0, rate=1000.0)
    slow = free_decays.campaign(SETTINGS, duration=5.0, rate=200.0)
    data = prepare(replace(fast, runs=(fast.runs[0], *slow.runs[1:])), {run.id: 1e-6 for run in fast.runs})
    assert {run.block for run in data.runs} == {4, 1}
    power = 3e-6
    in_blocks = [np.full(run.reading.size, power / run.noise.variance) for run in data.runs]
    assert np.mean(np.concatenate(in_blocks)) / data.mean_block == pytest.approx(power / 1e-6)
