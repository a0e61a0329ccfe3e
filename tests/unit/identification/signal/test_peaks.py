"""The line through the logarithms of the peaks, and the deviations of its rate and of the spectrum's peak."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, linregress

from identification.signal.frequency import follow_peaks, peak_decay, psd_peak, psd_peak_std
from identification.signal.noise import PeakNoise
from tunnel_sim.vocabulary.record import Record


def noisy(rng: np.random.Generator) -> Record:
    time = np.arange(0.0, 10.0, 0.005)
    swing = np.exp(-0.1 * time) * np.cos(2.0 * np.pi * time)
    return Record(time, swing + 0.01 * rng.standard_normal(time.size))


def test_the_rate_and_its_deviation_are_those_of_a_linear_regression_where_peaks_scatter() -> None:
    record = noisy(np.random.default_rng(5))
    times, heights = follow_peaks(record, 1.0)
    found = peak_decay(record, 1.0, PeakNoise(1e-6, 1e-6))
    assert found is not None
    expected = linregress(times, np.log(np.abs(heights - found.zero)))
    assert (found.rate, found.rate_std) == pytest.approx((-expected.slope, expected.stderr))


def test_the_deviations_are_those_of_repeated_noise() -> None:
    """Truth: the scatter over draws of the noise, of the rate and of the frequency of the spectrum's peak."""
    rng, trials = np.random.default_rng(6), 200
    noise = PeakNoise.of(0.01, 0.005**-1 / 6.0)
    rates, stds, frequencies = [], [], []
    for _ in range(trials):
        record = noisy(rng)
        found = peak_decay(record, 1.0, noise)
        assert found is not None
        rates.append(found.rate)
        stds.append(found.rate_std)
        frequencies.append(psd_peak(record).frequency)
    chance = np.sqrt(chi2.isf([1.0 - 1e-4, 1e-4], trials - 1) / (trials - 1))
    for values, std in ((rates, np.median(stds)), (frequencies, psd_peak_std(noisy(rng), 1.0, 0.01))):
        assert chance[0] < np.std(values, ddof=1) / std < chance[1]


@pytest.mark.parametrize("rate", [10.0, 14.0, 200.0])
def test_peaks_are_followed_at_ten_samples_a_period(rate: float) -> None:
    time = np.arange(0.0, 10.0, 1.0 / rate)
    reading = 0.2 + np.exp(-0.1 * time) * np.cos(2.0 * np.pi * time)
    times, heights = follow_peaks(Record(time, reading), 1.0, sparse=True)
    assert times == pytest.approx(0.5 * np.arange(1, times.size + 1), abs=0.02)
    assert times.size >= 18
    peaks = np.exp(-0.1 * times) * (-1.0) ** np.arange(1, times.size + 1)
    assert heights - 0.2 == pytest.approx(peaks, abs=0.015)
