"""Random moments: a layer of noise under every set of causes, and itself a cause.

A strong random motion misleads least squares: the residuals of the wind-on runs are far from white, so that
instants and weak effects are missed in them. Here sets are grown and fitted to rows in whose noise the rig's
response to the random moment is part. The random moment is estimated from what the best of them leaves, until both
agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from diagnosis.likelihood.ceiling import Unexplained
from diagnosis.likelihood.least_squares import Fit, FitError, by_run, fit, fit_at, try_fit
from diagnosis.likelihood.paths import COMMON
from diagnosis.likelihood.residuals import CHANNELS, ChannelMisfit, gap_left, misfit
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model.parameters import Point
from diagnosis.model.run_data import Data
from diagnosis.search.grow import grow, sets_with_one_more
from diagnosis.search.hypothesis import Hypothesis, Scale, of_more_weight, restricted
from diagnosis.search.process_noise import (
    ProcessNoise,
    is_steady_noise,
    likeliest,
    random_moments,
    with_response,
)
from diagnosis.search.scatter import settled
from diagnosis.search.weigh import FittedSet, log_weight
from tunnel_sim.effects import Effect

if TYPE_CHECKING:
    from diagnosis.search.views.view import View

_ROUNDS = 3  # of estimating the random moment from the residuals, and the effects beside it


@dataclass(frozen=True, eq=False)
class RandomAnswer:
    """A random moment, alone or beside other effects.

    Args:
        kinds: the effects that the parts of its spectrum are.
        beside: the fitted effects beside it with residuals in the sensor's noise alone, or None.
        left: what remains. The share is that of the innovations' and the wind-off runs' excess in the nominal
            one's, and the same in every channel.
    """

    kinds: tuple[type[Effect], ...]
    process: ProcessNoise
    beside: Hypothesis | None
    left: FittedSet

    @property
    def share(self) -> float:
        """Of the gap left open, a fraction."""
        return self.left.share

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, sorted; once where an effect acts steadily and at random."""
        names = {kind.name for kind in self.kinds}
        return tuple(sorted(names | set(() if self.beside is None else self.beside.effects)))


def weigh_random_moments(view: View, hypotheses: Sequence[Hypothesis]) -> list[RandomAnswer]:
    """Try turbulence, and vortices with a wandering phase, under all sets of effects.

    Args:
        view: in which they are fitted.
        hypotheses: those found without a random moment.

    Returns:
        The random moment with the best set of effects beside it. It must lower −2 ln L beside the same set by more
        than a needless effect may, and be steady noise, alike in all runs in the wind. Empty where none passes,
        where the likeliest is of a kind that may not be named, where no random moment in the wind could leave
        little enough of the gap, and where one law closes nearly all that the sets leave.
    """
    nominal, able = view.base, view.able
    allowed = {kind.random: kind for kind in view.prepared.kinds if kind.random}
    chosen = nominal.settings.moment
    scale = Scale.of(hypotheses, view.gap, nominal.settings.weighing)
    best = max([Hypothesis((), nominal), *hypotheses], key=scale.weight)
    if not allowed or not _may_act(best, scale) or is_no_noise(best.fit):
        return []
    top = _settled(best, view)
    for number in range(chosen.further_effects + 1):
        if number > 0:  # a small effect that no gap shows may keep the innovations from being white
            further = _evident(top, able)
            if not further:
                break
            top = further[0]
        seen = _seen_in(top, nominal.problem.data)
        steady = [one for one in random_moments(seen.fit) if is_steady_noise(one, chosen)]
        process = likeliest(steady, chosen)
        if process is not None and not follows_the_motion(seen.fit) and not obeys_a_law(seen.fit):
            bands = dict.fromkeys(part.band for part in process.spectrum)
            if not bands.keys() <= allowed.keys():
                return []
            kinds = tuple(allowed[band] for band in bands)
            excess = abs(process.excess) + max(wind_off_excess(seen.fit), 0.0)
            names = tuple(dict.fromkeys((*(kind.name for kind in kinds), *seen.effects)))
            share, by_channel = excess / view.repeating.gap, excess / nominal.gap * view.gap.excess
            # of a random motion, taken for the sensor's noise, the runs would seem to differ
            cost, numbers, compared = (
                top.fit.scatter_cost(scale.known),
                seen.further_numbers,
                top.fit.compared,
            )
            left = FittedSet(names, share, by_channel, numbers, scatter_cost=cost, compared=compared)
            return [RandomAnswer(kinds, process, seen if seen.effects else None, left)]
    return []


