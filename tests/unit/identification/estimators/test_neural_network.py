"""The networks on records: what they read, what they refuse, and what a window's noise does."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from identification import Status, identify
from identification.estimators.neural_network import NeuralNetwork, read_window
from identification.neural.networks import shipped_networks
from identification.neural.three_cycles import _shares, find_windows
from tests.reference.free_decays import damped_cosine
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record


def record(zeta, omega_n, *, cycles=12.0, noise=0.0, rng=None, rate=1000.0, held=0.0, release=0.35):
    time = np.arange(round((held + cycles * 2.0 * np.pi / omega_n) * rate)) / rate
    yaw = damped_cosine(np.maximum(time - held, 0.0), 2.0 * zeta * omega_n, omega_n**2, release, 0.0) + 0.004
    return Record(time, yaw + (noise * rng.standard_normal(time.size) if noise else 0.0))


def estimated(given, weights=None):
    campaign = Campaign("one", RigProperties(), SensorProperties(), (Run("r1", given, 0.0),))
    return identify(campaign, NeuralNetwork(weights), throw=False).runs[0]


@pytest.mark.parametrize("zeta", [0.0011, 0.005, 0.03, 0.1, 0.2, 0.34])
@pytest.mark.parametrize("omega_n", [0.45, 3.0, 12.5, 25.5])
def test_the_whole_training_range_is_read_from_the_record_alone(zeta, omega_n):
    found = estimated(record(zeta, omega_n, cycles=5.0, rate=100.0 if omega_n < 1.0 else 1000.0))
    assert found.zeta.value == pytest.approx(zeta, abs=3e-7 + 3e-5 * zeta)
    assert found.omega_n.value == pytest.approx(omega_n, rel=1e-4)
    assert 0.0 < found.zeta.std < 1e-5
    assert 0.0 < found.omega_n.std < 1e-4 * omega_n


def test_a_record_that_begins_before_the_release_is_read_from_it_on():
    found = estimated(record(0.02, 12.5, held=0.7))
    assert found.zeta.value == pytest.approx(0.02, rel=1e-3)
    assert found.windows[0].start_s == pytest.approx(0.25 * 2.0 * np.pi / 12.5, abs=0.01)


def test_windows_follow_one_another_and_carry_the_envelope():
    windows = estimated(record(0.01, 12.5)).windows
    assert len(windows) == 3
    for before, after in pairwise(windows):
        assert after.start_s == pytest.approx(before.start_s + before.duration_s, abs=1e-6)
        assert after.amplitude.value / before.amplitude.value == pytest.approx(
            np.exp(-6.0 * np.pi * 0.01), rel=1e-4
        )
    middle = windows[0].start_s + 0.5 * windows[0].duration_s
    assert windows[0].amplitude.value == pytest.approx(0.35 * np.exp(-0.01 * 12.5 * middle), rel=2e-4)
    assert windows[0].cycles == 3


@pytest.mark.parametrize(("zeta", "omega_n"), [(0.0007, 12.5), (0.4, 12.5), (0.02, 30.0), (0.02, 0.3)])
def test_outside_the_training_range_it_refuses(zeta, omega_n):
    found = estimated(record(zeta, omega_n, cycles=8.0, rate=200.0))
    assert found.status is Status.OUTSIDE_TRAINING
    assert found.zeta is None
    assert found.windows == ()
    assert "use output_error" in found.status.value


def test_a_growing_oscillation_is_refused():
    time = np.arange(0.0, 6.0, 0.001)
    growing = Run("r1", Record(time, 0.02 * np.exp(0.05 * time) * np.cos(12.5 * time)), 0.0)
    campaign = Campaign("one", RigProperties(), SensorProperties(), (growing,))
    with pytest.raises(TunnelError, match="grows with the wind off"):
        identify(campaign, NeuralNetwork())
    assert NeuralNetwork().estimate(campaign).runs[0].status is Status.OUTSIDE_TRAINING


def test_with_too_few_cycles_it_refuses():
    found = estimated(record(0.01, 12.5, cycles=2.9))
    assert found.status is Status.TOO_FEW_CYCLES
    assert found.omega_n is None
    assert estimated(record(0.01, 12.5, cycles=3.4)).status is not Status.TOO_FEW_CYCLES


def test_a_square_wave_is_no_oscillation():
    time = np.arange(0.0, 6.0, 0.001)
    assert estimated(Record(time, 0.2 * np.sign(np.cos(12.5 * time)))).status is Status.NO_OSCILLATION


def test_a_drifting_frequency_departs():
    time = np.arange(0.0, 12.0, 0.001)
    rng = np.random.default_rng(1)
    yaw = 0.3 * np.exp(-0.08 * time) * np.cos(12.5 * time * (1.0 + 0.002 * time))
    found = estimated(Record(time, yaw + 5e-4 * rng.standard_normal(time.size)))
    assert Status.MODEL_DEPARTS in found.statuses
    spread = [window.omega_n.value for window in found.windows]
    assert found.omega_n.std > 0.1 * np.std(spread)


def test_noise_reaches_the_results_as_the_propagation_says():
    networks, noise = shipped_networks(), 5e-4
    rng = np.random.default_rng(4)
    values, claimed = [], []
    for _ in range(100):
        windows, _ = find_windows(record(0.02, 12.5, cycles=3.6, noise=noise, rng=rng), noise)
        reading = read_window(windows[0], networks)
        values.append((reading.zeta, reading.omega_n))
        claimed.append(np.sqrt(reading.variances))
    scatter = np.std(values, axis=0, ddof=1)
    # A standard deviation of 100 values is known to 7 %; three of them.
    np.testing.assert_allclose(np.mean(claimed, axis=0), scatter, rtol=0.22)


def test_a_record_of_a_small_part_of_a_cycle_has_no_windows():
    given = record(0.01, 12.5, cycles=0.005, rate=400_000.0)
    assert find_windows(given, 1e-6)[0] == ()


def test_weights_that_are_not_there_are_bad_input(tmp_path):
    with pytest.raises(TunnelError, match=r"nothing\.safetensors: no such file"):
        estimated(record(0.01, 12.5), tmp_path / "nothing.safetensors")


def test_the_mean_of_a_window_takes_each_sample_for_the_step_around_it():
    """At edges between samples: weights of 1/n, whose mean time is the middle; elsewhere parts of two samples."""
    step = 0.01
    trace = SimpleNamespace(time=step * np.arange(40), step=step)
    edges = step * (np.array([3, 8, 10, 20]) - 0.5)
    shares = _shares(trace, edges, slice(0, 40))
    assert shares.sum(axis=1) == pytest.approx(1.0)
    assert shares @ trace.time == pytest.approx(0.5 * (edges[1:] + edges[:-1]))
    assert shares[0, 2:9] == pytest.approx([0.0, 0.2, 0.2, 0.2, 0.2, 0.2, 0.0])
    (apart,) = _shares(trace, step * np.array([5.0, 6.0]), slice(4, 8))
    assert apart == pytest.approx([0.0, 0.5, 0.5, 0.0])
