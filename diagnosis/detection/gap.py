"""Is there a gap? Tests of the nominal model's residuals by frequency band, and of the noise itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from diagnosis.detection.noise_colour import noise_colour, whitened
from diagnosis.detection.noise_under_null import level_p_value, trend_p_values
from diagnosis.detection.sensor_noise import Noise, NoiseTrend
from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.least_squares import fit as refit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.spectra import resonance
from diagnosis.fitting.starting_points import is_gross
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


def test_gap(fit: Fit, noise: Noise, trend: NoiseTrend, *, coarse_step: bool) -> GapTest:
    """Test whether a fit's residuals and the noise are consistent with white noise.

    Args:
        fit: usually of the nominal model.
        noise: the campaign's.
        trend: of the noise with the motion.
        coarse_step: whether the reading's step is known to be coarser than stated; the level and trend of the
            noise are then not tested.

    Returns:
        The verdict at `GAP_FALSE_ALARM_RATE`, shared equally among the tests (Bonferroni).
    """
    floor = (1.0 + FLOOR_TOLERANCE) * noise.margin
    tests = dict(zip(BANDS, band_p_values(fit, floor, noise.spread), strict=True))
    tests["offset"] = offset_p_value(fit, floor, noise.spread)
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
        any(p < limit * NOISE_FALSE_ALARM_SHARE for p in noisy.values()),
    )


def judge(nominal: Fit, noise: Noise, trend: NoiseTrend, *, coarse_step: bool) -> tuple[Fit, Noise, GapTest]:
    """Test for a gap, and decide between a gap and coloured noise.

    Args:
        nominal: fit of the nominal model to runs prepared for white noise.
        noise: the campaign's.
        trend: of the noise with the motion.
        coarse_step: as `test_gap` takes it.

    Returns:
        The fit, the noise and the verdict; the first two whitened where the noise is coloured. Colour is believed
        where whitening closes the gap, or where it shows above the motion's harmonics too: beside the motion, a gap
        raises the spectrum as well.
    """
    plain = test_gap(nominal, noise, trend, coarse_step=coarse_step)
    found = None if not plain.detected or is_gross(nominal) else noise_colour(nominal)
    if found is None:
        return nominal, noise, plain
    white = refit(Problem(whitened(nominal.problem.data, found)), nominal.point)
    coloured = noise.coloured(found, white.problem.data)
    test = test_gap(white, coloured, trend, coarse_step=coarse_step)
    if test.detected and noise_colour(nominal, beyond=BEYOND_THE_MOTION) is None:
        return nominal, noise, plain
    return white, coloured, test


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
    return float(chi2.sf(total / stretch, freedom / stretch))


def _known(_frequency: Array) -> float:
    return 0.0


def offset_p_value(fit: Fit, floor: float = 1.0, spread: Spread = _known) -> float:
    """Probability that white noise alone moves the runs' means as far from the common zero.

    Args:
        fit: its residuals, in noise standard deviations.
        floor: power assumed for white noise, a factor on the noise variance.
        spread: gives the standard deviation of the noise's mean power over some frequencies (Hz), a share of it.

    Returns:
        The p-value; the zero takes one degree of freedom.
    """
    total = sum(float(np.sum(residual)) ** 2 / residual.size for residual in fit.residuals)
    lowest = np.array([1.0 / max(run.duration for run in fit.problem.data.runs)])
    return chance(total / floor, len(fit.residuals) - 1.0, spread(lowest))


def band_p_values(fit: Fit, floor: float = 1.0, spread: Spread = _known) -> tuple[float, ...]:
    """Probability that white noise alone gives as much power in each band, summed over the runs.

    Args:
        fit: its residuals, in noise standard deviations.
        floor: power assumed for white noise, a factor on the noise variance.
        spread: gives the standard deviation of the noise's mean power over some frequencies (Hz), a share of it.

    Returns:
        One p-value per band of `BANDS`; the bands are multiples of each run's own frequency.
    """
    bands, powers, frequencies = [], [], []
    for index, (run, residual) in enumerate(zip(fit.problem.data.runs, fit.residuals, strict=True)):
        spectrum = np.abs(np.fft.rfft(residual)) ** 2 / residual.size
        frequency = np.fft.rfftfreq(residual.size, run.interval)
        multiple = frequency[1:-1] / max(resonance(fit, index), 1e-9)
        band = np.clip(np.floor(multiple + 0.5), 0, len(BANDS) - 1).astype(int)
        bands.append(band)
        powers.append(spectrum[1:-1])
        frequencies.append(frequency[1:-1])
    where, power, place = (np.concatenate(column) for column in (bands, powers, frequencies))
    # each ordinate is half a χ² of two degrees of freedom
    inside = [where == index for index in range(len(BANDS))]
    return tuple(
        chance(2.0 * float(power[i].sum()) / floor, 2.0 * i.sum(), spread(place[i])) if i.any() else 1.0
        for i in inside
    )
