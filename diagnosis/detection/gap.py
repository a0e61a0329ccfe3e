"""Is there a gap? Tests of the nominal model's residuals by frequency band, and of the noise itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from diagnosis.detection.noise_colour import noise_colour, whitened
from diagnosis.detection.noise_under_null import level_p_value, trend_p_values
from diagnosis.detection.rounding import rounding_errors, with_rounding
from diagnosis.detection.sensor_noise import Noise, NoiseTrend
from diagnosis.detection.wandering_zero import zero_wanders
from diagnosis.fitting.least_squares import Fit, FitError
from diagnosis.fitting.least_squares import fit as refit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.spectra import resonance
from diagnosis.fitting.starting_points import is_gross, nominal_start
from diagnosis.policy import BEYOND_THE_MOTION, FLOOR_TOLERANCE, GAP_FALSE_ALARM_RATE, NOISE_FALSE_ALARM_SHARE
from tunnel_sim.vocabulary.record import Array

Spread = Callable[[Array], float]
BANDS = ("below", "f0", "2f0", "3f0", "above")


@dataclass(frozen=True)
class GapTest:
    """The tests of a gap.

    Args:
        detected: whether any of them rejects the absence of a gap.
        p_value: the smallest p-value, times the number of tests (at most 1).
        tests: p-value by name: the bands, and the noise's trend with the motion, its scatter and its level.
        noisy: whether the noise itself misbehaves: its level follows the motion, it comes in bursts, or it is
            above the stated level.
    """

    detected: bool
    p_value: float
    tests: Mapping[str, float]
    noisy: bool


def test_gap(
    fit: Fit,
    noise: Noise,
    trend: NoiseTrend,
    *,
    coarse_step: bool,
    errors: Sequence[Array] | None,
) -> GapTest:
    """Test whether a fit's residuals and the noise are consistent with white noise.

    Args:
        fit: usually of the nominal model.
        trend: of the noise with the motion.
        coarse_step: whether the reading's step is known to be coarser than stated; the level and trend of the
            noise are then not tested.
        errors: what noise and rounding leave in the block means, by run, repetitions of it, shape (repetitions,
            blocks), rad; None where they are white.

    Returns:
        The verdict at `GAP_FALSE_ALARM_RATE`, shared equally among the tests (Bonferroni).
    """
    level, scatter = (np.ones(6), np.zeros(6)) if errors is None else _under_rounding(fit, errors)
    floor = (1.0 + FLOOR_TOLERANCE) * noise.margin * level
    tests = dict(zip(BANDS, band_p_values(fit, floor[:-1], noise.spread, scatter[:-1]), strict=True))
    tests["offset"] = offset_p_value(fit, floor[-1], noise.spread, scatter[-1])
    noisy: dict[str, float] = {}
    if not coarse_step and noise.source != "floor":
        noisy |= trend_p_values(trend, fit, noise)
        if noise.stated_variance is not None:
            noisy["noise level"] = level_p_value(fit, noise)
    everything = tests | noisy
    limit = GAP_FALSE_ALARM_RATE / len(everything)
    smallest = min(everything.values())
    return GapTest(
        smallest < limit,
        min(1.0, smallest * len(everything)),
        everything,
        any(p < _misbehaves(everything) for p in noisy.values()),
    )


def _misbehaves(tests: Mapping[str, float]) -> float:
    """The p-value of one of these tests below which the noise itself misbehaves."""
    return GAP_FALSE_ALARM_RATE * NOISE_FALSE_ALARM_SHARE / len(tests)


def judge(
    nominal: Fit, noise: Noise, trend: NoiseTrend, *, step: float, coarse_step: bool
) -> tuple[Fit, Noise, GapTest]:
    """Test for a gap, and decide between a gap and coloured noise.

    Args:
        nominal: fit of the nominal model to runs prepared for white noise.
        trend: of the noise with the motion.
        step: of the lattice of the readings, rad; 0 where there is none.
        coarse_step: as `test_gap` takes it.

    Returns:
        The fit, the noise and the verdict. The noise of the fit allows for rounding, whose error is not white where
        the motion is slow and the noise small, and fit and noise are whitened where the noise is coloured. Where
        whitening does not close the gap, colour is believed only if runs with the wind off have it, and if it shows
        above the motion's harmonics: turbulence needs the wind, and a gap raises the spectrum beside the motion.
        Nor is it believed where there would be more noise than is stated, or where it alone would close the gap of
        a wandering zero. Turbulence may hide the colour, which is then sought in the runs with the wind off alone.
    """
    errors = rounding_errors(nominal, noise.white(step), step)
    allowed = None if errors is None else with_rounding(nominal.problem.data, errors)
    if allowed is not None:
        nominal = refit(Problem(allowed), nominal.point)
    plain = test_gap(nominal, noise, trend, coarse_step=coarse_step, errors=errors)
    for source in () if is_gross(nominal) else _colour_sources(nominal):
        found = noise_colour(source, throughout=source is not nominal)
        if found is None:
            continue
        white = refit(Problem(whitened(nominal.problem.data, found)), nominal.point)
        coloured = noise.coloured(found, nominal.problem.data)
        test = test_gap(white, coloured, trend, coarse_step=coarse_step, errors=errors)
        still = any(not run.wind_on for run in nominal.problem.data.runs)
        excessive = test.tests.get("noise level", 1.0) < _misbehaves(test.tests)
        believed = still and not excessive and noise_colour(source, beyond=BEYOND_THE_MOTION) is not None
        if believed if test.detected else not zero_wanders(nominal, found):
            return white, coloured, test
    return nominal, noise, plain


def _colour_sources(nominal: Fit) -> Iterator[Fit]:
    """The fits that may show the noise's colour: the nominal one, and that of the runs with the wind off alone."""
    yield nominal
    data = nominal.problem.data
    still = tuple(run for run in data.runs if not run.wind_on)
    if 0 < len(still) < len(data.runs):
        only = data.with_runs(still)
        with suppress(FitError, np.linalg.LinAlgError):
            yield refit(Problem(only), nominal_start(only))


