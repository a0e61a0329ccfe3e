"""Cycles of a swing are counted through any disturbance, and none where nothing oscillates."""

from __future__ import annotations

import numpy as np
import pytest

from tunnel_sim.vocabulary.record import Record, count_cycles

NOISE = np.random.default_rng(3).standard_normal(10000)
SECONDS = np.arange(10000) / 1000.0


@pytest.mark.parametrize("zeta", [0.0, 0.01, 0.1, 0.3])
@pytest.mark.parametrize("cycles", [3.0, 5.0, 40.0])
@pytest.mark.parametrize(
    "disturb",
    [
        lambda y: y,
        lambda y: y + 0.002 * NOISE,
        lambda y: np.round(y / 0.01) * 0.01,
        lambda y: np.clip(y, -0.15, 0.15) + 3.0,
        lambda y: y + 0.02 * np.sin(2.0 * np.pi * 50.0 * SECONDS),
        lambda y: y + 0.02 * np.sin(2.0 * np.pi * 49.97 * SECONDS),
        lambda y: y + 0.03 * np.exp(-2.0 * SECONDS) * np.cos(2.0 * np.pi * 22.0 * SECONDS),
    ],
    ids=["clean", "noisy", "coarse", "clipped", "hum", "wandering-hum", "ringing"],
)
def test_three_cycles_are_seen_through_any_disturbance(zeta: float, cycles: float, disturb) -> None:
    phase = 2.0 * np.pi * cycles / 10.0 * SECONDS
    motion = 0.35 * np.exp(-zeta / np.sqrt(1.0 - zeta**2) * phase) * np.cos(phase)
    found = count_cycles(Record(SECONDS, disturb(motion)))
    assert found == pytest.approx(cycles, rel=0.15)


@pytest.mark.parametrize("samples_per_cycle", [8, 12, 30, 200])
@pytest.mark.parametrize("cycles", [3.0, 3.4, 6.5])
@pytest.mark.parametrize("zeta", [0.0, 0.02, 0.1])
def test_few_samples_are_enough(samples_per_cycle: int, cycles: float, zeta: float) -> None:
    phase = 2.0 * np.pi * np.arange(round(samples_per_cycle * cycles) + 1) / samples_per_cycle
    for start in np.linspace(0.0, 2.0 * np.pi, 9):
        motion = 0.35 * np.exp(-zeta * phase) * np.cos(phase + start)
        found = count_cycles(Record(np.arange(phase.size) / 50.0, motion))
        assert found == pytest.approx(cycles, rel=0.3)
        assert found >= 2.75


@pytest.mark.parametrize("drift", [-0.03, 0.03])
def test_drift_neither_makes_nor_hides_cycles(drift: float) -> None:
    for cycles in (2.0, 4.0, 20.0):
        motion = 0.14 * np.exp(-0.1 * SECONDS) * np.cos(2.0 * np.pi * cycles / 10.0 * SECONDS)
        found = count_cycles(Record(SECONDS, motion + drift * SECONDS / 10.0))
        assert found == pytest.approx(cycles, rel=0.15)


@pytest.mark.parametrize("cycles", [0.8, 1.5, 2.0, 2.4])
@pytest.mark.parametrize("hum", [0.0, 0.03])
def test_hum_and_noise_make_no_cycles(cycles: float, hum: float) -> None:
    motion = 0.2 * np.cos(2.0 * np.pi * cycles / 10.0 * SECONDS)
    disturbed = motion + hum * np.sin(2.0 * np.pi * 50.0 * SECONDS) + 0.002 * NOISE
    assert count_cycles(Record(SECONDS, disturbed)) < 2.75


@pytest.mark.parametrize(
    "reading",
    [
        0.1 + 0.0 * SECONDS,
        0.0005 * NOISE,
        np.round(NOISE) * 0.0005,
        0.05 * SECONDS,
        0.01 * np.sin(2.0 * np.pi * 50.0 * SECONDS),
    ],
    ids=["constant", "noise", "coarse-noise", "drift", "hum"],
)
def test_what_does_not_oscillate_has_no_cycles(reading: np.ndarray) -> None:
    assert count_cycles(Record(SECONDS, reading)) == 0.0


@pytest.mark.parametrize("rate", [0.2, 1.0, 5.0])
def test_a_creep_back_to_rest_is_no_oscillation(rate: float) -> None:
    assert count_cycles(Record(SECONDS, 0.35 * np.exp(-rate * SECONDS))) < 2.75
