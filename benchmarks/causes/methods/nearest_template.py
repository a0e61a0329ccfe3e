"""The nearest template on the backbones: frequency and damping ratio against amplitude.

Every run is cut into windows of three cycles, each with an amplitude, a frequency and a decay. A cause's
template is the effect of its moment on them by equivalent linearisation. The part of both that the nominal model
can fit is projected out.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.causes.entry import UNKNOWN, About, answer_of, main
from benchmarks.causes.moments import NOT_SEEN, Array, frequency, moments_of, own_decay, stiffness
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Record

NEAR, SHARPNESS, CYCLES = 0.6, 0.08, 3
NAMES = (
    "coulomb_friction", "quadratic_damping", "structural_damping", "cubic_stiffness", "free_play",
    "gravity_stiffness", "rod_flexibility", "nonlinear_yaw_moment", "nonlinear_yaw_damping",
    "wind_speed_drift", "wind_speed_offset", "spring_miscalibration",
)  # fmt: skip
ABOUT = About(
    "nearest template on f(A), ζ(A)",
    f"windows of {CYCLES} cycles, one cause; `unknown` below a squared cosine of {NEAR:g}, none where the "
    "windows scatter by no more than three times their noise",
    (*NAMES, UNKNOWN),
    NOT_SEEN,
)


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    measured, weight, nominal, templates = backbones(read_campaign(folder))
    basis = np.linalg.qr(nominal * weight[:, None])[0]

    def rest(values: Array) -> Array:
        scaled = values * weight
        return np.asarray(scaled - basis @ (basis.T @ scaled))

    left = rest(measured)
    if float(np.mean(left**2)) < 9.0:
        return answer_of([], dict.fromkeys(NAMES, 0.01))
    near: dict[str, float] = {}
    for name, columns in templates.items():
        cause = np.column_stack([rest(c) for c in columns.T])
        fitted = cause @ np.linalg.lstsq(cause, left, rcond=1e-9)[0]
        near[name] = float(fitted @ fitted / (left @ left))
    best = max(near, key=near.__getitem__)
    odds = {n: float(np.exp((v - near[best]) / SHARPNESS)) for n, v in near.items()}
    known = 0.9 if near[best] > NEAR else 0.2
    stated = {n: known * v / sum(odds.values()) for n, v in odds.items()} | {UNKNOWN: 1.0 - known}
    sets = [((n,), p) for n, p in stated.items()]
    return answer_of([best] if near[best] > NEAR else [UNKNOWN], stated, sets)


def backbones(campaign: Campaign) -> tuple[Array, Array, Array, dict[str, Array]]:
    """Stiffness and damping per inertia against amplitude, and the influences of nominal model and causes on them.

    Returns:
        Measured values, ω² (1/s²) and 2σω (1/s²) of every window, shape (2 windows,); one over their standard
        deviations; columns of the nominal model, shape (2 windows, p); templates by cause, shape (2 windows, k).
    """
    springs = sorted({stiffness(run) for run in campaign.runs})
    swing = max(float(np.ptp(run.record.yaw_rad)) / 2.0 for run in campaign.runs)
    phase = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
    values: list[float] = []
    weights: list[float] = []
    nominal: list[list[float]] = []
    causes: dict[str, list[list[float]]] = {name: [] for name in NAMES}
    for run in campaign.runs:
        k, q, v = stiffness(run), (run.air_density or 0.0) * run.wind_speed**2, run.wind_speed
        for amplitude, omega, sigma, noise, share in _windows(run):
            b, r = amplitude * np.cos(phase), -amplitude * omega * np.sin(phase)
            values += [omega**2, 2.0 * sigma * omega]
            weights += [1.0 / (2.0 * omega * noise)] * 2
            nominal += [[k, q, 0.0, 0.0], [0.0, 0.0, omega, v * omega]]
            found = moments_of(run, b, r, swing, springs) | {"wind_speed_drift": [q * b * share]}
            for name in NAMES:
                causes[name].append(
                    [float(-2.0 * np.mean(m * np.cos(phase)) / amplitude) for m in found[name]]
                )
                causes[name].append(
                    [float(2.0 * np.mean(m * np.sin(phase)) / amplitude) for m in found[name]]
                )
    columns = {n: np.array(c) for n, c in causes.items() if c and len(c[0])}
    used = {n: c[:, np.any(c, axis=0)] for n, c in columns.items() if np.any(c)}
    table = np.array(nominal)
    return np.array(values), np.array(weights), table[:, np.any(table, axis=0)], used


def _windows(run: Run) -> list[tuple[float, float, float, float, float]]:
    """For every window: amplitude (rad), frequency (rad/s), decay (1/s), their noise, time over the length."""
    record = run.record
    length = round(CYCLES * 2.0 * np.pi / (frequency(run) * record.sample_interval))
    noise = float(np.std(np.diff(record.yaw_rad, 2))) / np.sqrt(6.0)
    found = []
    for start in range(0, record.yaw_rad.size - length + 1, length):
        part = Record(record.time_s[start : start + length], record.yaw_rad[start : start + length])
        omega, sigma, _ = own_decay(replace(run, record=part))
        amplitude = float(np.ptp(part.yaw_rad)) / 2.0
        # the Cramér–Rao bound of the frequency of a sinusoid of this length, and of its decay
        std = noise / amplitude * np.sqrt(24.0 / length**3) / record.sample_interval
        if omega > 0.0 and amplitude > 20.0 * noise:
            place = (start + 0.5 * length) / record.yaw_rad.size
            found.append((amplitude, omega, sigma, float(std), place))
    return found


if __name__ == "__main__":
    main(answer)
