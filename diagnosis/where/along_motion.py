"""The gap along the motion: frequency and damping by amplitude, and the missing moment by angle and rate.

A linear rig has level backbone curves. Their slope and curvature are signs of an effect on stiffness or on damping.

A small moment m added to the model changes the angle by ρ with I ρ̈ + C ρ̇ + K ρ = m: the residual, inserted in
the equation of the fitted run, gives the missing moment, smoothed over part of a cycle. This is the
restoring-force surface of Masri & Caughey, J. Appl. Mech. 46 (1979) 433, doi 10.1115/1.3424568, from residuals
instead of readings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import lstsq

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from identification.estimate import NoiseLevel
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.free_decay import Decay
from identification.signal.run_fit import fit_windows
from tunnel_sim.files.from_json import Row, Rows
from tunnel_sim.vocabulary.record import Array

RUN_DEPARTS: Final = 1.5
"""Ratio of the mean squared residual of a run to the noise variance above which the model does not fit the
run. Judgement."""


@dataclass(frozen=True, eq=False)
class Backbone:
    """One run's frequency and damping by windows of three cycles; none where it decays too quickly or is driven.

    Args:
        id: of the run.
        time_s: mid-window since the start of the record, shape (n,), s.
        amplitude_rad: at mid-window, shape (n,), rad.
        frequency_hz: undamped natural frequency, shape (n,), Hz.
        frequency_std: standard deviation of each frequency, shape (n,), Hz, widened where a window's residual
            is not white.
        zeta: damping ratio, shape (n,).
        zeta_std: standard deviation of each damping ratio, shape (n,).
        nominal_frequency_hz: frequency of the nominal model, Hz; for a body without a spring, from `resonance`.
        nominal_zeta: damping ratio of the nominal model, dimensionless.
        alone_frequency_hz: frequency of a linear fit to this run alone, Hz; None where that fails.
        alone_zeta: damping ratio of the same fit.
        alone_excess: mean squared scaled residual of that fit minus one, a ratio.
    """

    id: str
    time_s: Row
    amplitude_rad: Row
    frequency_hz: Row
    frequency_std: Row
    zeta: Row
    zeta_std: Row
    nominal_frequency_hz: float
    nominal_zeta: float
    alone_frequency_hz: float | None = None
    alone_zeta: float | None = None
    alone_excess: float | None = None


def backbones(fit: Fit) -> list[Backbone]:
    """The backbone of every run, by a fit of the nominal model, in the measured rig's units."""
    curves = []
    seconds, hertz, radians = (fit.problem.data.similarity.own(1.0, unit) for unit in ("s", "Hz", "rad"))
    for index, run in enumerate(fit.problem.data.runs):
        inertia, damping, stiffness = linear_coefficients(fit, index)
        stiffness = fit.problem.data.model.restoring(inertia, stiffness)
        decay = Decay(0.5 * damping / inertia, max(stiffness, 1e-12) / inertia)
        nominal = decay.omega_n / (2.0 * np.pi) * hertz, decay.zeta
        if run.drive is not None:
            none = np.zeros(0)
            curves.append(Backbone(run.id, none, none, none, none, none, none, *nominal))
            continue
        std = float(run.noise_at(resonance(fit, index)))
        reading = Reading(run.interval * np.arange(run.reading.size, dtype=np.float64), run.reading)
        departs = float(np.mean(fit.residuals[index] ** 2)) > RUN_DEPARTS
        noise = NoiseLevel(std, "residual", std, 1.0, departs, disagrees=False)
        windows = fit_windows(reading, decay, fit.zero(index), noise)
        fitted = fit_run(reading, decay).runs
        alone: tuple[float | None, ...] = None, None, None
        if fitted and fitted[0].decay.omega_n > 0.0:
            own, excess = fitted[0].decay, float(np.mean((fitted[0].residual / std) ** 2)) - 1.0
            alone = own.omega_n / (2.0 * np.pi) * hertz, own.zeta, excess
        backbone = Backbone(
            run.id,
            np.array([run.start + w.start_s + 0.5 * w.duration_s for w in windows]) * seconds,
            np.array([w.amplitude.value / w.omega_n.value**run.derivative for w in windows]) * radians,
            np.array([w.omega_n.value for w in windows]) / (2.0 * np.pi) * hertz,
            np.array([w.omega_n.std for w in windows]) / (2.0 * np.pi) * hertz,
            np.array([w.zeta.value for w in windows]),
            np.array([w.zeta.std for w in windows]),
            *nominal,
            *alone,
        )
        curves.append(backbone)
    return curves


