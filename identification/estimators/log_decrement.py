"""Logarithmic decrement as a regression: a weighted line through the logarithm of every peak.

White noise of S per sample changes the height of a peak by (3/2) S/√m and its instant by √(3/m) S/(w ωd² h), with m
samples in its half width w and h its height; so the logarithms have the variance (9/4) S²/(m h²). The line's
gradient is the decay rate, the sensor's zero is fitted with it, and a second line, through the instants,
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
from identification.signal.free_decay import Decay
from identification.signal.frequency import PEAK_HALF_WIDTH, follow_peaks, starting_frequency
from identification.signal.noise import reading_noise
from identification.statistics import decay_covariance, weighted_fit
from tunnel_sim.vocabulary.campaign import Run, SensorProperties

_LEAST_PEAKS = 5
_SWEEPS = 4  # of weights and zero; each adds two digits


@dataclass(frozen=True)
class LogDecrement(RunByRun):
    """Weighted regression of the logarithms of all peaks; it has no settings."""

    name = "log_decrement"

    def _run(self, run: Run, sensor: SensorProperties) -> Found:
        frequency = starting_frequency(run.record)
        if frequency is None:
            return Status.NO_OSCILLATION
        noise_std = reading_noise(run.record, sensor)
        half_width = PEAK_HALF_WIDTH / frequency
        share = noise_std / np.sqrt(2.0 * half_width * run.record.sample_rate)
        times, heights = follow_peaks(run.record, frequency)
        if times.size < _LEAST_PEAKS:
            return Status.NO_OSCILLATION
        height_std = 1.5 * share
        centres = 0.25 * (heights[:-2] + 2.0 * heights[1:-1] + heights[2:])
        zero = float(centres[: max(1, centres.size // 2)].mean())
        expected = np.abs(heights - zero)
        for _ in range(_SWEEPS):
            below = np.flatnonzero(expected < LEAST_PEAK_HEIGHT * height_std)
            count = int(below[0]) if below.size else times.size
            if count < _LEAST_PEAKS or not np.all(np.abs(heights[:count] - zero) > 0.0):
                return Status.NOT_CONVERGED
            above = heights[:count] - zero
            # An error of the zero raises the peaks of one side and lowers those of the other.
            side = -np.sign(above) / expected[:count]
            columns = np.column_stack((np.ones(count), -times[:count], side))
            variance = (height_std / expected[:count]) ** 2
            line, spread = weighted_fit(columns, np.log(np.abs(above)), variance)
            zero += float(line[2])
            expected = np.exp(np.clip(line[0] - line[1] * times, -700.0, 700.0))
        steps = np.column_stack((np.ones(count), np.arange(count, dtype=np.float64)))
        omega = np.pi * (count - 1) / float(times[count - 1] - times[0])
        instant_std = np.sqrt(3.0) * share / (half_width * omega**2 * expected[:count])
        clock, clock_spread = weighted_fit(steps, times[:count], instant_std**2)
        omega_d, rate = np.pi / float(clock[1]), float(line[1])
        omega_variance = (omega_d**2 / np.pi) ** 2 * float(clock_spread[1, 1])
        covariance = decay_covariance(rate, omega_d, float(spread[1, 1]), omega_variance)
        return run_estimate(run, Decay(rate, omega_d**2 + rate**2), covariance, noise_std, sensor)
