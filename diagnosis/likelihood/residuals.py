"""What residuals hold: spectral lines, and the misfit by channel.

An error in the damping changes the amplitude of the motion, and one in the stiffness its phase. In every cycle of a
run the residual is split into its part along the motion, its part along the rate, its mean, and the rest. What
changes in proportion to time over a run is a damping or a frequency of the run's own.

An error of the frequency makes χ² large, because phases add up over the cycles. Apart, it does not hide a cause in
the damping, nor the other way round.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.nondimensional import REFERENCE_FREQUENCY, Similarity
from diagnosis.likelihood.run_data import Data, RunData
from tunnel_sim.vocabulary.record import Array

_PADDING = 8  # zero padding: lines are found to a small part of a bin
_MAINS, _MAINS_WANDER = 50.0, 0.5  # Hz, of the rig as measured
_NYQUIST = 2.6  # blocks per period of the mains: two, and room for the skirt
_BEYOND_MOTION = 4.0  # times the motion's frequency: beyond its third harmonic


@dataclass(frozen=True, eq=False)
class ResidualSpectrum:
    """A run's residual spectrum.

    Args:
        frequency: Hz, shape (n,).
        transform: complex amplitude of a sine at that frequency, in noise standard deviations, shape (n,).
        duration: s.
        count: residuals in the record.
    """

    frequency: Array
    transform: np.ndarray
    duration: float
    count: int

    def at(self, frequency: float | Array) -> np.ndarray:
        """Complex amplitude at any frequency (nearest of the padded grid)."""
        index = np.round(np.asarray(frequency) / self.frequency[1]).astype(int)
        found: np.ndarray = self.transform[np.clip(index, 0, self.transform.size - 1)]
        return found

    def power(self, frequency: float | Array) -> Array:
        """Drop of χ² when a sine of free amplitude and phase is removed."""
        value: Array = np.abs(self.at(frequency)) ** 2 * self.count / 2.0
        return value


def residual_spectra(fit: Fit) -> list[ResidualSpectrum]:
    """The spectrum of every run's scaled residuals."""
    spectra = []
    for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True):
        size = _PADDING * residual.size
        transform = np.fft.rfft(residual, size) * 2.0 / residual.size
        spectra.append(
            ResidualSpectrum(
                np.asarray(np.fft.rfftfreq(size, run.interval), np.float64),
                transform,
                run.duration,
                residual.size,
            )
        )
    return spectra


@dataclass(frozen=True)
class Line:
    """A line found in the spectra.

    Args:
        parameter: frequency in Hz for the mains, Strouhal number for shedding.
        drop: of χ² when the line is removed from the runs concerned, dimensionless.
        contrast: ratio of the drop at the line to the drop beside it (the greatest for the mains, the median for
            shedding).
        amplitude: rad at the sensor for the mains, moment coefficient for shedding.
        phases: of sine, rad, by run, shape (runs,); zero for runs not concerned.
        runs: number of runs searched.
    """

    parameter: float
    drop: float
    contrast: float
    amplitude: float
    phases: Array
    runs: int


def by_moment(fit: Fit) -> Data:
    """The runs of a fit, whose noise holds a random moment beside the white noise.

    Per interval, a body without a spring turns a random moment into 1/((1 − B)(1 − φ B)) of it, with the backward
    shift B and φ = exp(−C h/Izz). White noise beside it makes (1 − B)(1 − φ B) of the reading a moving average of
    order two, whose inverse whitens it (Box and Jenkins, Time Series Analysis). The power of the moment is the
    likeliest one for the fit's residuals.
    """
    from scipy.signal import lfilter  # only here: slow to load

    inertia, damping, _ = linear_coefficients(fit, 0)
    runs = []
    for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True):
        shape = np.polymul([1.0, -1.0], [1.0, -np.exp(-damping * run.interval / inertia)])
        left = np.convolve(residual, shape, "valid")
        likeliest, least = run, np.inf
        for power in _POWERS:
            average = _moving_average(shape, power)
            variance = shape[2] / average[2]  # of the innovations: the products' last coefficients are equal
            cost = float(np.mean(lfilter([1.0], average, left) ** 2) / variance + np.log(variance))
            if cost < least:
                noise = run.noise_variance * variance
                likeliest = dataclasses.replace(run, innovations=(shape, average), noise_variance=noise)
                least = cost
        runs.append(likeliest)
    return fit.problem.data.with_runs(tuple(runs))


