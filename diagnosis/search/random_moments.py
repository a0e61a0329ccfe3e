"""Random moments: a layer of noise under every set of causes, and itself a cause.

Least squares takes residuals for white, so a strong random motion hides instants and weak effects. Here sets are
grown and fitted to rows whose noise includes the rig's response to the random moment. The random moment is
estimated from the residual of the best set, until both agree.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import fdtrc

from diagnosis.likelihood.ceiling import Unexplained
from diagnosis.likelihood.least_squares import Fit, FitError, fit, fit_at, try_fit
from diagnosis.likelihood.part_of_fit import restricted, sought_again
from diagnosis.likelihood.paths import COMMON
from diagnosis.likelihood.residuals import CHANNELS, ChannelMisfit, gap_left, misfit
from diagnosis.model.data import Data
from diagnosis.search.evident import evident, needed
from diagnosis.search.grow import grow
from diagnosis.search.hypothesis import Hypothesis, Scale, of_more_weight
from diagnosis.search.one_more import sets_with_one_more
from diagnosis.search.process_noise import (
    MomentLayer,
    ProcessNoise,
    acts_by,
    is_of_reading,
    likeliest,
    random_moments,
    with_response,
)
from diagnosis.search.random_spectra import SOURCES, MomentSource
from diagnosis.search.runs_in_view import RunsInView
from diagnosis.search.scatter import differing, with_likeliest_widths, without_deviations
from diagnosis.search.steady_noise import is_a_line, is_slow, is_steady_noise, most_absorbed
from diagnosis.search.weights import FittedSet, log_weight
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import AtRandom

ALIKE_WITHIN: Final = 20.0
"""Difference of −2 ln L below which two kinds of random moment explain the residuals equally well, in χ².
Judgement (decision 0046). The minimum drop for a random moment: real spectra are not first-order, and smaller
differences reflect the shape of the spectrum."""
FURTHER_EFFECTS: Final = 2
"""Maximum number of effects added to make the innovations white. Judgement. Time against coverage."""
LAW_SHARE: Final = 0.5
"""Minimum share of the residual, on held-out runs, that a law with the wind must explain to replace a random
moment. Convention. More than half."""
NO_NOISE_SHARE: Final = 0.9
"""Share of the residual explained by one law, on held-out runs, above which no random moment is sought.
Judgement. At most a tenth of the residual then differs from run to run."""
LAW_STDS: Final = 2.0
"""Margin over that share, in its scatter, in standard deviations. Convention."""
_ROUNDS = 3  # of estimating the random moment from the residuals, and the effects beside it


def weigh_random_moments(view: RunsInView, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Try turbulence, vortices with a wandering phase, and the surroundings, under all sets of effects.

    Args:
        view: view of the runs in which sets are fitted.
        hypotheses: sets found without a random moment.

    Returns:
        The most likely random moment with the best set of effects, and others that explain the runs nearly as well.
        Runs at one wind speed separate neither the stream from the surroundings, nor vortices, which follow the
        wind, from turbulence about a fixed frequency. The moment must lower −2 ln L beside the same set by more
        than chance, and be steady noise, alike in all runs in which it acts. Empty where none qualifies, where the
        most likely one may not be named, where no random moment could explain enough of the gap, and where one law
        explains nearly all of the residual.
    """
    scale = Scale.of(hypotheses, view.gap, view.base.settings.weighing)
    best = max([Hypothesis((), view.base), *hypotheses], key=scale.weight)
    if scale.greatest(best, repeating=False) <= scale.weight(best):
        return []
    named = [source for source in SOURCES if any(source.may_be(kind) for kind in view.prepared.kinds)]
    acting = [source for source in named if _may_act(source, best, scale, view.prepared.kinds)]
    found = list[_Beside]()
    for source in sorted(acting, key=lambda one: _explained(one, best)[0]) if len(acting) > 1 else acting:
        if all(one.cost_from(source) < one.cost + ALIKE_WITHIN for one in found):
            one = _Beside.found(source, best, view)
            found += [] if one is None else [one]
    least = min((one.cost for one in found), default=0.0)
    return [answer for one in found if one.cost < least + ALIKE_WITHIN for answer in one.answers()]


