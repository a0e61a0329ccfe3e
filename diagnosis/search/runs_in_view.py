"""The runs in a view: how they are fitted while sets of causes grow, and how a set is fitted to whole runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Final, Self

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import ChannelMisfit, gap_left
from diagnosis.search.clock import Progress
from diagnosis.search.hypothesis import FREED_HYPOTHESES, Hypothesis, polish, with_forms
from diagnosis.search.one_more import same_change, sets_with_one_more
from diagnosis.search.prepared import Prepared
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.record import Array

FORM_OPEN: Final = 0.02
"""Minimum share of the excess that a textbook form leaves unexplained for its forms to be freed. Judgement
(decision
0006)."""


@dataclass(frozen=True, eq=False)
class RunsInView:
    """The form of the runs to which sets of causes are fitted.

    Args:
        prepared: the campaign, with its nominal model fitted to the whole runs of the answers.
        base: fit of the nominal model in this view; shares refer to its gap.
    """

    prepared: Prepared
    base: Fit

    #: Whether the parameters of an answer are fitted in the view instead of whole runs.
    states_parameters: ClassVar[bool] = False
    #: Whether the gap may be so small that irregular noise explains it.
    may_be_noise: ClassVar[bool] = False
    #: Key of the caution about answers found in the view; empty: none.
    caution: ClassVar[str] = ""

    def on(self, base: Fit) -> Self:
        """The same view of runs with other noise, for a given fit of the nominal model."""
        return replace(self, base=base)

    @cached_property
    def gap(self) -> ChannelMisfit:
        """Misfit of the nominal model in the view, by channel."""
        return gap_left(self.base)

    @cached_property
    def left_by_read_off(self) -> Array:
        """χ² by channel that needs no effect, shape (6,), dimensionless."""
        return self.prepared.left_by_read_off(self.base)

    @property
    def repeating(self) -> Fit:
        """The nominal fit with runs that repeat exactly; shares refer to its gap."""
        return self.base

    # ---- how sets are grown ----

    @property
    def able(self) -> Sequence[type[Effect]]:
        """The effects that a fit in the view can find."""
        return self.prepared.able

    @property
    def smallest(self) -> Hypothesis:
        """The set that all others contain."""
        return Hypothesis((), self.base)

    def larger(self, level: Sequence[Hypothesis], progress: Progress | None) -> list[Hypothesis]:
        """The sets with one effect more than the sets of a level."""
        return sets_with_one_more(level, self.able, progress)

    def with_forms(self, children: Sequence[Hypothesis], level: Sequence[Hypothesis]) -> Sequence[Hypothesis]:
        """Sets with their forms freed where that pays.

        Args:
            level: the sets with one effect less, from which the sets are grown, the best first.
        """
        parent = level[0]
        count = FREED_HYPOTHESES if not parent.effects else 1
        return with_forms(children, self.gap, FORM_OPEN * parent.fit.excess, count)

    def to_grow(self, level: Sequence[Hypothesis], going: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The sets to be grown further; one of several that change the readings alike.

        Args:
            level: the sets from which the candidates are grown.
            going: the candidates, the best first.
        """
        del level
        kept: list[Hypothesis] = []
        for hypothesis in going:  # sets that change the readings alike would also grow alike
            if not any(same_change(hypothesis.fit, other.fit, self.base) for other in kept):
                kept.append(hypothesis)
        return kept[: self.base.settings.search.grown_from]

    def holds(self, answer: Hypothesis | None, settled: Hypothesis | None) -> bool:
        """Whether an answer holds in whole runs, so that no view of whole runs is needed.

        Args:
            answer: fitted in the view; None: the answer is not a fitted set.
            settled: the same answer, fitted to whole runs.
        """
        del answer, settled
        return True

    def for_whole_runs(self, likely: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
        """The likely sets fitted to whole runs if these show scatter or a random moment, and the view cannot."""
        del likely
        return ()

    # ---- how they are fitted to whole runs ----

    def whole(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """A set fitted to whole runs, from its fit in the view; None where that fails."""
        raise NotImplementedError

    def settled(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """A possible answer, fitted to whole runs and to convergence; None where that fails.

        Its effects are then checked in each half of the runs.
        """
        return self.whole(polish(hypothesis))

    def finished(self, settled: Hypothesis) -> Hypothesis:
        """The answer in its final form, from its fit to whole runs."""
        return settled
