"""Starting points for motions that the nominal model misses grossly: the balance of moments, sample by sample.

Where a fitted trajectory is out of phase with the record, its sensitivities are useless. The equation of motion is
linear in the parameters of many effects, so that a regression on smoothed angle, rate and acceleration (the
equation-error method; Klein & Morelli, Aircraft System Identification, AIAA 2006) gives a starting point.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear
from scipy.signal import detrend, savgol_filter

from diagnosis.fitting.problem import Point, Problem
from diagnosis.fitting.run_data import Data, RunData
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.record import Array

_SMOOTHING = 0.05  # of a period: the length of the smoothing polynomial
_ORDER = 3


def equation_error_start(problem: Problem) -> Point | None:
    """Parameter values by regression of the balance of moments.

    Args:
        problem: runs, and effects that are linear in their parameters.

    Returns:
        A starting point; None where an effect is not linear in its severity, or the regression fails.
    """
    nothing = np.zeros(1)
    if any(kind.regressor(nothing, nothing, 1.0) is None for kind in problem.effects):
        return None
    data = problem.data
    own = [float(np.median(run.reading[-run.reading.size // 4 :])) for run in data.runs]
    common_zero = float(np.median(own))
    rows, targets, releases = [], [], []
    for run, own_zero in zip(data.runs, own, strict=True):
        zero = own_zero if data.own_zeros else common_zero
        angle, rate, acceleration = _smoothed(run, zero)
        start = (
            float(angle[0] if run.derivative else run.reading[0] - zero),
            float(rate[: max(1, rate.size // 200)].mean()),
        )
        releases.append((*start, zero) if data.own_zeros else start)
        edge = max(3, angle.size // 100)
        inside = slice(edge, -edge)
        design, target = _balance(problem, run, angle[inside], rate[inside], acceleration[inside])
        rows.append(design)
        targets.append(target)
    matrix, target = np.concatenate(rows), np.concatenate(targets)
    scale = np.sqrt(np.mean(matrix**2, axis=0)) + 1e-300
    lower, upper = _solution_bounds(problem)
    solution = lsq_linear(matrix / scale, target, bounds=(lower * scale, upper * scale)).x / scale
    if not np.all(np.isfinite(solution)):
        return None
    return Point(_common(problem, solution, common_zero), np.array(releases))


def _solution_bounds(problem: Problem) -> tuple[Array, Array]:
    """Bounds of the regressed parameters: the nominal ones without the zero, then the severities."""
    lower, upper = (
        dict(zip(problem.names, problem.bounds[0], strict=True)),
        dict(zip(problem.names, problem.bounds[1], strict=True)),
    )
    names = [name for name in problem.nominal_names if name != "zero"]
    severities = [f"{kind.name}.{kind.parameters()[0].name}" for kind in problem.effects]
    for kind, key in zip(problem.effects, severities, strict=True):
        if _is_share(problem, kind):  # regressed as a moment, whose bounds are not the share's
            lower[key], upper[key] = -np.inf, np.inf
    keys = [*names, *severities]
    return np.array([lower[key] for key in keys]), np.array([upper[key] for key in keys])


def _is_share(problem: Problem, kind: type[Effect]) -> bool:
    """Whether an effect's severity is a share of a stiffness not yet known: it is regressed as a moment."""
    return problem.data.normalised and kind.parameters()[0].per_stiffness


def _smoothed(run: RunData, zero: float) -> tuple[Array, Array, Array]:
    values = run.reading - zero
    crossings = np.flatnonzero(np.diff(np.signbit(values - np.mean(values))))
    period = 2.0 * run.interval * values.size / max(len(crossings), 2)
    length = max(2 * int(0.5 * _SMOOTHING * period / run.interval) + 1, _ORDER + 2 + _ORDER % 2)
    length = min(length, values.size - 1 + values.size % 2)
    for _ in range(run.derivative):  # a rate's integral, whose drift is the zero's error
        values = detrend(np.cumsum(values) * run.interval)
    found = [savgol_filter(values, length, _ORDER, deriv=k, delta=run.interval) for k in range(3)]
    return found[0], found[1], found[2]


def _balance(
    problem: Problem, run: RunData, angle: Array, rate: Array, acceleration: Array
) -> tuple[Array, Array]:
    """Regressors in the order of the nominal parameters (without the zero), then the effects; and the target."""
    data: Data = problem.data
    spring = 1.0 if data.normalised else run.spring_stiffness or 1.0
    columns = [-angle if data.normalised else -acceleration, -rate]
    if data.wind_on:
        pressure = data.air_moment(run)
        columns.append(pressure * angle)
        columns.append(pressure * data.reference_length / max(run.wind_speed, 1e-9) * rate)
    regressors = [kind.regressor(angle, rate, spring) for kind in problem.effects]
    columns += [column for column in regressors if column is not None]
    return np.stack(columns, axis=1), acceleration if data.normalised else spring * angle


def _common(problem: Problem, solution: Array, zero: float) -> Array:
    """The solution in the order of the problem's common parameters."""
    nominal = [name for name in problem.nominal_names if name != "zero"]
    count = len(nominal)
    values = dict(zip(nominal, solution[:count], strict=True))
    values["zero"] = zero
    for kind, value in zip(problem.effects, solution[count:], strict=True):
        severity, *rest = kind.parameters()
        share = _is_share(problem, kind)
        values[f"{kind.name}.{severity.name}"] = (
            value / max(abs(values["stiffness"]), 1e-9) if share else value
        )
        for info in rest:  # held ones are not among the names
            values[f"{kind.name}.{info.name}"] = info.default
    return np.array([values[name] for name in problem.names])
