"""Jumps of a run's oscillation at an instant, and starts that are not free, from its reading alone.

A blow changes angle and rate of a free decay at once. Causes change the amplitude, frequency and harmonics
along the decay, but smoothly. Around every instant, the reading over a few cycles is therefore fitted twice: by
smooth harmonics of the run's own oscillation, with a kink allowed at the instant, and then with a jump of the
oscillation as well. No model of the rig is needed, so a large gap from any cause does not hide a blow. A body
that is held when the record starts departs from the same harmonics, continued to the start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.special import fdtrc

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from tunnel_sim.vocabulary.quantities import Angles, Vector
from tunnel_sim.vocabulary.record import Array

_ROWS = 24  # rows per cycle to which readings are averaged: nothing above the third harmonic is fitted
_HALF = 2.0  # fitted cycles on either side of an instant; closer to an end no jump is sought
_APART = 0.25  # cycles between the instants
_FEWEST = 6.0  # cycles of a run in which jumps are sought
_SMOOTH, _SLOW = 4, 2  # orders of the slow change of amplitude and phase, first and later
_ROUNDS = 3  # rounds of finding that change, each from the previous one
_COLUMNS = 23  # number of columns of `_Oscillation.around`
#: Indices of the columns that are not continued to a start: fast changes and kinks of both waves, and the jump.
_OF_JUMPS = (5, 6, 10, 11, 20, 21)
_AT_ONCE = 200  # maximum number of instants, which bounds the memory
_FREE = 0.015  # root mean square departure of the start over the swing that every run may have
_HELD = 3  # cycles in which a start that is not free is sought
_CLEAR = 4.0  # minimum amplitude of such a start, in noise standard deviations
_QUARTILE = 0.575  # the lower quartile of χ² with two degrees of freedom


@dataclass(frozen=True, eq=False)
class Jumps:
    """Evidence for a jump of a run's oscillation, by instant.

    Args:
        id: of the run.
        time: the instants since the start of the fitted part, shape (n,), s.
        drop: drop of χ² by a jump of amplitude and phase, shape (n,), in the variance of the noise, of the
            departure from smooth harmonics around the instant, or of the run's other jumps, whichever is
            largest.
        chance: probability of as large a drop at that instant by chance, shape (n,).
    """

    id: str
    time: Array
    drop: Array
    chance: Array


@dataclass(frozen=True, eq=False)
class _Oscillation:
    """A run's reading in rows, in noise standard deviations, and the slow change of its oscillation.

    Args:
        time: time of every row, shape (n,), s.
        size: logarithm of the amplitude, shape (n,).
    """

    time: Array
    reading: Vector
    phase: Angles
    size: Array

    @property
    def cycles(self) -> Array:
        """Cycles since the first row, shape (n,)."""
        return np.asarray((self.phase - self.phase[0]) / (2.0 * np.pi))

    @classmethod
    def of(cls, fit: Fit, index: int) -> _Oscillation:
        """The oscillation of a run, with the frequency and decay of a fit as first values."""
        run, frequency = fit.problem.data.runs[index], resonance(fit, index)
        inertia, damping, _ = linear_coefficients(fit, index)
        group = max(1, round(1.0 / (frequency * run.interval * _ROWS)))
        count = run.reading.size // group
        time = np.asarray((np.arange(count) + 0.5) * group * run.interval)
        rows = run.reading[: count * group].reshape(count, group).mean(axis=1)
        rows *= np.sqrt(group) / float(run.noise_at(frequency))
        found = cls(time, rows, 2.0 * np.pi * frequency * time, -0.5 * damping / inertia * time)
        for turn in range(_ROUNDS):
            found = found._followed(_SLOW if turn == 0 else _SMOOTH)
        return found

    def _followed(self, order: int) -> _Oscillation:
        """The oscillation with phase and amplitude that follow the reading, as polynomials of time."""
        cycles = self.cycles
        places = np.arange(0.5, cycles[-1] - 0.4, 0.5)
        if places.size == 0:
            return self
        rows, inside = _windows(cycles, places, 1.0, 6)
        mean = np.sum(self.size[rows] * inside, axis=1) / np.maximum(inside.sum(axis=1), 1)
        since, phase = cycles[rows] - places[:, None], self.phase[rows]
        size = np.exp(np.where(inside, self.size[rows] - mean[:, None], 0.0))
        cos, sin = size * np.cos(phase), size * np.sin(phase)
        columns = [np.ones_like(since), since, cos, -sin, cos * since, -sin * since, self.reading[rows]]
        triangle = _triangle(np.stack(columns, axis=-1) * inside[..., None])
        found = np.linalg.pinv(triangle[:, :6, :6]) @ triangle[:, :6, 6:]
        own = found[:, 2, 0] + 1j * found[:, 3, 0]
        amplitude, phases = np.abs(own), np.angle(own)
        sizes = np.log(np.maximum(amplitude, 1e-300)) - mean
        clear = amplitude > max(_CLEAR, 0.01 * amplitude.max(initial=0.0))
        if np.count_nonzero(clear) < 3 * order:
            return self
        weights = np.minimum(amplitude[clear] / amplitude[clear].max(), 0.3)
        at = 2.0 * places[clear] / cycles[-1] - 1.0
        everywhere = np.clip(2.0 * cycles / cycles[-1] - 1.0, -1.0, at[-1])
        change = [
            chebyshev.chebval(everywhere, chebyshev.chebfit(at, values, order, w=weights))
            for values in (np.unwrap(phases[clear]), sizes[clear])
        ]
        return _Oscillation(self.time, self.reading, self.phase + change[0], self.size + change[1])

    def around(self, instants: Array) -> tuple[Array, Array]:
        """Around instants (cycles): the smooth harmonics, the jump and the reading, in columns.

        Returns:
            The columns, shape (m, rows, n), with rows of zeros after the last one of an instant, and the number of
            rows of every instant, shape (m,).
        """
        rows, inside = _windows(self.cycles, instants, _HALF, _COLUMNS)
        since, phase = (self.cycles[rows] - instants[:, None]) / _HALF, self.phase[rows]
        size = np.exp(self.size[rows] - self.size[rows[:, :1]])
        waves = [size * np.cos(phase), size * np.sin(phase)]
        columns = [np.ones_like(since), since]
        for wave in waves:
            columns += [wave * since**power for power in range(4)]
            columns.append(wave * np.maximum(since, 0.0))
        for harmonic in (2, 3):
            for turn in (np.cos, np.sin):
                wave = size**harmonic * turn(harmonic * phase)
                columns += [wave, wave * since]
        columns += [wave * (since > 0.0) for wave in waves]
        return np.stack([*columns, self.reading[rows]], axis=-1) * inside[..., None], inside.sum(axis=1)


def _windows(
    cycles: Array, centres: Array, half: float, fewest: int
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The rows within half a width of centres, padded to the longest window, and a mask of the true rows.

    Args:
        fewest: minimum number of rows of a window.
    """
    order = np.argsort(cycles, kind="stable")
    first = np.searchsorted(cycles, centres - half, sorter=order)
    count = np.searchsorted(cycles, centres + half, side="right", sorter=order) - first
    place = np.arange(max(fewest, int(count.max())))
    return order[np.minimum(first[:, None] + place, cycles.size - 1)], place < count[:, None]


