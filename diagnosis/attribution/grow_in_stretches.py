"""Which effects, where the nominal model misses the motion itself: sets grown on stretches of the runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.attribution.grow import Progress, going_on, sets_with_one_more
from diagnosis.attribution.hypothesis import Hypothesis, with_forms
from diagnosis.fitting.channels import misfit
from diagnosis.fitting.least_squares import Fit, FitError
from diagnosis.fitting.run_data import Data
from diagnosis.fitting.starting_points import is_gross
from diagnosis.fitting.stretches import Stretches, fit_longer, in_stretches, long_stretch, spread_out
from diagnosis.policy import FREED_FROM, GROWN_FROM, LENGTHENED, MODEL_ERROR
from tunnel_sim.effects import Effect


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
        """The hypothesis fitted to whole runs, from its fit to stretches.

        Args:
            hypothesis: fitted to the stretches.

        Returns:
            The same effects; None where the fit fails.
        """
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
        kinds: effects to try; those that are autonomous are.
        progress: called with the names of each set.

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
    while level:
        grown = _longer_sets(level, short, data, able, progress)
        least = min(FREED_FROM * level[0].long.fit.excess, MODEL_ERROR**2 * gap.motion / nominal.count)
        children = with_forms([child.long for child in grown.values()], gap, least)
        found += children
        parents = [g.long for g in level]
        going = _of_each(parents, going_on(children, parents, gap))
        level = [replace(grown[h.names], long=h) for h in going[:GROWN_FROM]]
    return InStretches(nominal, long, tuple(sorted(found, key=lambda h: h.fit.total)))


def _of_each(parents: Sequence[Hypothesis], ranked: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best child of each parent, then the others: what fits better at first may be a dead end."""
    first: list[Hypothesis] = []
    for parent in parents:
        child = next((h for h in ranked if h not in first and set(parent.effects) < set(h.effects)), None)
        if child is not None:
            first.append(child)
    return first + [h for h in ranked if h not in first]


def _longer_sets(
    level: Sequence[_Grown],
    short: Stretches,
    data: Data,
    kinds: Sequence[type[Effect]],
    progress: Progress | None,
) -> dict[tuple[str, ...], _Grown]:
    """The sets with one effect more, by their names, from the better of two starts where there are two."""
    tried = sets_with_one_more([g.short for g in level if g.short is not None], kinds, progress)
    best = sorted(tried, key=lambda h: h.fit.total)[:LENGTHENED]
    grown = {h.names: g for h in best if (g := _lengthened(h, short, data)) is not None}
    following = [g.long for g in level if g.long.effects and not is_gross(g.long.fit)]
    for child in sets_with_one_more(following, kinds, progress):
        other = grown.get(child.names)
        if other is None or child.fit.total < other.long.fit.total:
            grown[child.names] = _Grown(child, None if other is None else other.short)
    return grown


def _lengthened(hypothesis: Hypothesis, short: Stretches, data: Data) -> _Grown | None:
    with suppress(FitError, np.linalg.LinAlgError):
        found, _ = fit_longer(hypothesis.fit, short, data, long_stretch(short))
        return _Grown(replace(hypothesis, fit=found), hypothesis)
    return None
