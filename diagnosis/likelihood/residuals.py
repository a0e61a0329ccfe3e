"""Spectral lines of residuals, and the misfit by channel.

A damping error changes the amplitude of the motion, and a stiffness error its phase. In every cycle the
residual is therefore split into its part along the motion, its part along the rate, its mean, and the rest. A
part that grows linearly over a run is a damping or a frequency specific to the run. A frequency error makes χ²
large, because phases add up; a separate channel keeps it from hiding a cause in the damping.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.run_data import RunData
from tunnel_sim.vocabulary.caching import cached_while_in_use
from tunnel_sim.vocabulary.quantities import Frequencies, Hertz, Seconds
from tunnel_sim.vocabulary.record import Array

_PADDING = 8  # zero padding: lines are located to a small part of a bin


@dataclass(frozen=True, eq=False)
class ResidualSpectrum:
    """A run's residual spectrum.

    Args:
        transform: complex amplitude of a sine at that frequency, in noise standard deviations, shape (n,).
        count: number of residuals in the record.
    """

    frequency: Frequencies
    transform: np.ndarray
    duration: Seconds
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
        frequency = np.asarray(np.fft.rfftfreq(size, run.interval), np.float64)
        spectra.append(ResidualSpectrum(frequency, transform, run.duration, residual.size))
    return spectra


@dataclass(frozen=True)
class SpectralLine:
    """A line found in the spectra.

    Args:
        parameter: frequency in Hz for the mains, Strouhal number for shedding.
        drop: drop of χ² when the line is removed from the runs concerned, dimensionless.
        contrast: ratio of the drop at the line to the drop beside it (the greatest drop for the mains, the
            median for shedding).
        amplitude: rad at the sensor for the mains, moment coefficient for shedding.
        phases: of sine, rad, by run, shape (runs,); zero for runs not concerned.
    """

    parameter: float
    drop: float
    contrast: float
    amplitude: float
    phases: Array


def smooth_spectra(fit: Fit) -> list[ResidualSpectrum]:
    """`residual_spectra` with a Hann window, so that leakage from the motion does not reach the mains."""
    found, step = [], _PADDING
    for spectrum in residual_spectra(fit):
        values = spectrum.transform
        hann = 0.5 * values.copy()  # the window is applied in the frequency domain
        hann[step:-step] -= 0.25 * (values[: -2 * step] + values[2 * step :])
        found.append(dataclasses.replace(spectrum, transform=hann * np.sqrt(8.0 / 3.0)))
    return found


def block_gain(frequency: Hertz, run: RunData) -> float:
    """Gain of a run's block mean at a frequency, dimensionless; 1 where a block is one sample."""
    x = np.pi * frequency * run.interval / run.block
    return float(np.sin(run.block * x) / (run.block * np.sin(x))) if run.block > 1 else 1.0


def wind_line(fit: Fit, least: float, greatest: float, size: str) -> SpectralLine | None:
    """The strongest line of a moment with a frequency proportional to the wind speed, in all wind-on runs.

    Args:
        least: least frequency times size over wind speed, dimensionless; a Strouhal number where the size is
            the width.
        greatest: upper bound on the same ratio, dimensionless.
        size: ``width`` or ``length`` of the body.

    Returns:
        None without wind, or where the size is not stated.
    """
    data = fit.problem.data
    concerned = [i for i, run in enumerate(data.runs) if run.wind_on]
    metres = {"width": data.width, "length": data.reference_length}[size]
    if not concerned or metres <= 0.0:
        return None
    spectra = residual_spectra(fit)
    chains = [fit.problem.chain(fit.point.common, fit.point.per_run[i], data.runs[i]) for i in concerned]
    speeds = np.array([chain.physics().wind_speed for chain in chains])  # corrected by the effects of the fit
    spacing = 0.1 * metres / (float(speeds.max()) * max(data.runs[i].duration for i in concerned))
    grid = np.arange(least, greatest, spacing)
    powers, limited = [], []
    for i, speed in zip(concerned, speeds, strict=True):
        own = resonance(fit, i)
        frequency = grid * speed / metres
        power = spectra[i].power(frequency)
        power[np.abs(frequency / own - 1.0) < 0.08] = 0.0  # the line of the free motion is not evidence
        powers.append(power)
        # no run carries a line alone
        limited.append(np.minimum(power, 10.0 * float(np.quantile(power, 0.99)) + 1.0))
    total = np.sum(limited, axis=0)
    at = int(np.argmax(total))
    best = float(grid[at])
    floor = float(np.median(total)) / np.log(2.0)
    phases = np.zeros(len(data.runs))
    amplitudes = []
    for i, speed in zip(concerned, speeds, strict=True):
        frequency = best * speed / metres
        run = data.runs[i]
        inertia, damping, stiffness = linear_coefficients(fit, i)
        omega = 2.0 * np.pi * frequency
        forced = data.air_moment(run) / (stiffness - inertia * omega**2 + 1j * omega * damping)
        forced = complex(forced * (1j * omega) ** run.derivative)  # reading per unit moment coefficient
        gain = forced / run.noise.scale * run.response(frequency)
        value = complex(spectra[i].at(frequency))
        phases[i] = float(np.angle(value / gain)) + np.pi / 2
        amplitudes.append((abs(value) / abs(gain), abs(gain) ** 2))
    values, weights = np.array(amplitudes).T
    amplitude = float(np.sum(values * weights) / np.sum(weights))
    drop = float(np.sum([power[at] for power in powers]))
    return SpectralLine(best, drop, float(total[at]) / max(floor, 1e-9), amplitude, phases)


