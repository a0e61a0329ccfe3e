"""Backbone curves: frequency and damping of every run against its amplitude, with bands.

A linear rig shows level lines. Their slope and curvature are signs of an effect on stiffness or on damping.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.likelihood.run_data import RunData
from diagnosis.policy import COLOURED_RUN
from identification.estimate import NoiseLevel
from identification.signal.decay_fit import Reading, fit_run
from identification.signal.free_decay import Decay
from identification.signal.run_fit import fit_windows
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class Backbone:
    """One run's frequency and damping by windows of three cycles.

    Args:
        id: of the run.
        time: mid-window since the start of the record, shape (n,), s.
        amplitude: at mid-window, shape (n,), rad.
        frequency: undamped natural frequency, shape (n,), Hz.
        frequency_std: of each, shape (n,), Hz, widened where a window's residual is not white.
        zeta: damping ratio, shape (n,).
        zeta_std: likewise, shape (n,).
        nominal_frequency: of the nominal model, Hz; of a body that nothing holds, as `resonance` gives it.
        nominal_zeta: of the nominal model, dimensionless.
        alone_frequency: frequency of a linear fit to this run alone, Hz; None where that fails.
        alone_zeta: damping ratio of the same fit.
        alone_excess: mean squared scaled residual of that fit minus one, a ratio.
    """

    id: str
    time: Array
    amplitude: Array
    frequency: Array
    frequency_std: Array
    zeta: Array
    zeta_std: Array
    nominal_frequency: float
    nominal_zeta: float
    alone_frequency: float | None
    alone_zeta: float | None
    alone_excess: float | None


def backbones(fit: Fit, starts: Sequence[float] = ()) -> list[Backbone]:
    """The backbone of every run.

    Args:
        fit: of the nominal model; gives zero, noise and starting values.
        starts: time that the fit left out at the start of every record, s; nothing where empty.

    Returns:
        One per run, in order; without windows where a run decays too quickly for any, or is driven.
    """
    return [
        _backbone(fit, i, run, starts[i] if starts else 0.0) for i, run in enumerate(fit.problem.data.runs)
    ]


def _backbone(fit: Fit, index: int, run: RunData, start: float) -> Backbone:
    inertia, damping, stiffness = linear_coefficients(fit, index)
    if fit.problem.data.unrestrained:
        stiffness = inertia * (2.0 * np.pi * resonance(fit, index)) ** 2
    if run.drive is not None:
        return _of_driven(run, Decay(0.5 * damping / inertia, max(stiffness, 1e-12) / inertia))
    decay = Decay(0.5 * damping / inertia, max(stiffness, 1e-12) / inertia)
    std = float(run.noise_at(resonance(fit, index)))
    reading = Reading(run.interval * np.arange(run.reading.size, dtype=np.float64), run.reading)
    departs = float(np.mean(fit.residuals[index] ** 2)) > COLOURED_RUN
    noise = NoiseLevel(std, "residual", std, 1.0, departs, disagrees=False)
    windows = fit_windows(reading, decay, fit.zero(index), noise)
    alone = fit_run(reading, decay)
    settled = alone.runs[0] if alone.runs and alone.runs[0].decay.omega_n > 0.0 else None
    return Backbone(
        run.id,
        np.array([start + w.start_s + 0.5 * w.duration_s for w in windows]),
        np.array([w.amplitude.value / w.omega_n.value**run.derivative for w in windows]),
        np.array([w.omega_n.value for w in windows]) / (2.0 * np.pi),
        np.array([w.omega_n.std for w in windows]) / (2.0 * np.pi),
        np.array([w.zeta.value for w in windows]),
        np.array([w.zeta.std for w in windows]),
        decay.omega_n / (2.0 * np.pi),
        decay.zeta,
        None if settled is None else settled.decay.omega_n / (2.0 * np.pi),
        None if settled is None else settled.decay.zeta,
        None if settled is None else float(np.mean((settled.residual / std) ** 2)) - 1.0,
    )


def _of_driven(run: RunData, decay: Decay) -> Backbone:
    none = np.zeros(0)
    nominal = decay.omega_n / (2.0 * np.pi), decay.zeta
    return Backbone(run.id, none, none, none, none, none, none, *nominal, None, None, None)


def drift(curves: list[Backbone]) -> tuple[float, float]:
    """How far the curves are from level.

    Args:
        curves: by run.

    Returns:
        χ² beyond that of level lines, of frequency and of damping: an effect on stiffness raises the first, one
        on damping the second. In each window the two are known equally well in ω, so that they can be compared.
    """
    return (
        sum(_departure(c.frequency, c.frequency_std) for c in curves),
        sum(_departure(c.zeta, c.zeta_std) for c in curves),
    )


def _departure(values: Array, std: Array) -> float:
    if values.size < 2:
        return 0.0
    weight = 1.0 / np.maximum(std, 1e-300) ** 2
    mean = float(weight @ values / weight.sum())
    return float(weight @ (values - mean) ** 2) - (values.size - 1)
