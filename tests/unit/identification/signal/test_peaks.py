"""The line through the logarithms of the peaks; truth: SciPy's linear regression."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import linregress

from identification.signal.frequency import _line, follow_peaks
from tunnel_sim.vocabulary.record import Record


def test_the_gradient_and_its_deviation_are_those_of_a_linear_regression() -> None:
    rng = np.random.default_rng(5)
    x = np.sort(rng.uniform(3.0, 40.0, 11))
    y = 0.7 - 0.03 * x + 0.2 * rng.standard_normal(11)
    expected = linregress(x, y)
    assert _line(x, y) == pytest.approx((expected.slope, expected.stderr))


@pytest.mark.parametrize("rate", [10.0, 14.0, 200.0])
def test_peaks_are_followed_at_ten_samples_a_period(rate: float) -> None:
    time = np.arange(0.0, 10.0, 1.0 / rate)
    reading = 0.2 + np.exp(-0.1 * time) * np.cos(2.0 * np.pi * time)
    times, heights = follow_peaks(Record(time, reading), 1.0, sparse=True)
    assert times == pytest.approx(0.5 * np.arange(1, times.size + 1), abs=0.02)
    assert times.size >= 18
    peaks = np.exp(-0.1 * times) * (-1.0) ** np.arange(1, times.size + 1)
    assert heights - 0.2 == pytest.approx(peaks, abs=0.015)
