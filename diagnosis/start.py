"""Where fits start: the nominal model from the record alone, and an effect's severity from its signature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.data import Data, RunData
from diagnosis.equation_error import equation_error_start
from diagnosis.least_squares import Fit, clip, normal_equations, scaled_residuals
from diagnosis.problem import Point, Problem
from diagnosis.spectra import Line, mains_line, shedding_line
from tunnel_sim.effects import Effect
from tunnel_sim.record import Array

_GROSS = 0.01  # share of the reading's power
_FAR = 2.0  # rad: where a limit on one side only puts the other
_PADDING = 16  # zero padding of the spectrum that gives the first frequency


def nominal_start(data: Data) -> Point:
    """A starting point for the nominal model.

    Args:
        data: the runs.

    Returns:
        Inertia and aerodynamic stiffness by linear regression of the runs' frequencies, a small damping, and
        the releases from the first samples.
    """
    omega2 = np.array([(2.0 * np.pi * _frequency(run)) ** 2 for run in data.runs])
    zero = float(np.median([np.mean(run.reading) for run in data.runs]))
    release = np.array([[np.mean(run.reading[:3]) - zero, 0.0] for run in data.runs])
    if data.normalised:
        return Point(
            np.array(
                [float(np.median(omega2)), 0.01 * float(np.sqrt(np.median(omega2))), *_still(data), zero]
            ),
            release,
        )
    spring = np.array([run.spring_stiffness for run in data.runs], dtype=np.float64)
    pressure = np.array(
        [0.5 * r.air_density * r.wind_speed**2 * data.frontal_area * data.reference_length for r in data.runs]
    )
    # Kr = Izz ω² + pressure Cnβ, relative errors alike
    design = np.column_stack([omega2, pressure]) / spring[:, None]
    if not data.wind_on:
        design = design[:, :1]
    solution = np.linalg.lstsq(design, np.ones(len(spring)), rcond=None)[0]
    inertia = float(solution[0]) if solution[0] > 0.0 else float(np.median(spring / omega2))
    air = (float(solution[1]), 0.0) if data.wind_on else ()
    damping = 0.01 * inertia * float(np.sqrt(np.median(omega2)))
    return Point(np.array([inertia, damping, *air, zero]), release)


def _still(data: Data) -> tuple[float, ...]:
    return (0.0, 0.0) if data.wind_on else ()


def _frequency(run: RunData) -> float:
    """Frequency of the greatest peak of a run's spectrum, Hz."""
    values = run.reading - run.reading.mean()
    size = _PADDING * values.size
    power = np.abs(np.fft.rfft(values * np.hanning(values.size), size)) ** 2
    peak = int(np.argmax(power[1:-1])) + 1
    left, middle, right = np.log(power[peak - 1 : peak + 2])
    offset = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return float((peak + offset) / (size * run.interval))


@dataclass(frozen=True)
class Lead:
    """A starting point for an effect, and what its signature promises.

    Args:
        problem: the fit with the effect added.
        point: where to start.
        promise: drop of χ² by linear theory, dimensionless.
        balanced: whether the point comes from the balance of moments.
    """

    problem: Problem
    point: Point
    promise: float
    balanced: bool = False


def leads(base: Fit, kind: type[Effect]) -> list[Lead]:
    """Starting points for adding one effect to a fitted problem, the most promising first.

    Args:
        base: the fit without it.
        kind: the effect to add.

    Returns:
        One lead per trial value of its further parameters; none where the effect cannot be seen in these runs.
    """
    data = base.problem.data
    if kind.condition == "wind_on" and not data.wind_on:
        return []
    if kind.name in ("mains_hum", "vortex_shedding"):
        line = mains_line(base) if kind.name == "mains_hum" else shedding_line(base)
        return [] if line is None else [_line_lead(base, kind, line)]
    found = [_lead(base, kind, trial) for trial in (*_trials(data, kind), *_bent_trials(data, kind))]
    if is_gross(base):
        found.append(_balance_lead(base, kind))
    return sorted((lead for lead in found if lead is not None), key=lambda lead: -lead.promise)


def is_gross(fit: Fit) -> bool:
    """Whether a fit misses the motion itself, so that its sensitivities say little.

    Args:
        fit: any fit.

    Returns:
        True where the residual holds more than a hundredth of the reading's power.
    """
    readings = sum(
        float(np.sum((r.reading - np.mean(r.reading)) ** 2 / r.noise_variance)) for r in fit.problem.data.runs
    )
    return fit.total > _GROSS * readings


def _balance_lead(base: Fit, kind: type[Effect]) -> Lead | None:
    # where gravity is most of the stiffness, its rest angle and the sensor's zero are one
    fixed = dict(base.problem.fixed) | (
        {"gravity_stiffness.rest_angle": 0.0} if kind.name == "gravity_stiffness" else {}
    )
    problem = Problem(
        base.problem.data, (*base.problem.effects, kind), tuple(fixed.items()), base.problem.bent
    )
    point = equation_error_start(problem)
    if point is None:
        return None
    point = clip(problem, point)
    total = sum(float(r @ r) for r in scaled_residuals(problem, point))
    return Lead(problem, point, base.total - total, balanced=True) if np.isfinite(total) else None


def _line_lead(base: Fit, kind: type[Effect], line: Line) -> Lead:
    problem = Problem(base.problem.data, (*base.problem.effects, kind), base.problem.fixed, base.problem.bent)
    severity, place = kind.parameters()
    lower, upper = severity.lower, severity.upper
    values = np.array(
        [np.clip(line.amplitude, lower, upper), np.clip(line.parameter, place.lower, place.upper)]
    )
    release = np.column_stack([base.point.release, line.phases])
    return Lead(problem, Point(np.concatenate([base.point.common, values]), release), line.drop)


