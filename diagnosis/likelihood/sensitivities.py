"""Sensitivities of the scaled prediction: exact in the motion, finite differences where it has no derivative."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.slopes import changes
from diagnosis.model.parameters import Point
from tunnel_sim.vocabulary.record import Array

#: Derivatives by run: with respect to the common parameters, shape (n, common), and the run's own, shape (n, own).
Jacobian: TypeAlias = list[tuple[Array, Array]]


def sensitivities(
    problem: Problem, point: Point, base: Jacobian | None = None, prediction: list[Array] | None = None
) -> Jacobian:
    """Derivatives of the scaled prediction.

    Args:
        base: derivatives from a fit of the same runs with fewer parameters, which come first; they are reused.
        prediction: prediction at the point, by run, if known.
    """
    known, known_own = (0, 0) if base is None else (base[0][0].shape[1], base[0][1].shape[1])
    points, steps = moves(problem, point, known, known_own)
    found = motion_changes(problem, point, points)
    lost = np.flatnonzero([any(np.isnan(change[i, 0]) for change in found) for i in range(len(points))])
    if lost.size:
        moved = [points[i] for i in lost]
        if prediction is None:
            prediction, *predictions = problem.predict([point, *moved])
        else:
            predictions = problem.predict(moved)
        with np.errstate(invalid="ignore"):  # a run that diverged; the caller checks for it
            for place, values in zip(lost, predictions, strict=True):
                for change, here, there in zip(found, prediction, values, strict=True):
                    change[place] = there - here
    common = len(problem.names) - known
    result = []
    for r, run in enumerate(problem.data.runs):
        with np.errstate(invalid="ignore"):  # as above
            scaled = run.scaled((found[r] / steps[:, r, None]).T)
        by_common, by_own = scaled[:, :common], scaled[:, common:]
        if base is not None:
            known_common, known_ends = base[r]
            by_common, by_own = (
                np.column_stack([known_common, by_common]),
                np.column_stack([known_ends, by_own]),
            )
        result.append((by_common, by_own))
    return result


def moves(problem: Problem, point: Point, known: int = 0, known_own: int = 0) -> tuple[list[Point], Array]:
    """Points one small step away for each parameter: first the common ones, then every run's own.

    Args:
        known: number of leading common parameters to leave out.
        known_own: number of leading own parameters of every run to leave out.

    Returns:
        The points, and their steps by run, in the parameters' units, shape (points, runs).
    """
    count = len(point.per_run)
    steps, points = problem.parameters.steps(point.common), []
    for i in range(known, steps.size):
        moved = point.common.copy()
        moved[i] += steps[i]
        points.append(Point(moved, point.per_run))
    amplitude = np.maximum(np.abs(point.per_run[:, 0]), 1e-3)
    own_steps = problem.parameters.own_steps(amplitude)
    for j in range(known_own, point.per_run.shape[1]):
        release = point.per_run.copy()
        release[:, j] += own_steps[j]
        points.append(Point(point.common, release))
    sizes = [np.full(count, step) for step in steps[known:]] + own_steps[known_own:]
    return points, np.array(sizes).reshape(len(points), count)


def motion_changes(problem: Problem, point: Point, points: list[Point]) -> list[Array]:
    """Changes of the predicted block means from a point to others near it, to first order.

    Returns:
        By run, in the unit of the reading, shape (points, n); NaN throughout where the motion has no derivative.
    """
    runs = problem.data.runs
    if not points:
        return [np.zeros((0, run.reading.size)) for run in runs]
    asked = problem.asked(
        [point, *points], [(i, r) for i in range(len(points) + 1) for r in range(len(runs))]
    )
    found = changes(asked, len(runs))
    return [run.in_blocks(change) for change, run in zip(found, runs, strict=True)]
