"""Prediction of stretches of time left out of the fit, for runs that cannot be left out as a whole."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from diagnosis.answer.held_out import FOLDS, fit_seen
from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.spectra import resonance
from tunnel_sim.vocabulary.record import Array

_STRETCHES = 9  # in a run: each a ninth of it, or a cycle where the run is short

Turns = Sequence[NDArray[np.int64]]


def turns_of(nominal: Fit, ids: Collection[str]) -> list[NDArray[np.int64]]:
    """In which turn every block of every run is left out of the fit.

    See docs/decisions/0016-held-out-cause-by-cause.md.

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
        stretches = min(max(cycles, FOLDS), _STRETCHES)
        turn = (np.arange(count) * stretches // count) % FOLDS
        found.append(np.where(run.id in ids, turn, -1))
    return found


def predict_stretches(whole: Fit, turns: Turns) -> dict[str, Array]:
    """Refit without each turn's stretches, and predict them. No parameter sees the readings left out.

    Args:
        whole: the fit of all blocks, from which the smaller fits start.
        turns: from `turns_of`.

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