@dataclass(frozen=True, eq=False)
class _Beside:
    """A random moment of a source, and the best set of effects beside it.

    Args:
        alike: the most likely moment, and other kinds that explain the runs nearly as well.
        sets: the set with the response to the random moment in the noise, and its rivals with another effect in
            place of one.
        seen: the first of these sets with the sensor's noise alone.
    """

    alike: tuple[ProcessNoise, ...]
    sets: tuple[Hypothesis, ...]
    seen: Hypothesis
    view: RunsInView

    @classmethod
    def found(cls, source: MomentSource, best: Hypothesis, view: RunsInView) -> _Beside | None:
        """The steady noise of a source beside the effects found with it; None where there is none."""
        chosen = view.base.settings.moment
        top, exchanges = _settled(best, view, source)
        for number in range(FURTHER_EFFECTS + 1):
            if number > 0:  # a small effect that no gap shows may keep the innovations from being white
                further = evident(top, view.able)
                if not further:
                    break
                top, exchanges = further[0], exchanges | _exchanges(further)
            seen = _seen_in(top, view.base.problem.data)
            steady = [one for one in random_moments(seen.fit, source) if is_steady_noise(one, chosen)]
            shown = [one for one in steady if _shown_apart(one, source, seen.fit, view.prepared.kinds)]
            process = likeliest(shown, chosen)
            if process is not None and _is_random(process, source, seen.fit, view.prepared.kinds):
                sets = (top, *_exchanged(top, exchanges, view.able))
                return cls((process, *_others_alike(process, shown)), sets, seen, view)
        return None

    def cost_from(self, source: MomentSource) -> float:
        """The cost of a random moment of another source beside the same effects; infinite where none acts."""
        known = self.seen.fit
        cost, process = _explained(source, self.seen)
        noisy = None if process is None else with_response(known, process.spectrum)
        fitted = None if noisy is None else try_fit(replace(known.problem, data=noisy), known.point)
        if fitted is None:
            return cost
        return _explained(source, replace(self.seen, fit=fit_at(known.problem, fitted.point)))[0]

    @property
    def cost(self) -> float:
        """−2 ln L without constants of all runs, and the prices of parts and effects, dimensionless."""
        return _cost(self.alike[0], self.sets[0])

    def answers(self) -> list[Hypothesis]:
        """The answers to be weighed, the likeliest first; without answers that contain an unnameable part."""
        tried = (self._answer(process, top) for process in self.alike for top in self.sets)
        return [answer for answer in tried if answer is not None]

    def _answer(self, process: ProcessNoise, top: Hypothesis) -> Hypothesis | None:
        view, first = self.view, self.sets[0]
        seen = self.seen if top is first else _seen_in(top, view.base.problem.data)
        allowed = [kind for kind in view.prepared.kinds if issubclass(kind, AtRandom)]
        of_parts = [[kind for kind in allowed if part.is_of(kind)] for part in process.spectrum]
        if not all(of_parts):
            return None
        kinds = tuple(dict.fromkeys(kinds[0] for kinds in of_parts))
        excess = abs(process.excess) + max(excess_elsewhere(self.seen.fit, process.runs), 0.0)
        names = tuple(dict.fromkeys((*(kind.name for kind in kinds), *seen.effects)))
        share, by_channel = excess / view.repeating.gap, excess / view.base.gap * view.gap.excess
        # rivals are compared in the noise of the random moment
        behind = np.maximum(misfit(top.fit).excess - misfit(first.fit).excess, 0.0)
        # with a random motion taken for sensor noise, the runs would appear to differ
        cost = top.fit.scatter_cost(view.gap.deviation_precision)
        numbers, between = seen.further_numbers, top.fit.shown_between_runs
        left = FittedSet(
            names, share, by_channel + behind, numbers, scatter_cost=cost, shown_between_runs=between
        )
        known = seen.fit if seen.effects else view.prepared.nominal
        repeating = try_fit(*without_deviations(known)) if known.problem.scatter else known
        moment = MomentLayer(kinds, process, left)
        return replace(seen, fit=known, repeating=repeating or known, moment=moment)


def _others_alike(process: ProcessNoise, shown: Sequence[ProcessNoise]) -> list[ProcessNoise]:
    """Moments about a fixed frequency beside one that follows the wind, and the reverse, if as likely."""
    kind, found = _kind(process), dict[frozenset[str], ProcessNoise]()
    about = [one for one in shown if any(part.states > 1 for part in one.spectrum)]
    if process not in about:
        return []
    for one in sorted(about, key=lambda one: -one.cost):
        if _kind(one) != kind and one.cost < process.cost + ALIKE_WITHIN:
            found[_kind(one)] = one
    return sorted(found.values(), key=lambda one: one.cost)


