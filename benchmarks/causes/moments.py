"""The residual moment of a campaign and the moments of its causes, for methods of regression.

Nothing here comes from the project's fits. The equation of motion is used in its weak form: with L = D² + 2σD +
ω² of a run's own frequency and decay, L β = (ω² − Kr/Izz) β + (2σ − Cr/Izz) β̇ + moments / Izz. L⁻¹ is applied
to both sides. The noise of the rows is then the noise of the reading, small moments add up over the swings, and
all unknowns are linear. The right-hand side is evaluated along the motion, smoothed by polynomials over a
quarter of a cycle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter, savgol_filter

from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Campaign, Run

Array = NDArray[np.float64]

_CYCLE, _ROWS = 0.25, 16  # length of the polynomial, cycles; rows per cycle
_PLAY = 0.01  # share of the largest swing at which a dead zone is evaluated
NAMES: tuple[str, ...] = (
    "coulomb_friction", "quadratic_damping", "structural_damping", "cubic_stiffness", "asymmetric_stiffness",
    "free_play", "gravity_stiffness", "rod_flexibility", "nonlinear_yaw_moment", "wind_speed_drift",
    "nonlinear_yaw_damping", "unsteady_aero_lag", "flow_misalignment", "sensor_nonlinearity", "sensor_drift",
    "wind_speed_offset", "spring_miscalibration",
)  # fmt: skip
"""Causes that are moments along the motion. The others are lines, steps and noise of the reading, or random."""
NOT_SEEN = ("random_moments",)


@dataclass(frozen=True, eq=False)
class Equations:
    """Rows of the weak equation of motion of all runs, in standard deviations of the reading's noise.

    Args:
        target: reading minus its response to the nominal restoring and damping moments, shape (rows,).
        nominal: columns of the nominal model and of the releases, shape (rows, p).
        causes: columns by name of the cause, each of shape (rows, k).
        run: the run of every row, shape (rows,).
        phase: phase of the motion, 0 to 2π, shape (rows,).
        level: amplitude of the motion over the largest, shape (rows,).
        time: time since the start of the run over the run's length, shape (rows,).
    """

    target: Array
    nominal: Array
    causes: Mapping[str, Array]
    run: NDArray[np.int64]
    phase: Array
    level: Array
    time: Array

    def residuals(self) -> tuple[Array, dict[str, Array]]:
        """Target and causes without the parts that the nominal model explains.

        Returns:
            The residual moment, shape (rows,), and the residual moments of each cause, shape (rows, k).
        """
        basis = np.linalg.qr(self.nominal / np.maximum(np.linalg.norm(self.nominal, axis=0), 1e-300))[0]

        def rest(values: Array) -> Array:
            return np.asarray(values - basis @ (basis.T @ values))

        return rest(self.target), {name: rest(columns) for name, columns in self.causes.items()}


def frequency(run: Run) -> float:
    """Frequency of a run's motion, rad/s: the peak of its windowed spectrum, by a parabola."""
    y = run.record.yaw_rad - np.mean(run.record.yaw_rad)
    size = 4 * y.size
    power = np.log(np.abs(np.fft.rfft(y * np.hanning(y.size), size)) ** 2 + 1e-300)
    k = int(np.argmax(power[3:-1])) + 3
    a, b, c = power[k - 1 : k + 2]
    shift = 0.5 * (a - c) / (a - 2.0 * b + c) if a - 2.0 * b + c else 0.0
    return float(2.0 * np.pi * (k + shift) / (size * run.record.sample_interval))


def equations(folder: Path) -> Equations:
    """The equations of a campaign's folder.

    Raises:
        TunnelError: when the campaign cannot be read.
    """
    return equations_of(read_campaign(folder))


