"""The paper's conventional method: spectrum, time to half amplitude, wind-on against wind-off.

Standard deviations of frequency f and decay rate σ are propagated from the noise, without the bias of the method;
the deviation of σ is the scatter of the peaks where it is larger beyond chance. The pairs are compared by eqs 7, 8,
17 and 18 (`identification.campaign.pairing`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.campaign.derivatives import noise_statuses
from identification.campaign.pairing import Paired, PairedRun
from identification.estimate import RunEstimate, Status, by_severity
from identification.policy import LEAST_PROMINENCE
from identification.show.quantity import Quantity
from identification.signal.free_decay import Decay
from identification.signal.frequency import PEAK_HALF_WIDTH, peak_decay, psd_peak, psd_peak_std
from identification.signal.noise import PeakNoise, reading_noise
from identification.signal.run_fit import residual_check
from identification.statistics import decay_covariance, deviations
from tunnel_sim.vocabulary.campaign import Run, SensorProperties


@dataclass(frozen=True)
class Conventional(Paired):
    """The paper's method; it has no settings."""

    name = "conventional"

    def _run(self, run: Run, sensor: SensorProperties) -> tuple[RunEstimate, PairedRun | None]:
        peak = psd_peak(run.record)
        if not peak.prominence > LEAST_PROMINENCE:
            return RunEstimate(run.id, (Status.NO_OSCILLATION,)), None
        white = reading_noise(run.record, sensor)
        samples = 2.0 * PEAK_HALF_WIDTH / peak.frequency * run.record.sample_rate
        peaks = peak_decay(run.record, peak.frequency, PeakNoise.of(white, samples))
        if peaks is None:
            return RunEstimate(run.id, (Status.NO_OSCILLATION,)), None
        omega_d = 2.0 * np.pi * peak.frequency
        check = residual_check(run, Decay(peaks.rate, omega_d**2 + peaks.rate**2), sensor)
        noise, noise_std = (None, white) if check is None else (check.noise, check.noise_std)
        if check is not None and check.colour is not None:
            own_noise = PeakNoise.of(noise_std, samples, check.colour)
            peaks = peak_decay(run.record, peak.frequency, own_noise) or peaks
        omega_d_std = 2.0 * np.pi * psd_peak_std(run.record, peak.frequency, noise_std)
        if check is not None and check.noise.departs:
            own = decay_covariance(peaks.rate, omega_d, peaks.rate_std**2, omega_d_std**2)
            rate_std, omega_d_std = deviations(peaks.rate, omega_d, check.widened(own))
            peaks = replace(peaks, rate_std=rate_std)
        omega = float(np.hypot(omega_d, peaks.rate))
        omega_std = float(np.hypot(omega_d * omega_d_std, peaks.rate * peaks.rate_std)) / omega
        zeta_std = float(np.hypot(omega_d * peaks.rate_std, peaks.rate * omega_d_std)) * omega_d / omega**3
        statuses = noise_statuses([noise])
        if run.spring_stiffness is None:
            statuses.add(Status.NO_STIFFNESS)
        estimate = RunEstimate(
            id=run.id,
            statuses=by_severity(statuses),
            omega_n=Quantity(omega, omega_std, "rad/s"),
            zeta=Quantity(peaks.rate / omega, zeta_std, "1"),
            sensor_zero=Quantity(peaks.zero, peaks.zero_std, "rad"),
            noise=noise,
        )
        return estimate, PairedRun(
            run, peak.frequency, omega_d_std / (2.0 * np.pi), peaks.rate, peaks.rate_std
        )
