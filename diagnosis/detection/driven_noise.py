"""The noise of a driven run: what its response contains beside what follows from the input."""

from __future__ import annotations

import numpy as np
from scipy.special import gammaincinv

from tunnel_sim.vocabulary.record import Array

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