def chance(total: float, freedom: float, relative: float) -> float:
    """Probability that white noise reaches a sum of squares.

    Args:
        total: sum of squares, in units of the noise variance.
        freedom: degrees of freedom, a number of coefficients.
        relative: standard deviation of the noise variance, as a share of it.

    Returns:
        The upper tail of a χ² variable, widened for the uncertainty of the noise level.
    """
    if freedom <= 0.0:
        return 1.0
    stretch = 1.0 + 0.5 * freedom * relative**2
    return float(chdtrc(freedom / stretch, total / stretch))


def _known(_frequency: Array) -> float:
    return 0.0


def offset_p_value(fit: Fit, floor: float = 1.0, spread: Spread = _known, scatter: float = 0.0) -> float:
    """Probability that white noise alone moves the runs' means as far from the common zero.

    Args:
        fit: its residuals, in noise standard deviations.
        floor: power assumed for white noise, a factor on the noise variance.
        spread: gives the standard deviation of the noise's mean power over some frequencies (Hz), a share of it.
        scatter: standard deviation of the floor, a share of it.

    Returns:
        The p-value; the zero takes one degree of freedom. 1 where the runs have zeros of their own.
    """
    if fit.problem.data.own_zeros:
        return 1.0
    lowest = np.array([1.0 / max(run.duration for run in fit.problem.data.runs)])
    relative = float(np.hypot(spread(lowest), scatter))
    return chance(_offsets(fit.residuals) / floor, len(fit.residuals) - 1.0, relative)


def _offsets(residuals: Sequence[Array]) -> float:
    """Sum of the squared means of the runs' residuals, in their variances under white noise."""
    return sum(float(np.sum(residual)) ** 2 / residual.size for residual in residuals)


def band_p_values(
    fit: Fit, floor: float | Array = 1.0, spread: Spread = _known, scatter: float | Array = 0.0
) -> tuple[float, ...]:
    """Probability that white noise alone gives as much power in each band, summed over the runs.

    Args:
        fit: its residuals, in noise standard deviations.
        floor: power assumed for white noise, a factor on the noise variance; one for all bands, or shape (bands,).
        spread: gives the standard deviation of the noise's mean power over some frequencies (Hz), a share of it.
        scatter: standard deviation of the floor, a share of it, of its shape.

    Returns:
        One p-value per band of `BANDS`; the bands are multiples of each run's own frequency.
    """
    values = []
    each = np.broadcast_to(floor, len(BANDS)), np.broadcast_to(scatter, len(BANDS))
    for (power, place), level, share in zip(_by_band(fit, fit.residuals), *each, strict=True):
        relative = float(np.hypot(spread(place), share)) if place.size else 0.0
        # each ordinate is half a χ² of two degrees of freedom
        values.append(chance(2.0 * float(power.sum()) / level, 2.0 * place.size, relative))
    return tuple(values)


def _by_band(fit: Fit, residuals: Sequence[Array]) -> list[tuple[Array, Array]]:
    """Power and frequency (Hz) of the periodograms' ordinates, all runs together, by band."""
    bands, powers, frequencies = [], [], []
    for index, (run, residual) in enumerate(zip(fit.problem.data.runs, residuals, strict=True)):
        spectrum = np.abs(np.fft.rfft(residual)) ** 2 / residual.size
        frequency = np.fft.rfftfreq(residual.size, run.interval)
        multiple = frequency[1:-1] / max(resonance(fit, index), 1e-9)
        band = np.clip(np.floor(multiple + 0.5), 0, len(BANDS) - 1).astype(int)
        bands.append(band)
        powers.append(spectrum[1:-1])
        frequencies.append(frequency[1:-1])
    where, power, place = (np.concatenate(column) for column in (bands, powers, frequencies))
    # each ordinate is half a χ² of two degrees of freedom
    return [(power[where == index], place[where == index]) for index in range(len(BANDS))]


def _under_rounding(fit: Fit, errors: Sequence[Array]) -> tuple[Array, Array]:
    """Level of the tests' statistics under noise and rounding, and its scatter beyond that of white noise.

    Both are shares of what white noise of the fit's variance gives, shape (tests,): the bands, then the offset.
    """
    found, count = [], np.ones(len(BANDS) + 1)
    for number in range(len(errors[0])):
        residuals = [run.scaled(e[number]) for run, e in zip(fit.problem.data.runs, errors, strict=True)]
        bands = _by_band(fit, residuals)
        count = np.array([*(max(place.size, 1) for _, place in bands), 0.5 * len(residuals)])
        found.append([*(float(power.sum()) for power, _ in bands), 0.5 * _offsets(residuals)] / count)
    level = np.mean(found, axis=0)
    beyond = np.var(found, axis=0, ddof=1) / np.maximum(level, 1e-100) ** 2 - 1.0 / count
    return np.maximum(level, 1.0), np.sqrt(np.maximum(beyond, 0.0))
