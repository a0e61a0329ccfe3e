"""What else a wrong spring may be: another spring, or another inertia with this spring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scipy.special import chdtri

from diagnosis.findings.finding import NextStep, SecondReading
from diagnosis.search.rivals.inertia_by_spring import inertia_in_place
from diagnosis.search.rivals.rival import RIVAL_RATE
from diagnosis.search.rivals.two_springs import ONE_SPRING, SpringError, spring_error
from diagnosis.search.study import Study
from identification.show.numbers import for_people, listed, probability


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
    springs = [f"{one.words} ({probability(one.probability or 0.0)})" for one in found]
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


def other_inertia(study: Study) -> SecondReading | None:
    """The other inertia in the runs of one spring that explains as much as its stiffness; None without one.

    The decay and the air's part in the frequency tell the two apart, where the runs repeat well enough.
    """
    fit = study.chosen
    instead = inertia_in_place(fit)
    if instead is None:
        return None
    fitted, name = instead
    chance = float(chdtri(1.0, RIVAL_RATE)) * (1.0 + max(fit.excess, 0.0))
    if fitted.unlikelihood - fit.unlikelihood > chance:
        return None
    found = spring_error(fitted, name, study.similarity)
    spring, side = f"the spring of {found.stiffness:g} N m/rad", "higher" if found.error > 0.0 else "lower"
    words = (
        f"An inertia {for_people(100.0 * abs(found.error), 100.0 * found.std, '%')} {side} with {spring} would "
        "explain as much: these runs do not tell a wrong stiffness from adapters and clamps of another inertia."
    )
    step = NextStep(
        f"Weigh the adapter and the clamps of {spring}", "tells another inertia from a wrong stiffness"
    )
    figures = {"stiffness": found.stiffness, "error": found.error, "std": found.std}
    return SecondReading(ONE_SPRING.name, "another inertia", words, step, figures)
