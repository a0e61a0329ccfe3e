"""The peak of the power spectral density. Truth: the frequency of the sine that is put in."""

from __future__ import annotations

import numpy as np
import pytest

from identification.signal.frequency import psd_peak
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
