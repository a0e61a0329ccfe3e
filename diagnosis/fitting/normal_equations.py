"""One Gauss–Newton step of a campaign: its normal equations, with the releases eliminated run by run."""

from __future__ import annotations

import numpy as np

from diagnosis.fitting.problem import Point, Problem
from tunnel_sim.vocabulary.record import Array


def normal_equations(
    jacobian: list[tuple[Array, Array]], residuals: list[Array], damping: float = 0.0
) -> tuple[Array, Array, list[Array]]:
    """Normal matrix and gradient of the common parameters with every run's release eliminated.

    Args:
        jacobian: from `sensitivities`.
        residuals: scaled.
        damping: of the release's own step, as a share of its diagonal.

    Returns:
        Matrix (common, common), gradient (common,), and per run the (2, common + 1) solution that gives the
        release's step: release = solution[:, -1] − solution[:, :-1] @ common step.
    """
    count = jacobian[0][0].shape[1]
    matrix, gradient = np.zeros((count, count)), np.zeros(count)
    solutions = []
    for (common, release), r in zip(jacobian, residuals, strict=True):
        inner = release.T @ release
        cross = np.column_stack([release.T @ common, release.T @ r])
        size = np.sqrt(np.maximum(np.diag(inner), 1e-300))
        ridge = inner / np.outer(size, size) + (1e-12 + damping) * np.eye(len(size))
        solution = np.linalg.solve(ridge, cross / size[:, None]) / size[:, None]
        matrix += common.T @ common - cross[:, :-1].T @ solution[:, :-1]
        gradient += common.T @ r - cross[:, :-1].T @ solution[:, -1]
        solutions.append(solution)
    return matrix, gradient, solutions


def damped_step(
    problem: Problem,
    point: Point,
    residuals: list[Array],
    jacobian: list[tuple[Array, Array]],
    damping: float,
) -> Point:
    """Where a Gauss–Newton step leads.

    Args:
        problem: gives the bounds.
        point: where to start.
        residuals: scaled, by run.
        jacobian: from `sensitivities`, of the same rows as the residuals.
        damping: added to the scaled normal matrix's diagonal, dimensionless.

    Returns:
        The point, its common parameters inside their bounds.
    """
    matrix, gradient, solutions = normal_equations(jacobian, residuals, damping)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale) + damping * np.eye(len(scale))
    lower, upper = problem.bounds
    step = bounded_step(
        scaled, gradient / scale, (lower - point.common) * scale, (upper - point.common) * scale
    )
    release = np.stack([s[:, -1] - s[:, :-1] @ (step / scale) for s in solutions])
    return Point(np.clip(point.common + step / scale, lower, upper), point.release + release)


def bounded_step(matrix: Array, gradient: Array, lower: Array, upper: Array) -> Array:
    """The solution of the normal equations, those parameters held at a bound that would leave their range.

    Args:
        matrix: symmetric, shape (n, n).
        gradient: shape (n,).
        lower: least steps, at most 0, shape (n,).
        upper: greatest steps, at least 0, shape (n,).

    Returns:
        Steps within their bounds, shape (n,).
    """
    step, free = np.zeros(gradient.size), np.ones(gradient.size, dtype=bool)
    while free.any():
        held = gradient[free] - matrix[np.ix_(free, ~free)] @ step[~free]
        step[free] = np.linalg.lstsq(matrix[np.ix_(free, free)], held, rcond=1e-13)[0]
        outside = free & ((step < lower) | (step > upper))
        if not outside.any():
            break
        step[outside] = np.clip(step, lower, upper)[outside]
        free &= ~outside
    return step


def project_release(change: Array, slopes: Array) -> Array:
    """The part of a change of one run's prediction that its release cannot absorb.

    Args:
        change: shape (n,).
        slopes: derivatives to the release, shape (n, own).

    Returns:
        The remainder, shape (n,).
    """
    left: Array = change - slopes @ np.linalg.lstsq(slopes, change, rcond=1e-10)[0]
    return left
