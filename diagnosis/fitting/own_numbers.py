"""Effects that have a number of their own in every run, found in the residuals of a fit: ringing, and skips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.fitting.least_squares import Fit
from tunnel_sim.effects.base import MULTIPLES, NEAR_MOTION
from tunnel_sim.vocabulary.record import Array

_PADDING = 4  # zero padding of the spectra
_DECAYS = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0)  # of a ringing in one run, nepers
_EDGE = 8  # blocks at either end of a run in which a skip cannot be told from the release or seen at all


@dataclass(frozen=True, eq=False)
class OwnNumbers:
    """What was found.

    Args:
        values: of the effect's parameters that belong to its textbook form, in their order.
        numbers: of every run its phase (rad) or instant (share of the run), shape (runs,).
        drop: of χ² by taking it out, dimensionless.
    """

    values: tuple[float, ...]
    numbers: Array
    drop: float


def ringing(fit: Fit) -> OwnNumbers | None:
    """The strongest decaying line that starts at the release and has one frequency in all runs.

    Args:
        fit: whose residuals.

    Returns:
        Amplitude (rad), angular frequency (rad/s) and damping ratio with every run's phase; None where no
        frequency is left beside the motion's own.
    """
    runs = fit.problem.data.runs
    step = 1.0 / (_PADDING * max(run.duration for run in runs))
    grid = np.arange(step, 0.4 / max(run.interval for run in runs), step)
    free = np.all([_beside_the_motion(run.reading, run.interval, grid) for run in runs], axis=0)
    if not free.any():
        return None
    shortest = min(run.duration for run in runs)
    tried = [(rate, _amplitudes(fit, grid, rate)) for rate in np.array(_DECAYS) / shortest]
    drops = [np.where(free, np.sum(drop, axis=0), 0.0) for _, (_, drop) in tried]
    best = int(np.argmax([drop.max() for drop in drops]))
    at = int(np.argmax(drops[best]))
    rate, (amplitude, _) = tried[best]
    omega = float(np.hypot(2.0 * np.pi * grid[at], rate))
    found = amplitude[:, at]
    size = float(np.sqrt(np.mean(np.abs(found) ** 2)))
    return OwnNumbers((size, omega, float(rate) / omega), np.angle(found), float(drops[best][at]))


def _beside_the_motion(reading: Array, interval: float, grid: Array) -> np.ndarray:
    """Which frequencies of the grid are neither the run's own nor a multiple of it."""
    size = _PADDING * reading.size
    power = np.abs(np.fft.rfft((reading - reading.mean()) * np.hanning(reading.size), size))
    own = float(np.argmax(power)) / (size * interval)
    return np.asarray(np.all([np.abs(grid - k * own) > NEAR_MOTION * own for k in MULTIPLES], axis=0))


def _amplitudes(fit: Fit, grid: Array, rate: float) -> tuple[np.ndarray, Array]:
    """Complex amplitudes (rad) of exp(−rate t) cos on a grid of frequencies (Hz), and the drops of χ², by run."""
    amplitudes, drops = [], []
    for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True):
        decay = np.exp(-rate * run.interval * np.arange(residual.size))
        size = 2 ** int(np.ceil(np.log2(2 * _PADDING * residual.size)))
        transform = np.conj(np.fft.rfft(residual * decay, size))
        index = np.round(grid * size * run.interval).astype(int)
        power = float(decay @ decay)
        found = 2.0 * np.conj(transform[index]) / power
        amplitudes.append(found * np.sqrt(run.noise_variance) / run.response(grid))
        drops.append(0.5 * np.abs(found) ** 2 * power)
    return np.array(amplitudes), np.array(drops)


def skip(fit: Fit) -> OwnNumbers | None:
    """The instants at which the runs jump ahead by one common time.

    Args:
        fit: whose residuals.

    Returns:
        The time lost (s) with every run's instant; None where no run is long enough.
    """
    found = [_run_skip(fit, number) for number in range(len(fit.problem.data.runs))]
    if any(run is None for run in found):
        return None
    times, weights, numbers = (np.array(column) for column in zip(*filter(None, found), strict=True))
    lost = float(np.sum(times * weights) / np.sum(weights))
    return OwnNumbers((max(lost, 0.0),), numbers, float(np.sum(times**2 * weights)))


def _run_skip(fit: Fit, number: int) -> tuple[float, float, float] | None:
    """Time lost (s), its weight (1/s²) and the instant of one run, by linear theory.

    The reading from block k on changes by the rate of the motion for every second lost. What the run's own
    sensitivities absorb of that is taken out for all k at once by sums from the end.
    """
    run, residual = fit.problem.data.runs[number], fit.residuals[number]
    if residual.size < 4 * _EDGE:
        return None
    basis = np.linalg.qr(np.column_stack(fit.jacobian[number]))[0]
    slope = run.scaled(np.gradient(run.reading - run.unscaled(residual), run.interval))
    left = residual - basis @ (basis.T @ residual)

    def after(values: Array) -> Array:
        """Sums from each block to the last."""
        return np.asarray(np.cumsum(values[::-1], axis=0)[::-1], np.float64)

    along = after(slope * left)
    power = after(slope**2) - np.sum(after(slope[:, None] * basis) ** 2, axis=1)
    inside = slice(_EDGE, residual.size - _EDGE)
    weight = np.maximum(power[inside], 1e-9 * float(slope @ slope))
    times = np.maximum(along[inside], 0.0) / weight
    best = int(np.argmax(times**2 * weight))
    instant = (best + _EDGE) * run.interval / run.duration
    return float(times[best]), float(weight[best]), float(instant)
