"""Sets of causes fitted to whole runs, as their angle shows them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.blocks import without_long_rest
from diagnosis.search.clock import Clock
from diagnosis.search.hypothesis import Hypothesis, polish
from diagnosis.search.prepared import Prepared
from diagnosis.search.random_moments import weigh_random_moments, without_the_random_moment
from diagnosis.search.scatter import evident, likelier, scattered
from diagnosis.search.sets import Sets
from diagnosis.search.views.view import View


@dataclass(frozen=True, eq=False)
class WholeRuns(View):
    """Whole runs, without the long rest in which some end.

    Args:
        first: the set that all others contain; None: that without an effect.
        unscattered: the fit of the nominal model with runs that repeat exactly, where the base's do not.
    """

    first: Hypothesis | None = None
    unscattered: Fit | None = None

    may_be_noise: ClassVar[bool] = True

    @classmethod
    def after(cls, prepared: Prepared, known: Sets | None, clock: Clock) -> Self | None:
        """The first view, but of runs that are seen in stretches."""
        if known is not None:
            return None
        first = prepared.ringing
        moving, rested = without_long_rest(prepared.nominal.problem.data)
        if rested:  # where dry friction stops a body, χ² has many minima
            nominal = try_fit(Problem(moving), prepared.nominal.point)
            if nominal is not None:  # what is left may be too short: whole runs then
                prepared = replace(prepared, nominal=nominal, rested=rested)
        if first is not None:
            return cls(prepared, prepared.nominal, first)
        with clock.step("scatter"):
            base = scattered(prepared.nominal, prepared.kinds)
        if base is None:
            return cls(prepared, prepared.nominal)
        return cls(prepared, base, unscattered=prepared.nominal)

    @property
    def repeating(self) -> Fit:
        """The fit of the nominal model with runs that repeat exactly."""
        return self.base if self.unscattered is None else self.unscattered

    def on(self, base: Fit) -> Self:
        """The same view of runs with other noise, in which all sets are grown."""
        return replace(self, base=base, first=None, unscattered=None)

    @property
    def smallest(self) -> Hypothesis:
        """The set that all others contain."""
        return self.first or Hypothesis((), self.base, repeating=self.unscattered)

    def sets(self, clock: Clock) -> Sets:
        """The sets that are found, and the random moments that may act beside them."""
        found = super().sets(clock)
        with clock.step("random moments"):
            random = weigh_random_moments(self, found.hypotheses)
            sets = without_the_random_moment(random, found.hypotheses, self.gap)
        return replace(found, random=tuple(random), hypotheses=tuple(sets))

    def whole(self, hypothesis: Hypothesis) -> Hypothesis:
        """The set as it is."""
        return hypothesis

    def settled(self, hypothesis: Hypothesis) -> Hypothesis:
        """The set as it is."""
        return hypothesis

    def finished(self, settled: Hypothesis) -> Hypothesis:
        """The answer fitted to convergence: only now, as another view may follow."""
        polished = polish(settled)
        fitted = evident(likelier(polished.fit))
        return polished if fitted is polished.fit else replace(polished, fit=fitted)