def _kind(process: ProcessNoise) -> frozenset[str]:
    """The kinds of spectrum of its parts."""
    return frozenset(part.band for part in process.spectrum)


def _explained(source: MomentSource, beside: Hypothesis) -> tuple[float, ProcessNoise | None]:
    """The most likely random moment of a source in a set's residual, and its cost; infinite where none acts."""
    process = likeliest(random_moments(beside.fit, source), beside.fit.settings.moment)
    return (np.inf, None) if process is None else (_cost(process, beside), process)


def _cost(process: ProcessNoise, beside: Hypothesis) -> float:
    """−2 ln L without constants of all runs, with the prices of a moment's parts and of the effects beside it."""
    chosen = beside.fit.settings.moment
    return process.cost + process.price(chosen.part_price) + chosen.effect_price * len(beside.effects)


def without_the_random_moment(
    answers: Sequence[Hypothesis], known: Sequence[Hypothesis], gap: ChannelMisfit
) -> list[Hypothesis]:
    """The sets beside random moments, fitted with the sensor's noise alone, in case the moment is not real.

    Returns:
        All sets; of two with the same effects the one of more weight.
    """
    found = {hypothesis.names: hypothesis for hypothesis in known}
    for answer in answers:
        fitted = try_fit(answer.fit.problem, answer.fit.point) if answer.effects else None
        if fitted is not None:
            alone = replace(answer, fit=fitted, moment=None)
            found[alone.names] = of_more_weight(found.get(alone.names), alone, gap)
    return list(found.values())


def _may_act(source: MomentSource, best: Hypothesis, scale: Scale, kinds: Sequence[type[Effect]]) -> bool:
    """Whether a random moment of a source may be the residual of the best set.

    It may if perfect agreement of the wind-on runs would raise the set's weight, or if the residual is steady
    noise: a strong random motion misleads the fit of the other runs too. A moment that acts in every run could
    explain any gap, so it must be steady noise.
    """
    runs = list(zip(best.fit.problem.data.runs, best.fit.residuals, strict=True))
    still = [run for run, _ in runs if not source.acts(run)]
    if len(still) == len(runs):
        return False
    if still:
        left = misfit(best.fit, [np.zeros_like(r) if source.acts(run) else r for run, r in runs]).excess
        count, between = len(best.effects) + 1, best.fit.shown_between_runs
        costs = best.fit.scatter_cost(scale.deviation_precision), scale.scatter_cost
        weight = log_weight(left, scale.misfit, count, best.further_numbers, scale.chosen, costs, between)
        if weight > scale.weight(best):
            return not is_no_noise(best.fit)
    return _shows(source, best.fit, kinds) and not is_no_noise(best.fit)


def is_shaken(fitted: Fit, kinds: Sequence[type[Effect]]) -> bool:
    """Whether a residual shows a random moment that may be named.

    Args:
        kinds: the effects that may be named.
    """
    named = [source for source in SOURCES if any(source.may_be(kind) for kind in kinds)]
    runs = fitted.problem.data.runs
    return any(_shows(one, fitted, kinds) for one in named if any(map(one.acts, runs)))


def _shows(source: MomentSource, fitted: Fit, kinds: Sequence[type[Effect]]) -> bool:
    """Whether a residual is the steady noise of a source, and no noise of the reading."""
    chosen = fitted.settings.moment
    process = likeliest(random_moments(fitted, source), chosen)
    if process is None or not _shown_apart(process, source, fitted, kinds):
        return False
    if source.in_every_run and (
        is_of_reading(fitted, process)
        or is_a_line(fitted, process)
        or is_slow(fitted, process, source, kinds)
    ):
        return False
    return is_steady_noise(process, chosen)


def _is_random(
    process: ProcessNoise, source: MomentSource, fitted: Fit, kinds: Sequence[type[Effect]]
) -> bool:
    """Whether a residual is no noise of the reading, no line, not slow, not inflated, and follows no phase or law.

    Args:
        process: the moment in the residual.
        fitted: a set at its best point beside the moment, with the sensor's noise alone.
        kinds: the effects that may be named.
    """
    if source.in_every_run and is_of_reading(fitted, process):
        return False
    if follows_the_motion(fitted, process.runs) or obeys_a_law(fitted, source):
        return False
    least = try_fit(fitted.problem, fitted.point)
    if least is None:
        return True
    # the point beside a strong moment misses the runs by a spring and a damping, which are slow
    remaining = likeliest(random_moments(least, source), fitted.settings.moment)
    if remaining is None or is_a_line(least, remaining) or is_slow(least, remaining, source, kinds):
        return False
    return not is_inflated(process, fitted, least)


