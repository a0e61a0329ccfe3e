"""Sets of causes fitted in stretches of the runs, where the nominal model misses the motion itself.

Where the model is far from the motion, its phase is lost within a few cycles, and χ² of a whole run has many
minima. In a stretch of two cycles the phase cannot be lost: there, a model error changes the frequency and the
damping from stretch to stretch (multiple shooting; Bock, Springer Ser. Chem. Phys. 18 (1981) 102).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import ceil
from typing import Final, Self

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit
from diagnosis.likelihood.starting_points import loses_phase, misses_motion
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.model.similarity import REFERENCE_FREQUENCY
from diagnosis.search.clock import Progress, StepClock
from diagnosis.search.hypothesis import Hypothesis, with_forms
from diagnosis.search.one_more import sets_with_one_more
from diagnosis.search.prepared import Prepared, fit_nominal
from diagnosis.search.random_moments import is_shaken
from diagnosis.search.runs_in_view import FORM_OPEN
from diagnosis.search.scatter import scattered
from diagnosis.search.sets import Sets
from diagnosis.search.views.view import View
from tunnel_sim.effects import Effect

FITTED_LONGER: Final = 4
"""Number of sets of each size that are found on short stretches and fitted to long ones. Judgement. Time
against coverage."""

_SHORT, _LONG = 2, 18  # number of cycles
_LONGER = 3  # ratio of the lengths of successive fits: the phase at the end of a stretch is known well enough
_TOLERANCE = 1e-3  # tolerance of the intermediate fits
_ITERATIONS = 15


def long_stretch(short: Stretches) -> int:
    """Length, in blocks, of the stretches on which sets of causes are compared, given stretches of two cycles.

    Eighteen cycles are long enough for the phase to test the model of the motion. A hundred would also show the
    clock, the temperature and the release by hand.
    """
    return short.length * _LONG // _SHORT


@dataclass(frozen=True, eq=False)
class Stretches:
    """The runs of a campaign in stretches.

    Args:
        data: the stretches, as runs.
        places: run number and first block of each stretch.
        length: length in blocks; the last stretch of a run may be between half and one and a half times as
            long.
    """

    data: Data
    places: tuple[tuple[int, int], ...]
    length: int

    def only(self, places: Container[tuple[int, int]]) -> Stretches:
        """The stretches at the given places."""
        if all(place in places for place in self.places):
            return self
        kept = [k for k, place in enumerate(self.places) if place in places]
        runs = tuple(self.data.runs[k] for k in kept)
        return Stretches(self.data.with_runs(runs), tuple(self.places[k] for k in kept), self.length)


def in_stretches(data: Data, length: int | None = None) -> Stretches:
    """Cut runs into stretches for fits with autonomous effects.

    Args:
        length: length of a stretch, in blocks; default: two cycles. Stretches of a multiple of it share ends.
    """
    if length is None:
        length = round(_SHORT / (REFERENCE_FREQUENCY * data.runs[0].interval))
    parts, places = [], []
    for number, run in enumerate(data.runs):
        count = max(1, round(run.reading.size / length))
        begins = [k * length for k in range(count)]
        for begin, end in zip(begins, [*begins[1:], run.reading.size], strict=True):
            name = f"{run.id} from block {begin}"
            parts.append(dataclasses.replace(run.part(begin, end), id=name, stretch_of=run.id))
            places.append((number, begin))
    return Stretches(data.with_runs(tuple(parts)), tuple(places), length)


def spread_out(short: Stretches, data: Data) -> Stretches:
    """Stretches of two cycles on which sets of causes grow, spread over the runs where there are too many.

    Returns:
        The stretches within every k-th stretch of eighteen cycles, including the first of each run. k is the
        least number that keeps the blocks within the limit for growth.
    """
    each = ceil(sum(run.reading.size for run in data.runs) / data.settings.search.grown_on)
    long = in_stretches(data, long_stretch(short))
    kept: set[tuple[int, int]] = set()
    for run in range(len(data.runs)):
        begins = [begin for number, begin in long.places if number == run]
        ends = [*begins[1:], data.runs[run].reading.size]
        for begin, end in list(zip(begins, ends, strict=True))[::each]:
            kept.update(place for place in short.places if place[0] == run and begin <= place[1] < end)
    return short.only(kept)


def fit_longer(
    found: Fit, stretches: Stretches, data: Data, length: int | None = None
) -> tuple[Fit, Stretches]:
    """Fit ever longer stretches, each from the fit of shorter ones.

    Args:
        found: a fit of the stretches, including the first of each run.
        length: target length, in blocks; None: whole runs.

    Returns:
        The fit of the longest stretches, and these stretches. Whole runs are one stretch each and keep their
        names.

    Raises:
        FitError: when the model cannot be integrated.
    """
    longest = max(run.reading.size for run in data.runs)
    goal = longest if length is None else min(length, longest)
    while stretches.length < goal:
        known = dict(zip(stretches.places, found.point.per_run, strict=True))
        longer = in_stretches(data, min(stretches.length * _LONGER, goal)).only(known)
        if longer.length >= longest:
            longer = Stretches(data, tuple((i, 0) for i in range(len(data.runs))), longest)
        release = np.array([known[place] for place in longer.places])
        problem = dataclasses.replace(found.problem, data=longer.data)
        start = Point(found.point.common, release)
        if longer.length >= goal:
            found = fit(problem, start)
        else:
            found = fit(problem, start, tolerance=_TOLERANCE, max_iterations=_ITERATIONS)
        stretches = longer
    return found, stretches


@dataclass(frozen=True, eq=False)
class InStretches(View):
    """Long stretches of the runs, on which sets are compared, and short ones, on which they grow.

    Effects are added on short stretches, in which the phase cannot be lost. The sets that keep the phase on
    long stretches are extended there, because a slow loss of phase hardly shows in two cycles.

    Args:
        first: fit of the nominal model to the short stretches.
        short: the short stretches.
        long: the long stretches.
    """

    first: Fit
    short: Stretches
    long: Stretches

    @classmethod
    def after(cls, prepared: Prepared, known: Sets | None, clock: StepClock) -> Self | None:
        """The first view where the nominal model loses the phase of the motion; an input keeps the phase."""
        lost = prepared.ringing is None and loses_phase(prepared.nominal)
        if known is not None or not prepared.able or not lost:
            return None
        with clock.step("effects"):
            return cls.of(prepared)

    @classmethod
    def of(cls, prepared: Prepared) -> Self:
        """The nominal model fitted to stretches of the runs."""
        data = prepared.nominal.problem.data
        short = spread_out(in_stretches(data), data)
        first = fit_nominal(short.data)
        try:
            base, long = fit_longer(first, short, data, long_stretch(short))
        except (FitError, np.linalg.LinAlgError):  # a model without the causes may diverge on long stretches
            base, long = first, short
        return cls(prepared, base, first, short, long)

    @property
    def able(self) -> Sequence[type[Effect]]:
        """The effects that do not depend on the time before a stretch."""
        return [kind for kind in self.prepared.able if kind.autonomous]

    @property
    def smallest(self) -> Hypothesis:
        """The nominal model."""
        return Hypothesis((), self.base, short=Hypothesis((), self.first))

    def larger(self, level: Sequence[Hypothesis], progress: Progress | None) -> list[Hypothesis]:
        """The sets with one effect more, from the better of two starts if there are two."""
        data = self.prepared.nominal.problem.data
        tried = sets_with_one_more([h.short for h in level if h.short is not None], self.able, progress)
        grown: dict[tuple[str, ...], Hypothesis] = {}
        for h in sorted(tried, key=lambda h: h.fit.total)[:FITTED_LONGER]:
            with suppress(FitError, np.linalg.LinAlgError):
                longer, _ = fit_longer(h.fit, self.short, data, long_stretch(self.short))
                grown[h.names] = replace(h, fit=longer, short=h)
        following = [h for h in level if h.effects and not misses_motion(h.fit)]
        for child in sets_with_one_more(following, self.able, progress):
            other = grown.get(child.names)
            if other is None or child.fit.total < other.fit.total:
                grown[child.names] = replace(child, short=None if other is None else other.short)
        return list(grown.values())

    def with_forms(self, children: Sequence[Hypothesis], level: Sequence[Hypothesis]) -> Sequence[Hypothesis]:
        """Sets with their forms freed if the textbook form leaves more than sensors and springs may cause."""
        may = self.base.settings.weighing.model_error**2 * self.gap.motion / self.base.count
        return with_forms(children, self.gap, min(FORM_OPEN * level[0].fit.excess, may))

    def to_grow(self, level: Sequence[Hypothesis], going: Sequence[Hypothesis]) -> list[Hypothesis]:
        """The best child of each parent, then the others: the best fit at first may be a dead end."""
        first: list[Hypothesis] = []
        for parent in level:
            own = [h for h in going if h not in first and set(parent.effects) < set(h.effects)]
            first += own[:1]
        kept = first + [h for h in going if h not in first]
        return kept[: self.base.settings.search.grown_from]

    def whole(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """The set fitted to ever longer stretches, up to whole runs."""
        with suppress(FitError, np.linalg.LinAlgError):
            whole, _ = fit_longer(hypothesis.fit, self.long, self.prepared.nominal.problem.data)
            return replace(hypothesis, fit=whole)
        return None

    def for_whole_runs(self, likely: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
        """The likely sets fitted to whole runs if the runs show scatter or a random moment beside one.

        Chance differences between runs and random moments are compared in whole runs only. On stretches the
        first would look like effects, and the releases of the stretches would absorb the second.
        """
        found = sorted(filter(None, map(self.whole, likely)), key=lambda one: one.fit.total)
        kinds = self.prepared.kinds
        differ = any(scattered(one.fit, kinds) is not None for one in found)
        return tuple(found) if differ or any(is_shaken(one.fit, kinds) for one in found[:1]) else ()
