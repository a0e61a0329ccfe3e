"""The noise of a record whose samples are not evenly spaced, from what a smooth curve leaves of it.

A periodogram has no band free of the motion there: an irregular clock spreads it over all frequencies.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_lsq_spline

from identification.decay.thinning import mean_of_blocks
from tunnel_sim.vocabulary.record import Array, Record

_ORDER = 5
_KNOTS = 24.0  # per cycle at most: the curve follows what is slower than twelve times the motion
_LONG_GAP = 0.25  # of a cycle: the curve is not drawn across it
_LEAST_PIECES = 8  # of a curve


def scattered_variance(record: Record, frequency: float, block: int) -> tuple[float, float]:
    """Variance of the noise as it acts on means of neighbouring samples.

    Args:
        frequency: of its motion, Hz.
        block: samples that a mean is taken of. Where stamps were given to the samples afterwards, neighbours share
            some noise, so that differences of single samples would miss it.

    Returns:
        Variance of a mean times ``block``, in the reading's unit squared, and its relative standard deviation.
    """
    piece = max(2 * block, round(record.sample_rate / (_KNOTS * frequency)))
    widest = max(_LONG_GAP / frequency, 2.0 * record.sample_interval)
    gaps = np.flatnonzero(np.diff(record.time_s) > widest)
    stretches = np.split(np.arange(record.time_s.size), gaps + 1)
    whole = [place for place in stretches if place.size >= _LEAST_PIECES * piece]
    # The curve takes the noise below its knots' Nyquist frequency; of it means pass 1 − (block² − 1)(π f/rate)²/3.
    absorbed = 1.0 - (block**2 - 1) * (np.pi / (2.0 * piece)) ** 2 / 9.0
    squares, freedom = 0.0, 0.0
    for place in whole or [np.arange(record.time_s.size)]:
        means = mean_of_blocks(_left(record.time_s[place], record.yaw_rad[place], piece), block)
        squares += float(means @ means)
        freedom += means.size - absorbed * (place.size // piece + _ORDER)
    return block * squares / max(freedom, 1.0), float(np.sqrt(2.0 / max(freedom, 1.0)))


def _left(time: Array, values: Array, piece: int) -> Array:
    """What the best quintic spline with ``piece`` samples between its knots leaves."""
    inner = time[piece : 1 - piece : piece]
    knots = np.concatenate([np.full(_ORDER + 1, time[0]), inner, np.full(_ORDER + 1, time[-1])])
    return np.asarray(values - make_lsq_spline(time, values, knots, _ORDER)(time), np.float64)
