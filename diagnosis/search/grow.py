"""Sets of causes, grown one effect at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from diagnosis.likelihood.residuals import ChannelMisfit
from diagnosis.search.clock import Progress
from diagnosis.search.hypothesis import Hypothesis, Scale
from diagnosis.search.runs_in_view import RunsInView
from diagnosis.search.scatter import likelier

GROWTH_LOSS: Final = 2.8
"""Maximum loss in the logarithm of the weight by an added effect for the set to be extended further. Judgement.
A superfluous effect costs more. One of two equal causes explains only half."""
MOST_CAUSES: Final = 5
"""Maximum number of named causes, in effects. Convention. One to four causes of the vocabulary, and a small
one."""


@dataclass(frozen=True, eq=False)
class GrownLevel:
    """The sets grown up to a size.

    Args:
        found: all fitted sets, best first.
        level: the sets to which an effect is added next; empty at the end.
    """

    found: tuple[Hypothesis, ...]
    level: tuple[Hypothesis, ...]


def levels(view: RunsInView, progress: Progress | None = None) -> Iterator[GrownLevel]:
    """Add effects one at a time to the best few sets of each size, in a view of the runs.

    Args:
        progress: called with the names of each set before it is tried.

    Yields:
        The sets of each size, the smallest first. Growth ends where the evidence for a larger set falls or
        cannot rise, and at the maximum number of causes; the caller may end it earlier.
    """
    first, gap = view.smallest, view.gap
    level = [first]
    # a set of chance differences between runs alone is an answer, too
    found = {first.names: first} if first.effects or first.fit.problem.scatter else {}
    while level:
        yield _grown(found, level)
        children = _likeliest(view.with_forms(view.larger(level, progress), level), gap, view)
        found |= {child.names: child for child in children}
        level = view.to_grow(level, going_on(children, level, gap, in_pairs=level[0] is first))
    yield _grown(found, level)


def _grown(found: Mapping[tuple[str, ...], Hypothesis], level: Sequence[Hypothesis]) -> GrownLevel:
    return GrownLevel(tuple(sorted(found.values(), key=lambda h: h.fit.total)), tuple(level))


def grow(view: RunsInView, progress: Progress | None = None) -> list[Hypothesis]:
    """The fitted sets of all sizes, best first (`levels`)."""
    *_, last = levels(view, progress)
    return list(last.found)


def going_on(
    children: Sequence[Hypothesis],
    parents: Sequence[Hypothesis],
    gap: ChannelMisfit,
    *,
    in_pairs: bool = False,
) -> list[Hypothesis]:
    """The sets to grow further from their parents, best first; empty if not even the best could gain weight.

    Args:
        gap: misfit of the nominal model.
        in_pairs: whether to extend all effects that only the comparison of runs shows. Of two patterns between
            the runs, one alone leaves differences that make the other look like chance.
    """
    settings = parents[0].fit.settings
    scale = Scale.of((*children, *parents), gap, settings.weighing)
    ranked = sorted(children, key=lambda h: -scale.weight(h))
    if not ranked or not _may_gain(ranked[0], scale):
        return []
    best = max((*ranked, *parents), key=scale.weight)
    if best.explains_runs:  # only differences between runs remain, and further effects may explain them
        known = max(parent.fit.shown_between_runs for parent in parents)
        patterns = [child for child in ranked if in_pairs and child.fit.shown_between_runs > known]
        # not by weight: if the scatter is as wide as before, it hides the gain
        patterns.sort(key=lambda child: child.fit.unlikelihood)
        return patterns or [child for child in ranked if child is best]
    going = []
    # the set may still improve on its best parent: one of two equal causes explains half
    for child in ranked:
        smaller = [h for h in parents if set(h.effects) < set(child.effects)]
        first = not any(parent.effects for parent in smaller)
        if first or scale.weight(child) > max(map(scale.weight, smaller)) - GROWTH_LOSS:
            going.append(child)
    return going


def _may_gain(hypothesis: Hypothesis, scale: Scale) -> bool:
    """Whether the weight could rise if one more effect removed the whole residual."""
    if not hypothesis.effects:
        return True
    rises = scale.greatest(hypothesis) > scale.weight(hypothesis)
    return rises and len(hypothesis.effects) < MOST_CAUSES


def _likeliest(children: Sequence[Hypothesis], gap: ChannelMisfit, view: RunsInView) -> list[Hypothesis]:
    """The sets, with the best also fitted to runs that repeat exactly."""
    if not view.base.problem.scatter:
        return list(children)
    scale = Scale.of((*children, view.smallest), gap, view.base.settings.weighing)
    ranked = sorted(children, key=lambda h: -scale.weight(h))
    first = view.base.settings.search.grown_from
    return [replace(h, fit=likelier(h.fit)) if place < first else h for place, h in enumerate(ranked)]
