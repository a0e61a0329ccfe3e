"""What residuals hold, by channel: in the damping, the frequency, the zero and the harmonics, and between runs.

An error in the damping changes the amplitude of the motion, and one in the stiffness its phase. In every cycle of a
run the residual is split into its part along the motion, its part along the rate, its mean, and the rest. What
changes in proportion to time over a run is a damping or a frequency of the run's own.

An error of the frequency makes χ² large, because phases add up over the cycles. Apart, it does not hide a cause in
the damping, nor the other way round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.run_data import RunData
from diagnosis.fitting.spectra import resonance
from tunnel_sim.vocabulary.record import Array

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