def is_inflated(process: ProcessNoise, fitted: Fit, least: Fit) -> bool:
    """Whether the residual of a set beside a random moment is far above the least residual of the set.

    Least squares follow a random motion in part, so their residual is smaller, but not by more than chance. A noise
    that is estimated from an error of the model permits a larger error, and is estimated from it again. Residuals
    below twice the noise power are too small to tell.

    Args:
        process: the moment in the residual.
        fitted: a set at its best point beside the moment, with the sensor's noise alone.
        least: the set fitted by least squares.
    """
    excess, floor = fitted.total - fitted.count, max(least.total - least.count, least.count)
    return excess > floor and excess > most_absorbed(process, least) * floor


def _shown_apart(
    process: ProcessNoise, source: MomentSource, fitted: Fit, kinds: Sequence[type[Effect]]
) -> bool:
    """Whether the runs without another source show the random moment too; true if every run has another source.

    They must show it beside a spring and a damping of their own: a run that differs is no random motion.

    Args:
        kinds: the effects that may be named.
    """
    others, chosen = [one for one in SOURCES if one is not source], fitted.settings.moment
    runs = fitted.problem.data.runs
    apart = [place for place, run in enumerate(runs) if not any(one.acts(run) for one in others)]
    ids = {runs[place].id for place in apart}
    drops = [drop for run, drop in zip(process.runs, process.drops.tolist(), strict=True) if run in ids]
    if not drops:
        return True
    if not acts_by(sum(drops), chosen):
        return False
    own = differing(fitted, apart, kinds)
    return own is None or likeliest(random_moments(own, source), chosen) is not None


def excess_elsewhere(fit: Fit, acts: Collection[str]) -> float:
    """Mean squared scaled residual minus one of the runs in which a random moment does not act; 0 without any.

    Args:
        acts: ids of the runs in which it acts.
    """
    off = [
        float(np.mean(residual**2)) - 1.0
        for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True)
        if run.id not in acts
    ]
    return float(np.mean(off)) if off else 0.0


def follows_the_motion(fitted: Fit, acts: Collection[str]) -> bool:
    """Whether residuals change the amplitude of the motion more, or less, than its phase.

    A random moment is independent of the phase of the motion: it adds the same power along the motion and along
    the rate. A missing damping adds to the first, and a missing stiffness to the second.

    Args:
        acts: ids of the runs in which the random moment acts.

    Returns:
        By Fisher's test of the ratio of the two powers. Every run in which it acts counts as one degree of freedom
        of each, since a slow random motion may have no more.
    """
    runs = list(zip(fitted.problem.data.runs, fitted.residuals, strict=True))
    count = sum(run.id in acts for run, _ in runs)
    seen = misfit(
        fitted, [residual if run.id in acts else np.zeros_like(residual) for run, residual in runs]
    ).chi2
    along = {name: float(seen[CHANNELS.index(name)]) for name in CHANNELS}
    motion = along["damping"] + along["damping of runs"]
    rate = along["frequency"] + along["frequency of runs"]
    larger = max(motion, rate) / max(min(motion, rate), 1e-300)
    return 2.0 * float(fdtrc(count, count, larger)) < fitted.settings.moment.phase_rate


def obeys_a_law(fitted: Fit, source: MomentSource) -> bool:
    """Whether one law, common to all runs, would explain most of a residual.

    A random moment differs from run to run, so no law fitted to some runs predicts the others. A missing law of
    angle, rate and wind speed does, and must not be taken for a slow random moment.

    Args:
        source: of the random moment; determines the laws that act in the same runs.

    Returns:
        Whether one of these laws (`diagnosis.likelihood.paths`) explains enough of held-out runs, beyond chance.
    """
    return _closed_by_a_law(fitted, source.laws, LAW_SHARE)


def is_no_noise(fitted: Fit) -> bool:
    """Whether one law of any kind, common to all runs, would explain nearly all of a residual.

    The rest is then too small for a random moment to be the missing cause, and none is sought.
    """
    return _closed_by_a_law(fitted, list(COMMON), NO_NOISE_SHARE)


def _closed_by_a_law(fitted: Fit, kinds: Sequence[str], share: float) -> bool:
    """Whether a law of some kind explains more than a share of a residual on held-out runs."""
    unexplained = Unexplained(fitted)
    found = (unexplained.common(kind).ceiling for kind in kinds)
    return any(one.closed - LAW_STDS * one.std > share for one in found)


