"""Effects that have a number of their own in every run, found in the residuals of a fit: ringing, and skips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.whitening import correlate
from tunnel_sim.effects.base import IN_RUNS, MULTIPLES, NEAR_MOTION
from tunnel_sim.vocabulary.record import Array

_PADDING = 4  # zero padding of the spectra
_DECAYS = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0)  # of a ringing in one run, nepers
_MOST_SKIPS, _SWEEPS = 3, 4  # skips sought in a run, and how often each is sought again beside the others
_ROUNDS = 3  # of the search: the first with a time for every skip, the others with the one common time found
_EDGE = (
    8  # blocks at either end of a run in which a skip cannot be distinguished from the release or seen at all
)


@dataclass(frozen=True, eq=False)
class PerRunParameters:
    """What was found.

    Args:
        values: of the effect's parameters that belong to its textbook form, in their order.
        numbers: of every run its phase (rad), shape (runs,), or its instants (shares of the run), shape (runs, n).
        drop: of χ² by taking it out, dimensionless.
    """

    values: tuple[float, ...]
    numbers: Array
    drop: float


def ringing(fit: Fit) -> PerRunParameters | None:
    """The strongest decaying line that starts at the release and has one frequency in all runs.

    Returns:
        Amplitude (rad), angular frequency (rad/s) and damping ratio with every run's phase; None where no
        frequency is left beside the motion's own.

    Where a frequency is that of a run's own motion, or a multiple of it, that run does not count. At least half of
    them must: springs and winds differ, and a line that is near the motion of one run is beside that of another.
    """
    runs = fit.problem.data.runs
    step = 1.0 / (_PADDING * max(run.duration for run in runs))
    grid = np.arange(step, 0.4 / max(run.interval for run in runs), step)
    beside = np.array([_beside_the_motion(run.reading, run.interval, grid) for run in runs])
    free = np.mean(beside, axis=0) >= IN_RUNS
    if not free.any():
        return None
    shortest = min(run.duration for run in runs)
    tried = [(rate, _amplitudes(fit, grid, rate)) for rate in np.array(_DECAYS) / shortest]
    drops = [np.where(free, np.sum(drop * beside, axis=0), 0.0) for _, (_, drop) in tried]
    best = int(np.argmax([drop.max() for drop in drops]))
    at = int(np.argmax(drops[best]))
    rate, (amplitude, _) = tried[best]
    exponent = complex(-rate, 2.0 * np.pi * grid[at])
    omega = abs(exponent)
    found = amplitude[:, at] / exponent ** runs[0].derivative
    size = float(np.sqrt(np.mean(np.abs(found[beside[:, at]]) ** 2)))
    return PerRunParameters((size, omega, float(rate) / omega), np.angle(found), float(drops[best][at]))


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


def skip(fit: Fit) -> PerRunParameters | None:
    """The instants at which the runs jump ahead by one common time.

    Returns:
        The time lost (s) with every run's instants, as many as χ² asks for; None where no run is long enough.
    """
    runs = [_Skipping(fit, number) for number in range(len(fit.problem.data.runs))]
    if any(run.left.size < 4 * _EDGE for run in runs):
        return None
    found = [_skips(runs, count) for count in range(1, _MOST_SKIPS + 1)]
    cost = 2.0 * sum(
        np.log(run.left.size) for run in runs
    )  # of an instant, which is sought among as many blocks
    return max(found, key=lambda one: one.drop - cost * one.numbers.shape[1])


def _skips(runs: list[_Skipping], count: int) -> PerRunParameters:
    """So many skips in every run, all of one time."""
    steps, lost = [run.steps(count) for run in runs], 0.0
    for number in range(_ROUNDS):
        if (
            number > 0
        ):  # two skips close together were found as one of twice the time, and another one of nothing
            steps = [run.steps(count, of_run, lost) for run, of_run in zip(runs, steps, strict=True)]
        times, weights = (
            np.array([[getattr(step, name) for step in of_run] for of_run in steps])
            for name in ("time", "weight")
        )
        lost = max(float(np.sum(times * weights) / np.sum(weights)), 0.0)
    drop = sum(run.drop(of_run, lost) for run, of_run in zip(runs, steps, strict=True))
    numbers = np.array(
        [[run.share(step) for step in of_run] for run, of_run in zip(runs, steps, strict=True)]
    )
    return PerRunParameters((lost * count,), numbers, drop)


@dataclass(frozen=True)
class _Skip:
    """A skip in one run: its block, the time lost (s) and the weight of that (1/s²)."""

    block: int
    time: float
    weight: float


class _Skipping:
    """One run, in which skips are sought by linear theory.

    The reading from block k on changes by the rate of the motion for every second lost, and the residual by what
    the whitening filter makes of that. What the run's own sensitivities absorb is taken out for all k at once by
    sums from the end.
    """

    def __init__(self, fit: Fit, number: int) -> None:
        run, residual = fit.problem.data.runs[number], fit.residuals[number]
        self.run = run
        self.basis = np.linalg.qr(np.column_stack(fit.jacobian[number]))[0]
        self.rate = np.gradient(run.reading - run.unscaled(residual), run.interval)
        self.slope = run.unwhitened(self.rate)
        self.left = self._unabsorbed(residual)
        power = _after(_squares(self.slope, run.taps))
        absorbed = _after(self.slope[:, None] * correlate(self.basis, run.taps))
        power -= np.sum(absorbed**2, axis=1)
        self.weight = np.maximum(power, 1e-9 * float(self.slope @ self.slope))

    def steps(self, count: int, found: list[_Skip] | None = None, time: float | None = None) -> list[_Skip]:
        """The skips that leave least, each sought again beside the others.

        Args:
            found: where the search starts; None starts without any.
            time: lost at every skip, s; None for a time of its own at each.
        """
        found = list(found or [])
        for _ in range(1 if count == 1 else _SWEEPS):
            for place in range(count):
                others = found[:place] + found[place + 1 :]
                change = self._change([(step, step.time if time is None else time) for step in others])
                found[place : place + 1] = [self._best(self.left - change, time)]
        return found

    def _best(self, left: Array, time: float | None) -> _Skip:
        inside = slice(_EDGE, left.size - _EDGE)
        weight = self.weight[inside]
        seen = _after(self.slope * correlate(left, self.run.taps))[inside]
        own = seen / weight
        tried = np.maximum(own, 0.0) if time is None else time
        best = int(np.argmax(tried * (2.0 * seen - tried * weight)))
        return _Skip(best + _EDGE, float(own[best]), float(weight[best]))

    def drop(self, steps: list[_Skip], time: float) -> float:
        """Of χ² by skips of one time (s)."""
        left = self.left - self._change([(step, time) for step in steps])
        return float(self.left @ self.left - left @ left)

    def share(self, step: _Skip) -> float:
        """Instant of a skip, as a share of the run."""
        return float(step.block * self.run.interval / self.run.duration)

    def _change(self, steps: list[tuple[_Skip, float]]) -> Array:
        ahead = np.zeros(self.rate.size)
        for step, time in steps:
            ahead[step.block :] += time
        return self._unabsorbed(self.run.scaled(self.rate * ahead))

    def _unabsorbed(self, values: Array) -> Array:
        return np.asarray(values - self.basis @ (self.basis.T @ values), np.float64)


def _after(values: Array) -> Array:
    """Sums from each block to the last."""
    return np.asarray(np.cumsum(values[::-1], axis=0)[::-1], np.float64)


def _squares(values: Array, whitening: Array) -> Array:
    """Of which the sum from any value to the last is the power of the whitened values from there on."""
    lags = np.correlate(whitening, whitening, "full")[whitening.size - 1 :]
    return np.asarray(values * (2.0 * correlate(values, lags) - lags[0] * values), np.float64)
