"""A part of a fit: the fit with some of its effects, and the instants and phases sought again beside the others."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from contextlib import suppress

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit, fit_at
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model.parameters import Point
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import OwnNumbers


def restricted(whole: Fit, names: Collection[str]) -> Fit:
    """A fit with only the named effects; everything else, with the residuals, comes from the whole fit.

    Returns:
        A start, with its sensitivities, for the fit of the smaller problem.
    """
    large = whole.problem
    problem = Problem(
        large.data,
        tuple(kind for kind in large.effects if kind.name in names),
        tuple((name, value) for name, value in large.fixed if name.split(".")[0] in names),
        tuple(name for name in large.free_forms if name.split(".")[0] in names),
        large.instants,
        large.scatter,
        large.resolve_rod_mode,
    )
    common = [large.names.index(name) for name in problem.names]
    own = [large.parameters.own_names.index(name) for name in problem.parameters.own_names]
    return dataclasses.replace(
        whole,
        problem=problem,
        point=Point(whole.point.common[common], whole.point.per_run[:, own]),
        covariance=whole.covariance[np.ix_(common, common)],
        jacobian=[(c[:, common], r[:, own]) for c, r in whole.jacobian],
    )


def sought_again(known: Fit) -> Fit:
    """A fit after a second search for instants and phases; each run keeps those with the smaller residual.

    They were first found before the other effects, or their forms, were known. An effect with a free form of its
    own keeps its phases: the search is for the textbook form.
    """
    free = {name.split(".")[0] for name in known.problem.free_forms}
    for kind in known.problem.effects:
        if issubclass(kind, OwnNumbers) and kind.name not in free:
            with suppress(FitError, np.linalg.LinAlgError):
                known = _sought_again(known, kind)
    return known


def _sought_again(known: Fit, kind: type[Effect]) -> Fit:
    others = restricted(known, {other.name for other in known.problem.effects} - {kind.name})
    start = next(iter(starting_points(fit_at(others.problem, others.point), kind)), None)
    if start is None:
        return known
    sought = fit(start.problem, start.point)
    tried = [known, sought]
    if sought.point.per_run.shape == known.point.per_run.shape:  # else the number of instants differs
        release = sought.point.per_run.copy()
        kept = known.chi2 < sought.chi2
        old, new = (one.problem.parameters.own_places[kind.name] for one in (known, sought))
        release[kept, new] = known.point.per_run[kept, old]
        tried.append(fit(sought.problem, Point(sought.point.common, release)))
    return min(tried, key=lambda one: one.total)
