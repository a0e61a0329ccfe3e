"""The noise of records without a quiet band: samples that are not evenly spaced, and driven runs.

A periodogram has no band free of the motion there: an irregular clock spreads it over all frequencies.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.special import gammaincinv

from identification.signal.decay_fit import mean_of_blocks
from tunnel_sim.vocabulary.record import Array, Record

_ORDER = 5
_KNOTS = 24.0  # per cycle at most: the curve follows what is slower than twelve times the motion
_KNOTS_OF_MOTION = 12.0  # per cycle: it follows what is slower than six times the motion
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
        curve = SmoothCurve(record.time_s[place], piece)
        means = mean_of_blocks(curve.left(record.yaw_rad[place]), block)
        squares += float(means @ means)
        freedom += means.size - absorbed * (place.size // piece + _ORDER)
    return block * squares / max(freedom, 1.0), float(np.sqrt(2.0 / max(freedom, 1.0)))


def beside_the_motion(record: Record, frequency: float) -> SmoothCurve:
    """A curve that follows the motion and nothing much faster.

    Args:
        frequency: of the motion, Hz.
    """
    return SmoothCurve(record.time_s, max(2, round(record.sample_rate / (_KNOTS_OF_MOTION * frequency))))


class SmoothCurve:
    """A quintic spline through some times, by least squares.

    Args:
        time: of the samples, shape (n,), s.
        piece: samples between its knots.
    """

    def __init__(self, time: Array, piece: int) -> None:
        inner = time[piece : 1 - piece : piece]
        self.time = time
        self.knots = np.concatenate([np.full(_ORDER + 1, time[0]), inner, np.full(_ORDER + 1, time[-1])])

    def left(self, values: Array) -> Array:
        """What the curve leaves of the values, shape (n,) or (n, k)."""
        curve = make_lsq_spline(self.time, values, self.knots, _ORDER)
        return np.asarray(values - curve(self.time), np.float64)


#: From here on the median is taken over eight windows or more. Simulated records of known noise then have no bias
#: beyond chance (3 %); with 200 samples the variance is 17 % too large, and with 130 five times and more.
LEAST_SAMPLES = 500

_LINES = 24  # of a window
_DEGREE = 2  # of the polynomials of the response to the input, and of the ends of the record
_FROM = 0.1  # of the sampling rate: the lowest frequency used where the record allows no higher one
_TO = 0.49  # of the sampling rate


def driven_variance(reading: Array, values: Array, low: float) -> tuple[float, float]:
    """Variance of the white noise of a driven run, by the local polynomial method.

    In each narrow window of the spectrum, the frequency response and the effect of the record's ends are smooth
    (Pintelon and Schoukens, System Identification, 2nd ed., ch. 7). What is left is noise, and harmonics of the
    input where the body is not linear, which a median over the windows ignores as far as they are few.

    Args:
        reading: shape (n,), n at least `LEAST_SAMPLES`, rad.
        values: of the input at the same times, shape (n,).
        low: lowest frequency used, a share of the sampling rate.

    Returns:
        Variance of one sample, rad², and its relative standard deviation.
    """
    size = reading.size
    response = np.fft.rfft(reading - reading.mean()) / np.sqrt(size)
    moved = np.fft.rfft(values - values.mean())
    moved = moved / max(float(np.abs(moved).max()), 1e-300)
    first, last = int(min(low, _FROM) * size) + 1, int(_TO * size)
    starts = range(first, max(last - _LINES, first + 1), _LINES)
    place = np.linspace(-1.0, 1.0, _LINES)
    powers = place[:, None] ** np.arange(_DEGREE + 1)
    left = []
    for start in starts:
        window = slice(start, start + _LINES)
        given = moved[window, None] * powers / max(float(np.abs(moved[window]).max()), 1e-300)
        basis = np.linalg.qr(np.column_stack([given, powers]))[0]
        y = response[window]
        rest = y - basis @ (basis.conj().T @ y)
        left.append(float(np.sum(np.abs(rest) ** 2)))
    freedom = _LINES - 2 * (_DEGREE + 1)
    median = float(gammaincinv(freedom, 0.5))
    return float(np.median(left)) / median, 1.2533 / float(np.sqrt(len(left) * freedom))
