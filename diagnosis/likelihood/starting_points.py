"""Starting points of fits: the nominal model from the records alone, an effect's severity from its signature."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, clip
from diagnosis.likelihood.normal_equations import Products, damped_step, normal_equations
from diagnosis.likelihood.per_run import ResidualsOf
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import CHANNELS, gap_left, misfit
from diagnosis.likelihood.scatter_widths import Between
from diagnosis.model.chance import Scatter
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import Clock, OwnNumbers
from tunnel_sim.effects.evidence import Sought
from tunnel_sim.effects.parameters import Circumstances, ParameterInfo, Trial
from tunnel_sim.vocabulary.record import Array

GROSS_MISFIT: Final = 0.01
"""Minimum residual, as a share of the power of the readings, for a fit to fail to describe the motion.
Judgement."""

_HELD = 1e18  # precision of fixed deviations
_MODERATE, _SMALL = 3.0, 0.05  # tried sizes of a change, over the residual's size
_ABSORBED = 2  # steps; after one step, the error of the absorption is as large as the remainder of the effect
_NEARER = 0.02  # share of an effect's size by linear theory


def nominal_start(data: Data) -> Point:
    """The first starting point of the nominal model, which the records give."""
    return next(nominal_starts(data))


def nominal_starts(data: Data) -> Iterator[Point]:
    """The starting points of the nominal model; the second is for a fit that misses the motion at first."""
    parameters = Problem(data).parameters
    for start in data.model.starts(data):
        yield parameters.point(start.common, start.own)


@dataclass(frozen=True, eq=False)
class StartingPoint:
    """Start of an effect's fit, with the improvement predicted by linear theory.

    Args:
        problem: the fit with the effect added.
        point: the starting point.
        predicted_drop: drop of χ² by linear theory, dimensionless.
        predicted: χ² beyond noise by channel that linear theory predicts, shape (6,), dimensionless.
        scaled: index of the common parameter scaled by linear theory; None: no parameter is scaled.
        second_order: whether the other parameters absorb the first order of the effect.
        scatter_cost: −2 ln of the evidence of chance differences between the runs by linear theory, dimensionless.
    """

    problem: Problem
    point: Point
    predicted_drop: float
    predicted: Array
    scaled: int | None
    second_order: bool = False
    scatter_cost: float = 0.0

    def nearer(self) -> StartingPoint | None:
        """The point with much less of the effect; None where linear theory did not scale the effect.

        A fit from this point cannot end worse than the fit without the effect.
        """
        if self.scaled is None:
            return None
        common = self.point.common.copy()
        common[self.scaled] *= _NEARER
        return dataclasses.replace(self, point=Point(common, self.point.per_run))


def starting_points(base: Fit, kind: type[Effect]) -> list[StartingPoint]:
    """Starting points for adding one effect to a fitted problem, by predicted drop of χ², greatest first.

    One per trial; none where the runs cannot show the effect.
    """
    data = base.problem.data
    if not data.may_show(kind):
        return []
    if issubclass(kind, OwnNumbers):
        tried = (_with_own_numbers(base, kind, one) for one in kind.sought(ResidualsOf(base)) if one)
    else:
        tried = (_by_linear_theory(base, kind, trial) for trial in kind.trials(_circumstances(base)))
    return sorted(filter(None, tried), key=lambda start: -start.predicted_drop)


def _with_own_numbers(base: Fit, kind: type[OwnNumbers], one: Sought) -> StartingPoint | None:
    """An effect with a phase or instants in every run, as found in the residuals; None if its size is zero."""
    of_input = tuple((f"{kind.name}.{i.name}", one.of_input) for i in kind.parameters() if i.of_input)
    fixed = (*base.problem.fixed, *(of_input if base.problem.data.driven else ()))
    instants = one.numbers.shape[-1] if issubclass(kind, Clock) else base.problem.instants
    effects = (*base.problem.effects, kind)
    problem = dataclasses.replace(base.problem, effects=effects, fixed=fixed, instants=instants)
    infos = zip(one.values, _own_parameters(problem, kind), strict=True)
    values = [np.clip(value, info.lower, info.upper) for value, info in infos]
    if values[0] == 0.0:
        return None
    release = np.column_stack([base.point.per_run, one.numbers])
    point = Point(np.concatenate([base.point.common, values]), release)
    predicted = misfit(base).excess
    predicted[CHANNELS.index(kind.gains_in())] -= one.drop
    cost = gap_left(base).scatter_cost
    return StartingPoint(problem, point, one.drop, predicted, base.point.common.size, scatter_cost=cost)


@dataclass(frozen=True, eq=False)
class _TrialChange:
    """A trial of an effect at a moderate size.

    Args:
        problem: the fit with the effect added.
        own: free parameters of the effect, with the values ``sizes``, shape (own,).
        scaled: index of the scaled parameter among them; None: no parameter is scaled.
        replaced: index of the common parameter that the effect replaces; None: it replaces none.
        change: change of the scaled prediction, by run, shape (n,).
    """

    problem: Problem
    own: list[ParameterInfo]
    sizes: Array
    scaled: int | None
    replaced: int | None
    change: list[Array]


def _moderate(base: Fit, kind: type[Effect], trial: Trial) -> _TrialChange | None:
    """A trial at a moderate size; None where the prediction diverges or the size is not allowed."""
    problem = _tried(base, kind, trial)
    own = _own_parameters(problem, kind)
    scaled = None if trial.scaled is None else [info.name for info in own].index(trial.scaled)
    sizes = np.array([trial.values.get(info.name, info.default) for info in own])
    if not _within(own, sizes):
        return None
    names = base.problem.names
    replaced = names.index(trial.replaces) if trial.replaces in names else None
    change = _moderate_change(base, problem, sizes, scaled, replaced, second_order=trial.second_order)
    return None if change is None else _TrialChange(problem, own, sizes, scaled, replaced, change)


def _within(infos: Sequence[ParameterInfo], values: Array) -> bool:
    """Whether parameters are within their bounds: for an arm that turns over the top an effect may exceed them."""
    return all(info.lower <= value <= info.upper for info, value in zip(infos, values, strict=True))


def changes(base: Fit, kind: type[Effect]) -> Iterator[list[Array]]:
    """Changes by an effect without parameters per run, at moderate sizes, one for each trial.

    Returns:
        Changes of the scaled prediction, by run, shape (n,); none where the runs cannot show the effect.
    """
    data = base.problem.data
    if not data.may_show(kind) or issubclass(kind, OwnNumbers):
        return
    for trial in kind.trials(_circumstances(base)):
        tried = _moderate(base, kind, trial)
        if tried is not None:
            yield tried.change


def _by_linear_theory(base: Fit, kind: type[Effect], trial: Trial) -> StartingPoint | None:
    """An effect at its best size by linear theory; None where its change is negligible."""
    tried = _moderate(base, kind, trial)
    if tried is None:
        return None
    problem, own, sizes, change = tried.problem, tried.own, tried.sizes, tried.change
    scaled, replaced = tried.scaled, tried.replaced
    moved = None
    if trial.second_order:
        moved = base.point
        for _ in range(_ABSORBED):
            moved = absorbed(base, change, moved)
            change = change_to(base, problem, Point(np.concatenate([moved.common, sizes]), moved.per_run))
    added = _added(base, change)
    if added is None or (moved is not None and added.slope <= 0.0):
        return None
    start, drop, slope = sizes.copy(), added.drop, added.slope
    if scaled is not None:
        by = slope if moved is None else np.sqrt(slope)
        moderate = np.clip(by * sizes[scaled], -trial.at_most, trial.at_most)
        start[scaled] = np.clip(moderate, own[scaled].lower, own[scaled].upper)
        if start[scaled] == 0.0:
            start[scaled], drop = 0.01 * sizes[scaled], 0.0
        if replaced is not None:
            start[scaled] = min(start[scaled], base.point.common[replaced])
    point = Point(_with_effect(base, start, scaled, replaced), base.point.per_run)
    if moved is not None and scaled is not None:
        part = start[scaled] / sizes[scaled]
        point.common[: moved.common.size] += part * (moved.common - base.point.common)
        release = point.per_run + part * (moved.per_run - base.point.per_run)
        point = clip(problem, Point(point.common, release))
    place = None if scaled is None else base.point.common.size + scaled
    problem = dataclasses.replace(problem, scatter=added.scatter)
    left = misfit(base, added.residuals).excess
    return StartingPoint(problem, point, drop, left, place, trial.second_order, added.scatter_cost)


@dataclass(frozen=True, eq=False)
class _Added:
    """A change of the prediction, added at its best size by linear theory.

    Args:
        slope: the best size, as a multiple of the change.
        drop: drop of −2 ln L, dimensionless.
        residuals: scaled residuals, by run.
        scatter: chance differences between the runs, with the most likely widths beside the change.
        scatter_cost: −2 ln of the evidence of these differences, dimensionless.
    """

    slope: float
    drop: float
    residuals: list[Array]
    scatter: Scatter = ()
    scatter_cost: float = 0.0


def _added(base: Fit, change: list[Array]) -> _Added | None:
    """A change added to a fit; None where the fit absorbs it, or the change is not finite."""
    if base.between is not None:
        return _added_beside_scatter(base, base.between, change)
    left = project_out(base, change)
    power = sum(float(c @ c) for c in left)
    if not 0.0 < power < np.inf:
        return None
    slope = sum(float(c @ r) for c, r in zip(left, base.residuals, strict=True)) / power
    after = [r - slope * c for c, r in zip(left, base.residuals, strict=True)]
    return _Added(slope, slope * slope * power, after)


def _added_beside_scatter(base: Fit, between: Between, change: list[Array]) -> _Added | None:
    """A change added to a fit with scatter between its runs: a further cause may reduce the scatter."""
    if not all(np.all(np.isfinite(one)) for one in change):
        return None
    columns, size = base.columns.with_column(change)
    beside = columns.likeliest(between.widths)
    return _Added(
        float(beside.likeliest.common[-1]) / size,
        between.likelihood - beside.likelihood,
        columns.remaining_residuals(beside.likeliest),
        tuple(one.as_wide_as(width) for one, width in zip(base.problem.scatter, beside.widths, strict=True)),
        beside.cost(base.columns.products.own),
    )


def _tried(base: Fit, kind: type[Effect], trial: Trial) -> Problem:
    """A problem with one more effect, with the parameters that a trial fixes and frees."""
    spring = kind.chosen_spring()
    held = {} if spring is None else {spring: trial.values[spring]}
    fixed = (*base.problem.fixed, *((f"{kind.name}.{name}", value) for name, value in held.items()))
    freed = next((form for form in kind.forms() if any(name in trial.values for name in form)), ())
    free_forms = (*base.problem.free_forms, *(f"{kind.name}.{name}" for name in freed))
    effects = (*base.problem.effects, kind)
    return dataclasses.replace(base.problem, effects=effects, fixed=fixed, free_forms=free_forms)


def second_order_starts(base: Fit, kind: type[Effect], *, passive: bool) -> list[StartingPoint]:
    """Starts of an effect with an absorbed first order, at the sizes of its trials, whatever the readings.

    Empty for other effects, and where the runs cannot show it.

    Args:
        passive: whether only the passive trials count.
    """
    found: list[StartingPoint] = []
    if not base.problem.data.may_show(kind):
        return found
    for trial in kind.trials(_circumstances(base)):
        if trial.second_order and (trial.passive or not passive) and trial.scaled is not None:
            problem = dataclasses.replace(base.problem, effects=(*base.problem.effects, kind))
            own = _own_parameters(problem, kind)
            sizes = np.array([trial.values.get(info.name, info.default) for info in own])
            point = Point(np.concatenate([base.point.common, sizes]), base.point.per_run)
            place = base.point.common.size + [info.name for info in own].index(trial.scaled)
            found.append(StartingPoint(problem, point, 0.0, np.zeros(len(CHANNELS)), place, True))
    return found


def misses_motion(fit: Fit) -> bool:
    """Whether a fit misses the motion itself, so that its sensitivities are of little use.

    It does if the residual exceeds a given share of the power of the readings, both about their means in every
    cycle. A drift or a step of the zero is slower than the motion and does not affect its phase.
    """
    found = misfit(fit)
    at_motion = float(found.chi2.sum()) - float(found.chi2[CHANNELS.index("zero")])
    return at_motion > GROSS_MISFIT * found.motion


def loses_phase(fit: Fit) -> bool:
    """Whether a fit misses the motion because it loses its phase, cycle by cycle; an input keeps the phase."""
    return not fit.problem.data.driven and misses_motion(fit)


def _own_parameters(problem: Problem, kind: type[Effect]) -> list[ParameterInfo]:
    """The parameters of an effect that are free in a problem."""
    return [info for info in kind.parameters() if f"{kind.name}.{info.name}" in problem.names]


def _circumstances(base: Fit) -> Circumstances:
    data = base.problem.data
    greatest = max(float(np.max(np.abs(run.reading))) for run in data.runs)
    moment, rate = 0.0, 0.0
    for run, own in zip(data.runs, base.point.per_run, strict=True):
        if run.drive is not None and run.drive.kind.by_actuator:
            drive = base.problem.stated(base.point.common, own, run).drive
            assert drive is not None
            own_moment, own_rate = drive.greatest
            moment, rate = max(moment, own_moment), max(rate, own_rate)
    return Circumstances(data.springs, greatest, data.model.per_inertia, data.wind_speeds, moment, rate)


def _with_effect(base: Fit, values: Array, scaled: int | None, replaced: int | None) -> Array:
    """Common parameters with an effect's parameters; ``replaced`` is the index of the parameter it replaces."""
    common = base.point.common.copy()
    if scaled is not None and replaced is not None:
        common[replaced] -= values[scaled]
    return np.concatenate([common, values])


