"""Samples at uneven times, missing samples, rates and accelerations: the fits predict them as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.findings.closing import compare
from diagnosis.likelihood.least_squares import fit, scaled_residuals
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.parameters import Point
from diagnosis.model.run_data import hermite_basis
from diagnosis.noise.mains import refine_frequency, remove_hum
from diagnosis.noise.sensor_noise import campaign_noise, scattered_variance
from diagnosis.settings import Settings
from tests.reference.free_decays import AREA, LENGTH, Setting, Truth, angle_of
from tunnel_sim.effects.sensor import DroppedSamples
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

NOISE = 5e-4
SETTINGS = (Setting(16.12, 0.0), Setting(44.84, 0.0), Setting(16.12, 24.0), Setting(44.84, 24.0))


def uneven_times(rng, *, rate=1000.0, duration=8.0, jitter=0.45, lost=0.1, gap=(2.0, 2.03)):
    time = (
        np.arange(round(duration * rate)) + jitter * rng.uniform(-1.0, 1.0, round(duration * rate))
    ) / rate
    kept = (rng.uniform(size=time.size) > lost) & ((time < gap[0]) | (time > gap[1]))
    return np.sort(time[kept])


def uneven_campaign(*, noise=NOISE, seed=4, derivative=0, **how):
    rng = np.random.default_rng(seed)
    runs = []
    for number, setting in enumerate(SETTINGS):
        time = uneven_times(rng, **how)
        step = 2e-4
        values = np.stack([angle_of(setting, Truth(), time + k * step) for k in (-1, 0, 1)])
        stencils = ([0.0, 1.0, 0.0], [-0.5 / step, 0.0, 0.5 / step], [step**-2, -2.0 * step**-2, step**-2])
        reading = np.array(stencils[derivative]) @ values
        noisy = reading + 0.002 + noise * rng.standard_normal(time.size)
        runs.append(Run(f"r{number}", Record(time, noisy), setting.speed, setting.spring, 1.204))
    sensor = SensorProperties(quantity=("angle", "rate", "acceleration")[derivative])
    return Campaign("uneven", RigProperties(None, AREA, LENGTH), sensor, tuple(runs))


def prepared(data, noise=NOISE):
    return prepare(data, {run.id: noise**2 for run in data.runs})


def fitted(data):
    return fit(Problem(data), nominal_start(data))


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_the_basis_gives_a_cubic_and_its_derivatives(derivative):
    cubic = np.polynomial.Polynomial(np.random.default_rng(derivative).normal(size=4))
    h, u = 0.3, np.linspace(0.0, 1.0, 7)
    ends = np.array([cubic(0.0), cubic(h), h * cubic.deriv()(0.0), h * cubic.deriv()(h)])
    expected = cubic.deriv(derivative)(h * u) if derivative else cubic(h * u)
    np.testing.assert_allclose(ends @ hermite_basis(u, derivative, h), expected, atol=1e-12)


def test_even_samples_are_taken_as_ever():
    data = prepared(uneven_campaign(jitter=0.0, lost=0.0, gap=(9.0, 9.0)))
    for run in data.runs:
        assert run.samples is None
        assert run.weights.shape == (4,)
        difference = np.linspace(-1.0, 1.0, run.reading.size)
        assert run.scaled(difference).tobytes() == (difference / run.noise.scale).tobytes()


def test_uneven_samples_lose_nothing_of_the_model():
    """The residual is the noise alone, at unit variance in every block, whatever its number of samples."""
    data = prepared(uneven_campaign())
    found = fitted(data)
    assert found.excess == pytest.approx(0.0, abs=4.0 * np.sqrt(2.0 / found.count))
    truth = {
        "yaw_inertia": 0.1014,
        "mechanical_damping": 0.012,
        "cn_beta": 0.49,
        "cn_r": -0.11,
        "zero": 0.002,
    }
    for name, value in truth.items():
        assert abs(found.value(name) - value) < 4.0 * found.std(name)
    count = np.concatenate([run.samples.count for run in data.runs])
    residual = np.concatenate(found.residuals)
    for number in (2, 3, 4):
        chosen = residual[count == number]
        assert np.mean(chosen**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / chosen.size))


def test_without_noise_nothing_is_left():
    found = fitted(prepared(uneven_campaign(noise=0.0)))
    assert np.abs(np.concatenate(found.residuals)).max() * NOISE < 2e-6


def test_empty_blocks_weigh_nothing():
    data = prepared(uneven_campaign())
    found = fitted(data)
    for run, residual in zip(data.runs, found.residuals, strict=True):
        empty = run.samples.count == 0
        assert empty.sum() > 3
        assert np.all(residual[empty] == 0.0)
        assert np.isfinite(run.reading).all()
        assert np.isfinite(run.times).all()
        assert run.filled == np.sum(~empty)
    assert found.count == sum(run.filled for run in data.runs)
    unbounded = [np.full(run.reading.size, np.inf) for run in data.runs]
    assert all(
        np.all(run.scaled(p)[run.samples.count == 0] == 0.0)
        for run, p in zip(data.runs, unbounded, strict=True)
    )


def test_a_part_of_a_run_has_the_samples_of_its_blocks():
    run = prepared(uneven_campaign()).runs[0]
    part = run.part(100, 300)
    assert part.reading.tobytes() == run.reading[100:300].tobytes()
    assert (part.start, part.duration) == (100 * run.interval, run.duration - 100 * run.interval)
    np.testing.assert_allclose(part.weights, run.weights[:, 100:300], atol=1e-9)
    np.testing.assert_allclose(part.times, run.times[100:300] - part.start, atol=1e-12)
    assert part.scaled(np.ones(200)).tobytes() == run.scaled(np.ones(run.reading.size))[100:300].tobytes()


def test_samples_skipped_are_read_sample_by_sample():
    """With nothing lost, the path of the samples agrees with that of the blocks."""
    data = prepared(uneven_campaign())
    plain = fitted(data)
    problem = Problem(data, (DroppedSamples,))
    release = np.column_stack([plain.point.per_run, np.full(len(data.runs), 0.5)])
    for lost, apart in ((0.0, 1e-6), (1e-9, 1e-3)):
        point = Point(np.append(plain.point.common, lost), release)
        for one, other in zip(plain.residuals, scaled_residuals(problem, point), strict=True):
            assert np.abs(one - other).max() < apart


def test_mujoco_reads_the_samples_at_their_times():
    found = fitted(prepared(uneven_campaign()))
    comparison = compare(found.problem, found.point.common, found.point.per_run)
    assert comparison.failure == ""
    for difference in comparison.differences:
        assert np.abs(difference).max() < 0.02 * NOISE
    assert sum(float(r @ r) for r in comparison.residuals) == pytest.approx(found.total, rel=1e-4)


@pytest.mark.parametrize(("derivative", "noise"), [(1, 0.01), (2, 0.2)])
@pytest.mark.parametrize("jitter", [0.0, 0.45])
def test_rates_and_accelerations_give_the_same_rig(derivative, noise, jitter):
    lost, gap = (0.1, (2.0, 2.03)) if jitter else (0.0, (9.0, 9.0))
    data = uneven_campaign(derivative=derivative, noise=noise, jitter=jitter, lost=lost, gap=gap)
    found = fitted(prepared(data, noise))
    assert found.excess == pytest.approx(0.0, abs=4.0 * np.sqrt(2.0 / found.count))
    for name, value in {"yaw_inertia": 0.1014, "cn_beta": 0.49, "cn_r": -0.11}.items():
        assert abs(found.value(name) - value) < 4.0 * found.std(name)
    comparison = compare(found.problem, found.point.common, found.point.per_run)
    assert sum(float(r @ r) for r in comparison.residuals) == pytest.approx(found.total, rel=1e-4)


@pytest.mark.parametrize("how", [{}, {"jitter": 0.9, "lost": 0.3}, {"rate": 100.0}, {"gap": (2.0, 4.0)}])
def test_the_noise_of_uneven_records(how):
    noise = campaign_noise(uneven_campaign(**how), Settings().noise)
    freedom = 4.0 * 8.0 * min(how.get("rate", 1000.0), 250.0) * 0.4
    assert noise.used / NOISE**2 == pytest.approx(1.0, abs=0.02 + 4.0 * np.sqrt(2.0 / freedom))


def test_noise_that_neighbours_share_counts_in_full():
    """Stamps put on an even series afterwards: its readings are interpolated, and so is its noise."""
    rng = np.random.default_rng(8)
    even = np.arange(9000) / 1000.0
    reading = 0.3 * np.cos(20.0 * even) + NOISE * rng.standard_normal(even.size)
    time = np.sort(rng.uniform(0.0, even[-1], 8000))
    record = Record(time, np.interp(time, even, reading))
    variance, relative = scattered_variance(record, 3.2, 4)
    # A mean of four samples between those of the series has a little less of its noise.
    assert variance / NOISE**2 == pytest.approx(1.0, abs=0.1 + 4.0 * relative)
    assert np.var(np.diff(record.yaw_rad - 0.3 * np.cos(20.0 * time))) < 1.5 * NOISE**2


def test_a_hum_is_removed_down_to_the_noise():
    """An irregular clock spreads the motion over all frequencies, the hum's among them."""
    data = uneven_campaign(lost=0.0, gap=(9.0, 9.0))

    def hum(time):
        return 4e-3 * np.sin(2.0 * np.pi * 50.03 * time) + 8e-4 * np.sin(6.0 * np.pi * 50.03 * time + 1.0)

    def with_hum(run):
        return replace(run, record=Record(run.record.time_s, run.record.yaw_rad + hum(run.record.time_s)))

    noisy = replace(data, runs=tuple(with_hum(run) for run in data.runs))
    frequency = refine_frequency(noisy, 50.02)
    assert frequency == pytest.approx(50.03, abs=1e-3)
    cleaned, found = remove_hum(noisy, frequency, NOISE**2, Settings().read_off)
    assert found.amplitude == pytest.approx(4e-3, abs=5.0 * found.std)
    for run, before in zip(cleaned.runs, data.runs, strict=True):
        added = run.record.yaw_rad - before.record.yaw_rad
        assert np.sqrt(np.mean((added - added.mean()) ** 2)) < 0.1 * NOISE
