"""Fitted sets of causes in one view of the runs, and their probabilities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.random_moments import RandomAnswer
from diagnosis.search.rivals.rival import FoundRival
from diagnosis.search.weigh import FittedSet, Weighed, weigh

if TYPE_CHECKING:
    from diagnosis.search.views.view import View

Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Sets:
    """What is weighed in a view of the runs.

    Args:
        view: the view.
        hypotheses: sets of effects fitted in it.
        random: answers with a random moment that passed its tests.
        rivals: what is outside the vocabulary and weighed beside the sets.
        refused: by names of refused answers, their effects that no half of the records shows.
        settled: the answer fitted to whole runs, each of whose effects a half of them shows; None where the answer
            is no fitted set, or is not settled yet.
    """

    view: View
    hypotheses: tuple[Hypothesis, ...]
    random: tuple[RandomAnswer, ...] = ()
    rivals: tuple[FoundRival, ...] = ()
    refused: Mapping[Names, Names] = field(default_factory=dict)
    settled: Hypothesis | None = None

    @cached_property
    def weighed(self) -> list[Weighed]:
        """The answers with their probabilities, the answer first; shares are of the gap in the view."""
        base, prepared, nominal = self.view.base, self.view.prepared, self.view.gap
        sets = [h.fitted_set(base) for h in self.hypotheses]
        sets += [h.fitted_set(base, outside=True) for rival in self.rivals for h in rival.hypotheses]
        sets += [answer.left for answer in self.random]
        if prepared.read_off:  # it may be the only cause, and is part of the gap
            sets.append(FittedSet((), 1.0, nominal.excess))
        nominal = replace(nominal, chi2=nominal.chi2 + prepared.hum_power(base))
        own = self.view.left_by_read_off
        return weigh([replace(one, excess=one.excess - own) for one in sets], nominal, base.settings.weighing)

    def fitted(self, names: Sequence[str]) -> Hypothesis | None:
        """The set of these effects; None where they were not fitted together."""
        key = tuple(sorted(names))
        return next((h for h in self.hypotheses if h.names == key), None)

    def moment(self, names: Names, steady: Hypothesis | None) -> RandomAnswer | None:
        """The random moment among these effects; None where none passed, or the effects close more without it.

        Args:
            names: sorted.
            steady: the effects fitted without a random moment, if they were.
        """
        found = next((answer for answer in self.random if answer.effects == names), None)
        if found is None or steady is None:
            return found
        share = max(steady.fit.excess, 0.0) / max(self.view.prepared.nominal.excess, 1e-9)
        return found if found.share < share else None

    @property
    def best(self) -> Hypothesis | None:
        """The most probable answer that is a fitted set."""
        named = (self.fitted(w.effects) for w in self.weighed)
        return next((hypothesis for hypothesis in named if hypothesis is not None), None)

    @property
    def answer(self) -> Hypothesis | None:
        """The set that is the answer; None where that is no fitted set, or a random moment is among it."""
        names = self.weighed[0].effects
        found = self.fitted(names)
        return found if self.moment(names, found) is None else None

    def without(self, names: Names, lost: Names) -> Sets:
        """The sets without one, some of whose effects no half of the records shows.

        Args:
            names: of the set, sorted.
            lost: of these effects; none where the set cannot be fitted to whole runs.
        """
        kept = tuple(h for h in self.hypotheses if h.names != names)
        return replace(self, hypotheses=kept, refused={**self.refused, **({names: lost} if lost else {})})

    def in_whole_runs(self) -> dict[Names, Hypothesis | None]:
        """The answer and its parts fitted to whole runs, by names; None where that fails."""
        names = self.weighed[0].effects
        found = {h.names: self.view.whole(h) for h in self.hypotheses if set(h.names) < set(names)}
        if self.settled is not None:
            at_random = any(moment.effects == names for moment in self.random)
            found[names] = self.settled if at_random else self.view.finished(self.settled)
        return found
