"""The result of an investigation: the prepared campaign, the gap, and the answers, each with its own fits."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.residuals import ChannelMisfit, misfit
from diagnosis.model.fact import Fact
from diagnosis.model.nominal import NominalModel
from diagnosis.model.similarity import Similarity
from diagnosis.noise.gap import GapTest
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.choices import Choice, choices
from diagnosis.search.clock import StepClock
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.prepared import Prepared
from diagnosis.search.process_noise import MomentLayer
from diagnosis.search.rivals.rival import FoundRival
from diagnosis.search.scatter import evident, named, shown_by
from diagnosis.search.sets import Names, Sets
from diagnosis.search.surviving import shown_by_one
from diagnosis.settings import Settings
from diagnosis.where.place import Place
from tunnel_sim.vocabulary.campaign import Campaign

NOISE_EXPLAINS: Final = 1.0
"""Maximum gap that irregular noise may explain completely. Judgement. The noise variance itself."""
SHARES_CHANCE: Final = 1.0
"""Standard deviation of the explained share of the gap above which the shares of all sets count as chance.
Convention. As large as the gap itself."""
NOISE_EXCUSED: Final = 0.8
"""Explained share of a gap this small above which irregular noise is not its cause. Judgement (decision
0007). Effects with few parameters explain little of any noise."""

CHOICES_FROM: Final = 0.05
"""Minimum probability of an answer for alternative springs to be sought. Judgement."""


@dataclass(frozen=True)
class Gap:
    """Whether there is a gap, and where.

    Args:
        test: whether there is a gap, after the hum is removed.
        place: place of the gap, from the residuals alone; None if there is no gap.
    """

    test: GapTest
    place: Place | None = None


@dataclass(frozen=True, eq=False)
class Study:
    """Everything found in a campaign, in the units of the similar campaign.

    Args:
        prepared: the campaign before any effect is fitted.
        gap: whether there is a gap, and where.
        answers: the answer first, then the most probable ones; empty without a gap.
        refused: the reason for each refused answer, by its names: effects that the runs do not confirm.
        needless: effects of the most likely set that do not reduce the residual on held-out readings.
        rivals: causes weighed from outside the vocabulary.
        disturbed: disturbed runs, which are left out from the disturbance on.
        between_runs: for an unknown cause, the nominal fit to runs that differ; None where they repeat.
        caution: key of the caution about answers found in the view of the runs; empty: none.
        unexplained_floor: the share of the gap that all effects together leave, if that ended the search; else
            None.
        single: by effect of the answer that only one run can show, that run.
        seconds: wall time by step, s.
    """

    prepared: Prepared
    gap: Gap
    answers: tuple[Answer, ...] = ()
    refused: Mapping[Names, Fact] = field(default_factory=dict)
    needless: Names = ()
    rivals: tuple[FoundRival, ...] = ()
    disturbed: tuple[Disturbance, ...] = ()
    between_runs: Fit | None = None
    caution: str = ""
    unexplained_floor: float | None = None
    single: Mapping[str, str] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def campaign(self) -> Campaign:
        """The similar campaign."""
        return self.prepared.campaign

    @property
    def similarity(self) -> Similarity:
        """The conversion from the measured campaign."""
        return self.prepared.similarity

    @property
    def nominal(self) -> Fit:
        """The fit of the nominal model."""
        return self.prepared.nominal

    @property
    def model(self) -> NominalModel:
        """The nominal model."""
        return self.nominal.problem.data.model

    @property
    def settings(self) -> Settings:
        """The settings of the diagnosis."""
        return self.nominal.settings

    @property
    def read_off(self) -> Names:
        """Causes detected in the records before fitting."""
        return self.prepared.read_off

    @property
    def answer(self) -> Answer | None:
        """The answer; None where no cause was weighed."""
        return self.answers[0] if self.answers else None

    @property
    def fitted(self) -> Names:
        """Causes found by fitting: none, one or several, or ``unknown`` alone."""
        return self.answer.effects if self.answer else ()

    @property
    def scattering(self) -> Names:
        """The unstated chance differences between the runs."""
        return () if self.fitted == UNKNOWN else named(self.chosen)

    def named_beside(self, answer: Answer) -> Names:
        """Causes other than the fitted effects of an answer: detected in the records, or differences between runs.

        The differences belong to the answer. An answer fitted to runs that repeat takes the differences of the
        first answer.
        """
        fit = None if answer is self.answer else answer.fit
        if fit is None or not fit.problem.scatter:
            return self.beside
        return (*self.read_off, *shown_by(fit))

    @property
    def beside(self) -> Names:
        """Causes other than fitted effects: detected in the records, or differences between runs."""
        return (*self.read_off, *self.scattering)

    @property
    def causes(self) -> Names:
        """All causes, sorted; ``unknown`` alone where the vocabulary does not explain the gap."""
        if self.fitted == UNKNOWN:
            return UNKNOWN
        return tuple(sorted({*self.beside, *self.fitted}))

    @property
    def named(self) -> bool:
        """Whether there is a gap with a named cause."""
        return self.causes not in ((), UNKNOWN)

    @property
    def chosen(self) -> Fit:
        """The fit of the answer; the nominal one where the answer has no fitted effect."""
        found = None if self.answer is None else self.answer.fit
        return self.nominal if found is None else found

    @property
    def stated(self) -> Fit:
        """The fit that supplies the reported coefficients."""
        answer = self.answer
        if answer is None or answer.stated is None or answer.stated is answer.hypothesis:
            return self.chosen
        return answer.stated.fit

    @property
    def moment(self) -> MomentLayer | None:
        """The random moment that is part of the answer, or None."""
        return None if self.answer is None else self.answer.moment

    def of(self, effects: Collection[str]) -> Answer | None:
        """The answer of these effects; None if they were not weighed."""
        key = tuple(sorted(effects))
        return next((answer for answer in self.answers if answer.effects == key), None)

    def of_part(self, names: Names) -> Study:
        """The study without its answer and the sets that contain it; a part of the old answer becomes the answer.

        The other sets keep their odds. ``unknown`` is the answer where it is more probable than all sets
        together, or the part was not weighed.

        Args:
            names: of the part, sorted.
        """
        kept = [answer for answer in self.answers if not {*answer.effects} >= {*self.fitted}]
        unknown = next((answer for answer in kept if answer.effects == UNKNOWN), Answer(UNKNOWN, 1.0, 0.0))
        part, total = self.of(names), sum(answer.probability for answer in kept) or 1.0
        least = self.settings.weighing.unknown_from * total
        fitted = part is not None and part.hypothesis is not None and part.moment is None
        known = fitted and unknown.probability < least
        first = part if part is not None and known else unknown
        answers = (first, *(answer for answer in kept if answer is not first))
        return replace(
            self,
            answers=tuple(replace(answer, probability=answer.probability / total) for answer in answers),
            needless=tuple(sorted({*self.needless, *self.fitted} - {*names})),
        )

    @classmethod
    def of_sets(cls, sets: Sets, gap: Gap, clock: StepClock) -> Study:
        """The study with sets as its answers; the first set and its parts are fitted to whole runs.

        Args:
            sets: the sets of the last view.
        """
        prepared = sets.view.prepared
        with clock.step("polishing"):
            whole = sets.in_whole_runs()
        answers = [_with_fits(one, sets, whole) for one in _excused(sets, gap.test)]
        with clock.step("choices"):
            answers = [replace(one, choices=_choices(one, sets)) for one in answers]
        first = answers[0]
        steady = None if first.moment is not None or first.hypothesis is None else first.hypothesis.fit
        single = {} if steady is None else shown_by_one(steady)
        base = sets.view.base
        return cls(
            prepared,
            gap,
            tuple(_less_certain(answers) if single else answers),
            refused=sets.refused,
            rivals=sets.rivals,
            between_runs=evident(base) if answers[0].effects == UNKNOWN and base.problem.scatter else None,
            caution=sets.view.caution,
            unexplained_floor=sets.unexplained_floor,
            single=single,
            seconds=clock.seconds,
        )


def _less_certain(answers: Sequence[Answer]) -> list[Answer]:
    """The answers, if only one run shows an effect of the first: that run may be odd, or its cause unknown."""
    first, *others = answers
    share = 0.0 if first.hypothesis is None else first.hypothesis.fit.settings.selection.odd_share
    doubt = share * first.probability
    if all(one.effects != UNKNOWN for one in others):
        others.append(Answer(UNKNOWN, 1.0, 0.0))
    moved = [replace(one, probability=one.probability + doubt * (one.effects == UNKNOWN)) for one in others]
    return [
        replace(first, probability=first.probability - doubt),
        *sorted(moved, key=lambda one: -one.probability),
    ]


def _with_fits(answer: Answer, sets: Sets, whole: Mapping[Names, Hypothesis | None]) -> Answer:
    """An answer with its fits.

    Args:
        whole: sets fitted to whole runs, by names; None where the fit failed.
    """
    names = answer.effects
    in_view = sets.fitted(names)
    hypothesis = whole.get(names, in_view)
    at_random = sets.at_random(names, hypothesis)
    if at_random is not None:
        return replace(answer, hypothesis=at_random, stated=at_random)
    stated = in_view if sets.view.states_parameters else hypothesis
    return replace(answer, hypothesis=hypothesis, stated=stated)


def _excused(sets: Sets, test: GapTest) -> Sequence[Answer]:
    """The answers; if noise explains the gap, only the causes detected in the records, or ``none``."""
    weighed, prepared = sets.weighed, sets.view.prepared
    if not sets.view.may_be_noise or not noise_explains(sets.view.repeating, test, weighed):
        return weighed
    answer = Answer((), 1.0, 1.0) if prepared.read_off else Answer(UNKNOWN, 1.0, 1.0)
    others = [replace(w, probability=0.0) for w in weighed if w.effects not in ((), UNKNOWN)]
    return [answer, *others]


def noise_explains(nominal: Fit, test: GapTest, weighed: Sequence[Answer]) -> bool:
    """Whether irregular noise may explain a whole small gap, or the shares of the gap are chance.

    Effects with few parameters explain little of any noise, however irregular.
    """
    small = test.noisy and nominal.excess < NOISE_EXPLAINS * nominal.problem.data.mean_block
    closed = any(w.effects != UNKNOWN and w.share < 1.0 - NOISE_EXCUSED for w in weighed)
    return nominal.chance > SHARES_CHANCE or (small and not closed)


def _choices(answer: Answer, sets: Sets) -> tuple[Choice, ...]:
    """The choices of a probable answer that the runs cannot exclude, with its coefficients."""
    nominal = sets.view.prepared.nominal
    chosen = answer.stated
    if chosen is None or answer.probability < CHOICES_FROM:
        return ()
    if all(kind.chosen_spring() is None for kind in chosen.fit.problem.effects):
        return ()
    gap = _gap_beside(chosen.fit, nominal, sets.view.base)
    return () if gap is None else choices(chosen, gap)


def _gap_beside(fit: Fit, *known: Fit) -> ChannelMisfit | None:
    """Misfit of the nominal model to the readings of a fit, in the fit's noise; None where its fit fails.

    Args:
        known: fits of the nominal model; the first of them is a fit to whole runs.
    """
    data = fit.problem.data
    for base in known:
        if base.problem.data is data:
            return misfit(base)
    if len(data.runs) != len(known[0].problem.data.runs):
        return None
    fitted = try_fit(replace(known[0].problem, data=data), known[0].point)
    return None if fitted is None else misfit(fitted)
