"""Hilbert envelope: decay rate from the logarithm of the envelope, frequency from the phase.

The analytic signal of a finite record is wrong near its ends. The record is therefore first extended past both
ends by a few cycles of an approximate decay that fades out. The envelope is demodulated with a fixed frequency
and averaged over half cycles. The averages of a decay are again an exponential sequence; for m samples their
logarithms and phases have independent errors of √2 S/(√m A). Where a line does not fit a run, its standard
deviations are raised to the scatter about it.

Sources: M. Feldman, Mech. Syst. Signal Process. 25 (2011) 735–802, doi 10.1016/j.ymssp.2010.07.018 (free decay by
the Hilbert transform, and its end effects); backbone from free decays: J. M. Londoño, S. A. Neild & J. E. Cooper,
J. Sound Vib. 348 (2015) 224–238, doi 10.1016/j.jsv.2015.03.025.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len

from identification.campaign.combination import Found, RunByRun, run_estimate
from identification.estimate import Status, WindowEstimate
from identification.policy import LEAST_ENVELOPE, LEAST_WINDOW_ENERGY
from identification.show.quantity import Quantity
from identification.signal.decay_fit import Reading, even_reading, project_run
from identification.signal.free_decay import Decay, free_decay
from identification.signal.frequency import starting_decay
from identification.signal.noise import reading_noise
from identification.signal.run_fit import CYCLES, modal_quantities, residual_check
from identification.signal.run_unknowns import RunFit
from identification.statistics import decay_covariance, weighted_fit
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.quantities import Angles
from tunnel_sim.vocabulary.record import Array

_CARRIED_ON = 6.0  # cycles beyond either end
_GROWTH = 3.0  # a fast decay is extended backwards only until it has grown by e³


@dataclass(frozen=True, eq=False)
class Envelope:
    """Half-cycle averages of the demodulated analytic signal.

    Args:
        time: middles of the half cycles since the first sample, shape (n,), s.
        phase: relative to the carrier, unwrapped, shape (n,), rad.
        carrier: the demodulating angular frequency, rad/s.
    """

    time: Array
    amplitude: Angles
    phase: Array
    carrier: float
    samples: int


def envelope(reading: Reading, rough: RunFit, zero: float) -> Envelope:
    """Envelope and phase of a record: at least one average per half cycle.

    Args:
        rough: an oscillating approximate decay of the record, with its initial state.
        zero: the sensor's zero, rad.
    """
    from scipy.signal import hilbert  # imported here because it is slow to load

    reading = even_reading(reading)
    interval = float(reading.time[-1]) / (reading.time.size - 1)
    omega = rough.decay.omega_d
    span = _CARRIED_ON * 2.0 * np.pi / omega
    margin = int(min(span, _GROWTH / max(rough.decay.rate, _GROWTH / span)) / interval)
    steps = interval * np.arange(1, margin + 1, dtype=np.float64)
    share = steps / (steps[-1] + interval) if margin else steps
    # From 1 to 0 with three zero derivatives at either end: a kink would be another discontinuity.
    fade = 1.0 - share**4 * (35.0 - 84.0 * share + 70.0 * share**2 - 20.0 * share**3)
    after = free_decay(reading.time[-1] + steps, rough.decay, rough.angle, rough.rate)
    before = free_decay(-steps, rough.decay, rough.angle, rough.rate)
    extended = np.concatenate(((fade * before)[::-1], reading.yaw - zero, fade * after))
    signal = hilbert(extended, next_fast_len(extended.size))[margin : margin + reading.time.size]
    block = max(1, round(np.pi / (omega * interval)))
    count = reading.time.size // block
    turned = (signal * np.exp(-1j * omega * reading.time))[: count * block]
    means = turned.reshape(count, block).mean(axis=1)
    middles = reading.time[: count * block].reshape(count, block).mean(axis=1)
    return Envelope(middles, np.abs(means), np.unwrap(np.angle(means)), omega, block)


_PASSES = 3  # each round extends the record with the decay of the previous one
_LEAST_POINTS = 5


@dataclass(frozen=True)
class Hilbert(RunByRun):
    """Regression of the envelope's logarithm and of the phase. The windows of a run are the backbone.

    Args:
        cycles_per_window: periods in each window of the backbone; 0 gives none.
    """

    name = "hilbert"
    cycles_per_window: int = CYCLES

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        start = starting_decay(run.record)
        if start is None:
            return Status.NO_OSCILLATION
        reading = Reading.from_record(run.record)
        check = residual_check(run, start, sensor)
        coloured = check is not None and check.colour is not None
        # half-cycle averages are lines of zero noise at all other harmonics: only the power at the motion counts
        noise_std = check.noise_std if check is not None and coloured else reading_noise(run.record, sensor)
        decay, covariance, averages = start, None, None
        for _ in range(_PASSES):
            projected = project_run(reading, decay) if decay.omega_d > 0.0 else None
            if projected is None:
                return Status.NOT_CONVERGED
            if decay.omega_d * float(reading.time[-1]) < np.pi * _LEAST_POINTS:
                break  # too few half cycles for a line
            averages = envelope(reading, *projected)
            lines = _lines(averages, decay, noise_std)
            if lines is None:
                break
            decay, covariance = lines
        if averages is None or decay.stiffness <= 0.0:
            return Status.NOT_CONVERGED
        windows: list[WindowEstimate] = []  # lines through consecutive parts of the envelope
        length = 2 * self.cycles_per_window  # two averages per cycle
        deviation = noise_std * np.sqrt(2.0 / averages.samples)
        shown = covariance is not None and length > 0
        for begin in range(0, averages.time.size - length + 1, length) if shown else ():
            part = slice(begin, begin + length)
            amplitude = float(np.exp(np.log(averages.amplitude[part]).mean()))
            if 0.5 * length * averages.samples * amplitude**2 < LEAST_WINDOW_ENERGY * noise_std**2:
                break
            _, own, own_covariance = _fitted(averages, part, np.full(length, deviation / amplitude))
            if own.stiffness <= 0.0:
                break
            step = float(averages.time[1] - averages.time[0])
            omega_n, zeta = modal_quantities(own, own_covariance)
            windows.append(
                WindowEstimate(
                    start_s=float(averages.time[begin] - 0.5 * step),
                    duration_s=length * step,
                    amplitude=Quantity(amplitude, float(deviation / np.sqrt(length)), "rad"),
                    omega_n=omega_n,
                    zeta=zeta,
                    cycles=self.cycles_per_window,
                )
            )
        return run_estimate(run, decay, covariance, noise_std, check, sensor, tuple(windows))


def _lines(averages: Envelope, decay: Decay, noise_std: float) -> tuple[Decay, Array] | None:
    # The decay and the covariance of (a, k). Weights follow the line, not the noisy envelope itself.
    deviation = noise_std * np.sqrt(2.0 / averages.samples)
    if not averages.amplitude.min() > 0.0:
        return None
    scale = float(np.exp(np.mean(np.log(averages.amplitude[:4]) + decay.rate * averages.time[:4])))
    expected = scale * np.exp(-decay.rate * averages.time)
    for _ in range(2):
        below = np.flatnonzero(expected < LEAST_ENVELOPE * deviation)
        count = int(below[0]) if below.size else expected.size
        if count < _LEAST_POINTS:
            return None
        logarithm, decay, covariance = _fitted(averages, slice(0, count), deviation / expected[:count])
        expected = np.exp(logarithm[0] - logarithm[1] * averages.time)
    return decay, covariance


def _fitted(seen: Envelope, part: slice, deviation: Array) -> tuple[Array, Decay, Array]:
    """The line of the logarithm and, with the line of the phase, the decay and the covariance of (a, k)."""
    columns = np.column_stack((np.ones(deviation.size), -seen.time[part]))
    logarithm, by_envelope = weighted_fit(columns, np.log(seen.amplitude[part]), deviation**2)
    phase, by_phase = weighted_fit(columns, seen.phase[part], deviation**2)
    rate, omega_d = float(logarithm[1]), seen.carrier - float(phase[1])
    covariance = decay_covariance(rate, omega_d, float(by_envelope[1, 1]), float(by_phase[1, 1]))
    return logarithm, Decay(rate, omega_d**2 + rate**2), covariance
