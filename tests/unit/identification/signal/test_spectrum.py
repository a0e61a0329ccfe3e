"""The peak of the power spectral density. Truth: the frequency of the sine that is put in."""

from __future__ import annotations

import numpy as np
import pytest

from identification import identify
from identification.signal.frequency import psd_peak, starting_frequency
from identification.status import Status
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

TIME = np.arange(1000) / 100.0


def reading(frequency: float) -> np.ndarray:
    return np.exp(-0.05 * TIME) * np.cos(2.0 * np.pi * frequency * TIME)


@pytest.mark.parametrize("frequency", [0.35, 1.234, 7.0, 40.0])
def test_the_peak_is_within_a_sixteenth_of_a_bin(frequency: float) -> None:
    noisy = reading(frequency) + 1e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    found = psd_peak(Record(TIME, noisy))
    assert found.frequency == pytest.approx(frequency, abs=0.1 / 16.0)
    assert found.prominence > 1e4


@pytest.mark.parametrize("offset", [0.03, -0.3, 2.0])
@pytest.mark.parametrize("size", [1e-3, 0.35])
def test_offset_and_size_do_not_matter(offset: float, size: float) -> None:
    noisy = reading(1.234) + 1e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    plain, moved = psd_peak(Record(TIME, noisy)), psd_peak(Record(TIME, offset + size * noisy))
    assert moved.frequency == pytest.approx(plain.frequency, rel=1e-6)
    assert moved.prominence == pytest.approx(plain.prominence, rel=1e-6)


def damped(
    cycles: float, per_cycle: float, zeta: float, drift: float, shape: int, seed: int
) -> tuple[float, Record]:
    """A decay at any frequency with a drift of its centre, straight, bowed or levelling off; and its frequency."""
    rng = np.random.default_rng([31, seed])
    frequency, size = 10.0 ** rng.uniform(-0.3, 1.9), round(cycles * per_cycle)
    time = np.arange(size) / (frequency * per_cycle)
    part, omega = time / time[-1], 2.0 * np.pi * frequency
    centre = drift * (part, np.sin(np.pi * part), np.exp(-3.0 * part))[shape]
    swing = np.exp(-zeta * omega * time) * np.cos(
        np.sqrt(1.0 - zeta**2) * omega * time + rng.uniform(0.0, 6.28)
    )
    return frequency, Record(time, 0.35 * (swing + centre) + 0.002 * rng.standard_normal(size))


def misses(count: int, longest: float, samples: float) -> list[tuple[float, ...]]:
    """The decays at random from 3 to ``longest`` cycles whose frequency is not found, to 2 % or half a bin."""
    rng, missed = np.random.default_rng(32), []
    for seed in range(count):
        cycles = 10.0 ** rng.uniform(np.log10(3.0), np.log10(longest))
        per_cycle = max(3.0, min(10.0 ** rng.uniform(np.log10(4.0), 3.0), samples / cycles))
        zeta, drift = (
            10.0 ** rng.uniform(np.log10(3e-5), np.log10(0.05)),
            rng.choice([0.0, 0.1]) * rng.random(),
        )
        frequency, record = damped(cycles, per_cycle, zeta, drift, seed % 3, seed)
        found = starting_frequency(record)
        if found is None or abs(found / frequency - 1.0) > max(0.02, 0.5 / cycles, 1.5 * zeta):
            missed.append((cycles, per_cycle, zeta, drift))
    return missed


def test_the_frequency_of_a_decay_is_found_whatever_its_length() -> None:
    assert misses(60, 2e4, 5e4) == []


@pytest.mark.slow
def test_the_frequency_of_a_decay_is_found_at_any_rate_and_length() -> None:
    assert misses(1000, 2e4, 4e5) == []


@pytest.mark.slow
@pytest.mark.parametrize("drift", [0.0, 0.09])
def test_a_decay_of_thousands_of_cycles_is_identified(drift: float) -> None:
    """With a drift of its centre, too, by which neither frequency nor damping changes."""
    omega, zeta, time = 275.9575, 1e-4, np.arange(50000) / 300.0
    angle = np.exp(-zeta * omega * time) * np.cos(omega * time) + drift * time / time[-1]
    angle += 0.01 * np.random.default_rng(3).standard_normal(time.size)
    campaign = Campaign(
        "ring", RigProperties(), SensorProperties(), (Run("a", Record(time, 0.044 * angle), 0.0),)
    )
    (run,) = identify(campaign).runs
    assert run.omega_n is not None
    assert run.zeta is not None
    assert run.omega_n.value == pytest.approx(omega, abs=5.0 * run.omega_n.std)
    assert run.omega_n.std < 1e-4
    assert run.zeta.value == pytest.approx(zeta, rel=0.01)
    assert Status.FREQUENCY_CHANGES not in run.statuses
