"""A cause from outside the vocabulary: two springs that are not as stiff as stated.

Every effect that changes the frequency with the spring has one parameter for it, and the inertia is another.
Two such effects therefore fit any frequencies of three springs. Two wrong springs are as simple (paper, Table
II: springs 4 and 7), and are not an effect of the vocabulary. They are weighed like a set of effects; their
probability is added to the probability of an unknown cause.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.model.fact import Fact, as_stated
from diagnosis.model.similarity import Similarity
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.one_more import sets_with_one_more
from diagnosis.search.rivals.rival import Rival
from identification.show.numbers import for_people, plain
from tunnel_sim.effects import ALL_EFFECTS, Effect

TWO_SPRINGS_OF: Final = 3
"""Minimum number of springs for two of them to be called miscalibrated. Physics. With fewer springs, one
effect of the vocabulary fits any frequencies."""


@dataclass(frozen=True)
class SpringError:
    """A spring that may not be as stiff as stated.

    Args:
        stiffness: as stated, N m/rad.
        error: relative error of the stiffness, a fraction.
        std: standard deviation of the error, a fraction.
        probability: among the possible springs, a fraction; None if several springs are off together.
    """

    stiffness: float
    error: float
    std: float
    probability: float | None = None

    @property
    def words(self) -> str:
        """Such as ``16.12 N m/rad is 1.96 % softer than stated``."""
        size = for_people(100.0 * abs(self.error), 100.0 * self.std, "%")
        side = "stiffer" if self.error > 0.0 else "softer"
        return f"{self.stiffness:g} N m/rad is {size} {side} than stated"


(ONE_SPRING,) = (kind for kind in ALL_EFFECTS if kind.chosen_spring() is not None)


@dataclass(frozen=True)
class AnotherSpring(ONE_SPRING):  # type: ignore[valid-type, misc]
    """A second spring that is not as stiff as stated."""

    name = "another_spring"


class TwoSprings(Rival):
    """Two springs off, replacing the effects of an answer that change the frequency with the spring."""

    def hypotheses(
        self, likely: Sequence[Hypothesis], known: Sequence[Hypothesis], nominal: Fit
    ) -> list[Hypothesis]:
        """Pairs of springs with the other effects of each answer; none with too few springs.

        Fits start at the known sets with the same effects.
        """
        data = nominal.problem.data
        if len(data.springs) < TWO_SPRINGS_OF:
            return []
        by_name = {hypothesis.names: hypothesis for hypothesis in known} | {(): Hypothesis((), nominal)}
        pairs: dict[tuple[str, ...], Hypothesis] = {}
        for answer in likely:
            kinds = answer.fit.problem.effects
            others = tuple(sorted(kind.name for kind in kinds if not differs_by_spring(kind)))
            if len(others) == len(kinds) or others in pairs:
                continue
            one, rest = by_name.get(tuple(sorted((*others, ONE_SPRING.name)))), by_name.get(others)
            if one is None and rest is None:
                start = restricted(answer.fit, others)
                fitted = try_fit(start.problem, start.point)
                rest = None if fitted is None else Hypothesis(others, fitted)
            level = [one] if one is not None else sets_with_one_more([rest] if rest else [], [ONE_SPRING])
            for pair in sets_with_one_more(level, [AnotherSpring]):
                fitted = None if pair.fit.converged else try_fit(pair.fit.problem, pair.fit.point)
                pairs[others] = pair if fitted is None else replace(pair, fit=fitted)
        return list(pairs.values())

    def fact(self, best: Hypothesis, similarity: Similarity) -> Fact:
        """The two springs with their errors, and the effects that act with them."""
        both = (ONE_SPRING.name, AnotherSpring.name)
        springs = [asdict(spring_error(best.fit, name, similarity)) for name in both]
        beside = [name for name in best.names if name not in both]
        figures = {"springs": springs, "beside": beside}
        return as_stated(_words(figures), "two springs off", figures, remedy=_REMEDY)


_REMEDY = "Measure the stiffness of the springs again"


def _words(found: Mapping[str, Any]) -> str:
    """Springs that would explain the gap together."""
    beside = f" beside {plain(*found['beside'])}" if found["beside"] else ""
    springs = " and ".join(SpringError(**one).words for one in found["springs"])
    return (
        f"Two springs that are not as stiff as stated would explain the gap{beside}: for example, {springs}."
    )


def spring_error(fit: Fit, name: str, similarity: Similarity) -> SpringError:
    """The spring of a spring effect, and its error."""
    stated = dict(fit.problem.fixed)[f"{name}.{ONE_SPRING.chosen_spring()}"]
    inflate = float(np.sqrt(1.0 + max(fit.excess, 0.0)))
    error, std = (of(f"{name}.error") for of in (fit.value, fit.std))
    return SpringError(similarity.own(stated, "N m/rad"), error, inflate * std)


def differs_by_spring(kind: type[Effect]) -> bool:
    """Whether an effect changes the frequency of the runs by a share that depends on the spring."""
    stiffens = kind.channel == "stiffness" and kind.condition == "always" and not kind.on_spring
    return stiffens or kind.chosen_spring() is not None