def _trials(data: Data, kind: type[Effect]) -> list[dict[str, float]]:
    """Trial parameters: a severity of typical size, further parameters at values worth trying."""
    infos = kind.parameters()
    severity = infos[0]
    rest: list[dict[str, float]] = [{}]
    if kind.name == "spring_miscalibration":
        rest = [{"spring_stiffness": k} for k in data.springs] if len(data.springs) > 1 else []
    elif kind.name == "rod_flexibility":
        rest = [{"inertia_share": s} for s in (0.05, 0.2, 0.5)]
    elif kind.name == "sensor_clipping":
        return _clipping_trials(data)
    elif kind.name == "wind_speed_drift" and data.normalised:
        return []
    elif kind.name == "unsteady_aero_lag":
        return [{"lag": severity.scale}, {"lag": -severity.scale}]
    scale = severity.scale * (_moment_scale(data) if severity.unit.startswith("N m") else 1.0)
    return [{severity.name: scale, **other} for other in rest]


def _bent_trials(data: Data, kind: type[Effect]) -> list[dict[str, float]]:
    """Trials for forms that open a direction of their own: the last value given is the one that is scaled."""
    if kind.name == "sensor_nonlinearity":
        cubic, square = (
            next(i.scale for i in kind.parameters() if i.name == name)
            for name in ("coefficient", "quadratic")
        )
        return [{"coefficient": 0.01 * cubic, "quadratic": square}]
    if kind.name == "sensor_clipping":
        return [
            {"limit": _FAR, "centre": side * (_FAR - trial["limit"])}
            for trial in _clipping_trials(data)
            for side in (-1.0, 1.0)
        ]
    return []


def _moment_scale(data: Data) -> float:
    """Moments are per unit inertia in normalised form."""
    return 10.0 if data.normalised else 1.0


def _clipping_trials(data: Data) -> list[dict[str, float]]:
    top = max(float(np.max(np.abs(run.reading))) for run in data.runs)
    return [{"limit": top * share} for share in (0.999, 0.99, 0.97, 0.93, 0.87, 0.8)]


def _lead(base: Fit, kind: type[Effect], trial: dict[str, float]) -> Lead | None:
    held = {"spring_stiffness"} if kind.name == "spring_miscalibration" else set()
    fixed = (*base.problem.fixed, *((f"{kind.name}.{n}", v) for n, v in trial.items() if n in held))
    bends = any(info.form and info.name in trial for info in kind.parameters())
    bent = (*base.problem.bent, kind.name) if bends else base.problem.bent
    problem = Problem(base.problem.data, (*base.problem.effects, kind), fixed, bent)
    infos = [info for info in kind.parameters() if info.name not in held and (bends or not info.form)]
    names = [info.name for info in infos]
    scaled = names.index(list(trial)[-1]) if bends else 0
    values = np.array([trial.get(info.name, info.default) for info in infos])
    clipping = kind.name == "sensor_clipping"
    change = _moderate_change(base, problem, values, scaled if not clipping else None)
    if change is None:
        return None
    left = project_out(base, change)
    power = sum(float(c @ c) for c in left)
    if power <= 0.0:
        return None
    slope = sum(float(c @ r) for c, r in zip(left, base.residuals, strict=True)) / power
    start = values.copy()
    promise = slope * slope * power
    if not clipping:
        start[scaled] = np.clip(slope * values[scaled], infos[scaled].lower, infos[scaled].upper)
        if start[scaled] == 0.0:
            start[scaled], promise = 0.01 * values[scaled], 0.0
    return Lead(problem, Point(np.concatenate([base.point.common, start]), base.point.release), promise)


def _moderate_change(base: Fit, problem: Problem, values: Array, scaled: int | None) -> list[Array] | None:
    """Change of the scaled prediction by an effect, one value lowered until the change is no wild one.

    ``values`` holds the effect's parameters and is changed in place to those that were used; ``scaled`` is the
    place of the one that is lowered, None where none may be.
    """
    data = base.problem.data
    scale = [np.sqrt(run.noise_variance) for run in data.runs]
    limit = 3.0 * np.sqrt(base.total)
    for _ in range(12):
        moved = problem.predict([Point(np.concatenate([base.point.common, values]), base.point.release)])[0]
        change = [
            (m - run.reading) / s + r
            for m, run, r, s in zip(moved, data.runs, base.residuals, scale, strict=True)
        ]
        size = float(np.sqrt(sum(float(c @ c) for c in change)))
        if np.isfinite(size) and (size <= limit or scaled is None):
            return change
        if scaled is None:
            return None
        values[scaled] *= 0.1 if not np.isfinite(size) else max(0.01, 0.5 * limit / size)
    return None


def project_out(base: Fit, columns: list[Array]) -> list[Array]:
    """What of a change of the prediction the fitted parameters cannot absorb.

    Args:
        base: a fit, whose common parameters and releases absorb.
        columns: scaled change by run, each of shape (n,).

    Returns:
        The remainder, by run.
    """
    matrix, gradient, solutions = normal_equations(base.jacobian, columns)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    step = np.linalg.lstsq(matrix / np.outer(scale, scale), gradient / scale, rcond=1e-12)[0] / scale
    return [
        column - common @ step - release @ (solution[:, -1] - solution[:, :-1] @ step)
        for column, (common, release), solution in zip(columns, base.jacobian, solutions, strict=True)
    ]
