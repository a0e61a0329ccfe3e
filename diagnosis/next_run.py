"""The run that would tell two fitted models apart."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from diagnosis.data import RunData
from diagnosis.least_squares import Fit, project_release
from diagnosis.problem import Point, Problem
from tunnel_sim.record import Array

_ANGLES = (0.35, 0.14)  # rad
_SPEEDS = (0.0, 10.0, 20.0, 30.0)  # m/s
_STIFFNESS_FACTORS = (0.5, 1.0, 2.0)
_DURATIONS = (10.0, 30.0)  # s


def separating_run(first: Fit, second: Fit) -> dict[str, Any] | None:
    """Among feasible runs, the one whose readings the two models predict most differently.

    Args:
        first: a fitted model.
        second: its rival, fitted to the same runs.

    Returns:
        Spring stiffness (N m/rad), wind speed (m/s), release angle (rad), duration (s) and the expected
        separation in standard deviations of the noise, after the release is refitted; None in normalised form.
    """
    data = first.problem.data
    if data.normalised:
        return None
    best: tuple[float, RunData, float] | None = None
    for run, angle in _designs(first):
        difference = separation(first, second, run, angle)
        if difference is not None and (best is None or difference > best[0]):
            best = (difference, run, angle)
    if best is None:
        return None
    apart, run, angle = best
    return {
        "spring_stiffness": run.spring_stiffness,
        "wind_speed": run.wind_speed,
        "release_angle": angle,
        "duration": run.duration,
        "separation": apart,
    }


def planned_run(
    fit: Fit, *, spring_stiffness: float, wind_speed: float, air_density: float, duration: float
) -> RunData:
    """A run that has not been made, with the sampling and the noise of those that have.

    Args:
        fit: to the runs made.
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s.
        air_density: ρ, kg/m³; not used where the wind is off.
        duration: s.
    """
    template = fit.problem.data.runs[0]
    return dataclasses.replace(
        template,
        id="next",
        reading=np.zeros(round(duration / template.interval)),
        spring_stiffness=spring_stiffness,
        wind_speed=wind_speed,
        air_density=air_density if wind_speed > 0.0 else 0.0,
        duration=duration,
    )


def _designs(fit: Fit) -> list[tuple[RunData, float]]:
    data = fit.problem.data
    density = max((run.air_density for run in data.runs), default=0.0) or 1.2
    springs = sorted({round(k * f, 2) for k in data.springs for f in _STIFFNESS_FACTORS} | set(data.springs))
    speeds = [v for v in _SPEEDS if v == 0.0 or data.wind_on]
    designs = []
    for spring in springs[:: max(1, len(springs) // 4)]:
        for speed in speeds:
            for duration in _DURATIONS:
                run = planned_run(
                    fit, spring_stiffness=spring, wind_speed=speed, air_density=density, duration=duration
                )
                designs += [(run, angle) for angle in _ANGLES]
    return designs


def separation(first: Fit, second: Fit, run: RunData, angle: float) -> float | None:
    """How far apart two models predict one run's readings, once its release is refitted.

    Args:
        first: a fitted model.
        second: its rival.
        run: its conditions and length; the reading in it is not used.
        angle: of the release, rad.

    Returns:
        Standard deviations of the noise; None where a model's motion grows without bound. Half its square is the
        log-likelihood ratio, nats, that the run is expected to bring if one of the two is right.
    """
    predictions = []
    for fit in (first, second):
        problem = Problem(
            fit.problem.data.with_runs((run,)), fit.problem.effects, fit.problem.fixed, fit.problem.bent
        )
        own = fit.point.release.shape[1]
        points = [Point(fit.point.common, np.array([[angle, 0.0, *[0.0] * (own - 2)]]))]
        for step in ((1e-4 * angle, 0.0), (0.0, 1e-3 * angle)):
            points.append(
                Point(fit.point.common, points[0].release + np.array([[*step, *[0.0] * (own - 2)]]))
            )
        predictions.append([values[0] for values in problem.predict(points)])
    base = predictions[0][0]
    change: Array = predictions[1][0] - base
    slopes = np.stack([predictions[0][1] - base, predictions[0][2] - base], axis=1)
    if not (np.all(np.isfinite(change)) and np.all(np.isfinite(slopes))):
        return None
    left = project_release(change, slopes)
    return float(np.sqrt(left @ left / run.noise_variance))
