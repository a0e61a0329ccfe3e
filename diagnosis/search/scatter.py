"""Chance differences between runs: a layer under every set of causes.

A wind speed, a spring or a damping that differs slightly from run to run is not a cause among others. Beside
any set of causes every run has deviations. Their prior is normal, with the most likely width for the set. They
are integrated out where sets are compared (docs/decisions/0036-the-model-of-a-campaign.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from diagnosis.likelihood.least_squares import Fit, fit_at, scaled_residuals, try_fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.scatter_widths import Between, Kept, ScatterColumns, width_prior
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.model.chance import Chance, Scatter
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.settings import ScatterSettings
from tunnel_sim.effects import BetweenRuns, Effect

WIDTHS_SETTLED: Final = 1.0
"""Drop of −2 ln L above which a fit is repeated with new widths of the scatter, in χ². Convention. A smaller
change is insignificant."""

FEWEST_COMPARED: Final = 3
"""Minimum number of runs that show whether runs repeat. Estimated. One difference gives a width to within a factor
of 16 only."""

_ROUNDS = 3  # rounds of widths and fits
_REPEATING = 8  # iterations of a fit to runs that repeat, which starts close

_TOLERANCE = 1e-7  # drop of χ², as a share of χ², at which the answer's fit has converged


def may_show(kinds: Sequence[type[Effect]], data: Data) -> tuple[type[BetweenRuns], ...]:
    """The differences that the runs could show: at least three runs have the quantity and a spring."""
    return tuple(kind for kind in data.model.may_scatter(kinds) if data.acts(kind).sum() >= FEWEST_COMPARED)


def may_scatter(kinds: Sequence[type[Effect]], data: Data) -> tuple[type[BetweenRuns], ...]:
    """The differences that the runs could show, and the stated ones that act in any run."""
    shown = may_show(kinds, data)
    return tuple(
        kind
        for kind in data.model.may_scatter(kinds)
        if kind in shown or (_stated(kind, data) > 0.0 and data.acts(kind).any())
    )


def _stated(kind: type[BetweenRuns], data: Data) -> float:
    """The width of a difference as the campaign states it, a fraction; 0 where it states none."""
    return data.repeatability.get(kind.scatters, 0.0)


def with_deviations(problem: Problem, point: Point, scatter: Scatter) -> tuple[Problem, Point]:
    """A problem with chance differences between runs, and a point of it with all deviations zero.

    Args:
        problem: a problem without such differences.
    """
    layered = replace(problem, scatter=scatter)
    first = len(problem.parameters.own) - problem.parameters.of_effects
    none = np.zeros((len(point.per_run), len(scatter)))
    release = np.hstack([point.per_run[:, :first], none, point.per_run[:, first:]])
    return layered, Point(point.common, release)


def without_deviations(fitted: Fit) -> tuple[Problem, Point]:
    """The problem of a fit without chance differences between runs, and its point."""
    names = fitted.problem.parameters.own_names
    own = fitted.problem.parameters.places(fitted.problem.scatter)
    kept = [place for place in range(len(names)) if place not in own]
    return replace(fitted.problem, scatter=()), Point(fitted.point.common, fitted.point.per_run[:, kept])


def chance(fitted: Fit, kind: type[BetweenRuns], width: float) -> Chance:
    """A chance difference beside the nominal model as fitted.

    Args:
        width: relative width of the runs' deviations, dimensionless.
    """
    run = fitted.problem.stated(fitted.point.common, fitted.point.per_run[0], fitted.problem.data.runs[0])
    return Chance(kind, width, run.derivatives, run.mechanical_damping)


def usual(fitted: Fit, kind: type[BetweenRuns]) -> Chance:
    """A chance difference of usual width."""
    return chance(fitted, kind, kind.parameters()[0].scale)


def as_stated(fitted: Fit, kinds: Sequence[type[Effect]]) -> Fit:
    """A fit with the scatter that the campaign states; unchanged if it states none.

    Args:
        fitted: a fit to runs that repeat exactly.
        kinds: the effects that may be named.
    """
    widths = {kind: _stated(kind, fitted.problem.data) for kind in may_scatter(kinds, fitted.problem.data)}
    scatter = tuple(chance(fitted, kind, width) for kind, width in widths.items() if width > 0.0)
    if not scatter:
        return fitted
    return try_fit(*with_deviations(fitted.problem, fitted.point, scatter)) or fitted


def scattered(fitted: Fit, kinds: Sequence[type[Effect]]) -> Fit | None:
    """A fit with more scatter than stated; None where the runs do not show it, or the fit fails.

    Args:
        fitted: a fit with the stated scatter.
        kinds: the effects that may be named.
    """
    data = fitted.problem.data
    if not may_show(kinds, data):
        return None
    able = may_scatter(kinds, data)
    scatter = tuple(usual(fitted, kind) for kind in able)
    problem, point = with_deviations(*without_deviations(fitted), scatter)
    jacobian = sensitivities(problem, point)
    if not all(np.all(np.isfinite(c)) and np.all(np.isfinite(r)) for c, r in jacobian):
        return None
    residuals = fitted.residuals if not fitted.problem.scatter else scaled_residuals(problem, point)
    columns = ScatterColumns.of(problem, point, residuals, jacobian)
    if not _evident(columns, fitted.settings.scatter):
        return None
    layered = try_fit(with_widths(problem, columns.likeliest()), point)
    return None if layered is None else with_likeliest_widths(layered)


def differing(fitted: Fit, places: Sequence[int], kinds: Sequence[type[Effect]]) -> Fit | None:
    """Some runs of a fit, refitted with the widest possible deviations; None where they may not differ.

    Args:
        places: places of these runs.
        kinds: the effects that may be named.
    """
    problem, point = without_deviations(fitted)
    runs = tuple(problem.data.runs[place] for place in places)
    problem = replace(problem, data=problem.data.with_runs(runs))
    widest = _with_widest(problem, Point(point.common, point.per_run[list(places)]), fitted, kinds)
    return None if widest is None else try_fit(*widest)


def with_own_linear_terms(fitted: Fit, kinds: Sequence[type[Effect]]) -> tuple[Problem, Point] | None:
    """The problem of a fit with the widest possible deviations of every run, at the fit's point.

    With these deviations, a run determines only the part of an effect that its spring and damping cannot imitate.

    Args:
        kinds: the effects that may be named.

    Returns:
        The problem and the point; None if the runs may not differ.
    """
    widest = _with_widest(*without_deviations(fitted), fitted, kinds)
    return None if widest is None else (widest[0], _same_deviations(*widest, fitted))


def _with_widest(
    problem: Problem, point: Point, fitted: Fit, kinds: Sequence[type[Effect]]
) -> tuple[Problem, Point] | None:
    """A problem without deviations, with the widest that its runs may have added; None where they have none."""
    data = problem.data
    able = tuple(usual(fitted, kind) for kind in data.model.may_scatter(kinds) if data.acts(kind).any())
    if not able:
        return None
    own, start = with_deviations(problem, point, able)
    most = width_prior(own).most
    return replace(own, scatter=tuple(one.as_wide_as(w) for one, w in zip(able, most, strict=True))), start


def _same_deviations(problem: Problem, point: Point, fitted: Fit) -> Point:
    """A point with the deviations of a fit, for the quantities that both have."""
    names, release = fitted.problem.parameters.own_names, point.per_run.copy()
    for place, name in enumerate(problem.parameters.own_names):
        if name in names:
            release[:, place] = fitted.point.per_run[:, names.index(name)]
    return Point(point.common, release)


def evident(fitted: Fit) -> Fit:
    """A fit with chance differences if its runs show more than stated; else as stated."""
    scatter, known = fitted.problem.scatter, fitted.problem.data.repeatability
    if shown := shown_by(fitted):
        widths = fitted.columns.likeliest().widths
        widened = [
            replace(one, width=float(width), shown=one.name in shown)
            for one, width in zip(scatter, widths, strict=True)
        ]
    else:
        stated = [(one, known.get(one.kind.scatters, 0.0)) for one in scatter]
        widened = [replace(one, width=width, shown=False) for one, width in stated if width > 0.0]
    return with_scatter(fitted, tuple(widened))


def shown_by(fitted: Fit) -> tuple[str, ...]:
    """Names of the unstated chance differences that the runs of a fit show; empty where the runs repeat."""
    scatter, chosen = fitted.problem.scatter, fitted.settings.scatter
    if not scatter:
        return ()
    columns = fitted.columns
    if not _evident(columns, chosen):
        return ()
    able = may_show([one.kind for one in scatter], fitted.problem.data)
    shown = zip(scatter, _shown(columns, chosen), strict=True)
    return tuple(one.name for one, seen in shown if seen and one.kind in able)


def _shown(columns: ScatterColumns, chosen: ScatterSettings) -> Kept:
    """The quantities that differ between the runs; the least needed one is removed repeatedly."""
    varying = np.ones(columns.prior.usual.size, bool)
    while varying.sum() > 1:
        places = np.flatnonzero(varying)
        gains = [columns.gain(varying, np.arange(varying.size) == place) for place in places]
        least = int(np.argmin(gains))
        if gains[least] >= chdtri(1.0, chosen.which_scatters_rate):
            break
        varying[places[least]] = False
    return varying


def with_scatter(fitted: Fit, scatter: Scatter) -> Fit:
    """A fit with other chance differences between its runs; unchanged where that fails."""
    if scatter == fitted.problem.scatter:
        return fitted
    problem, point = with_deviations(*without_deviations(fitted), scatter)
    return try_fit(problem, _same_deviations(problem, point, fitted), tolerance=_TOLERANCE) or fitted


def named(fitted: Fit) -> tuple[str, ...]:
    """The unstated chance differences that the runs of a fit show, as `evident` returns them."""
    return tuple(one.name for one in fitted.problem.scatter if one.shown)


def _evident(columns: ScatterColumns, chosen: ScatterSettings) -> bool:
    """Whether the runs differ by more than the least widths."""
    every = np.ones(columns.prior.usual.size, bool)
    limit = chdtri(float(every.size), chosen.scatter_rate)
    return bool(columns.gain(every, every) >= limit)


def with_likeliest_widths(fitted: Fit, *, rounds: int = _ROUNDS) -> Fit:
    """A fit with the most likely widths for its residuals; unchanged if it has no such differences."""
    for _ in range(rounds):
        between = fitted.between
        if between is None:
            return fitted
        here = fitted.columns.at(fitted.widths)
        if here.restricted - between.restricted < WIDTHS_SETTLED:
            return fitted
        again = try_fit(with_widths(fitted.problem, between), fitted.point, base=fitted)
        if again is None:
            return fitted
        fitted = again
    return fitted


def likelier(fitted: Fit, repeating: Fit | None = None) -> Fit:
    """The given fit, or a more likely fit started from runs that repeat exactly.

    Wide deviations hide most of an effect's change between runs, so a fit from them may end in another minimum.

    Args:
        fitted: a fit with scatter between its runs.
        repeating: a fit of the same effects to runs that repeat; None: it starts from the values of ``fitted``.
    """
    if not fitted.problem.scatter:
        return fitted
    if repeating is None:
        repeating = try_fit(*without_deviations(fitted), max_iterations=_REPEATING)
    if repeating is None:
        return fitted
    least = width_prior(fitted.problem).least
    scatter = tuple(one.as_wide_as(width) for one, width in zip(fitted.problem.scatter, least, strict=True))
    start = fit_at(*with_deviations(repeating.problem, repeating.point, scatter))
    # no form is exact: its errors between runs look like narrow deviations
    if start.between is None or not start.between.likelihood < fitted.unlikelihood:
        return fitted
    again = try_fit(with_widths(start.problem, start.between), start.point)
    again = None if again is None else with_likeliest_widths(again)
    return again if again is not None and again.unlikelihood < fitted.unlikelihood else fitted


def with_widths(problem: Problem, between: Between) -> Problem:
    """A problem with other widths of the same differences."""
    wider = (one.as_wide_as(width) for one, width in zip(problem.scatter, between.widths, strict=True))
    return replace(problem, scatter=tuple(wider))