def _exchanges(sets: Sequence[Hypothesis]) -> set[tuple[str, str]]:
    """Pairs of an effect of the first set and the effect that replaces it in a set nearly as good."""
    first, *others = sets
    near = (one for one in others if one.fit.total < first.fit.total + ALIKE_WITHIN)
    apart = ((set(first.effects) - set(one.effects), set(one.effects) - set(first.effects)) for one in near)
    return {(out.pop(), into.pop()) for out, into in apart if len(out) == len(into) == 1}


def _exchanged(
    top: Hypothesis, exchanges: Collection[tuple[str, str]], kinds: Sequence[type[Effect]]
) -> list[Hypothesis]:
    """The sets with one effect exchanged for another, in the noise of the given set.

    Args:
        exchanges: pairs of names: an effect and its replacement; pairs that do not apply are passed over.
    """
    found = []
    for out, into in sorted(exchanges):
        kind = next((one for one in kinds if one.name == into), None)
        if kind is None or out not in top.effects or into in top.effects:
            continue
        rest = tuple(name for name in top.effects if name != out)
        start = restricted(top.fit, rest)
        alone = try_fit(start.problem, start.point)
        found += [] if alone is None else sets_with_one_more([Hypothesis(rest, alone)], [kind])
    return found


def _settled(
    best: Hypothesis, view: RunsInView, source: MomentSource
) -> tuple[Hypothesis, set[tuple[str, str]]]:
    """The best set of effects on rows whose noise includes the response to the random moment, and exchanges in it.

    The given set where no random moment acts or its filter does not settle. The random moment is estimated from
    the residual of the best set with the sensor's noise alone: the fit with the response as noise lets the motion
    wander, and its residuals overstate the moment. The rounds end where the best set is the one that the moment
    was estimated beside. If they do not end, the likeliest of those reached is taken.
    """
    nominal, kinds, known, top = view.base, view.able, best.fit, best
    data, chosen = nominal.problem.data, nominal.settings.moment
    hidden = {kind.name for kind in kinds if source.condition in ("always", kind.condition)}
    reached: dict[tuple[str, ...], Hypothesis] = {}
    exchanges = set[tuple[str, str]]()

    with suppress(FitError, np.linalg.LinAlgError):
        for number in range(_ROUNDS):
            process = likeliest(random_moments(known, source), chosen)
            noisy = None if process is None else with_response(known, process.spectrum)
            if noisy is None:
                break
            base = with_likeliest_widths(fit(replace(nominal.problem, data=noisy), nominal.point))
            sets = [Hypothesis((), base), *_in_noise_of(base, best)]
            if number == 0:  # later rounds only drop effects, and add evident ones
                sets += grow(view.on(base))
            found = max(sets, key=Scale.of(sets, gap_left(base), base.settings.weighing).weight)
            # a random moment leaves little of a gap for comparing effects where it acts: more are added while one
            # seen there alone is evident, the most evident of all, so that none absorbs the residual of another;
            # without growth, one seen anywhere
            exchanges |= _exchanges([found, *sets])
            top = needed(replace(found, fit=sought_again(found.fit)))
            further = evident(top, kinds)
            while any(number > 0 or h.effects[-1] in hidden for h in further):
                top, exchanges = further[0], exchanges | _exchanges(further)
                further = evident(top, kinds)
            if top.names == best.names:
                return top, exchanges
            reached[top.names] = top
            best = _seen_in(top, data)
            known = fit(best.fit.problem, best.fit.point)
        if len(reached) > 1:  # alternates between sets
            top = min(reached.values(), key=lambda one: _explained(source, _seen_in(one, data))[0])
    return top, exchanges


def _in_noise_of(base: Fit, known: Hypothesis) -> list[Hypothesis]:
    """A set found without the random moment, in its noise: a nominal model that loses the phase grows none."""
    problem = replace(known.fit.problem, data=base.problem.data)
    fitted = try_fit(problem, known.fit.point) if known.effects else None
    return [] if fitted is None else [Hypothesis(known.effects, with_likeliest_widths(fitted))]


def _seen_in(hypothesis: Hypothesis, data: Data) -> Hypothesis:
    """The hypothesis, unchanged, with residuals in the noise of other data."""
    problem = replace(hypothesis.fit.problem, data=data)
    return replace(hypothesis, fit=fit_at(problem, hypothesis.fit.point), textbook=None)
