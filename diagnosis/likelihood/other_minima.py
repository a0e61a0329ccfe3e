"""Other minima of χ², and their contribution to a fit's covariance.

An effect names other values that change the slow motion alike (`Effect.alike`). χ² may have a narrow minimum at
each of them, for example at every frequency of a rod's ringing. Gauss–Newton steps then do not lead from one to
another.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.normal_equations import damped_step
from diagnosis.model.parameters import Point
from tunnel_sim.vocabulary.record import Array

_TOGETHER = 16  # points predicted at once: a campaign's predictions fill memory
_REFITTED = 3  # number of best points that are fitted, since linear theory does not show the deepest


@dataclass(frozen=True, eq=False)
class _Elsewhere:
    """Other values of an effect's parameters.

    Args:
        point: the point with the other parameters moved by linear theory.
        total: χ² there, by linear theory.
        held: indices of the fixed common parameters.
    """

    point: Point
    total: float
    held: list[int]


def deepest(fitted: Fit, *, tolerance: float = 1e-4) -> Fit:
    """The fit in the deepest of the minima that its effects name.

    Args:
        fitted: a fit that may be in another minimum.
        tolerance: minimum drop of χ² in a step, as a share of χ², for a fit to continue, as in `fit`.

    Returns:
        The fit of least χ². Its stated covariance includes the other minima, each by its likelihood: among many
        shallow minima, chance may decide which is the deepest.
    """
    found = _elsewhere(fitted)
    if not found:
        return fitted
    best = fitted
    for one in sorted(found, key=lambda one: one.total)[:_REFITTED]:
        other = try_fit(fitted.problem, one.point, tolerance=tolerance)
        if other is not None and other.total < best.total:
            best = other
    return _with_spread(best, found)


def _elsewhere(fitted: Fit) -> list[_Elsewhere]:
    problem, common = fitted.problem, fitted.point.common
    lower, upper = problem.bounds
    tried: list[tuple[Point, list[int]]] = []
    for effect in problem.effects_at(common):
        for trial in effect.alike():
            names = {f"{effect.name}.{name}": value for name, value in trial.values.items()}
            if not names.keys() <= set(problem.names):  # some parameters are fixed
                continue
            at = common.copy()
            at[[problem.names.index(name) for name in names]] = list(names.values())
            if np.all((lower <= at) & (at <= upper)):
                held = [problem.names.index(n) for n in names if n != f"{effect.name}.{trial.scaled}"]
                tried.append((Point(at, fitted.point.per_run), held))
    moved: list[_Elsewhere] = []
    for first in range(0, len(tried), _TOGETHER):
        some = tried[first : first + _TOGETHER]
        predictions = problem.predict([point for point, _ in some])
        for (point, held), prediction in zip(some, predictions, strict=True):
            pairs = zip(problem.data.runs, prediction, strict=True)
            residuals = [run.scaled(run.reading - values) for run, values in pairs]
            if all(np.all(np.isfinite(r)) for r in residuals):
                moved.append(_by_linear_theory(fitted, point, residuals, held))
    return moved


def _by_linear_theory(fitted: Fit, point: Point, residuals: list[Array], held: list[int]) -> _Elsewhere:
    """The point with all but the fixed parameters moved, by the sensitivities of the fit."""
    jacobian = []
    for columns, own in fitted.jacobian:
        free = columns.copy()
        free[:, held] = 0.0
        jacobian.append((free, own))
    there = damped_step(fitted.problem, point, residuals, jacobian, 0.0)
    step, release = there.common - point.common, there.per_run - point.per_run
    left = [
        r - columns @ step - own @ release[i]
        for i, (r, (columns, own)) in enumerate(zip(residuals, jacobian, strict=True))
    ]
    return _Elsewhere(there, sum(float(r @ r) for r in left), held)


def _with_spread(fitted: Fit, found: list[_Elsewhere]) -> Fit:
    """The fit, with its stated covariance including the distance to other likely minima.

    The curvature of the fit's own minimum is already in the covariance; the part that follows from it is left
    out.
    """
    std = np.sqrt(np.maximum(np.diag(fitted.covariance), 1e-300))
    weights, spread = [1.0], np.zeros_like(fitted.covariance)
    for one in found:
        apart, rise = one.point.common - fitted.point.common, max(one.total - fitted.total, 0.0)
        expected = float(np.max((apart / std)[one.held] ** 2))
        if rise < expected:
            weights.append((1.0 - rise / expected) * float(np.exp(-0.5 * rise)))
            spread += weights[-1] * np.outer(apart, apart)
    return dataclasses.replace(fitted, spread=spread / sum(weights))
