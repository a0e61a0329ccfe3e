"""Linear theory of the coefficients: gradients, moves by the remainder, and possible small causes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.normal_equations import normal_equations
from diagnosis.likelihood.residuals import linear_coefficients, resonance
from diagnosis.likelihood.starting_points import StartingPoint, misses_motion, project_out, starting_points
from identification.statistics import scatter_of_runs
from tunnel_sim.effects import Effect
from tunnel_sim.effects.parameters import WindOnRun
from tunnel_sim.vocabulary.record import Array

SMALL_CAUSES: Final = 3
"""Maximum number of unnamed small causes considered together, in effects. Judgement (decision 0028). Time
against coverage."""
SMALL_CAUSES_TRIED: Final = 8
"""Number of effects in the sets of small causes: those with the greatest drop of χ² each. Judgement (decision
0028). Time against coverage."""
MISFIT_DEGREES: Final = 6.0
"""Effective degrees of freedom of the error of a real model. Judgement (decision 0028). One for every channel
of the residuals."""
DISPERSION_STDS: Final = 2.0
"""Margin of the campaign's χ² over its expectation that counts as chance when the misfit is treated as noise,
in standard deviations. Convention."""
SCATTER_STDS: Final = 2.0
"""Margin of the campaign's χ² over its expectation that counts as chance for the scatter of the runs, in
standard deviations. Convention."""
MOVE_STDS: Final = 2.0
"""Maximum chance difference between the two halves of the data, in standard deviations. Convention."""
LEAST_HALF: Final = 0.1
"""Minimum share of the information on a coefficient in each half of the data. Judgement."""

_DISTINCT = 1e-3  # minimum eigenvalue of the correlation matrix of a set's changes
# number of changes of a size, and the relative change below which the size has settled
_SECANTS, _SETTLED = 4, 0.25
_OWN_SIZE = 3.0  # factor by which linear theory may change a size taken from lines of the records


def wind_on_runs(fit: Fit) -> list[WindOnRun]:
    """Stiffnesses, frequencies and loads of the wind-on runs on a spring, in SI units."""
    data = fit.problem.data
    found = []
    for i, run in enumerate(data.runs):
        inertia, _, stiffness = linear_coefficients(fit, i)
        spring = fit.problem.stated(fit.point.common, fit.point.per_run[i], run).spring_stiffness
        load = 0.5 * run.air_density * run.wind_speed * data.frontal_area * data.reference_length**2
        if stiffness <= 0.0 or spring <= 0.0 or load <= 0.0:
            continue
        omega, still = math.sqrt(stiffness / inertia), math.sqrt(spring / inertia)
        pressure = load * run.wind_speed / data.reference_length
        found.append(WindOnRun(spring, omega, still, pressure, load))
    return found


def coefficients_of(fit: Fit) -> tuple[str, ...]:
    """Names of the coefficients stated for a fit."""
    return fit.problem.data.model.coefficient_names(fit.problem.names)


def coefficient_move(fit: Fit, name: str) -> float:
    """The move of a coefficient (`move_of_halves`), in its unit."""
    return move_of_halves(fit, fit.problem.data.model.gradient(fit.problem.names, fit.point.common, name))


def parameter_shift(fit: Fit, shifts: Sequence[Array]) -> Array:
    """The change of the common parameters by a change of the readings, shape (common,), in their units.

    Args:
        shifts: changes of the readings, in noise standard deviations, by run, shape (n,).
    """
    _, slope, _ = normal_equations(fit.jacobian, list(shifts), products=fit.products)
    return np.asarray(fit.covariance @ slope, np.float64)


def move_of_halves(fit: Fit, gradient: Array) -> float:
    """Half the difference between a quantity's values from two halves of the data, beyond chance.

    Args:
        gradient: derivatives of the quantity by the common parameters, shape (common,).

    The data are halved by amplitude, by time, by wind speed and by spring; the division with the largest
    difference counts. The difference comes from one Gauss–Newton step of the fit: the scores of a fit sum to
    zero, so the two halves pull in opposite directions. If the model were right, the pull would be due to noise
    alone. This is the test of Zeileis & Hornik (Stat. Neerl. 61 (2007) 488) for parameters that change along an
    ordering, in the parameter's unit. Refitting each half would give the same answer, but a half may show only
    some of the causes, which would leave the refit undetermined.

    Returns:
        The move in the quantity's unit, less the contribution of noise (2 standard deviations, in quadrature);
        0 where noise explains it.
    """
    _, slope, solutions = normal_equations(fit.jacobian, fit.residuals, products=fit.products)
    # the remaining step of the fit itself
    direction, step = fit.covariance @ gradient, fit.covariance @ slope
    rows: list[tuple[float, ...]] = []  # one row for each piece of one cycle
    for index, (run, (common, release), residual, solution) in enumerate(
        zip(fit.problem.data.runs, fit.jacobian, fit.residuals, solutions, strict=True)
    ):
        left = common - release @ solution[:, :-1]
        influence = left @ direction
        pull = influence * (residual - left @ step - release @ solution[:, -1])
        motion, count = np.abs(run.reading - np.mean(run.reading)), run.reading.size
        cycles = resonance(fit, index) * run.interval  # cycles per block
        pieces = min(max(int(count * cycles), 1), count)
        starts = np.arange(pieces, dtype=np.int64) * count // pieces
        columns: Sequence[Array] = (
            np.add.reduceat(pull, starts),
            np.add.reduceat(influence**2, starts),
            np.maximum.reduceat(motion, starts),
            starts / count,
        )
        rows += [(*row, run.wind_speed, run.spring_stiffness or 0.0) for row in zip(*columns, strict=True)]
    pull, weight, *orders = np.array(rows, np.float64).T
    found, total = 0.0, float(weight.sum())
    for order in orders:
        rank = np.argsort(order, kind="stable")
        at = int(np.searchsorted(np.cumsum(weight[rank]), 0.5 * total))
        middle = order[rank[min(at, rank.size - 1)]]
        for low in (order < middle, order <= middle):  # runs of equal order stay together
            share = float(weight[low].sum()) / max(total, 1e-300)
            if LEAST_HALF < share < 1.0 - LEAST_HALF:  # else one half has no information
                both = 2.0 * share * (1.0 - share)
                moved = float(pull[low].sum()) / both
                chance = MOVE_STDS**2 * total / (2.0 * both)
                found = max(found, math.sqrt(max(moved**2 - chance, 0.0)))
    return found


@dataclass(frozen=True, eq=False)
class Beside:
    """A fit, and the fit with sets of small causes added, by linear theory.

    Args:
        weights: probability of each set, the empty set first, shape (sets,).
        moves: change of the nominal model's coefficients by each set, shape (sets, coefficients).
        noise: variances of the moves due to the noise of the readings, shape (sets, coefficients).
        forms: further variances due to the forms of the small causes, shape (sets, coefficients).
        residuals: scaled residuals, mean over the sets, by run.
        scatter: standard deviations from the scatter of the runs in these residuals if it exceeds chance, else
            0; shape (coefficients,).
    """

    weights: Array
    moves: Array
    noise: Array
    forms: Array
    residuals: list[Array]
    scatter: Array


@dataclass(frozen=True, eq=False)
class _Cause:
    """One effect beside the fit, with the size used to compute its change."""

    unabsorbed: Array  # the change of all readings that the fit cannot absorb, scaled, shape (n,)
    moves: Array  # changes of the coefficients by the absorbed part, shape (coefficients,)
    unseen: (
        # their standard deviations from the part of the effect's form that no free decay shows, shape
        # (coefficients,)
        Array
    )
    least: float  # least allowed multiple of the size
    greatest: float  # greatest allowed multiple of the size
    by_chance: float  # chance gain of χ² by parameters per run


@dataclass(frozen=True, eq=False)
class _Step:
    """A set of effects added by one Gauss–Newton step."""

    sizes: Array  # multiples of the causes' sizes, 0 outside the set, shape (causes,)
    drop: float  # drop of χ², less the gain by chance of the runs' own parameters
    moves: Array  # changes of the coefficients, shape (coefficients,)
    noise: Array  # variances of these due to the noise, shape (coefficients,)
    forms: Array  # variances of these due to the effects' forms, shape (coefficients,)


def alone(fit: Fit) -> Beside:
    """A fit without added small causes."""
    formal = _formal(fit, coefficient_gradients(fit))[None, :]
    return Beside(
        np.ones(1), np.zeros_like(formal), formal, np.zeros_like(formal), fit.residuals, 0.0 * formal[0]
    )


Starts = Sequence[tuple[type[Effect], Sequence[StartingPoint]]]
"""Effects that may act beside the fitted ones, each with its starting points."""


def starts_beside(fit: Fit, kinds: Sequence[type[Effect]]) -> Starts:
    """The starting points of the effects that a fit does not include; none where the fit misses the motion."""
    if misses_motion(fit):
        return ()
    present, found = {kind.name for kind in fit.problem.effects}, []
    for kind in kinds:
        if kind.fitted and kind.name not in present:
            with suppress(np.linalg.LinAlgError):
                found.append((kind, starting_points(fit, kind)))
    return found


def beside(fit: Fit, starts: Starts) -> Beside:
    """Add sets of effects that a fit does not include, up to three at a time, by one Gauss–Newton step.

    An unnamed effect changes the coefficients, because the fit absorbs a part of it. The other part is in the
    residuals and gives the effect's size. A set has the weight exp(−(χ²/φ + price)/2), with the same price for
    each effect. φ is the dispersion of the best set's residual beyond chance, over the six effective degrees of
    freedom of a real model's error (decisions 0007 and 0028). An effect that the readings do not show therefore
    has no part in the average, however far it could move a coefficient.

    Args:
        fit: the fit of the answer, with or without effects.
        starts: the effects that may act beside the fitted ones.
    """
    gradients, settings = coefficient_gradients(fit), fit.settings.answer
    influence = influences(fit)
    causes, residuals = [], np.concatenate(fit.residuals)
    for _, points in starts:
        with suppress(np.linalg.LinAlgError):
            start = next(iter(points), None)  # the most promising starting point
            cause = None if start is None else _cause(fit, start, influence)
            # some effects are not linear in their size, so each is evaluated near the size of its own step
            for _ in range(_SECANTS):
                if start is None or cause is None or start.scaled is None:
                    break
                size = float(cause.unabsorbed @ residuals) / float(cause.unabsorbed @ cause.unabsorbed)
                if not cause.least < size < cause.greatest or size <= 0.0 or abs(size - 1.0) < _SETTLED:
                    break
                common = start.point.common.copy()
                common[start.scaled] *= size
                start = replace(start, point=replace(start.point, common=common))
                cause = _cause(fit, start, influence)
            causes += [] if cause is None else [cause]
    if not causes:
        return replace(alone(fit), scatter=_scatter(fit, influence, fit.residuals))
    # a matrix of all changes would be the largest array of a diagnosis
    gram = np.array([[one.unabsorbed @ other.unabsorbed for other in causes] for one in causes])
    score = np.array([cause.unabsorbed @ residuals for cause in causes])
    formal = _formal(fit, gradients)
    zero = np.zeros(formal.size)
    steps_taken = [_Step(np.zeros(len(causes)), 0.0, zero, zero, zero)]
    tried = np.argsort(-(score**2) / np.maximum(np.diag(gram), 1e-300), kind="stable")[
        :SMALL_CAUSES_TRIED
    ].tolist()
    sizes = range(1, SMALL_CAUSES + 1)
    sets = [list(chosen) for size in sizes for chosen in combinations(tried, size)]
    steps = (_step(gram, score, causes, chosen, settings.small_form_std) for chosen in sets)
    steps_taken += [step for step in steps if step is not None]
    excess = fit.total - fit.count - np.array([step.drop for step in steps_taken])
    price = settings.small_cause_price * np.array([np.count_nonzero(step.sizes) for step in steps_taken])
    best = float(excess[np.argmin(excess + price)])
    beyond = max(best - DISPERSION_STDS * math.sqrt(2.0 * fit.count), 0.0)
    odds = -0.5 * (excess / (1.0 + beyond / MISFIT_DEGREES) + price)
    weights = np.exp(odds - odds.max())
    weights /= weights.sum()
    mean_sizes = weights @ np.array([step.sizes for step in steps_taken])
    taken = np.split(
        sum(size * cause.unabsorbed for size, cause in zip(mean_sizes, causes, strict=True)),
        np.cumsum([residual.size for residual in fit.residuals])[:-1],
    )
    remaining = [residual - part for residual, part in zip(fit.residuals, taken, strict=True)]
    return Beside(
        weights,
        np.array([step.moves for step in steps_taken]),
        np.array([formal + step.noise for step in steps_taken]),
        np.array([step.forms for step in steps_taken]),
        remaining,
        _scatter(fit, influence, remaining),
    )


def influences(fit: Fit) -> list[Array]:
    """Change of the coefficients per unit of every scaled residual, by run, shape (n, coefficients)."""
    _, _, solutions = normal_equations(fit.jacobian, fit.residuals, products=fit.products)
    directions = fit.covariance @ coefficient_gradients(fit).T
    return [
        (common - release @ solution[:, :-1]) @ directions
        for (common, release), solution in zip(fit.jacobian, solutions, strict=True)
    ]


def size_range(start: StartingPoint) -> tuple[float, float]:
    """Least and greatest multiple of an effect's starting size that its parameter allows."""
    assert start.scaled is not None
    value = start.point.common[start.scaled]
    least, greatest = sorted(bound[start.scaled] / value for bound in start.problem.bounds)
    return float(least), float(greatest)


