"""Sets of causes fitted to the angle in whole runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Final, Self

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.residuals import ChannelMisfit, gap_left, misfit
from diagnosis.model.blocks import without_long_rest
from diagnosis.model.chance import Scatter
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.clock import StepClock
from diagnosis.search.grow import levels
from diagnosis.search.hypothesis import Hypothesis, Scale, of_more_weight, polish, with_forms
from diagnosis.search.prepared import Prepared
from diagnosis.search.random_moments import weigh_random_moments, without_the_random_moment
from diagnosis.search.reach import unexplained_floor
from diagnosis.search.scatter import (
    evident,
    likelier,
    scattered,
    with_deviations,
    with_likeliest_widths,
    without_deviations,
)
from diagnosis.search.sets import Sets, prune, resolved
from diagnosis.search.views.view import View
from diagnosis.search.weights import OF_MOTION, error_of_form, log_misfit, misfit_scale

REACH_FROM: Final = 0.5
"""Unexplained share of the gap, for the best set of a size, above which the limit for larger sets is computed.
Judgement. The largest of a few causes explains about half of a gap."""
OUT_OF_REACH: Final = 0.2
"""Unexplained share of the gap, with all effects together, above which no larger sets are grown. Estimated.
In 77 simulated campaigns with one to four known causes the share is 0.15 at most; it exceeds 0.05 in two. In
six of 14 campaigns with a cause outside the vocabulary it exceeds 0.4. These campaigns are not an independent
test."""
NEARLY_EXPLAINED: Final = 0.2
"""Maximum unexplained share of the gap within runs for the forms of a set beside scatter to be freed.
Judgement. The effect of another form of a cause differs from the textbook form's by less than 45 %. In two
simulated campaigns of three and four causes, free forms did not improve sets with an unexplained share of 0.26
to 0.81."""
GROWN_BESIDE: Final = 0.2
"""Maximum unexplained share of the gap within runs for a set beside scatter to be extended, where no set
explains the runs. Judgement (decision 0007). In two unblinded campaigns of two and three causes, the first
cause left 0.02 and 0.09. Time against coverage."""
BESIDE_SCATTER: Final = 4
"""Number of sets, found for runs that repeat, that are compared after scatter between runs is added. Judgement
(decision 0007). Time against coverage."""


@dataclass(frozen=True, eq=False)
class WholeRuns(View):
    """Whole runs, without the long rest at the end of some.

    Args:
        first: the set contained in all others; None: the empty set.
        unscattered: the nominal fit to runs that repeat exactly, if the runs of the base do not.
        known: the likely sets of another view; scatter or a random moment may act beside them.
    """

    first: Hypothesis | None = None
    unscattered: Fit | None = None
    known: tuple[Hypothesis, ...] = ()

    may_be_noise: ClassVar[bool] = True

    @classmethod
    def after(cls, prepared: Prepared, known: Sets | None, clock: StepClock) -> Self | None:
        """The first view, or the view after one that lacks the noise of whole runs, or an answer in them."""
        holds = known is not None and known.view.holds(known.answer, known.confirmed)
        with clock.step("effects"):
            others = () if known is None else known.view.for_whole_runs(known.likely)
            if holds and not others:
                return None
            view = cls.of(prepared, others)
            return None if holds and not (view.explained or view.shaken) else view

    @classmethod
    def of(cls, prepared: Prepared, known: tuple[Hypothesis, ...] = ()) -> Self:
        """Whole runs, with the nominal model fitted to them.

        Args:
            known: the likely sets of another view, fitted to whole runs.
        """
        first = prepared.ringing
        moving, rested = without_long_rest(prepared.nominal.problem.data)
        if rested:  # if dry friction stops a body, χ² has many minima
            nominal = try_fit(replace(prepared.nominal.problem, data=moving), prepared.nominal.point)
            if nominal is not None:  # the rest may be too short: then whole runs are fitted
                prepared = replace(prepared, nominal=nominal, rested=rested)
        if not prepared.nominal.problem.scatter:
            return cls(prepared, prepared.nominal, first, known=known)
        # the scatter is the stated one, or larger
        base = scattered(prepared.nominal, prepared.kinds) or prepared.nominal
        repeating = try_fit(*without_deviations(prepared.nominal)) or prepared.nominal
        return cls(prepared, base, first, unscattered=repeating, known=known)

    @cached_property
    def explained(self) -> tuple[Hypothesis, ...]:
        """The known sets that explain every run by itself, beside chance differences between the runs."""
        tried = (self.beside(one) for one in self.known)
        return tuple(one for one in tried if one is not None and self._explains(one))

    @cached_property
    def shaken(self) -> tuple[Hypothesis, ...]:
        """The sets with a random moment beside effects; none without known sets.

        The known sets come from stretches: a random moment alone does not explain why the nominal model loses
        the phase.
        """
        tried = weigh_random_moments(self, self.known) if self.known else []
        return tuple(one for one in tried if one.effects)

    @property
    def repeating(self) -> Fit:
        """The nominal fit with runs that repeat exactly."""
        return self.base if self.unscattered is None else self.unscattered

    @cached_property
    def scattering(self) -> Fit | None:
        """The nominal fit to runs that differ by chance; None where they do not."""
        return scattered(self.base, self.prepared.kinds)

    @cached_property
    def _scattering_gap(self) -> ChannelMisfit:
        """Misfit of the nominal model to runs that differ by chance, by channel."""
        assert self.scattering is not None
        return gap_left(self.scattering)

    def on(self, base: Fit) -> Self:
        """The same view of runs with other noise, in which all sets are grown."""
        return replace(self, base=base, first=None, unscattered=None)

    @property
    def smallest(self) -> Hypothesis:
        """The set contained in all others."""
        return self.first or Hypothesis((), self.base, repeating=self.unscattered)

    def sets(self, clock: StepClock) -> Sets:
        """The sets found, and the random moments that may act beside them.

        If the runs differ by chance, sets are first grown in runs that repeat, until one set explains every run
        by itself. From there they grow beside chance differences. If no set does, and none explains runs that
        repeat, the most likely sets are compared beside chance differences.
        """
        grown, explained = self.known, self.explained
        if not explained and self.shaken:
            return _with_random(self.shaken, Sets(self, grown))
        if self.unscattered is not None or self.first is not None:
            return _with_moments(super().sets(clock), clock)
        floor: float | None = None
        with clock.step("effects"):
            for step in () if explained else levels(self, clock.progress):
                grown, floor = step.found, self._floor(step.level)
                # the floor includes deviations of every run, so nothing is tried beside them
                tried = map(self.beside, step.level if floor is None else ())
                explained = tuple(one for one in tried if one is not None and self._explains(one))
                if explained or floor is not None:
                    break
            scale = Scale.of((*grown, self.smallest), self.gap, self.base.settings.weighing)
            likely = sorted(grown, key=lambda one: -scale.weight(one))[:BESIDE_SCATTER]
        if explained:
            return _with_moments(self._beside_scatter(likely, self.likeliest_part(explained), clock), clock)
        found = Sets(self, grown, unexplained_floor=floor)
        beside: Sets | None = None
        if found.weighed[0].effects == UNKNOWN and floor is None and self.scattering is not None:
            beside = self._beside_scatter(likely, None, clock)
            if any(one.effects and self._explains(one) for one in beside.hypotheses):
                return _with_moments(beside, clock)  # nothing remains for a random moment
        plain = _with_moments(found, clock)
        if plain.random:  # a moment that the runs refute must not hide differences between them
            plain = resolved(plain)
        if plain.weighed[0].effects != UNKNOWN or self.scattering is None:
            return plain
        beside = _with_moments(beside or Sets(self._differing(None), (self._none,)), clock)
        return plain if beside.weighed[0].effects == UNKNOWN else beside

    def _floor(self, level: Sequence[Hypothesis]) -> float | None:
        """The share of the gap that all effects together leave, if no larger set could be the cause.

        Computed if the sets of a level leave most of the gap; else None.
        """
        gap = self.base.total - self.base.count
        if not level or any(
            not one.effects or one.fit.total - one.fit.count < REACH_FROM * gap for one in level
        ):
            return None
        left = unexplained_floor(self.base, self.able, self.prepared.kinds)
        return left if left > OUT_OF_REACH else None

    def beside(self, one: Hypothesis) -> Hypothesis | None:
        """A set beside chance differences between the runs, with free forms if the runs need them.

        None where the runs do not differ, or the fit fails.
        """
        if self.scattering is None or not one.effects:
            return None if self.scattering is None else self._none
        if one not in self._fitted_beside:
            self._fitted_beside[one] = self._fitted_with_deviations(one, self.scattering.problem.scatter)
        return self._fitted_beside[one]

    @cached_property
    def _fitted_beside(self) -> dict[Hypothesis, Hypothesis | None]:
        """Cache of sets beside chance differences, by the set in runs that repeat."""
        return {}

    def _fitted_with_deviations(self, one: Hypothesis, scatter: Scatter) -> Hypothesis | None:
        fitted = try_fit(*with_deviations(one.fit.problem, one.fit.point, scatter))
        if fitted is None:
            return None
        found = replace(one, fit=with_likeliest_widths(fitted), textbook=None, repeating=one.fit)
        if not found.explains_runs and self._leaves_less(found, NEARLY_EXPLAINED):
            (found,) = with_forms([found], self._scattering_gap, 0.0)
        return replace(found, fit=with_likeliest_widths(found.fit))

    def _leaves_less(self, beside: Hypothesis, share: float) -> bool:
        """Whether a set beside chance differences leaves less than a share of the gap within runs."""
        left, gap = np.sum(misfit(beside.fit).excess), np.sum(self._scattering_gap.excess)
        return bool(left < share * gap)

    def likeliest_part(self, explained: Sequence[Hypothesis]) -> Hypothesis:
        """The most likely set that explains every run by itself, or its most likely part that does.

        In runs that repeat, a set often contains an effect that imitates differences between the runs.
        """
        found, weighing = {one.names: one for one in explained}, self.base.settings.weighing
        while True:
            scale = Scale.of(tuple(found.values()), self._scattering_gap, weighing)
            best = max(found.values(), key=scale.weight)
            with_less = prune(best, tuple(found.values())) if len(best.effects) > 1 else []
            parts = [part for one in with_less if self._explains(part := self._settled_beside(one))]
            if not parts:
                return best
            found |= {part.names: part for part in parts}

    def _settled_beside(self, part: Hypothesis) -> Hypothesis:
        """A part of a set beside chance differences between the runs, with its own widths."""
        return replace(
            part, fit=with_likeliest_widths(part.fit), repeating=try_fit(*without_deviations(part.fit))
        )

    def _explains(self, beside: Hypothesis) -> bool:
        """Whether a set beside chance differences explains the runs up to chance and an error of its form."""
        return beside.leaves_within(error_of_form(self._scattering_gap, self.base.settings.weighing))

    def _beside_scatter(
        self, likely: Sequence[Hypothesis], explained: Hypothesis | None, clock: StepClock
    ) -> Sets:
        """The sets beside chance differences between the runs.

        Args:
            likely: sets in runs that repeat, the most likely first.
            explained: the set that explains every run by itself and is grown further. None: no set does; sets
                then grow from scatter alone, as long as one nearly explains the runs.
        """
        none, view = self._none, self._differing(explained)
        grown = tuple[Hypothesis, ...]()
        with clock.step("effects"):
            for step in levels(view, clock.progress):
                grown = step.found
                larger = [one for one in step.level if one.effects and explained is None]
                if larger and not any(self._leaves_less(one, GROWN_BESIDE) for one in larger):
                    break
            others = (self.beside(one) for one in likely)
            found: dict[tuple[str, ...], Hypothesis] = {}
            for one in filter(None, (none, *others, *grown)):
                found[one.names] = of_more_weight(found.get(one.names), one, self._scattering_gap)
        return Sets(view, tuple(found.values()))

    @cached_property
    def _none(self) -> Hypothesis:
        """Chance differences between the runs alone."""
        assert self.scattering is not None
        return Hypothesis((), self.scattering, repeating=self.base)

    def _differing(self, first: Hypothesis | None) -> Self:
        """The view of runs that differ by chance.

        Args:
            first: the set contained in all others; None: the empty set.
        """
        assert self.scattering is not None
        return replace(self, base=self.scattering, unscattered=self.base, first=first or self._none)

    def whole(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set, unchanged."""
        return hypothesis

    def settled(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set, unchanged."""
        return hypothesis

    def finished(self, settled: Hypothesis) -> Hypothesis:
        """The answer fitted to convergence; a later step, because another view may follow."""
        return self.with_differences(polish(settled))

    def with_differences(self, polished: Hypothesis) -> Hypothesis:
        """An answer with chance differences between the runs, if they pay the price of an effect."""
        found, stated = polished.fit, bool(self.prepared.nominal.problem.scatter)
        repeats: Fit | None = found
        if found.problem.scatter:
            fitted, repeats = likelier(found), try_fit(*without_deviations(found))
        else:
            fitted = scattered(found, self.prepared.kinds) or found
        if not stated and repeats is not None and not self._pays(fitted, repeats):
            fitted = repeats
        fitted = evident(fitted)
        return polished if fitted is polished.fit else replace(polished, fit=fitted)

    def _pays(self, differing: Fit, repeats: Fit) -> bool:
        """Whether chance differences explain as much of the answer's residual as an effect must.

        Forms of effects are never exact, and their errors between runs are not scatter.
        """
        weighing = self.base.settings.weighing
        scale = misfit_scale(misfit(self.repeating), weighing)
        left, without = (
            log_misfit(misfit(one).excess, scale, OF_MOTION, weighing.leak) for one in (differing, repeats)
        )
        return weighing.steepness * (without - left) > weighing.set_price


def _with_moments(found: Sets, clock: StepClock) -> Sets:
    """Sets, and the random moments that may act beside them."""
    with clock.step("random moments"):
        return _with_random(weigh_random_moments(found.view, found.hypotheses), found)


def _with_random(random: Sequence[Hypothesis], found: Sets) -> Sets:
    """Sets with random moments, and the same sets without them: a moment may not be real."""
    sets = without_the_random_moment(random, found.hypotheses, found.view.gap)
    return replace(found, random=tuple(random), hypotheses=tuple(sets))
