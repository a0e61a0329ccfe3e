"""Whitening of coloured noise: an autoregressive filter that is exact from the first value of a record on."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg import solve_triangular

from tunnel_sim.vocabulary.record import Array

#: The filter of white noise, which changes nothing.
WHITE: Array = np.ones(1)


def whiten(values: Array, whitening: Array) -> Array:
    """Predict every value from those before it, and keep the errors.

    Args:
        values: of a record, or of several in columns, shape (n,) or (n, k), any unit.
        whitening: the errors' filter, 1 and the negative autoregressive coefficients, shape (order + 1,).

    Returns:
        Of the values' shape and unit. Noise of that spectrum becomes white with the variance of its innovations;
        the first values are predicted from the fewer before them, and scaled to the same variance.
    """
    if whitening.size == 1:
        return values
    from scipy.signal import oaconvolve  # only here: slow to load

    taps = whitening.reshape(-1, *[1] * (values.ndim - 1))
    start = _start(whitening.tobytes())[: len(values), : len(values)]
    with np.errstate(invalid="ignore"):  # a motion that grew without bound; the caller looks for it
        errors = oaconvolve(values, taps, axes=0)[: len(values)]
        errors[: len(start)] = start @ values[: len(start)]
    return np.asarray(errors, np.float64)


def colour(errors: Array, whitening: Array) -> Array:
    """The values of which `whiten` makes these errors, in their unit.

    Args:
        errors: shape (n,), any unit.
        whitening: the filter, shape (order + 1,).
    """
    if whitening.size == 1:
        return errors
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
    from scipy.signal import oaconvolve  # only here: slow to load

    taps = whitening.reshape(-1, *[1] * (errors.ndim - 1))
    return np.asarray(oaconvolve(errors[::-1], taps, axes=0)[: len(errors)][::-1], np.float64)


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
    return 1.0 if whitening.size == 1 else 1.0 / float(_start(whitening.tobytes())[0, 0])


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
