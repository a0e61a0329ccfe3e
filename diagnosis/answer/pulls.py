"""How far what remains of the gap moves the coefficients: the pull of one half of the data against the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.answer.small_swings import coefficient_gradient
from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.normal_equations import normal_equations
from diagnosis.fitting.spectra import resonance
from diagnosis.policy import CHANCE_STDS, LEAST_HALF
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class _Pieces:
    """All runs in pieces of one cycle.

    Args:
        pull: of each piece's residuals on the coefficient, in its unit, shape (pieces,).
        weight: of each piece in the coefficient's variance, in its unit squared, shape (pieces,).
        orders: by what the data are halved, each of shape (pieces,).
    """

    pull: Array
    weight: Array
    orders: tuple[Array, ...]


def coefficient_move(fit: Fit, name: str) -> float:
    """Half the difference between the coefficients of two halves of the data, beyond chance.

    The data are halved by amplitude, by time, by wind speed and by spring, and the halves that differ most count.
    The difference is that of one Gauss–Newton step from the fit: the scores of a fit sum to zero, and what one half
    pulls up the other pulls down. Were the model right, the pull would be the noise's alone. This is the test of
    Zeileis & Hornik (Stat. Neerl. 61 (2007) 488) for parameters that change along an ordering, in the parameter's
    unit; a refit of each half would answer the same, but is undetermined where one half shows only some causes.

    Args:
        name: of the coefficient: ``cn_beta``, ``cn_r``, ``omega_n`` or ``zeta``.

    Returns:
        The move in the coefficient's unit, reduced by what the noise alone gives (2 standard deviations, in
        quadrature); 0 where it gives as much.
    """
    pieces = _pieces(fit, coefficient_gradient(fit.problem.names, fit.point.common, name))
    return max(_half_difference(pieces, order) for order in pieces.orders)


def _half_difference(pieces: _Pieces, order: Array) -> float:
    """Half the difference between pieces low and high in an order, beyond chance; 0 where one half says nothing."""
    total = float(pieces.weight.sum())
    rank = np.argsort(order, kind="stable")
    at = int(np.searchsorted(np.cumsum(pieces.weight[rank]), 0.5 * total))
    middle = order[rank[min(at, rank.size - 1)]]
    found = 0.0
    for low in (order < middle, order <= middle):  # runs of one condition are not divided
        share = float(pieces.weight[low].sum()) / max(total, 1e-300)
        if LEAST_HALF < share < 1.0 - LEAST_HALF:
            both = 2.0 * share * (1.0 - share)
            moved = float(pieces.pull[low].sum()) / both
            chance = CHANCE_STDS**2 * total / (2.0 * both)
            found = max(found, math.sqrt(max(moved**2 - chance, 0.0)))
    return found


def _pieces(fit: Fit, gradient: Array) -> _Pieces:
    matrix, slope, solutions = normal_equations(fit.jacobian, fit.residuals)
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(size, size), rcond=1e-12, hermitian=True) / np.outer(
        size, size
    )
    direction, step = inverse @ gradient, inverse @ slope  # the step is what the fit had still to go
    rows: list[tuple[float, ...]] = []
    for index, (run, (common, release), residual, solution) in enumerate(
        zip(fit.problem.data.runs, fit.jacobian, fit.residuals, solutions, strict=True)
    ):
        left = common - release @ solution[:, :-1]
        influence = left @ direction
        pull = influence * (residual - left @ step - release @ solution[:, -1])
        motion = np.abs(run.reading - np.mean(run.reading))
        starts = _starts(run.reading.size, resonance(fit, index) * run.interval)
        columns: Sequence[Array] = (
            np.add.reduceat(pull, starts),
            np.add.reduceat(influence**2, starts),
            np.maximum.reduceat(motion, starts),
            starts / run.reading.size,
        )
        rows += [(*row, run.wind_speed, run.spring_stiffness or 0.0) for row in zip(*columns, strict=True)]
    pull, weight, *orders = np.array(rows, np.float64).T
    return _Pieces(pull, weight, tuple(orders))


def _starts(count: int, cycles: float) -> NDArray[np.int64]:
    """First block of every whole cycle of a run of ``count`` blocks with ``cycles`` cycles to a block."""
    pieces = min(max(int(count * cycles), 1), count)
    return np.arange(pieces, dtype=np.int64) * count // pieces