def jumps(fit: Fit) -> list[Jumps]:
    """The jumps of every free decay that is long enough.

    Args:
        fit: fit of the nominal model; its frequencies are close to the runs'.
    """
    return [found for index in range(len(fit.problem.data.runs)) if (found := _of_run(fit, index))]


def starts(fit: Fit) -> list[Jumps]:
    """The departure of the first cycles of every free decay from the harmonics of the next three cycles.

    Args:
        fit: as in `jumps`.

    Returns:
        As jumps at the start of these cycles. Causes that act at large amplitudes make all runs depart by a
        similar share of the swing, so the drop is the power of the departure in units of `_FREE` of the swing.
    """
    found = []
    for index, run in enumerate(fit.problem.data.runs):
        motion = _motion(fit, index)
        if motion is None:
            continue
        begins = np.arange(min(float(_HELD), motion.cycles[-1] - 2.0 * _HALF))
        columns, count = motion.around(begins + _HALF)
        seen = [_departure(one[:rows]) for one, rows in zip(columns, count.tolist(), strict=True)]
        share, chance = np.array(seen).T
        found.append(Jumps(run.id, np.interp(begins, motion.cycles, motion.time), share / _FREE**2, chance))
    return found


def _departure(columns: Array) -> tuple[float, float]:
    """The departure of the first cycle of a window, beyond its noise, as a share of the power, and its chance."""
    since = _HALF * columns[:, 1]
    columns = np.delete(columns, _OF_JUMPS, axis=1)
    later = columns[since >= 1.0 - _HALF]
    left, whole = (float(_triangle(part[None])[0, -1, -1] ** 2) for part in (later, columns))
    early, freedom = len(columns) - len(later), max(len(later) - columns.shape[1] + 1.0, 1.0)
    level, departure = max(left / freedom, 1.0), (whole - left) / early
    share = max(departure - level, 0.0) / float(np.var(columns[:, -1]))
    return share, float(fdtrc(early, freedom, departure / level))


def _of_run(fit: Fit, index: int) -> Jumps | None:
    run, motion = fit.problem.data.runs[index], _motion(fit, index)
    if motion is None:
        return None
    cycles = motion.cycles
    instants = np.arange(_HALF, cycles[-1] - _HALF, _APART)
    parts = np.array_split(instants, 1 + instants.size // _AT_ONCE)
    drop, left, freedom = np.concatenate([_compared(motion, part) for part in parts], axis=1)
    everywhere = float(np.quantile(drop, 0.25)) / _QUARTILE
    scaled = drop / np.maximum(np.maximum(left, everywhere), 1.0)
    # the tail of F with two degrees of freedom
    chance = (1.0 + scaled / freedom) ** (-0.5 * freedom)
    return Jumps(run.id, np.interp(instants, cycles, motion.time), scaled, chance)


def _motion(fit: Fit, index: int) -> _Oscillation | None:
    """The oscillation of a run; None if it is driven, too short, or sampled too rarely for its harmonics."""
    run, frequency = fit.problem.data.runs[index], resonance(fit, index)
    if run.drive is not None or run.reading.size * run.interval * frequency < _FEWEST:
        return None
    if run.interval * frequency * _ROWS > 2.0:
        return None
    motion = _Oscillation.of(fit, index)
    cycles = motion.cycles
    return motion if cycles[-1] > _FEWEST and np.all(np.diff(cycles) > 0.0) else None


def _triangle(columns: Array) -> Array:
    """R of the QR decomposition of each matrix of a stack, shape (m, rows, n)."""
    return np.asarray(np.linalg.qr(columns, mode="r"))


def _compared(motion: _Oscillation, instants: Array) -> Array:
    """By instant, the drop of χ², the residual χ² per degree of freedom, and their number, shape (3, m)."""
    columns, count = motion.around(instants)
    # the last column in the orthonormal basis of the columns before it
    reading = _triangle(columns)[..., -1] ** 2
    freedom = np.maximum(count - _COLUMNS + 1.0, 1.0)
    return np.stack([reading[:, -3] + reading[:, -2], reading[:, -1] / freedom, freedom])
