"""How far the gap closes on readings that were not used for the fit: runs, or stretches of time."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.likelihood.least_squares import Fit, FitError, clip, damped_step, scaled_residuals
from diagnosis.likelihood.problem import Point, Problem
from diagnosis.likelihood.residuals import resonance
from diagnosis.likelihood.run_data import Data, RunData
from tunnel_sim.vocabulary.record import Array

FOLDS = 3
_STEPS = 6  # Gauss–Newton steps without a group
_TRIES = 4  # dampings tried in a step
_GAIN = 1e-4  # share of χ² that a step must save
_RELEASE_STEPS = 4  # two are enough where the slopes are those of nearly the same parameters
_RELEASE_GAIN = 1e-6  # of a run's χ² that a step must save


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Prediction of runs left out of the fit.

    Args:
        residuals: by run id: reading minus prediction in noise standard deviations, only the run's own
            parameters refitted.
        points: by run id: the common parameters found without it, and its own.
    """

    residuals: dict[str, Array]
    points: dict[str, tuple[Array, Array]]

    @property
    def excess(self) -> dict[str, float]:
        """By run id: mean squared scaled residual minus one."""
        return {run: float(np.mean(residual**2)) - 1.0 for run, residual in self.residuals.items()}


def folds(data: Data, count: int = FOLDS) -> list[tuple[str, ...]]:
    """Groups of runs to leave out in turn.

    Args:
        count: number of groups, fewer where there are few runs.

    Returns:
        Ids by group. Runs with the same wind and spring go to different groups, and the runs kept always include
        every spring, wind-off runs, wind-on runs and an input of unknown gain: the others could not be predicted
        without them. The only run of its kind is in no group.
    """
    order = sorted(data.runs, key=lambda run: (run.wind_on, run.spring_stiffness or 0.0, run.wind_speed))
    free = [run for run in order if _covers(data, [run])]
    count = min(count, len(free))
    if count < 2:
        return []
    groups: list[list[RunData]] = [[] for _ in range(count)]
    for i, run in enumerate(free):
        for turn in range(count):
            group = groups[(i + turn) % count]
            if _covers(data, [*group, run]):
                group.append(run)
                break
    return [tuple(run.id for run in group) for group in groups if group]


def _covers(data: Data, left_out: list[RunData]) -> bool:
    """Whether the other runs have every spring, wind on and off, and an input of unknown gain, as all runs have."""
    gone = {run.id for run in left_out}

    def kinds(runs: Sequence[RunData]) -> tuple[set[object], ...]:
        return (
            {run.gain_free for run in runs},
            {run.spring_stiffness for run in runs},
            {run.wind_on for run in runs},
        )

    return kinds(data.runs) == kinds([run for run in data.runs if run.id not in gone])


def predict_held_out(whole: Fit) -> HeldOut:
    """Refit without each group of runs, starting from the fit of all, and predict it."""
    data = whole.problem.data
    residuals: dict[str, Array] = {}
    points: dict[str, tuple[Array, Array]] = {}
    ids = [run.id for run in data.runs]
    for group in folds(data):
        out = [i for i, run_id in enumerate(ids) if run_id in group]
        seen = [np.full(run.reading.size, run.id not in group) for run in data.runs]
        try:
            common = fit_seen(whole, seen)[0].common
            released, left = refit_releases(
                replace(whole.problem, data=data.subset(tuple(ids[i] for i in out))),
                Point(common, whole.point.release[out]),
                [whole.jacobian[i][1] for i in out],
            )
        except (FitError, np.linalg.LinAlgError):
            continue
        for k, i in enumerate(out):
            residuals[ids[i]] = left[k]
            points[ids[i]] = (released.common, released.release[k])
    return HeldOut(residuals, points)


def refit_releases(problem: Problem, start: Point, slopes: list[Array]) -> tuple[Point, list[Array]]:
    """Fit only each run's own parameters: release and phases.

    Args:
        start: common parameters, which are held, and releases to start from.
        slopes: derivatives of the scaled prediction to each run's own parameters, shape (n, own), from a fit of
            about the same parameters.

    Returns:
        The point found, each run at its own best, and the scaled residuals there by run.
    """
    best, residuals = start, scaled_residuals(problem, start)
    for _ in range(_RELEASE_STEPS):
        steps = [np.linalg.lstsq(s, r, rcond=1e-10)[0] for s, r in zip(slopes, residuals, strict=True)]
        trial = Point(best.common, best.release + np.stack(steps))
        moved = scaled_residuals(problem, trial)
        with np.errstate(invalid="ignore"):  # a prediction that grows without bound is left as it is
            gains = [float(r @ r - m @ m) for r, m in zip(residuals, moved, strict=True)]
        better = [gain > _RELEASE_GAIN * float(r @ r) for gain, r in zip(gains, residuals, strict=True)]
        if not any(better):
            break
        best = Point(best.common, np.where(np.array(better)[:, None], trial.release, best.release))
        residuals = [m if keep else r for m, r, keep in zip(moved, residuals, better, strict=True)]
    return best, residuals


def fit_seen(whole: Fit, seen: Sequence[NDArray[np.bool_]]) -> tuple[Point, list[Array]]:
    """Fit some of the blocks, with the sensitivities of the fit of all blocks, which is close.

    Args:
        seen: by run the blocks to fit, shape (n,).

    Returns:
        The point found, and the scaled residuals of all blocks there. Parameters at a bound, and the own parameters
        of a run that is not seen, stay as they were.
    """
    free = np.array([whole.bound(name) is None for name in whole.problem.names], np.float64)
    slopes = [(c[s] * free, r[s]) for (c, r), s in zip(whole.jacobian, seen, strict=True)]

    def look(point: Point) -> tuple[Point, list[Array], list[Array], float]:
        residuals = scaled_residuals(whole.problem, point)
        visible = [r[s] for r, s in zip(residuals, seen, strict=True)]
        cost = sum(float(r @ r) for r in visible)
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


_STRETCHES = 9  # in a run: each a ninth of it, or a cycle where the run is short

Turns = Sequence[NDArray[np.int64]]


def turns_of(nominal: Fit, ids: Collection[str]) -> list[NDArray[np.int64]]:
    """In which turn every block of every run is left out of the fit.

    See docs/decisions/0016-held-out-cause-by-cause.md.

    Returns:
        By run, shape (n,): the turn, or −1 in the other runs. Every third stretch is left out in the same turn.
    """
    found = []
    for index, run in enumerate(nominal.problem.data.runs):
        count = run.reading.size
        cycles = int(run.duration * resonance(nominal, index))
        stretches = min(max(cycles, FOLDS), _STRETCHES)
        turn = (np.arange(count) * stretches // count) % FOLDS
        found.append(np.where(run.id in ids, turn, -1))
    return found


def predict_stretches(whole: Fit, turns: Turns) -> dict[str, Array]:
    """Refit without each turn's stretches, and predict them. No parameter sees the readings left out.

    Returns:
        By id of the runs that are divided: reading minus prediction in noise standard deviations, every block
        predicted by the fit that has not seen it, unless that fit failed.
    """
    runs = whole.problem.data.runs
    found = {
        run.id: r.copy() for run, r, turn in zip(runs, whole.residuals, turns, strict=True) if turn[0] >= 0
    }
    for number in range(FOLDS if found else 0):
        out = [turn == number for turn in turns]
        try:
            _, residuals = fit_seen(whole, [~left for left in out])
        except np.linalg.LinAlgError:
            continue
        for run, residual, left in zip(runs, residuals, out, strict=True):
            if left.any():
                found[run.id][left] = residual[left]
    return found
