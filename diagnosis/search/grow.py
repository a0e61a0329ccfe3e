"""Which effects: sets of causes, grown one effect at a time and pruned, on whole runs or on stretches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.likelihood.least_squares import Fit, FitError, fit, try_fit
from diagnosis.likelihood.prepare import Stretches, fit_longer, in_stretches, long_stretch, spread_out
from diagnosis.likelihood.residuals import ChannelMisfit, misfit
from diagnosis.likelihood.run_data import Data
from diagnosis.likelihood.starting_points import StartingPoint, misses_motion, starting_points
from diagnosis.search.hypothesis import (
    Hypothesis,
    Scale,
    is_plausible,
    of_more_weight,
    own_gain,
    restricted,
    turned_back,
    with_forms,
)
from diagnosis.search.weigh import OF_MOTION, log_misfit, misfit_scale
from tunnel_sim.effects import Effect

_ITERATIONS = 12  # of a fit on the way; the answer's own is polished

Progress = Callable[[str], None]


def grow(
    nominal: Fit,
    kinds: Sequence[type[Effect]],
    progress: Progress | None = None,
    first: Hypothesis | None = None,
) -> list[Hypothesis]:
    """Add effects one after another, to the best few sets of each size.

    Args:
        first: the set that all others contain; None: none.

    Returns:
        Fitted hypotheses of all sizes, best first. The growth ends where the evidence for a larger set falls or
        could not rise, and at the most causes named.
    """
    found: dict[tuple[str, ...], Hypothesis] = {} if first is None else {first.names: first}
    level, gap = [Hypothesis((), nominal) if first is None else first], misfit(nominal)
    chosen = nominal.settings.search
    while level:
        children = sets_with_one_more(level, kinds, progress)
        scale = Scale.of(children, gap, nominal.settings.weighing)
        if all(scale.form_may_gain(child) for child in children):
            count = chosen.freed_hypotheses if not level[0].effects else 1
            children = with_forms(children, gap, chosen.form_open * level[0].fit.excess, count)
        found |= {child.names: child for child in children}
        going, level = going_on(children, level, gap), []
        for hypothesis in going:  # those that change the readings alike would grow alike
            if not any(_same_change(hypothesis.fit, other.fit, nominal) for other in level):
                level.append(hypothesis)
        level = level[: chosen.grown_from]
    return sorted(found.values(), key=lambda h: h.fit.total)


def second_mode_alone(nominal: Fit, kinds: Sequence[type[Effect]]) -> Hypothesis | None:
    """The second mode, where the nominal model misses the motion because it has one mode only.

    Returns:
        The fit with the mode added; None where it misses the motion too, or may not be tried.
    """
    modes = [kind for kind in kinds if kind.line == "ringing"]
    found = sets_with_one_more([Hypothesis((), nominal)], modes, None)
    return found[0] if found and not misses_motion(found[0].fit) else None


def _same_change(one: Fit, other: Fit, nominal: Fit) -> bool:
    """Whether two fits differ by little of the power by which they change the nominal one."""
    apart = sum(float(np.sum((a - b) ** 2)) for a, b in zip(one.residuals, other.residuals, strict=True))
    return apart < nominal.settings.search.same_change * (nominal.total - max(one.total, other.total))


def going_on(
    children: Sequence[Hypothesis], parents: Sequence[Hypothesis], gap: ChannelMisfit
) -> list[Hypothesis]:
    """The sets to grow further from their parents, best first; none where the best of all could gain nothing.

    Args:
        gap: what the nominal model leaves.
    """
    settings = parents[0].fit.settings
    scale = Scale.of((*children, *parents), gap, settings.weighing)
    ranked = sorted(children, key=lambda h: -scale.weight(h))
    if not ranked or not _may_gain(ranked[0], scale):
        return []
    going = []
    for child in ranked:  # may still lead on from the best it grew from: of two equal causes one closes half
        smaller = [h for h in parents if set(h.effects) < set(child.effects)]
        first = not any(parent.effects for parent in smaller)
        if first or scale.weight(child) > max(map(scale.weight, smaller)) - settings.search.growth_loss:
            going.append(child)
    return going


def _may_gain(hypothesis: Hypothesis, scale: Scale) -> bool:
    """Whether the weight could rise if one more effect left nothing."""
    if not hypothesis.effects:
        return True
    rises = scale.greatest(hypothesis) > scale.weight(hypothesis)
    return rises and len(hypothesis.effects) < hypothesis.fit.settings.search.most_causes


def prune(whole: Hypothesis, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses with one effect less than a given one that were not fitted yet.

    Returns:
        The missing ones, each started from the values of the whole.
    """
    known = {hypothesis.names for hypothesis in found}
    smaller = []
    for kind in whole.fit.problem.effects:
        names = tuple(name for name in whole.effects if name != kind.name)
        if names and tuple(sorted(names)) not in known:
            with suppress(FitError, np.linalg.LinAlgError):
                smaller.append(Hypothesis(names, without(whole.fit, kind)))
    return smaller


