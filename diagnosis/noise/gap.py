"""Is there a gap? Tests of the residuals by frequency band and of the noise; and the error of rounded readings."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import bdtrc, chdtrc, stdtr

from diagnosis.likelihood.least_squares import Fit, FitError, try_fit
from diagnosis.likelihood.least_squares import fit as refit
from diagnosis.likelihood.per_run import excited
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import resonance
from diagnosis.likelihood.run_data import Data, RunData
from diagnosis.likelihood.run_noise import WhiteNoise
from diagnosis.likelihood.starting_points import misses_motion, nominal_start, starting_points
from diagnosis.noise.colour import alike_in_all_runs, noise_colour, whitened, zero_wanders
from diagnosis.noise.sensor_noise import Noise, NoiseTrend, trend_statistics
from diagnosis.settings import GapSettings
from identification.status import Outcome, Remark
from tunnel_sim.effects import the_effect
from tunnel_sim.vocabulary.record import Array

#: Noise of this many steps makes the rounding error independent of the motion to within a ten-thousandth: the first
#: harmonic of the error falls with exp(−4π²σ²/q²) (B. Widrow and I. Kollár, Quantization Noise, 2008, ch. 11).
_BLURS = 0.5
_MOST_ROUNDINGS, _FEWEST_ROUNDINGS, _SAMPLES = 16, 4, 2.5e6


def samples(fit: Fit) -> int:
    """Number of samples in all runs of a fit."""
    return sum(run.reading.size * run.block for run in fit.problem.data.runs)


def repeated(
    fit: Fit, white: Mapping[str, float], step: float, count: int, levels: Array | None = None
) -> Iterator[tuple[RunData, Array, Array]]:
    """Read the fitted motion again, with white noise and a lattice of unknown origin.

    Args:
        white: standard deviation of a sample's noise before rounding, rad, by run id.
        step: of the lattice, rad; 0 where there is none.
        count: of the repetitions.
        levels: readings that occur where steps are of unequal width, increasing, shape (levels,), rad; None: the
            step is the same everywhere.

    Yields:
        Every run with the samples of its motion, shape (n,), and of the readings, shape (count, n), rad.
    """
    # seeded by the readings, so that one campaign is always compared with the same repetitions
    rng = np.random.default_rng([zlib.crc32(run.reading.tobytes()) for run in fit.problem.data.runs])
    for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True):
        motion = run.reading - run.unscaled(residual)
        if run.block > 1 or run.samples is not None:  # samples from block means
            seen = slice(None) if run.samples is None else run.samples.count > 0
            motion = np.asarray(CubicSpline(run.times[seen], motion[seen])(run.sample_times), np.float64)
        reading = motion + white[run.stretch_of or run.id] * rng.standard_normal((count, motion.size))
        if step > 0.0 and levels is None:
            shift = step * rng.uniform(size=(count, 1))
            # back to the angle: the origin belongs to the lattice, not to the motion
            reading = step * np.round((reading + shift) / step) - shift
        elif step > 0.0 and levels is not None:
            reading = levels[np.searchsorted(0.5 * (levels[1:] + levels[:-1]), reading)]
        yield run, motion, reading


def rounding_errors(
    fit: Fit, white: Mapping[str, float], step: float, levels: Array | None = None
) -> list[Array] | None:
    """What noise and rounding alone leave in the block means, arguments as in `repeated`.

    Returns:
        By run, repetitions of it, shape (repetitions, blocks), rad; None where the noise is large enough to make
        the rounding error white.
    """
    if min(white.values()) > _BLURS * step:
        return None
    count = int(np.clip(_SAMPLES / samples(fit), _FEWEST_ROUNDINGS, _MOST_ROUNDINGS))
    return [run.means(reading - motion) for run, motion, reading in repeated(fit, white, step, count, levels)]


def with_rounding(data: Data, errors: Sequence[Array]) -> Data | None:
    """Data prepared for white noise, with noise of block means that is not below errors of `rounding_errors`.

    It is raised where averaging does not reduce the errors as it reduces white noise, at most to that of one
    sample. None where none is raised.
    """
    raised = [
        float(np.clip(np.mean(error**2), run.noise.variance, run.noise.variance * run.block))
        for run, error in zip(data.runs, errors, strict=True)
    ]
    if all(run.noise.variance == value for run, value in zip(data.runs, raised, strict=True)):
        return None
    runs = [replace(run, noise=WhiteNoise(value)) for run, value in zip(data.runs, raised, strict=True)]
    return data.with_runs(tuple(runs))


#: Repetitions of the campaign, fewer where it is long, never below the least.
_REPETITIONS, _FEWEST = 32, 16
#: A step this many times the noise hides its level, since crossed edges look like noise; several are tried.
_COARSE = 3.0
_FACTORS = (0.0, 0.5, 1.0, 1.5)
_NAMES = ("noise against amplitude", "noise against rate", "noise in bursts")
_HANN = 1.57  # correlated bins of the windowed periodogram that carry the information of one independent bin


def trend_p_values(trend: NoiseTrend, fit: Fit, noise: Noise) -> Mapping[str, float]:
    """Probability that white noise behaves like that of the campaign, by name of the test.

    It is from Student's t of the campaign among repetitions of it simulated with white noise and the readings'
    lattice (a prediction interval for one more; Geisser, Predictive Inference, 1993); where the lattice hides the
    noise, the largest over several possible levels. All are 1 where the sampling is too slow for the test.
    """
    if not trend.judged:
        return dict.fromkeys(_NAMES, 1.0)
    white = noise.white(trend.step)
    factors = _FACTORS if trend.step > _COARSE * min(white.values()) else (1.0,)
    tails = np.log(fit.settings.gap.noise_tails)
    observed = np.array([trend.amplitude_z, trend.rate_z, trend.spread - tails])
    count = int(np.clip(_SAMPLES / samples(fit), _FEWEST, _REPETITIONS))
    found = np.zeros(3)
    for factor in factors:
        level = {run: factor * std for run, std in white.items()}
        repetitions = repeated(fit, level, trend.step, count)
        seen = trend_statistics((reading, run.sample_times) for run, _, reading in repetitions)
        assert seen is not None  # the campaign was judged
        mean, scatter = seen.mean(axis=0), np.maximum(seen.std(axis=0, ddof=1), 1e-9)
        score = (observed - mean) / (scatter * np.sqrt(1.0 + 1.0 / count))
        two_sided = 2.0 * stdtr(count - 1, -np.abs(score[:2]))
        found = np.maximum(found, np.append(two_sided, stdtr(count - 1, -score[2])))
    return dict(zip(_NAMES, found.tolist(), strict=True))


def level_p_value(fit: Fit, noise: Noise) -> float:
    """Probability that noise as stated, allowing for its rounding, is estimated as high as it is.

    It is that of a sign test: that at least half the ordinates of the periodogram above the motion exceed the
    median found, at the largest noise that the statement allows.
    """
    assert noise.stated_variance is not None
    level = noise.estimated / (fit.settings.gap.noise_above_stated * noise.stated_variance)
    ordinates = max(int(_ABOVE * 0.5 * samples(fit) / _HANN), 1)
    return float(bdtrc((ordinates - 1) // 2, ordinates, 2.0**-level))


_ABOVE = 0.48  # share of the ordinates that the estimate uses, where sampling is slowest


Spread = Callable[[Array], float]
BANDS = ("below", "f0", "2f0", "3f0", "above")


@dataclass(frozen=True)
class GapTest:
    """The tests of a gap.

    Args:
        p_value: the smallest p-value, times the number of tests (at most 1).
        tests: p-value by name: the bands, and the noise's trend with the motion, its scatter and its level.
        noisy: whether the noise itself misbehaves: its level follows the motion, it comes in bursts, or it is
            above the stated level.
        within_step: whether a gap is no larger than the error of the readings' lattice, and is therefore none; the
            smallest p-value is then 1, whatever the single tests say.
    """

    detected: bool
    p_value: float
    tests: Mapping[str, float]
    noisy: bool
    within_step: bool = False


def gap_test(
    fit: Fit,
    noise: Noise,
    trend: NoiseTrend,
    *,
    coarse_step: bool,
    errors: Sequence[Array] | None,
) -> GapTest:
    """Test whether a fit's residuals and the noise are consistent with white noise.

    Args:
        coarse_step: whether the reading's step is known to be coarser than stated; the level and trend of the
            noise are then not tested.
        errors: what noise and rounding leave in the block means, by run, repetitions of it, shape (repetitions,
            blocks), rad; None where they are white.

    Returns:
        The verdict at one rate of false alarms, shared equally among the tests (Bonferroni).
    """
    level, scatter, chosen = np.ones(6), np.zeros(6), fit.settings.gap
    if errors is not None:
        # statistics under noise and rounding, and their scatter beyond that of white noise, as shares of what white
        # noise of the fit's variance gives: the bands, then the offset
        found, count = [], np.ones(len(BANDS) + 1)
        for number in range(len(errors[0])):
            residuals = [run.scaled(e[number]) for run, e in zip(fit.problem.data.runs, errors, strict=True)]
            bands = _by_band(fit, residuals)
            count = np.array([*(max(place.size, 1) for _, place in bands), 0.5 * len(residuals)])
            found.append([*(float(power.sum()) for power, _ in bands), 0.5 * _offsets(residuals)] / count)
        level = np.mean(found, axis=0)
        beyond = np.var(found, axis=0, ddof=1) / np.maximum(level, 1e-100) ** 2 - 1.0 / count
        level, scatter = np.maximum(level, 1.0), np.sqrt(np.maximum(beyond, 0.0))
    floor = (1.0 + chosen.noise_tolerance) * noise.margin * level
    tests = dict(zip(BANDS, band_p_values(fit, floor[:-1], noise.spread, scatter[:-1]), strict=True))
    tests["offset"] = offset_p_value(fit, floor[-1], noise.spread, scatter[-1])
    noisy: dict[str, float] = {}
    if not coarse_step and noise.source != "floor":
        noisy |= trend_p_values(trend, fit, noise)
        if noise.stated_variance is not None:
            noisy["noise level"] = level_p_value(fit, noise)
    everything = tests | noisy
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
        coarse_step: as `gap_test` takes it.

    Returns:
        The fit, the noise and the verdict. The noise of the fit allows for rounding, whose error is not white where
        the motion is slow and the noise small, and fit and noise are whitened where the noise is coloured. Where
        whitening does not close the gap, colour is believed only if runs with the wind off have it, and if it shows
        above the motion's harmonics: turbulence needs the wind, and a gap raises the spectrum beside the motion.
        Nor is it believed where there would be more noise than is stated, or where it alone would close the gap of
        a wandering zero, of an error that every run repeats or of an oscillation that the input excites. Such an
        oscillation is a narrow line, and colour is sought beside it. Turbulence may hide the colour, which is then
        sought in the runs with the wind off alone.

        A gap within the error of the readings' lattice is not detected: the levels of a camera or an encoder may be
        off by half a step, which follows the motion as long as no noise of half a step blurs it (Widrow and
        Kollár, Quantization Noise, 2008).
    """
    errors = rounding_errors(nominal, noise.white(step), step)
    allowed = None if errors is None else with_rounding(nominal.problem.data, errors)
    if allowed is not None:
        nominal = refit(Problem(allowed), nominal.point)
    plain = gap_test(nominal, noise, trend, coarse_step=coarse_step, errors=errors)
    for source in () if misses_motion(nominal) else _colour_sources(nominal):
        found = noise_colour(source, throughout=source is not nominal)
        if found is None:
            continue
        white = refit(Problem(whitened(nominal.problem.data, found)), nominal.point)
        if source is nominal and _follows_input(white):  # what the input excites is in the colour
            beside = _beside_mode(nominal)
            found = None if beside is None else noise_colour(beside)
            if beside is None or found is None:
                continue
            source = beside
            white = refit(Problem(whitened(nominal.problem.data, found)), nominal.point)
        coloured = noise.coloured(found, nominal.problem.data)
        test = gap_test(white, coloured, trend, coarse_step=coarse_step, errors=errors)
        still = any(not run.wind_on for run in nominal.problem.data.runs)
        excessive = test.tests.get("noise level", 1.0) < _misbehaves(test.tests, nominal.settings.gap)
        beyond = nominal.settings.noise.colour_beyond
        believed = still and not excessive and noise_colour(source, beyond=beyond) is not None
        repeats = alike_in_all_runs(nominal) or _follows_input(white)
        noise_alone = not zero_wanders(nominal, found) and not repeats
        if believed if test.detected else noise_alone:
            return white, coloured, test
    blurred = max(noise.white(step).values()) >= 0.5 * step
    power = nominal.excess * max(run.noise.variance for run in nominal.problem.data.runs)
    if plain.detected and not coarse_step and not blurred and power < step**2 / 12.0:
        plain = replace(plain, detected=False, p_value=1.0, within_step=True)
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


