"""A run that differs from all others as a whole.

A cause acts in all runs. Suppose that few causes, or none, explain every run but one, and that the other runs
include its wind state and its spring. The simplest explanation is then a fault of that run: its start was held,
its logger filtered the signal, or its gain differed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import chdtrc, fdtrc

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.partial import refit_releases
from diagnosis.likelihood.residuals import CHANNELS, gap_left, resonance
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.likelihood.without_run import WithoutRuns, refitted_without
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.hypothesis import Hypothesis, Scale
from diagnosis.search.one_more import sets_with_one_more
from diagnosis.search.process_noise import acts_by, likeliest, random_moments, with_response
from diagnosis.search.random_spectra import SOURCES
from diagnosis.search.scatter import scattered
from diagnosis.search.steady_noise import is_steady_noise
from diagnosis.search.weights import FittedSet, error_of_form, log_weight
from tunnel_sim.effects import Effect
from tunnel_sim.effects.base import SPRING_TOLERANCE
from tunnel_sim.vocabulary.campaign import Campaign

if TYPE_CHECKING:
    from diagnosis.search.study import Study

DISTURBED_FEWEST: Final = 3
"""Minimum number of free decays in a campaign to be searched for a disturbed run. Judgement. With two runs, a
disturbance of one cannot be distinguished from a property of all."""
DISTURBED_SHARE: Final = 0.25
"""Maximum share of the runs that may be disturbed; at least one run. Judgement. The others show the common
behaviour."""
DISTURBED_KEPT: Final = 6.0
"""Minimum number of cycles before a disturbance for that part of the run to be used. Otherwise the run is left
out. Judgement. A record needs three cycles, and its damping needs twice as many."""
ODD_HOLDS: Final = 0.5
"""Minimum share of the gap in each of several odd runs, relative to the gap of the remaining runs. Convention.
Most of it."""

SUSPECT_HOLDS: Final = 0.75
"""Minimum share of the misfit of a set that vanishes without one run for the campaign to be studied without it,
where no set explains the runs. Judgement. A fit that an odd run has spoilt seldom finds back to chance. In three
campaigns with an odd run the share is 0.89 to 0.98; of the other unknown ones, 0.63 at most beside a real cause."""

_SETS, _RUNS = 6, 2  # number of sets, and of runs for each, that are refitted


@dataclass(frozen=True, eq=False)
class OddRuns:
    """One run or a few, and a set that may explain the others.

    Args:
        p_values: by run id, the probability by chance of as large a misfit, times the number of runs.
        beside: the set, fitted to the other runs.
    """

    p_values: Mapping[str, float]
    beside: Hypothesis


def odd_alone(measured: Campaign, nominal: Fit, kinds: Sequence[type[Effect]]) -> tuple[Disturbance, ...]:
    """The runs without which the nominal model explains the others; none where a cause explains all as simply.

    Two effects are never as simple: they cost more than an odd run.

    Args:
        measured: the campaign in its own units.
        nominal: fit of the nominal model to all runs of the similar campaign, which shows a gap.
        kinds: the effects that may be named.
    """
    none = Hypothesis((), nominal)
    found = _explaining(list(_without_a_run([none])), nominal, kinds)
    if not found or _acts_at_random(nominal, found[0].beside.fit):
        return ()
    differing = scattered(nominal, kinds)
    single = sets_with_one_more([none], [kind for kind in kinds if kind.fitted])
    rivals = [*single, *([] if differing is None else [Hypothesis((), differing)])]
    return _stated(_simplest(found, rivals, nominal), measured, nominal)


def odd_runs(measured: Campaign, study: Study) -> tuple[Disturbance, ...]:
    """The runs that differ from the others as a whole; none where the answer explains the runs more simply.

    Args:
        measured: the campaign in its own units.
        study: of all its runs.

    Returns:
        The most likely odd runs, at one false-alarm rate. They exclude driven runs, and a run that alone has
        its wind state or its spring, because its conditions may explain the difference.
    """
    nominal, answer = study.nominal, study.answer
    if not study.gap.test.detected:
        return ()
    sets = [Hypothesis((), nominal), *_sets(study)]
    refitted = list(_without_a_run(sets))
    found = _explaining(refitted, nominal, study.prepared.kinds)
    rivals, at_random = list[Hypothesis](), None
    if answer is not None and answer.effects != UNKNOWN:
        at_random = None if answer.moment is None else answer.moment.left
        rivals = [answer.hypothesis] if answer.hypothesis is not None and at_random is None else []
    rivals += [one for rival in study.rivals for one in rival.hypotheses]
    odd = _simplest(found, rivals, nominal, at_random)
    if odd is None and study.causes == UNKNOWN:
        odd = _suspect(sets, refitted)
    return _stated(odd, measured, nominal)


def _suspect(sets: Sequence[Hypothesis], refitted: Sequence[OddRuns]) -> OddRuns | None:
    """The run without which a set's misfit nearly vanishes, for the set that then leaves least; None: no run is.

    Args:
        sets: the nominal model first, then the weighed sets, none of which explains the runs.
        refitted: the sets without single runs.
    """
    rate = sets[0].fit.settings.selection.disturbed_rate
    whole = {one.effects: one.fit.total - one.fit.count for one in sets[1:]}
    clear = [
        odd
        for odd in refitted
        if max(odd.p_values.values()) < rate
        and odd.beside.fit.total - odd.beside.fit.count
        < (1.0 - SUSPECT_HOLDS) * whole.get(odd.beside.effects, -np.inf)
    ]
    return min(clear, key=lambda odd: odd.beside.fit.total - odd.beside.fit.count, default=None)


def _stated(odd: OddRuns | None, measured: Campaign, nominal: Fit) -> tuple[Disturbance, ...]:
    """Odd runs as facts, with the start of the part that moves like the other runs."""
    disturbances, data = list[Disturbance](), nominal.problem.data
    if odd is None:
        return ()
    for name, p_value in odd.p_values.items():
        index = [run.id for run in data.runs].index(name)
        start = _free_from(odd.beside.fit, nominal, index)
        if start is not None:
            run = next(one for one in measured.runs if one.id == name)
            begun = float(run.record.time_s[0]) + run.clock_s
            start = begun + data.similarity.own(data.runs[index].start + start, "s")
        disturbances.append(Disturbance(name, None, None, p_value, kept_from_s=start))
    return tuple(disturbances)


def _free_from(others: Fit, nominal: Fit, index: int) -> float | None:
    """The time since the start of a run's fitted part from which the other runs' model explains it, s.

    None if there is no such time within the first quarter of the run, or too few cycles remain.
    """
    chosen, run = nominal.settings.selection, nominal.problem.data.runs[index]
    cycle = 1.0 / (resonance(nominal, index) * run.interval)  # length in blocks
    for quarters in range(1, int(run.reading.size / cycle) + 1):
        first = round(quarters * cycle / 4.0)
        if run.reading.size - first < DISTURBED_KEPT * cycle:
            return None
        data = others.problem.data.with_runs((run.part(first),))
        start = Point(others.point.common, np.zeros((1, others.point.per_run.shape[1])))
        start.per_run[0, 0] = data.runs[0].reading[0]
        problem = replace(others.problem, data=data)
        slopes = [slope for _, slope in sensitivities(problem, start)]
        _, (residual,) = refit_releases(problem, start, slopes)
        level = max(others.total / others.count, 1.0)
        if (
            float(fdtrc(residual.size, others.count, float(residual @ residual) / residual.size / level))
            > chosen.disturbed_rate
        ):
            return first * run.interval
    return None


def _sets(study: Study) -> list[Hypothesis]:
    """The weighed sets of effects, for runs that repeat: an odd run would otherwise look like scatter."""
    hypotheses = []
    for answer in study.answers:
        whole = answer.hypothesis
        fit = None if whole is None else whole.repeating if whole.fit.problem.scatter else whole.fit
        if whole is not None and fit is not None and whole.effects:
            hypotheses.append(Hypothesis(whole.effects, fit))
    return hypotheses


def _explaining(refitted: Sequence[OddRuns], nominal: Fit, kinds: Sequence[type[Effect]]) -> list[OddRuns]:
    """The runs without which a set explains the others up to chance and an error of its form.

    Args:
        refitted: the nominal model and other sets without single runs, in runs that repeat.
        kinds: the effects that may be named, also effects between runs.
    """
    chosen, weighing = nominal.settings.selection, nominal.settings.weighing
    gaps = {tuple(odd.p_values): gap_left(odd.beside.fit) for odd in refitted if not odd.beside.effects}
    tried = [odd for odd in refitted if max(odd.p_values.values()) < chosen.disturbed_rate]
    explaining = [
        odd
        for odd in tried
        if (gap := gaps.get(tuple(odd.p_values))) is not None
        and odd.beside.leaves_within(error_of_form(gap, weighing) * bool(odd.beside.effects))
    ]
    if explaining or nominal.problem.scatter or not replaceable(nominal.problem.data):
        return explaining
    for odd in _without_several([odd for odd in tried if not odd.beside.effects], nominal, kinds):
        if odd.beside.explains_runs or odd.beside.leaves_within(np.zeros(len(CHANNELS))):
            if not odd.beside.fit.problem.scatter:
                return [odd]
            differing = scattered(nominal, kinds)
            return [odd] if differing is not None and not _are_explained(differing, odd) else []
    return []


def _without_several(
    tried: Sequence[OddRuns], nominal: Fit, kinds: Sequence[type[Effect]]
) -> Iterator[OddRuns]:
    """The nominal model without one run, without two, and so on; with chance differences if the runs show any.

    Each of these runs shows most of the gap of the remaining runs. One odd run may hide another.

    Args:
        tried: the nominal model without each run.
    """
    whole = nominal
    known: dict[str, float] = {}
    for _ in range(max(1, int(DISTURBED_SHARE * len(nominal.problem.data.runs)))):
        differing = scattered(whole, kinds)
        best = _worst_of(whole, tried) if differing is None else _worst_beside(differing, whole)
        if best is None or len(best.beside.fit.residuals) < DISTURBED_FEWEST - 1:
            return
        whole, known = best.beside.fit, {**known, **best.p_values}
        beside = scattered(whole, kinds)
        yield OddRuns(known, best.beside if beside is None else Hypothesis((), beside))
        tried = [] if beside is not None else list(_without_a_run([best.beside]))


def _worst_of(whole: Fit, tried: Sequence[OddRuns]) -> OddRuns | None:
    """The run without which most of the gap vanishes; None if there is none."""
    chosen = whole.settings.selection
    best = min(tried, key=lambda one: one.beside.fit.total, default=None)
    left = np.inf if best is None else best.beside.fit.total - best.beside.fit.count
    if best is None or max(best.p_values.values()) >= chosen.disturbed_rate:
        return None
    return best if left < (1.0 - ODD_HOLDS) * (whole.total - whole.count) else None


def _worst_beside(differing: Fit, whole: Fit) -> OddRuns | None:
    """The run that shows most of the gap beside chance differences; None if there is none.

    Args:
        whole: the fit without chance differences.
    """
    chosen, data = whole.settings.selection, whole.problem.data
    own = np.array([float(r @ r) - r.size for r in differing.residuals])
    index = int(np.argmax(own))
    size = differing.residuals[index].size
    p_value = min(1.0, own.size * float(chdtrc(size, own[index] + size)))
    alone = own[index] > ODD_HOLDS * float(np.maximum(own, 0.0).sum())
    if index not in replaceable(data) or not alone or p_value >= chosen.disturbed_rate:
        return None
    fitted = refitted_without(whole, index)
    return None if fitted is None else OddRuns({data.runs[index].id: p_value}, Hypothesis((), fitted))


def _are_explained(fitted: Fit, odd: OddRuns) -> bool:
    """Whether a fit explains some of its runs up to chance."""
    chosen = fitted.settings.weighing
    for run, residual in zip(fitted.problem.data.runs, fitted.residuals, strict=True):
        margin = chosen.needless_chi2 + chosen.chance_stds * np.sqrt(2.0 * residual.size)
        if run.id in odd.p_values and float(residual @ residual) - residual.size > margin:
            return False
    return True


def _simplest(
    candidates: Sequence[OddRuns],
    rivals: Sequence[Hypothesis],
    nominal: Fit,
    at_random: FittedSet | None = None,
) -> OddRuns | None:
    """The most likely odd runs; None if there are none, or a rival set of causes in all runs weighs as much.

    Args:
        at_random: a rival set with a random moment.
    """
    if not candidates:
        return None
    share, count = nominal.settings.selection.odd_share, len(nominal.problem.data.runs)
    if any(
        odd.beside.fit.problem.scatter for odd in candidates
    ):  # a set that leaves a gap cannot be compared by its evidence
        rivals = [rival for rival in rivals if rival.leaves_within(np.zeros(len(CHANNELS)))]
        at_random = None
    sets = [*rivals, *(odd.beside for odd in candidates)]
    scale = Scale.of(sets, gap_left(nominal), nominal.settings.weighing)
    best = max(candidates, key=lambda odd: _weight(odd.beside, scale))
    # the odds of an odd run: the share of campaigns that have one
    weight = _weight(best.beside, scale) - len(best.p_values) * np.log(count * (1.0 - share) / share)
    # the price of a rival's free forms does not count in favour of an odd run
    weights = [_weight(rival, scale) + scale.chosen.form_price * rival.further_numbers for rival in rivals]
    weights += [] if at_random is None else [scale.weight_of(at_random)]
    if weight <= max(weights, default=-np.inf):
        return None
    # chance may explain a deviation in stiffness, damping or wind speed
    by_chance = any(rival.fit.problem.scatter and _are_explained(rival.fit, best) for rival in rivals)
    return None if by_chance else best


def _weight(hypothesis: Hypothesis, scale: Scale) -> float:
    """Logarithm of the weight of a set; chance differences between the runs count by their evidence."""
    if not hypothesis.fit.problem.scatter:
        return scale.weight(hypothesis)
    cost = gap_left(hypothesis.fit).scatter_cost
    excess = hypothesis.excess - scale.least
    count, further = len(hypothesis.effects), hypothesis.further_numbers
    return log_weight(excess, scale.misfit, count, further, scale.chosen, (cost, cost))


def replaceable(data: Data) -> list[int]:
    """Indices of the runs that share the wind state with other runs, and the spring with other runs.

    None of a campaign that is driven, or has few runs.
    """
    found = list[int]()
    if data.driven or len(data.runs) < DISTURBED_FEWEST:
        return found
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


def _acts_at_random(nominal: Fit, others: Fit) -> bool:
    """Whether a random moment alone explains the residual of all runs in which it acts, hidden by the others.

    Args:
        others: the fit to the runs that are not odd, which needs no random moment.
    """
    chosen = nominal.settings.moment
    for source in SOURCES:
        found = likeliest(random_moments(nominal, source), chosen)
        if found is not None and is_steady_noise(found, chosen):
            noisy = with_response(others, found.spectrum)
            if noisy is None or not acts_by(_expected(others.problem.data, noisy), chosen):
                return True
    return False


def _expected(data: Data, noisy: Data) -> float:
    """The expected drop of −2 ln L by a random moment in runs with noise equal to its response, dimensionless."""
    pairs = zip(data.runs, noisy.runs, strict=True)
    ratios = [(run.reading.size, more.noise.variance / run.noise.variance) for run, more in pairs]
    return float(sum(size * (ratio - 1.0 - np.log(ratio)) for size, ratio in ratios))


def _without_a_run(sets: Sequence[Hypothesis]) -> Iterator[OddRuns]:
    """The sets without the runs that they explain least: by least misfit, then fewest effects if equal by chance.

    Without such a run most of a set's misfit vanishes, by linear theory. The nominal model is the first of the
    sets; it is also fitted without each run that is left out for another set.
    """
    data = sets[0].fit.problem.data
    runs = replaceable(data)
    if not runs:
        return
    tried = []
    for hypothesis in sets:
        without = WithoutRuns.of(hypothesis.fit)
        excesses = (without.total - without.count)[runs]
        most = (1.0 - ODD_HOLDS) * (hypothesis.fit.total - hypothesis.fit.count)
        order = [runs[place] for place in np.argsort(excesses) if excesses[place] < most]
        tried.append((float(excesses.min()), hypothesis, order))
    (_, nominal, of_nominal), *others = tried
    by_chance = nominal.fit.settings.weighing.chance_stds * np.sqrt(2.0 * nominal.fit.count)
    others.sort(key=lambda given: (max(given[0], by_chance), len(given[1].effects)))
    likely = [(hypothesis, order[:_RUNS]) for _, hypothesis, order in others[:_SETS]]
    asked = [index for index in runs if index in of_nominal or any(index in order for _, order in likely)]
    for hypothesis, order in [(nominal, asked), *likely]:
        for index in order:
            fitted = refitted_without(hypothesis.fit, index)
            if fitted is not None:
                p_value = _p_value(hypothesis.fit, fitted, index)
                yield OddRuns({data.runs[index].id: p_value}, Hypothesis(hypothesis.effects, fitted))


def _p_value(whole: Fit, others: Fit, index: int) -> float:
    """Probability by chance that a run adds so much to χ², with the misfit of the other runs as noise."""
    filled = whole.problem.data.runs[index].filled
    added = max(whole.total - others.total, 0.0) / filled
    level = max(others.total / others.count, 1.0)
    return min(1.0, len(whole.residuals) * float(fdtrc(filled, others.count, added / level)))
