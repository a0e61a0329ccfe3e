"""What causes that an answer does not name may do to the coefficients: the linear theory of sets of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from diagnosis.answer.small_swings import coefficient_gradient, coefficient_names, wind_on_runs
from diagnosis.likelihood.least_squares import Fit, normal_equations
from diagnosis.likelihood.starting_points import StartingPoint, misses_motion, project_out, starting_points
from diagnosis.policy import CHANCE_STDS, FORM_CHANGE_STD, NEEDLESS_CHI2, OWN_EVIDENCE
from identification.statistics import scatter_of_runs
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.record import Array

_DEGREES = 6.0  # effective degrees of freedom of a real model's error
_MOST = 3  # small causes at once
_TRIED = 8  # effects that sets are made of: those that alone lower χ² most
_DISTINCT = 1e-3  # least eigenvalue of the correlation matrix of a set's changes
_SECANTS, _SETTLED = 4, 0.25  # times a size is changed, and the share by which it then changes no more
_OWN_SIZE = 3.0  # factor by which linear theory may change the size that was found in the records' lines


@dataclass(frozen=True, eq=False)
class Beside:
    """A fit and the same with sets of small causes added, by linear theory.

    Args:
        weights: probability of each set, the empty one first, shape (sets,).
        moves: how far each set moves the coefficients of `coefficient_names`, shape (sets, coefficients).
        noise: variances due to the noise of the readings, of that shape.
        forms: further variances due to the forms of the small causes, of that shape.
        left: scaled residuals that the sets leave on the average, by run.
        scatter: standard deviations from the scatter of the runs in these, where they are beyond chance, shape
            (coefficients,); else 0.
    """

    weights: Array
    moves: Array
    noise: Array
    forms: Array
    left: list[Array]
    scatter: Array


@dataclass(frozen=True, eq=False)
class _Cause:
    """One effect beside the fit, at the size at which its change was computed.

    Args:
        left: the change of all readings that the fit cannot absorb, scaled, shape (n,).
        moves: of the coefficients by the part that it absorbs, shape (coefficients,).
        unseen: standard deviations of the coefficients from the part of its form that no free decay shows, of that
            shape.
        least: smallest multiple of the size that is allowed.
        greatest: largest multiple of the size that is allowed.
        by_chance: χ² by which the numbers of the runs' own may lower it.
    """

    left: Array
    moves: Array
    unseen: Array
    least: float
    greatest: float
    by_chance: float


@dataclass(frozen=True, eq=False)
class _Step:
    """A set of effects added by one Gauss–Newton step.

    Args:
        sizes: multiples of the causes' sizes, 0 outside the set, shape (causes,).
        drop: of χ², less what the runs' own numbers gain by chance.
        moves: of the coefficients, shape (coefficients,).
        noise: variances of these due to the noise, of that shape.
        forms: variances of these due to the effects' forms, of that shape.
    """

    sizes: Array
    drop: float
    moves: Array
    noise: Array
    forms: Array


def alone(fit: Fit) -> Beside:
    """A fit with no set of small causes added."""
    formal = _formal(fit, _gradients(fit))[None, :]
    return Beside(
        np.ones(1), np.zeros_like(formal), formal, np.zeros_like(formal), fit.residuals, 0.0 * formal[0]
    )


def beside(fit: Fit, kinds: Sequence[type[Effect]]) -> Beside:
    """Add sets of effects that a fit does not have, up to three at a time, by one Gauss–Newton step.

    An effect that acts but is not named changes the coefficients, because the fit absorbs a part of it. The other
    part is in the residuals and gives its size. A set has the weight exp(−(χ²/φ + price)/2). The price is
    `NEEDLESS_CHI2` for each effect. φ is the dispersion of what the best set leaves beyond chance, over the six
    effective degrees of freedom that the error of a real model has (decisions 0007 and 0028). An effect
    that the readings do not show therefore has no part in the average, however far it could move a coefficient.

    Args:
        fit: with or without effects.
        kinds: the effects that may act beside those of the fit; none are tried where the fit misses the motion.

    Returns:
        Moves and variances in the coefficients' units.
    """
    gradients = _gradients(fit)
    present = {kind.name for kind in fit.problem.effects}
    others = [kind for kind in kinds if kind.fitted and kind.name not in present]
    influence = _influence(fit, gradients)
    causes = [] if misses_motion(fit) else _causes(fit, others, influence)
    if not causes:
        return replace(alone(fit), scatter=_scatter(fit, influence, fit.residuals))
    left = np.array([cause.left for cause in causes])
    gram, score = left @ left.T, left @ np.concatenate(fit.residuals)
    formal = _formal(fit, gradients)
    zero = np.zeros(formal.size)
    found = [_Step(np.zeros(len(causes)), 0.0, zero, zero, zero)]
    found += [step for chosen in _sets(gram, score) if (step := _step(gram, score, causes, chosen))]
    excess = fit.total - fit.count - np.array([step.drop for step in found])
    price = NEEDLESS_CHI2 * np.array([np.count_nonzero(step.sizes) for step in found])
    best = float(excess[np.argmin(excess + price)])
    beyond = max(best - CHANCE_STDS * math.sqrt(2.0 * fit.count), 0.0)
    odds = -0.5 * (excess / (1.0 + beyond / _DEGREES) + price)
    weights = np.exp(odds - odds.max())
    weights /= weights.sum()
    taken = np.split(
        (weights @ np.array([step.sizes for step in found])) @ left,
        np.cumsum([residual.size for residual in fit.residuals])[:-1],
    )
    remaining = [residual - part for residual, part in zip(fit.residuals, taken, strict=True)]
    return Beside(
        weights,
        np.array([step.moves for step in found]),
        np.array([formal + step.noise for step in found]),
        np.array([step.forms for step in found]),
        remaining,
        _scatter(fit, influence, remaining),
    )


def _gradients(fit: Fit) -> Array:
    """Derivatives of the coefficients with respect to the common parameters, shape (coefficients, common).

    Zero for a coefficient that a model of one's own holds.
    """
    names, common = fit.problem.names, fit.point.common
    held = np.zeros(len(names))
    composed = {"omega_n", "zeta"}
    return np.array(
        [
            coefficient_gradient(names, common, name) if name in names or name in composed else held
            for name in coefficient_names(fit.problem)
        ]
    )


def _formal(fit: Fit, gradients: Array) -> Array:
    """Variances of the coefficients from the fit's covariance, to first order, shape (coefficients,)."""
    found: Array = np.maximum(np.einsum("ci,ij,cj->c", gradients, fit.covariance, gradients), 0.0)
    return found


