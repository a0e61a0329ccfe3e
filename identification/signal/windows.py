"""Damping and frequency through consecutive windows of a few cycles, as in the paper's Table III.

A linear oscillation has the same ζ and ωn in every window; a drift with the amplitude shows a gap in the model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.estimate import NoiseLevel, Quantity, WindowEstimate
from identification.policy import LEAST_WINDOW_ENERGY
from identification.signal.decay_fit import (
    ANGLE,
    ANGULAR_RATE,
    RATE,
    STIFFNESS,
    DecayFit,
    Reading,
    RunFit,
    fit_run,
)
from identification.signal.free_decay import Decay, envelope_amplitude
from identification.signal.frequency import starting_decay
from identification.signal.noise import eighth_of_a_cycle, slow_power
from identification.statistics import determined, inverse
from tunnel_sim.vocabulary.record import Array, Record

CYCLES = 3
_LEAST_WINDOWS = 4
_LEAST_SAMPLES = 16
_TOLERANCE = 1e-5  # relative, of a window's fit; the next Gauss–Newton step would be a thousand times smaller


def fit_windows(
    reading: Reading, run: Decay, zero: float, noise: NoiseLevel, *, cycles: int | None = None
) -> tuple[WindowEstimate, ...]:
    """Fit a decay to each window of a run separately.

    Each window lasts ``cycles`` periods of its own fitted frequency and the next starts where it ends, so the
    windows follow the cycles where the frequency drifts. The sensor's zero is common to them: that of
    the whole run, or, where one decay does not fit the whole run, the median of the windows' own. The series
    ends with the record, or where the oscillation is lost in the noise; a window that one decay does not
    describe even roughly is skipped.

    Args:
        zero: its sensor zero, rad.
        cycles: periods in a window; where None three, or one where the record is too short for four such.

    Returns:
        The windows in order; none where the run does not oscillate for that long.
    """
    if cycles is None:
        cycles = CYCLES if _LEAST_WINDOWS * _length(run, CYCLES) <= float(reading.time[-1]) else 1
    if noise.departs:
        run = _start_at(reading, 0, run, cycles)
        own = [fit.zero for _, fit in _series(reading, run, None, noise, cycles)]
        zero = float(np.median(own)) if own else zero
    return tuple(window for window, _ in _series(reading, run, zero, noise, cycles))


def _series(
    reading: Reading, decay: Decay, zero: float | None, noise: NoiseLevel, cycles: int
) -> list[tuple[WindowEstimate, DecayFit]]:
    series: list[tuple[WindowEstimate, DecayFit]] = []
    begin = 0
    while (fitted := _fit_window(reading, begin, decay, zero, cycles)) is not None:
        fit, count = fitted
        motion = reading.yaw[begin : begin + count] - fit.zero - fit.runs[0].residual
        if float(motion @ motion) < LEAST_WINDOW_ENERGY * noise.std**2:
            break
        window = _window_estimate(reading, begin, count, fit.runs[0], noise) if fit.converged else None
        if window is not None:
            series.append((replace(window, cycles=cycles), fit))
        begin, decay = begin + count, fit.runs[0].decay
        if window is None and begin < reading.time.size:
            decay = _start_at(reading, begin, decay, cycles)
    return series


def _start_at(reading: Reading, begin: int, decay: Decay, cycles: int) -> Decay:
    # Where one decay does not fit what went before, its values may be far from those of the window to come.
    part = slice(begin, int(np.searchsorted(reading.time, reading.time[begin] + _length(decay, cycles))))
    if part.stop - part.start < _LEAST_SAMPLES or part.stop >= reading.time.size:
        return decay
    return starting_decay(Record(reading.time[part], reading.yaw[part])) or decay


def _length(decay: Decay, cycles: int) -> float:
    return cycles * 2.0 * np.pi / decay.omega_d if decay.omega_d > 0.0 else np.inf


def _fit_window(
    reading: Reading, begin: int, decay: Decay, zero: float | None, cycles: int
) -> tuple[DecayFit, int] | None:
    # Fitted with the expected frequency, and again where the fitted frequency changes the length of the window.
    interval = float(reading.time[-1]) / (reading.time.size - 1)
    fit, count = None, 0
    for _ in range(2):
        length = _length(decay, cycles) / interval
        if not _LEAST_SAMPLES <= length < reading.time.size - begin + 0.5:
            return None
        if fit is not None and abs(length - count) <= 0.01 * count:
            break
        count = round(length)
        part = slice(begin, begin + count)
        window = Reading(reading.time[part] - reading.time[begin], reading.yaw[part])
        fit = fit_run(window, decay, zero=zero, tolerance=_TOLERANCE)
        if not fit.runs:
            return None
        decay = fit.runs[0].decay
    return None if fit is None else (fit, count)


def _window_estimate(
    reading: Reading, begin: int, count: int, run: RunFit, noise: NoiseLevel
) -> WindowEstimate | None:
    time = reading.time[begin : begin + count]
    interval = float(time[-1] - time[0]) / (count - 1)
    duration = count * interval
    decay = run.decay
    amplitude = envelope_amplitude(decay, run.angle, run.rate) * np.exp(-0.5 * decay.rate * duration)
    power, blocks = slow_power(run.residual, eighth_of_a_cycle(decay.omega_n, interval))
    variance = noise.std**2 * max(1.0, power / max(blocks - 4, 1) / noise.std**2)
    if not np.isfinite(amplitude) or 0.5 * count * amplitude**2 < LEAST_WINDOW_ENERGY * variance:
        return None
    order = [RATE, STIFFNESS, ANGLE, ANGULAR_RATE]
    information = run.information[np.ix_(order, order)]
    if not determined(information):
        return None
    covariance = inverse(information) * variance
    omega_n, zeta = modal_quantities(decay, covariance[:2, :2])
    # At mid-window the amplitude hardly depends on the damping: white noise gives A √(2/N).
    return WindowEstimate(
        start_s=float(time[0]),
        duration_s=duration,
        amplitude=Quantity(float(amplitude), float(np.sqrt(2.0 * variance / count)), "rad"),
        omega_n=omega_n,
        zeta=zeta,
    )


def modal_quantities(decay: Decay, covariance: Array) -> tuple[Quantity, Quantity]:
    """ωn and ζ with their standard deviations.

    Args:
        decay: with a positive stiffness.
        covariance: of (a, k), shape (2, 2), in 1/s and 1/s².

    Returns:
        ωn in rad/s and ζ.
    """
    omega, zeta = decay.omega_n, decay.zeta
    slope = np.array([1.0 / omega, -0.5 * zeta / omega**2])
    omega_std = float(np.sqrt(covariance[1, 1])) / (2.0 * omega)
    zeta_std = float(np.sqrt(slope @ covariance @ slope))
    return Quantity(omega, omega_std, "rad/s"), Quantity(zeta, zeta_std, "1")