def drift(curves: list[Backbone]) -> tuple[float, float]:
    """Deviation of the curves from level lines: χ² of frequency and of damping.

    An effect on stiffness raises the first, an effect on damping the second. In units of ω, each window
    determines both equally well, so they can be compared.
    """
    return (
        sum(_departure(c.frequency_hz, c.frequency_std) for c in curves),
        sum(_departure(c.zeta, c.zeta_std) for c in curves),
    )


def _departure(values: Array, std: Array) -> float:
    if values.size < 2:
        return 0.0
    weight = 1.0 / np.maximum(std, 1e-300) ** 2
    mean = float(weight @ values / weight.sum())
    return float(weight @ (values - mean) ** 2) - (values.size - 1)


_WINDOW = (
    0.4  # share of a cycle: passes the third harmonic at half height and limits the noise of two derivatives
)
_BINS = 15  # number of bins along each axis of the map
_LEAST = 8  # minimum number of residuals in a bin for it to be shown


@dataclass(frozen=True, eq=False)
class Apparent:
    """The missing moment along one run.

    Args:
        angle: angle of the motion, shape (n,), rad.
        rate: rate of the motion over its angular frequency, shape (n,), rad.
        moment: smoothed moment, shape (n,), N m; rad/s² in normalised form.
        start: index of the residual at which these begin.
        kernel: weights on residuals in rad that gave the moment, shape (m,).
        noise_std: noise of one residual, rad.
    """

    angle: Array
    rate: Array
    moment: Array
    start: int
    kernel: Array
    noise_std: float


def motion(fit: Fit, index: int) -> tuple[Array, Array]:
    """Angle and rate over the angular frequency of the fitted motion of a run, from the zero, rad, shape (n,)."""
    run = fit.problem.data.runs[index]
    reading = run.reading - run.unscaled(fit.residuals[index]) - fit.zero(index)
    omega = 2.0 * np.pi * resonance(fit, index)
    slope = np.gradient(reading, run.interval) / omega
    # Each derivative of an oscillation leads by a quarter cycle and is ω times as large.
    angle, rate = ((reading, slope), (-slope, reading), (-reading, -slope))[run.derivative]
    return angle / omega**run.derivative, rate / omega**run.derivative


def amplitude_about_rest(fit: Fit, index: int) -> Array:
    """Amplitude of the fitted motion of a run about its rest, rad, shape (n,).

    A free decay ends at the zero of the fit. A driven body, or one without a restoring moment, may rest
    anywhere: the middle of its run counts.
    """
    angle, rate = motion(fit, index)
    data = fit.problem.data
    run = data.runs[index]
    if run.derivative == 0 and (run.drive is not None or not data.model.restored):
        angle = angle - float(np.mean(angle))
    return np.asarray(np.hypot(angle, rate), np.float64)