def equations_of(campaign: Campaign) -> Equations:
    """The equations of a campaign."""
    swing = max(float(np.ptp(run.record.yaw_rad)) / 2.0 for run in campaign.runs)
    springs = sorted({stiffness(run) for run in campaign.runs})
    decays = [own_decay(run) for run in campaign.runs]
    still = [d[2] for d, run in zip(decays, campaign.runs, strict=True) if not run.wind_speed]
    zero = float(np.median(still or [d[2] for d in decays]))
    parts = [
        _rows(campaign, number, decays[number][:2], zero, swing, springs)
        for number in range(len(campaign.runs))
    ]
    names = [name for name in NAMES if any(np.any(p[2].get(name, 0.0)) for p in parts)]
    target, nominal = (np.concatenate([p[i] for p in parts]) for i in (0, 1))
    causes = {name: np.concatenate([p[2][name] for p in parts]) for name in names}
    run, phase, level, time = (np.concatenate([p[3][i] for p in parts]) for i in range(4))
    nominal = nominal[:, np.linalg.norm(nominal, axis=0) > 0.0]
    return Equations(target, nominal, causes, run.astype(np.int64), phase, level, time)


def own_decay(run: Run) -> tuple[float, float, float]:
    """Angular frequency (rad/s), decay (1/s) and resting angle (rad) of the damped sinusoid nearest to a run."""
    step = max(1, round(2.0 * np.pi / (_ROWS * frequency(run) * run.record.sample_interval)))
    size = run.record.yaw_rad.size // step * step
    y, time = (v[:size].reshape(-1, step).mean(axis=1) for v in (run.record.yaw_rad, run.record.time_s))
    time = time - time[0]

    def basis(point: Array) -> Array:
        decay = np.exp(-point[1] * time)
        return np.column_stack(
            (decay * np.cos(point[0] * time), decay * np.sin(point[0] * time), np.ones(time.size))
        )

    def left(point: Array) -> Array:
        columns = basis(point)
        return np.asarray(columns @ np.linalg.lstsq(columns, y, rcond=None)[0] - y)

    omega = frequency(run)
    found = least_squares(left, np.array([omega, 0.01 * omega]), x_scale=[0.01 * omega] * 2).x
    return float(found[0]), float(found[1]), float(np.linalg.lstsq(basis(found), y, rcond=None)[0][2])


def stiffness(run: Run) -> float:
    return 1.0 if run.spring_stiffness is None else run.spring_stiffness


