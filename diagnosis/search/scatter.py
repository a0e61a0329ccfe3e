"""Chance differences between runs: a layer under every set of causes (docs/decisions/0036-runs-that-do-not-repeat.md).

A wind speed, a spring or a damping that is a little different in every run is no cause beside others. Every run has
its own deviations under every set, with a normal prior whose width is the likeliest for the set; they are integrated
out where sets are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from diagnosis.likelihood.between_runs import Between, RunColumns, width_prior
from diagnosis.likelihood.least_squares import Fit, sensitivities, try_fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from diagnosis.model.run_data import Data
from tunnel_sim.effects import Effect

_ROUNDS = 3  # of widths and fits
_FEWEST = 2  # runs that may differ from each other

Scatter = tuple[tuple[type[Effect], float], ...]


def may_scatter(kinds: Sequence[type[Effect]], data: Data) -> tuple[type[Effect], ...]:
    """The differences that the runs could show: two runs at least have what differs, and a spring holds the body."""
    runs = {"always": len(data.runs), "wind_on": sum(run.wind_on for run in data.runs)}
    held = data.model.restored
    return tuple(kind for kind in kinds if kind.scatters and held and runs[kind.condition] >= _FEWEST)


def with_deviations(problem: Problem, point: Point, scatter: Scatter) -> tuple[Problem, Point]:
    """A problem with chance differences between runs, and a point of it without any.

    Args:
        problem: without such differences.
    """
    layered = replace(problem, scatter=scatter)
    first = len(problem.parameters.own) - problem.parameters.of_effects
    none = np.zeros((len(point.release), len(scatter)))
    release = np.hstack([point.release[:, :first], none, point.release[:, first:]])
    return layered, Point(point.common, release)


def without_deviations(fitted: Fit) -> tuple[Problem, Point]:
    """The problem of a fit without chance differences between runs, and its point."""
    names = fitted.problem.parameters.own_names
    chance = {kind.name for kind, _ in fitted.problem.scatter}
    kept = [place for place, name in enumerate(names) if name not in chance]
    return replace(fitted.problem, scatter=()), Point(fitted.point.common, fitted.point.release[:, kept])


def scattered(found: Fit, kinds: Sequence[type[Effect]]) -> Fit | None:
    """A fit with chance differences between the runs; None where they do not differ, or the fit fails.

    Args:
        found: without such differences.
        kinds: the effects that may be named.
    """
    able = may_scatter(kinds, found.problem.data)
    if not able:
        return None
    problem, point = with_deviations(found.problem, found.point, usual(able))
    jacobian = sensitivities(problem, point)
    if not all(np.all(np.isfinite(c)) and np.all(np.isfinite(r)) for c, r in jacobian):
        return None
    columns, prior = RunColumns.of(problem, point, found.residuals, jacobian), width_prior(problem)
    between = columns.likeliest(prior)
    gain = columns.at(prior.least, prior).found.restricted - between.found.restricted
    if gain < chdtri(len(able), found.settings.scatter.rate):
        return None
    layered = try_fit(replace(problem, scatter=tuple(zip(able, between.widths.tolist(), strict=True))), point)
    return None if layered is None else settled(layered)


def usual(kinds: Sequence[type[Effect]]) -> Scatter:
    """Differences of usual widths."""
    return tuple((kind, kind.parameters()[0].scale) for kind in kinds)


def settled(fitted: Fit, *, rounds: int = _ROUNDS) -> Fit:
    """A fit whose widths are the likeliest for what it leaves; as given where it has no such differences."""
    for _ in range(rounds):
        between = fitted.between
        if between is None:
            return fitted
        prior = width_prior(fitted.problem)
        now = np.array([width for _, width in fitted.problem.scatter])
        here = fitted.columns.at(now, prior)
        if here.restricted - between.restricted < fitted.settings.scatter.settled:
            return fitted
        again = try_fit(with_widths(fitted.problem, between), fitted.point, base=fitted)
        if again is None:
            return fitted
        fitted = again
    return fitted


def with_widths(problem: Problem, between: Between) -> Problem:
    """A problem with other widths of the same differences."""
    kinds = (kind for kind, _ in problem.scatter)
    return replace(problem, scatter=tuple(zip(kinds, between.widths.tolist(), strict=True)))