def without_the_random_moment(
    answers: Sequence[RandomAnswer], known: Sequence[Hypothesis], gap: ChannelMisfit
) -> list[Hypothesis]:
    """The sets beside random moments fitted with the sensor's noise alone: what they leave may be no random moment.

    Returns:
        All sets; of two with the same effects that of more weight.
    """
    found = {hypothesis.names: hypothesis for hypothesis in known}
    for answer in answers:
        if answer.beside is not None:
            fitted = try_fit(answer.beside.fit.problem, answer.beside.fit.point)
            if fitted is not None:
                alone = replace(answer.beside, fit=fitted)
                found[alone.names] = of_more_weight(found.get(alone.names), alone, gap)
    return list(found.values())


def _evident(top: Hypothesis, kinds: Sequence[type[Effect]]) -> list[Hypothesis]:
    """The set with one more effect that is evident beside the random moment, the most evident first.

    The noise is estimated from the residuals themselves, and no real spectrum has its form. So the scatter between
    the runs says how much of a fall of χ² is chance.
    """
    if len(top.effects) >= top.fit.settings.search.most_causes:
        return []
    able = {kind.name: kind for kind in kinds if not kind.line}
    larger = sets_with_one_more([top], list(able.values()))
    gains = [(top.fit.total - h.fit.total) / overdispersion(h.fit, able[h.effects[-1]]) for h in larger]
    order = sorted(range(len(larger)), key=lambda i: -gains[i])
    return [larger[i] for i in order if gains[i] > top.fit.settings.moment.evident_from]


def _may_act(best: Hypothesis, scale: Scale) -> bool:
    """Whether a random moment may be what the best set leaves.

    With one that left nothing in the wind the set would weigh more, or what is left is steady noise: a strong
    random motion misleads the fit of the wind-off runs too.
    """
    runs = list(zip(best.fit.problem.data.runs, best.fit.residuals, strict=True))
    if not any(run.wind_on for run, _ in runs) or scale.greatest(best, repeating=False) <= scale.weight(best):
        return False
    still = misfit(best.fit, [np.zeros_like(r) if run.wind_on else r for run, r in runs]).excess
    count, chosen = len(best.effects) + 1, best.fit.settings.moment
    costs = best.fit.scatter_cost(scale.known), scale.scatter_cost
    numbers, compared = best.further_numbers, best.fit.compared
    if log_weight(still, scale.misfit, count, numbers, scale.chosen, costs, compared) > scale.weight(best):
        return True
    process = likeliest(random_moments(best.fit), chosen)
    return process is not None and is_steady_noise(process, chosen)


def wind_off_excess(fit: Fit) -> float:
    """Mean squared scaled residual minus one of the wind-off runs; 0 where there are none."""
    off = [
        float(np.mean(residual**2)) - 1.0
        for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True)
        if not run.wind_on
    ]
    return float(np.mean(off)) if off else 0.0


def follows_the_motion(fitted: Fit) -> bool:
    """Whether residuals in the wind change the amplitude of the motion otherwise than its phase.

    A random moment does not know the phase of the motion: what it adds along the motion and along the rate has the
    same power. A missing damping adds to the first, and a missing stiffness to the second.

    Returns:
        By Fisher's test of the ratio of the two powers. Every run in the wind counts as one degree of freedom of
        each, since a slow random motion may have no more.
    """
    runs = list(zip(fitted.problem.data.runs, fitted.residuals, strict=True))
    windy = sum(run.wind_on for run, _ in runs)
    seen = misfit(
        fitted, [residual if run.wind_on else np.zeros_like(residual) for run, residual in runs]
    ).chi2
    along = {name: float(seen[CHANNELS.index(name)]) for name in CHANNELS}
    motion = along["damping"] + along["damping of runs"]
    rate = along["frequency"] + along["frequency of runs"]
    larger = max(motion, rate) / max(min(motion, rate), 1e-300)
    return 2.0 * float(fdtrc(windy, windy, larger)) < fitted.settings.moment.phase_rate


def obeys_a_law(fitted: Fit) -> bool:
    """Whether most of what a fit leaves would be closed by one law of the wind, the same in all runs.

    A random moment is another one in every run, so that no law fitted to some runs predicts the others. A missing
    law of angle, rate and wind speed does, and a slow random moment would take its place.

    Returns:
        Whether the law of the wind (`diagnosis.likelihood.paths.wind`) closes enough on runs held out of its fit,
        beyond chance.
    """
    return _closed_by_a_law(fitted, ["wind"], fitted.settings.moment.law_share)


def is_no_noise(fitted: Fit) -> bool:
    """Whether nearly all that a fit leaves would be closed by one law of any kind, the same in all runs.

    What remains for a random moment is then too small to be what the sets lack, and none is sought.
    """
    return _closed_by_a_law(fitted, list(COMMON), fitted.settings.moment.no_noise_share)


def _closed_by_a_law(fitted: Fit, kinds: Sequence[str], share: float) -> bool:
    """Whether a law of some kind closes more than a share of what a fit leaves, on held-out runs."""
    unexplained = Unexplained(fitted)
    if unexplained.held_out != "runs":  # no run can be left out
        return False
    found, stds = (unexplained.common(kind).ceiling for kind in kinds), fitted.settings.moment.law_stds
    return any(one.closed - stds * one.std > share for one in found)


