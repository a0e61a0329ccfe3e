"""The moment that is missing from the nominal model, computed from the residuals, over angle and rate.

A small moment m added to the model changes the angle by ρ with I ρ̈ + C ρ̇ + K ρ = m: the residual, inserted in
the equation of the fitted run, gives the missing moment, smoothed over part of a cycle. This is the restoring-force
surface of Masri & Caughey, J. Appl. Mech. 46 (1979) 433, doi 10.1115/1.3424568, from residuals instead of readings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.likelihood.run_data import RunData
from tunnel_sim.vocabulary.record import Array

_WINDOW = (
    0.4  # of a cycle: passes the third harmonic at half height and keeps the noise of two derivatives down
)
_BINS = 15  # along each axis of the map
_LEAST = 8  # residuals in a bin, for it to be shown


@dataclass(frozen=True, eq=False)
class Apparent:
    """The missing moment along one run.

    Args:
        angle: of the motion, shape (n,), rad.
        rate: of the motion over its angular frequency, shape (n,), rad.
        moment: smoothed, shape (n,), N m; rad/s² in normalised form.
        start: index of the first residual these belong to.
        kernel: weights on residuals in rad that gave the moment, shape (m,).
        noise_std: of one residual, rad.
    """

    angle: Array
    rate: Array
    moment: Array
    start: int
    kernel: Array
    noise_std: float

    def summed(self, inside: np.ndarray) -> tuple[float, float]:
        """The moment summed over some instants, and the variance of the sum under white noise.

        Args:
            inside: which instants, shape (n,), true or false.

        Returns:
            Sum of the moment over the instants and the variance of that sum.
        """
        weight = np.convolve(inside.astype(np.float64), self.kernel)
        return float(self.moment[inside].sum()), float(weight @ weight) * self.noise_std**2


def motion(fit: Fit, index: int) -> tuple[Array, Array]:
    """Angle and rate of the fitted motion of one run.

    Returns:
        Angle from the zero, rad, and rate over the angular frequency, rad, each of shape (n,).
    """
    run: RunData = fit.problem.data.runs[index]
    reading = run.reading - run.unscaled(fit.residuals[index]) - fit.zero(index)
    omega = 2.0 * np.pi * resonance(fit, index)
    slope = np.gradient(reading, run.interval) / omega
    # Each derivative of an oscillation leads by a quarter cycle and is ω times as large.
    angle, rate = ((reading, slope), (-slope, reading), (-reading, -slope))[run.derivative]
    return angle / omega**run.derivative, rate / omega**run.derivative


def apparent_moment(fit: Fit, index: int) -> Apparent | None:
    """The moment that is missing in one run.

    Args:
        fit: of the nominal model.

    Returns:
        The moment; None where the run is sampled too slowly or too short, or the reading is not an angle.
    """
    run = fit.problem.data.runs[index]
    inertia, damping, stiffness = linear_coefficients(fit, index)
    frequency = resonance(fit, index)
    width = 2 * round(0.5 * _WINDOW / (frequency * run.interval)) + 1
    if run.derivative or width < 5 or width > run.reading.size // 4:
        return None
    kernel = _kernel(width, run.interval, frequency, (stiffness, damping, inertia))
    scale = float(run.noise_at(frequency))
    angle, rate = motion(fit, index)
    half = width // 2
    inner = slice(half, run.reading.size - half)
    moment = np.convolve(run.unscaled(fit.residuals[index]), kernel, mode="valid")
    return Apparent(angle[inner], rate[inner], moment, half, kernel, scale)


def _cubic_weights(width: int, order: int, interval: float) -> Array:
    """Weights of a convolution for the derivative of the cubic fitted to `width` samples, in their middle.

    Savitzky & Golay, Anal. Chem. 36 (1964) 1627, doi 10.1021/ac60214a047; SciPy's own are slow to load.
    """
    places = np.arange(width)[::-1] - width // 2.0
    wanted = np.zeros(4)
    wanted[order] = math.factorial(order) / interval**order
    return np.asarray(lstsq(places ** np.arange(4.0)[:, None], wanted)[0])


def _kernel(width: int, interval: float, frequency: float, coefficients: tuple[float, float, float]) -> Array:
    """Weights of K ρ + C ρ̇ + I ρ̈, smoothed, and exact at the run's own frequency."""
    omega = 2.0 * np.pi * frequency
    phase = np.exp(-1j * omega * interval * (np.arange(width) - width // 2))
    result = np.zeros(width)
    for order, coefficient in enumerate(coefficients):
        weights = _cubic_weights(width, order, interval)
        gain = complex(weights @ phase) / (1j * omega) ** order
        # derivatives of the local cubic fall short by a few per cent, as much as the moment sought
        result += coefficient * weights / gain.real
    return result


@dataclass(frozen=True, eq=False)
class PhasePlane:
    """The mean missing moment by angle and rate.

    Args:
        edges: of the bins of both axes, shape (n + 1,), rad.
        moment: mean by rate (rows) and angle (columns), shape (n, n); NaN where too few residuals fall.
        std: of each mean under white noise, shape (n, n).
        by_angle: mean over all rates, shape (n,).
        by_angle_std: likewise, shape (n,).
        by_rate: mean over all angles, shape (n,).
        by_rate_std: likewise, shape (n,).
        unit: of the moment: ``N m``, or ``rad/s2`` in normalised form.
        runs: ids of the runs included.
    """

    edges: Array
    moment: Array
    std: Array
    by_angle: Array
    by_angle_std: Array
    by_rate: Array
    by_rate_std: Array
    unit: str
    runs: tuple[str, ...]


def phase_plane(fit: Fit, run_ids: tuple[str, ...]) -> PhasePlane | None:
    """The map of the missing moment.

    Args:
        fit: of the nominal model.
        run_ids: runs to include; all where empty.

    Returns:
        The map; None where no run allows one.
    """
    data = fit.problem.data
    chosen = [i for i, run in enumerate(data.runs) if not run_ids or run.id in run_ids]
    found = [(data.runs[i].id, a) for i in chosen if (a := apparent_moment(fit, i)) is not None]
    if not found:
        return None
    runs = [a for _, a in found]
    reach = max(float(np.max(np.hypot(a.angle, a.rate))) for a in runs)
    edges = np.linspace(-reach, reach, _BINS + 1)
    columns = [np.clip(np.digitize(a.angle, edges) - 1, 0, _BINS - 1) for a in runs]
    rows = [np.clip(np.digitize(a.rate, edges) - 1, 0, _BINS - 1) for a in runs]
    cells = [r * _BINS + c for r, c in zip(rows, columns, strict=True)]
    plane, plane_std = _binned(runs, cells, _BINS * _BINS)
    by_angle, by_angle_std = _binned(runs, columns, _BINS)
    by_rate, by_rate_std = _binned(runs, rows, _BINS)
    return PhasePlane(
        edges,
        plane.reshape(_BINS, _BINS),
        plane_std.reshape(_BINS, _BINS),
        by_angle,
        by_angle_std,
        by_rate,
        by_rate_std,
        "rad/s2" if data.normalised else "N m",
        tuple(name for name, _ in found),
    )


def _binned(runs: list[Apparent], cells: list[np.ndarray], count: int) -> tuple[Array, Array]:
    """Mean and standard deviation by cell, over all runs."""
    total, variance, number = np.zeros(count), np.zeros(count), np.zeros(count)
    for run, cell in zip(runs, cells, strict=True):
        for index in np.unique(cell):
            inside = cell == index
            summed, spread = run.summed(inside)
            total[index] += summed
            variance[index] += spread
            number[index] += int(inside.sum())
    shown = number >= _LEAST
    number = np.maximum(number, 1.0)
    return np.where(shown, total / number, np.nan), np.where(shown, np.sqrt(variance) / number, np.nan)
