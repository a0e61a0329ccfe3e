"""The matrix pencil: exact without noise at any damping, its covariance that of trials, its refusals."""

import numpy as np
import pytest

from identification.signal import frequency
from identification.signal.free_decay import Decay, free_decay
from identification.signal.frequency import pencil_decay


@pytest.mark.parametrize("zeta", [-0.01, 0.0, 0.002, 0.05, 0.4, 1.5])
def test_exact_without_noise(zeta):
    truth = Decay.from_modal(10.0, zeta)
    clock = 0.03 * np.arange(120)
    found = pencil_decay(0.7 + free_decay(clock, truth, 0.3, 0.5), 0.03, 11.0)
    assert found.decay.rate == pytest.approx(truth.rate, abs=1e-7)
    assert found.decay.stiffness == pytest.approx(truth.stiffness, rel=1e-7)


@pytest.mark.parametrize("zeta", [0.002, 0.05])
def test_covariance_is_that_of_trials(zeta):
    rng, noise, trials = np.random.default_rng(4), 1e-3, 400
    clock = 0.04 * np.arange(250)
    clean = 0.1 + free_decay(clock, Decay.from_modal(10.0, zeta), 0.3, 0.0)
    seen, expected = [], None
    for _ in range(trials):
        found = pencil_decay(clean + noise * rng.standard_normal(250), 0.04, 10.0)
        seen.append([found.decay.rate, found.decay.stiffness])
        expected = noise**2 * found.weights @ found.weights.T
    # χ² of 400 trials: a deviation is known to 3.5 %, and this is four of them.
    np.testing.assert_allclose(np.std(seen, axis=0), np.sqrt(np.diag(expected)), rtol=0.15)


def test_the_weights_are_the_slope():
    rng = np.random.default_rng(5)
    clock = 0.05 * np.arange(60)
    yaw = free_decay(clock, Decay.from_modal(9.0, 0.03), 0.3, 0.0)
    found, away = pencil_decay(yaw, 0.05, 9.0), 1e-7 * rng.standard_normal(60)
    moved = pencil_decay(yaw + away, 0.05, 9.0)
    change = [moved.decay.rate - found.decay.rate, moved.decay.stiffness - found.decay.stiffness]
    np.testing.assert_allclose(change, found.weights @ away, rtol=1e-3)


@pytest.mark.parametrize("zeta", [0.002, 0.05])
def test_short_and_long_records_are_decomposed_alike(zeta, monkeypatch):
    yaw = free_decay(0.05 * np.arange(60), Decay.from_modal(9.0, zeta), 0.3, 0.0)
    yaw += 1e-3 * np.random.default_rng(6).standard_normal(60)
    dense = pencil_decay(yaw, 0.05, 9.0)
    monkeypatch.setattr(frequency, "_DENSE", 0)
    iterated = pencil_decay(yaw, 0.05, 9.0)
    assert iterated.decay.rate == pytest.approx(dense.decay.rate, rel=1e-7)
    assert iterated.decay.stiffness == pytest.approx(dense.decay.stiffness, rel=1e-9)
    np.testing.assert_allclose(iterated.weights, dense.weights, rtol=1e-5, atol=1e-8)


def test_it_says_when_there_is_nothing():
    assert pencil_decay(np.ones(5), 0.1, 5.0) is None
    assert pencil_decay(np.full(50, 0.3), 0.1, 5.0) is None


def test_a_decay_that_is_over_before_the_second_value_is_none():
    values = np.exp(-0.4 * np.arange(15))
    values[0] += 0.5
    assert pencil_decay(values, 1.0, 0.4) is None
