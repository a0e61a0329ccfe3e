"""Fits of some of the readings, or of some of the parameters, that start from the fit of all."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from diagnosis.likelihood.least_squares import Fit, clip, scaled_residuals
from diagnosis.likelihood.normal_equations import damped_step
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from tunnel_sim.vocabulary.record import Array

_STEPS = 6  # Gauss–Newton steps without a group
_TRIES = 4  # number of tried dampings in a step
_GAIN = 1e-4  # minimum drop of χ² in a step, as a share of χ²
_RELEASE_STEPS = 4  # two steps are enough with slopes at nearly the same parameters
_RELEASE_GAIN = 1e-6  # minimum drop of a run's χ² in a step, as a share of χ²


def refit_releases(problem: Problem, start: Point, slopes: list[Array]) -> tuple[Point, list[Array]]:
    """Fit only each run's own parameters: release and phases.

    Args:
        start: common parameters, which are fixed, and releases to start from.
        slopes: derivatives of the scaled prediction to each run's own parameters, shape (n, own), from a fit
            at nearly the same parameters.

    Returns:
        The point with each run's best parameters, and the scaled residuals there by run.
    """
    best, residuals = start, scaled_residuals(problem, start)
    root = np.sqrt(problem.parameters.precision)
    for _ in range(_RELEASE_STEPS):
        steps = []
        for slope, residual, away in zip(slopes, residuals, problem.parameters.pull(best), strict=True):
            rows, values = slope, residual
            if root.any():  # the priors are further rows
                rows = np.vstack([slope, np.diag(root)])
                values = np.append(residual, away / np.where(root > 0.0, root, 1.0))
            steps.append(np.linalg.lstsq(rows, values, rcond=1e-10)[0])
        trial = Point(best.common, best.per_run + np.stack(steps))
        moved = scaled_residuals(problem, trial)
        with np.errstate(invalid="ignore"):  # a run with a diverging prediction is unchanged
            saved = problem.parameters.surprises(best) - problem.parameters.surprises(trial)
            gains = [float(r @ r - m @ m) + own for r, m, own in zip(residuals, moved, saved, strict=True)]
        better = [gain > _RELEASE_GAIN * float(r @ r) for gain, r in zip(gains, residuals, strict=True)]
        if not any(better):
            break
        best = Point(best.common, np.where(np.array(better)[:, None], trial.per_run, best.per_run))
        residuals = [m if keep else r for m, r, keep in zip(moved, residuals, better, strict=True)]
    return best, residuals


def fit_seen(
    whole: Fit, seen: Sequence[NDArray[np.bool_]], held: Collection[str] = ()
) -> tuple[Point, list[Array]]:
    """Fit some of the blocks, with the sensitivities of the fit of all blocks.

    Args:
        seen: the blocks to fit, by run, shape (n,).
        held: names of common parameters to be kept fixed.

    Returns:
        The point found, and the scaled residuals of all blocks there. Parameters at a bound, and the own
        parameters of a run without blocks to fit, are unchanged.
    """
    free = np.array(
        [whole.bound(name) is None and name not in held for name in whole.problem.names], np.float64
    )
    slopes = [(c[s] * free, r[s]) for (c, r), s in zip(whole.jacobian, seen, strict=True)]

    def look(point: Point) -> tuple[Point, list[Array], list[Array], float]:
        residuals = scaled_residuals(whole.problem, point)
        visible = [r[s] for r, s in zip(residuals, seen, strict=True)]
        cost = sum(float(r @ r) for r in visible) + whole.problem.parameters.surprise(point)
        return point, residuals, visible, cost if np.isfinite(cost) else np.inf

    damping = 1e-6
    point, residuals, visible, cost = look(whole.point)
    for _ in range(_STEPS):
        before = cost
        for _ in range(_TRIES):
            there = look(clip(whole.problem, damped_step(whole.problem, point, visible, slopes, damping)))
            if there[-1] < cost:
                point, residuals, visible, cost = there
                damping *= 0.2
                break
            damping = max(damping * 10.0, 1e-4)
        if before - cost < _GAIN * before:
            break
    return point, residuals