def _sets(gram: Array, score: Array) -> Iterator[list[int]]:
    """Places of the effects of every set that is tried."""
    power = np.diag(gram) if gram.size else np.zeros(0)
    tried = np.argsort(-(score**2) / np.maximum(power, 1e-300), kind="stable")[:_TRIED].tolist()
    for size in range(1, _MOST + 1):
        yield from map(list, combinations(tried, size))


def _step(gram: Array, score: Array, causes: Sequence[_Cause], chosen: list[int]) -> _Step | None:
    """Add a set of effects.

    Args:
        gram: products of the causes' changes, shape (causes, causes).
        score: products of these with the residuals, shape (causes,).
        chosen: places of the set's effects.

    Returns:
        None where its effects change the readings alike, or a size would leave its range.
    """
    own = gram[np.ix_(chosen, chosen)]
    scale = np.sqrt(np.diag(own))
    alike = own / np.outer(scale, scale)
    if np.linalg.eigvalsh(alike)[0] < _DISTINCT:
        return None
    inverse = np.linalg.inv(alike) / np.outer(scale, scale)
    size = inverse @ score[chosen]
    inside = [causes[i] for i in chosen]
    if any(not cause.least <= one <= cause.greatest for one, cause in zip(size, inside, strict=True)):
        return None
    moves = np.array([cause.moves for cause in inside])
    unseen = np.array([cause.unseen for cause in inside])
    sizes = np.zeros(len(causes))
    sizes[chosen] = size
    return _Step(
        sizes,
        float(score[chosen] @ size) - sum(cause.by_chance for cause in inside),
        size @ moves,
        np.einsum("ic,ij,jc->c", moves, inverse, moves),
        size**2 @ ((FORM_CHANGE_STD * moves) ** 2 + unseen**2),
    )


