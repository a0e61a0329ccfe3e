"""The noise of a run's block means, one type for each kind: its whitening filter and its strength.

All kinds are noise of evenly spaced samples. Blocks with fewer samples are treated in the run.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_triangular

from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class RunNoise(ABC):
    """A kind of noise; one that changes along the run overrides `transposed`, `powers_onward` and `part` as well.

    Args:
        variance: variance of the white noise after `white`, rad².
    """

    variance: float

    #: Whether the noise is white and equally strong throughout, so that `white` changes nothing.
    plain: ClassVar[bool] = False

    @property
    def scale(self) -> float:
        """Standard deviation of the white noise after `white`, rad."""
        return float(np.sqrt(self.variance))

    @property
    def over_white(self) -> float:
        """Standard deviation of the noise over `scale`, 1 or more."""
        return 1.0

    @abstractmethod
    def white(self, values: Array) -> Array:
        """Whiten the noise of values, in their unit; of one run or several in columns, shape (n,) or (n, k)."""

    @abstractmethod
    def coloured(self, values: Array) -> Array:
        """The inverse of `white`, for values of shape (n,)."""

    @abstractmethod
    def response(self, cycles: Array) -> np.ndarray:
        """The complex factor by which `white` changes a sinusoid of some cycles per block, any shape."""

    def taps(self, count: int) -> Array:
        """Response of `white` to one value well inside a run of ``count`` blocks, dimensionless, shape (m,)."""
        middle = count // 2
        return self.white(np.eye(1, count, middle)[0])[middle:]

    def transposed(self, values: Array) -> Array:
        """The transpose of `white` well inside the run, for values of shape (n,) or (n, k)."""
        return _correlated(values, self.taps(len(values)))

    def powers_onward(self, values: Array) -> Array:
        """Power of the whitened values from each one to the last, with the earlier ones set to 0, shape (n,)."""
        taps = self.taps(values.size)
        lags = np.correlate(taps, taps, "full")[taps.size - 1 :]
        added = values * (2.0 * _correlated(values, lags) - lags[0] * values)
        return np.cumsum(added[::-1])[::-1]

    def part(self, first: int, last: int) -> RunNoise:
        """The noise of the blocks from ``first`` to before ``last``."""
        del first, last
        return self


class WhiteNoise(RunNoise):
    """White noise, which needs no filter."""

    plain = True

    def white(self, values: Array) -> Array:
        """The values themselves."""
        return values

    coloured = white

    def response(self, cycles: Array) -> np.ndarray:
        """1 at every frequency."""
        return np.ones(np.shape(cycles), np.complex128)

    def taps(self, count: int) -> Array:
        """The filter that changes nothing: the value 1."""
        del count
        return np.ones(1)


@dataclass(frozen=True, eq=False)
class AutoregressiveNoise(RunNoise):
    """Coloured noise with a filter that is exact from the first value of a record on.

    Args:
        variance: variance of the prediction errors, rad².
        whitening: prediction-error filter: each value less its prediction from the earlier ones; 1 and
            the negative autoregressive coefficients, shape (order + 1,), of order 1 or more.
    """

    whitening: Array

    @property
    def over_white(self) -> float:
        """By the prediction of the first value, which has no earlier values."""
        return 1.0 / float(_start(self.whitening.tobytes())[0, 0])

    def white(self, values: Array) -> Array:
        """The prediction errors; the first ones use fewer values, and are scaled to the same variance."""
        start = _start(self.whitening.tobytes())[: len(values), : len(values)]
        with np.errstate(invalid="ignore"):  # a motion that grew without bound; the caller checks for it
            errors = _convolved(values, self.whitening)
            errors[: len(start)] = start @ values[: len(start)]
        return errors

    def coloured(self, values: Array) -> Array:
        """The inverse of `white`: the values with these prediction errors."""
        from scipy.signal import lfilter, lfiltic  # imported here because it is slow to load

        start = _start(self.whitening.tobytes())[: values.size, : values.size]
        first = solve_triangular(start, values[: len(start)], lower=True)
        memory = lfiltic([1.0], self.whitening, first[::-1])
        return np.concatenate([first, lfilter([1.0], self.whitening, values[len(start) :], zi=memory)[0]])

    def response(self, cycles: Array) -> np.ndarray:
        """The response of the filter."""
        return _response(self.whitening, cycles)

    def taps(self, count: int) -> Array:
        """The filter."""
        del count
        return self.whitening


@dataclass(frozen=True, eq=False)
class NoiseWithMoment(RunNoise):
    """Noise plus the response to a random moment, which begins at rest with the run.

    Args:
        variance: variance after both filters, rad².
        sensor: the noise without the response; its variance does not matter.
        numerator: numerator of the filter that whitens the sum once the sensor's noise is white, shape (m,).
        denominator: denominator of that filter, shape (k,).
    """

    sensor: RunNoise
    numerator: Array
    denominator: Array

    @property
    def over_white(self) -> float:
        """The ratio for the sensor's noise alone."""
        return self.sensor.over_white

    def white(self, values: Array) -> Array:
        """Whiten the sensor's noise first, then the response."""
        with np.errstate(invalid="ignore"):  # a motion that grew without bound; the caller checks for it
            return _filtered(self.numerator, self.denominator, self.sensor.white(values))

    def coloured(self, values: Array) -> Array:
        """Restore the response first, then the sensor's noise."""
        return self.sensor.coloured(_filtered(self.denominator, self.numerator, values))

    def response(self, cycles: Array) -> np.ndarray:
        """The factors of both filters, multiplied."""
        own = self.sensor.response(cycles) * _response(self.numerator, cycles)
        return np.asarray(own / _response(self.denominator, cycles))

    def taps(self, count: int) -> Array:
        """The responses of both filters, one after the other, shape (count,)."""
        sensor, impulse = self.sensor.taps(count)[:count], np.zeros(count)
        impulse[: sensor.size] = sensor
        return _filtered(self.numerator, self.denominator, impulse)


