"""The frequency of a record, and with it the decay that a fit starts from.

The frequency is that of the highest peak of the power spectral density. From it and the record alone follow
starting values of a fit at any damping. A record is refused here for numerical reasons only; the methods judge
everything else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from identification.policy import LEAST_SAMPLES
from identification.signal.decay_fit import Reading, mean_of_blocks, projected_cost
from identification.signal.free_decay import Decay
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced, read_only

# Fourth powers of readings and of times are summed over a record: beyond these limits they overflow or underflow.
_LEAST, _GREATEST = 1e-60, 1e60
_ROUNDING = 1e-12  # of the largest reading: a few thousand rounding errors, in which no motion can be seen


def holds_motion(record: Record) -> bool:
    """Whether a record has enough samples, and a reading that changes by more than rounding.

    Returns:
        False for a record of fewer than eight samples, for a constant one, and for one whose numbers are so large
        or small that their squares cannot be summed.
    """
    if record.time_s.size < LEAST_SAMPLES:
        return False
    low, high = float(record.yaw_rad.min()), float(record.yaw_rad.max())
    largest = max(abs(low), abs(high))
    if not largest < _GREATEST:
        return False
    span = high - low
    return (
        span > max(_LEAST, _ROUNDING * largest)
        and record.sample_interval > _LEAST
        and record.duration < _GREATEST
        and bool(np.abs(record.time_s).max() < _GREATEST)
    )


_PADDING = 8  # zero padding: eight times the record, so the interpolated peak sits within 1/16 of a bin

_FEWEST_CYCLES = 2.0  # in a record whose motion lasts as long as it does


@dataclass(frozen=True)
class SpectralPeak:
    """The highest peak of a power spectral density.

    Args:
        frequency: of the peak, Hz; 0 where the record holds no motion (`holds_motion`).
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


_SAMPLES = 1024  # candidates are compared on a thinned record; the fit itself uses every sample
_LONG = 4096  # samples for the spectrum; a longer record is thinned to them and not padded
_DAMPING_RATIOS = (0.0, 0.002, 0.006, 0.02, 0.06, 0.2, 0.5)


def starting_decay(record: Record) -> Decay | None:
    """A decay close enough for the least-squares fit to converge.

    For records of many cycles the candidates are the peak of the power spectral density with several damping
    ratios; for heavily damped ones, the fit of the twice integrated equation of motion. The candidate with the
    smallest sum of squares is taken.

    Returns:
        The decay; None where the record holds no motion, or no decay fits it at all.
    """
    frequency = starting_frequency(record)
    if frequency is None:
        return None
    thin = thinned_reading(record, frequency)
    omega = 2.0 * np.pi * frequency
    candidates = [Decay.from_modal(omega / np.sqrt(1.0 - zeta**2), zeta) for zeta in _DAMPING_RATIOS]
    # y + 2a∫y + k∬y = c₀ + c₁t + c₂t²: linear in a and k, and integration reduces the noise.
    time, yaw = thin.time, thin.yaw
    once = _integral(time, yaw)
    twice = _integral(time, once)
    columns = np.column_stack((once, twice, np.ones_like(time), time, time**2))
    scale = np.linalg.norm(columns, axis=0)
    solution = np.linalg.lstsq(columns / scale, -yaw, rcond=None)[0] / scale
    integrated = Decay(float(solution[0]) / 2.0, float(solution[1]))
    if integrated.stiffness > 0.0:
        candidates.append(integrated)
    costs = [projected_cost(thin, candidate) for candidate in candidates]
    best = int(np.argmin(costs))
    return candidates[best] if np.isfinite(costs[best]) else None


def starting_frequency(record: Record) -> float | None:
    """The approximate frequency of the strongest oscillation.

    Returns:
        Hz; None where the record holds no motion.
    """
    if not holds_motion(record):
        return None
    # A block mean hides an oscillation of two samples per cycle or fewer: a record of some two thousand cycles.
    factor = max(1, record.time_s.size // _LONG)
    if factor > 1:
        record = Record(mean_of_blocks(record.time_s, factor), mean_of_blocks(record.yaw_rad, factor))
    frequency = psd_peak(record, padding=8 if factor == 1 else 1, falling=True).frequency
    return None if frequency == 0.0 else frequency


def thinned_reading(record: Record, frequency: float) -> Reading:
    """Block means of a record, at least twenty per cycle; they decay at the same rate.

    Args:
        frequency: of its oscillation, Hz.

    Returns:
        The thinned reading, about a thousand samples of a long record; its clock starts at the first sample.
    """
    factor = max(1, min(record.time_s.size // _SAMPLES, int(record.sample_rate / (20.0 * frequency))))
    return Reading(
        mean_of_blocks(record.time_s - record.time_s[0], factor), mean_of_blocks(record.yaw_rad, factor)
    )


def _integral(time: Array, values: Array) -> Array:
    steps = np.diff(time) * 0.5 * (values[1:] + values[:-1])
    return np.concatenate(([0.0], np.cumsum(steps)))