def _influence(fit: Fit, gradients: Array) -> list[Array]:
    """What a unit of every scaled residual adds to the coefficients, by run, shape (n, coefficients)."""
    matrix, _, solutions = normal_equations(fit.jacobian, fit.residuals)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=1e-12, hermitian=True)
    directions = (inverse / np.outer(scale, scale)) @ gradients.T
    return [
        (common - release @ solution[:, :-1]) @ directions
        for (common, release), solution in zip(fit.jacobian, solutions, strict=True)
    ]


def _scatter(fit: Fit, influence: list[Array], residuals: list[Array]) -> Array:
    """Standard deviations from the scatter of the runs; 0 where chance explains what is left."""
    names, runs = coefficient_names(fit.problem), fit.problem.data.runs
    excess = sum(float(residual @ residual) for residual in residuals) - fit.count
    if excess <= CHANCE_STDS * math.sqrt(2.0 * fit.count):
        return np.zeros(len(names))
    windy = sum(run.wind_on for run in runs)
    informative_runs = np.array([windy if name.startswith("cn_") else len(runs) for name in names])
    parts = [residual @ own for residual, own in zip(residuals, influence, strict=True)]
    return scatter_of_runs(np.array(parts), informative_runs)


def _causes(fit: Fit, kinds: Sequence[type[Effect]], influence: list[Array]) -> list[_Cause]:
    """The effects that the runs can show, each from its most promising starting point."""
    found = []
    for kind in kinds:
        with suppress(np.linalg.LinAlgError):
            starts = starting_points(fit, kind)
            cause = _at_its_size(fit, starts[0], influence) if starts else None
            found += [] if cause is None else [cause]
    return found


def _at_its_size(fit: Fit, start: StartingPoint, influence: list[Array]) -> _Cause | None:
    """The effect at about the size that its own step gives: not every effect is linear in its size."""
    residuals = np.concatenate(fit.residuals)
    cause = _cause(fit, start, influence)
    for _ in range(_SECANTS):
        if cause is None or start.scaled is None:
            break
        size = float(cause.left @ residuals) / float(cause.left @ cause.left)
        if not cause.least < size < cause.greatest or size <= 0.0 or abs(size - 1.0) < _SETTLED:
            break
        common = start.point.common.copy()
        common[start.scaled] *= size
        start = replace(start, point=replace(start.point, common=common))
        cause = _cause(fit, start, influence)
    return cause


def _cause(fit: Fit, start: StartingPoint, influence: list[Array]) -> _Cause | None:
    runs, moved = fit.problem.data.runs, start.problem.predict([start.point])[0]
    change = [
        run.scaled(m - run.reading) + residual
        for run, m, residual in zip(runs, moved, fit.residuals, strict=True)
    ]
    if not all(np.all(np.isfinite(c)) for c in change):
        return None
    left = np.concatenate(project_out(fit, change))
    if not left.any():
        return None
    moves = -sum((c @ i for c, i in zip(change, influence, strict=True)), np.zeros(influence[0].shape[1]))
    own = start.point.release.shape[1] - fit.point.release.shape[1]
    least, greatest = (1.0 / _OWN_SIZE, _OWN_SIZE) if own else _range(start)
    return _Cause(
        left, moves, _unseen(fit, start, moves.size), least, greatest, OWN_EVIDENCE * own * len(runs)
    )


def _range(start: StartingPoint) -> tuple[float, float]:
    """The multiples of the size of an effect that its parameter's range allows."""
    if start.scaled is None:
        return 0.0, 1.0
    value = start.point.common[start.scaled]
    ends = sorted(bound[start.scaled] / value for bound in start.problem.bounds)
    return ends[0], ends[1]


def _unseen(fit: Fit, start: StartingPoint, count: int) -> Array:
    """Standard deviations from the part of the effect's form that no free decay shows; Cnβ and Cnr come last."""
    if "cn_beta" not in fit.problem.names:
        return np.zeros(count)
    effect = start.problem.effects_at(start.point.common)[-1]
    return np.array([*[0.0] * (count - 2), *effect.unseen_form(fit.value("cn_beta"), wind_on_runs(fit))])
