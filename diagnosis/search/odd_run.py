"""A run that differs from all others as a whole.

A cause acts in all runs. Where a few causes, or none, explain every run but one, and the other runs include its
wind state and its spring, the simplest explanation is that something happened to that run: its start was held, its
logger filtered, its gain was another.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isclose
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from diagnosis.facts.disturbance import Disturbance
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.partial import refit_releases
from diagnosis.likelihood.residuals import gap_left, resonance
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.likelihood.without_run import WithoutRuns, refitted_without
from diagnosis.model.parameters import Point
from diagnosis.model.run_data import Data
from diagnosis.search.grow import sets_with_one_more
from diagnosis.search.hypothesis import Hypothesis, Scale
from diagnosis.search.process_noise import likeliest, random_moments
from diagnosis.search.random_spectra import SOURCES
from diagnosis.search.scatter import scattered
from diagnosis.search.steady_noise import is_steady_noise
from diagnosis.search.weigh import UNKNOWN, FittedSet, error_of_form, log_weight
from tunnel_sim.effects import Effect
from tunnel_sim.effects.base import SPRING_TOLERANCE
from tunnel_sim.vocabulary.campaign import Campaign

if TYPE_CHECKING:
    from diagnosis.search.study import Study

_SETS, _RUNS = 6, 2  # sets, and runs of each, that are refitted


@dataclass(frozen=True, eq=False)
class OddRun:
    """A run, and a set that may explain the others.

    Args:
        index: of the run.
        beside: the set, fitted to the other runs.
        p_value: probability by chance of so large a misfit of the run, times the number of runs.
    """

    index: int
    beside: Hypothesis
    p_value: float


def odd_alone(measured: Campaign, nominal: Fit, kinds: Sequence[type[Effect]]) -> Disturbance | None:
    """The run without which the nominal model explains the others; None where a cause explains all runs as simply.

    Two effects never do: they cost more than an odd run.

    Args:
        measured: the campaign in its own units.
        nominal: fit of the nominal model to all runs of the similar campaign, which shows a gap.
        kinds: the effects that may be named.
    """
    none = Hypothesis((), nominal)
    found = _explaining([none], nominal, kinds)
    if not found or _acts_at_random(nominal):
        return None
    differing = scattered(nominal, kinds)
    single = sets_with_one_more([none], [kind for kind in kinds if kind.fitted])
    rivals = [*single, *([] if differing is None else [Hypothesis((), differing)])]
    return _stated(_simplest(found, rivals, nominal), measured, nominal)


def odd_run(measured: Campaign, study: Study) -> Disturbance | None:
    """The run that differs from the others as a whole; None where the answer explains the runs more simply.

    Args:
        measured: the campaign in its own units.
        study: of all its runs.

    Returns:
        The likeliest, at one rate of false alarms. None for driven runs, and for a run that alone has its wind
        state or its spring: its difference may be that of its conditions.
    """
    nominal, answer = study.nominal, study.answer
    if not study.gap.test.detected:
        return None
    found = _explaining([Hypothesis((), nominal), *_sets(study)], nominal, study.prepared.kinds)
    rivals, at_random = list[Hypothesis](), None
    if answer is not None and answer.effects != UNKNOWN:
        at_random = None if answer.random is None else answer.random.left
        rivals = [answer.hypothesis] if answer.hypothesis is not None and at_random is None else []
    return _stated(_simplest(found, rivals, nominal, at_random), measured, nominal)


def _stated(odd: OddRun | None, measured: Campaign, nominal: Fit) -> Disturbance | None:
    """An odd run as a fact, with the start of the part that moves as the others do."""
    if odd is None:
        return None
    run, start = nominal.problem.data.runs[odd.index], _free_from(odd, nominal)
    if start is not None:
        stamps = next(one.record.time_s for one in measured.runs if one.id == run.id)
        start = float(stamps[0]) + nominal.problem.data.similarity.own(run.start + start, "s")
    return Disturbance(run.id, None, None, odd.p_value, kept_from_s=start)


def _free_from(odd: OddRun, nominal: Fit) -> float | None:
    """The time since the start of a run's fitted part from which the model of the others explains it, s.

    None where there is none within the first quarter of the run, or too few cycles are left.
    """
    chosen, run = nominal.settings.selection, nominal.problem.data.runs[odd.index]
    cycle = 1.0 / (resonance(nominal, odd.index) * run.interval)  # in blocks
    others = odd.beside.fit
    for quarters in range(1, round(run.reading.size / cycle) + 1):
        first = round(quarters * cycle / 4.0)
        if run.reading.size - first < chosen.disturbed_kept * cycle:
            return None
        data = others.problem.data.with_runs((run.part(first),))
        start = Point(others.point.common, np.zeros((1, others.point.release.shape[1])))
        start.release[0, 0] = data.runs[0].reading[0]
        problem = replace(others.problem, data=data)
        slopes = [slope for _, slope in sensitivities(problem, start)]
        _, (left,) = refit_releases(problem, start, slopes)
        level = max(others.total / others.count, 1.0)
        if (
            float(fdtrc(left.size, others.count, float(left @ left) / left.size / level))
            > chosen.disturbed_rate
        ):
            return first * run.interval
    return None


def _sets(study: Study) -> list[Hypothesis]:
    """The sets of effects that were weighed, in runs that repeat: an odd run makes them seem to differ."""
    found = []
    for answer in study.answers:
        beside = None if answer.random is None else answer.random.beside
        for one in (answer.hypothesis, beside):
            fit = None if one is None else one.repeating if one.fit.problem.scatter else one.fit
            if one is not None and fit is not None and one.effects:
                found.append(Hypothesis(one.effects, fit))
    return found


def _explaining(sets: Sequence[Hypothesis], nominal: Fit, kinds: Sequence[type[Effect]]) -> list[OddRun]:
    """The runs without which a set explains the others up to chance and an error of its form.

    Args:
        sets: the nominal model first, in runs that repeat.
        kinds: the effects that may be named, those between runs among them.
    """
    data, chosen, weighing = nominal.problem.data, nominal.settings.selection, nominal.settings.weighing
    if data.driven or len(data.runs) < chosen.disturbed_fewest:
        return []
    tried = list(_without_a_run(sets, replaceable(data)))
    gaps = {one.index: gap_left(one.beside.fit) for one in tried if not one.beside.effects}
    tried = [one for one in tried if one.p_value < chosen.disturbed_rate and one.index in gaps]
    found = [
        one
        for one in tried
        if one.beside.leaves_within(error_of_form(gaps[one.index], weighing) * bool(one.beside.effects))
    ]
    return found or list(_beside_scatter([one for one in tried if not one.beside.effects], nominal, kinds))


def _beside_scatter(tried: Sequence[OddRun], nominal: Fit, kinds: Sequence[type[Effect]]) -> Iterator[OddRun]:
    """The runs without which chance differences explain the others, but which these do not explain themselves."""
    differing = None if nominal.problem.scatter or not tried else scattered(nominal, kinds)
    if differing is None:
        return
    for one in sorted(tried, key=lambda one: one.beside.fit.total)[:_RUNS]:
        fitted = scattered(one.beside.fit, kinds)
        others = None if fitted is None else Hypothesis((), fitted)
        if others is not None and others.explains_runs and not _is_explained(differing, one.index):
            yield replace(one, beside=others)


def _is_explained(fitted: Fit, index: int) -> bool:
    """Whether a fit explains one of its runs up to chance."""
    residual, chosen = fitted.residuals[index], fitted.settings.weighing
    margin = chosen.needless_chi2 + chosen.chance_stds * np.sqrt(2.0 * residual.size)
    return float(residual @ residual) - residual.size < margin


def _simplest(
    found: Sequence[OddRun], rivals: Sequence[Hypothesis], nominal: Fit, at_random: FittedSet | None = None
) -> OddRun | None:
    """The likeliest odd run; None where there is none, or a rival set of causes of all runs weighs as much.

    Args:
        at_random: a rival set with a random moment.
    """
    if not found:
        return None
    share, count = nominal.settings.selection.odd_share, len(nominal.problem.data.runs)
    sets = [*rivals, *(one.beside for one in found)]
    scale = Scale.of(sets, gap_left(nominal), nominal.settings.weighing)
    best = max(found, key=lambda one: _weight(one.beside, scale))
    # one of the runs is odd in a share of the campaigns
    weight = _weight(best.beside, scale) - np.log(count * (1.0 - share) / share)
    # the forms of an answer are free where that pays, and are not compared with an odd run
    weights = [_weight(one, scale) + scale.chosen.form_price * one.further_numbers for one in rivals]
    weights += [] if at_random is None else [scale.weight_of(at_random)]
    if weight <= max(weights, default=-np.inf):
        return None
    # a deviation of its stiffness, damping or wind speed may be chance
    by_chance = any(one.fit.problem.scatter and _is_explained(one.fit, best.index) for one in rivals)
    return None if by_chance else best


def _weight(one: Hypothesis, scale: Scale) -> float:
    """Logarithm of the weight of a set; chance differences between its runs count by their own evidence."""
    if not one.fit.problem.scatter:
        return scale.weight(one)
    cost = gap_left(one.fit).scatter_cost
    excess = one.excess - scale.least
    return log_weight(excess, scale.misfit, len(one.effects), one.further_numbers, scale.chosen, (cost, cost))


def replaceable(data: Data) -> list[int]:
    """Indices of the runs of which others have the wind state, and others the spring."""
    found = []
    for index, run in enumerate(data.runs):
        others = [other for other in data.runs if other is not run]
        wind = any(other.wind_on == run.wind_on for other in others)
        if wind and any(_same_spring(run.spring_stiffness, other.spring_stiffness) for other in others):
            found.append(index)
    return found


def _same_spring(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return isclose(one, other, rel_tol=SPRING_TOLERANCE)


def _acts_at_random(nominal: Fit) -> bool:
    """Whether a random moment that is alike in all runs in which it acts explains the residual."""
    chosen = nominal.settings.moment
    tried = (likeliest(random_moments(nominal, source), chosen) for source in SOURCES)
    return any(one is not None and is_steady_noise(one, chosen) for one in tried)


def _without_a_run(sets: Sequence[Hypothesis], runs: Sequence[int]) -> Iterator[OddRun]:
    """The sets without the runs that they explain least, the sets of least misfit first.

    The nominal model, the first of them, is fitted without each of the runs.
    """
    if not runs:
        return
    tried = []
    for one in sets:
        without = WithoutRuns.of(one.fit)
        left = (without.total - without.count)[list(runs)]
        tried.append((float(left.min()), one, [runs[place] for place in np.argsort(left)[:_RUNS]]))
    likely = sorted(tried[1:], key=lambda given: given[0])[:_SETS]
    for _, one, order in [(0.0, sets[0], list(runs)), *likely]:
        for index in order:
            fitted = refitted_without(one.fit, index)
            if fitted is not None:
                yield OddRun(index, Hypothesis(one.effects, fitted), _p_value(one.fit, fitted, index))


def _p_value(whole: Fit, others: Fit, index: int) -> float:
    """Probability by chance that a run adds so much to χ², with the misfit of the others as noise."""
    filled = whole.problem.data.runs[index].filled
    added = max(whole.total - others.total, 0.0) / filled
    level = max(others.total / others.count, 1.0)
    return min(1.0, len(whole.residuals) * float(fdtrc(filled, others.count, added / level)))