# Of a random moment's response per interval, in variances of white noise.
_POWERS = np.geomspace(1e-12, 1e12, 49)


def _moving_average(shape: Array, power: float) -> Array:
    """The invertible factor of a spectrum: of the shape's, and a constant beside it."""
    roots = np.roots(np.polyadd(np.convolve(shape, shape[::-1]), [power, 0.0, 0.0]))
    return np.asarray(np.real(np.poly(roots[np.argsort(np.abs(roots))][:2])), np.float64)


def mains_interval(similarity: Similarity) -> float:
    """Longest interval between blocks at which the mains can be seen, s."""
    return 1.0 / (_NYQUIST * similarity.similar(_MAINS, "Hz"))


def mains_line(fit: Fit) -> Line | None:
    """The strongest line near 50 Hz common to all runs.

    Returns:
        The line; None where the sampling is too slow to see it, or the motion too fast to distinguish it.
    """
    data = fit.problem.data
    mains, around = (data.similarity.similar(value, "Hz") for value in (_MAINS, _MAINS_WANDER))
    fast_enough = all(run.interval < mains_interval(data.similarity) for run in data.runs)
    if not fast_enough or mains < _BEYOND_MOTION * REFERENCE_FREQUENCY:
        return None
    spectra = smooth_spectra(fit)
    grid = np.arange(mains - around, mains + around, 0.005)
    total = np.sum([s.power(grid) for s in spectra], axis=0)
    best = float(grid[np.argmax(total)])
    beside = np.concatenate(
        [np.arange(best - 4.0, best - 0.6, 0.02), np.arange(best + 0.6, best + 4.0, 0.02)]
    )
    floor = float(np.max(np.sum([s.power(beside) for s in spectra], axis=0)))
    drop = float(total.max())
    gain = [block_gain(best, run) * run.response(best) for run in data.runs]
    scale = [np.sqrt(run.noise_variance) / g for run, g in zip(data.runs, gain, strict=True)]
    amplitude = float(
        np.sqrt(np.mean([np.abs(s.at(best) * k) ** 2 for s, k in zip(spectra, scale, strict=True)]))
    )
    amplitude *= float(
        np.sqrt(1.5)
    )  # the smoothed transform keeps the noise's level: lines lose a third of power
    # transform is of cos − i sin: a sine a sin(ωt + φ) gives a exp(i(φ − π/2))
    phases = np.array(
        [float(np.angle(s.at(best) * k)) + np.pi / 2 for s, k in zip(spectra, scale, strict=True)]
    )
    return Line(best, drop, drop / max(floor, 1e-9), amplitude, phases, len(spectra))


def smooth_spectra(fit: Fit) -> list[ResidualSpectrum]:
    """`residual_spectra` with a Hann window, whose leakage from the motion does not reach the mains."""
    return [_smooth(spectrum) for spectrum in residual_spectra(fit)]


def _smooth(spectrum: ResidualSpectrum) -> ResidualSpectrum:
    """The spectrum with less leakage of strong lines: a Hann window, applied in the frequency domain."""
    step = _PADDING
    values = spectrum.transform
    hann = 0.5 * values.copy()
    hann[step:-step] -= 0.25 * (values[: -2 * step] + values[2 * step :])
    return ResidualSpectrum(spectrum.frequency, hann * np.sqrt(8.0 / 3.0), spectrum.duration, spectrum.count)