def overdispersion(fitted: Fit, kind: type[Effect]) -> float:
    """Variance of an effect's parameters over what independent noise would give, 1 or more.

    Returns:
        From the scatter of the runs' gradients, whose sum is zero (the sandwich covariance with the runs
        as clusters; Liang and Zeger, Biometrika 73 (1986) 13), the mean over the parameters.
    """
    matrices, gradients, _ = by_run(fitted.jacobian, fitted.residuals, products=fitted.products)
    own = [i for i, name in enumerate(fitted.problem.names) if name.split(".")[0] == kind.name]
    total = matrices.sum(axis=0)
    size = np.sqrt(np.maximum(np.diag(total), 1e-300))
    inverse = np.linalg.pinv(total / np.outer(size, size), rcond=1e-12)
    scatter = (gradients / size).T @ (gradients / size) * len(gradients) / max(len(gradients) - 1, 1)
    robust = (inverse @ scatter @ inverse)[np.ix_(own, own)]
    naive = inverse[np.ix_(own, own)]
    return max(1.0, float(np.trace(np.linalg.pinv(naive) @ robust)) / max(len(own), 1))


def _settled(best: Hypothesis, view: View) -> Hypothesis:
    """The best set of effects on rows in whose noise the response to the random moment is part.

    The set given, where no random moment acts or its filter does not settle. The random moment is estimated from
    what the best set leaves when it is fitted with the sensor's noise alone: the fit with the response as noise
    lets the motion wander as the response does, and its own residuals overstate it. The rounds end where the best
    set is the one that the random moment was estimated beside. Where none is, the likeliest of those reached is
    taken.
    """
    nominal, kinds, known, top = view.base, view.able, best.fit, best
    data, chosen = nominal.problem.data, nominal.settings.moment
    windy = {kind.name for kind in kinds if kind.condition == "wind_on"}
    reached: dict[tuple[str, ...], Hypothesis] = {}

    def cost(hypothesis: Hypothesis) -> float:
        process = likeliest(random_moments(_seen_in(hypothesis, data).fit), chosen)
        if process is None:
            return np.inf
        price = process.price(chosen.part_price) + chosen.effect_price * len(hypothesis.effects)
        return process.cost + price

    with suppress(FitError, np.linalg.LinAlgError):
        for _ in range(_ROUNDS):
            process = likeliest(random_moments(known), chosen)
            noisy = None if process is None else with_response(known, process.spectrum)
            if noisy is None:
                break
            base = settled(fit(replace(nominal.problem, data=noisy), nominal.point))
            sets = [Hypothesis((), base), *grow(view.on(base))]
            found = max(sets, key=Scale.of(sets, gap_left(base), base.settings.weighing).weight)
            # a random moment leaves little of a gap in the wind for effects to be compared there: more are added
            # while one of the wind is evident, the most evident of all, so that none mops up what another leaves
            top = _sought_again(found)
            further = _evident(top, kinds)
            while any(h.effects[-1] in windy for h in further):
                top = further[0]
                further = _evident(top, kinds)
            if top.names == best.names:
                return top
            reached[top.names] = top
            best = _seen_in(top, data)
            known = fit(best.fit.problem, best.fit.point)
        if len(reached) > 1:  # to and fro between sets
            top = min(reached.values(), key=cost)
    return top


def _sought_again(hypothesis: Hypothesis) -> Hypothesis:
    """The set with instants and phases sought once more; each run keeps those that leave less.

    They were found before the other effects were known.
    """
    known = hypothesis.fit
    for kind in known.problem.effects:
        if not (kind.skips or kind.line):
            continue
        others = restricted(known, {other.name for other in known.problem.effects} - {kind.name})
        start = next(iter(starting_points(fit_at(others.problem, others.point), kind)), None)
        if start is None:
            continue
        sought = fit(start.problem, start.point)
        tried = [known, sought]
        if sought.point.release.shape == known.point.release.shape:  # else another number of instants
            release = sought.point.release.copy()
            kept = known.chi2 < sought.chi2
            old, new = (f.problem.parameters.own_places[kind.name] for f in (known, sought))
            release[kept, new] = known.point.release[kept, old]
            tried.append(fit(sought.problem, Point(sought.point.common, release)))
        known = min(tried, key=lambda f: f.total)
    return replace(hypothesis, fit=known)


def _seen_in(hypothesis: Hypothesis, data: Data) -> Hypothesis:
    """The hypothesis as it stands, with residuals in the noise of other data."""
    problem = replace(hypothesis.fit.problem, data=data)
    return replace(hypothesis, fit=fit_at(problem, hypothesis.fit.point), textbook=None)
