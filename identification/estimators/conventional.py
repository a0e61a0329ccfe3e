"""The paper's conventional method: spectrum, time to half amplitude, wind-on against wind-off.

The damped frequency f is the peak of the power spectral density, the time to half amplitude t½ = ln 2/σ comes
from the decay of the peaks, and each wind-on run is compared with the wind-off runs of its spring by eqs 7, 8, 17
and 18 (`identification.campaign.pairing`). Standard deviations of f and σ are the scatter of one run's peaks.
They include scatter only, not the bias of the method.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.campaign.derivatives import noise_statuses
from identification.campaign.pairing import PairedRun
from identification.estimate import NoiseLevel, Quantity, RunEstimate, Status, by_severity
from identification.estimators.run_by_run import Paired
from identification.policy import LEAST_PROMINENCE
from identification.signal.free_decay import Decay
from identification.signal.frequency import PeakDecay, peak_decay, psd_peak
from identification.signal.run_fit import residual_check
from identification.statistics import decay_covariance, deviations
from tunnel_sim.vocabulary.campaign import Run, SensorProperties


@dataclass(frozen=True)
class Conventional(Paired):
    """The paper's method; it has no settings."""

    name = "conventional"

    def _run(self, run: Run, sensor: SensorProperties) -> tuple[RunEstimate, PairedRun | None]:
        seen = _peaks_of(run, sensor)
        if seen.peaks is None:
            return RunEstimate(seen.run.id, (Status.NO_OSCILLATION,)), None
        peaks = seen.peaks
        omega_d, omega_d_std = 2.0 * np.pi * seen.frequency, 2.0 * np.pi * peaks.frequency_std
        omega = float(np.hypot(omega_d, peaks.rate))
        omega_std = float(np.hypot(omega_d * omega_d_std, peaks.rate * peaks.rate_std)) / omega
        zeta_std = float(np.hypot(omega_d * peaks.rate_std, peaks.rate * omega_d_std)) * omega_d / omega**3
        statuses = noise_statuses([seen.noise])
        if seen.run.spring_stiffness is None:
            statuses.add(Status.NO_STIFFNESS)
        omega_n = Quantity(omega, omega_std, "rad/s")
        estimate = RunEstimate(
            id=seen.run.id,
            statuses=by_severity(statuses),
            omega_n=omega_n,
            zeta=Quantity(peaks.rate / omega, zeta_std, "1"),
            sensor_zero=Quantity(peaks.zero, peaks.zero_std, "rad"),
            noise=seen.noise,
        )
        return estimate, PairedRun(
            seen.run, seen.frequency, peaks.frequency_std, peaks.rate, peaks.rate_std, omega_n
        )


@dataclass(frozen=True)
class _PeakRun:
    """A run, its frequency in Hz and its peaks; None where it shows no oscillation."""

    run: Run
    frequency: float
    peaks: PeakDecay | None
    noise: NoiseLevel | None = None


def _peaks_of(run: Run, sensor: SensorProperties) -> _PeakRun:
    peak = psd_peak(run.record)
    peaks = peak_decay(run.record, peak.frequency) if peak.prominence > LEAST_PROMINENCE else None
    if peaks is None:
        return _PeakRun(run, peak.frequency, None)
    omega_d = 2.0 * np.pi * peak.frequency
    check = residual_check(run, Decay(peaks.rate, omega_d**2 + peaks.rate**2), sensor)
    if check is None:
        return _PeakRun(run, peak.frequency, peaks)
    own = decay_covariance(peaks.rate, omega_d, peaks.rate_std**2, (2.0 * np.pi * peaks.frequency_std) ** 2)
    widened = check.widened(own)
    if check.noise.departs:
        rate_std, omega_std = deviations(peaks.rate, omega_d, widened)
        peaks = replace(peaks, rate_std=rate_std, frequency_std=omega_std / (2.0 * np.pi))
    return _PeakRun(run, peak.frequency, peaks, check.noise)