def block_gain(frequency: float, run: RunData) -> float:
    """Gain of a run's block mean at a frequency.

    Args:
        frequency: Hz.
        run: whose blocks.

    Returns:
        Dimensionless; 1 where a block is one sample.
    """
    x = np.pi * frequency * run.interval / run.block
    return float(np.sin(run.block * x) / (run.block * np.sin(x))) if run.block > 1 else 1.0


def shedding_line(fit: Fit) -> Line | None:
    """The strongest line at one Strouhal number in all wind-on runs.

    Returns:
        The line; None without wind or body width.
    """
    data = fit.problem.data
    concerned = [i for i, run in enumerate(data.runs) if run.wind_on]
    if not concerned or data.width <= 0.0:
        return None
    spectra = residual_spectra(fit)
    speeds = np.array([_fitted_speed(fit, i) for i in concerned])
    spacing = 0.1 * data.width / (float(speeds.max()) * max(data.runs[i].duration for i in concerned))
    grid = np.arange(0.02, 0.60, spacing)
    powers = []
    for i, speed in zip(concerned, speeds, strict=True):
        own = resonance(fit, i)
        frequency = grid * speed / data.width
        power = spectra[i].power(frequency)
        power[np.abs(frequency / own - 1.0) < 0.08] = 0.0  # the free motion's own line is not evidence
        powers.append(np.minimum(power, _local_excess(power)))
    total = np.sum(powers, axis=0)
    best = float(grid[np.argmax(total)])
    floor = float(np.median(total)) / np.log(2.0)
    phases = np.zeros(len(data.runs))
    amplitudes = []
    for i, speed in zip(concerned, speeds, strict=True):
        frequency = best * speed / data.width
        run = data.runs[i]
        gain = _forced_gain(fit, i, frequency) / np.sqrt(run.noise_variance) * run.response(frequency)
        value = complex(spectra[i].at(frequency))
        phases[i] = float(np.angle(value / gain)) + np.pi / 2
        amplitudes.append((abs(value) / abs(gain), abs(gain) ** 2))
    values, weights = np.array(amplitudes).T
    amplitude = float(np.sum(values * weights) / np.sum(weights))
    return Line(
        best, float(total.max()), float(total.max()) / max(floor, 1e-9), amplitude, phases, len(concerned)
    )


def _fitted_speed(fit: Fit, run_index: int) -> float:
    """The wind speed of a run, corrected by the effects of the fit, m/s."""
    run, point = fit.problem.data.runs[run_index], fit.point
    return fit.problem.chain(point.common, point.release[run_index], run).physics().wind_speed


def _local_excess(power: Array) -> Array:
    """Cap on power, so that no run carries a line alone: ten times the run's own 99th percentile."""
    return np.full_like(power, 10.0 * float(np.quantile(power, 0.99)) + 1.0)


def resonance(fit: Fit, run_index: int) -> float:
    """Frequency of a run's free motion in the fitted model.

    Args:
        fit: parameter values.

    Returns:
        Hz; of a body that nothing holds, that of `free_frequency` in the similar campaign.
    """
    if fit.problem.data.unrestrained:
        return REFERENCE_FREQUENCY
    inertia, _, stiffness = linear_coefficients(fit, run_index)
    return float(np.sqrt(max(stiffness, 1e-12) / inertia) / (2.0 * np.pi))


def linear_coefficients(fit: Fit, run_index: int) -> tuple[float, float, float]:
    """Inertia, damping and stiffness of a run in the fitted model, air and gravity included.

    Args:
        fit: parameter values.

    Returns:
        kg m², N m s/rad and N m/rad; per unit inertia in normalised form.
    """
    problem = fit.problem
    run = problem.data.runs[run_index]
    stated = problem.stated(fit.point.common, fit.point.release[run_index], run)
    pressure = problem.data.air_moment(run)
    stiffness = stated.spring_stiffness - pressure * stated.derivatives.cn_beta
    stiffness += sum(effect.stiffness_at_rest for effect in problem.effects_at(fit.point.common))
    rate = pressure * problem.data.reference_length / run.wind_speed if run.wind_on else 0.0
    return stated.yaw_inertia, stated.mechanical_damping - rate * stated.derivatives.cn_r, stiffness