def _filtered(numerator: Array, denominator: Array, values: Array) -> Array:
    """Values, in columns or in one, after a filter."""
    from scipy.signal import lfilter  # imported here because it is slow to load

    return np.asarray(lfilter(numerator, denominator, values, axis=0), np.float64)


def _response(taps: Array, cycles: Array) -> np.ndarray:
    return np.asarray(np.polynomial.polynomial.polyval(np.exp(-2j * np.pi * cycles), taps))


def _correlated(values: Array, taps: Array) -> Array:
    """Sum of the taps times the values that follow each one, 0 beyond the end."""
    return values * taps[0] if taps.size == 1 else _convolved(values[::-1], taps)[::-1]


def _convolved(values: Array, taps: Array) -> Array:
    """The convolution with the taps, of the values' shape."""
    size = next_fast_len(len(values) + taps.size - 1, real=True)
    transform = _transform(taps.tobytes(), size).reshape(-1, *[1] * (values.ndim - 1))
    found = irfft(rfft(values, size, axis=0) * transform, size, axis=0, overwrite_x=True)
    return np.asarray(found[: len(values)], np.float64)


# enough for the runs of a campaign; SciPy's own convolutions transform the taps in every call
@lru_cache(maxsize=32)
def _transform(taps: bytes, size: int) -> np.ndarray:
    return np.asarray(rfft(np.frombuffer(taps), size))


@lru_cache(maxsize=32)  # runs of a campaign
def _start(whitening: bytes) -> Array:
    """Predictors of the first values from all before them, over their standard deviation, shape (order, order).

    The predictors of lower order follow from the filter by the Levinson recursion taken backwards (S. M. Kay,
    Modern Spectral Estimation, 1988, sect. 6.3).
    """
    predictor = np.frombuffer(whitening)
    order = predictor.size - 1
    rows = np.zeros((order, order))
    variance = 1.0  # variance of the prediction error, over the whole filter's
    for m in range(order, 0, -1):
        reflection = predictor[-1]
        left = 1.0 - reflection**2
        predictor = (predictor - reflection * predictor[::-1])[:-1] / left
        variance /= left
        rows[m - 1, :m] = predictor[::-1] / np.sqrt(variance)
    return rows