def resonance(fit: Fit, run_index: int) -> float:
    """Frequency of a run's free motion in the fitted model, Hz; without a spring, `free_frequency`."""
    inertia, _, stiffness = linear_coefficients(fit, run_index)
    return fit.problem.data.model.frequency(inertia, stiffness)


def linear_coefficients(fit: Fit, run_index: int) -> tuple[float, float, float]:
    """Inertia, damping and stiffness of a run in the fitted model, air and gravity included.

    In kg m², N m s/rad and N m/rad; per unit inertia in normalised form.
    """
    inertia, damping, stiffness = fit.linear[run_index].tolist()
    return inertia, damping, stiffness


CHANNELS = ("damping", "frequency", "damping of runs", "frequency of runs", "zero", "harmonics")
"""The order of the channels in all arrays."""

_LEAST = 4  # samples in a cycle
_SINGULAR = 1e-14  # relative: columns that agree up to rounding


@dataclass(frozen=True, eq=False)
class ChannelMisfit:
    """Misfit of residuals by channel.

    Args:
        chi2: by channel, shape (6,), dimensionless.
        count: expected χ² of noise alone: independent values by channel, shape (6,).
        motion: sum of squares of the readings about their means in every cycle, in noise variances,
            dimensionless.
        scatter_cost: −2 ln of the evidence of the fit's chance differences between runs, dimensionless; 0 where
            the runs repeat.
        deviation_precision: precision of these differences, as in `Between.cost`, shape (runs, kinds, kinds).
        repeats: whether the runs of the fit repeat exactly.
    """

    chi2: Array
    count: Array
    motion: float
    scatter_cost: float = 0.0
    deviation_precision: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    repeats: bool = True

    @property
    def excess(self) -> Array:
        """χ² beyond noise by channel, shape (6,); below 0 by chance."""
        return np.asarray(self.chi2 - self.count, np.float64)


def misfit(fit: Fit, residuals: Sequence[Array] | None = None) -> ChannelMisfit:
    """Misfit of a fit, by channel.

    Args:
        residuals: scaled, by run, each of shape (n,); None: the fit's.
    """
    given = fit.residuals if residuals is None else residuals
    chi2 = [run.channels(left) for run, left in zip(_cycles(fit), given, strict=True)]
    count, powers = [run.count for run in _cycles(fit)], [run.power for run in _cycles(fit)]
    return ChannelMisfit(
        np.sum(chi2, axis=0, dtype=np.float64),
        np.sum(count, axis=0, dtype=np.float64),
        float(np.sum(powers)),
        repeats=not fit.problem.scatter,
    )


def gap_left(fit: Fit) -> ChannelMisfit:
    """The reference of the weights: a fit's misfit, with the cost of chance differences between its runs."""
    if not fit.problem.scatter:
        return misfit(fit)
    precision = fit.columns.products.own
    return dataclasses.replace(
        misfit(fit), scatter_cost=fit.scatter_cost(precision), deviation_precision=precision
    )


