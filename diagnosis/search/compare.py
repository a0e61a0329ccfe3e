"""The sets that an answer has to be compared with: smaller ones, exchanged ones, rivals, and halves of the runs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit, try_fit
from diagnosis.search.clock import Clock
from diagnosis.search.grow import same_change, sets_with_one_more
from diagnosis.search.hypothesis import Hypothesis, restricted, with_forms
from diagnosis.search.resolved import unresolved
from diagnosis.search.rivals.rival import FoundRival, Rival
from diagnosis.search.sets import Sets
from diagnosis.search.weigh import UNKNOWN


def compared(sets: Sets, rivals: Sequence[Rival], clock: Clock) -> Sets:
    """The sets with those that the answer is compared with, and without those that no half of the runs shows.

    Args:
        rivals: from outside the vocabulary.
    """
    sets = _with_near_sets(sets, clock)
    with clock.step("pruning"):
        least = sets.view.base.settings.search.outside_from
        fitted = (sets.fitted(w.effects) for w in sets.weighed if w.probability > least)
        likely = [hypothesis for hypothesis in fitted if hypothesis is not None]
        tried = (
            FoundRival(one, tuple(one.hypotheses(likely, sets.hypotheses, sets.view.base))) for one in rivals
        )
        sets = replace(sets, rivals=tuple(one for one in tried if one.hypotheses))
    with clock.step("polishing"):
        return resolved(sets)


def _with_near_sets(sets: Sets, clock: Clock) -> Sets:
    """With every set that has one effect less than the answer, or another one that does the same."""
    best, view = sets.best, sets.view
    if best is None or len(best.effects) == 1:
        return sets
    with clock.step("pruning"):
        known = (*sets.hypotheses, *prune(best, sets.hypotheses))
        sets = replace(sets, hypotheses=(*known, *exchange(best, known, view.base)))
    with clock.step("forms"):  # of rival sets, free where that pays: growth frees those of few sets
        least = view.base.settings.search.rival_forms
        near = [w.effects for w in sets.weighed if w.effects != UNKNOWN and w.probability > least]
        if len(near) < 2:
            return sets
        rivals = [h for h in sets.hypotheses if h.names in near and not h.forms]
        others = [h for h in sets.hypotheses if not any(h is rival for rival in rivals)]
        return replace(sets, hypotheses=(*others, *with_forms(rivals, view.gap, 0.0, len(rivals))))


def resolved(sets: Sets) -> Sets:
    """Without the answers that cannot be fitted to whole runs, or of which no half of them shows some effect."""
    while (answer := sets.answer) is not None:
        whole = sets.view.settled(answer)
        lost = () if whole is None else unresolved(whole.fit)
        if whole is not None and not lost:
            return replace(sets, settled=whole)
        sets = sets.without(answer.names, lost)
    return sets


def prune(whole: Hypothesis, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses with one effect less than a given one that were not fitted yet.

    Returns:
        The missing ones, each started from the values of the whole.
    """
    known = {hypothesis.names for hypothesis in found}
    smaller = []
    for kind in whole.fit.problem.effects:
        names = tuple(name for name in whole.effects if name != kind.name)
        if names and tuple(sorted(names)) not in known:
            with suppress(FitError, np.linalg.LinAlgError):
                start = restricted(whole.fit, names)
                smaller.append(Hypothesis(names, fit(start.problem, start.point)))
    return smaller


def exchange(whole: Hypothesis, found: Sequence[Hypothesis], nominal: Fit) -> list[Hypothesis]:
    """The sets in which one effect of a given set is replaced by another that changes the readings alike.

    Args:
        whole: with two effects or more.
        found: fitted hypotheses, those with one effect less than ``whole`` among them.

    Returns:
        Those that were not fitted yet. Two effects are alike where each was fitted alone and the fits are.
    """
    by_name = {hypothesis.names: hypothesis for hypothesis in found}
    alone = {h.effects[0]: h for h in found if len(h.effects) == 1}
    sets: list[Hypothesis] = []
    for name in filter(alone.__contains__, whole.effects):
        others = tuple(sorted(set(whole.effects) - {name}))
        alike = [
            h.fit.problem.effects[0]
            for other, h in alone.items()
            if other not in whole.effects
            and tuple(sorted((*others, other))) not in by_name
            and same_change(h.fit, alone[name].fit, nominal)
        ]
        if others in by_name:
            for child in sets_with_one_more([by_name[others]], alike):  # converged, as its rival is
                fitted = None if child.fit.converged else try_fit(child.fit.problem, child.fit.point)
                sets.append(child if fitted is None else replace(child, fit=fitted))
    return sets
