"""Fitted sets of causes in one view of the runs: compared with their neighbours and rivals, and weighed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit, scaled_residuals, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.likelihood.residuals import misfit
from diagnosis.model.fact import Fact
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.clock import StepClock
from diagnosis.search.hypothesis import Hypothesis, with_forms
from diagnosis.search.one_more import same_change, sets_with_one_more
from diagnosis.search.patterns import has_a_cause, with_drifts
from diagnosis.search.rivals.rival import FoundRival, Rival
from diagnosis.search.runs_in_view import RunsInView
from diagnosis.search.scatter import with_scatter
from diagnosis.search.surviving import refusal
from diagnosis.search.weigh import weigh
from diagnosis.search.weights import FittedSet

RIVAL_FORMS: Final = 0.05
"""Minimum probability of a rival set for its forms to be freed. Judgement."""
OUTSIDE_FROM: Final = 0.05
"""Minimum probability of a set for comparison with explanations outside the vocabulary. Judgement."""
LIKELY_FROM: Final = 0.05
"""Minimum probability of a set for the runs to be compared beside it. Judgement. Time against coverage."""

Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Sets:
    """The sets and rivals weighed in a view of the runs.

    Args:
        view: the view.
        hypotheses: sets of effects fitted in it.
        random: sets with a random moment that passed its tests.
        rivals: causes from outside the vocabulary, weighed beside the sets.
        refused: the reason for each refused answer, by its names: effects that the runs do not confirm.
        unexplained_floor: the share of the gap that all effects together leave, if that ended the search; else
            None.
        confirmed: the answer fitted to whole runs, with every effect confirmed by the runs; None where the answer
            is not a fitted set, or is not confirmed yet.
    """

    view: RunsInView
    hypotheses: tuple[Hypothesis, ...]
    random: tuple[Hypothesis, ...] = ()
    rivals: tuple[FoundRival, ...] = ()
    refused: Mapping[Names, Fact] = field(default_factory=dict)
    unexplained_floor: float | None = None
    confirmed: Hypothesis | None = None

    @cached_property
    def weighed(self) -> list[Answer]:
        """The answers with their probabilities, the answer first; shares are of the gap in the view."""
        base, prepared, nominal = self.view.base, self.view.prepared, self.view.gap
        sets = [self._fitted_set(one) for one in (*self.hypotheses, *self.random)]
        outside = (one for rival in self.rivals for one in rival.hypotheses)
        sets += [one.fitted_set(self.view.repeating, nominal, outside=True) for one in outside]
        if prepared.read_off:  # a cause detected in the records may be the only one, and is part of the gap
            sets.append(FittedSet((), 1.0, nominal.excess, scatter_cost=nominal.scatter_cost))
        nominal = replace(nominal, chi2=nominal.chi2 + prepared.hum_power(base))
        own = self.view.left_by_read_off
        whole = None if self.view.repeating is base else misfit(self.view.repeating)
        sets = [replace(one, excess=one.excess - own) for one in sets]
        return weigh(sets, nominal, base.settings.weighing, whole)

    def _fitted_set(self, one: Hypothesis) -> FittedSet:
        """The set as input of the weighing.

        A drift in the order of the runs is neither scatter nor an effect of the vocabulary. Beside any set it costs
        as much as an effect. Where the runs differ by patterns alone, or with a condition, the cause is unknown.
        """
        outside = not one.effects and has_a_cause(one.fit)
        found = one.fitted_set(self.view.repeating, self.view.gap, outside=outside)
        drifting = with_drifts(one.fit)
        if drifting is None:
            return found
        cost = drifting.cost(self.view.gap.deviation_precision) + 2.0 * one.fit.settings.weighing.set_price
        return replace(found, scatter_cost=cost if outside else min(cost, found.scatter_cost))

    def fitted(self, names: Sequence[str]) -> Hypothesis | None:
        """The set of these effects; None if they were not fitted together."""
        key = tuple(sorted(names))
        return next((h for h in self.hypotheses if h.names == key), None)

    def at_random(self, names: Names, steady: Hypothesis | None) -> Hypothesis | None:
        """The set of these causes with a random moment; None if there is none, or they explain more without it.

        Args:
            names: sorted.
            steady: the effects fitted without a random moment, if available.
        """
        found = next((one for one in self.random if one.names == names), None)
        if found is None or found.moment is None or steady is None:
            return found
        share = max(steady.fit.excess, 0.0) / max(self.view.prepared.nominal.excess, 1e-9)
        return found if found.moment.left.share < share else None

    @property
    def best(self) -> Hypothesis | None:
        """The most probable answer that is a fitted set."""
        named = (self.fitted(w.effects) for w in self.weighed)
        return next((hypothesis for hypothesis in named if hypothesis is not None), None)

    @property
    def likely(self) -> list[Hypothesis]:
        """The fitted sets that are not improbable, the most probable first; none beside a random moment."""
        named = (w.effects for w in self.weighed if w.probability > LIKELY_FROM)
        found = [*filter(None, (self.best, *map(self.fitted, named)))]
        return [] if self.random else list(dict.fromkeys(found))

    @property
    def answer(self) -> Hypothesis | None:
        """The set that is the answer; None if the answer is not a fitted set, or includes a random moment."""
        names = self.weighed[0].effects
        found = self.fitted(names)
        return found if self.at_random(names, found) is None else None

    def without(self, names: Names, reason: Fact | None) -> Sets:
        """The sets without one set that the runs do not confirm.

        Args:
            names: names of the set, sorted.
            reason: reason for the refusal; None where the set cannot be fitted to whole runs.
        """
        kept = tuple(h for h in self.hypotheses if h.names != names)
        return replace(self, hypotheses=kept, refused=self._refused(names, reason))

    def without_moment(self, refused: Hypothesis, reason: Fact) -> Sets:
        """The sets without one set with a random moment that the runs do not confirm."""
        kept = tuple(one for one in self.random if one is not refused)
        return replace(self, random=kept, refused=self._refused(refused.names, reason))

    def _refused(self, names: Names, reason: Fact | None) -> Mapping[Names, Fact]:
        return self.refused if reason is None else {**self.refused, names: reason}

    def in_whole_runs(self) -> dict[Names, Hypothesis | None]:
        """The answer and its parts fitted to whole runs, by names; None where that fails."""
        names = self.weighed[0].effects
        found = {h.names: self.view.whole(h) for h in self.hypotheses if set(h.names) < set(names)}
        if self.confirmed is not None:
            at_random = any(one.names == names for one in self.random)
            found[names] = whole = self.confirmed if at_random else self.view.finished(self.confirmed)
            # the parts are compared with the answer, with the answer's chance differences between runs
            parts = {key: part for key, part in found.items() if part is not None and key != names}
            for key, part in parts.items():
                found[key] = replace(part, fit=with_scatter(part.fit, whole.fit.problem.scatter))
        return found


def with_near_rivals(sets: Sets, rivals: Sequence[Rival], clock: StepClock) -> Sets:
    """Add near rivals; drop sets that the runs do not confirm.

    Args:
        rivals: causes from outside the vocabulary.
    """
    sets = _with_near_sets(sets, clock)
    with clock.step("pruning"):
        fitted = (sets.fitted(w.effects) for w in sets.weighed if w.probability > OUTSIDE_FROM)
        likely = [hypothesis for hypothesis in fitted if hypothesis is not None]
        tried = (
            FoundRival(one, tuple(one.hypotheses(likely, sets.hypotheses, sets.view.base))) for one in rivals
        )
        sets = replace(sets, rivals=tuple(one for one in tried if one.hypotheses))
    with clock.step("polishing"):
        return resolved(sets)


def _with_near_sets(sets: Sets, clock: StepClock) -> Sets:
    """Add every set with one effect less than the answer, or with an equivalent effect."""
    pruned, view = set[Names](), sets.view
    while (best := sets.best) is not None and len(best.effects) > 1 and best.names not in pruned:
        pruned.add(best.names)  # a part of the answer may be the answer now
        with clock.step("pruning"):
            by_name = {h.names: h for h in (*sets.hypotheses, *prune(best, sets.hypotheses))}
            known = tuple(by_name.values())
            sets = replace(sets, hypotheses=(*known, *exchange(best, known, view.base)))
    if not pruned:
        return sets
    with clock.step("forms"):  # forms of rival sets are freed, too: growth frees the forms of few sets
        near = [w.effects for w in sets.weighed if w.effects != UNKNOWN and w.probability > RIVAL_FORMS]
        if len(near) < 2:
            return sets
        rivals = [h for h in sets.hypotheses if h.names in near and not h.forms]
        others = [h for h in sets.hypotheses if not any(h is rival for rival in rivals)]
        return replace(sets, hypotheses=(*others, *with_forms(rivals, view.gap, 0.0, len(rivals))))


def resolved(sets: Sets) -> Sets:
    """Drop answers that cannot be fitted to whole runs, or have an effect that the runs do not confirm."""
    while True:
        names = sets.weighed[0].effects
        found = sets.fitted(names)
        at_random = sets.at_random(names, found)
        if at_random is not None:
            reason = refusal(at_random, sets.view.repeating)
            if reason is None:
                return sets
            sets = sets.without_moment(at_random, reason)
        elif found is not None:
            whole = sets.view.settled(found)
            reason = None if whole is None else refusal(whole, sets.view.repeating)
            if whole is not None and reason is None:
                return replace(sets, confirmed=whole)
            sets = sets.without(names, reason)
        else:
            return sets


def prune(whole: Hypothesis, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Sets with one effect less than a given set that are not fitted yet, or not with its forms.

    Growth frees the forms of few sets. A set may owe its fit to the form of one effect, and not to another effect.

    Returns:
        The new sets, each started from the values of the whole set.
    """
    known = {hypothesis.names: hypothesis.fit for hypothesis in found}
    smaller = []
    for kind in whole.fit.problem.effects:
        names = tuple(name for name in whole.effects if name != kind.name)
        part = known.get(tuple(sorted(names)))
        if names and (part is None or not {*part.problem.free_forms} >= {*whole.fit.problem.free_forms}):
            with suppress(FitError, np.linalg.LinAlgError):
                start = restricted(whole.fit, names)
                if part is None or _total(start) < part.total:
                    smaller.append(Hypothesis(names, fit(start.problem, start.point), textbook=part))
    return smaller


def _total(start: Fit) -> float:
    """The χ² at the point of a fit, with the residuals of another problem."""
    left = scaled_residuals(start.problem, start.point)
    return sum(float(r @ r) for r in left) + start.problem.parameters.surprise(start.point)


def exchange(whole: Hypothesis, found: Sequence[Hypothesis], nominal: Fit) -> list[Hypothesis]:
    """The sets in which one effect of a given set is replaced by another that changes the readings alike.

    Args:
        whole: with two effects or more.
        found: fitted hypotheses, among them all with one effect less than ``whole``.

    Returns:
        The sets that are not fitted yet. Two effects are alike if their fits alone are.
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
            for child in sets_with_one_more([by_name[others]], alike):  # converged, like its rival
                fitted = None if child.fit.converged else try_fit(child.fit.problem, child.fit.point)
                sets.append(child if fitted is None else replace(child, fit=fitted))
    return sets
