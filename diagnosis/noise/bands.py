"""Residuals against white noise: by band about the motion's harmonics, and by the means of the runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import chdtrc

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import resonance
from tunnel_sim.vocabulary.record import Array

Spread = Callable[[Array], float]
BANDS = ("below", "f0", "2f0", "3f0", "above")
#: The bands, and the runs' means.
TESTS = (*BANDS, "offset")


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


def p_values(
    fit: Fit, floor: float | Array = 1.0, spread: Spread = _known, scatter: float | Array = 0.0
) -> dict[str, float]:
    """P-value of the power, summed over the runs, under white noise, by name of `TESTS`.

    The p-value of the runs' means about the common zero is 1 where the runs have their own zeros or the body has
    no spring.

    Args:
        floor: power assumed for white noise, a factor on the noise variance; one for all, or shape (tests,).
        spread: function for the standard deviation of the noise's mean power over some frequencies (Hz), a share
            of it.
        scatter: standard deviation of the floor, a share of it, of its shape.
    """
    total, count, places = powers(fit, fit.residuals)
    freedom = 2.0 * count  # half a χ² of two degrees of freedom each; the mean of the means is fitted
    freedom[-1] = freedom[-1] - 1.0 if fit.problem.data.model.shares_zero else 0.0
    found = {}
    each = np.broadcast_to(floor, len(TESTS)), np.broadcast_to(scatter, len(TESTS))
    for name, power, free, place, level, share in zip(TESTS, total, freedom, places, *each, strict=True):
        relative = float(np.hypot(spread(place), share)) if place.size else 0.0
        found[name] = chance(2.0 * power / level, free, relative)
    return found


def powers(fit: Fit, residuals: Sequence[Array]) -> tuple[Array, Array, list[Array]]:
    """Power of residuals by `TESTS`, all runs together.

    Returns:
        Sums of the periodograms' ordinates, in variances of white noise, and half the sum of the squared means;
        their expectations under white noise, the number of ordinates and half the number of runs, shape (tests,)
        each; and the frequencies of the ordinates, Hz.
    """
    runs = fit.problem.data.runs
    bands, ordinates, frequencies = [], [], []
    for index, (run, residual) in enumerate(zip(runs, residuals, strict=True)):
        spectrum = np.abs(np.fft.rfft(residual)) ** 2 / residual.size
        frequency = np.fft.rfftfreq(residual.size, run.interval)
        multiple = frequency[1:-1] / max(resonance(fit, index), 1e-9)
        bands.append(np.clip(np.floor(multiple + 0.5), 0, len(BANDS) - 1).astype(int))
        ordinates.append(spectrum[1:-1])
        frequencies.append(frequency[1:-1])
    where, power, place = (np.concatenate(column) for column in (bands, ordinates, frequencies))
    inside = [where == band for band in range(len(BANDS))]
    means = sum(float(np.sum(residual)) ** 2 / residual.size for residual in residuals)
    return (
        np.array([*(float(power[band].sum()) for band in inside), 0.5 * means]),
        np.array([*(float(band.sum()) for band in inside), 0.5 * len(residuals)]),
        [*(place[band] for band in inside), np.array([1.0 / max(run.duration for run in runs)])],
    )