def coefficient_gradients(fit: Fit) -> Array:
    """Derivatives of the coefficients with respect to the common parameters, shape (coefficients, common).

    Zero for a coefficient that the user's own model fixes.
    """
    names, model = fit.problem.names, fit.problem.data.model
    return np.array(
        [model.gradient(names, fit.point.common, name) for name in model.coefficient_names(names)]
    )


def _formal(fit: Fit, gradients: Array) -> Array:
    """Variances of the coefficients from the fit's covariance, to first order, shape (coefficients,)."""
    found: Array = np.maximum(np.einsum("ci,ij,cj->c", gradients, fit.stated_covariance, gradients), 0.0)
    return found


def _step(
    gram: Array, score: Array, causes: Sequence[_Cause], chosen: list[int], form_std: float
) -> _Step | None:
    """Add the effects with some indices; None if they change the readings alike, or a size is out of range.

    ``gram`` has the products of the causes' changes, shape (causes, causes), and ``score`` their products with
    the residuals. ``form_std`` is the standard deviation of a move due to the form, as a share of the move.
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
        size**2 @ ((form_std * moves) ** 2 + unseen**2),
    )


def _scatter(fit: Fit, influence: list[Array], residuals: list[Array]) -> Array:
    """Standard deviations from the scatter of the runs; 0 where chance explains the residual."""
    names, data = coefficients_of(fit), fit.problem.data
    excess = sum(float(residual @ residual) for residual in residuals) - fit.count
    if excess <= SCATTER_STDS * math.sqrt(2.0 * fit.count):
        return np.zeros(len(names))
    informative = [data.in_wind if name.startswith("cn_") else data.runs for name in names]
    informative_runs = np.array([len(runs) for runs in informative])
    parts = [residual @ own for residual, own in zip(residuals, influence, strict=True)]
    return scatter_of_runs(np.array(parts), informative_runs)


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
    own = start.point.per_run.shape[1] - fit.point.per_run.shape[1]
    least, greatest = 0.0, 1.0
    if own:
        least, greatest = 1.0 / _OWN_SIZE, _OWN_SIZE
    elif start.scaled is not None:  # range of the effect's parameter
        least, greatest = size_range(start)
    unseen = np.zeros(moves.size)
    if "cn_beta" in fit.problem.names:  # Cnβ and Cnr come last
        effect = start.problem.effects_at(start.point.common)[-1]
        unseen[-2:] = effect.unseen_form(fit.value("cn_beta"), wind_on_runs(fit))
    gain = fit.settings.weighing.own_number_gain * own * len(runs)
    return _Cause(left, moves, unseen, least, greatest, gain)