def _rows(
    campaign: Campaign,
    number: int,
    decay: Sequence[float],
    zero: float,
    swing: float,
    springs: Sequence[float],
) -> tuple[Array, Array, dict[str, Array], tuple[Array, ...]]:
    """Target, nominal columns, causes, and positions of the rows of one run."""
    run, (omega, sigma) = campaign.runs[number], decay
    record = run.record
    dt = record.sample_interval
    y = record.yaw_rad
    if not record.uniform:
        y = np.interp(record.time_s[0] + dt * np.arange(y.size), record.time_s, y)
    y = y - zero
    width = max(2 * round(np.pi * _CYCLE / (omega * dt)) + 1, 7)
    b = np.asarray(savgol_filter(y, width, 4))
    r = np.asarray(savgol_filter(y, width, 4, deriv=1, delta=dt))
    time, size = dt * np.arange(y.size), np.hypot(b, r / omega)
    step = max(1, round(2.0 * np.pi / (_ROWS * omega * dt)))
    response = cont2discrete(([1.0], [1.0, 2.0 * sigma, omega**2 + sigma**2]), dt, "foh")

    def rows(values: Array) -> Array:
        return np.asarray(values[: y.size // step * step].reshape(-1, step).mean(axis=1))

    def seen(moment: Array) -> Array:
        return rows(lfilter(np.ravel(response[0]), response[1], moment))

    causes = {
        name: [seen(c) for c in columns] for name, columns in moments_of(run, b, r, swing, springs).items()
    }
    causes["sensor_drift"] = [rows(time / time[-1])]
    causes["sensor_nonlinearity"] = [rows(b**3)]
    own = 2 * len(campaign.runs) * [np.zeros(y.size // step)]
    free = np.exp((1j * omega - sigma) * time)
    own[2 * number], own[2 * number + 1] = rows(free.real), rows(free.imag)
    v, q, k = run.wind_speed, (run.air_density or 0.0) * run.wind_speed**2, stiffness(run)
    nominal = [seen(c) for c in (-k * b, -r, q * b, v * r, k * np.ones_like(b))] + own
    noise = max(float(np.std(np.diff(y, 2))) / np.sqrt(6.0), 1e-9)  # white noise, by second differences
    weight = np.sqrt(step) / noise
    target = rows(y) - seen((omega**2 + sigma**2) * b + 2.0 * sigma * r)
    phase = np.arctan2(r / omega, b) % (2.0 * np.pi)
    middle = np.arange(y.size // step) * step + step // 2
    where = (
        np.full(middle.size, number, float),
        phase[middle],
        size[middle] / swing,
        time[middle] / time[-1],
    )
    stacked = {name: weight * np.column_stack(columns) for name, columns in causes.items() if columns}
    return weight * target, weight * np.column_stack(nominal), stacked, where


def moments_of(
    run: Run, b: Array, r: Array, swing: float, springs: Sequence[float]
) -> dict[str, list[Array]]:
    """The moments of the causes along a motion, each up to an unknown factor."""
    v, q, k = run.wind_speed, (run.air_density or 0.0) * run.wind_speed**2, stiffness(run)
    share, windy = np.arange(b.size) / b.size, float(run.wind_speed > 0.0)
    dead, rate = _PLAY * swing, float(np.max(np.abs(r)))
    slope = np.gradient(r, run.record.sample_interval)
    return {
        "coulomb_friction": [-np.tanh(r / (0.02 * rate))],
        "quadratic_damping": [-np.abs(r) * r],
        "structural_damping": [-np.sqrt(k) * r],
        "cubic_stiffness": [-k * b**3],
        "asymmetric_stiffness": [-k * b**2],
        "free_play": [k * np.clip(b, -dead, dead)],
        "gravity_stiffness": [-np.sin(b), np.cos(b)],
        "rod_flexibility": [k * k * b],
        "nonlinear_yaw_moment": [q * b**3],
        "wind_speed_drift": [q * b * share],
        "nonlinear_yaw_damping": [v * b**2 * r],
        "unsteady_aero_lag": [windy * slope],
        "flow_misalignment": [q * np.ones_like(b)],
        "wind_speed_offset": [v * b],
        "spring_miscalibration": [-k * b * (k == one) for one in springs] if len(springs) > 2 else [],
    }


DETECTED = 1.15  # mean square of the rows above which there is a gap; 1.00 ± 0.05 without a gap
CLOSED = 0.5  # minimum share of the gap that named causes explain: most of it


@dataclass(frozen=True, eq=False)
class Regression:
    """The residual equations after projecting out the nominal model, for regressions.

    Args:
        target: the residual, shape (rows,).
        causes: columns by name, orthogonal to the nominal model and to each other within a cause, shape (rows, k).
    """

    target: Array
    causes: Mapping[str, Array]

    @classmethod
    def of(cls, found: Equations) -> Regression:
        """Project the nominal model out."""
        target, causes = found.residuals()
        kept = {}
        for name, columns in causes.items():
            left, size, _ = np.linalg.svd(columns, full_matrices=False)
            raw = np.linalg.norm(found.causes[name])
            # a cause is indistinguishable if the nominal model imitates all but a thousandth of it
            rank = int(np.sum(size > 1e-3 * raw)) if raw > 0.0 else 0
            if rank:
                kept[name] = left[:, :rank]
        return cls(target, kept)

    @property
    def gap(self) -> float:
        """Mean square of the residual in noise variances."""
        return float(self.target @ self.target) / self.target.size

    def unexplained(self, names: Sequence[str]) -> float:
        """Residual mean square with causes."""
        if not names:
            return self.gap
        columns = np.column_stack([self.causes[name] for name in names])
        rest = self.target - columns @ np.linalg.lstsq(columns, self.target, rcond=1e-9)[0]
        return float(rest @ rest) / rest.size

    def verdict(self, named: Sequence[str]) -> list[str]:
        """The answer from a regression's causes: none without a gap, `unknown` if most of the gap is unexplained.

        Args:
            named: causes that the regression selects.
        """
        if self.gap < DETECTED:
            return []
        closed = (self.gap - self.unexplained(named)) / (self.gap - 1.0)
        return list(named) if named and closed > CLOSED else ["unknown"]
