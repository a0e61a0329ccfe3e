"""How many cycles of free oscillation a record holds, whatever else is on it."""

from __future__ import annotations

import numpy as np

from tunnel_sim.vocabulary.record import Array, Record

MAINS_HZ = (50.0, 60.0)
# A spectral line counts when it is this many times the median of the spectrum. Of white noise, whose bins are
# exponentially distributed, one record of 10 000 samples in about thirty thousand has such a line. A record
# shorter than SHORT_RECORD samples has too few bins for a background: its strongest line counts.
LINE_OVER_MEDIAN = 27.0
SHORT_RECORD = 100
# A crossing counts when the reading then goes this far, as a share of the largest swing, beyond the centre.
HYSTERESIS = 0.03
NOISE_MARGIN = 4.0  # standard deviations of the smoothed noise, where that is the larger one


def count_cycles(record: Record) -> float:
    """Cycles of the dominant oscillation within the record.

    Slow drift and mains hum are taken off, the dominant spectral line gives the time scale, a moving average
    of a quarter of its period takes off what is faster, and the crossings of the centre of oscillation, with
    hysteresis, give the period. The number of cycles is the record's duration over that period, so that a
    heavily damped run counts beyond the last swing that stands out of the noise.

    Args:
        record: the reading; its zero, noise, resolution and clipping do not matter.

    Returns:
        The number of cycles; 0 when nothing oscillates.
    """
    reading = _without_hum(record)
    level = _without_trend(reading)
    # What is left of a constant, a straight line or pure hum is rounding.
    if reading.size < 6 or float(np.ptp(level)) <= 1e-9 * float(np.abs(record.yaw_rad).max()):
        return 0.0
    frequency = _dominant_frequency(level, record.sample_rate)
    if frequency is None:
        return 0.0
    width = max(1, round(0.25 * record.sample_rate / frequency))
    # A straight line through a heavily damped run is tilted by its first swing: the better count is taken.
    return max(_count(reading, width), _count(level, width))


def _count(reading: Array, width: int) -> float:
    """The record's length over the period of its crossings; 0 with fewer than two of them."""
    crossings = _crossings(reading, width)
    if crossings.size < 2:
        return 0.0
    # Whole periods where there are any, for the halves are unequal about a shifted centre; their median, for
    # the last crossing may be a late wander of the rest position.
    whole = crossings[2:] - crossings[:-2]
    period = float(np.median(whole)) if whole.size else 2.0 * float(crossings[1] - crossings[0])
    return reading.size / period


def _without_hum(record: Record) -> Array:
    """The reading less a sinusoid at each mains frequency, fitted second by second.

    Second by second, because the mains wander by some hundredths of a hertz.
    """
    reading: Array = record.yaw_rad - record.yaw_rad.mean()
    block = round(record.sample_rate)
    for mains in MAINS_HZ:
        # Too short a record, or too slow a sampling, cannot tell the hum from the motion.
        if reading.size < block or mains > 0.45 * record.sample_rate:
            continue
        phase = 2.0 * np.pi * mains * np.arange(block) / record.sample_rate
        # A level and a slope are fitted beside the hum, so that a second's motion is not taken for hum.
        hum_basis = np.column_stack([np.cos(phase), np.sin(phase)])
        basis = np.column_stack([hum_basis, np.ones(block), np.linspace(-1.0, 1.0, block)])
        # The last block is a whole one too: it begins inside the one before and mends only its own part.
        starts = [*range(0, reading.size - block, block), reading.size - block]
        pieces = np.stack([reading[start : start + block] for start in starts])
        hum = pieces @ np.linalg.pinv(basis).T[:, :2] @ hum_basis.T
        overlap = len(starts) * block - reading.size
        reading = reading - np.concatenate([hum[:-1].ravel(), hum[-1, overlap:]])
    return reading


def _without_trend(reading: Array) -> Array:
    """The reading less its straight line: a sensor's drift is no oscillation."""
    abscissa = np.linspace(-1.0, 1.0, reading.size)
    slope = float(abscissa @ reading) / float(abscissa @ abscissa)
    level: Array = reading - float(reading.mean()) - slope * abscissa
    return level


def _dominant_frequency(reading: Array, sample_rate: float) -> float | None:
    """The strongest line of the spectrum, Hz; None when none stands out of the noise."""
    power = np.abs(np.fft.rfft(reading))[1:] ** 2
    frequency = np.fft.rfftfreq(reading.size, 1.0 / sample_rate)[1:]
    # Between power and power per octave: neither slow wander nor a short ringing may hide the oscillation.
    background = float(np.median(power)) if reading.size >= SHORT_RECORD else 0.0
    share = np.where(power > LINE_OVER_MEDIAN * background, power * np.sqrt(frequency), 0.0)
    best = int(np.argmax(share))
    return float(frequency[best]) if share[best] > 0.0 else None


def _crossings(reading: Array, width: int) -> Array:
    """Where the smoothed reading crosses its centre, in samples, with hysteresis."""
    total = np.concatenate([[0.0], np.cumsum(reading)])
    smooth = (total[width:] - total[:-width]) / width
    smooth = smooth - np.median(smooth)
    # Differences of neighbours see the noise and hardly the motion.
    quartiles = np.percentile(np.diff(reading), [25.0, 75.0])
    noise = float(quartiles[1] - quartiles[0]) / (1.349 * np.sqrt(2.0 * width))
    largest = float(np.abs(smooth).max())
    # Where a cycle has few samples the differences do see the motion: hence the upper limit.
    band = min(max(HYSTERESIS * largest, NOISE_MARGIN * noise), 0.25 * largest)
    outside = np.flatnonzero(np.abs(smooth) > band)
    change = np.flatnonzero(np.diff(np.sign(smooth[outside])) != 0.0)
    # Between the last sample on one side of the band and the first on the other.
    return 0.5 * (outside[change] + outside[change + 1]).astype(np.float64)
