"""The normal equations of a campaign's least squares, with the releases eliminated run by run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from tunnel_sim.vocabulary.quantities import Vector
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class Products:
    """Products of the sensitivities, computed once per point.

    Args:
        own: each run's own sensitivities with themselves, plus the precision of their priors, shape (runs, own,
            own).
        mixed: the own sensitivities with the common ones, shape (runs, own, common).
        common: the common sensitivities with themselves, by run, shape (runs, common, common).
    """

    own: Array
    mixed: Array
    common: Array

    @classmethod
    def of(cls, jacobian: list[tuple[Array, Array]], precision: Array | None = None) -> Products:
        """The products of the results of `sensitivities`.

        Args:
            precision: precision of the own parameters' priors, shape (own,); None: they have none.
        """
        own = np.stack([release.T @ release for _, release in jacobian])
        return cls(
            own if precision is None or not precision.any() else own + np.diag(precision),
            np.stack([release.T @ common for common, release in jacobian]),
            np.stack([common.T @ common for common, _ in jacobian]),
        )


def normal_equations(
    jacobian: list[tuple[Array, Array]],
    residuals: list[Array],
    damping: float = 0.0,
    products: Products | None = None,
    pull: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Normal matrix and gradient of the common parameters, releases eliminated; arguments as in `by_run`.

    Returns:
        Matrix (common, common), gradient (common,), and the (runs, own, common + 1) solutions that give the
        releases' steps: release = solution[:, -1] − solution[:, :-1] @ common step.
    """
    matrices, gradients, solutions = by_run(jacobian, residuals, damping, products, pull)
    return matrices.sum(axis=0), gradients.sum(axis=0), solutions


def by_run(
    jacobian: list[tuple[Array, Array]],
    residuals: list[Array],
    damping: float = 0.0,
    products: Products | None = None,
    pull: Array | None = None,
) -> tuple[Array, Array, Array]:
    """As `normal_equations`, before the sum over the runs.

    Args:
        jacobian: from `sensitivities`.
        residuals: scaled residuals.
        damping: damping of the release's step, as a share of its diagonal.
        products: products of the jacobian, if known.
        pull: pull of the own parameters' priors, shape (runs, own), as `ParameterSet.pull`; None: none.

    Returns:
        Matrices, shape (runs, common, common), gradients, shape (runs, common), and the solutions of
        `normal_equations`.
    """
    columns = list(zip(jacobian, residuals, strict=True))
    with np.errstate(over="ignore", invalid="ignore"):  # a run diverged; its step is refused
        known = Products.of(jacobian) if products is None else products
        seen = np.stack([release.T @ r for (_, release), r in columns])[:, :, None]
        seen = seen if pull is None else seen + pull[:, :, None]
        cross = np.concatenate([known.mixed, seen], axis=2)
        size = np.sqrt(np.maximum(np.diagonal(known.own, axis1=1, axis2=2), 1e-300))
        ridge = known.own / (size[:, :, None] * size[:, None, :]) + (1e-12 + damping) * np.eye(size.shape[1])
        solutions = np.linalg.solve(ridge, cross / size[:, :, None]) / size[:, :, None]
        absorbed = np.swapaxes(cross[:, :, :-1], 1, 2) @ solutions
        seen_common = np.stack([common.T @ r for (common, _), r in columns])
        return known.common - absorbed[:, :, :-1], seen_common - absorbed[:, :, -1], solutions


def damped_step(
    problem: Problem,
    point: Point,
    residuals: list[Array],
    jacobian: list[tuple[Array, Array]],
    damping: float,
    products: Products | None = None,
    *,
    linear: bool = False,
) -> Point:
    """The end of a Gauss–Newton step, the common parameters inside their bounds.

    Args:
        residuals: scaled, by run.
        jacobian: from `sensitivities`, of the same rows as the residuals.
        damping: added to the scaled normal matrix's diagonal, dimensionless.
        products: products of the jacobian, if known.
        linear: whether the residuals are a change from an optimum at which priors and readings are in balance.
    """
    parameters = problem.parameters
    known = Products.of(jacobian, parameters.precision) if products is None else products
    pull = parameters.pull(point) if parameters.precision.any() and not linear else None
    matrix, gradient, solutions = normal_equations(jacobian, residuals, damping, known, pull)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale) + damping * np.eye(len(scale))
    lower, upper = problem.bounds
    step = bounded_step(
        scaled, gradient / scale, (lower - point.common) * scale, (upper - point.common) * scale
    )
    release = solutions[:, :, -1] - solutions[:, :, :-1] @ (step / scale)
    return Point(np.clip(point.common + step / scale, lower, upper), point.per_run + release)


def bounded_step(matrix: Array, gradient: Vector, lower: Array, upper: Array) -> Array:
    """The solution of the normal equations; parameters that would leave their range are fixed at its end.

    Args:
        matrix: symmetric, shape (n, n).
        lower: least steps, at most 0, shape (n,).
        upper: greatest steps, at least 0, shape (n,).
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


def project_release(change: Vector, slopes: Array) -> Array:
    """The part of a change of one run's prediction that its release cannot absorb.

    Args:
        slopes: derivatives to the release, shape (n, own).
    """
    left: Array = change - slopes @ np.linalg.lstsq(slopes, change, rcond=1e-10)[0]
    return left
