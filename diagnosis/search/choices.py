"""Discrete choices that the runs cannot make: which spring is not as stiff as stated.

The inertia is fitted, so one spring that is too stiff and another that is too soft change the frequencies
alike. The coefficients of the two fits differ by far more than their standard deviations, so an answer with one
choice is one of several.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.residuals import ChannelMisfit
from diagnosis.model.parameters import Point
from diagnosis.model.similarity import Similarity
from diagnosis.search.hypothesis import Hypothesis, Scale, is_plausible
from tunnel_sim.effects import Effect

CHOICE_KEPT: Final = 0.05
"""Minimum probability of an alternative spring to be stated. Judgement."""


@dataclass(frozen=True, eq=False)
class Choice:
    """One choice of a set of effects.

    Args:
        hypothesis: the set with this choice, fitted.
        probability: among the choices of the set, a fraction.
    """

    hypothesis: Hypothesis
    probability: float


def choices(chosen: Hypothesis, gap: ChannelMisfit) -> tuple[Choice, ...]:
    """The choices of a set of effects that the runs cannot exclude, the likeliest first.

    Args:
        chosen: a fitted set, with the best-fitting choice.
        gap: misfit of the nominal model.

    Returns:
        The choices probable enough to be stated, weighed like sets of effects; empty for fewer than two.
    """
    others = [
        other
        for kind in chosen.fit.problem.effects
        if (parameter := kind.chosen_spring()) is not None
        for other in _other_springs(chosen, kind, f"{kind.name}.{parameter}")
    ]
    if not others:
        return ()
    sets = [chosen, *others]
    weighing = chosen.fit.settings.weighing
    if chosen.fit.problem.scatter:
        gap = replace(gap, deviation_precision=chosen.fit.columns.products.own)
    scale = Scale.of(sets, gap, weighing)
    logs = np.array([scale.weight(one) for one in sets])
    weights = np.exp(logs - logs.max())
    kept = weights / weights.sum() >= CHOICE_KEPT
    if kept.sum() < 2:
        return ()
    shares = weights * kept / (weights @ kept)
    found = [Choice(one, float(share)) for one, share in zip(sets, shares, strict=True) if share > 0.0]
    return tuple(sorted(found, key=lambda one: -one.probability))


def _other_springs(chosen: Hypothesis, kind: type[Effect], name: str) -> Sequence[Hypothesis]:
    """The set with another spring in place of the chosen one, fitted; a set is omitted if its fit fails."""
    whole, found = chosen.fit, []
    problem, severity = whole.problem, f"{kind.name}.{kind.parameters()[0].name}"
    stated = dict(problem.fixed)[name]
    for spring in problem.data.springs:
        if spring == stated:
            continue
        fixed = tuple((key, spring if key == name else value) for key, value in problem.fixed)
        other = replace(problem, fixed=fixed)
        fitted: Fit | None = try_fit(other, _exchanged(whole, severity))
        if fitted is not None and np.isfinite(fitted.total) and is_plausible(fitted):
            found.append(Hypothesis(chosen.effects, fitted))
    return found


def _exchanged(whole: Fit, severity: str) -> Point:
    """The point with another spring off: with two springs the motion is the same, so the fit keeps its phase.

    A spring (1 + x) times as stiff as stated, with all moments divided by 1 + x, has its stated stiffness, and the
    other spring is then 1/(1 + x) times as stiff as stated. Inertia, damping, moments of effects and the
    coefficients of the air are fitted; the air's pressure is stated.
    """
    problem, factor = whole.problem, 1.0 / (1.0 + whole.value(severity))
    scaled, air = Similarity(moment=factor), problem.data.model.coefficient_units
    common = whole.point.common.copy()
    for place, one in enumerate(problem.parameters.common):
        if one.name == severity:
            common[place] = factor - 1.0
        elif one.name in air:
            common[place] *= factor
        else:
            common[place] = scaled.similar(common[place], one.unit)
    return Point(common, whole.point.per_run)