def apparent_moment(fit: Fit, index: int) -> Apparent | None:
    """The moment missing from the model in a run; None where the run is too short, too slow or not of an angle."""
    run = fit.problem.data.runs[index]
    inertia, damping, stiffness = linear_coefficients(fit, index)
    frequency = resonance(fit, index)
    width = 2 * round(0.5 * _WINDOW / (frequency * run.interval)) + 1
    if run.derivative or width < 5 or width > run.reading.size // 4:
        return None
    half, omega = width // 2, 2.0 * np.pi * frequency
    # K ρ + C ρ̇ + I ρ̈ by the derivatives of the cubic fitted to `width` residuals, in their middle (Savitzky &
    # Golay, Anal. Chem. 36 (1964) 1627, doi 10.1021/ac60214a047; SciPy's own are slow to load)
    places = np.arange(width)[::-1] - width // 2.0
    phase = np.exp(-1j * omega * run.interval * (np.arange(width) - half))
    kernel = np.zeros(width)
    for order, coefficient in enumerate((stiffness, damping, inertia)):
        wanted = np.zeros(4)
        wanted[order] = math.factorial(order) / run.interval**order
        weights = np.asarray(lstsq(places ** np.arange(4.0)[:, None], wanted)[0])
        gain = complex(weights @ phase) / (1j * omega) ** order
        # derivatives of the local cubic fall short by a few per cent, as much as the moment sought
        kernel += coefficient * weights / gain.real
    angle, rate = motion(fit, index)
    inner = slice(half, run.reading.size - half)
    moment = np.convolve(run.unscaled(fit.residuals[index]), kernel, mode="valid")
    return Apparent(angle[inner], rate[inner], moment, half, kernel, float(run.noise_at(frequency)))


@dataclass(frozen=True, eq=False)
class PhasePlane:
    """The mean missing moment by angle and rate.

    Args:
        edges_rad: edges of the bins of both axes, shape (n + 1,), rad.
        moment: mean by rate (rows) and angle (columns), shape (n, n); NaN in bins with too few residuals.
        std: standard deviation of each mean under white noise, shape (n, n).
        by_angle: mean over all rates, shape (n,).
        by_angle_std: standard deviation of each, shape (n,).
        by_rate: mean over all angles, shape (n,).
        by_rate_std: standard deviation of each, shape (n,).
        unit: unit of the moment: ``N m``, or ``rad/s2`` in normalised form.
        runs: ids of the averaged runs.
    """

    edges_rad: Row
    moment: Rows
    std: Rows
    by_angle: Row
    by_angle_std: Row
    by_rate: Row
    by_rate_std: Row
    unit: str
    runs: tuple[str, ...]


def phase_plane(fit: Fit, run_ids: tuple[str, ...]) -> PhasePlane | None:
    """The map of the missing moment in some runs, or in all if none is named; None without any."""
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
    unit = data.model.moment_unit
    factor = data.similarity.own(1.0, unit)
    plane, plane_std = (
        values.reshape(_BINS, _BINS) for values in _binned(runs, cells, _BINS * _BINS, factor)
    )
    by_angle, by_rate = _binned(runs, columns, _BINS, factor), _binned(runs, rows, _BINS, factor)
    edges = edges * data.similarity.own(1.0, "rad")
    return PhasePlane(edges, plane, plane_std, *by_angle, *by_rate, unit, tuple(name for name, _ in found))


def _binned(runs: list[Apparent], cells: list[np.ndarray], count: int, factor: float) -> tuple[Array, Array]:
    """Mean by cell over all runs and its standard deviation under white noise, times a factor."""
    total, variance, number = np.zeros(count), np.zeros(count), np.zeros(count)
    for run, cell in zip(runs, cells, strict=True):
        for index in np.unique(cell):
            inside = cell == index
            weight = np.convolve(inside.astype(np.float64), run.kernel)
            total[index] += float(run.moment[inside].sum())
            variance[index] += float(weight @ weight) * run.noise_std**2
            number[index] += int(inside.sum())
    shown = number >= _LEAST
    number = np.maximum(number, 1.0)
    mean, std = total / number, np.sqrt(variance) / number
    return np.where(shown, mean, np.nan) * factor, np.where(shown, std, np.nan) * factor
