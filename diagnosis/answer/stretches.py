"""Prediction of stretches of time left out of the fit, for runs that cannot be left out as a whole."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from diagnosis.fitting.least_squares import Fit, clip, damped_step, scaled_residuals
from diagnosis.fitting.problem import Point
from diagnosis.fitting.spectra import resonance
from tunnel_sim.vocabulary.record import Array

_FOLDS = 3
_STRETCHES = 9  # in a run: each a ninth of it, or a cycle where the run is short
_STEPS = 6  # Gauss-Newton steps with the slopes of the whole fit, which is close
_TRIES = 4  # dampings tried in a step
_GAIN = 1e-4  # of χ² that a step must save

Turns = Sequence[NDArray[np.int64]]


def turns_of(nominal: Fit, ids: Collection[str]) -> list[NDArray[np.int64]]:
    """In which turn every block of every run is left out of the fit (docs/decisions/0016-held-out-in-time.md).

    Args:
        nominal: gives the runs and their cycles.
        ids: of the runs to divide into stretches.

    Returns:
        By run, shape (n,): the turn, or −1 in the other runs. Every third stretch is left out in the same turn.
    """
    found = []
    for index, run in enumerate(nominal.problem.data.runs):
        count = run.reading.size
        cycles = int(run.duration * resonance(nominal, index))
        stretches = min(max(cycles, _FOLDS), _STRETCHES)
        turn = (np.arange(count) * stretches // count) % _FOLDS
        found.append(np.where(run.id in ids, turn, -1))
    return found


def predict_stretches(whole: Fit, turns: Turns) -> dict[str, Array]:
    """Refit without each turn's stretches, and predict them. No parameter sees the readings left out.

    Args:
        whole: the fit of all blocks, from which the smaller fits start.
        turns: from `turns_of`.

    Returns:
        By id of the runs that are divided: reading minus prediction in noise standard deviations, every block
        predicted by the fit that has not seen it.
    """
    runs = whole.problem.data.runs
    found = {
        run.id: r.copy() for run, r, turn in zip(runs, whole.residuals, turns, strict=True) if turn[0] >= 0
    }
    for number in range(_FOLDS if found else 0):
        out = [turn == number for turn in turns]
        residuals = _refitted(whole, [~left for left in out])
        for run, residual, left in zip(runs, residuals, out, strict=True):
            if left.any():
                found[run.id][left] = residual[left]
    return found


def _refitted(whole: Fit, seen: Sequence[NDArray[np.bool_]]) -> list[Array]:
    """Residuals of all blocks after a fit to those that are seen."""
    slopes = [(c[s], r[s]) for (c, r), s in zip(whole.jacobian, seen, strict=True)]

    def look(point: Point) -> tuple[list[Array], list[Array], float]:
        residuals = scaled_residuals(whole.problem, point)
        visible = [r[s] for r, s in zip(residuals, seen, strict=True)]
        cost = sum(float(r @ r) for r in visible)
        return residuals, visible, cost if np.isfinite(cost) else np.inf

    point, damping = whole.point, 1e-6
    residuals, visible, cost = look(point)
    for _ in range(_STEPS):
        before = cost
        for _ in range(_TRIES):
            trial = clip(whole.problem, damped_step(whole.problem, point, visible, slopes, damping))
            there = look(trial)
            if there[2] < cost:
                point, (residuals, visible, cost) = trial, there
                damping *= 0.2
                break
            damping = max(damping * 10.0, 1e-4)
        if before - cost < _GAIN * before:
            break
    return residuals
