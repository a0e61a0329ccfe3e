"""Fits to all runs but one: by linear theory from the fit to all of them, and refitted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.normal_equations import by_run
from diagnosis.model.parameters import Point
from tunnel_sim.vocabulary.record import Array

_UNDETERMINED = 1e-9  # minimum share of its information on a parameter that the other runs must have
_ITERATIONS = 10  # iterations of a fit without a run: it starts nearby


@dataclass(frozen=True, eq=False)
class WithoutRuns:
    """The fits without each run by linear theory.

    Args:
        fitted: the fit to all runs.
        common: common parameters without each run, shape (runs, common).
        stds: standard deviations of the common parameters, with the misfit of the other runs as noise, shape
            (runs, common); infinite where the other runs do not determine them.
        total: χ² of the other runs, with the priors of their own parameters, shape (runs,).
        count: number of residuals of the other runs, shape (runs,).
    """

    fitted: Fit
    common: Array
    stds: Array
    total: Array
    count: Array

    @classmethod
    def of(cls, fitted: Fit) -> WithoutRuns:
        """From a converged fit; parameters at a bound stay there."""
        parameters, names = fitted.problem.parameters, fitted.problem.names
        pull = parameters.pull(fitted.point) if parameters.precision.any() else None
        matrices, gradients, _ = by_run(
            fitted.jacobian, fitted.residuals, products=fitted.products, pull=pull
        )
        whole = matrices.sum(axis=0)
        free = np.array([fitted.bound(name) is None for name in names]) & (np.diag(whole) > 0.0)
        size = np.sqrt(np.where(free, np.diag(whole), 1.0))
        matrices, gradients = matrices / np.outer(size, size), gradients / size
        own = np.array([float(r @ r) for r in fitted.residuals]) + parameters.surprises(fitted.point)
        filled = np.array([run.filled for run in fitted.problem.data.runs])
        common, stds, total = [], [], []
        for place in range(len(matrices)):
            left = (matrices.sum(axis=0) - matrices[place])[np.ix_(free, free)]
            slope = (gradients.sum(axis=0) - gradients[place])[free]
            inverse = np.linalg.pinv(left, rcond=1e-12, hermitian=True)
            step, std = np.zeros(size.size), np.full(size.size, np.inf)
            step[free] = inverse @ slope
            known = np.diag(left) > _UNDETERMINED
            total.append(float(np.delete(own, place).sum() - slope @ inverse @ slope))
            misfit = max(1.0, total[-1] / max(float(np.delete(filled, place).sum()), 1.0))
            std[free] = np.where(known, np.sqrt(np.maximum(np.diag(inverse), 0.0) * misfit), np.inf)
            common.append(fitted.point.common + step / size)
            stds.append(std / size)
        return cls(fitted, np.stack(common), np.stack(stds), np.array(total), filled.sum() - filled)


def refitted_without(fitted: Fit, index: int) -> Fit | None:
    """The fit of a problem to all runs but one, with unchanged noise and widths; None where it fails.

    Args:
        index: index of the left-out run.
    """
    data = fitted.problem.data
    others = data.with_runs(tuple(run for place, run in enumerate(data.runs) if place != index))
    start = Point(fitted.point.common, np.delete(fitted.point.per_run, index, axis=0))
    return try_fit(replace(fitted.problem, data=others), start, max_iterations=_ITERATIONS)
