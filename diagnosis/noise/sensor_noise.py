"""The noise of a record, compared with the stated noise, and its dependence on the motion.

It is measured in the part of the spectrum far above the motion. There is no such part in driven runs, nor where
the samples are not evenly spaced, since an irregular clock spreads the motion over all frequencies.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_lsq_spline
from scipy.special import gammaincinv, ndtri

from diagnosis.model.blocks import BLOCK_INTERVAL
from diagnosis.model.fact import Fact
from diagnosis.model.similarity import frequency
from diagnosis.noise.kinds import Estimated, Floor, Noise, StatedNoise
from diagnosis.settings import NoiseSettings
from identification.signal.decay_fit import mean_of_blocks
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.quantities import Hertz
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced

_FLOOR_FROM = 60.0  # Hz: above the motion, the rod's ringing and the mains
_LN2 = float(np.log(2.0))  # median of a unit exponential: the periodogram of white noise
#: Error of block means and steps in a fit of the closed form of the nominal model, as a share of the swing, at
#: which its bands still pass as white.
_ACCURACY = 4e-5


def estimate_variance(record: Record, fastest: float | None = None) -> tuple[float, float]:
    """Variance of the white noise, from the median of the periodogram above the motion.

    Where the samples are not evenly spaced, `scattered_variance` measures it.

    Args:
        fastest: frequency of the campaign's fastest motion, Hz, so that coloured noise is measured in the same
            band in all runs; None: the record's own.

    Returns:
        Variance of one sample, rad², and its relative standard deviation. Lines such as the mains' harmonics do
        not change a median.
    """
    if not record.uniform:
        block = max(1, round(BLOCK_INTERVAL * record.sample_rate))
        return scattered_variance(record, fastest or frequency(record), block)
    rate = record.sample_rate
    low = min(_FLOOR_FROM, 0.25 * rate)
    places, power = floor_periodogram(record.yaw_rad, rate)
    floor = power[(places > low) & (places < 0.49 * rate)]
    # a median of n exponentials scatters by 1/√n of its mean ln 2; the Hann window correlates neighbouring
    # bins: 1.57 of them carry what one would without it
    return float(np.median(floor) / _LN2 * rate / 2.0), float(np.sqrt(1.57 / floor.size) / _LN2)


def floor_periodogram(values: Array, rate: Hertz) -> tuple[Array, Array]:
    """One-sided periodogram with a window whose leakage stays below the noise: frequencies, Hz, and unit²/Hz.

    Args:
        values: samples, shape (n,).
    """
    window = np.hanning(values.size)
    spectrum = np.fft.rfft((values - np.mean(values)) * window)
    power = 2.0 * np.abs(spectrum) ** 2 / (rate * float(window @ window))
    return np.asarray(np.fft.rfftfreq(values.size, 1.0 / rate), np.float64), power


_ORDER = 5
_KNOTS = 24.0  # greatest number per cycle: the curve follows motions slower than twelve times it
_LONG_GAP = 0.25  # of a cycle: the curve is not drawn across it
_LEAST_PIECES = 8  # of a curve
_NEARLY_EVEN = 0.1  # least interval between samples over the greatest


def scattered_variance(record: Record, frequency: float, block: int) -> tuple[float, float]:
    """Variance of the noise in means of neighbouring samples.

    Args:
        frequency: of its motion, Hz.
        block: number of samples in a mean. Where time stamps were assigned to the samples afterwards, neighbours
            share some noise, which differences of single samples would miss.

    Returns:
        Variance of a mean times ``block``, in the reading's unit squared, and its relative standard deviation.
    """
    piece = max(2 * block, round(record.sample_rate / (_KNOTS * frequency)))
    widest = max(_LONG_GAP / frequency, 2.0 * record.sample_interval)
    gaps = np.flatnonzero(np.diff(record.time_s) > widest)
    stretches = np.split(np.arange(record.time_s.size), gaps + 1)
    whole = [place for place in stretches if place.size >= _LEAST_PIECES * piece]
    # The curve takes the noise below its knots' Nyquist frequency; of it means pass 1 − (block² − 1)(π f/rate)²/3.
    absorbed = 1.0 - (block**2 - 1) * (np.pi / (2.0 * piece)) ** 2 / 9.0
    squares, freedom = 0.0, 0.0
    for place in whole or [np.arange(record.time_s.size)]:
        curve = SmoothCurve(record.time_s[place], piece)
        means = mean_of_blocks(curve.residuals(record.yaw_rad[place]), block)
        squares += float(means @ means)
        freedom += means.size - absorbed * (place.size // piece + _ORDER)
    return block * squares / max(freedom, 1.0), float(np.sqrt(2.0 / max(freedom, 1.0)))


class SmoothCurve:
    """A quintic spline through some times, by least squares.

    Args:
        time: of the samples, shape (n,), s.
        piece: samples between its knots.
    """

    def __init__(self, time: Array, piece: int) -> None:
        inner = time[piece : 1 - piece : piece]
        self.time = time
        self.knots = np.concatenate([np.full(_ORDER + 1, time[0]), inner, np.full(_ORDER + 1, time[-1])])

    def residuals(self, values: Array) -> Array:
        """Residuals of the values from the curve, shape (n,) or (n, k)."""
        apart = np.diff(self.time)
        # normal equations are ten times as fast, and lose their digits where samples come in bursts
        method: Literal["norm-eq", "qr"] = "norm-eq" if apart.min() > _NEARLY_EVEN * apart.max() else "qr"
        curve = make_lsq_spline(self.time, values, self.knots, _ORDER, method=method)
        return np.asarray(values - curve(self.time), np.float64)


#: With this many samples the median is taken over eight windows or more. Simulated records of known noise then
#: have no bias beyond chance (3 %); with 200 samples the variance is 17 % too large, and with 130 by a factor of
#: five and more.
LEAST_SAMPLES = 500

_LINES = 24  # of a window
_DEGREE = 2  # of the polynomials of the response to the input, and of the ends of the record
_FROM = 0.1  # of the sampling rate: the lowest frequency used where the record allows no higher one
_TO = 0.49  # of the sampling rate
_BAND = 0.999  # share of the power of a driven motion within its band


def driven_variance(reading: Array, values: Array, low: float) -> tuple[float, float]:
    """Variance of the white noise of a driven run, by the local polynomial method.

    In each narrow window of the spectrum, the frequency response and the effect of the record's ends are smooth
    (Pintelon and Schoukens, System Identification, 2nd ed., ch. 7). The residual is noise, with harmonics of the
    input where the body is not linear, which a median over the windows ignores if they are few.

    Args:
        reading: shape (n,), n at least `LEAST_SAMPLES`, rad.
        values: of the input at the same times, shape (n,).
        low: lowest frequency used, a share of the sampling rate.

    Returns:
        Variance of one sample, rad², and its relative standard deviation.
    """
    size = reading.size
    response = np.fft.rfft(reading - reading.mean()) / np.sqrt(size)
    moved = np.fft.rfft(values - values.mean())
    moved = moved / max(float(np.abs(moved).max()), 1e-300)
    first, last = int(min(low, _FROM) * size) + 1, int(_TO * size)
    starts = range(first, max(last - _LINES, first + 1), _LINES)
    place = np.linspace(-1.0, 1.0, _LINES)
    powers = place[:, None] ** np.arange(_DEGREE + 1)
    left = []
    for start in starts:
        window = slice(start, start + _LINES)
        given = moved[window, None] * powers / max(float(np.abs(moved[window]).max()), 1e-300)
        basis = np.linalg.qr(np.column_stack([given, powers]))[0]
        y = response[window]
        rest = y - basis @ (basis.conj().T @ y)
        left.append(float(np.sum(np.abs(rest) ** 2)))
    freedom = _LINES - 2 * (_DEGREE + 1)
    median = float(gammaincinv(freedom, 0.5))
    return float(np.median(left)) / median, 1.2533 / float(np.sqrt(len(left) * freedom))


def campaign_noise(campaign: Campaign, chosen: NoiseSettings) -> Noise:
    """The noise of every run: as stated where the records agree with it, else as estimated from them.

    Most runs usually agree with one another within chance. They have the stated noise if their mean agrees with it,
    else that mean; a run that differs from them has its own. Where a run contains less noise than the accuracy of
    the fits, that accuracy is used instead.
    """
    measured, relative = _measured(campaign)
    # however slow the motion, a rounded reading has at least this error
    rounded = lattice_step(campaign) ** 2 / 12.0
    estimates = {run: max(value, rounded) for run, value in measured.items()}
    variances = np.array(list(estimates.values()))
    pooled, uncertainty = float(np.mean(variances)), float(np.sqrt(np.sum(relative**2)) / relative.size)
    alike = _alike(variances, relative, chosen.own_rate)
    uniform, some = bool(alike.all()), alike if alike.any() else np.ones_like(alike)
    common, chance = float(np.mean(variances[some])), float(np.sqrt(np.sum(relative[some] ** 2))) / some.sum()
    agrees = -float(ndtri(0.5 * chosen.stated_rate)) * chance
    stated = _stated_variance(campaign.sensor, common, agrees)
    floors = {run.id: accuracy(run.record, swings=not run.unrestrained) ** 2 for run in campaign.runs}
    fewer = sum(floors[run] > value for run, value in estimates.items())
    if fewer:
        used = {run: max(value, floors[run]) for run, value in estimates.items()}
        reason = Fact("floor", {"std_rad": float(np.sqrt(pooled)), "fewer": fewer, "runs": len(used)})
        return Floor(used, stated, reason, pooled, 0.0, measured)
    agreed = stated is not None and abs(common / stated - 1.0) < agrees
    common = stated if stated is not None and agreed else common
    used = {run: common if same else estimates[run] for run, same in zip(estimates, alike, strict=True)}
    std = float(np.sqrt(pooled))
    level = {"std_rad": std, "uncertainty_rad": 0.5 * uncertainty * std}
    if stated is None:
        reason = Fact("not stated")
    elif uniform and agreed:
        return StatedNoise(used, stated, Fact("agrees", level), pooled, uncertainty, measured)
    else:
        span = {"least_rad": float(np.sqrt(variances.min())), "most_rad": float(np.sqrt(variances.max()))}
        beside = {"stated_rad": float(np.sqrt(stated))}
        apart = "some runs differ" if agreed and alike.any() else "differs by run"
        reason = Fact("contradicts", beside | level) if uniform else Fact(apart, beside | span)
    return Estimated(used, stated, reason, pooled, uncertainty, measured)


def _alike(variances: Array, relative: Array, rate: float) -> NDArray[np.bool_]:
    """Whether each run has the noise of most runs, shape (runs,); all False where no noise is that of most.

    Args:
        variances: shape (runs,), rad².
        relative: their relative standard deviations, shape (runs,).
        rate: of false alarms of all runs together.
    """
    apart = -float(ndtri(0.5 * rate / variances.size)) * relative
    alike = np.abs(variances / np.mean(variances) - 1.0) < apart
    if not alike.all():  # the median is not moved by a run that differs
        alike = np.abs(variances / np.median(variances) - 1.0) < apart
    return alike if 2 * alike.sum() > alike.size else np.zeros_like(alike)


def _measured(campaign: Campaign) -> tuple[dict[str, float], Array]:
    """Variance of one sample by run id, rad², and its relative standard deviations, shape (runs,)."""
    fastest = max((_fastest(run) for run in campaign.runs if not run.record.uniform), default=None)
    found = {}
    for run in campaign.runs:
        if run.drive is None or not run.record.uniform:
            found[run.id] = estimate_variance(run.record, fastest)
        else:
            low = _FLOOR_FROM / run.record.sample_rate
            found[run.id] = driven_variance(run.record.yaw_rad, run.drive.values, low)
    return {run: value for run, (value, _) in found.items()}, np.array([std for _, std in found.values()])


def _stated_variance(sensor: SensorProperties, measured: float, agrees: float) -> float | None:
    """The variance stated by a data sheet, before or after rounding, rad²; None where none is stated.

    A data sheet seldom says which. The larger one is taken where the records agree with it, since noise that is
    taken too small is a gap; else the one closer to the records.

    Args:
        measured: variance of the records, rad².
        agrees: greatest relative difference by chance.
    """
    if not sensor.noise_std:  # no record has a noise of zero
        return None
    rounded = sensor.noise_std**2 + (sensor.resolution or 0.0) ** 2 / 12.0
    if abs(measured / rounded - 1.0) < agrees:
        return rounded
    return min((rounded, sensor.noise_std**2), key=lambda variance: abs(variance - measured))


def _fastest(run: Run) -> float:
    """The frequency of a decay, or the upper end of the band in which a driven run moves, Hz."""
    if run.drive is None:
        return frequency(run.record)
    record = evenly_spaced(run.record)
    power = np.cumsum(np.abs(np.fft.rfft(record.yaw_rad - record.yaw_rad.mean())) ** 2)
    last = int(np.searchsorted(power, _BAND * power[-1]))
    return max(last, 1) * record.sample_rate / record.yaw_rad.size


def accuracy(record: Record, *, swings: bool = True) -> float:
    """Least noise of a sample at which the errors of the fits do not show.

    Args:
        swings: whether the body has a spring, so that its motion has a phase to lose.

    Returns:
        Standard deviation of a sample, rad: a share of the swing, plus three times the error of the reading from
        RK4's loss of phase, (ωh)⁴/120 of the phase for steps h of a block (Hairer, Nørsett and Wanner, Solving
        ODEs I, sect. II.1). The factor of three is used because the error is in one narrow band and the noise in
        all.
    """
    swing = record.yaw_rad - np.mean(record.yaw_rad)
    cycles = 1 + int(np.argmax(np.abs(np.fft.rfft(swing)[1:])))
    omega = 2.0 * np.pi * cycles / record.duration
    block = max(1, round(BLOCK_INTERVAL * record.sample_rate))
    lag = omega * (record.time_s - record.time_s[0]) * (omega * BLOCK_INTERVAL) ** 4 / 120.0
    lost = float(np.sqrt(np.mean((lag * swing) ** 2)))
    return float(np.sqrt(block) * (_ACCURACY * np.max(np.abs(swing)) + (3.0 * lost if swings else 0.0)))


def reading_step(campaign: Campaign) -> float:
    """The step of the lattice on which the readings lie: the smallest difference between distinct readings, rad.

    This is the true resolution where the record visits neighbouring steps, as every decay does; it is far below
    any step where readings are continuous.
    """
    return min((float(np.quantile(gaps, 0.02)) for gaps in _gaps(campaign)), default=0.0)


def lattice_step(campaign: Campaign) -> float:
    """As `reading_step`, rad; 0 where the differences between distinct readings are not multiples of it."""
    step = reading_step(campaign)
    multiples = np.concatenate([gaps / step for gaps in _gaps(campaign)]) if step > 0.0 else np.full(1, 0.5)
    # differences of continuous readings are a quarter of a step off in the median, rounded ones hardly at all
    return step if np.median(np.abs(multiples - np.round(multiples))) < _OFF_LATTICE else 0.0


def reading_levels(campaign: Campaign) -> Array:
    """The distinct readings in increasing order, shape (levels,), rad; merged within a rounding error."""
    found = np.unique(np.concatenate([run.record.yaw_rad for run in campaign.runs]))
    apart = np.diff(found) > _OFF_LATTICE * reading_step(campaign)
    return np.asarray(found[np.concatenate([[True], apart])], np.float64)


def typical_step(levels: Array) -> float:
    """The uniform step with the same rounding power as `reading_levels`, two or more, rad."""
    widths = np.diff(levels)
    return float(np.sqrt(np.sum(widths**3) / np.sum(widths)))


def _gaps(campaign: Campaign) -> list[Array]:
    """Differences between neighbouring distinct readings, by run, rad; runs of a single reading are left out."""
    gaps = [np.diff(np.unique(run.record.yaw_rad)) for run in campaign.runs]
    # the same step may be printed twice with different rounding
    clear = [found[found > 1e-9] for found in gaps]
    return [found for found in clear if found.size]


_OFF_LATTICE = 0.1  # of a step: printed readings are rounded once more


@dataclass(frozen=True)
class NoiseTrend:
    """Dependence of the noise's level on the motion and on time.

    Args:
        amplitude_z: slope of the local noise variance against the squared amplitude, in units of its standard
            deviation under steady white noise.
        rate_z: slope of the local noise variance against the squared rate, in its own standard deviation, a ratio.
        spread: natural logarithm of the ratio of the local variances' standard deviation to its value for a normal
            distribution with their quartiles: positive for heavy tails. Skewness alone makes it about 0.1.
        step: of the lattice of the readings, rad.
        judged: whether any run is sampled fast enough for the test.
    """

    amplitude_z: float
    rate_z: float
    spread: float
    step: float = 0.0
    judged: bool = True


_WINDOW = 0.02  # s: a small part of a swing, so that large angles and large rates fall in different windows
_FEWEST = 5  # samples in a window: as many as a fourth difference spans
_SHORTEST = 5.0 * _WINDOW  # s: of a record with several windows


def noise_trend(campaign: Campaign) -> NoiseTrend:
    """Measure whether the noise is equally strong in motion and at rest, and at all times.

    The statistics are trends of the variance of fourth divided differences of the reading in windows of 20 ms,
    pooled over the runs of five windows or more. Their null distribution is simulated (`diagnosis.noise.gap`).
    Driven runs are not judged: their motion may be as fast as the noise.
    """
    if campaign.driven:
        return NoiseTrend(0.0, 0.0, 0.0, judged=False)
    long = [run.record for run in campaign.runs if run.record.duration > _SHORTEST]
    readings = []
    for record in long:  # on a uniform clock where the stamps are only rounded
        uniform = np.arange(record.time_s.size, dtype=np.float64) * record.sample_interval
        readings.append((record.yaw_rad[None], uniform if record.uniform else record.time_s))
    values = trend_statistics(readings)
    if values is None:
        return NoiseTrend(0.0, 0.0, 0.0, judged=False)
    amplitude, rate, spread = values[0].tolist()
    return NoiseTrend(amplitude, rate, spread, step=reading_step(campaign))


def trend_statistics(readings: Iterable[tuple[Array, Array]]) -> Array | None:
    """The statistics of `NoiseTrend`, shape (repetitions, 3); None where no run is fast enough.

    Args:
        readings: by run, readings of any number of repetitions, shape (repetitions, n), rad, and their times,
            shape (n,), s; consumed one by one, so that a generator keeps one run in memory at a time.
    """
    parts = [_local_levels(reading, time) for reading, time in readings if _in_window(time) >= _FEWEST]
    if not parts:
        return None
    level, square, rate = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    scatter = np.maximum(np.std(level, axis=-1), _TINY)
    root = np.sqrt(level.shape[-1])
    upper, lower = np.quantile(level, [0.75, 0.25], axis=-1)
    bulk = np.maximum((upper - lower) / 1.349, _TINY * scatter)
    along = [np.einsum("ij,ij->i", level, over) / (scatter * root) for over in (square, rate)]
    return np.stack([*along, np.log(scatter / bulk)], axis=-1)


_TINY = 1e-9  # of a level's mean: the quartiles of a reading that rests on one step coincide


def _standardised(values: Array) -> Array:
    centred = values - values.mean(axis=-1, keepdims=True)
    result: Array = centred / np.maximum(centred.std(axis=-1, keepdims=True), 1e-300)
    return result


def _in_window(time: Array) -> int:
    """Samples in a window, on average."""
    return round(_WINDOW * (time.size - 1) / float(time[-1] - time[0]))


def _local_levels(reading: Array, time: Array) -> tuple[Array, Array, Array]:
    """Mean squared fourth difference by window over its mean, less one; squared angle and rate, standardised."""
    width = _in_window(time)
    reading = reading - reading.mean(axis=-1, keepdims=True)
    # fourth divided differences: white noise has the same variance in all of them, and (ω dt)⁴ of the motion
    # remains, far below any noise
    size = time.size - 4
    total, gain = np.zeros((*reading.shape[:-1], size)), np.zeros(size)
    for k in range(5):
        weight = np.ones(size)
        for j in {0, 1, 2, 3, 4} - {k}:
            weight /= time[k : size + k] - time[j : size + j]
        total += weight * reading[..., k : size + k]
        gain += weight**2
    fourth = total / np.sqrt(gain)
    count = fourth.shape[-1] // width

    def windows(values: Array) -> Array:
        return values[..., : count * width].reshape(*values.shape[:-1], count, width)

    level = np.mean(windows(fourth) ** 2, axis=-1)
    level = level / np.maximum(level.mean(axis=-1, keepdims=True), 1e-300) - 1.0
    angle = windows(reading[..., 2:]).mean(axis=-1)
    return level, _standardised(angle**2), _standardised(np.gradient(angle, axis=-1) ** 2)
