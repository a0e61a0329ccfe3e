"""Coloured noise of the sensor: its spectrum between the harmonics of the motion, as an autoregression.

The misfit of a model is concentrated at the frequency of the motion and its harmonics. Between them the
spectrum of a residual is therefore the noise's, whatever the model, and noise with a smooth spectrum has
similar power at the harmonics. An autoregression fitted to that spectrum gives the power of the noise at any
frequency, and it whitens the residual, so that one test of the model serves white and coloured noise. `tunnel
diagnose` takes its spectra from the same ordinates and whitens by the same recursion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from math import log, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.special import chdtri

from tunnel_sim.vocabulary.quantities import Angles, Seconds, Vector
from tunnel_sim.vocabulary.record import Array

HANN = 1.94
"""Number of neighbouring ordinates under a Hann window that carry the information of one independent ordinate."""
CYCLES = 8.0
"""Minimum number of cycles in a periodogram: the windowed line of the motion stays within the excluded share."""
LOWEST = 2.5
"""Frequency, in cycles per record, at which the window's lobe about zero frequency ends."""
_BESIDE = 0.25  # share of the motion's frequency that is excluded on either side of its harmonics
_IN_CYCLE = 32.0  # minimum number of values in a cycle of the motion, if the record has as many samples
_FASTEST = 0.375  # share of the sample rate above which no ordinates lie between the motion and half the rate
_HIGHEST_ORDER = 40
_VALUES_PER_TAP = 10.0


@dataclass(frozen=True, eq=False)
class Periodogram:
    """Periodogram of the residual of a record, with a Hann window.

    Args:
        frequency: ordinates, in cycles per unit of the interval, shape (n,).
        power: in units of white noise of the stated variance, shape (n,).
        between: which ordinates lie between the harmonics of the motion, shape (n,).
    """

    frequency: Array
    power: Array
    between: NDArray[np.bool_]

    @classmethod
    def of(cls, values: Angles, interval: Seconds, own: float, variance: float = 1.0) -> Periodogram:
        """The periodogram of evenly spaced values.

        Args:
            values: the residual, shape (n,).
            interval: interval between the values.
            own: frequency of the motion, in cycles per unit of the interval.
            variance: variance of white noise of power 1, in the squared unit of the values.
        """
        window = np.hanning(values.size)
        scale = variance * float(window @ window)
        power = np.abs(np.fft.rfft((values - values.mean()) * window)) ** 2 / scale
        frequency = np.fft.rfftfreq(values.size, interval)
        order = frequency / own
        multiple = np.round(order)
        between = np.where(multiple > 0, np.abs(order - multiple) >= _BESIDE, True)
        between &= frequency * values.size * interval > LOWEST
        between[-1] = False  # the ordinate at half the sampling rate has one degree of freedom
        return cls(np.asarray(frequency), np.asarray(power), np.asarray(between))

    def by_band(self, edges: Array) -> tuple[Array, Array]:
        """Mean power and number of independent ordinates between the harmonics by band, shape (bands,) each.

        Args:
            edges: edges of the bands, ascending, shape (bands + 1,).
        """
        band = np.searchsorted(edges, self.frequency[self.between], side="right") - 1
        inside = (band >= 0) & (band < edges.size - 1)
        count = np.bincount(band[inside], minlength=edges.size - 1)
        power = np.bincount(band[inside], self.power[self.between][inside], edges.size - 1)
        return power / np.maximum(count, 1), count / HANN

    def bridged(self, own: float) -> Array:
        """The power, with the ordinates at the harmonics interpolated from their neighbours, shape (n,).

        Args:
            own: frequency of the motion, in the unit of the frequency.
        """
        gap = (self.frequency[self.between] / own).astype(np.intp)  # [m + ¼, m + ¾] of the motion's frequency
        count = np.bincount(gap)
        kept = np.flatnonzero(count)
        level = np.bincount(gap, self.power[self.between])[kept] / count[kept]
        centre = np.bincount(gap, self.frequency[self.between])[kept] / count[kept]
        logarithm = np.log(np.maximum(level, 1e-300))
        filled = np.exp(np.interp(self.frequency, centre, logarithm))
        return np.where(self.between, self.power, filled)


def levinson(covariance: Vector) -> Iterator[tuple[Array, float]]:
    """Whitening filters of rising order and the variances of their innovations, from an autocovariance.

    S. M. Kay, Modern Spectral Estimation (1988), sect. 6.3. The first filter is for white noise.

    Args:
        covariance: autocovariance at lags from zero on, shape (n,).

    Yields:
        The filter, its first tap 1, shape (order + 1,), and the variance, for orders below n.
    """
    whitening, variance = np.ones(1), float(covariance[0])
    yield whitening, variance
    for order in range(1, covariance.size):
        reflection = -float(whitening @ covariance[order:0:-1]) / variance
        grown = np.append(whitening, 0.0)
        whitening = grown + reflection * grown[::-1]
        variance *= 1.0 - reflection**2
        yield whitening, variance


def steady(power: Array, count: Array, rate: float) -> NDArray[np.bool_]:
    """The bands with one level in all parts, by a likelihood ratio of gamma variables; shape (bands,).

    A steady band fails at the false-alarm rate ``rate``. Bartlett's correction makes the statistic nearly χ²
    for few ordinates (Proc. R. Soc. A 160 (1937) 268, doi 10.1098/rspa.1937.0109).

    Args:
        power: mean power by part and band, shape (parts, bands).
        count: number of independent ordinates, shape (parts, bands).
    """
    total = count.sum(axis=0)
    mean = np.sum(power * count, axis=0) / np.maximum(total, 1e-300)
    ratio = np.maximum(power / np.where(mean > 0.0, mean, 1.0), 1e-300)  # any number where the count is 0
    corrected = count / (1.0 + 1.0 / (6.0 * np.maximum(count, 1e-300)))
    statistic = 2.0 * np.sum(corrected * (ratio - 1.0 - np.log(ratio)), axis=0)
    freedom = np.sum(count > 0, axis=0) - 1
    limit = chdtri(np.maximum(freedom, 1), rate)
    return np.asarray((freedom > 0) & (mean > 0.0) & (statistic < limit))