_TRIED = 2000  # frequencies and dampings of an oscillation, at most


def _follows_input(white: Fit) -> bool:
    """Whether white residuals hold an oscillation that the input excites alike in all runs, as noise does not."""
    found = excited(white)
    rate = white.settings.noise.oscillation_rate
    return found is not None and bool(_TRIED * chdtrc(1.0, found.drop) < rate)


def _beside_mode(nominal: Fit) -> Fit | None:
    """The fit with the oscillation that the input excites; None where it fails."""
    starts = starting_points(nominal, the_effect(line="ringing"))
    driven = [start for start in starts if any(value != 0.0 for _, value in start.problem.fixed)]
    return try_fit(driven[0].problem, driven[0].point) if driven else None


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
    """Probability that white noise alone moves the runs' means so far from the common zero.

    It takes arguments as in `band_p_values`, and is 1 where the runs have zeros of their own or nothing holds the
    body.
    """
    if not fit.problem.data.model.shares_zero:
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
    """Probability that white noise alone gives as much power in each band, summed over the runs, by `BANDS`.

    Args:
        floor: power assumed for white noise, a factor on the noise variance; one for all bands, or shape (bands,).
        spread: gives the standard deviation of the noise's mean power over some frequencies (Hz), a share of it.
        scatter: standard deviation of the floor, a share of it, of its shape.
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


def noise_remarks(noise: Noise, trend: NoiseTrend, test: GapTest) -> tuple[Remark, ...]:
    """What the user should know of the noise.

    Args:
        trend: of the noise with the motion.

    Returns:
        Remarks where the noise is coloured, where the sampling is too slow to compare it with the motion, and where
        the readings' steps may be all of the gap.
    """
    found = []
    runs = tuple(noise.variance)
    if test.within_step:
        what = (
            "the model departs from the readings by less than their steps, whose error may follow the motion"
        )
        found.append(Remark(Outcome.NOTED, runs, what, "read the angle more finely to see smaller gaps"))
    if noise.colour is not None:
        span = noise.colour.frequency[-1] / noise.colour.frequency[0]
        ratio = np.exp(np.ptp(noise.colour.level))
        what = (
            f"the sensor's noise is coloured: {noise.std:.3g} rad in all, and its power per hertz varies by a "
            f"factor of {ratio:.3g} over a factor of {span:.3g} in frequency, in the same way throughout the runs"
        )
        found.append(Remark(Outcome.NOTED, runs, what, "the diagnosis allows for it, and it is not a cause"))
    if not trend.judged:
        what = "sampled too slowly to test whether the noise follows the motion or comes in bursts"
        found.append(Remark(Outcome.NOTED, runs, what, "sample faster to test it"))
    return tuple(found)
