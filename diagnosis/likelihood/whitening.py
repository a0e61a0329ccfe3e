"""Whitening of coloured noise: an autoregressive filter that is exact from the first value of a record on."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_triangular

from tunnel_sim.vocabulary.record import Array


def whiten(values: Array, whitening: Array) -> Array:
    """Predict every value from those before it, and keep the errors.

    Args:
        values: of a record, or of several in columns, shape (n,) or (n, k), any unit.
        whitening: the errors' filter, 1 and the negative autoregressive coefficients, shape (order + 1,),
            of order 1 or more.

    Returns:
        Of the values' shape and unit. Noise of that spectrum becomes white with the variance of its innovations;
        the first values are predicted from the fewer before them, and scaled to the same variance.
    """
    start = _start(whitening.tobytes())[: len(values), : len(values)]
    with np.errstate(invalid="ignore"):  # a motion that grew without bound; the caller looks for it
        errors = _convolved(values, whitening)
        errors[: len(start)] = start @ values[: len(start)]
    return errors


def colour(errors: Array, whitening: Array) -> Array:
    """The values of which `whiten` makes these errors, in their unit.

    Args:
        errors: shape (n,), any unit.
        whitening: the filter, shape (order + 1,).
    """
    from scipy.signal import lfilter, lfiltic  # only here: slow to load

    start = _start(whitening.tobytes())[: errors.size, : errors.size]
    first = solve_triangular(start, errors[: len(start)], lower=True)
    memory = lfiltic([1.0], whitening, first[::-1])
    return np.concatenate([first, lfilter([1.0], whitening, errors[len(start) :], zi=memory)[0]])


def correlate(errors: Array, whitening: Array) -> Array:
    """The transpose of the filter: the sum of its taps times the errors that follow each value, 0 beyond the end.

    Args:
        errors: of a record, or of several in columns, shape (n,) or (n, k), any unit.
        whitening: the filter, shape (order + 1,).
    """
    if whitening.size == 1:
        return np.asarray(errors * whitening[0], np.float64)
    return _convolved(errors[::-1], whitening)[::-1]


def response(whitening: Array, frequency: Array) -> np.ndarray:
    """The complex frequency response of a whitening filter, of the frequency's shape.

    Args:
        whitening: the filter, shape (order + 1,).
        frequency: in cycles per value, any shape.
    """
    return np.asarray(np.polynomial.polynomial.polyval(np.exp(-2j * np.pi * frequency), whitening))


def colouring(whitening: Array) -> float:
    """Standard deviation of noise over that of its innovations, 1 or more.

    Args:
        whitening: the filter, shape (order + 1,).
    """
    return 1.0 / float(_start(whitening.tobytes())[0, 0])


def _convolved(values: Array, whitening: Array) -> Array:
    """The convolution with the filter, of the values' shape."""
    size = next_fast_len(len(values) + whitening.size - 1, real=True)
    transform = _transform(whitening.tobytes(), size).reshape(-1, *[1] * (values.ndim - 1))
    found = irfft(rfft(values, size, axis=0) * transform, size, axis=0, overwrite_x=True)
    return np.asarray(found[: len(values)], np.float64)


@lru_cache(maxsize=32)  # runs of a campaign; SciPy's own convolutions transform the filter in every call
def _transform(filter_bytes: bytes, size: int) -> np.ndarray:
    return np.asarray(rfft(np.frombuffer(filter_bytes), size))


@lru_cache(maxsize=32)  # runs of a campaign
def _start(filter_bytes: bytes) -> Array:
    """Predictors of the first values from all before them, over their standard deviation, shape (order, order).

    The predictors of lower order follow from the filter by the Levinson recursion taken backwards (S. M. Kay,
    Modern Spectral Estimation, 1988, sect. 6.3).
    """
    predictor = np.frombuffer(filter_bytes)
    order = predictor.size - 1
    rows = np.zeros((order, order))
    variance = 1.0  # of the prediction error, in that of the whole filter
    for m in range(order, 0, -1):
        reflection = predictor[-1]
        left = 1.0 - reflection**2
        predictor = (predictor - reflection * predictor[::-1])[:-1] / left
        variance /= left
        rows[m - 1, :m] = predictor[::-1] / np.sqrt(variance)
    return rows
