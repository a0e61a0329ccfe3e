"""The colour of the sensor's noise, from its spectrum between the harmonics of the motion; and a wandering zero.

Coloured noise differs from a gap in three properties: it is as strong with the wind off as on, as strong at the
start of a record as at its end, and smooth across the motion's frequency and its harmonics. Its spectrum is
therefore taken between the harmonics, in parts of all records, where these parts agree. A gap changes with the
wind or the amplitude, and lies at the harmonics, across which the spectrum is interpolated.

Coloured noise and a wandering zero both raise the spectrum towards low frequencies. The spectrum of noise is level
below some corner; a random walk's is not, because its zero departs ever further.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.special import chdtri, fdtrc

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import resonance
from diagnosis.model.data import Data
from diagnosis.model.run_noise import AutoregressiveNoise, WhiteNoise
from identification.signal.colour import CYCLES, HANN, LOWEST, Periodogram, levinson, steady
from tunnel_sim.vocabulary.record import Array

COLOUR_FLAT: Final = 0.03
"""Maximum deviation of a band from a flat spectrum that does not count as colour. Judgement. Quantisation
causes a deviation of this size."""
COLOUR_PARTS: Final = 4
"""Minimum number of parts of the records for the test for colour. Judgement. Fewer parts may agree by
chance."""
COLOUR_AMPLITUDES: Final = 2.0
"""Minimum ratio of the largest to the smallest motion among these parts, to show that the noise does not
follow the motion. Judgement. The power of noise that follows the motion then differs by a factor of four."""
COLOUR_BANDS: Final = 0.75
"""Minimum share of stationary bands where only the wind-off runs show the colour. Judgement. Few parts are
compared in that case, so non-stationary bands are easily missed."""
FADES_RATE: Final = 0.01
"""Rate at which chance alone makes noise that resonates seem to fade with the motion. Convention."""
COLOUR_SLOPE_STDS: Final = 2.0
"""Margin by which the slope assumed below the lowest band exceeds the estimated slope, in standard
deviations. Convention."""

_PARTS = 8  # parts of records to compare, where they are long enough
_OCTAVE_PARTS = 2  # bands in an octave
_SLOPE_BANDS = 4  # lowest bands that give the slope below them
_LONGEST = 512  # taps of the whitening filter


@dataclass(frozen=True, eq=False)
class Colour:
    """A spectrum of the noise of block means.

    Args:
        frequency: centres of bands, Hz, ascending, shape (n,).
        level: natural logarithm of the power over the power of the white noise assumed before, shape (n,).
        std: of the levels, shape (n,).
        slope: of the level against the logarithm of frequency in the lowest bands, between 0 and −2, the slope
            of a random walk; dimensionless.
        slope_std: its standard deviation, dimensionless.
        steep: slope assumed below the first band: ``slope``, made steeper by the uncertainty; dimensionless.
    """

    frequency: Array
    level: Array
    std: Array
    slope: float
    slope_std: float
    steep: float

    def at(self, frequency: Array) -> Array:
        """The level at frequencies above zero, Hz, any shape; below the first band as high as chance allows."""
        return self._extended(frequency, self.steep)

    def _extended(self, frequency: Array, slope: float) -> Array:
        place, places = np.log(frequency), np.log(self.frequency)
        below = np.minimum(place - places[0], 0.0)
        return np.asarray(np.interp(place, places, self.level) + slope * below)

    def mean(self, count: int, interval: float) -> float:
        """The mean power over the frequencies of a record of a number of values.

        Args:
            interval: between them, s.
        """
        frequency = np.asarray(np.fft.rfftfreq(count, interval)[1:], np.float64)
        return float(np.mean(np.exp(self._extended(frequency, self.slope))))

    def spread(self, frequency: Array) -> float:
        """Standard deviation of the mean power over frequencies above zero, Hz, shape (n,), a share of it."""
        place, places = np.log(frequency), np.log(self.frequency)
        nearest = np.argmin(np.abs(place[:, None] - places), axis=1)
        share = np.bincount(nearest, minlength=places.size) / place.size
        below = float(np.mean(np.minimum(place - places[0], 0.0)))
        return float(np.sqrt(np.sum((share * self.std) ** 2) + (below * self.slope_std) ** 2))


def noise_colour(nominal: Fit, beyond: float = 0.0, *, throughout: bool = False) -> Colour | None:
    """The colour of the noise in the residuals of a fit.

    Args:
        nominal: any fit whose residuals were scaled as white.
        beyond: multiple of the motion's frequency from which the spectrum is used.
        throughout: whether the lowest band and most of all must be steady; otherwise any two must.

    Returns:
        The spectrum; None where it is flat within a tolerance and chance, no bands agree in all parts of the
        records, or these are too few.
    """
    parts, sizes, chosen = [], [], nominal.settings.noise
    wanted = max(2, -(-_PARTS // len(nominal.residuals)))
    for index, (run, residual) in enumerate(zip(nominal.problem.data.runs, nominal.residuals, strict=True)):
        own, values = resonance(nominal, index), run.unscaled(residual)
        pieces = min(wanted, int(run.reading.size * run.interval * own / CYCLES))
        length = values.size // max(pieces, 1)
        for piece in (slice(i * length, (i + 1) * length) for i in range(pieces)):
            parts.append(Periodogram.of(values[piece], run.interval, own, run.noise.variance))
            sizes.append(float(np.std(run.reading[piece] - values[piece])))
    if len(sizes) < COLOUR_PARTS or max(sizes) < COLOUR_AMPLITUDES * min(sizes):
        return None
    lowest = max(
        LOWEST * max(part.frequency[1] for part in parts),
        beyond * max(resonance(nominal, i) for i in range(len(nominal.residuals))),
    )
    highest = 0.5 / max(run.interval for run in nominal.problem.data.runs)
    if highest < 2.0 * lowest:
        return None
    # of equal ratio, an octave or more apart
    edges = np.geomspace(lowest, highest, round(_OCTAVE_PARTS * np.log2(highest / lowest)) + 1)
    cells = [part.by_band(edges) for part in parts]
    power, count = (np.array(column) for column in zip(*cells, strict=True))
    kept = steady(power, count, chosen.colour_band_rate)
    if kept.sum() < 2 or (throughout and not (kept[0] and kept.mean() >= COLOUR_BANDS)):
        return None
    total = count.sum(axis=0)
    level = np.log(np.sum(power * count, axis=0)[kept] / total[kept])
    std = np.sqrt(1.0 / total[kept])
    weight = 1.0 / (std**2 + COLOUR_FLAT**2)
    departure = float(weight @ (level - float(weight @ level / weight.sum())) ** 2)
    if departure < float(chdtri(level.size - 1, chosen.colour_rate)):  # one constant within chance
        return None
    centres = np.sqrt(edges[1:] * edges[:-1])[kept]
    lowest_bands = slice(0, _SLOPE_BANDS)
    place, weight = np.log(centres)[lowest_bands], 1.0 / std[lowest_bands] ** 2
    centred = place - float(weight @ place / weight.sum())
    information = float(weight @ centred**2)
    slope = float((weight * centred) @ level[lowest_bands]) / information
    slope_std = float(np.sqrt(1.0 / information))
    # where a gap hides the lowest bands, a steeper slope would take the gap for noise
    steep = slope - COLOUR_SLOPE_STDS * slope_std if kept[0] else slope
    return Colour(centres, level, std, _red(slope), slope_std, _red(steep))


def _red(slope: float) -> float:
    """A slope between white noise and a random walk."""
    return float(np.clip(slope, -2.0, 0.0))


def whitened(data: Data, colour: Colour) -> Data:
    """The data, prepared for white noise, with a filter that whitens noise of a colour.

    The recursion stops at the order beyond which all records together have less than one nat of evidence for
    another; the gain of all further orders follows from the spectrum (Kolmogorov). The runs have the variance of
    the innovations.
    """
    longest = max(run.reading.size for run in data.runs)
    total = sum(run.reading.size for run in data.runs)
    size = 2 ** int(np.ceil(np.log2(8 * longest)))
    filters: dict[float, tuple[Array, float]] = {}
    for interval in {run.interval for run in data.runs}:
        frequency = np.maximum(np.arange(size // 2 + 1) / size, 0.25 / longest) / interval
        spectrum = colour.at(frequency)
        covariance = np.fft.irfft(np.exp(spectrum), size)
        least = np.exp(np.mean(np.concatenate([spectrum, spectrum[-2:0:-1]])))
        for filters[interval] in levinson(covariance[: _LONGEST + 1]):
            if 0.5 * total * np.log(filters[interval][1] / least) <= 1.0:
                break
    runs = []
    for run in data.runs:
        whitening, variance = filters[run.interval]
        variance *= run.noise.variance
        coloured = whitening.size > 1
        noise = AutoregressiveNoise(variance, whitening) if coloured else WhiteNoise(variance)
        runs.append(replace(run, noise=noise))
    return data.with_runs(tuple(runs))


_LOWEST_CORNER = 1e-3  # of the colour's lowest frequency: effectively none
_THIRDS = 3  # parts of a run that are compared for noise that fades
_ABOUT = 3.0  # factor about the motion's frequency, up and down, within which it may fade
_WHITE = 30.0  # the level's natural logarithm stays within this distance of white noise


def zero_wanders(nominal: Fit, white: Fit, colour: Colour) -> bool:
    """Whether the noise's spectrum rises to the lowest frequencies of the runs without a corner.

    The decision is a likelihood ratio. The spectrum adds white noise and a first-order process, which is a
    random walk where its corner is zero; the colour's lowest band is the lowest visible corner of stationary noise.
    Noise that resonates is stationary too, although its flank is steep, unless it fades with the motion. The
    spectrum is fitted to the ordinates between the harmonics by Whittle's likelihood (P. Whittle, Ark. Mat. 2
    (1953) 423, doi 10.1007/BF02590998).

    Args:
        nominal: fit in white noise.
        white: fit in noise of the colour.
        colour: colour of the noise.
    """
    spectra = []
    for index, (run, residual) in enumerate(zip(nominal.problem.data.runs, nominal.residuals, strict=True)):
        values, own = run.unscaled(residual), resonance(nominal, index)
        whole = Periodogram.of(values, run.interval, own, run.noise.variance)
        spectra.append((whole.frequency[whole.between], whole.power[whole.between]))
    frequency, power = (np.concatenate(column) for column in zip(*spectra, strict=True))
    relative = frequency / colour.frequency[0]
    free = _WANDERING.least_loss(relative, power)
    chance = chdtri(1, 2.0 * nominal.settings.noise.wandering_rate)

    def loses(process: _Process) -> bool:
        return bool(2.0 * (process.least_loss(relative, power) - free) / HANN > chance)

    return loses(_LEVEL) and (loses(_RESONANT) or fades(white))


def fades(white: Fit) -> bool:
    """Whether whitened residuals about the motion are stronger in the first third of the runs than in the last."""
    power, count = np.zeros(_THIRDS), np.zeros(_THIRDS)
    for index, (run, residual) in enumerate(zip(white.problem.data.runs, white.residuals, strict=True)):
        own = resonance(white, index)
        for third, part in enumerate(np.array_split(residual, _THIRDS)):
            window = np.hanning(part.size)
            about = np.abs(np.log(np.fft.rfftfreq(part.size, run.interval)[1:] / own)) < np.log(_ABOUT)
            ordinates = np.abs(np.fft.rfft(part * window)[1:][about]) ** 2 / float(window @ window)
            power[third] += float(np.sum(ordinates))
            count[third] += ordinates.size
    first, *_, last = power / np.maximum(count, 1.0)
    return bool(fdtrc(2.0 * count[0] / HANN, 2.0 * count[-1] / HANN, first / last) < FADES_RATE)


def alike_in_all_runs(fit: Fit) -> bool:
    """Whether residuals slower than the motion repeat from run to run, as an error of the sensor does.

    Noise differs from run to run. Let the share of the mean of n runs in the mean of their powers be γ² at a
    frequency, with times from the release. For independent runs it exceeds x with probability (1 − x)ⁿ⁻¹, whatever
    the noise's colour.

    Returns:
        By that test of all frequencies below half the motion's together. False where fewer than two runs have the
        same raster.
    """
    runs: dict[tuple[float, float], list[int]] = {}
    for index, run in enumerate(fit.problem.data.runs):
        runs.setdefault((run.interval, run.start), []).append(index)
    (interval, _), alike = max(runs.items(), key=lambda item: len(item[1]))
    size = min(fit.residuals[index].size for index in alike)
    below = np.fft.rfftfreq(size, interval)[1:] < 0.5 * min(resonance(fit, index) for index in alike)
    waves = np.fft.rfft([fit.residuals[index][:size] for index in alike])[:, 1:][:, below]
    if len(alike) < 2 or not below.any():
        return False
    shared = np.abs(waves.mean(axis=0)) ** 2 / np.mean(np.abs(waves) ** 2, axis=0)
    chance = (1.0 - np.minimum(shared, 1.0)) ** (len(alike) - 1)
    return bool(chance.min() * chance.size < fit.settings.noise.repeated_rate)


def _first_order(frequency: Array, corner: float) -> tuple[Array, list[Array]]:
    """Power of a first-order process, not normalised, and its slopes by the logarithms of its parameters."""
    response = 1.0 / (frequency**2 + corner**2)
    return response, [-2.0 * (corner * response) ** 2]


def _second_order(frequency: Array, corner: float, damping_ratio: float) -> tuple[Array, list[Array]]:
    """Power of a process that resonates at its corner; as in `_first_order`."""
    damped = (2.0 * damping_ratio * corner * frequency) ** 2
    response = 1.0 / ((frequency**2 - corner**2) ** 2 + damped)
    by_corner = 2.0 * damped - 4.0 * corner**2 * (frequency**2 - corner**2)
    return response, [-by_corner * response**2, -2.0 * damped * response**2]


@dataclass(frozen=True)
class _Process:
    """A process with a spectrum that is level below its corner.

    Args:
        power: power of the process by frequency, with its slopes, as in `_first_order`.
        lowest: lowest corner, over the lowest visible one; a random walk's is far below that.
        starts: corners at which fits start, likewise.
        damping: damping ratios of a resonance, lowest and highest; empty for a process of first order.
    """

    power: Callable[..., tuple[Array, list[Array]]]
    lowest: float
    starts: tuple[float, ...]
    damping: tuple[tuple[float, float], ...] = ()

    def least_loss(self, frequency: Array, power: Array) -> float:
        """Least negative log-likelihood of periodogram ordinates, nats, beside white noise.

        Args:
            frequency: frequencies over the lowest visible corner, shape (n,).
            power: ordinates, shape (n,).
        """

        def loss(place: Array) -> tuple[float, Array]:
            white, slow, *own = np.exp(place)
            response, by_own = self.power(frequency, *own)
            level = white + slow * response
            by_level = (1.0 - power / level) / level
            slopes = white, slow * response, *(slow * slope for slope in by_own)
            total = float(np.sum(np.log(level) + power / level))
            return total, np.array([float(np.sum(by_level * slope)) for slope in slopes])

        order = 2 + 2 * len(self.damping)
        bounds = [(-_WHITE, _WHITE), (-_WHITE, order * _WHITE / 2), (np.log(self.lowest), _WHITE)]
        bounds += [(np.log(low), np.log(high)) for low, high in self.damping]
        starts = [
            np.array(
                [0.0, np.log(power.max() * c**order + 1.0), np.log(c), *(high for _, high in bounds[3:])]
            )
            for c in self.starts
        ]
        return min(float(minimize(loss, start, jac=True, bounds=bounds).fun) for start in starts)


_LEVEL = _Process(_first_order, 1.0, (1.0, 4.0, 16.0))
_RESONANT = _Process(_second_order, 1.0, (2.0, 4.0, 8.0, 16.0), ((0.003, 0.7),))
_WANDERING = _Process(_first_order, _LOWEST_CORNER, (_LOWEST_CORNER, 1.0, 4.0, 16.0))
