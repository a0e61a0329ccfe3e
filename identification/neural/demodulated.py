"""A record as windows of whole periods: envelope, phase, zero and two harmonics, with their weights.

The deviations from one damped oscillation are independent from window to window and nearly normal, so the
subsequent fits are linear. Missing samples only reduce the weight of a window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.policy import LEAST_ENERGY
from identification.signal.decay_fit import Reading, block_means
from identification.signal.frequency import starting_frequency
from identification.status import Status
from tunnel_sim.vocabulary.quantities import Times
from tunnel_sim.vocabulary.record import Array, Record

WINDOWS = 32
LEAST_WINDOWS = 4
_PER_CYCLE = 24.0  # minimum number of block means per period
_LEAST_SAMPLES = 12  # number of samples in a window: seven unknowns are fitted to it
_PASSES = 3  # rounds of demodulation, each with the decay of the previous one
_LINEAR = 50.0  # information below which the logarithm of a noisy amplitude is replaced by its linear part
_ROUGH = 1e-6  # least noise over the swing: a hundred times the error of three passes
_SEEN = 0.5  # minimum amplitude over the noise of a window's amplitude for the record to be used


@dataclass(frozen=True, eq=False)
class Demodulated:
    """A record's windows relative to the damped oscillation exp(−rate·t) cos(omega·t).

    Args:
        omega: damped angular frequency of the demodulation, rad/s.
        rate: decay rate of the demodulation, 1/s.
        time: middles of the windows since the first sample, shape (w,), s.
        logarithm: logarithm of the amplitude over the oscillation's, shape (w,).
        phase: relative to the oscillation, shape (w,), rad.
        information: inverse variance of either, shape (w,).
        amplitude: amplitude of the oscillation, shape (w,), rad.
        zero: mean of the reading, shape (w,), rad.
        second: complex amplitude of the second harmonic over the amplitude, in its phase, shape (w,).
        third: the same for the third harmonic, shape (w,).
        noise: standard deviation of a block mean within the windows, rad.
        samples: block means in each window, shape (w,).
        fast_noise: noise between neighbouring samples of the record over white noise of the same level.
        duration: duration of the record, s.
    """

    omega: float
    rate: float
    time: Array
    logarithm: Array
    phase: Array
    information: Array
    amplitude: Array
    zero: Array
    second: Array
    third: Array
    noise: float
    samples: Array
    block: int
    fast_noise: float
    duration: float


@dataclass(frozen=True, eq=False)
class _Windows:
    time: Array
    amplitudes: Array  # complex, one column per harmonic, at the middles, phases from the first sample
    zero: Array
    samples: Array
    noise: float


def demodulate(record: Record) -> Demodulated | Status:
    """Reduce a record to windows; a status if nothing oscillates, or too few periods exceed the noise."""
    frequency = starting_frequency(record)
    if frequency is None:
        return Status.NO_OSCILLATION
    reading, factor = block_means(Reading.from_record(record), frequency, _PER_CYCLE)
    peak = float(np.ptp(reading.yaw))
    omega, rate, span = 2.0 * np.pi * frequency, 0.0, float(reading.time[-1])
    windows = None
    for number in range(_PASSES):
        last = number == _PASSES - 1
        windows = _fit_windows(reading, omega, rate, span, 3 if last else 1)
        if windows is None:
            return Status.TOO_FEW_CYCLES
        sizes = np.abs(windows.amplitudes[:, 0])
        if last:
            break
        # Lines through logarithm and phase: the decay rate, and a correction of the frequency.
        noise = max(windows.noise, _ROUGH * peak)
        weight = windows.samples * np.maximum(sizes, noise) ** 2
        weight[sizes < noise * np.sqrt(2.0 / windows.samples)] *= 1e-3
        centred = (windows.time - float(weight @ windows.time / weight.sum())) * weight
        spread = float(centred @ windows.time)
        rate = -(float(centred @ np.log(np.maximum(sizes, 1e-300))) / spread)
        omega = omega + float(centred @ np.unwrap(np.angle(windows.amplitudes[:, 0]))) / spread
        if not (omega > 0.0 and np.isfinite(rate) and abs(rate) < omega):
            return Status.NO_OSCILLATION
        least = _SEEN * noise * np.sqrt(2.0 / windows.samples.mean())
        if rate > 0.0 and sizes[0] > least:
            span = min(float(reading.time[-1]), max(np.log(sizes[0] / least) / rate, 8.0 * np.pi / omega))
    assert windows is not None
    # Deviations from one oscillation.
    noise = max(windows.noise, _ROUGH * peak)
    first = windows.amplitudes[:, 0]
    weight = windows.samples * np.abs(first) ** 2
    logs = np.log(np.maximum(np.abs(first), 1e-300)) + rate * windows.time
    level = float(weight @ logs / weight.sum())
    line = np.exp(level - rate * windows.time)
    turned = first / line
    turned = turned * np.exp(-1j * float(np.angle(weight @ turned)))
    information = 0.5 * windows.samples * line**2 / noise**2
    if np.abs(information @ turned) ** 2 < LEAST_ENERGY * information.sum():
        return Status.NO_OSCILLATION  # noise has amplitudes in all windows, but no common phase
    clear = information > _LINEAR
    logarithm = np.where(clear, np.log(np.maximum(np.abs(turned), 1e-300)), np.clip(turned.real - 1.0, -3, 3))
    phase = np.where(clear, np.unwrap(np.angle(turned)), np.clip(turned.imag, -3.0, 3.0))
    # A window of equal readings, rounded coarsely, has no phase.
    unit = np.where(first == 0.0, 1.0, first / np.maximum(np.abs(first), 1e-300))
    differences = np.diff(record.yaw_rad, n=2)
    fast = float(np.sqrt(np.mean(differences**2) / 6.0)) if differences.size else 0.0
    return Demodulated(
        omega=omega,
        rate=rate,
        time=windows.time,
        logarithm=logarithm,
        phase=phase,
        information=information,
        amplitude=line,
        zero=windows.zero,
        second=windows.amplitudes[:, 1] / unit**2 / line,
        third=windows.amplitudes[:, 2] / unit**3 / line,
        noise=noise,
        samples=windows.samples,
        block=factor,
        fast_noise=fast / (noise * np.sqrt(factor)),
        duration=record.duration,
    )


def _fit_windows(reading: Reading, omega: float, rate: float, span: float, harmonics: int) -> _Windows | None:
    time = reading.time - reading.time[0]
    count = int(np.clip(omega * span / (2.0 * np.pi), 0, WINDOWS))
    if count < LEAST_WINDOWS:
        return None
    edges = np.searchsorted(time, np.linspace(0.0, span * (1.0 + 1e-12), count + 1))
    sizes = np.diff(edges)
    kept = sizes >= (_LEAST_SAMPLES if harmonics > 1 else 5)
    if kept.sum() < LEAST_WINDOWS:
        return None
    place = np.repeat(np.arange(count), sizes)
    chosen = kept[place]
    place = (np.cumsum(kept) - 1)[place[chosen]]
    time, yaw = time[: edges[-1]][chosen], reading.yaw[: edges[-1]][chosen]
    sizes = sizes[kept]
    starts = np.concatenate(([0], np.cumsum(sizes)[:-1]))
    middle: Array = np.add.reduceat(time, starts) / sizes
    decaying = np.exp(-rate * (time - middle[place]) + 1j * omega * time)
    columns, power = [np.ones_like(time)], np.ones_like(decaying)
    for _ in range(harmonics):
        power = power * decaying
        columns += [power.real, power.imag]
    basis = np.stack(columns)
    size = len(basis)
    upper = np.triu_indices(size)
    gram = np.empty((sizes.size, size, size))
    gram[:, upper[0], upper[1]] = np.add.reduceat(basis[upper[0]] * basis[upper[1]], starts, axis=1).T
    gram[:, upper[1], upper[0]] = gram[:, upper[0], upper[1]]
    gram += 1e-12 * np.eye(size)
    moment = np.add.reduceat(basis * yaw, starts, axis=1).T
    try:
        found = np.linalg.solve(gram, moment[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return None
    residual = yaw - (basis * found.T[:, place]).sum(axis=0)
    freedom = time.size - size * sizes.size
    noise = float(np.sqrt(residual @ residual / max(freedom, 1)))
    amplitudes = found[:, 1::2] - 1j * found[:, 2::2]
    return _Windows(
        middle, np.asarray(amplitudes), np.asarray(found[:, 0], np.float64), sizes.astype(np.float64), noise
    )


Places = NDArray[np.intp]
Column = tuple[Array | None, Array | None]
"""Columns of the logarithm of the amplitude and of the phase; None: zero."""
_FLOOR = 0.02  # minimum amplitude over the first: noise would dominate inverse powers of smaller amplitudes
_POWERS = (-1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0)
_SETTLING = 4.0  # time constants in a record


@dataclass(frozen=True, eq=False)
class RivalWindows:
    """The windows of all runs in sequence.

    Args:
        sizes: number of windows of each run, shape (runs,).
        run: index of each window's run, shape (w,).
        omega: angular frequency of each run, shape (runs,), rad/s.
        rate: decay rate of each run, shape (runs,), 1/s.
        powers: powers of the amplitude, by exponent, shape (w,) each.
        integrals: of these powers over time, by exponent, shape (w,) each.
        drift: integral of the time as a share of the record, shape (w,), s.
        settling: integral of a step that settles, shape (w,), s.
    """

    runs: Sequence[Demodulated]
    sizes: Places
    run: Places
    omega: Array
    rate: Array
    time: Times
    powers: dict[float, Array]
    integrals: dict[float, Array]
    drift: Array
    settling: Array

    @classmethod
    def of(cls, runs: Sequence[Demodulated]) -> RivalWindows:
        """Integrals over time, from each run's first window, by the trapezium rule."""
        sizes = np.array([run.time.size for run in runs])
        place = np.repeat(np.arange(len(runs)), sizes)
        time = np.concatenate([run.time for run in runs])
        first = np.array([run.amplitude[0] for run in runs])[place]
        relative = np.concatenate([run.amplitude for run in runs]) / first
        amplitude = first * np.maximum(relative, _FLOOR)
        share = time / np.array([run.duration for run in runs])[place]
        begins = np.concatenate(([0], np.cumsum(sizes)[:-1]))
        steps = np.diff(time, prepend=0.0)
        steps[begins] = 0.0
        table = np.stack([*(amplitude**power for power in _POWERS), share, 1.0 - np.exp(-_SETTLING * share)])
        before = np.concatenate((table[:, :1], table[:, :-1]), axis=1)
        total = np.cumsum(0.5 * steps * (table + before), axis=1)
        total = total - total[:, begins][:, place]
        return cls(
            runs,
            sizes,
            place,
            np.array([run.omega for run in runs]),
            np.array([run.rate for run in runs]),
            time,
            dict(zip(_POWERS, table, strict=False)),
            dict(zip(_POWERS, total, strict=False)),
            total[-2],
            total[-1],
        )

    def joined(self, columns: Sequence[Column]) -> Array:
        """Columns of logarithm and phase; within a run the logarithms of its windows come first."""
        table = np.zeros((2, self.time.size, len(columns)))
        for place, pair in enumerate(columns):
            for channel, values in enumerate(pair):
                if values is not None:
                    table[channel, :, place] = values
        ends = np.cumsum(self.sizes)
        order = np.concatenate(
            [
                np.concatenate((np.arange(a, b), self.time.size + np.arange(a, b)))
                for a, b in zip(ends - self.sizes, ends, strict=True)
            ]
        )
        return np.asarray(table.reshape(2 * self.time.size, -1)[order])