def absorbed(base: Fit, change: Sequence[Array], point: Point | None = None) -> Point:
    """The point at which a fit's parameters absorb a change of the scaled prediction, by one Gauss–Newton step.

    Args:
        change: change of the scaled prediction at the point.
        point: start of the step; None: the fit's point.
    """
    products = base.products
    if base.problem.scatter:  # chance differences may absorb a part of the change
        precision = base.problem.parameters.precision
        products = Products.of(base.jacobian, np.where(precision > 0.0, _HELD, 0.0))
    return damped_step(
        base.problem, point or base.point, [-c for c in change], base.jacobian, 0.0, products, linear=True
    )


def change_to(base: Fit, problem: Problem, point: Point) -> list[Array]:
    """Change of the scaled prediction from a fit to a point of a problem with further parameters."""
    moved, runs = problem.predict([point])[0], base.problem.data.runs
    return [run.scaled(m - run.reading) + r for m, run, r in zip(moved, runs, base.residuals, strict=True)]


def _moderate_change(
    base: Fit,
    problem: Problem,
    values: Array,
    scaled: int | None,
    replaced: int | None = None,
    *,
    second_order: bool = False,
) -> list[Array] | None:
    """Change of the scaled prediction by an effect, one of its values lowered until the change is moderate.

    ``values`` has the effect's parameters and is changed in place to the used values; ``scaled`` is the index
    of the value to lower, None for none; ``replaced`` is the common parameter that the effect replaces. If the
    runs differ by chance, the change is small: the square of a phase error is an amplitude error, which would
    distinguish an effect from such differences. An effect of ``second_order`` shows only by that square.
    """
    limit = (_SMALL if base.problem.scatter and not second_order else _MODERATE) * np.sqrt(base.total)
    for _ in range(12):
        change = change_to(
            base, problem, Point(_with_effect(base, values, scaled, replaced), base.point.per_run)
        )
        size = float(np.sqrt(sum(float(c @ c) for c in change)))
        if np.isfinite(size) and (size <= limit or scaled is None):
            return change
        if scaled is None:
            return None
        values[scaled] *= 0.1 if not np.isfinite(size) else max(0.01, 0.5 * limit / size)
    return None


