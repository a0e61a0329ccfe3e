"""Tests for a gap in the residuals and in the noise, and the choice between a gap and coloured noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import bdtrc, chdtrc, stdtr

from diagnosis.likelihood.least_squares import Fit, FitError, try_fit
from diagnosis.likelihood.least_squares import fit as refit
from diagnosis.likelihood.per_run import excited, ringing, ringing_p_value
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import misses_motion, nominal_start, starting_points
from diagnosis.model.fact import Fact, Noted
from diagnosis.noise.bands import p_values
from diagnosis.noise.colour import alike_in_all_runs, noise_colour, whitened, zero_wanders
from diagnosis.noise.kinds import Coloured, Noise
from diagnosis.noise.rounding import repeated, repetitions, samples
from diagnosis.noise.sensor_noise import NoiseTrend, trend_statistics
from diagnosis.settings import GapSettings
from tunnel_sim.effects import the_effect
from tunnel_sim.effects.capabilities import SecondOscillation

NOISE_TOLERANCE: Final = 0.03
"""Allowed excess of the noise below 60 Hz over the noise above 60 Hz, as a share. Judgement. Quantisation
colours the noise."""
NOISE_TAILS: Final = 1.15
"""Allowed ratio of the tails of the noise to a normal distribution's tails. Judgement. Sensor noise is not
exactly normal."""
NOISE_ABOVE_STATED: Final = 1.5
"""Maximum ratio of the noise variance to the stated variance that does not count as a gap. Judgement. Stated
noise is often rounded to one digit."""

COLOUR_BEYOND: Final = 3.5
"""Multiple of the frequency of the motion above which the spectrum must be coloured where a gap remains.
Judgement. The bands below contain the motion."""

_MOST, _FEWEST = 32, 16  # repetitions of the campaign
#: A step this many times the noise hides its level, since crossed edges look like noise; several levels are tried.
_COARSE = 3.0
_FACTORS = (0.0, 0.5, 1.0, 1.5)
_NAMES = ("noise against amplitude", "noise against rate", "noise in bursts")
_HANN = 1.57  # correlated bins of the windowed periodogram that carry the information of one independent bin


def trend_p_values(trend: NoiseTrend, fit: Fit, noise: Noise) -> Mapping[str, float]:
    """P-values of the campaign's noise under white noise, by name of the test.

    They come from Student's t of the campaign among simulated repetitions with white noise and the readings'
    lattice (a prediction interval for one more; Geisser, Predictive Inference, 1993); where the lattice hides the
    noise, the largest over several possible levels. All are 1 where the sampling is too slow for the test.
    """
    if not trend.judged:
        return dict.fromkeys(_NAMES, 1.0)
    white = noise.white(trend.step)
    factors = _FACTORS if trend.step > _COARSE * min(white.values()) else (1.0,)
    tails = np.log(NOISE_TAILS)
    observed = np.array([trend.amplitude_z, trend.rate_z, trend.spread - tails])
    count = repetitions(fit, _FEWEST, _MOST)
    found = np.zeros(3)
    for factor in factors:
        level = {run: factor * std for run, std in white.items()}
        again = repeated(fit, level, trend.step, count)
        seen = trend_statistics((reading, run.sample_times) for run, _, reading in again)
        assert seen is not None  # the campaign was judged
        mean, scatter = seen.mean(axis=0), np.maximum(seen.std(axis=0, ddof=1), 1e-9)
        score = (observed - mean) / (scatter * np.sqrt(1.0 + 1.0 / count))
        two_sided = 2.0 * stdtr(count - 1, -np.abs(score[:2]))
        found = np.maximum(found, np.append(two_sided, stdtr(count - 1, -score[2])))
    return dict(zip(_NAMES, found.tolist(), strict=True))


def level_p_value(fit: Fit, noise: Noise) -> float:
    """P-value of the estimated noise level if the stated noise, with its rounding, is right.

    It comes from a sign test: that at least half the ordinates of the periodogram above the motion exceed the
    median found, at the largest noise that the statement allows.
    """
    assert noise.stated_variance is not None
    level = noise.estimated / (NOISE_ABOVE_STATED * noise.stated_variance)
    ordinates = max(int(_ABOVE * 0.5 * samples(fit) / _HANN), 1)
    return float(bdtrc((ordinates - 1) // 2, ordinates, 2.0**-level))


_ABOVE = 0.48  # share of the ordinates that the estimate uses, where sampling is slowest


@dataclass(frozen=True)
class GapTest:
    """The tests of a gap.

    Args:
        p_value: the smallest p-value, times the number of tests (at most 1).
        tests: p-value by name: the bands, the noise's trend with the motion, its scatter and its level, and
            differences between runs beyond the fitted ones.
        noisy: whether the noise itself misbehaves: its level follows the motion, it comes in bursts, or it is
            above the stated level.
        within_step: whether the gap is no larger than the error of the readings' lattice, and therefore not a gap;
            the smallest p-value is then 1, whatever the single tests give.
    """

    detected: bool
    p_value: float
    tests: Mapping[str, float]
    noisy: bool
    within_step: bool = False


def gap_test(fit: Fit, noise: Noise, trend: NoiseTrend, *, coarse_step: bool) -> GapTest:
    """Test whether a fit's residuals and the noise are consistent with white noise.

    Args:
        coarse_step: whether the step of the readings is coarser than stated; the level and trend of the noise are
            then not tested.

    Returns:
        The verdict at one rate of false alarms, shared equally among the tests (Bonferroni).
    """
    chosen = fit.settings.gap
    level, scatter = noise.rounding.expected(fit)
    floor = (1.0 + NOISE_TOLERANCE) * noise.margin * level
    noisy: dict[str, float] = {}
    if noise.shown and not coarse_step:
        noisy |= trend_p_values(trend, fit, noise)
        if noise.stated_variance is not None:
            noisy["noise level"] = level_p_value(fit, noise)
    everything = p_values(fit, floor, noise.spread, scatter) | noisy
    if fit.between is not None:
        everything["between runs"] = fit.columns.wider(fit.widths)
    limit = chosen.detection_rate / len(everything)
    smallest = min(everything.values())
    return GapTest(
        smallest < limit,
        min(1.0, smallest * len(everything)),
        everything,
        any(p < _misbehaves(everything, chosen) for p in noisy.values()),
    )


def _misbehaves(tests: Mapping[str, float], chosen: GapSettings) -> float:
    """The p-value of one of these tests below which the noise itself misbehaves."""
    return chosen.misbehaving_rate / len(tests)


def gap_or_colour(
    nominal: Fit, noise: Noise, trend: NoiseTrend, *, step: float, coarse_step: bool
) -> tuple[Fit, Noise, GapTest]:
    """Test for a gap, and decide between a gap and coloured noise.

    Args:
        nominal: fit of the nominal model to runs prepared for white noise.
        step: of the lattice of the readings, rad; 0 where there is none.
        coarse_step: as in `gap_test`.

    Returns:
        The fit, the noise and the verdict, with the first colour that passes, else with the noise as it was found.
        The noise of the fit allows for rounding, whose error is not white where the motion is slow and the noise
        small.
    """
    noise = noise.rounded(nominal, step)
    allowed = noise.rounding.allowed_in(nominal.problem.data)
    if allowed is not nominal.problem.data:
        nominal = refit(replace(nominal.problem, data=allowed), nominal.point)
    for candidate in _candidates(nominal, noise):
        test = gap_test(candidate.fit, candidate.noise, trend, coarse_step=coarse_step)
        if candidate.believed(test):
            return candidate.fit, candidate.noise, test
    test = gap_test(nominal, noise, trend, coarse_step=coarse_step)
    if test.detected and not coarse_step and _within_step(nominal, noise, step):
        test = replace(test, detected=False, p_value=1.0, within_step=True)
    return nominal, noise, test


def _within_step(nominal: Fit, noise: Noise, step: float) -> bool:
    """Whether a gap is no larger than the error of the readings' lattice.

    The levels of a camera or an encoder may be off by half a step, which follows the motion unless noise of half a
    step blurs it (Widrow and Kollár, Quantization Noise, 2008).
    """
    blurred = max(noise.white(step).values()) >= 0.5 * step
    power = nominal.excess * max(run.noise.variance for run in nominal.problem.data.runs)
    return not blurred and power < step**2 / 12.0


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A colour of the noise that may explain the whole gap.

    Args:
        nominal: the fit in white noise.
        source: the fit with residuals that show the colour.
        fit: the nominal one in noise of that colour.
        noise: of that colour.
    """

    nominal: Fit
    source: Fit
    fit: Fit
    noise: Coloured

    @classmethod
    def of(cls, nominal: Fit, source: Fit, noise: Noise, *, throughout: bool = False) -> _Candidate | None:
        """The colour in the residuals of a source; None where they are white. Arguments as in `noise_colour`."""
        found = noise_colour(source, throughout=throughout)
        if found is None:
            return None
        data = nominal.problem.data
        white = refit(replace(nominal.problem, data=whitened(data, found)), nominal.point)
        return cls(nominal, source, white, noise.coloured(found, data))

    def believed(self, test: GapTest) -> bool:
        """Whether it is noise rather than a gap.

        Where the whitened fit still has a gap, the colour must appear in runs with the wind off, and above the
        motion's harmonics: turbulence needs the wind, and a gap raises the spectrum beside the motion. The noise
        may not exceed its stated level. Where no gap remains, it must not be the spectrum of a wandering zero, of
        an error that every run repeats or of an oscillation that the release or the input excites.
        """
        chosen = self.nominal.settings
        if test.detected:
            still = bool(self.nominal.problem.data.in_still_air)
            excessive = test.tests.get("noise level", 1.0) < _misbehaves(test.tests, chosen.gap)
            return still and not excessive and noise_colour(self.source, beyond=COLOUR_BEYOND) is not None
        repeats = alike_in_all_runs(self.nominal) or _rings(self.fit)
        return not repeats and not zero_wanders(self.nominal, self.fit, self.noise.spectrum)


