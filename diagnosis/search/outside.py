"""A cause from outside the vocabulary: two springs that are not as stiff as stated.

Every effect that changes the frequency with the spring has one number for it, and the inertia is another: two such
effects fit any frequencies of three springs, so that they prove nothing by them. Two springs that are off are as
simple (paper, Table II: springs 4 and 7), and are no effect of the vocabulary. They are weighed like a set of it;
what is probable of them is probable of an unknown cause.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.search.grow import sets_with_one_more
from diagnosis.search.hypothesis import Hypothesis, restricted
from tunnel_sim.effects import ALL_EFFECTS, Effect

(ONE_SPRING,) = (kind for kind in ALL_EFFECTS if kind.chosen_spring() is not None)


@dataclass(frozen=True)
class AnotherSpring(ONE_SPRING):  # type: ignore[valid-type, misc]
    """A second spring that is not as stiff as stated."""

    name = "another_spring"


def two_springs(answers: Iterable[Hypothesis], found: Sequence[Hypothesis], nominal: Fit) -> list[Hypothesis]:
    """Two springs off, in place of the effects of answers that change the frequency with the spring.

    Args:
        answers: the sets that may be the answer.
        found: fitted hypotheses, at which the fits start where they have the effects that stay.
        nominal: the nominal model.

    Returns:
        Fitted hypotheses that lower χ² by more than needless effects would; none with too few springs.
    """
    data = nominal.problem.data
    if len(data.springs) < data.settings.search.two_springs_of:
        return []
    known = {hypothesis.names: hypothesis for hypothesis in found} | {(): Hypothesis((), nominal)}
    pairs: dict[tuple[str, ...], Hypothesis] = {}
    for answer in answers:
        kinds = answer.fit.problem.effects
        others = tuple(sorted(kind.name for kind in kinds if not _differs_by_spring(kind)))
        if len(others) == len(kinds) or others in pairs:
            continue
        one, rest = known.get(tuple(sorted((*others, ONE_SPRING.name)))), known.get(others)
        if one is None and rest is None:
            start = restricted(answer.fit, others)
            fitted = try_fit(start.problem, start.point)
            rest = None if fitted is None else Hypothesis(others, fitted)
        level = [one] if one is not None else sets_with_one_more([rest] if rest else [], [ONE_SPRING], None)
        for pair in sets_with_one_more(level, [AnotherSpring], None):
            fitted = None if pair.fit.converged else try_fit(pair.fit.problem, pair.fit.point)
            pairs[others] = pair if fitted is None else replace(pair, fit=fitted)
    return list(pairs.values())


def _differs_by_spring(kind: type[Effect]) -> bool:
    """Whether an effect changes the frequency of the runs of every spring by another share."""
    stiffens = kind.channel == "stiffness" and kind.condition == "always" and not kind.on_spring
    return stiffens or kind.chosen_spring() is not None