def exchange(whole: Hypothesis, found: Sequence[Hypothesis], nominal: Fit) -> list[Hypothesis]:
    """The sets in which one effect of a given set is replaced by another that changes the readings alike.

    Args:
        whole: with two effects or more.
        found: fitted hypotheses, those with one effect less than ``whole`` among them.

    Returns:
        Those that were not fitted yet. Two effects are alike where each was fitted alone and the fits are.
    """
    by_name = {hypothesis.names: hypothesis for hypothesis in found}
    alone = {h.effects[0]: h for h in found if len(h.effects) == 1}
    sets: list[Hypothesis] = []
    for name in filter(alone.__contains__, whole.effects):
        others = tuple(sorted(set(whole.effects) - {name}))
        alike = [
            h.fit.problem.effects[0]
            for other, h in alone.items()
            if other not in whole.effects
            and tuple(sorted((*others, other))) not in by_name
            and _same_change(h.fit, alone[name].fit, nominal)
        ]
        if others in by_name:
            for child in sets_with_one_more([by_name[others]], alike, None):  # converged, as its rival is
                fitted = None if child.fit.converged else try_fit(child.fit.problem, child.fit.point)
                sets.append(child if fitted is None else replace(child, fit=fitted))
    return sets


def without(whole: Fit, kind: type[Effect]) -> Fit:
    """Refit with one effect taken out, starting from the values of the others.

    Raises:
        FitError: when the model cannot be integrated.
    """
    start = restricted(whole, {other.name for other in whole.problem.effects} - {kind.name})
    return fit(start.problem, start.point)


def sets_with_one_more(
    level: Sequence[Hypothesis], kinds: Sequence[type[Effect]], progress: Progress | None
) -> list[Hypothesis]:
    """The sets with one effect more, each fitted from its best starting points.

    Returns:
        One for every set of effects: that of more weight where two sets lead to it, so that a freed form of one
        does not take the place of the other.
    """
    # alone, a freed form also follows what other causes do
    single = [h for h in level if len(h.effects) == 1]
    textbook = [Hypothesis(h.effects, h.textbook) for h in single if h.textbook is not None]
    found: dict[tuple[str, ...], Hypothesis] = {}
    for parent in (*level, *textbook):
        base = parent.fit
        others = [kind for kind in kinds if kind.name not in parent.effects]
        for kind, starts in _worth_fitting(parent, others):
            if progress is not None:
                progress(" + ".join((*parent.effects, kind.name)))
            starts = starts[: kind.tries]
            tried = [fitted for start in starts if (fitted := _fitted(start, base)) is not None]
            if all(fitted.total > base.total for fitted in tried):  # linear theory led too far
                near = [point for start in starts if (point := start.nearer()) is not None]
                tried += [fitted for start in near if (fitted := _fitted(start, base)) is not None]
            there = filter(is_plausible, map(turned_back, tried))
            best = min(there, key=lambda fitted: fitted.total, default=None)
            if best is not None:
                child = Hypothesis((*parent.effects, kind.name), best)
                found[child.names] = of_more_weight(found.get(child.names), child, misfit(base))
    return list(found.values())


def _worth_fitting(
    parent: Hypothesis, kinds: Sequence[type[Effect]]
) -> list[tuple[type[Effect], list[StartingPoint]]]:
    """The effects that linear theory predicts to close most; after the nominal model generously many.

    Beside other effects, those that are predicted to do no more than a needless one are left out.
    """
    scored = [(kind, starts) for kind in kinds if (starts := starting_points(parent.fit, kind))]
    weighing, chosen = parent.fit.settings.weighing, parent.fit.settings.search
    scale = misfit_scale(misfit(parent.fit), weighing)
    scored.sort(
        key=lambda item: min(
            log_misfit(start.predicted, scale, OF_MOTION, weighing.leak) for start in item[1]
        )
    )
    if parent.effects:
        needed, own = [], own_gain(parent.fit.problem)
        for kind, starts in scored[: chosen.grown_by]:
            by_chance = own_gain(starts[0].problem) - own
            if starts[0].predicted_drop > chosen.least_drop + by_chance:
                needed.append((kind, starts))
        return needed
    limit = chosen.predicted_share * parent.fit.total
    return [
        item for i, item in enumerate(scored) if i < chosen.always_fitted or item[1][0].predicted_drop > limit
    ]