def unabsorbed(base: Fit, kind: type[Effect]) -> tuple[Array, float] | None:
    """The change by an effect of typical size that the fitted parameters cannot absorb.

    Args:
        kind: an effect without parameters per run.

    Returns:
        The scaled change of all runs, shape (n,), and its norm as a share of the whole change; None where the
        runs cannot show the effect.
    """
    trial = next(iter(kind.trials(_circumstances(base))), None)
    if trial is None or not base.problem.data.may_show(kind):
        return None
    effects = (*base.problem.effects, kind)
    form = next(iter(kind.forms()), ())
    free_forms = tuple(f"{kind.name}.{name}" for name in form)
    problem = dataclasses.replace(base.problem, effects=effects, free_forms=free_forms)
    infos = _own_parameters(problem, kind)
    values = np.array([trial.values.get(info.name, info.default) for info in infos])
    if not _within(infos, values):
        return None
    scaled = None if trial.scaled is None else [info.name for info in infos].index(trial.scaled)
    change = _moderate_change(base, problem, values, scaled)
    if change is None:
        return None
    left, whole = np.concatenate(project_out(base, change)), np.concatenate(change)
    size = float(np.linalg.norm(whole))
    return None if size == 0.0 else (left, float(np.linalg.norm(left)) / size)


def project_out(base: Fit, columns: list[Array]) -> list[Array]:
    """The part of a change of the prediction, by run, that common parameters and releases of the fit cannot absorb.

    Args:
        columns: scaled change by run, each of shape (n,).
    """
    matrix, gradient, solutions = normal_equations(base.jacobian, columns, products=base.products)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    step = np.linalg.lstsq(matrix / np.outer(scale, scale), gradient / scale, rcond=1e-12)[0] / scale
    return [
        column - common @ step - release @ (solution[:, -1] - solution[:, :-1] @ step)
        for column, (common, release), solution in zip(columns, base.jacobian, solutions, strict=True)
    ]
