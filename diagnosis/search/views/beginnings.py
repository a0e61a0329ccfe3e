"""Sets of causes of runs with a long input: found in the beginnings of the runs, then compared in whole runs.

An input keeps a body in motion, so the beginning of a run shows as much as the whole run. A free decay has its
large swings at its beginning and its small ones at its end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.likelihood.residuals import misfit
from diagnosis.model.data import Data
from diagnosis.model.similarity import REFERENCE_FREQUENCY
from diagnosis.search.clock import StepClock
from diagnosis.search.hypothesis import Hypothesis, converged, polish
from diagnosis.search.one_more import sets_with_one_more
from diagnosis.search.prepared import Prepared
from diagnosis.search.sets import Sets
from diagnosis.search.views.view import View
from diagnosis.search.views.whole_runs import WholeRuns
from diagnosis.search.weights import OF_MOTION, log_misfit, misfit_scale
from tunnel_sim.effects.capabilities import Clock

COMPARED_FROM: Final = 0.01
"""Minimum probability of a set of the beginnings of driven runs for comparison in whole runs. Judgement
(decision 0007). Time against coverage."""

_LEAST = 8  # cycles in a beginning: a body with a damping ratio of 0.02 remembers as many


def common_length(data: Data) -> int:
    """The greatest length of driven runs, in blocks, that keeps all readings within the chosen number.

    Shorter runs and free decays stay whole. 0 where these alone have more readings.
    """
    free = sum(run.reading.size for run in data.decays)
    left, length = max(data.settings.search.begun_on - free, 0), 0
    sizes = sorted(run.reading.size for run in data.driven_runs)
    for number, size in enumerate(sizes):
        length = left // (len(sizes) - number)
        if size > length:
            break
        left -= size
    return length


def beginnings(data: Data, length: int) -> Data:
    """Driven runs up to a length, in blocks; shorter ones and free decays stay whole."""
    return data.with_runs(tuple(run.beginning(length) for run in data.runs))


@dataclass(frozen=True, eq=False)
class Beginnings(WholeRuns):
    """The beginnings of runs with a long input, in which sets are found."""

    @classmethod
    def after(cls, prepared: Prepared, known: Sets | None, clock: StepClock) -> Self | None:
        """The first view of runs with a long input.

        None where their beginnings would be short, the nominal model has a second mode, or the runs differ by a
        stated scatter.
        """
        data, chosen = prepared.nominal.problem.data, prepared.settings.search
        length, driven = common_length(data), [run.interval for run in data.driven_runs]
        cycles = length * REFERENCE_FREQUENCY * min(driven, default=0.0)
        if sum(run.reading.size for run in data.runs) <= chosen.long_input or cycles < _LEAST:
            return None
        view = super().after(prepared, known, clock)
        if view is None or view.first is not None or view.unscattered is not None:
            return None
        problem = view.base.problem
        begun = try_fit(replace(problem, data=beginnings(problem.data, length)), view.base.point)
        return None if begun is None else replace(view, base=begun)

    def holds(self, answer: Hypothesis | None, settled: Hypothesis | None) -> bool:
        """Whether the answer is a set that explains whole runs as well as their beginnings.

        If it does not, an effect that acts later could pay its price. Chance differences between the runs
        imitate an effect that seldom acts, so whole runs must decide between the two.

        Args:
            answer: fitted to the beginnings; None: the answer is not a fitted set.
            settled: the same answer, fitted to whole runs.
        """
        weighing = self.base.settings.weighing

        def left(fit: Fit, nominal: Fit) -> float:
            scale = misfit_scale(misfit(nominal), weighing)
            return log_misfit(misfit(fit).excess, scale, OF_MOTION, weighing.leak)

        if answer is None or settled is None or answer.fit.problem.scatter or settled.fit.problem.scatter:
            return False
        more = left(settled.fit, self.prepared.nominal) - left(answer.fit, self.repeating)
        return weighing.steepness * more < weighing.set_price

    def whole(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set fitted to whole runs, with the forms that the beginnings free, if any.

        Whole runs are searched again for an effect with instants, because it may act later, too.
        """
        sought = [kind for kind in hypothesis.fit.problem.effects if issubclass(kind, Clock)]
        kept = [name for name in hypothesis.effects if all(kind.name != name for kind in sought)]
        start = restricted(hypothesis.fit, kept) if sought else hypothesis.fit
        problem = replace(start.problem, data=self.prepared.nominal.problem.data)
        fitted = try_fit(problem, start.point)
        found = [] if fitted is None else [Hypothesis(tuple(kept), fitted)]
        for kind in sought:
            found = sets_with_one_more(found, [kind])
        return replace(found[0], plain=found[0].fit) if found else None

    def settled(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set fitted to whole runs, with the forms and the deepest minimum found in the beginnings.

        The covariance of other minima is also from the beginnings, although whole runs would exclude more of
        them.
        """
        begun = polish(hypothesis)
        whole, spread = self.whole(begun), begun.fit.spread
        if whole is None:
            return None
        fitted = converged(whole.fit)
        if spread is not None:
            order = [begun.fit.problem.names.index(name) for name in fitted.problem.names]
            fitted = replace(fitted, spread=spread[np.ix_(order, order)])
        return self.with_differences(replace(whole, fit=fitted))


@dataclass(frozen=True, eq=False)
class AfterBeginnings(View):
    """Whole runs, in which the likely sets of the beginnings are compared.

    Args:
        known: the sets found in the beginnings.
    """

    known: Sets

    may_be_noise: ClassVar[bool] = True

    @classmethod
    def after(cls, prepared: Prepared, known: Sets | None, clock: StepClock) -> Self | None:
        """The view after the beginnings, if their answer holds in whole runs."""
        del prepared, clock
        if known is None or not isinstance(known.view, Beginnings):
            return None
        if not known.view.holds(known.answer, known.confirmed):
            return None
        return cls(known.view.prepared, known.view.prepared.nominal, known)

    def sets(self, clock: StepClock) -> Sets:
        """The likely sets of the beginnings."""
        known = self.known
        likely = (known.fitted(one.effects) for one in known.weighed if one.probability > COMPARED_FROM)
        with clock.step("effects"):
            whole = [known.view.whole(one) for one in likely if one is not None]
        return Sets(self, tuple(one for one in whole if one is not None), refused=known.refused)

    def whole(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set, unchanged."""
        return hypothesis

    def settled(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set with its forms of the beginnings."""
        known, begun = self.known, self.known.fitted(hypothesis.names)
        if known.confirmed is not None and known.confirmed.names == hypothesis.names:
            return known.confirmed
        return polish(hypothesis) if begun is None else known.view.settled(begun)
