"""The paper's conventional method: spectrum, time to half amplitude, wind-on against wind-off.

The damped frequency f is the peak of the power spectral density, the time to half amplitude t½ = ln 2/σ comes
from the decay of the peaks, and each wind-on run is compared with the wind-off runs of its spring by eqs 7, 8, 17
and 18 (`identification.campaign.pairing`). Standard deviations of f and σ are the scatter of one run's peaks.
They include scatter only, not the bias of the method.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from identification.campaign.assembly import departures
from identification.campaign.derivatives import loads
from identification.campaign.pairing import PairedRun, paired_estimate
from identification.decay.damped_oscillation import Decay
from identification.decay.peaks import PeakDecay, peak_decay
from identification.decay.residual_check import residual_check
from identification.decay.spectrum import psd_peak
from identification.estimate import Estimate, NoiseLevel, Quantity, RunEstimate, Status, by_gravity
from identification.policy import LEAST_PROMINENCE
from identification.statistics.weighted_line import decay_covariance, deviations
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties


@dataclass(frozen=True)
class Conventional:
    """The paper's method; it has no settings."""

    name: ClassVar[str] = "conventional"

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign by pairs of wind-on and wind-off runs.

        Args:
            campaign: at least one run.

        Returns:
            The estimate; the coefficients omit wind-on runs without a wind-off run of their spring.

        Raises:
            TunnelError: when a wind-on run states no air density.
        """
        pairs = [loads(run, campaign.rig) for run in campaign.runs]
        seen = [_see(run, campaign.sensor) for run in campaign.runs]
        estimate = Estimate(campaign.name, self.name, tuple(_run_estimate(s) for s in seen))
        known = [(one, load) for one, load in zip(seen, pairs, strict=True) if one.peaks is not None]
        if not known:
            return replace(estimate, statuses=(Status.NO_RUN_IDENTIFIED,))
        statuses = {Status.RUN_LEFT_OUT} if len(known) < len(seen) else set()
        statuses |= departures([one.noise for one in seen])
        return paired_estimate(campaign, estimate, [(_paired(one), load) for one, load in known], statuses)


@dataclass(frozen=True)
class _Seen:
    """A run, its frequency in Hz and its peaks; None where it shows no oscillation."""

    run: Run
    frequency: float
    peaks: PeakDecay | None
    noise: NoiseLevel | None = None


def _see(run: Run, sensor: SensorProperties) -> _Seen:
    peak = psd_peak(run.record)
    peaks = peak_decay(run.record, peak.frequency) if peak.prominence > LEAST_PROMINENCE else None
    if peaks is None:
        return _Seen(run, peak.frequency, None)
    omega_d = 2.0 * np.pi * peak.frequency
    check = residual_check(run, Decay(peaks.rate, omega_d**2 + peaks.rate**2), sensor)
    if check is None:
        return _Seen(run, peak.frequency, peaks)
    own = decay_covariance(peaks.rate, omega_d, peaks.rate_std**2, (2.0 * np.pi * peaks.frequency_std) ** 2)
    widened = check.widened(own)
    if check.noise.departs:
        rate_std, omega_std = deviations(peaks.rate, omega_d, widened)
        peaks = replace(peaks, rate_std=rate_std, frequency_std=omega_std / (2.0 * np.pi))
    return _Seen(run, peak.frequency, peaks, check.noise)


def _run_estimate(seen: _Seen) -> RunEstimate:
    if seen.peaks is None:
        return RunEstimate(seen.run.id, (Status.NO_OSCILLATION,))
    peaks = seen.peaks
    omega_d, omega_d_std = 2.0 * np.pi * seen.frequency, 2.0 * np.pi * peaks.frequency_std
    omega = float(np.hypot(omega_d, peaks.rate))
    omega_std = float(np.hypot(omega_d * omega_d_std, peaks.rate * peaks.rate_std)) / omega
    zeta_std = float(np.hypot(omega_d * peaks.rate_std, peaks.rate * omega_d_std)) * omega_d / omega**3
    statuses = departures([seen.noise])
    if seen.run.spring_stiffness is None:
        statuses.add(Status.NO_STIFFNESS)
    return RunEstimate(
        id=seen.run.id,
        statuses=by_gravity(statuses),
        omega_n=Quantity(omega, omega_std, "rad/s"),
        zeta=Quantity(peaks.rate / omega, zeta_std, "1"),
        sensor_zero=Quantity(peaks.zero, peaks.zero_std, "rad"),
        noise=seen.noise,
    )


def _paired(seen: _Seen) -> PairedRun:
    # Of a run that shows an oscillation.
    omega_n = _run_estimate(seen).omega_n
    if seen.peaks is None or omega_n is None:
        raise AssertionError(seen.run.id)
    peaks = seen.peaks
    return PairedRun(seen.run, seen.frequency, peaks.frequency_std, peaks.rate, peaks.rate_std, omega_n)
