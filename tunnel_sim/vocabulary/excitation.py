"""Waveforms that drive a rig, of peak value 1 at the times of the samples."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.record import Array


def stepped_sine(time_s: Array, frequencies_hz: Sequence[float]) -> Array:
    """A sine that dwells equally long at each frequency, without a jump of its phase.

    Args:
        time_s: of the samples from 0 on, shape (n,), s, evenly spaced.
        frequencies_hz: in their order, Hz; a single one gives a plain sine.

    Returns:
        Shape (n,), dimensionless.
    """
    rates = np.asarray(frequencies_hz, dtype=np.float64)
    dwell = time_s.size * (time_s[1] - time_s[0]) / rates.size
    ends = np.append(dwell * np.arange(rates.size), np.inf)
    cycles = np.interp(time_s, ends[:-1], np.append(0.0, np.cumsum(dwell * rates[:-1])))
    last = time_s > ends[-2]
    cycles[last] += rates[-1] * (time_s[last] - ends[-2])
    values: Array = np.sin(2.0 * pi * cycles)
    return values


def chirp(time_s: Array, start_hz: float, end_hz: float) -> Array:
    """A sine whose frequency changes linearly with time.

    Args:
        time_s: of the samples from 0 on, shape (n,), s.
        start_hz: frequency at the first sample, Hz.
        end_hz: frequency at the last sample, Hz.

    Returns:
        Shape (n,), dimensionless.
    """
    slope = (end_hz - start_hz) / time_s[-1]
    values: Array = np.sin(2.0 * pi * (start_hz + 0.5 * slope * time_s) * time_s)
    return values


def square(time_s: Array, frequency_hz: float) -> Array:
    """A square wave that begins with 1.

    Args:
        time_s: of the samples from 0 on, shape (n,), s.
        frequency_hz: Hz.

    Returns:
        1 or −1, shape (n,).
    """
    half_cycles = np.floor(2.0 * frequency_hz * time_s + 1e-9)  # a sample that rounding puts before its edge
    return 1.0 - 2.0 * (half_cycles % 2.0)


def lines_in_band(size: int, interval: float, low_hz: float, high_hz: float) -> Array:
    """Which multiples of one over the record's length lie in a band, below half the sample rate.

    Args:
        size: number of samples n (a count).
        interval: between samples, s.
        low_hz: lower end of the band, included, Hz.
        high_hz: upper end of the band, included, Hz.

    Returns:
        Numbers of the lines, whole numbers, shape (k,).
    """
    length = size * interval
    first, last = np.ceil(low_hz * length - 1e-9), np.floor(high_hz * length + 1e-9)
    return np.arange(max(first, 1.0), min(last, (size - 1) // 2) + 1.0)


def multisine(time_s: Array, low_hz: float, high_hz: float, rng: np.random.Generator | None = None) -> Array:
    """Cosines of equal amplitude at all multiples of one over the record's length within a band.

    Args:
        time_s: of the samples from 0 on, shape (n,), s, evenly spaced.
        low_hz: lower end of the band, Hz.
        high_hz: upper end of the band, below half the sample rate, Hz; at least one line lies between.
        rng: draws the phases; None: those of Schroeder, −π k (k − 1)/N of the k-th of N lines, which keep the peak
            low (doi:10.1109/TIT.1970.1054411).

    Returns:
        Shape (n,), dimensionless; one period is the record.
    """
    lines = lines_in_band(time_s.size, time_s[1] - time_s[0], low_hz, high_hz)
    k = np.arange(1.0, lines.size + 1.0)
    phases = -pi * k * (k - 1.0) / lines.size if rng is None else rng.uniform(0.0, 2.0 * pi, lines.size)
    return _of_lines(time_s.size, lines, np.exp(1j * phases))


def band_noise(time_s: Array, low_hz: float, high_hz: float, rng: np.random.Generator) -> Array:
    """Gaussian noise that is white within a band and absent outside it.

    Args:
        time_s: of the samples from 0 on, shape (n,), s, evenly spaced.
        low_hz: lower end of the band, Hz.
        high_hz: upper end of the band, below half the sample rate, Hz; at least one multiple of one over the
            record's length lies between.
        rng: draws the amplitudes and phases of these multiples.

    Returns:
        Shape (n,), dimensionless.
    """
    lines = lines_in_band(time_s.size, time_s[1] - time_s[0], low_hz, high_hz)
    return _of_lines(
        time_s.size, lines, rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size)
    )


def _of_lines(size: int, lines: Array, weights: NDArray[np.complex128]) -> Array:
    spectrum = np.zeros(size // 2 + 1, dtype=np.complex128)
    spectrum[lines.astype(np.int64)] = weights
    values: Array = np.fft.irfft(spectrum, size)
    values /= np.max(np.abs(values))
    return values
