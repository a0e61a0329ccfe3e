"""Tests of a random moment: innovations that are steady noise, alike in all runs, and no steady line."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import residual_spectra
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.search.process_noise import ProcessNoise, acts_by, likeliest, random_moments, with_response
from diagnosis.search.random_spectra import MomentSource
from diagnosis.search.reach import orthonormal
from diagnosis.search.scatter import with_own_linear_terms
from diagnosis.settings import RandomMomentSettings
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.record import Array

WHITE_INNOVATIONS: Final = 10.0
"""Maximum deviation of the power of the innovations from white noise, by band and by quarter of a record, in
standard deviations. Judgement (decision 0046). Chance alone gives less than 3.5. Real spectra are not
first-order. With the true sets of unblinded campaigns it is at most 9.0."""
BURST_POWER: Final = 1.5
"""Maximum power of short innovations of a steady moment, relative to chance. Judgement. Real turbulence is
not exactly stationary."""
FADING: Final = 1.5
"""Ratio of the intensity in the first third of the runs to the intensity in the last third, above which a moment
fades with the motion. Judgement. The rest of a motion that a model misses decays with it; the surroundings and the
wind do not know when a run began. Real turbulence is not exactly stationary."""
STEADY_LINE_SHARE: Final = 0.9
"""Share of the residual explained by a line with a phase per run, above which the moment is a line. Judgement
(decision 0046). A line explains nine tenths of a random moment whose half-width is a twentieth of one over
the duration."""

SLOW_SHARE: Final = 0.5
"""Share of the drop of −2 ln L by a random moment that slow changes of the reading bring, above which it is none.
Convention. More than half. The rig resonates, so of nine drawn moments of the surroundings it is 0.006 at most, and
of sixteen of the stream 0.009."""

OWN_TERMS_SHARE: Final = 0.9
"""Share of the drop of −2 ln L by a random moment that a spring, a damping, a zero and a drift of each run bring,
above which it is none. Judgement. A straight line leaves 0.4 of a random walk; of seven drawn moments of the
surroundings it is 0.64 at most, and of sixteen of the stream 0.72."""

ABSORBED_RATE: Final = 0.01
"""Rate at which the power of a random motion, over the power that a fit leaves of it, exceeds its limit.
Convention."""

ABSORBED_MARGIN: Final = 1.5
"""Factor on this limit for the spectrum of a real moment, which is not of first order. Judgement. Turbulence of a
limited band exceeded the limit by a factor of 1.09."""

_SIMULATED = 200  # campaigns of a random motion
_ABSORBED = 1e-9  # least singular value of the columns of a run, relative to the largest
_LINE_WIDTHS = 3.0  # about the centre of a spectrum in which a line is sought


def is_steady_noise(result: ProcessNoise, chosen: RandomMomentSettings) -> bool:
    """Whether innovations are white, steady and without bursts, in more than one run, and do not fade."""
    first, *_, last = result.intensities
    if first > FADING * last and acts_by(result.unsteady_drop, chosen):
        return False
    return (
        departure_from_white(result) <= WHITE_INNOVATIONS
        and bursts(result, chosen.burst_rate) <= BURST_POWER
        and of_all_runs(result) >= chosen.one_run_rate
    )


def departure_from_white(result: ProcessNoise) -> float:
    """Departure of innovations from white and steady.

    Returns:
        Largest departure from 1 of the mean power in a frequency band, or in a quarter of the record in time, in
        its standard deviations.
    """
    departures = []
    for innovations in result.innovations:
        power = np.abs(np.fft.rfft(innovations - innovations.mean())) ** 2 / innovations.size
        for part in np.array_split(power[1:], 8):
            departures.append((float(part.mean()) - 1.0) * np.sqrt(part.size))
        for part in np.array_split(innovations, 4):
            departures.append((float(np.mean(part**2)) - 1.0) * np.sqrt(part.size / 2.0))
    return float(np.max(np.abs(departures)))


def bursts(result: ProcessNoise, false_alarm_rate: float) -> float:
    """Greatest power of innovations within a short time, relative to the greatest by chance.

    A blow is in few innovations, a gust in some more. Windows of 1, 2, 4, … innovations are moved over each run,
    up to a quarter of it.

    Args:
        false_alarm_rate: greatest probability that a steady normal moment exceeds 1 in any window, a fraction.
    """
    lengths = [1 << k for k in range(20)]
    windows = [(i, n) for i in result.innovations for n in lengths if 4 * n <= i.size]
    rate = false_alarm_rate / max(sum(i.size - n + 1 for i, n in windows), 1)
    highest = 0.0
    for innovations, length in windows:
        total = np.concatenate(([0.0], np.cumsum(innovations**2)))
        power = float(np.max(total[length:] - total[:-length]))
        highest = max(highest, power / float(chdtri(length, rate)))
    return highest


def of_all_runs(result: ProcessNoise) -> float:
    """P-value of the strongest run's share of a random moment, if the moment acts in all runs.

    A gust in one run is not turbulence. The power of the response to the narrowest random moment, which has two
    quadratures, is an exponential variable; the power of a broader one varies less. Fisher's test of the greatest
    of n such variables: Proc. R. Soc. A 125 (1929) 54, doi 10.1098/rspa.1929.0151.

    Returns:
        The first term of Fisher's series, which is at least the probability; a fraction.
    """
    total = float(result.by_run.sum())
    share = float(result.by_run.max()) / total if total > 0.0 else 0.0
    return min(1.0, result.by_run.size * (1.0 - share) ** (result.by_run.size - 1))


def is_a_line(fit: Fit, process: ProcessNoise) -> bool:
    """Whether a line at one frequency, with a phase of its own in every run, explains nearly all of a residual.

    The phase of a random moment about a frequency wanders. A moment without a centre is not a line: the rig's own
    response is narrow, and the release of every run absorbs a steady part at its frequency.

    Args:
        fit: fit by least squares in the sensor's noise; the release has absorbed its part of the moment.
        process: the most likely random moment in its residual.
    """
    runs = fit.problem.data.runs
    spectra = [one for run, one in zip(runs, residual_spectra(fit), strict=True) if run.id in process.runs]
    drops = [0.0]
    for part in process.spectrum:
        if part.centre > 0.0:
            reach = _LINE_WIDTHS * max(part.bandwidth, 1.0 / max(one.duration for one in spectra))
            near = np.linspace(part.centre - reach, part.centre + reach, 201)
            drops.append(float(np.max(np.sum([one.power(np.abs(near)) for one in spectra], axis=0))))
    left = (
        float(r @ r) - r.size for run, r in zip(runs, fit.residuals, strict=True) if run.id in process.runs
    )
    return max(drops) > STEADY_LINE_SHARE * sum(left)


def is_slow(fit: Fit, process: ProcessNoise, source: MomentSource, kinds: Sequence[type[Effect]]) -> bool:
    """Whether a zero of each run, or its drift, explains as much, or all of it beside a spring and a damping.

    A random moment moves the rig most near its resonance. A zero that differs from run to run has the spectrum of a
    moment that lasts longer than the run. Within a run, the amplitude and the phase wander under a random moment; a
    spring and a damping of the run leave a third or more of that.

    Args:
        fit: as in `is_a_line`.
        process: the most likely random moment of the source in its residual.
        kinds: the effects that may be named.
    """
    own = [columns for _, columns in fit.jacobian]
    if _drop_beside(own, fit, source) < (1.0 - SLOW_SHARE) * process.drop:
        return True
    widest = with_own_linear_terms(fit, kinds)
    if widest is None:
        return False
    linear = [columns for _, columns in sensitivities(*widest)]
    return _drop_beside(linear, fit, source) < (1.0 - OWN_TERMS_SHARE) * process.drop


def _drop_beside(own: Sequence[Array], fit: Fit, source: MomentSource) -> float:
    """Drop of −2 ln L by the likeliest moment in residuals without a zero, a drift and other terms of the runs."""
    quick = []
    for residual, columns in zip(fit.residuals, own, strict=True):
        drift = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, residual.size), 2)
        both = np.column_stack([columns, drift])
        sized = both / np.maximum(np.linalg.norm(both, axis=0), 1e-300)
        vectors, values, _ = np.linalg.svd(sized, full_matrices=False)
        slow = vectors[:, values > _ABSORBED * values[0]]
        quick.append(residual - slow @ (slow.T @ residual))
    left = likeliest(random_moments(replace(fit, residuals=quick), source), fit.settings.moment)
    return 0.0 if left is None else left.drop


def most_absorbed(process: ProcessNoise, fitted: Fit) -> float:
    """Greatest power of a random motion, as a multiple of the power that a fit leaves of it."""
    return ABSORBED_MARGIN * float(np.quantile(absorption(process, fitted), 1.0 - ABSORBED_RATE))


def absorption(process: ProcessNoise, fitted: Fit) -> Array:
    """Power of a random motion over the power that a fit leaves of it, by linear theory.

    Args:
        process: the moment; its motion begins at rest in every run in which it acts.
        fitted: the fit, which absorbs the motion by its common parameters and by the parameters of each run.

    Returns:
        Ratios of simulated campaigns, shape (campaigns,); 1 where the moment's filter does not settle.
    """
    noisy = with_response(fitted, process.spectrum)
    if noisy is None:
        return np.ones(1)
    rng = np.random.default_rng([zlib.crc32(run.reading.tobytes()) for run in noisy.runs])
    bases = [orthonormal(own) for _, own in fitted.jacobian]
    beside = [
        common - basis @ (basis.T @ common) for (common, _), basis in zip(fitted.jacobian, bases, strict=True)
    ]
    ends = np.cumsum([run.reading.size for run in noisy.runs])[:-1]
    of_all = np.split(orthonormal(np.concatenate(beside)), ends)
    whole, own_left = np.zeros((2, _SIMULATED))
    along = np.zeros((of_all[0].shape[1], _SIMULATED))
    for run, shaken, basis, common in zip(fitted.problem.data.runs, noisy.runs, bases, of_all, strict=True):
        if run.id in process.runs:
            white = rng.standard_normal((run.reading.size, _SIMULATED)).T * shaken.noise.scale
            moved = np.stack([run.scaled(shaken.noise.coloured(one)) for one in white], axis=1)
            whole += np.sum(moved**2, axis=0)
            moved -= basis @ (basis.T @ moved)
            own_left += np.sum(moved**2, axis=0)
            along += common.T @ moved
    left: Array = own_left - np.sum(along**2, axis=0)
    return whole / left
