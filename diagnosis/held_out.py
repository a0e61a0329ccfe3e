"""How far the gap closes on runs that were not used for the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.data import Data
from diagnosis.least_squares import Fit, FitError, fit, fit_releases
from diagnosis.problem import Point, Problem
from tunnel_sim.record import Array

_FOLDS = 3


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Prediction of runs left out of the fit.

    Args:
        excess: by run id: mean squared scaled residual minus one, only the run's release refitted.
        common: the common parameters found without each fold, shape (folds, common).
        names: of the common parameters.
    """

    excess: dict[str, float]
    common: Array
    names: tuple[str, ...]

    def jackknife_std(self, name: str, whole: float) -> float:
        """Standard deviation of a common parameter by leaving groups of runs out.

        Args:
            name: of the parameter.
            whole: its estimate from all runs.

        Returns:
            Delete-a-group jackknife (Kott, J. Off. Stat. 17 (2001) 521), in the parameter's unit.
        """
        values = self.common[:, self.names.index(name)]
        count = len(values)
        return float(np.sqrt((count - 1.0) / count * np.sum((values - whole) ** 2))) if count > 1 else 0.0


def folds(data: Data, count: int = _FOLDS) -> list[tuple[str, ...]]:
    """Groups of runs to leave out in turn.

    Args:
        data: the runs.
        count: number of groups, fewer where there are few runs.

    Returns:
        Ids by group. Runs alike in wind and spring go to different groups, and a run that alone stands for its
        spring is left out of none: without it nothing could be said of that spring.
    """
    order = sorted(data.runs, key=lambda run: (run.wind_on, run.spring_stiffness or 0.0, run.wind_speed))
    springs = [run.spring_stiffness for run in data.runs]
    free = [run.id for run in order if springs.count(run.spring_stiffness) > 1]
    count = min(count, len(free))
    if count < 2:
        return []
    return [tuple(free[i::count]) for i in range(count)]


def predict_held_out(whole: Fit) -> HeldOut:
    """Refit without each group of runs, and predict it.

    Args:
        whole: the fit of all runs, from which the smaller fits start.

    Returns:
        The excess of every run that could be left out.
    """
    data = whole.problem.data
    excess: dict[str, float] = {}
    found = []
    ids = [run.id for run in data.runs]
    for group in folds(data):
        keep = [i for i, run_id in enumerate(ids) if run_id not in group]
        out = [i for i, run_id in enumerate(ids) if run_id in group]
        try:
            smaller = fit(
                _restricted(whole.problem, [ids[i] for i in keep]),
                Point(whole.point.common, whole.point.release[keep]),
                base=_sliced(whole, keep),
                tolerance=1e-3,
                max_iterations=6,
            )
            left = fit_releases(
                _restricted(whole.problem, [ids[i] for i in out]),
                Point(smaller.point.common, whole.point.release[out]),
                [whole.jacobian[i][1] for i in out],
            )
        except (FitError, np.linalg.LinAlgError):
            continue
        found.append(smaller.point.common)
        for i, residual in zip(out, left, strict=True):
            excess[ids[i]] = float(np.mean(residual**2)) - 1.0
    common = np.array(found) if found else np.zeros((0, len(whole.problem.names)))
    return HeldOut(excess, common, whole.problem.names)


def _restricted(problem: Problem, ids: list[str]) -> Problem:
    return Problem(problem.data.subset(tuple(ids)), problem.effects, problem.fixed)


def _sliced(whole: Fit, keep: list[int]) -> Fit:
    return Fit(
        _restricted(whole.problem, [whole.problem.data.runs[i].id for i in keep]),
        Point(whole.point.common, whole.point.release[keep]),
        [whole.residuals[i] for i in keep],
        whole.chi2[keep],
        whole.covariance,
        [whole.jacobian[i] for i in keep],
        whole.iterations,
        whole.converged,
    )
