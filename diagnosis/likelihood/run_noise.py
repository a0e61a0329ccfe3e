"""The noise of a run's block means, one type for each kind: how it is made white, and how strong it is.

All kinds are noise of evenly spaced samples. Blocks with fewer samples than others are the run's own concern.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.whitening import colour, colouring, correlate, response, whiten
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class RunNoise(ABC):
    """A kind of noise; one that changes along the run overrides `transposed`, `powers_onward` and `part` as well.

    Args:
        variance: of the white noise that `white` makes of it, rad².
    """

    variance: float

    @property
    def scale(self) -> float:
        """Standard deviation of the white noise that `white` makes of it, rad."""
        return float(np.sqrt(self.variance))

    @property
    def plain(self) -> bool:
        """Whether it is white and equally strong throughout, so that `white` changes nothing."""
        return False

    @abstractmethod
    def white(self, values: Array) -> Array:
        """Block means with white noise, of the values' shape and unit.

        Args:
            values: of the run, or several in columns, shape (n,) or (n, k), any unit.
        """

    @abstractmethod
    def coloured(self, values: Array) -> Array:
        """The inverse of `white`, for values of shape (n,)."""

    @abstractmethod
    def response(self, cycles: Array) -> np.ndarray:
        """The complex factor by which `white` changes a sinusoid, of the frequency's shape.

        Args:
            cycles: its frequency in cycles per block, any shape.
        """

    @property
    def over_white(self) -> float:
        """Its standard deviation over `scale`, 1 or more."""
        return 1.0

    def taps(self, count: int) -> Array:
        """Response of `white` to one value well inside a run of ``count`` blocks, dimensionless, shape (m,)."""
        middle = count // 2
        return self.white(np.eye(1, count, middle)[0])[middle:]

    def transposed(self, values: Array) -> Array:
        """The transpose of `white` well inside the run, for values of shape (n,) or (n, k)."""
        return correlate(values, self.taps(len(values)))

    def powers_onward(self, values: Array) -> Array:
        """Sum of squares of what `white` makes of the values from each one to the last alone, shape (n,)."""
        taps = self.taps(values.size)
        lags = np.correlate(taps, taps, "full")[taps.size - 1 :]
        added = values * (2.0 * correlate(values, lags) - lags[0] * values)
        return np.cumsum(added[::-1])[::-1]

    def part(self, first: int, last: int) -> RunNoise:
        """The noise of the blocks from one up to, and without, another."""
        del first, last
        return self


class WhiteNoise(RunNoise):
    """White noise of one variance."""

    @property
    def plain(self) -> bool:
        """It is."""
        return True

    def white(self, values: Array) -> Array:
        """The values themselves."""
        return values

    def coloured(self, values: Array) -> Array:
        """The values themselves."""
        return values

    def response(self, cycles: Array) -> np.ndarray:
        """1 throughout."""
        return np.ones(np.shape(cycles), np.complex128)

    def taps(self, count: int) -> Array:
        """One value, 1."""
        del count
        return np.ones(1)


@dataclass(frozen=True, eq=False)
class AutoregressiveNoise(RunNoise):
    """Coloured noise; its variance is that of its innovations.

    Args:
        whitening: filter that makes it white, its first tap 1, shape (order + 1,), of order 1 or more.
    """

    whitening: Array

    def white(self, values: Array) -> Array:
        """The errors of the prediction of each value from those before it."""
        return whiten(values, self.whitening)

    def coloured(self, values: Array) -> Array:
        """The values of which the errors are given."""
        return colour(values, self.whitening)

    def response(self, cycles: Array) -> np.ndarray:
        """That of the whitening filter."""
        return response(self.whitening, cycles)

    def taps(self, count: int) -> Array:
        """The whitening filter."""
        del count
        return self.whitening

    @property
    def over_white(self) -> float:
        """From the whitening filter."""
        return colouring(self.whitening)


@dataclass(frozen=True, eq=False)
class NoiseWithMoment(RunNoise):
    """Noise beside the response to a random moment, which begins at rest with the run.

    Args:
        sensor: the noise beside the response, whose own variance does not matter.
        numerator: of the filter that makes both white after the sensor's noise alone is white, shape (m,).
        denominator: of that filter, shape (k,).
    """

    sensor: RunNoise
    numerator: Array
    denominator: Array

    def white(self, values: Array) -> Array:
        """The sensor's noise is made white, then the response."""
        with np.errstate(invalid="ignore"):  # a motion that grew without bound; the caller looks for it
            return _filtered(self.numerator, self.denominator, self.sensor.white(values))

    def coloured(self, values: Array) -> Array:
        """The response is restored, then the sensor's noise."""
        return self.sensor.coloured(_filtered(self.denominator, self.numerator, values))

    def response(self, cycles: Array) -> np.ndarray:
        """Those of both filters, multiplied."""
        own = self.sensor.response(cycles) * response(self.numerator, cycles)
        return np.asarray(own / response(self.denominator, cycles))

    def taps(self, count: int) -> Array:
        """Those of both filters, one after the other, shape (count,)."""
        sensor, impulse = self.sensor.taps(count)[:count], np.zeros(count)
        impulse[: sensor.size] = sensor
        return _filtered(self.numerator, self.denominator, impulse)

    @property
    def over_white(self) -> float:
        """That of the sensor's noise alone."""
        return self.sensor.over_white


def _filtered(numerator: Array, denominator: Array, values: Array) -> Array:
    """Values, in columns or in one, after a filter."""
    from scipy.signal import lfilter  # only here: slow to load

    return np.asarray(lfilter(numerator, denominator, values, axis=0), np.float64)
