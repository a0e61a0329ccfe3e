"""Effects with their own parameters in every run, found in the residuals: phases, and instants of skips."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import fdtrc

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.mains_lines import mains_line
from diagnosis.likelihood.residuals import SpectralLine, linear_coefficients, resonance, wind_line
from tunnel_sim.effects.base import HARMONICS, NEAR_MOTION, REFERENCE_RELEASE, beats_with
from tunnel_sim.effects.evidence import Sought
from tunnel_sim.vocabulary.record import Array

MODE_RUNS: Final = 0.5
"""Minimum share of the runs in which a second mode must be distinct from the motion. Convention."""

FLOOR_CYCLES: Final = 4.0
"""Width of the band beside a ringing in which the floor of the noise is measured, in cycles in a run. Judgement.
A few independent frequencies in every run."""
FLOOR_SHARE: Final = 0.05
"""Further width of this band, as a share of the ringing's frequency. Judgement. The half-width of a resonance with
a damping ratio of 0.05."""

_RINGING_PADDING = 4  # zero padding of the spectra
_DECAYS = (0.0, 1.0, 3.0, 10.0, 30.0, 100.0)  # of a ringing in one run, nepers
_MOST_SKIPS, _SWEEPS = 3, 4  # skips sought in a run, and how often each is sought again beside the others
_ROUNDS = 3  # of the search: the first with a time for every skip, the others with the common time
_EDGE = 8  # blocks at either end of a run in which a skip cannot be seen, or distinguished from the release


@dataclass(frozen=True, eq=False)
class ResidualsOf:
    """The residuals of a fit, searched by effects (`tunnel_sim.effects.evidence.Residuals`)."""

    fit: Fit

    def mains_line(self) -> Sought | None:
        """As `diagnosis.likelihood.mains_lines.mains_line`."""
        return _of_line(mains_line(self.fit))

    def wind_line(self, least: float, greatest: float, size: str) -> Sought | None:
        """As `diagnosis.likelihood.residuals.wind_line`.

        Args:
            least: frequency times size over wind speed, dimensionless.
            greatest: upper bound of the same ratio, dimensionless.
        """
        return _of_line(wind_line(self.fit, least, greatest, size))

    def ringing(self) -> Sought | None:
        """As `ringing`."""
        return ringing(self.fit)

    def excited(self) -> Sought | None:
        """As `excited`."""
        return excited(self.fit)

    def skips(self, *, with_input: bool) -> Sought | None:
        """As `skip`."""
        return skip(self.fit, with_input=with_input)


def _of_line(line: SpectralLine | None) -> Sought | None:
    return None if line is None else Sought((line.amplitude, line.parameter), line.phases, line.drop)


def ringing(fit: Fit) -> Sought | None:
    """The strongest decaying line that starts at the release and has one frequency in all runs.

    Returns:
        Amplitude (rad), angular frequency (rad/s) and damping ratio with every run's phase; None where no
        frequency is distinct from the motion.

    A run does not count where the frequency does not beat with its own motion, or is a multiple of it. At least
    half of the runs must count: springs and winds differ, so a line at the motion of one run is apart in another.
    """
    runs = fit.problem.data.runs
    step = 1.0 / (_RINGING_PADDING * max(run.duration for run in runs))
    grid = np.arange(step, 0.4 / max(run.interval for run in runs), step)
    apart = []  # by run, where the grid is neither the run's own frequency nor a multiple of it
    for run in runs:
        padded = _RINGING_PADDING * run.reading.size
        # the start counts most: a second mode may outlast the motion
        swing = (run.reading - run.reading.mean()) * np.hanning(2 * run.reading.size)[run.reading.size :]
        own = float(np.argmax(np.abs(np.fft.rfft(swing, padded)))) / (padded * run.interval)
        harmonic = np.any([np.abs(grid - k * own) <= NEAR_MOTION * own for k in HARMONICS], axis=0)
        apart.append(beats_with(grid, own, run.duration) & ~harmonic)
    beside = np.array(apart)
    free = np.mean(beside, axis=0) >= MODE_RUNS
    if not free.any():
        return None
    shortest = min(run.duration for run in runs)
    tried, drops = [], []
    for rate in np.array(_DECAYS) / shortest:
        # complex amplitudes (rad) of exp(−rate t) cos on the grid, and the drops of χ², by run
        amplitudes, by_run = [], []
        for run, residual in zip(runs, fit.residuals, strict=True):
            decay = np.exp(-rate * run.interval * np.arange(residual.size))
            size = 2 ** int(np.ceil(np.log2(2 * _RINGING_PADDING * residual.size)))
            transform = np.conj(np.fft.rfft(residual * decay, size))
            index = np.round(grid * size * run.interval).astype(int)
            power = float(decay @ decay)
            amplitude = 2.0 * np.conj(transform[index]) / power
            amplitudes.append(amplitude * run.noise.scale / run.response(grid))
            by_run.append(0.5 * np.abs(amplitude) ** 2 * power)
        tried.append((rate, np.array(amplitudes)))
        drops.append(np.where(free, np.sum(np.array(by_run) * beside, axis=0), 0.0))
    best = int(np.argmax([drop.max() for drop in drops]))
    at = int(np.argmax(drops[best]))
    rate, amplitude = tried[best]
    exponent = complex(-rate, 2.0 * np.pi * grid[at])
    omega = abs(exponent)
    found = amplitude[:, at] / exponent ** runs[0].derivative
    mean = float(np.sqrt(np.mean(np.abs(found[beside[:, at]]) ** 2)))
    return Sought((mean, omega, float(rate) / omega), np.angle(found), float(drops[best][at]))


def ringing_p_value(fit: Fit, line: Sought) -> float:
    """P-value of a ringing at its frequency, on the floor of the noise next to it.

    A mode that the release excites stands on the floor, in still air too. Noise with a resonance is as strong next
    to its strongest line, and vortices need the wind.

    Args:
        line: from `ringing`.
    """
    _, omega, damping = line.values
    frequency, drops, floor = omega / (2.0 * np.pi), list[float](), list[Array]()
    data = fit.problem.data
    still = {run.id for run in data.in_still_air or data.runs}
    for number, (run, residual) in enumerate(zip(data.runs, fit.residuals, strict=True)):
        if run.id not in still:
            continue
        time_s = run.interval * np.arange(residual.size)
        wave = np.exp(omega * (1j - damping) * time_s)
        basis = np.stack([wave.real, wave.imag], axis=1)
        rest = residual - basis @ np.linalg.lstsq(basis, residual, rcond=None)[0]
        drops.append(float(residual @ residual - rest @ rest))
        cycles = np.fft.rfftfreq(residual.size, run.interval) - frequency
        away = np.sign(frequency - resonance(fit, number)) * cycles * run.duration
        power = np.abs(np.fft.rfft(rest)) ** 2 / residual.size
        floor.append(power[(away >= 1.0) & (away <= FLOOR_CYCLES + FLOOR_SHARE * frequency * run.duration)])
    level = np.concatenate(floor)
    mean = max(float(np.mean(level)), 1.0) if level.size else 1.0
    free = 2.0 * len(drops)
    return float(fdtrc(free, max(2.0 * level.size, 1.0), sum(drops) / (free * mean)))


_DAMPINGS = (0.003, 0.01, 0.03, 0.1)  # of a mode that the input excites
_APART = 0.02  # frequencies tried, relative: within the half-power width of the dampings, or near it


def excited(fit: Fit) -> Sought | None:
    """The strongest oscillation, distinct from the motion, that the input excites from rest, common to all runs.

    Returns:
        Amplitude (rad), angular frequency (rad/s) and damping ratio, with phases of 0, which are unused in
        driven runs; None where no run on a spring is driven, or no frequency is distinct from the motion.
    """
    runs, own = fit.problem.data.runs, []
    # by length and interval, on which a mode's response depends: the frequencies, and sums over the runs of the
    # products of the input's spectrum with the residual's and with itself
    sums: dict[tuple[int, float], tuple[Array, np.ndarray, Array]] = {}
    for number, run in enumerate(runs):
        stated = fit.problem.stated(fit.point.common, fit.point.per_run[number], run)
        if run.drive is None or stated.drive is None or not stated.spring_stiffness > 0.0:
            continue
        size = 2 ** int(np.ceil(np.log2(2 * run.reading.size)))
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(size, run.interval), np.float64)
        # of the mode per rad of its amplitude, as far below its frequency
        static = run.input_means * stated.drive.scale / (REFERENCE_RELEASE * stated.spring_stiffness)
        seen = np.fft.rfft(static, size) * (1j * omega) ** run.derivative
        seen *= run.response(omega / (2.0 * np.pi)) / run.noise.scale
        seen *= np.sqrt(2.0 / size)
        left = np.conj(seen) * np.fft.rfft(fit.residuals[number], size) * np.sqrt(2.0 / size)
        _, product, power = sums.get((size, run.interval), (omega, 0.0, 0.0))
        sums[size, run.interval] = omega, product + left, power + np.abs(seen) ** 2
        own.append(2.0 * np.pi * resonance(fit, number))
    if not sums:
        return None
    grid = np.exp(
        np.arange(np.log(0.1 * min(own)), np.log(0.8 * np.pi / max(r.interval for r in runs)), _APART)
    )
    beside = np.mean([np.abs(grid / one - 1.0) > NEAR_MOTION for one in own], axis=0)
    grid = grid[beside >= MODE_RUNS]
    found = Sought((0.0, 1.0, 0.0), np.zeros(len(runs)), 0.0)
    for frequency in grid.tolist():
        for damping_ratio in _DAMPINGS:
            product = power = 0.0
            for omega, left, seen in sums.values():
                turn = omega / frequency
                mode = 1.0 / (1.0 - turn**2 + 2j * damping_ratio * turn)
                product += float(np.vdot(mode, left).real)
                power += float((np.abs(mode) ** 2) @ seen)
            if product**2 / power > found.drop:
                values = abs(product) / power, frequency, damping_ratio
                sign = float(np.sign(product))
                found = replace(found, values=values, drop=product**2 / power, of_input=sign)
    return found if found.of_input else None


def skip(fit: Fit, *, with_input: bool = False) -> Sought | None:
    """The instants at which the runs jump ahead by one common time.

    Args:
        with_input: whether the input of driven runs jumps too, so that only their state changes at once; else
            the reading is late from there on, as in free decays.

    Returns:
        The time lost (s) with every run's instants, as many as χ² supports; None where no run is long enough,
        or none has an input that could jump.
    """
    data = fit.problem.data
    runs = [_Skipping(fit, number, with_input=with_input) for number in range(len(data.runs))]
    if any(run.left.size < 4 * _EDGE for run in runs) or (with_input and not data.driven):
        return None
    found = []
    for count in range(1, _MOST_SKIPS + 1):  # number of skips in every run, all of one time
        steps, lost = [run.steps(count) for run in runs], 0.0
        for number in range(_ROUNDS):
            if number > 0:  # two skips close together are one of twice the time and an empty one
                steps = [run.steps(count, of_run, lost) for run, of_run in zip(runs, steps, strict=True)]
            times, weights = (
                np.array([[getattr(step, name) for step in of_run] for of_run in steps])
                for name in ("time", "weight")
            )
            lost = max(float(np.sum(times * weights) / np.sum(weights)), 0.0)
        drop = sum(run.drop(of_run, lost) for run, of_run in zip(runs, steps, strict=True))
        shares = [[run.share(step) for step in of_run] for run, of_run in zip(runs, steps, strict=True)]
        found.append(Sought((lost * count,), np.array(shares), drop))
    # of an instant, which is sought among as many blocks
    cost = 2.0 * sum(np.log(run.left.size) for run in runs)
    best = max(found, key=lambda one: one.drop - cost * one.numbers.shape[1])
    return replace(best, of_input=float(data.driven and not with_input))


@dataclass(frozen=True)
class _Skip:
    """A skip in one run: its block, the time lost (s) and the weight of that (1/s²)."""

    block: int
    time: float
    weight: float


class _Skipping:
    """Search for skips in one run, by linear theory.

    A second lost at block k adds to the reading of a later block t a sum over j of a_j(k) b_j(t) z_j^(t−k):

    - where the reading alone jumps, and in free decays: the rate of the motion at t;
    - where the input jumps too: the free motion that begins with the rate and the acceleration at k.

    The residual changes by that sum after the whitening filter. The part absorbed by the run's own
    sensitivities is removed for all k at once by sums from the end.
    """

    def __init__(self, fit: Fit, number: int, *, with_input: bool) -> None:
        run, residual = fit.problem.data.runs[number], fit.residuals[number]
        self.run = run
        self.basis = np.linalg.qr(np.column_stack(fit.jacobian[number]))[0]
        rate = np.gradient(run.reading - run.unscaled(residual), run.interval)
        scale = np.sqrt(run.counts / run.block) / run.noise.scale
        # a at the skip, b after it, z; not whitened
        self.terms: list[tuple[np.ndarray, np.ndarray, complex]] = [(np.ones(rate.size), rate, 1.0)]
        if with_input and run.drive is not None:
            inertia, damping, stiffness = linear_coefficients(fit, number)
            one, other = np.roots([inertia, damping, stiffness]) + np.array([0.0, 1e-9j])  # not equal
            more = np.gradient(rate, run.interval)
            self.terms = [
                ((more - second * rate) / (first - second), np.ones(rate.size), np.exp(first * run.interval))
                for first, second in ((one, other), (other, one))
            ]
        self.powers = [z ** np.arange(rate.size) for *_, z in self.terms]
        self._known: dict[int, Array] = {}
        self.scale = np.asarray(scale, np.float64)
        self.left = self._unabsorbed(residual)
        power = self._powers() - np.sum(self._seen(run.noise.transposed(self.basis)) ** 2, axis=1)
        self.weight = np.maximum(power, 1e-9 * float(np.sum((self.scale * rate) ** 2)))

    def steps(self, count: int, found: list[_Skip] | None = None, time: float | None = None) -> list[_Skip]:
        """The skips of least residual, each sought again beside the others.

        Args:
            found: where the search starts; None: without any.
            time: lost at every skip, s; None: each skip has its own.
        """
        found = list(found or [])
        inside = slice(_EDGE, self.left.size - _EDGE)
        weight = self.weight[inside]
        for _ in range(1 if count == 1 else _SWEEPS):
            for place in range(count):
                others = found[:place] + found[place + 1 :]
                change = self._change([(step, step.time if time is None else time) for step in others])
                seen = self._seen(self.run.noise.transposed(self.left - change))[inside]
                own = seen / weight
                lost = np.maximum(own, 0.0) if time is None else time
                best = int(np.argmax(lost * (2.0 * seen - lost * weight)))
                found[place : place + 1] = [_Skip(best + _EDGE, float(own[best]), float(weight[best]))]
        return found

    def drop(self, steps: list[_Skip], time: float) -> float:
        """Drop of χ² by skips of one time (s)."""
        left = self.left - self._change([(step, time) for step in steps])
        return float(self.left @ self.left - left @ left)

    def share(self, step: _Skip) -> float:
        """Instant of a skip, as a share of the run."""
        return float(step.block * self.run.interval / self.run.duration)

    def _change(self, steps: list[tuple[_Skip, float]]) -> Array:
        return sum((time * self._by_second(step.block) for step, time in steps), np.zeros(self.left.size))

    def _by_second(self, block: int) -> Array:
        """The unabsorbed change of the residual by a second lost at a block, which is sought again and again."""
        if block not in self._known:
            after, added = slice(block, None), np.zeros(self.left.size)
            added[after] = sum(
                (a[block] * b[after] * power[: self.left.size - block]).real
                for (a, b, _), power in zip(self.terms, self.powers, strict=True)
            )
            self._known[block] = self._unabsorbed(self.run.scaled(added))
        return self._known[block]

    def _seen(self, whitened: Array) -> Array:
        """Products of the change by a second lost at every block with values after the transposed filter."""
        columns = whitened.reshape(len(whitened), -1)
        found = sum(
            (a[:, None] * _after((b * self.scale)[:, None] * columns, z)).real for a, b, z in self.terms
        )
        return np.asarray(found, np.float64).reshape(whitened.shape)

    def _powers(self) -> Array:
        """Powers of the change by a second lost at every block."""
        if len(self.terms) == 1:
            # the sum from any value to the last is the power of the whitened slope from there on
            return self.run.noise.powers_onward(np.real(self.terms[0][1] * self.scale))
        size = self.left.size
        white = self.run.noise.white
        free = [power / self.run.noise.scale for power in self.powers]
        whitened = [white(np.real(one)) + 1j * white(np.imag(one)) for one in free]
        power = np.zeros(size)
        for (a, _, _), one in zip(self.terms, whitened, strict=True):
            for (other_a, _, _), other in zip(self.terms, whitened, strict=True):
                # of the first blocks after the skip, as many as follow it
                power += (a * np.conj(other_a) * np.cumsum(one * np.conj(other))[::-1]).real
        return power

    def _unabsorbed(self, values: Array) -> Array:
        return np.asarray(values - self.basis @ (self.basis.T @ values), np.float64)


def _after(values: np.ndarray, factor: complex) -> np.ndarray:
    """Sums from each block to the last, each later block multiplied by one more power of a factor."""
    if factor == 1.0:
        return np.cumsum(values[::-1], axis=0)[::-1]
    from scipy.signal import lfilter  # only here: slow to load

    found: np.ndarray = lfilter([1.0], [1.0, -factor], values[::-1], axis=0)[::-1]
    return found
