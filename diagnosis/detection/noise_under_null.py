"""Null distribution of the noise's statistics: white noise on the fitted motion, rounded like the readings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import bdtrc, stdtr

from diagnosis.detection.rounding import repeated, samples
from diagnosis.detection.sensor_noise import Noise, NoiseTrend, trend_statistics
from diagnosis.fitting.least_squares import Fit
from diagnosis.policy import NOISE_TAILS, ROUNDED_NOISE
from tunnel_sim.vocabulary.record import Array

#: Repetitions of the campaign, fewer where it is long, never below the least.
_REPETITIONS, _FEWEST, _SAMPLES = 32, 16, 2.5e6
#: A step this many times the noise hides its level, since crossed edges look like noise; several are tried.
_COARSE = 3.0
_FACTORS = (0.0, 0.5, 1.0, 1.5)
_NAMES = ("noise against amplitude", "noise against rate", "noise in bursts")
_HANN = 1.57  # correlated bins of the windowed periodogram that carry the information of one independent bin


def trend_p_values(trend: NoiseTrend, fit: Fit, noise: Noise) -> Mapping[str, float]:
    """Probability that white noise behaves like that of the campaign.

    Args:
        trend: of the campaign.

    Returns:
        P-values by name, from Student's t of the campaign among repetitions of it simulated with white noise
        and the readings' lattice (a prediction interval for one more; Geisser, Predictive Inference, 1993);
        where the lattice hides the noise, the largest over several possible levels. All 1 where the sampling is
        too slow for the test.
    """
    if not trend.judged:
        return dict.fromkeys(_NAMES, 1.0)
    white = noise.white(trend.step)
    factors = _FACTORS if trend.step > _COARSE * min(white.values()) else (1.0,)
    found = np.zeros(3)
    for factor in factors:
        level = {run: factor * std for run, std in white.items()}
        found = np.maximum(found, _p_values(trend, _repetitions(fit, level, trend.step)))
    return dict(zip(_NAMES, found.tolist(), strict=True))


def _p_values(trend: NoiseTrend, chance: Array) -> Array:
    count = len(chance)
    mean, scatter = chance.mean(axis=0), np.maximum(chance.std(axis=0, ddof=1), 1e-9)
    observed = np.array([trend.amplitude_z, trend.rate_z, trend.spread - np.log(NOISE_TAILS)])
    score = (observed - mean) / (scatter * np.sqrt(1.0 + 1.0 / count))
    two_sided = 2.0 * stdtr(count - 1, -np.abs(score[:2]))
    return np.append(two_sided, stdtr(count - 1, -score[2]))


def _repetitions(fit: Fit, white: Mapping[str, float], step: float) -> Array:
    """Statistics of the campaign repeated, shape (repetitions, 3)."""
    count = int(np.clip(_SAMPLES / samples(fit), _FEWEST, _REPETITIONS))
    readings = ((reading, run.sample_times) for run, _, reading in repeated(fit, white, step, count))
    found = trend_statistics(readings)
    assert found is not None  # the campaign was judged
    return found


def level_p_value(fit: Fit, noise: Noise) -> float:
    """Probability that noise as stated, allowing for its rounding, is estimated as high as it is.

    Args:
        fit: gives the records' lengths.
        noise: of the campaign; its stated variance is not None.

    Returns:
        The p-value of a sign test: that at least half the ordinates of the periodogram above the motion exceed the
        median found, at the largest noise that the statement allows.
    """
    assert noise.stated_variance is not None
    level = noise.estimated / (ROUNDED_NOISE * noise.stated_variance)
    ordinates = max(int(_ABOVE * 0.5 * samples(fit) / _HANN), 1)
    return float(bdtrc((ordinates - 1) // 2, ordinates, 2.0**-level))


_ABOVE = 0.48  # share of the ordinates that the estimate uses, where sampling is slowest
