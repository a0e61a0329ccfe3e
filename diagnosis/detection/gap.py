"""Is there a gap? Tests of the nominal model's residuals by frequency band, and of the noise itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from diagnosis.detection.noise_under_null import level_p_value, trend_p_values
from diagnosis.detection.sensor_noise import Noise, NoiseTrend
from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.spectra import resonance
from diagnosis.policy import FLOOR_TOLERANCE, GAP_FALSE_ALARM_RATE, NOISE_FALSE_ALARM_SHARE

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
    # stated noise may be a little below that of the records and still agree with it
    floor = (1.0 + FLOOR_TOLERANCE) * max(noise.estimated / noise.used, 1.0)
    tests = dict(zip(BANDS, band_p_values(fit, floor), strict=True)) | {"offset": offset_p_value(fit, floor)}
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


def offset_p_value(fit: Fit, floor: float = 1.0) -> float:
    """Probability that white noise alone moves the runs' means as far from the common zero.

    Args:
        fit: its residuals, in noise standard deviations.
        floor: power assumed for white noise, a factor on the noise variance.

    Returns:
        The p-value; the zero takes one degree of freedom. 1 where the runs have zeros of their own.
    """
    if fit.problem.data.own_zeros:
        return 1.0
    total = sum(float(np.sum(residual)) ** 2 / residual.size for residual in fit.residuals)
    runs = len(fit.residuals)
    return float(chi2.sf(total / floor, runs - 1)) if runs > 1 else 1.0


def band_p_values(fit: Fit, floor: float = 1.0) -> tuple[float, ...]:
    """Probability that white noise alone gives as much power in each band, summed over the runs.

    Args:
        fit: its residuals, in noise standard deviations.
        floor: power assumed for white noise, a factor on the noise variance.

    Returns:
        One p-value per band of `BANDS`; the bands are multiples of each run's own frequency.
    """
    power, count = np.zeros(len(BANDS)), np.zeros(len(BANDS))
    for index, (run, residual) in enumerate(zip(fit.problem.data.runs, fit.residuals, strict=True)):
        spectrum = np.abs(np.fft.rfft(residual)) ** 2 / residual.size
        frequency = np.fft.rfftfreq(residual.size, run.interval)
        multiple = frequency[1:-1] / max(resonance(fit, index), 1e-9)
        band = np.clip(np.floor(multiple + 0.5), 0, len(BANDS) - 1).astype(int)
        power += np.bincount(band, spectrum[1:-1], len(BANDS))
        count += np.bincount(band, minlength=len(BANDS))
    # each ordinate is half a χ² of two degrees of freedom
    values = [
        float(chi2.sf(2.0 * p / floor, 2.0 * n)) if n > 0 else 1.0 for p, n in zip(power, count, strict=True)
    ]
    return tuple(values)