def _forced_gain(fit: Fit, run_index: int, frequency: float) -> complex:
    """Reading per unit moment coefficient at a frequency."""
    data: Data = fit.problem.data
    run = data.runs[run_index]
    inertia, damping, stiffness = linear_coefficients(fit, run_index)
    omega = 2.0 * np.pi * frequency
    gain = data.air_moment(run) / (stiffness - inertia * omega**2 + 1j * omega * damping)
    return complex(gain * (1j * omega) ** run.derivative)


CHANNELS = ("damping", "frequency", "damping of runs", "frequency of runs", "zero", "harmonics")
"""In this order everywhere."""

_LEAST = 4  # samples in a cycle


@dataclass(frozen=True, eq=False)
class ChannelMisfit:
    """What residuals hold by channel.

    Args:
        chi2: by channel, shape (6,), dimensionless.
        count: of independent values by channel, which is what noise alone gives, shape (6,).
        motion: sum of squares of the readings about their means in every cycle, in noise variances, dimensionless.
    """

    chi2: Array
    count: Array
    motion: float

    @property
    def excess(self) -> Array:
        """χ² beyond that of noise by channel, shape (6,); below 0 by chance."""
        return np.asarray(self.chi2 - self.count, np.float64)


def misfit(fit: Fit, residuals: Sequence[Array] | None = None) -> ChannelMisfit:
    """What a fit leaves, by channel.

    Args:
        fit: gives the motion.
        residuals: scaled, by run, where they are not those of the fit, each of shape (n,).
    """
    left = fit.residuals if residuals is None else residuals
    parts = [
        _of_run(fit, i, run, own)
        for i, (run, own) in enumerate(zip(fit.problem.data.runs, left, strict=True))
    ]
    chi2, count, motion = (np.sum(values, axis=0) for values in zip(*parts, strict=True))
    return ChannelMisfit(chi2, count, float(motion))


def _of_run(fit: Fit, index: int, run: RunData, left: Array) -> tuple[Array, Array, float]:
    reading = run.scaled(run.reading - fit.zero(index))
    motion = reading - fit.residuals[index]
    cycle = max(_LEAST, round(1.0 / (resonance(fit, index) * run.interval)))
    starts = np.arange(max(1, left.size // cycle)) * cycle
    sizes = np.diff([*starts, left.size])

    def sums(values: Array) -> Array:
        return np.asarray(np.add.reduceat(values, starts), np.float64)

    def centred(values: Array) -> Array:
        return np.asarray(values - np.repeat(sums(values) / sizes, sizes), np.float64)

    along = centred(motion)
    power = np.maximum(sums(along**2), 1e-300)
    slope = centred(np.gradient(motion))
    slope -= along * np.repeat(sums(along * slope) / power, sizes)
    rate_power = np.maximum(sums(slope**2), 1e-300)
    amplitude, amplitude_line = _curve_and_line(sums(along * left) / power, power)
    phase, phase_line = _curve_and_line(sums(slope * left) / rate_power, rate_power)
    zero = float(np.sum(sums(left) ** 2 / sizes))
    known = amplitude + phase + amplitude_line + phase_line + zero
    chi2 = np.array([amplitude, phase, amplitude_line, phase_line, zero, float(left @ left) - known])
    lines = min(starts.size, 2)
    counts = [
        starts.size - lines,
        starts.size - lines,
        lines,
        lines,
        starts.size,
        left.size - 3 * starts.size,
    ]
    return chi2, np.array(counts, np.float64), float(np.sum(centred(reading) ** 2))


def _curve_and_line(values: Array, weights: Array) -> tuple[float, float]:
    """χ² of values about their straight line over the cycles, and of that line."""
    root = np.sqrt(weights)
    columns = np.column_stack([root, root * np.arange(values.size)])
    line = columns @ np.linalg.lstsq(columns, root * values, rcond=None)[0]
    return float(np.sum((root * values - line) ** 2)), float(line @ line)