def _fitted(start: StartingPoint, base: Fit) -> Fit | None:
    if misses_motion(base):
        found = try_fit(start.problem, start.point)
    else:
        found = try_fit(start.problem, start.point, base=base, max_iterations=_ITERATIONS)
    return found if found is not None and np.isfinite(found.total) else None


@dataclass(frozen=True, eq=False)
class InStretches:
    """Sets of causes grown on stretches of the runs.

    Args:
        nominal: fit of the nominal model to long stretches.
        stretches: these.
        hypotheses: sets of causes fitted to them.
    """

    nominal: Fit
    stretches: Stretches
    hypotheses: tuple[Hypothesis, ...]

    def whole(self, hypothesis: Hypothesis, data: Data) -> Hypothesis | None:
        """The hypothesis fitted to whole runs, from its fit to stretches; None where the fit fails."""
        with suppress(FitError, np.linalg.LinAlgError):
            return replace(hypothesis, fit=fit_longer(hypothesis.fit, self.stretches, data)[0])
        return None


@dataclass(frozen=True, eq=False)
class _Grown:
    """A set of causes fitted to long stretches of the runs, and to short ones where it was found there."""

    long: Hypothesis
    short: Hypothesis | None = None


def grow_in_stretches(
    data: Data,
    fit_nominal: Callable[[Data], Fit],
    kinds: Sequence[type[Effect]],
    progress: Progress | None = None,
) -> InStretches:
    """Grow sets of causes on stretches of the runs, where the nominal model misses the motion itself.

    Args:
        fit_nominal: fits the nominal model to any runs.

    Returns:
        The best sets of each size, compared in long stretches. Effects are added in short ones, in which the phase
        cannot be lost, and in long ones to the sets that keep it there: a slow loss hardly shows in two cycles.
    """
    short = spread_out(in_stretches(data), data)
    first = fit_nominal(short.data)
    try:
        nominal, long = fit_longer(first, short, data, long_stretch(short))
    except (FitError, np.linalg.LinAlgError):  # a model without the causes may run away in long stretches
        nominal, long = first, short
    level, found = [_Grown(Hypothesis((), nominal), Hypothesis((), first))], []
    able, gap = [kind for kind in kinds if kind.autonomous], misfit(nominal)
    chosen = data.settings.search
    while level:
        # sets with one effect more, from the better of two starts where there are two
        tried = sets_with_one_more([g.short for g in level if g.short is not None], able, progress)
        grown: dict[tuple[str, ...], _Grown] = {}
        for h in sorted(tried, key=lambda h: h.fit.total)[: chosen.fitted_longer]:
            with suppress(FitError, np.linalg.LinAlgError):
                longer, _ = fit_longer(h.fit, short, data, long_stretch(short))
                grown[h.names] = _Grown(replace(h, fit=longer), h)
        following = [g.long for g in level if g.long.effects and not misses_motion(g.long.fit)]
        for child in sets_with_one_more(following, able, progress):
            other = grown.get(child.names)
            if other is None or child.fit.total < other.long.fit.total:
                grown[child.names] = _Grown(child, None if other is None else other.short)
        least = min(
            chosen.form_open * level[0].long.fit.excess,
            data.settings.weighing.model_error**2 * gap.motion / nominal.count,
        )
        children = with_forms([child.long for child in grown.values()], gap, least)
        found += children
        parents = [g.long for g in level]
        going = _of_each(parents, going_on(children, parents, gap))
        level = [replace(grown[h.names], long=h) for h in going[: chosen.grown_from]]
    return InStretches(nominal, long, tuple(sorted(found, key=lambda h: h.fit.total)))


def _of_each(parents: Sequence[Hypothesis], ranked: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best child of each parent, then the others: what fits better at first may be a dead end."""
    first: list[Hypothesis] = []
    for parent in parents:
        own = [h for h in ranked if h not in first and set(parent.effects) < set(h.effects)]
        first += own[:1]
    return first + [h for h in ranked if h not in first]
