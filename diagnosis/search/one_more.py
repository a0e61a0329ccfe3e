"""Sets of causes with one effect more, fitted from their best starting points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.residuals import gap_left, misfit
from diagnosis.likelihood.starting_points import (
    StartingPoint,
    misses_motion,
    second_order_starts,
    starting_points,
)
from diagnosis.search.clock import Progress
from diagnosis.search.hypothesis import Hypothesis, is_plausible, of_more_weight, own_gain, turned_back
from diagnosis.search.scatter import likelier, with_likeliest_widths, with_own_linear_terms
from diagnosis.search.weights import log_weight, misfit_scale
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import SecondOscillation

ALWAYS_FITTED: Final = 7
"""Number of effects that are fitted in any case, ranked by linear theory. Judgement. Linear theory ranks
effects well, but cannot decide."""
PREDICTED_SHARE: Final = 0.01
"""Minimum predicted drop of χ², as a share of χ², for further effects to be fitted. Judgement."""
LEAST_DROP: Final = 20.0
"""Minimum predicted drop of χ² for an effect to be fitted beside others. Judgement. Two parameters lower χ²
by more than 20 by chance once in 22,000 effects tried."""
LIKELY_BESIDE_SCATTER: Final = 6
"""Number of effects that are fitted in any case where scatter between runs explains their deviations.
Judgement. Linear theory underestimates effects hidden by deviations of the runs: an offset of the wind beside
free play was not tried. Time against coverage."""
GROWN_BY: Final = 4
"""Number of effects that are added to a set. Judgement. Time against coverage."""
SAME_CHANGE: Final = 0.02
"""Maximum difference between the changes of two equivalent sets, as a share of the power. Judgement."""

_ITERATIONS = 12  # iterations of an intermediate fit; the fit of the answer is polished


def second_mode_alone(nominal: Fit, kinds: Sequence[type[Effect]]) -> Hypothesis | None:
    """The second mode, where the nominal model misses the motion because it has only one mode.

    Returns:
        The fit with the mode added; None where it misses the motion as well, where a frequency and a damping of
        every run explain as much, or where the mode may not be tried.
    """
    modes = [kind for kind in kinds if issubclass(kind, SecondOscillation)]
    found = sets_with_one_more([Hypothesis((), nominal)], modes)
    if not found or misses_motion(found[0].fit):
        return None
    own = with_own_linear_terms(nominal, kinds)
    one_mode = None if own is None else try_fit(*own)
    return None if one_mode is not None and one_mode.total < found[0].fit.total else found[0]


def same_change(one: Fit, other: Fit, nominal: Fit) -> bool:
    """Whether two fits differ by a small share of the power of their change from the nominal fit."""
    apart = sum(float(np.sum((a - b) ** 2)) for a, b in zip(one.residuals, other.residuals, strict=True))
    return apart < SAME_CHANGE * (nominal.total - max(one.total, other.total))


def sets_with_one_more(
    level: Sequence[Hypothesis], kinds: Sequence[type[Effect]], progress: Progress | None = None
) -> list[Hypothesis]:
    """The sets with one more effect, each fitted from its best starting points.

    Returns:
        One set for each combination of effects. If two sets lead to it, the one with more weight is taken, so
        that a freed form of one does not exclude the other.
    """
    # a form freed alone also follows the effects of other causes
    single = [h for h in level if len(h.effects) == 1]
    textbook = [Hypothesis(h.effects, h.textbook) for h in single if h.textbook is not None]
    sets: dict[tuple[str, ...], Hypothesis] = {}
    for parent in (*level, *textbook):
        base = parent.fit
        others = [kind for kind in kinds if kind.name not in parent.effects]
        for kind, starts in _worth_fitting(parent, others):
            if progress is not None:
                progress(" + ".join((*parent.effects, kind.name)))
            starts = starts[: kind.tries]
            tried = [fitted for start in starts if (fitted := _fitted(start, base)) is not None]
            if all(fitted.unlikelihood > base.unlikelihood for fitted in tried):  # linear theory failed
                near = [point for start in starts if (point := start.nearer()) is not None]
                near += second_order_starts(base, kind, passive=False)
                tried += [fitted for start in near if (fitted := _fitted(start, base)) is not None]
            there = filter(is_plausible, map(turned_back, tried))
            best = min(there, key=lambda fitted: fitted.unlikelihood, default=None)
            if best is not None:
                best = likelier(best, _repeating(parent, kind)) if parent.repeating is not None else best
                child = Hypothesis((*parent.effects, kind.name), best)
                sets[child.names] = of_more_weight(sets.get(child.names), child, gap_left(base))
    return list(sets.values())


def _worth_fitting(
    parent: Hypothesis, kinds: Sequence[type[Effect]]
) -> list[tuple[type[Effect], list[StartingPoint]]]:
    """The effects that explain most by linear theory; generously many after the nominal model.

    Beside other effects, an effect is left out if its predicted gain is chance. Where chance differences
    between the runs explain what remains, those with the greatest predicted gain are fitted: the differences absorb
    most of what linear theory predicts.
    """
    scored = [(kind, starts) for kind in kinds if (starts := starting_points(parent.fit, kind))]
    weighing = parent.fit.settings.weighing
    scale = misfit_scale(misfit(parent.fit), weighing)
    scored.sort(
        key=lambda item: min(
            -log_weight(start.predicted, scale, 0, 0, weighing, (start.scatter_cost, np.inf))
            for start in item[1]
        )
    )
    if parent.effects or parent.explains_runs:
        own, beyond = own_gain(parent.fit.problem), {}
        for kind, starts in scored:  # the chance gain of the effect's parameters per run is excluded
            beyond[kind.name] = starts[0].predicted_drop - (own_gain(starts[0].problem) - own)
        # linear theory underestimates effects beside scatter: the runs' deviations absorb most of the prediction,
        # not of the effect
        if parent.explains_runs and parent.fit.problem.scatter:
            worth = sorted(scored, key=lambda item: -beyond[item[0].name])[:LIKELY_BESIDE_SCATTER]
        else:
            worth = [item for item in scored[:GROWN_BY] if beyond[item[0].name] > LEAST_DROP]
        if parent.effects and parent.explains_runs:
            worth += [item for item in scored if item[1][0].second_order and item not in worth]
        return [item for item in worth if beyond[item[0].name] > 0.0]
    limit = PREDICTED_SHARE * parent.fit.total
    return [item for i, item in enumerate(scored) if i < ALWAYS_FITTED or item[1][0].predicted_drop > limit]


def _repeating(parent: Hypothesis, kind: type[Effect]) -> Fit | None:
    """The set with one more effect, fitted to runs that repeat exactly, by the best of its starting points."""
    base = parent.repeating
    if base is None:
        return None
    starts = starting_points(base, kind)[: kind.tries]
    tried = [fitted for start in starts if (fitted := _fitted(start, base)) is not None]
    there = filter(is_plausible, map(turned_back, tried))
    return min(there, key=lambda fitted: fitted.total, default=None)


def _fitted(start: StartingPoint, base: Fit) -> Fit | None:
    if misses_motion(base):
        found = try_fit(start.problem, start.point)
    else:
        found = try_fit(start.problem, start.point, base=base, max_iterations=_ITERATIONS)
    return with_likeliest_widths(found, rounds=1) if found is not None and np.isfinite(found.total) else None
