"""Rival linear models of the windows: the nominal model and, beside it, each of many shapes, by least squares.

A rival adds one column to the nominal model. It shifts the parameters by an amount in closed form and lowers χ² by
another. Sets of two to four columns come from forward selection. A weak normal prior on every column keeps the
parameters finite where a column is nearly a combination of the nominal ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.statistics.information import determined, inverse, scaled_solve
from tunnel_sim.vocabulary.record import Array

Mask = NDArray[np.bool_]
SETS = (2, 3, 4)
"""Numbers of columns in the larger rivals, found by forward selection; one more rival has all columns."""
MORE = len(SETS) + 2
"""Rivals besides those of one column: the nominal model first; the sets and all columns together last."""
_PRIOR = 1e-6  # least squares of a column's own fit over the prior variance of its effect: 1000 deviations
_PRIOR_ALL = 1e-3  # the same where all columns act together


@dataclass(frozen=True, eq=False)
class Rivals:
    """The nominal model and its rivals, nominal first.

    Args:
        parameters: of the nominal model, shape (p,).
        shifts: what each rival adds to them, shape (r, p).
        covariances: of the parameters under each rival, shape (r, p, p).
        scores: signed significance of a rival's column, shape (r,); of a set, the root of its fall of χ².
        own: share of a column that the nominal parameters cannot imitate, shape (r,).
        remaining: χ² of each rival, shape (r,).
        freedom: number of values less number of nominal unknowns.
        valid: whether the campaign shows the rival at all, shape (r,).
    """

    parameters: Array
    shifts: Array
    covariances: Array
    scores: Array
    own: Array
    remaining: Array
    freedom: int
    valid: Mask


def fit_rivals(values: Array, design: Array, columns: Array, weights: Array, taken: int) -> Rivals | None:
    """Fit the nominal model and every rival.

    Args:
        values: data, shape (n,).
        design: columns of the nominal parameters, shape (n, p).
        columns: of the rivals, shape (n, c); zero where a rival does not apply.
        weights: inverse variances, shape (n,).
        taken: unknowns eliminated beforehand.

    Returns:
        The fits; None where the data do not determine the nominal parameters.
    """
    root = np.sqrt(weights)
    nominal, seen = design * root[:, None], columns * root[:, None]
    normal = nominal.T @ nominal
    if not determined(normal):
        return None
    covariance = inverse(normal)
    parameters = scaled_solve(normal, nominal.T @ (root * values))
    rest = root * values - nominal @ parameters
    full = np.einsum("nc,nc->c", seen, seen)
    valid = full > 0.0
    seen = seen / np.sqrt(np.where(valid, full, 1.0))
    moves = covariance @ (nominal.T @ seen)  # (p, c): how a column shifts the parameters
    own = seen - nominal @ moves
    gram, aim = own.T @ own, own.T @ rest
    alone = np.diag(gram).copy()
    sizes = aim / (alone + _PRIOR)
    scores = aim / np.sqrt(alone + _PRIOR)
    total = float(rest @ rest)
    shifts, covariances = [np.zeros(parameters.size)], [covariance]
    shifts += list((-moves * sizes).T)
    outer = moves.T[:, :, None] * moves.T[:, None, :]
    covariances += list(covariance + outer / (alone + _PRIOR)[:, None, None])
    found_scores, remaining = [0.0, *scores], [total, *(total - scores**2)]
    places = forward(gram, aim, max(SETS))
    sets = [(np.array(places[:number], dtype=np.intp), _PRIOR) for number in SETS]
    for chosen, prior in [*sets, (np.flatnonzero(valid), _PRIOR_ALL)]:
        inner = gram[np.ix_(chosen, chosen)] + prior * np.eye(chosen.size)
        solved = np.linalg.solve(inner, np.column_stack((aim[chosen], moves[:, chosen].T)))
        shifts.append(-moves[:, chosen] @ solved[:, 0])
        covariances.append(covariance + moves[:, chosen] @ solved[:, 1:])
        fall = float(aim[chosen] @ solved[:, 0])
        found_scores.append(float(np.sqrt(max(fall, 0.0))))
        remaining.append(total - fall)
    return Rivals(
        parameters,
        np.array(shifts),
        np.array(covariances),
        np.array(found_scores),
        np.concatenate(([1.0], alone, np.ones(len(SETS) + 1))),
        np.maximum(np.array(remaining), 0.0),
        values.size - taken - parameters.size,
        np.concatenate(([True], valid, np.ones(len(SETS) + 1, dtype=bool))),
    )


def forward(gram: Array, aim: Array, number: int) -> list[int]:
    """Forward selection: each column lowers χ² most beside those before it.

    Args:
        gram: products of the columns, shape (c, c).
        aim: products of the columns with the data, shape (c,).
        number: of columns to choose.
    """
    left, own = aim.copy(), np.diag(gram).copy()
    gram = gram.copy()
    chosen: list[int] = []
    for _ in range(min(number, aim.size)):
        gain = left**2 / (own + _PRIOR)
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        share = gram[:, best] / (own[best] + _PRIOR)
        left = left - share * left[best]
        gram = gram - np.outer(share, gram[best])
        own = np.maximum(np.diag(gram), 0.0)
    return chosen