def _candidates(nominal: Fit, noise: Noise) -> Iterator[_Candidate]:
    """The possible colours of the noise; none where the nominal model misses the motion.

    The first comes from all runs. The release or the input may excite a narrow line, and colour is sought beside
    it. Turbulence may hide the colour, which is then sought in the runs with the wind off alone.
    """
    if misses_motion(nominal):
        return
    found = _Candidate.of(nominal, nominal, noise)
    if found is not None and _rings(found.fit):
        beside = _beside_mode(nominal)
        found = None if beside is None else _Candidate.of(nominal, beside, noise)
    if found is not None:
        yield found
    for still in _in_still_air(nominal):
        found = _Candidate.of(nominal, still, noise, throughout=True)
        if found is not None:
            yield found


def _in_still_air(nominal: Fit) -> Iterator[Fit]:
    """The fit of the runs with the wind off alone, where there are others."""
    data = nominal.problem.data
    if data.in_wind and data.in_still_air:
        only = data.with_runs(data.in_still_air)
        with suppress(FitError, np.linalg.LinAlgError):
            yield refit(Problem(only), nominal_start(only))


_TRIED = 20_000  # frequencies and dampings of an oscillation: the independent ones of 8,000 block means


def _rings(white: Fit) -> bool:
    """Whether white residuals contain an oscillation that the release or the input excites, unlike noise."""
    rate, follows, rings = white.settings.noise.oscillation_rate, excited(white), ringing(white)
    if follows is not None and _TRIED * chdtrc(1.0, follows.drop) < rate:
        return True
    return rings is not None and _TRIED * ringing_p_value(white, rings) < rate


def _beside_mode(nominal: Fit) -> Fit | None:
    """The fit with the oscillation that the release or the input excites; None where it fails."""
    starts = starting_points(nominal, the_effect(SecondOscillation))
    return try_fit(starts[0].problem, starts[0].point) if starts else None


def noise_noted(noise: Noise, trend: NoiseTrend, test: GapTest, *, named: bool) -> tuple[Noted, ...]:
    """Remarks on the noise for the user.

    Args:
        trend: of the noise with the motion.
        named: whether a cause of the gap is named; misbehaving noise is then not part of the answer.

    Returns:
        Where the readings' steps may explain the whole gap, where the noise is coloured, and where the sampling is
        too slow to compare the noise with the motion and no cause is named.
    """
    within = (Fact("within step"),) if test.within_step else ()
    slow = () if trend.judged or named else (Fact("not judged"),)
    return tuple(Noted(tuple(noise.variance), one) for one in (*within, *noise.noted(), *slow))
