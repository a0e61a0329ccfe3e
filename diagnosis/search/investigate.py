"""Investigate a campaign: measure its noise, test for a gap, fit every effect and weigh the answers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.diagnosable import refuse_indefinite
from diagnosis.likelihood.least_squares import Fit, FitError, fit, scaled_residuals, try_fit
from diagnosis.likelihood.mains_lines import fastest, mains_interval
from diagnosis.likelihood.nondimensional import Similarity
from diagnosis.likelihood.prepare import prepare, without_long_rest, without_rest, without_start
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import CHANNELS, by_moment, misfit
from diagnosis.likelihood.run_data import Data
from diagnosis.likelihood.starting_points import misses_motion, nominal_starts
from diagnosis.model.choose import nominal_model
from diagnosis.model.nominal import NominalModel
from diagnosis.model.similar import similar_campaign
from diagnosis.noise.gap import GapTest, gap_or_colour
from diagnosis.noise.kinds import Noise
from diagnosis.noise.mains import Hum, find_hum, refine_frequency, remove_hum
from diagnosis.noise.rounding import Rounding
from diagnosis.noise.sensor_noise import (
    NoiseTrend,
    campaign_noise,
    noise_trend,
    reading_levels,
    reading_step,
    typical_step,
)
from diagnosis.search.choices import Choice, choices
from diagnosis.search.grow import exchange, grow, grow_in_stretches, prune, second_mode_alone
from diagnosis.search.hypothesis import Hypothesis, polish, with_forms
from diagnosis.search.outside import two_springs
from diagnosis.search.random_moments import RandomAnswer, weigh_random_moments, without_the_random_moment
from diagnosis.search.resolved import unresolved
from diagnosis.search.weigh import UNKNOWN, FittedSet, Weighed, weigh
from diagnosis.settings import Settings
from diagnosis.where.place import Place, locate
from tunnel_sim.effects import ALL_EFFECTS, Effect, the_effect
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

#: The effects that are read off the records before any is fitted.
HUM, COARSE_STEP = the_effect(line="mains"), the_effect(lattice=True)


@dataclass(frozen=True, eq=False)
class Study:
    """Everything found in a campaign, as `diagnosis.search.investigate.investigate` returns it.

    Args:
        campaign: the similar campaign (`diagnosis.likelihood.nondimensional`), whose units all values below have.
        similarity: how it was made from the measured one.
        cleaned: the campaign without the hum, where one was found.
        noise: of the cleaned records.
        trend: of the noise with the motion.
        step: of the lattice on which the readings lie, rad; 0 where they are continuous.
        coarse: whether that step is coarser than the stated resolution.
        hum: the hum that was removed, or None.
        nominal: the fit of the nominal model to the cleaned records.
        test: whether there is a gap, after the hum is removed.
        cut: whether the start of every run and what follows its motion were left out, because the nominal model
            misses the motion grossly.
        unresolved: effects of refused answers that no half of the records shows, by the names of the answer.
        choices: by names of a likely answer, the choices of it that the runs cannot exclude.
        outside: fitted causes from outside the vocabulary, alone or beside effects.
        by_moment: the sets fitted with a random moment beside them, where sets are weighed by the moment that they
            leave and not by the angle.
        rested: runs that end with a long rest, which the fits of effects leave out.
        place: where the gap is, from the residuals alone; None where it is not located yet.
        hypotheses: fitted sets of effects.
        weighed: answers with probabilities, the answer first; empty where there is no gap.
        random: answers with a random moment that passed its tests.
        seconds: wall time by step, s.
    """

    campaign: Campaign
    similarity: Similarity
    cleaned: Campaign
    noise: Noise
    trend: NoiseTrend
    step: float
    coarse: bool
    hum: Hum | None
    nominal: Fit
    test: GapTest
    cut: bool = False
    unresolved: Mapping[tuple[str, ...], tuple[str, ...]] = field(default_factory=dict)
    choices: Mapping[tuple[str, ...], tuple[Choice, ...]] = field(default_factory=dict)
    outside: tuple[Hypothesis, ...] = ()
    by_moment: tuple[Hypothesis, ...] = ()
    rested: tuple[str, ...] = ()
    place: Place | None = None
    hypotheses: tuple[Hypothesis, ...] = ()
    weighed: tuple[Weighed, ...] = ()
    random: tuple[RandomAnswer, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def model(self) -> NominalModel:
        """The nominal model."""
        return self.nominal.problem.data.model

    @property
    def settings(self) -> Settings:
        """The settings of the diagnosis."""
        return self.nominal.settings

    @property
    def read_off(self) -> tuple[str, ...]:
        """Causes read off the records before fitting."""
        found = {HUM.name: self.hum is not None, COARSE_STEP.name: self.coarse}
        return tuple(name for name, present in found.items() if present)

    @property
    def fitted(self) -> tuple[str, ...]:
        """Causes found by fitting: none, one or several, or ``unknown`` alone."""
        return self.weighed[0].effects if self.weighed else ()

    @property
    def causes(self) -> tuple[str, ...]:
        """All causes, sorted; ``unknown`` alone where nothing in the vocabulary explains the gap."""
        if self.fitted == UNKNOWN:
            return UNKNOWN
        return tuple(sorted({*self.read_off, *self.fitted}))

    @property
    def named(self) -> bool:
        """Whether there is a gap and a cause of it is named."""
        return self.causes not in ((), UNKNOWN)

    @property
    def chosen(self) -> Fit:
        """The fit of the answer; the nominal one where no fitted effect is part of it."""
        names = tuple(name for name in self.fitted if name != "unknown")
        random = self.random_answer(names)
        if random is not None:
            return self.nominal if random.beside is None else random.beside.fit
        hypothesis = self.hypothesis(names) if names else None
        return self.nominal if hypothesis is None else hypothesis.fit

    def stated(self, names: Sequence[str]) -> Hypothesis | None:
        """As `hypothesis`, with a random moment beside the effects where they were weighed so."""
        key = tuple(sorted(names))
        return next((h for h in self.by_moment if h.names == key), self.hypothesis(key))

    def hypothesis(self, names: Sequence[str]) -> Hypothesis | None:
        """The fitted hypothesis of these effects; None where they were not fitted together."""
        key = tuple(sorted(names))
        return next((h for h in self.hypotheses if h.names == key), None)

    def random_answer(self, names: Sequence[str]) -> RandomAnswer | None:
        """The random moment among these effects; None where none passed, or the effects close more without it."""
        key = tuple(sorted(names))
        found = next((answer for answer in self.random if answer.effects == key), None)
        steady = self.hypothesis(key)
        if found is None or steady is None:
            return found
        share = max(steady.fit.excess, 0.0) / max(self.nominal.excess, 1e-9)
        return found if found.share < share else None


def located(study: Study) -> Place:
    """Where the gap of a study is, found now where it was not found before."""
    if study.place is not None:
        return study.place
    stated = study.noise.stated_variance if study.coarse else None
    level = float(np.mean([run.noise.variance * run.block for run in study.nominal.problem.data.runs]))
    return locate(
        study.campaign,
        study.nominal,
        hum_removed=study.hum is not None,
        noise_ratio=level / stated if stated else 1.0,
    )


Progress = Callable[[str], None]

_IN_HARMONICS = np.eye(len(CHANNELS))[CHANNELS.index("harmonics")]


def investigate(
    campaign: Campaign,
    kinds: Sequence[type[Effect]] = ALL_EFFECTS,
    progress: Progress | None = None,
    model: NominalModel | None = None,
    settings: Settings = Settings(),
) -> Study:
    """Test a campaign for a gap, and weigh the effects that may cause it, in the units of the similar campaign.

    Args:
        progress: called with the name of each step.
        model: the nominal model of the campaign; None: that of its kind.
        settings: of the diagnosis.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """
    clock = _Clock(progress)
    found = _test(campaign, model or nominal_model(campaign), kinds, clock, settings)
    if found.test.detected:
        with clock.step("where"):
            found = replace(found, place=located(found))
        found = _weigh_effects(found, kinds, clock)
        with clock.step("choices"):
            found = replace(found, choices=_choices(found))
    return replace(found, seconds=clock.seconds)


def nominal_study(
    campaign: Campaign, kinds: Sequence[type[Effect]], settings: Settings = Settings()
) -> Study:
    """Test a campaign for a gap, and fit no effect: the study up to the fit of the nominal model.

    Args:
        kinds: the effects that may be read off the records.
        settings: of the diagnosis.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """
    return _test(campaign, nominal_model(campaign), kinds, _Clock(None), settings)


def fit_nominal(data: Data) -> Fit:
    """Fit the nominal model; where it misses the motion, from the runs' own decays as well.

    Raises:
        TunnelError: when the nominal model cannot be fitted.
    """
    try:
        starts = nominal_starts(data)
        found = fit(Problem(data), next(starts))
        nearer = next(starts, None) if misses_motion(found) else None
        if nearer is not None:
            found = min(found, fit(Problem(data), nearer), key=lambda one: one.total)
    except (FitError, np.linalg.LinAlgError) as error:
        raise TunnelError(
            "the nominal model cannot be fitted",
            remedy="check spring stiffness, wind speed and that the runs are free decays of three cycles or more",
        ) from error
    refuse_indefinite(found)
    return found


def _test(
    measured: Campaign,
    model: NominalModel,
    kinds: Sequence[type[Effect]],
    clock: _Clock,
    settings: Settings,
) -> Study:
    """The study up to the test of the gap: noise, hum and nominal fit."""
    campaign, similarity = similar_campaign(measured, model)
    model = model.similar(similarity)
    allowed = {kind.name for kind in kinds}
    with clock.step("noise"):
        noise = campaign_noise(campaign, settings.noise)
        trend, step = noise_trend(campaign), reading_step(campaign)
        stated = campaign.sensor.resolution
        least = settings.read_off.coarse_step
        coarse = COARSE_STEP.name in allowed and stated is not None and step > least * stated
    with clock.step("nominal fit"):
        nominal = fit_nominal(prepare(campaign, noise.variance, similarity, model=model, settings=settings))
        cleaned, hum, line = campaign, None, None
        if HUM.name in allowed:
            # block means short enough to show every line of the mains that the samples show
            interval = mains_interval(similarity)
            problem = Problem(prepare(campaign, noise.variance, similarity, interval, model, settings))
            residuals = scaled_residuals(problem, nominal.point)
            line = find_hum(replace(nominal, problem=problem, residuals=residuals))
        if line is not None:
            motion = fastest(nominal)
            frequency = refine_frequency(campaign, line, motion)
            for _ in range(2):  # as a hum may count as noise at first
                variance = float(np.mean(list(noise.variance.values())))
                cleaned, hum = remove_hum(campaign, frequency, variance, settings.read_off, motion)
                noise = campaign_noise(cleaned, settings.noise)
            nominal = fit_nominal(
                prepare(cleaned, noise.variance, similarity, model=model, settings=settings)
            )
        # a second mode is missed from the start on, and its decay is counted from there; a driven run has none
        missed = misses_motion(nominal) and not campaign.driven
        cut = missed and second_mode_alone(nominal, kinds) is None
        if cut:
            nominal = fit_nominal(without_rest(without_start(nominal.problem.data)))
        nominal, noise, test = gap_or_colour(nominal, noise, trend, step=step, coarse_step=coarse)
    return Study(campaign, similarity, cleaned, noise, trend, step, coarse, hum, nominal, test, cut)


def _weigh_effects(found: Study, kinds: Sequence[type[Effect]], clock: _Clock) -> Study:
    """The study with sets of effects and random moments fitted and weighed."""
    fitted = [kind for kind in kinds if kind.fitted]
    first = second_mode_alone(found.nominal, fitted) if misses_motion(found.nominal) else None
    # an input holds the phase of the motion, so that no stretches are needed
    if fitted and first is None and misses_motion(found.nominal) and not found.campaign.driven:
        data = found.nominal.problem.data
        with clock.step("effects"):
            grown = grow_in_stretches(data, fit_nominal, fitted, clock.progress)
        found = _compared(replace(found, hypotheses=grown.hypotheses), grown.nominal, clock)
        with clock.step("polishing"):
            return _with_whole_runs(found, grown.nominal, lambda h: grown.whole(h, data))
    moving, rested = without_long_rest(found.nominal.problem.data)
    if rested:  # where dry friction stops a body, χ² has many minima
        nominal = try_fit(Problem(moving), found.nominal.point)
        if nominal is not None:  # what is left may be too short: whole runs then
            found = replace(found, nominal=nominal, rested=rested)
    with clock.step("effects"):
        found = replace(found, hypotheses=tuple(grow(found.nominal, fitted, clock.progress, first)))
    with clock.step("random moments"):
        random = weigh_random_moments(found.nominal, found.hypotheses, kinds)
        sets = without_the_random_moment(random, found.hypotheses, misfit(found.nominal))
    found = replace(found, random=tuple(random), hypotheses=tuple(sets))
    found = _compared(found, found.nominal, clock)
    found, weighed = _resolved(found, found.nominal)
    best = None if found.model.restored else _best(found, weighed)
    if best is not None and best.fit.chance < found.settings.search.moment_chance:
        again = _weigh_by_moment(found, weighed, fitted, clock)
        if again is not None:
            return again
    if weighed[0].effects != UNKNOWN:
        with clock.step("polishing"):
            found = replace(found, hypotheses=_polished(found.hypotheses, weighed[0], random))
    if _noise_explains(found, weighed):
        answer = Weighed((), 1.0, 1.0) if found.read_off else Weighed(UNKNOWN, 1.0, 1.0)
        others = [replace(w, probability=0.0) for w in weighed if w.effects not in ((), UNKNOWN)]
        weighed = [answer, *others]
    return replace(found, weighed=tuple(weighed))


def _weigh_by_moment(
    found: Study, weighed: Sequence[Weighed], kinds: Sequence[type[Effect]], clock: _Clock
) -> Study | None:
    """The study of a body that nothing holds, whose sets are weighed by the moment that they leave.

    Every small error of the moment moves the body for good, so that its angle departs further and further. So
    the random moment that a set leaves counts as noise: that of the likeliest set whose moment is small beside the
    one that the nominal model misses.

    Args:
        weighed: answers by the angle.

    Returns:
        None where no set explains the angle, and none leaves a small moment.
    """
    data, chosen = found.nominal.problem.data, found.settings.search
    # the nominal model in the noise that the likeliest set leaves, and that other probable ones leave
    bases: list[Fit] = []
    for answer in weighed:
        left = found.hypothesis(answer.effects)
        if left is None or (bases and answer.probability < chosen.moment_noise_from):
            continue
        with suppress(FitError, np.linalg.LinAlgError):
            bases.append(fit(Problem(by_moment(left.fit)), found.nominal.point))
    small = [base for base in bases if chosen.moment_left * (1.0 + base.excess) >= 1.0]
    if not bases or (not small and weighed[0].effects == UNKNOWN):
        return None
    base = (small or bases)[0]

    def whole(hypothesis: Hypothesis) -> Hypothesis | None:
        fitted = try_fit(replace(hypothesis.fit.problem, data=data), hypothesis.fit.point)
        return None if fitted is None else replace(hypothesis, fit=fitted)

    with clock.step("effects"):
        found = replace(found, hypotheses=tuple(grow(base, kinds, clock.progress)))
    found = _compared(found, base, clock)
    found = replace(found, by_moment=found.hypotheses)
    with clock.step("polishing"):
        return _with_whole_runs(found, base, whole)


def _with_whole_runs(
    found: Study, nominal: Fit, whole_runs: Callable[[Hypothesis], Hypothesis | None]
) -> Study:
    """The study with the answer and its parts fitted to the whole runs; a set that cannot be is no answer."""
    while True:
        weighed = _weighed(found, nominal)
        answer = set(weighed[0].effects)
        polished = _polished(found.hypotheses, weighed[0], ())
        whole = [whole_runs(h) if answer.issuperset(h.names) else h for h in polished]
        kept = replace(found, hypotheses=tuple(h for h in whole if h is not None), weighed=tuple(weighed))
        fitted = kept.hypothesis(weighed[0].effects)
        lost = () if fitted is None else unresolved(fitted.fit)
        if weighed[0].effects == UNKNOWN or (fitted is not None and not lost):
            return kept
        found = _without(found, weighed[0].effects, lost)


def _resolved(found: Study, base: Fit) -> tuple[Study, list[Weighed]]:
    """The study without the answers of which a half of the records must show an effect and none does."""
    while True:
        weighed = _weighed(found, base)
        names = weighed[0].effects
        fitted = found.hypothesis(names) if found.random_answer(names) is None else None
        lost = () if fitted is None else unresolved(fitted.fit)
        if not lost:
            return found, weighed
        found = _without(found, names, lost)


def _without(found: Study, names: tuple[str, ...], lost: tuple[str, ...]) -> Study:
    """The study without a set of effects, some of which no half of the records shows."""
    kept = tuple(h for h in found.hypotheses if h.names != names)
    return replace(found, hypotheses=kept, unresolved={**found.unresolved, **({names: lost} if lost else {})})


def _choices(found: Study) -> dict[tuple[str, ...], tuple[Choice, ...]]:
    """By names of the probable answers, the choices that whole runs cannot exclude."""
    nominal, chosen, least = misfit(found.nominal), {}, found.settings.search.choices_from
    for answer in found.weighed:
        hypothesis = found.stated(answer.effects) if answer.probability >= least else None
        if hypothesis is not None and hypothesis.fit.problem.data is found.nominal.problem.data:
            chosen[answer.effects] = choices(hypothesis, nominal)
    return {names: several for names, several in chosen.items() if several}


def _compared(found: Study, base: Fit, clock: _Clock) -> Study:
    """The study with the sets that the answer has to be compared with."""
    found = _pruned(found, base, clock)
    least = found.settings.search.two_springs_from
    likely = [w.effects for w in _weighed(found, base) if w.probability > least]
    answers = [hypothesis for names in likely if (hypothesis := found.hypothesis(names)) is not None]
    with clock.step("pruning"):
        return replace(found, outside=tuple(two_springs(answers, found.hypotheses, base)))


def _pruned(found: Study, base: Fit, clock: _Clock) -> Study:
    """The study with every set that has one effect less than the answer, or another one that does the same."""
    best = _best(found, _weighed(found, base))
    if best is None or len(best.effects) == 1:
        return found
    with clock.step("pruning"):
        known = (*found.hypotheses, *prune(best, found.hypotheses))
        found = replace(found, hypotheses=(*known, *exchange(best, known, base)))
    with clock.step("forms"):  # of rival sets, free where that pays: growth frees those of few sets
        weighed = [w for w in _weighed(found, base) if w.effects != UNKNOWN]
        near = [w.effects for w in weighed if w.probability > found.settings.search.rival_forms]
        if len(near) < 2:
            return found
        rivals = [h for h in found.hypotheses if h.names in near and not h.forms]
        others = [h for h in found.hypotheses if not any(h is rival for rival in rivals)]
        return replace(found, hypotheses=(*others, *with_forms(rivals, misfit(base), 0.0, len(rivals))))


def _best(found: Study, weighed: Sequence[Weighed]) -> Hypothesis | None:
    """The most probable answer that is a fitted set."""
    named = (found.hypothesis(w.effects) for w in weighed)
    return next((hypothesis for hypothesis in named if hypothesis is not None), None)


def _weighed(found: Study, base: Fit) -> list[Weighed]:
    """The answers with their probabilities, the answer first; shares of the gap that ``base`` leaves."""
    nominal, weighing = misfit(base), found.settings.weighing
    # χ² by channel that causes read off the records leave under any set of effects: the error of a coarse step is
    # not white, and follows a slow motion, and a hum that is not a pure line leaves a small share of itself
    own = np.zeros(len(CHANNELS))
    if found.hum is not None:
        own += weighing.hum_left * found.hum.excess * base.count * _IN_HARMONICS
    if found.coarse:
        levels, stated = reading_levels(found.campaign), found.campaign.sensor.noise_std
        white = found.noise.white(typical_step(levels))
        # a coarse step hides the noise, so that what is stated of it is the better guess
        white = dict.fromkeys(white, stated) if stated else white
        rounding = Rounding.of(base, white, found.step, levels)
        tries = [misfit(base, residuals).excess for residuals in rounding.residuals(base.problem.data)]
        own += np.maximum(np.mean(tries, axis=0), 0.0) if tries else 0.0
    sets = [h.fitted_set(base) for h in found.hypotheses]
    sets += [h.fitted_set(base, outside=True) for h in found.outside]
    sets += [answer.left for answer in found.random]
    if found.read_off:  # it may be the only cause, and is part of the gap
        sets.append(FittedSet((), 1.0, nominal.excess))
    if found.hum is not None:
        removed = found.hum.excess * base.count * _IN_HARMONICS
        nominal = replace(nominal, chi2=nominal.chi2 + removed)
    return weigh([replace(one, excess=one.excess - own) for one in sets], nominal, weighing)


def _polished(
    hypotheses: Sequence[Hypothesis], answer: Weighed, random: Sequence[RandomAnswer]
) -> tuple[Hypothesis, ...]:
    """The hypotheses, the answer's own fitted to convergence unless a random moment is the answer."""
    if any(moment.effects == answer.effects for moment in random):
        return tuple(hypotheses)
    return tuple(polish(h) if h.names == answer.effects else h for h in hypotheses)


class _Clock:
    """Wall time by step, and the progress call."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self.progress = progress

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step."""
        if self.progress is not None:
            self.progress(name)
        begun = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begun


def _noise_explains(found: Study, weighed: Sequence[Weighed]) -> bool:
    """Whether the gap is so small that the noise, which misbehaves, is all of it, or that its shares are chance.

    Effects of a few numbers close little of any noise, however it misbehaves.
    """
    block, weighing = found.nominal.problem.data.mean_block, found.settings.weighing
    small = found.test.noisy and found.nominal.excess < weighing.noise_explains * block
    closed = any(w.effects != UNKNOWN and w.share < 1.0 - weighing.noise_excused for w in weighed)
    return found.nominal.chance > weighing.shares_chance or (small and not closed)
