"""The frequency of a damped oscillation from its power spectral density."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from identification.decay.readable import holds_motion
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced, read_only

_PADDING = 8  # zero padding: eight times the record, so the interpolated peak sits within 1/16 of a bin

_FEWEST_CYCLES = 2.0  # in a record whose motion lasts as long as it does


@dataclass(frozen=True)
class SpectralPeak:
    """The highest peak of a power spectral density.

    Args:
        frequency: of the peak, Hz; 0 where the record holds no motion (`readable.holds_motion`).
        prominence: its power over the median's; white noise alone reaches 40 less than once in 1e6 records.
    """

    frequency: float
    prominence: float


def psd_peak(record: Record, *, padding: int = _PADDING, falling: bool = False) -> SpectralPeak:
    """The damped frequency, as the peak of the power spectral density.

    The mean is removed. A Hann window keeps the offset and the negative frequencies from leaking into the peak. The
    record is padded with zeros to at least eight times its length. A parabola through the logarithms of the three
    highest bins gives the peak between them.

    Args:
        record: the reading, n samples, rad against s.
        padding: the record is padded to at least this number of times its length; 1 is faster, and good enough to
            start a fit of many cycles.
        falling: whether the window falls from the start of the record, instead of rising first: it then sees a
            decay that ends long before the record does.
    """
    if not holds_motion(record):
        return SpectralPeak(0.0, 0.0)
    record = evenly_spaced(record, bridged=False)
    centred = record.yaw_rad - record.yaw_rad.mean()
    size = 1 << int(np.ceil(np.log2(padding * centred.size)))
    # Below one cycle per record the spectrum holds the offset's remainder, not the oscillation.
    lowest = max(1, int(size / centred.size))
    place, power = highest_peak(centred * _window(centred.size, falling), size, lowest)
    highest = float(power[lowest:-1].max())
    if highest <= 0.0:
        return SpectralPeak(0.0, 0.0)
    median = max(float(np.median(power[lowest:])), 1e-300)
    return SpectralPeak(place * record.sample_rate / size, highest / median)


def highest_peak(values: Array, size: int, lowest: int = 1) -> tuple[float, Array]:
    """Where the spectrum of a series is highest, between its bins.

    Args:
        values: the series, windowed, without its mean, shape (n,).
        size: number of samples it is padded to with zeros, at least n.
        lowest: first bin to be considered; the last bin is never considered.

    Returns:
        The place of the peak in bins, by a parabola through the logarithms of the three highest; and the power,
        shape (size // 2 + 1,).
    """
    power = np.abs(np.fft.rfft(values, size)) ** 2
    peak = lowest + int(np.argmax(power[lowest:-1]))
    return peak + _parabola_offset(power[peak - 1 : peak + 2]), power


def peak_of_swing(swing: Array, size: int) -> float:
    """Where the spectrum of a decay is highest, between its bins.

    Args:
        swing: the series without its mean, shape (n,), any unit.
        size: number of samples it is padded to with zeros, at least n.

    Returns:
        The place of the peak in bins, with a Hann window. A peak below two cycles of the series is none of the
        motion's: a heavily damped one is over before the middle of the series. It is then sought with a window that
        falls from the start.
    """
    place, _ = highest_peak(swing * _window(swing.size, falling=False), size)
    per_cycle = size / swing.size
    if place < _FEWEST_CYCLES * per_cycle:
        place, _ = highest_peak(swing * _window(swing.size, falling=True), size, max(1, int(per_cycle)))
    return place


@lru_cache(maxsize=4)  # most runs of a campaign have the same length
def _window(size: int, falling: bool) -> Array:
    return read_only(np.hanning(2 * size)[size:] if falling else np.hanning(size))


def _parabola_offset(power: Array) -> float:
    # Where the parabola through three log powers peaks, in bins from the middle one, at most one half.
    low, middle, high = np.log(np.maximum(power, 1e-300))
    curvature = low - 2.0 * middle + high
    if curvature >= 0.0:
        return 0.0
    return float(np.clip(0.5 * (low - high) / curvature, -0.5, 0.5))
