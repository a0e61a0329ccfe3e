"""Springs of which one is off where the runs cannot tell which: their errors, in words and steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from diagnosis.findings.finding import NextStep
from diagnosis.search.rivals.two_springs import ONE_SPRING, SpringError, spring_error
from diagnosis.search.study import Study
from identification.show.numbers import for_people, listed, plain, probability


def spring_choices(study: Study) -> tuple[SpringError, ...]:
    """The springs of which one is off, where the runs cannot tell which."""
    return tuple(
        replace(
            spring_error(one.hypothesis.fit, ONE_SPRING.name, study.similarity), probability=one.probability
        )
        for one in (study.answer.choices if study.answer else ())
    )


def one_of_springs(found: Sequence[SpringError]) -> str:
    """The statement that one of several indistinguishable springs is off."""
    return f"one of the {count_of_springs(found)} springs is off"


def count_of_springs(found: Sequence[SpringError]) -> str:
    """The number of possible springs, in words."""
    count = len(found)
    return "two" if count == 2 else str(count)


def choices_of_spring(found: Sequence[SpringError]) -> str:
    """The alternative errors of springs: ``16.12 N m/rad by −1.96 % or 44.84 N m/rad by 2.00 %``."""
    each = (
        f"{one.stiffness:g} N m/rad by {for_people(100.0 * one.error, 100.0 * one.std, '%')}" for one in found
    )
    return " or ".join(each)


def choice_words(found: Sequence[SpringError]) -> str:
    """Which of the springs may be off, where the runs cannot tell; empty where they can."""
    if not found:
        return ""
    springs = [f"{_spring_off(one)} ({probability(one.probability or 0.0)})" for one in found]
    return (
        f"{one_of_springs(found).capitalize()}, and these runs do not show which: {', or '.join(springs)}. The "
        f"coefficients are averaged over {'both' if len(found) == 2 else 'them'}."
    )


def choice_steps(found: Sequence[SpringError]) -> list[NextStep]:
    """How to tell which spring is off; none where the runs tell."""
    stiffness = sorted(one.stiffness for one in found)
    if not stiffness:
        return []
    further, which = ("third", "both springs") if len(stiffness) == 2 else ("further", "these springs")
    springs = listed([f"{one:g}" for one in stiffness])
    return [
        NextStep(
            f"Measure the stiffness of {which} again ({springs} N m/rad), or add runs with a {further} spring",
            "shows which of them is off",
        )
    ]


def _spring_off(found: SpringError) -> str:
    """A spring that may be off, such as ``16.12 N m/rad is 1.96 % softer than stated``."""
    size = for_people(100.0 * abs(found.error), 100.0 * found.std, "%")
    side = "stiffer" if found.error > 0.0 else "softer"
    return f"{found.stiffness:g} N m/rad is {size} {side} than stated"


def two_springs_words(found: Mapping[str, Any]) -> str:
    """Springs that would explain the gap together."""
    beside = f" beside {plain(*found['beside'])}" if found["beside"] else ""
    springs = " and ".join(_spring_off(SpringError(**one)) for one in found["springs"])
    return (
        f"Two springs that are not as stiff as stated would explain the gap{beside}: for example, "
        f"{springs}. Measure their stiffness again."
    )


def inertia_by_spring_words(found: Mapping[str, Any]) -> str:
    """An inertia that differs from spring to spring and would explain the gap."""
    beside = f" beside {plain(*found['beside'])}" if found["beside"] else ""
    each = [
        f"{for_people(100.0 * one.error, 100.0 * one.std, '%')} with the spring of {one.stiffness:g} N m/rad"
        for one in (SpringError(**given) for given in found["springs"])
    ]
    return (
        f"An inertia that differs from spring to spring would explain the gap{beside}: {listed(each)}, against the "
        "softest spring. Weigh the adapters and clamps of the springs."
    )
