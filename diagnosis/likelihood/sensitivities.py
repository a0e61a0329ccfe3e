"""Sensitivities of the scaled prediction, by finite differences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from diagnosis.likelihood.least_squares import Fit


def sensitivities(
    problem: Problem, point: Point, base: Fit | None = None, prediction: list[Array] | None = None
) -> list[tuple[Array, Array]]:
    """Derivatives of the scaled prediction by finite differences.

    Args:
        base: a fit of the same runs; its derivatives are reused for the parameters it has.
        prediction: at the point, by run, where it is known.

    Returns:
        By run: with respect to the common parameters, shape (n, common), and the run's own, shape (n, own).
    """
    known = 0 if base is None else len(base.problem.names)
    known_own = 0 if base is None else base.point.release.shape[1]
    steps = problem.parameters.steps(point.common)
    points = []
    for i in range(known, steps.size):
        moved = point.common.copy()
        moved[i] += steps[i]
        points.append(Point(moved, point.release))
    amplitude = np.maximum(np.abs(point.release[:, 0]), 1e-3)
    own = point.release.shape[1]
    release_steps = problem.parameters.own_steps(amplitude)
    for j in range(known_own, own):
        release = point.release.copy()
        release[:, j] += release_steps[j]
        points.append(Point(point.common, release))
    if prediction is None:
        prediction, *predictions = problem.predict([point, *points])
    else:
        predictions = problem.predict(points)
    result = []
    for r, run in enumerate(problem.data.runs):
        with np.errstate(invalid="ignore"):  # a run that grew without bound; the caller looks for it
            changes = [run.scaled(moved[r] - prediction[r]) for moved in predictions]
        common = [c / steps[known + i] for i, c in enumerate(changes[: steps.size - known])]
        ends = [c / release_steps[known_own + j][r] for j, c in enumerate(changes[steps.size - known :])]
        if base is None:
            result.append((np.stack(common, axis=1), np.stack(ends, axis=1)))
        else:
            known_common, known_ends = base.jacobian[r]
            result.append((np.column_stack([known_common, *common]), np.column_stack([known_ends, *ends])))
    return result
