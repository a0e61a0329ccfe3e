"""Tests of a random moment: innovations that are steady noise, alike in all runs, and no steady line."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from diagnosis.likelihood.least_squares import Fit
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
BURST_SHARE: Final = 0.02
"""Minimum share of the power of all innovations for a burst to count against a moment. Judgement. Most of a blow is
in one burst; a jump of a few lost samples beside turbulence has half a per cent."""
FADING: Final = 1.5
"""Ratio of the intensity in the first third of the runs to the intensity in the last third, above which a moment
fades with the motion. Judgement. The rest of a motion that a model misses decays with it; the surroundings and the
wind do not know when a run began. Real turbulence is not exactly stationary."""
LINE_SHARE: Final = 0.75
"""Share of the residual explained by a line with an amplitude and a phase per run, above which the moment is none.
Judgement (decision 0046). A line explains 0.46 of sixteen drawn moments of the stream at most, 0.66 taken for the
other source, and 0.66 to 1.1 of a mode of the mount at 1.05 to 1.3 times the frequency of the motion."""

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
_LINE_DECAYS = np.array([0.0, 0.5, 1.0, 2.0, 4.0])  # over the longest run
_LINES = 41  # frequencies
_LINE_WIDTHS = 3.0  # about the centre of a spectrum in which a line is sought


def is_steady_noise(result: ProcessNoise, chosen: RandomMomentSettings) -> bool:
    """Whether innovations are white, steady and without bursts, in more than one run, and do not fade."""
    first, *_, last = result.intensities
    if first > FADING * last and acts_by(result.unsteady_drop, chosen):
        return False
    return (
        departure_from_white(result) <= WHITE_INNOVATIONS
        and bursts(result, chosen.burst_rate, BURST_SHARE) <= BURST_POWER
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


def bursts(result: ProcessNoise, false_alarm_rate: float, least: float = 0.0) -> float:
    """Greatest power of innovations within a short time, relative to the greatest by chance.

    A blow is in few innovations, a gust in some more. Windows of 1, 2, 4, … innovations are moved over each run,
    up to a quarter of it.

    Args:
        false_alarm_rate: greatest probability that a steady normal moment exceeds 1 in any window, a fraction.
        least: share of the power of all innovations below which a burst does not count.
    """
    lengths = [1 << k for k in range(20)]
    windows = [(i, n) for i in result.innovations for n in lengths if 4 * n <= i.size]
    rate = false_alarm_rate / max(sum(i.size - n + 1 for i, n in windows), 1)
    least *= sum(float(i @ i) for i in result.innovations)
    highest = 0.0
    for innovations, length in windows:
        total = np.concatenate(([0.0], np.cumsum(innovations**2)))
        power, limit = float(np.max(total[length:] - total[:-length])), float(chdtri(length, rate))
        highest = max(highest, power / limit if power - limit >= least else 0.0)
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
    """Whether a line at one frequency explains most of a residual; it may decay, at one rate in all runs.

    Its amplitude and phase differ from run to run: a mode of the mount is excited as the motion begins. The phase
    of a random moment about a frequency wanders. A moment without a centre is not a line: the rig's own response is
    narrow, and the release of every run absorbs a steady part at its frequency.

    Args:
        fit: fit by least squares in the sensor's noise; it has absorbed its part of the moment.
        process: the most likely random moment in its residual.
    """
    runs = [run for run in fit.problem.data.runs if run.id in process.runs]
    longest = max(run.duration for run in runs)
    drops = [0.0]
    for part in process.spectrum:
        if part.centre > 0.0:
            reach = _LINE_WIDTHS * max(part.bandwidth, 1.0 / longest)
            near = np.abs(np.linspace(part.centre - reach, part.centre + reach, _LINES))
            drops.append(float(np.max(_line_drops(fit, process, near, _LINE_DECAYS / longest))))
    residuals = (r for run, r in zip(fit.problem.data.runs, fit.residuals, strict=True) if run in runs)
    return max(drops) > LINE_SHARE * sum(float(r @ r) - r.size for r in residuals)


def _line_drops(fit: Fit, process: ProcessNoise, frequency: Array, decay: Array) -> Array:
    """Drop of χ² by a decaying sine of free amplitude and phase in every run, beside the parameters of the fit.

    Args:
        process: the moment, which names the runs.
        frequency: Hz, shape (frequencies,).
        decay: 1/s, shape (decays,).

    Returns:
        By linear theory, dimensionless, shape (frequencies, decays).
    """
    bases, of_all = _bases(fit)
    shape, count = (frequency.size, decay.size), of_all[0].shape[1]
    drop, gradient = np.zeros(shape), np.zeros((*shape, count))
    normal = np.broadcast_to(np.eye(count), (*shape, count, count)).copy()
    for run, residual, basis, common in zip(fit.problem.data.runs, fit.residuals, bases, of_all, strict=True):
        gradient += common.T @ residual
        if run.id not in process.runs:
            continue
        time = np.arange(residual.size) * run.interval
        envelope, turn = np.exp(-np.outer(time, decay)), np.exp(2j * np.pi * np.outer(frequency, time))
        columns = np.column_stack([residual - basis @ (basis.T @ residual), common, basis])
        weighted = (envelope[:, :, None] * columns[:, None, :]).reshape(time.size, -1)
        along = (turn @ weighted).reshape(*shape, -1)
        pair = np.stack([along.real, along.imag], axis=-2)  # cosine, sine
        total, twice = np.sum(envelope**2, axis=0), turn**2 @ envelope**2
        gram = 0.5 * np.stack([total + twice.real, twice.imag, twice.imag, total - twice.real], axis=-1)
        absorbed = pair[..., count + 1 :]
        left = gram.reshape(*shape, 2, 2) - absorbed @ np.swapaxes(absorbed, -1, -2)
        onto = pair[..., : count + 1]
        explained = np.swapaxes(onto, -1, -2) @ np.linalg.pinv(left, rcond=_ABSORBED, hermitian=True) @ onto
        drop += explained[..., 0, 0]
        gradient -= explained[..., 1:, 0]
        normal -= explained[..., 1:, 1:]
    step = np.linalg.pinv(normal, rcond=_ABSORBED, hermitian=True) @ gradient[..., None]
    return np.asarray(drop + np.sum(gradient * step[..., 0], axis=-1), np.float64)


def _bases(fit: Fit) -> tuple[list[Array], list[Array]]:
    """Orthonormal columns of each run's own parameters, and of the common ones beside them, by run."""
    bases = [orthonormal(own) for _, own in fit.jacobian]
    beside = [
        common - basis @ (basis.T @ common) for (common, _), basis in zip(fit.jacobian, bases, strict=True)
    ]
    ends = np.cumsum([len(one) for one in beside])[:-1]
    return bases, np.split(orthonormal(np.concatenate(beside)), ends)


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
    bases, of_all = _bases(fitted)
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
