"""The causes in words: first the certain ones, then the open ones; their sizes and consequences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from diagnosis.findings.candidates import Candidate
from diagnosis.findings.spring_choices import choices_of_spring, count_of_springs, one_of_springs
from diagnosis.findings.terms import BETWEEN_RUNS, scattering, without_scatter
from diagnosis.search.rivals.two_springs import SpringError
from identification.show.numbers import (
    for_people,
    listed,
    plain,
    probability,
    unit_mark,
)
from identification.show.quantity import Quantity
from tunnel_sim.effects import known_effects


@dataclass(frozen=True)
class NamedCauses:
    """The causes of an answer and their rivals.

    Args:
        causes: effect names, sorted.
        ambiguous_with: effects that the runs cannot distinguish from the causes.
        candidates: the answers considered, the answer first.
        inclusion: by effect, the probability that it is among the causes.
        choices: springs of which one may have a wrong stiffness.
        robot: whether the body is the joint of a machine.
        rivals_from: minimum probability of a rival that is named.
    """

    causes: tuple[str, ...]
    ambiguous_with: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    inclusion: Mapping[str, float]
    choices: tuple[SpringError, ...]
    robot: bool
    rivals_from: float

    def known_and_open(self, *, sized: bool = True) -> str:
        """The causes common to the likely answers, each with its probability, and the alternatives beside them.

        Args:
            sized: whether the possible errors of the springs are given; False where another sentence gives
                them.

        Returns:
            Text such as ``coulomb friction (98 %), and either a spring of 16.12 N m/rad that is 1.96 % softer
            than stated (59 %) or gravity stiffness (40 %)``.
        """
        certain, alternatives = self.certain_and_open(sized=sized)
        scatter = [BETWEEN_RUNS] if scattering(self.causes) else []
        known = (
            listed([*(f"{plain(name)} ({self.included(name)})" for name in certain), *scatter])
            if certain
            else ""
        )
        if known and len(alternatives) == 1:
            return known
        several = [f"{said} ({probability(value)})" for said, value in alternatives]
        if len(several) == 2:
            one_of = f"either {several[0]} or {several[1]}"
        else:
            one_of = f"one of these: {', '.join(several[:-1])} or {several[-1]}"
        return f"{known}, and {one_of}" if known else one_of

    def said_size(self, candidate: Candidate, name: str, *, deviations: bool = True) -> str:
        """The size of an effect of an answer in words; empty for an effect without a phrase.

        Args:
            candidate: the answer.
            name: name of the effect.
            deviations: whether standard deviations are stated.
        """
        kind = {kind.name: kind for kind in known_effects()}.get(name)
        given = _parameters(candidate, name)
        if kind is None or not given:
            return ""
        if kind.chosen_spring() and self.choices:
            return f"{one_of_springs(self.choices)}, {choices_of_spring(self.choices)}"
        values = {full: one.value for full, one in given.items()}
        said = {info.unit: given[info.name].unit for info in kind.parameters() if info.name in given}

        def text(value: float, std: float | None, unit: str) -> str:
            # moments are per unit inertia where no inertia is stated
            return for_people(value, std, said.get(unit, unit))

        stds = {full: one.std if deviations else None for full, one in given.items()}
        return kind.phrase(values, stds, text)

    def advice(self, name: str) -> str:
        """The remedy of a cause, with the values that it names, without a full stop."""
        kind = {kind.name: kind for kind in known_effects()}.get(name)
        said = "" if kind is None else (self.robot and kind.advice_for_joint) or kind.advice
        if not said:
            return f"Repair or model the cause of {plain(name)}"
        values = _parameters(self.candidates[0], name)
        for full, one in values.items():
            # the inertia is stated or estimated
            value = f"{one.value:g}" if one.std == 0.0 else f"{one.value:.4g}"
            said = said.replace(f"{{{full}}}", f"{value} {unit_mark(one.unit)}")
        return said

    def certain_and_open(self, *, sized: bool = True) -> tuple[list[str], list[tuple[str, float]]]:
        """Effects common to all likely answers, and the further effects of each answer with its probability.

        Causes detected in the records before the fits are part of every answer.
        """
        least = self.rivals_from
        first, *others = self.candidates
        causes = without_scatter(self.causes)
        named = {*self.causes, *self.ambiguous_with}
        read_off = [name for name in causes if name not in first.effect.split(" + ")]
        proper = {one.effect: without_scatter(sorted(_effects(one))) for one in others}
        likely = [one for one in others if one.probability >= least and named.issuperset(proper[one.effect])]
        sets = [(first, causes), *((one, [*read_off, *proper[one.effect]]) for one in likely)]
        certain = [name for name in causes if all(name in names for _, names in sets)]
        alternatives = []
        for one, names in sets:
            own = [self._called(one, name, sized) for name in names if name not in certain]
            own += [BETWEEN_RUNS] if scattering(_effects(one)) and not scattering(self.causes) else []
            alternatives.append((listed(own) if own else "nothing else", one.probability))
        return certain, alternatives

    def _called(self, candidate: Candidate, name: str, sized: bool) -> str:
        """The name of an effect; for a spring error, the spring and its relative error."""
        kind = {kind.name: kind for kind in known_effects()}.get(name)
        if kind is None or not kind.chosen_spring():
            return plain(name)
        if self.choices:
            each = f", {choices_of_spring(self.choices)}" if sized else ""
            return f"an error of one of the {count_of_springs(self.choices)} springs{each}"
        return self.said_size(candidate, name).partition(" (")[0] or plain(name)

    def included(self, name: str) -> str:
        """The probability that an effect is among the causes, in any combination."""
        return probability(self.inclusion.get(name, self.candidates[0].probability))


def _effects(candidate: Candidate) -> set[str]:
    return set(candidate.effect.split(" + "))


def _parameters(candidate: Candidate, name: str) -> dict[str, Quantity]:
    """The parameters of one effect of an answer, without the effect's name."""
    alone = candidate.effect == name
    return {
        full.rpartition(".")[2]: given
        for full, given in candidate.parameters.items()
        if full.partition(".")[0] == name or (alone and "." not in full)
    }