@cached_while_in_use  # residuals are split many times
def _cycles(fit: Fit) -> list[_Cycles]:
    """The cycles of every run, in which the channels are computed."""
    return [_Cycles.of(fit, index) for index in range(len(fit.problem.data.runs))]


@dataclass(frozen=True, eq=False)
class _Cycles:
    """The cycles of a run, and the motion in them.

    Args:
        starts: of the cycles, in blocks, shape (cycles,).
        sizes: of the cycles, in blocks, shape (cycles,).
        along: the motion about its mean in every cycle, in noise standard deviations, shape (n,).
        slope: derivative of the motion, orthogonal to ``along``, shape (n,).
        along_power: sum of the squares of ``along`` in every cycle, shape (cycles,).
        slope_power: sum of the squares of ``slope`` in every cycle, shape (cycles,).
        power: sum of squares of the readings about their means in every cycle.
    """

    starts: np.ndarray
    sizes: np.ndarray
    along: Array
    slope: Array
    along_power: Array
    slope_power: Array
    power: float

    @classmethod
    def of(cls, fit: Fit, index: int) -> _Cycles:
        """The cycles of one run of a fit."""
        run = fit.problem.data.runs[index]
        reading = run.scaled(run.reading - fit.zero(index))
        motion = reading - fit.residuals[index]
        cycle = max(_LEAST, round(1.0 / (resonance(fit, index) * run.interval)))
        starts = np.arange(max(1, motion.size // cycle)) * cycle
        sizes = np.diff([*starts, motion.size])
        along = _centred(motion, starts, sizes)
        power = np.maximum(np.add.reduceat(along**2, starts), 1e-300)
        slope = _centred(np.gradient(motion), starts, sizes)
        slope -= along * np.repeat(np.add.reduceat(along * slope, starts) / power, sizes)
        slope_power = np.maximum(np.add.reduceat(slope**2, starts), 1e-300)
        of_reading = float(np.sum(_centred(reading, starts, sizes) ** 2))
        return cls(starts, sizes, along, slope, power, slope_power, of_reading)

    @cached_property
    def count(self) -> list[int]:
        """Number of independent values by channel."""
        cycles, lines = self.starts.size, min(self.starts.size, 2)
        return [cycles - lines, cycles - lines, lines, lines, cycles, self.along.size - 3 * cycles]

    @cached_property
    def _lines(self) -> tuple[Array, Array]:
        """Bases of the straight lines over the cycles, weighted by ``along_power`` and ``slope_power``."""
        return _line_basis(self.along_power), _line_basis(self.slope_power)

    def channels(self, left: Array) -> list[float]:
        """χ² by channel.

        Args:
            left: residuals, in noise standard deviations, shape (n,).
        """
        of_along, of_slope = self._lines
        amplitude, amplitude_line = _curve_and_line(
            np.add.reduceat(self.along * left, self.starts) / np.sqrt(self.along_power), of_along
        )
        phase, phase_line = _curve_and_line(
            np.add.reduceat(self.slope * left, self.starts) / np.sqrt(self.slope_power), of_slope
        )
        zero = float(np.sum(np.add.reduceat(left, self.starts) ** 2 / self.sizes))
        known = amplitude + phase + amplitude_line + phase_line + zero
        return [amplitude, phase, amplitude_line, phase_line, zero, float(left @ left) - known]


def _centred(values: Array, starts: np.ndarray, sizes: np.ndarray) -> Array:
    """Values without their mean in each cycle."""
    return np.asarray(values - np.repeat(np.add.reduceat(values, starts) / sizes, sizes), np.float64)


def _line_basis(weights: Array) -> Array:
    """Orthonormal columns that span weighted straight lines over the cycles, shape (cycles, 2 or fewer)."""
    root = np.sqrt(weights)
    columns = np.column_stack([root, root * np.arange(weights.size)])
    basis, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(basis[:, size > _SINGULAR * size[0]], np.float64)


def _curve_and_line(values: Array, basis: Array) -> tuple[float, float]:
    """χ² of weighted values about their straight line over the cycles, and χ² of the line itself."""
    line = basis.T @ values
    curve = values - basis @ line
    return float(curve @ curve), float(line @ line)
