"""Buffeting: the likelihood of a random moment on the rig, by the innovations of a steady Kalman filter.

Åström, Introduction to Stochastic Control Theory (1970); Maine & Iliff, NASA RP-1077 (1981), filter error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import minimize
from scipy.signal import lfilter

from diagnosis.least_squares import Fit
from diagnosis.spectra import linear_coefficients
from tunnel_sim.record import Array

_INTERVAL = 0.012  # s between the residuals the filter sees: well above the rig's frequencies
_SETTLE = 1.0  # s at the start left out: the filter's own transient
_LONGEST_BANDWIDTH = 20.0  # Hz: the rig cannot tell a broader spectrum from white


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """A fitted random moment.

    Args:
        intensity: standard deviation of the moment coefficient.
        bandwidth: corner frequency of its spectrum, Hz.
        drop: of −2 ln L against white measurement noise alone, wind-on runs.
        cost: −2 ln L without constants, wind-on runs.
        white_excess: mean squared scaled residual minus one of the same samples, without the moment.
        excess: likewise of the scaled innovations.
        innovations: scaled, by wind-on run.
        run_ids: their runs.
        interval: between innovations, s.
    """

    intensity: float
    bandwidth: float
    drop: float
    cost: float
    white_excess: float
    excess: float
    innovations: list[Array]
    run_ids: tuple[str, ...]
    interval: float


@dataclass(frozen=True, eq=False)
class _Channel:
    """One wind-on run for the filter."""

    id: str
    residual: Array  # rad
    variance: float  # rad2, of one residual
    interval: float
    continuous: Array  # (3, 3): angle, rate, moment coefficient at unit corner frequency
    moment: float  # N m per unit coefficient, over the inertia


def fit_process_noise(fit: Fit) -> ProcessNoise | None:
    """Explain the residuals of the wind-on runs by a random moment of common coefficient.

    Args:
        fit: the deterministic model's fit; its coefficients give the rig's response.

    Returns:
        The fit; None without wind-on runs or where the model is not stable.
    """
    channels = [c for i in range(len(fit.residuals)) if (c := _channel(fit, i)) is not None]
    if not channels:
        return None
    white = sum(_minus_two_log_white(c) for c in channels)

    def cost(x: Array) -> float:
        return sum(_filtered(c, float(np.exp(x[0])), float(np.exp(x[1])))[0] for c in channels)

    grid = [(np.log(s), np.log(b)) for s in (3e-4, 1e-3, 3e-3, 1e-2, 3e-2) for b in (0.3, 3.0, 20.0)]
    start = min(grid, key=lambda x: cost(np.array(x)))
    found = minimize(
        cost,
        np.array(start),
        method="Nelder-Mead",
        bounds=[(np.log(1e-7), np.log(1.0)), (np.log(0.03), np.log(_LONGEST_BANDWIDTH))],
        options={"maxfev": 60, "xatol": 0.02, "fatol": 0.5},
    )
    intensity, bandwidth = (float(v) for v in np.exp(found.x))
    results = [_filtered(c, intensity, bandwidth) for c in channels]
    innovations = [scaled for _, scaled in results]
    count = sum(i.size for i in innovations)
    skip = [_skip(c) for c in channels]
    return ProcessNoise(
        intensity,
        bandwidth,
        white - float(found.fun),
        float(found.fun),
        sum(float(np.sum(c.residual[k:] ** 2)) / c.variance for c, k in zip(channels, skip, strict=True))
        / count
        - 1.0,
        sum(float(i @ i) for i in innovations) / count - 1.0,
        innovations,
        tuple(c.id for c in channels),
        channels[0].interval,
    )


def _channel(fit: Fit, run_index: int) -> _Channel | None:
    run = fit.problem.data.runs[run_index]
    if not run.wind_on:
        return None
    inertia, damping, stiffness = linear_coefficients(fit, run_index)
    if stiffness <= 0.0 or damping <= 0.0:
        return None
    group = max(1, round(_INTERVAL / run.interval))
    count = run.reading.size // group
    scale = np.sqrt(run.noise_variance)
    residual = (fit.residuals[run_index][: count * group] * scale).reshape(count, group).mean(axis=1)
    area, length = fit.problem.data.frontal_area, fit.problem.data.reference_length
    moment = 0.5 * run.air_density * run.wind_speed**2 * area * length / inertia
    continuous = np.array(
        [[0.0, 1.0, 0.0], [-stiffness / inertia, -damping / inertia, moment], [0.0, 0.0, -1.0]]
    )
    return _Channel(run.id, residual, run.noise_variance / group, group * run.interval, continuous, moment)


def _skip(channel: _Channel) -> int:
    return min(channel.residual.size // 4, round(_SETTLE / channel.interval))


def _minus_two_log_white(channel: _Channel) -> float:
    residual = channel.residual[_skip(channel) :]
    return float(residual.size * np.log(channel.variance) + residual @ residual / channel.variance)


def _filtered(channel: _Channel, intensity: float, bandwidth: float) -> tuple[float, Array]:
    """−2 ln L (without constants) and scaled innovations of the steady filter."""
    corner = 2.0 * np.pi * bandwidth
    dynamics = channel.continuous.copy()
    dynamics[2, 2] = -corner
    drive = np.zeros((3, 3))
    drive[2, 2] = 2.0 * corner * intensity**2
    h = channel.interval
    block = expm(np.block([[-dynamics, drive], [np.zeros((3, 3)), dynamics.T]]) * h)  # Van Loan 1978
    transition = block[3:, 3:].T
    disturbance = transition @ block[:3, 3:]
    disturbance = 0.5 * (disturbance + disturbance.T) + 1e-18 * np.eye(3)
    observe = np.array([[1.0, 0.0, 0.0]])
    try:
        covariance = solve_discrete_are(transition.T, observe.T, disturbance, np.array([[channel.variance]]))
    except (np.linalg.LinAlgError, ValueError):
        return np.inf, np.zeros(0)
    spread = float(covariance[0, 0] + channel.variance)
    gain = transition @ covariance @ observe.T / spread
    numerator = np.real(np.poly(transition))
    denominator = np.real(np.poly(transition - gain @ observe))
    innovations = lfilter(numerator, denominator, channel.residual)[_skip(channel) :]
    cost = float(innovations.size * np.log(spread) + innovations @ innovations / spread)
    return cost, innovations / np.sqrt(spread)


def whiteness(result: ProcessNoise) -> tuple[float, float, float]:
    """How far innovations are from white and steady.

    Args:
        result: a fit of process noise.

    Returns:
        Largest departure of a frequency band's mean power from 1, in its standard deviations; the same of a
        quarter of the record in time; and the greatest share of the squared innovations' excess in one run.
    """
    bands, quarters = [], []
    for innovations in result.innovations:
        power = np.abs(np.fft.rfft(innovations - innovations.mean())) ** 2 / innovations.size
        for part in np.array_split(power[1:], 8):
            bands.append((float(part.mean()) - 1.0) * np.sqrt(part.size))
        for part in np.array_split(innovations, 4):
            quarters.append((float(np.mean(part**2)) - 1.0) * np.sqrt(part.size / 2.0))
    by_run = [float(np.mean(i**2)) - 1.0 for i in result.innovations]
    return float(np.max(np.abs(bands))), float(np.max(np.abs(quarters))), float(np.max(np.abs(by_run)))
