"""Outsiders: known causes of a gap that are not in the vocabulary of effects.

An effect of the vocabulary may close most of a gap that it did not cause. Where an outsider closes more, the answer
is `unknown`, with a caution that names the outsider. Each is linear in its size, so that the residuals and
sensitivities of the nominal fit are enough to weigh it; no simulation is needed. A gain that drifts in proportion
to time is not among them: the damping absorbs it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import solve_banded

from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.run_data import RunData
from diagnosis.fitting.starting_points import project_out
from tunnel_sim.vocabulary.record import Array

# s: how slowly a zero follows; one that follows at once is a sensor's curve
_TIMES = (0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True)
class Outsider:
    """A cause outside the vocabulary, and how much of the gap it leaves.

    Args:
        words: its description.
        share: share of the gap it leaves open.
    """

    words: str
    share: float


def weigh_outsiders(nominal: Fit) -> Outsider | None:
    """The outsider that closes most of the nominal model's gap.

    Returns:
        The best; None where there is no gap.
    """
    if nominal.excess <= 0.0:
        return None
    motions = _motions(nominal)
    found = [
        Outsider(words, share)
        for words, columns in _OUTSIDERS
        for share in (_share_left(nominal, trial) for trial in columns(motions))
    ]
    return min(found, key=lambda outsider: outsider.share)


@dataclass(frozen=True, eq=False)
class _Motion:
    """One run, and the nominal model's angle from its zero (rad)."""

    angle: Array
    run: RunData


def _motions(nominal: Fit) -> list[_Motion]:
    runs = zip(nominal.problem.data.runs, nominal.residuals, strict=True)
    return [
        _Motion(
            run.reading - run.unscaled(residual) - nominal.zero(i),
            run,
        )
        for i, (run, residual) in enumerate(runs)
    ]


def _zero_follows_power(motions: list[_Motion]) -> list[list[Array]]:
    """A zero that follows the squared angle with a lag, starting from zero or from a settled value."""
    trials = []
    for time, settled in product(_TIMES, (False, True)):
        columns = []
        for motion in motions:
            square = motion.angle**2
            keep = np.exp(-motion.run.interval / time)
            # at rest before the release, or held at the release angle for long
            start = keep * square[0] if settled else 0.0
            columns.append(motion.run.scaled(_lagged(square, keep, start)))
        trials.append(columns)
    return trials


def _lagged(values: Array, keep: float, start: float) -> Array:
    """The recursion y = keep · (y before) + (1 − keep) · value, its first ``keep · (y before)`` given as ``start``.

    As a system of equations: `scipy.signal` takes a second to load.
    """
    right = (1.0 - keep) * values
    right[0] += start
    bands = np.stack([np.ones(values.size), np.full(values.size, -keep)])
    return np.asarray(solve_banded((1, 0), bands, right, check_finite=False), np.float64)


_OUTSIDERS: tuple[tuple[str, Callable[[list[_Motion]], list[list[Array]]]], ...] = (
    ("a sensor zero that follows the power of the motion", _zero_follows_power),
)


def _share_left(nominal: Fit, columns: list[Array]) -> float:
    left = project_out(nominal, columns)
    power = sum(float(c @ c) for c in left)
    if power <= 0.0:
        return 1.0
    along = sum(float(c @ r) for c, r in zip(left, nominal.residuals, strict=True))
    excess = (nominal.total - along**2 / power) / nominal.count - 1.0
    return max(excess, 0.0) / nominal.excess
