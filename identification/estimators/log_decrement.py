"""Logarithmic decrement as a regression: a weighted line through the logarithm of every peak.

White noise of S per sample changes the height of a peak by (3/2) S/√m and its instant by √(3/m) S/(w ωd² h), with
m samples in the window, w its half width and h the height; so the logarithms have the variance (9/4) S²/(m h²). In
coloured noise S² is the power near the odd harmonics of the motion (`identification.signal.noise.PeakNoise`). The
line's gradient is the decay rate, the sensor's zero is fitted with it, and a second line, through the instants,
gives the damped frequency. Peaks are used down to ten deviations. Sources: Lord Rayleigh, The Theory of Sound,
vol. 1 (1894), § 46; Tweten, Ballard & Mann, J. Sound Vib. 333 (2014) 2804–2811, doi 10.1016/j.jsv.2014.01.024
(regression over many peaks).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.campaign.combination import Found, RunByRun, run_estimate
from identification.estimate import Status
from identification.policy import LEAST_PEAK_HEIGHT
from identification.signal.colour import Autoregression
from identification.signal.free_decay import Decay
from identification.signal.frequency import PEAK_HALF_WIDTH, follow_peaks, starting_frequency
from identification.signal.noise import PEAK_HALF_TURN, PeakNoise, reading_noise
from identification.signal.run_fit import residual_check
from identification.statistics import decay_covariance, weighted_fit
from tunnel_sim.vocabulary.campaign import Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

_LEAST_PEAKS = 5
_SWEEPS = 4  # rounds of weights and zero; each adds two digits


@dataclass(frozen=True)
class LogDecrement(RunByRun):
    """Weighted regression of the logarithms of all peaks; it has no settings."""

    name = "log_decrement"

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        frequency = starting_frequency(run.record)
        if frequency is None:
            return Status.NO_OSCILLATION
        noise_std = reading_noise(run.record, sensor)
        found = _decay(run, frequency, noise_std)
        if isinstance(found, Status):
            return found
        check = residual_check(run, found[0], sensor)
        if check is not None and check.colour is not None:
            noise_std = check.noise_std
            found = _decay(run, frequency, noise_std, check.colour)
        return found if isinstance(found, Status) else run_estimate(run, *found, noise_std, check, sensor)


def _decay(
    run: Run, frequency: float, noise_std: float, colour: Autoregression | None = None
) -> tuple[Decay, Array] | Status:
    """The decay, and the covariance of (a, k); the status of a failure."""
    half_width = PEAK_HALF_WIDTH / frequency
    times, heights = follow_peaks(run.record, frequency)
    if times.size < _LEAST_PEAKS:
        return Status.NO_OSCILLATION
    noise = PeakNoise.of(noise_std, 2.0 * half_width * run.record.sample_rate, colour)
    centres = 0.25 * (heights[:-2] + 2.0 * heights[1:-1] + heights[2:])
    zero = float(centres[: max(1, centres.size // 2)].mean())
    expected = np.abs(heights - zero)
    for _ in range(_SWEEPS):
        below = np.flatnonzero(expected < LEAST_PEAK_HEIGHT * noise.height)
        count = int(below[0]) if below.size else times.size
        if count < _LEAST_PEAKS or not np.all(np.abs(heights[:count] - zero) > 0.0):
            return Status.NOT_CONVERGED
        above = heights[:count] - zero
        # An error of the zero raises the peaks of one side and lowers those of the other.
        side = -np.sign(above) / expected[:count]
        columns = np.column_stack((np.ones(count), -times[:count], side))
        variance = (noise.height / expected[:count]) ** 2
        # To second order noise lowers the mean of the logarithm, and a vertex of noisy slope is too high.
        bias = 0.5 * (noise.slope / (PEAK_HALF_TURN * expected[:count])) ** 2 - 0.5 * variance
        line, spread = weighted_fit(columns, np.log(np.abs(above)) - bias, variance)
        zero += float(line[2])
        expected = np.exp(np.clip(line[0] - line[1] * times, -700.0, 700.0))
    steps = np.column_stack((np.ones(count), np.arange(count, dtype=np.float64)))
    omega = np.pi * (count - 1) / float(times[count - 1] - times[0])
    instant_std = noise.slope / (half_width * omega**2 * expected[:count])
    clock, clock_spread = weighted_fit(steps, times[:count], instant_std**2)
    omega_d, rate = np.pi / float(clock[1]), float(line[1])
    omega_variance = (omega_d**2 / np.pi) ** 2 * float(clock_spread[1, 1])
    covariance = decay_covariance(rate, omega_d, float(spread[1, 1]), omega_variance)
    return Decay(rate, omega_d**2 + rate**2), covariance
