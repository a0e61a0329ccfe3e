"""A cause from outside the vocabulary: an inertia that differs from spring to spring.

Each spring has its adapter and its clamps, and they swing with the body. Another stiffness changes the frequency in
the runs of the spring. Another inertia also changes how fast they decay, and how far the air changes frequency and
decay. So the decay, and runs with the wind off and on, tell the two apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any, Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.likelihood.residuals import CHANNELS
from diagnosis.model.fact import Fact, as_stated
from diagnosis.model.parameters import Point
from diagnosis.model.similarity import Similarity
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.rivals.rival import Rival, explains_all, explains_more
from diagnosis.search.rivals.two_springs import ONE_SPRING, SpringError, differs_by_spring
from diagnosis.search.scatter import without_deviations
from identification.show.numbers import for_people, listed, plain
from tunnel_sim.effects.base import Drawn
from tunnel_sim.physics.run_settings import SettingsTable

INERTIAS_BESIDE: Final = 3
"""Number of sets of effects beside which inertias that differ by spring are tried. Judgement. Time against
coverage."""


@dataclass(frozen=True)
class InertiaOfSpring(ONE_SPRING):  # type: ignore[valid-type, misc]
    """An inertia that differs in the runs of one spring."""

    @classmethod
    def on_runs(
        cls,
        runs: SettingsTable,
        stated: SettingsTable,
        effects: Sequence[InertiaOfSpring],
        drawn: Sequence[Drawn],
    ) -> None:
        """Change the inertia in the spring's runs."""
        del drawn
        runs["yaw_inertia"][:] *= cls.scales(stated, effects)


@cache
def _kind(number: int) -> type[InertiaOfSpring]:
    """One of several such inertias."""
    return dataclass(frozen=True)(
        type(f"InertiaOfSpring{number}", (InertiaOfSpring,), {"name": f"inertia_of_spring_{number}"})
    )


class InertiaBySpring(Rival):
    """An inertia of every spring, in place of the effects of answers that change the frequency with the spring."""

    def hypotheses(
        self, likely: Sequence[Hypothesis], known: Sequence[Hypothesis], nominal: Fit
    ) -> list[Hypothesis]:
        """The inertias with the other effects of each answer, where they explain more than every set of effects.

        Runs that differ by chance are compared as if they repeated exactly.

        None with one spring, and none where effects alone explain the readings down to their noise. The law is
        exact, so it must leave no more than chance: beside runs that differ, it would take up a part of that.
        """
        data = nominal.problem.data
        if len(data.springs) < 2 or data.driven:
            return []
        sets = [one for one in (Hypothesis((), nominal), *known) if not one.fit.problem.scatter]
        repeating = [one.fit for one in sets] + [
            fitted for one in likely if (fitted := try_fit(*without_deviations(one.fit))) is not None
        ]
        least = min(repeating, key=lambda fit: fit.total, default=None)
        if least is None or explains_all(least):
            return []
        bases: dict[tuple[str, ...], Hypothesis] = {(): Hypothesis((), nominal)}
        for answer in likely:
            kinds = [kind for kind in answer.fit.problem.effects if not differs_by_spring(kind)]
            names = tuple(kind.name for kind in kinds)
            bases.setdefault(names, Hypothesis(names, restricted(answer.fit, names)))
        tried = [
            one
            for base in list(bases.values())[:INERTIAS_BESIDE]
            if (one := _with_inertias(base)) is not None
        ]
        exact = [one for one in tried if one.leaves_within(np.zeros(len(CHANNELS)))]
        better = [one for one in exact if explains_more(one.fit, least.total)]
        return [
            one
            for one in better
            if all(
                explains_more(one.fit, part.fit.total) for part in better if set(part.names) < set(one.names)
            )
        ]

    def fact(self, best: Hypothesis, similarity: Similarity) -> Fact:
        """The differences of the inertia by spring, and the effects that act with them."""
        fit, springs = best.fit, best.fit.problem.data.springs
        inflate = float(np.sqrt(1.0 + max(fit.excess, 0.0)))
        own = [_kind(number).name for number in range(len(springs) - 1)]
        each = [
            SpringError(
                similarity.own(spring, "N m/rad"),
                fit.value(f"{name}.error"),
                inflate * fit.std(f"{name}.error"),
            )
            for spring, name in zip(springs[1:], own, strict=True)
        ]
        beside = [name for name in best.names if name not in own]
        figures = {"springs": [asdict(one) for one in each], "beside": beside}
        return as_stated(_words(figures), "inertia by spring", figures, remedy=_REMEDY)


_REMEDY = "Weigh the adapters and clamps of the springs"


def _words(found: Mapping[str, Any]) -> str:
    """An inertia that differs from spring to spring and would explain the gap."""
    beside = f" beside {plain(*found['beside'])}" if found["beside"] else ""
    each = [
        f"{for_people(100.0 * one.error, 100.0 * one.std, '%')} with the spring of {one.stiffness:g} N m/rad"
        for one in (SpringError(**given) for given in found["springs"])
    ]
    return (
        f"An inertia that differs from spring to spring would explain the gap{beside}: {listed(each)}, against the "
        "softest spring."
    )


def inertia_in_place(fitted: Fit) -> tuple[Fit, str] | None:
    """The fit with another inertia in place of another stiffness in the runs of one spring, and its effect's name.

    None where no spring is off, or the fit fails.
    """
    problem, kind = fitted.problem, _kind(0)
    if ONE_SPRING not in problem.effects:
        return None
    effects = tuple(kind if one is ONE_SPRING else one for one in problem.effects)
    fixed = tuple(
        (name.replace(f"{ONE_SPRING.name}.", f"{kind.name}."), value) for name, value in problem.fixed
    )
    common = fitted.point.common.copy()
    common[problem.names.index(f"{ONE_SPRING.name}.error")] *= -1.0  # the same change of the frequency
    instead = try_fit(replace(problem, effects=effects, fixed=fixed), Point(common, fitted.point.per_run))
    return None if instead is None else (instead, kind.name)


def _with_inertias(base: Hypothesis) -> Hypothesis | None:
    """A set with an inertia of each spring but the softest."""
    problem, point = without_deviations(base.fit)
    springs = problem.data.springs[1:]
    kinds = tuple(_kind(number) for number in range(len(springs)))
    fixed = tuple(
        (f"{kind.name}.{ONE_SPRING.chosen_spring()}", spring)
        for kind, spring in zip(kinds, springs, strict=True)
    )
    problem = replace(problem, effects=(*problem.effects, *kinds), fixed=(*problem.fixed, *fixed))
    fitted = try_fit(problem, Point(np.append(point.common, np.zeros(len(kinds))), point.per_run))
    return None if fitted is None else Hypothesis((*base.effects, *(kind.name for kind in kinds)), fitted)