@dataclass(frozen=True, eq=False)
class Autoregression:
    """Coloured noise of a run as filtered white noise. Frequencies are multiples of the motion's.

    Args:
        whitening: filter from values to innovations, its first tap 1, shape (order + 1,).
        innovations: variance of the innovations, rad².
        covariance: autocovariance of the values, at lags from 0 to the order, shape (order + 1,), rad².
        count: number of values behind the estimate.
        block: number of samples whose mean, times the root of this number, is a value.
        cycle: number of values in a cycle of the motion.
    """

    whitening: Array
    innovations: float
    covariance: Array
    count: float
    block: int
    cycle: float

    @classmethod
    def of(cls, residual: Angles, cycle: float) -> Autoregression | None:
        """The noise in the residual of a run.

        The order has the least −2 ln L + 2p (H. Akaike, IEEE Trans. Automat. Contr. 19 (1974) 716, doi
        10.1109/TAC.1974.1100705). If a cycle has many samples, means of blocks keep the order low.

        Args:
            residual: evenly spaced residual, shape (n,), rad.
            cycle: number of samples in a cycle of the motion.

        Returns:
            The noise; None if the record is too short to distinguish it from the misfit of a model.
        """
        block = max(1, int(cycle / _IN_CYCLE))
        values, own = slow_part(residual, block), block / cycle
        if values.size * own < CYCLES or own > _FASTEST or not values.any():
            return None
        seen = Periodogram.of(values, 1.0, own)
        covariance = np.fft.irfft(seen.bridged(own), values.size)[: _HIGHEST_ORDER + 1]
        count = float(np.count_nonzero(seen.between)) * values.size / seen.frequency.size
        best, least = None, np.inf
        for whitening, variance in levinson(covariance[: max(2, int(count / _VALUES_PER_TAP))]):
            order = whitening.size - 1
            loss = count * log(max(variance, 1e-300)) + 2.0 * order
            if loss < least:
                least = loss
                best = cls(whitening, variance, covariance[: order + 1], count, block, 1.0 / own)
        return best

    def power(self, frequency: Array | float) -> Array:
        """Power of the noise, rad², any shape: white noise has the variance of one sample at all frequencies."""
        turns = self._turns(frequency)
        averaged = np.sinc(np.asarray(frequency) / self.cycle)  # the response of the means of blocks
        return np.asarray(self.innovations / np.abs(turns @ self.whitening * averaged) ** 2)

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the power at the frequency of the motion, by the delta method.

        The covariance of the taps is from H. B. Mann and A. Wald, Econometrica 11 (1943) 173, doi
        10.2307/1905674.
        """
        turns = self._turns(1.0)
        slope = -2.0 * np.real(turns[1:] / (turns @ self.whitening))
        spread = slope @ np.linalg.solve(toeplitz(self.covariance[:-1]), slope) if slope.size else 0.0
        return float(2.0 * self.count / (2.0 + self.innovations * spread))

    def near_motion(self, residual: Angles) -> tuple[float, float]:
        """Power of a residual within a quarter of the motion's frequency, over the noise's.

        Returns:
            The sum of independent squares, which have a mean of 1 in noise alone, and their number.
        """
        seen = Periodogram.of(slow_part(residual, self.block), 1.0, 1.0 / self.cycle)
        order = seen.frequency * self.cycle
        near = np.abs(order - 1.0) < _BESIDE
        expected = self.power(order[near]) * np.sinc(order[near] / self.cycle) ** 2
        squares = 2.0 / HANN
        return squares * float(np.sum(seen.power[near] / expected)), squares * float(np.count_nonzero(near))

    def whitened(self, residual: Angles) -> Array:
        """The innovations in a residual over their standard deviations, dimensionless.

        Earlier values are too few for the first ones; filters of lower order predict them.
        """
        values, order = slow_part(residual, self.block), self.whitening.size - 1
        later = np.convolve(values, self.whitening, mode="valid") / sqrt(self.innovations)
        lower = islice(levinson(self.covariance), min(order, values.size))
        first = [float(taps @ values[taps.size - 1 :: -1]) / sqrt(variance) for taps, variance in lower]
        return np.concatenate((first, later))

    def cost(self, residual: Angles) -> float:
        """−2 ln L + 2p of a residual, up to a constant, dimensionless."""
        values, order = self.whitened(residual), self.whitening.size - 1
        variances = [variance for _, variance in islice(levinson(self.covariance), order)]
        logarithms = float(np.sum(np.log(variances))) + (values.size - order) * log(self.innovations)
        return logarithms + float(np.sum(values**2)) + 2.0 * order

    def _turns(self, frequency: Array | float) -> NDArray[np.complex128]:
        lag = np.arange(self.whitening.size) / self.cycle
        return np.exp(-2j * np.pi * np.multiply.outer(frequency, lag))


def slow_part(values: Angles, block: int) -> Array:
    """Means over blocks, times the root of their size; for white noise they have the variance of one value.

    Args:
        block: number of values in a block.
    """
    blocks = values.size // block
    return np.asarray(values[: blocks * block].reshape(blocks, block).mean(axis=1) * sqrt(block))
