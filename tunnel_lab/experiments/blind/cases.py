"""A campaign's truth and answer, and the causes found and false."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from diagnosis.answer.run_deviations import Spread
from diagnosis.findings.decision import Decision
from diagnosis.findings.terms import SCATTERS
from diagnosis.findings.whole import Findings
from diagnosis.search.answer import UNKNOWN
from identification.show.quantity import Quantity
from identification.statistics import Proportion
from tunnel_sim.effects import known_effects
from tunnel_sim.effects.capabilities import OutOfPhase
from tunnel_sim.files.toml_input import NotNegative
from tunnel_sim.vocabulary.between_runs import SCATTERED

_KINDS = ("none", "single", "pair", "three", "four")
NAMES = ("cn_beta", "cn_r")
MODERATE = (1.0, 10.0)
"""Excess of a moderate gap: 1 to 10 noise variances."""


class ScaleTable(BaseModel):
    """The scale of a rig."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    time: float = Field(default=1.0, description="time over the standard rig's, a ratio")


class CampaignTruth(BaseModel):
    """The scored part of a truth, as the key states it; the rest is ignored."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    effects: list[str] = Field(description="effects that act and are to be found")
    small: list[str] = Field(default=[], description="effects that act but need not be found")
    severity: float | None = Field(
        default=None, description="excess of the nominal model as a ratio to the noise variance"
    )
    cn_beta: float | None = Field(default=None, description="Cnβ, 1/rad")
    cn_r: float | None = Field(default=None, description="Cnr, 1/rad")
    in_phase: dict[str, float] = Field(
        default={},
        description="with a lag of the air, Cnβ and Cnr in phase with angle and rate (decision 0004)",
    )
    scatter: dict[str, NotNegative] = Field(
        default={}, description="relative standard deviations between the runs, by quantity"
    )
    scatter_level: str = Field(default="", description="level of these widths, such as small")
    scatter_form: str = Field(default="normal", description="form of their distribution")
    repeatability: dict[str, NotNegative] = Field(
        default={}, description="widths that the campaign states, relative, by quantity"
    )
    scale: ScaleTable = ScaleTable()
    few_runs: bool = Field(default=False, description="whether there are few springs and speeds")
    coloured_share: float = Field(default=0.0, description="share of coloured noise in the sensor's variance")
    stamps: str = Field(default="even", description="even, rounded or jittered")


@dataclass(frozen=True)
class ScoredAnswer:
    """An answer to be scored: of `diagnose`, or of another method.

    Args:
        causes: effect names; None: there is no answer.
        ambiguous_with: effects that the runs cannot distinguish from the causes.
        probabilities: probabilities of the weighed answers, by their effects.
        decision: decision on these answers; None if there is none.
        inclusion: by effect, the probability that it is a cause.
        before: coefficients of the nominal model, by name.
        after: coefficients with the causes.
        spreads: scatter between the runs.
        closed: share of the gap that the causes close.
        seconds: time that the answer took, s; None: not known.
    """

    causes: tuple[str, ...] | None = None
    ambiguous_with: tuple[str, ...] = ()
    probabilities: Mapping[str, float] = field(default_factory=dict)
    decision: Decision | None = None
    inclusion: Mapping[str, float] = field(default_factory=dict)
    before: Mapping[str, Quantity] = field(default_factory=dict)
    after: Mapping[str, Quantity] = field(default_factory=dict)
    spreads: tuple[Spread, ...] = ()
    closed: float = 0.0
    seconds: float | None = None

    @classmethod
    def of(cls, found: Findings, seconds: float | None = None) -> ScoredAnswer:
        """The answer of a diagnosis."""
        return cls(
            causes=found.causes,
            ambiguous_with=found.ambiguous_with,
            probabilities={one.effect: one.probability for one in found.candidates},
            decision=found.decision if found.candidates else None,
            inclusion=found.inclusion,
            before=found.coefficients.before,
            after=found.coefficients.after,
            spreads=found.repeated.spreads,
            closed=found.gap.closed,
            seconds=seconds,
        )


@dataclass(frozen=True)
class CoefficientError:
    """An estimate minus the truth.

    Args:
        stds: error in stated standard deviations.
        share: error as a share of the truth.
        covered: whether the stated 95 % interval contains the truth.
    """

    stds: float
    share: float
    covered: bool


@dataclass(frozen=True, eq=False)
class Case:
    """One campaign.

    Args:
        stated: truth from the key.
        withheld: whether one of its effects was excluded from the vocabulary, so that the truth is unknown.
        answer: the scored part of the diagnosis.
    """

    name: str
    stated: CampaignTruth
    withheld: bool
    answer: ScoredAnswer

    @property
    def truth(self) -> tuple[str, ...]:
        """True effects, sorted; ``("unknown",)`` outside the vocabulary, empty for none."""
        return UNKNOWN if self.withheld else tuple(sorted(self.stated.effects))

    @property
    def small(self) -> tuple[str, ...]:
        """Effects that act but need not be found, sorted."""
        return tuple(sorted(self.stated.small))

    @property
    def widths(self) -> dict[str, float]:
        """True standard deviations between the runs by quantity, relative; empty where the runs repeat."""
        return {
            name: width for name, width in self.stated.scatter.items() if width > 0.0 and name in SCATTERED
        }

    @property
    def coefficients(self) -> dict[str, float]:
        """True ``cn_beta`` and ``cn_r``, 1/rad; in phase with a lag of the air that the answer does not name."""
        lagging = {kind.name for kind in known_effects() if issubclass(kind, OutOfPhase)}
        drawn = {name: value for name in NAMES if (value := getattr(self.stated, name)) is not None}
        return drawn if lagging & {*(self.answer.causes or ())} else drawn | self.stated.in_phase

    @property
    def causes(self) -> tuple[str, ...] | None:
        """The causes answered, without scatter between runs; None where there is no answer."""
        found = self.answer.causes
        return None if found is None else tuple(name for name in found if name not in SCATTERS)

    @property
    def named_scatter(self) -> frozenset[str]:
        """The quantities said to scatter between the runs."""
        return frozenset(
            {SCATTERS[name] for name in self.answer.causes or () if name in SCATTERS}
            | {number for number, spread in self.spreads.items() if spread.shown}
        )

    @property
    def spreads(self) -> dict[str, Spread]:
        """The answer on the scatter of each quantity."""
        return {SCATTERS[one.effect]: one for one in self.answer.spreads if one.effect in SCATTERS}

    @property
    def right(self) -> bool:
        """Whether the causes are exactly the true ones; small effects may be among them."""
        return self.causes is not None and set(self.causes) - set(self.small) == set(self.truth)

    @property
    def number(self) -> int | None:
        """Number of causes that matter; None outside the vocabulary."""
        return None if self.truth == UNKNOWN else len(self.truth)

    @property
    def named(self) -> tuple[str, ...]:
        """The effects named; none where the answer is ``unknown`` or missing."""
        return () if self.causes in (None, UNKNOWN) else tuple(self.causes or ())

    @property
    def kind(self) -> str:
        """``none``, ``single``, ``pair``, ``three``, ``four``, ``outside`` or ``withheld``."""
        if self.withheld:
            return "withheld"
        if self.truth == UNKNOWN:
            return "outside"
        return _KINDS[min(len(self.truth), 4)]

    @property
    def severity_class(self) -> str:
        """``below 1``, ``1 to 10``, ``above 10`` or, where unknown, empty."""
        if self.stated.severity is None:
            return ""
        if self.stated.severity < MODERATE[0]:
            return "below 1"
        return "1 to 10" if self.stated.severity <= MODERATE[1] else "above 10"

    @property
    def named_rightly(self) -> bool:
        """Whether effects act, and exactly these are named."""
        return self.right and self.truth not in ((), UNKNOWN)

    @property
    def probability(self) -> float | None:
        """Probability of the given answer; None if it is not among the candidates."""
        return self.answer.probabilities.get(" + ".join(self.answer.causes or ()) or "none")

    @property
    def stated_wrongly(self) -> bool:
        """Whether the answer states a wrong set of effects; an undecided answer states none."""
        found = self.answer.decision
        return bool(self.named) and not self.right and (found is None or found.decided)

    @property
    def covered(self) -> bool | None:
        """Whether the true causes are in the smallest set of likely answers; None if there is no answer."""
        found = self.answer.decision
        if found is None:
            return None
        likely = [set(effect.split(" + ")) - {"none", *SCATTERS} for effect, _ in found.credible]
        return any(names - set(self.small) == set(self.truth) for names in likely)

    @property
    def rival(self) -> bool:
        """Whether the true effects were not the answer, but were named as a possible confusion."""
        mentioned = {*(self.causes or ()), *self.answer.ambiguous_with}
        return not self.right and set(self.truth) <= mentioned

    def error(self, name: str, when: str) -> CoefficientError | None:
        """Error of ``cn_beta`` or ``cn_r``, ``before`` or ``after`` the causes are added; None if not stated."""
        found = (self.answer.before if when == "before" else self.answer.after).get(name)
        truth = self.coefficients.get(name)
        if found is None or not truth or not found.std:
            return None
        error, (low, high) = found.value - truth, found.ends
        return CoefficientError(error / found.std, error / abs(truth), low <= truth <= high)


def case(name: str, truth: Mapping[str, Any], said: ScoredAnswer, excluded: Sequence[str] = ()) -> Case:
    """Combine a truth, from the key, and an answer.

    Args:
        excluded: effects withheld from the vocabulary; a truth with one of them is ``unknown``.

    Raises:
        ValueError: when the truth is malformed (pydantic's error, with the place).
    """
    stated = CampaignTruth.model_validate(truth)
    return Case(name, stated, bool(set(stated.effects) & set(excluded)), said)


def label(names: Sequence[str] | None) -> str:
    """An answer or truth in a word: its effect, ``none``, ``unknown``, ``two or more``; ``no answer`` if None."""
    if names is None:
        return "no answer"
    if not names:
        return "none"
    return names[0] if len(names) == 1 else "two or more"


MIDDLE = (1.0 / 3.0, 3.0)
"""Time scales of the middle rigs: about a third of the scales, drawn evenly in the logarithm from 1/30 to 30."""

GROUPS: dict[str, Callable[[Case], bool]] = {
    "none acts": lambda c: c.number == 0,
    "one cause": lambda c: c.number == 1,
    "two causes": lambda c: c.number == 2,
    "three causes": lambda c: c.number == 3,
    "four causes": lambda c: c.number == 4,
    "none acts, coloured noise": lambda c: c.number == 0 and c.stated.coloured_share > 0.0,
    "none acts, rounded or jittered stamps": lambda c: c.number == 0 and c.stated.stamps != "even",
    "outside the vocabulary": lambda c: c.truth == UNKNOWN,
    "small causes beside": lambda c: bool(c.small),
    "coloured noise": lambda c: c.stated.coloured_share > 0.0,
    "rounded stamps": lambda c: c.stated.stamps == "rounded",
    "jittered stamps": lambda c: c.stated.stamps == "jittered",
    "few runs": lambda c: c.stated.few_runs,
    "scatter between runs": lambda c: bool(c.widths),
    "small scatter": lambda c: c.stated.scatter_level == "small",
    "large scatter": lambda c: c.stated.scatter_level == "large",
    "scatter, stated": lambda c: bool(c.stated.repeatability),
    "one cause beside scatter": lambda c: c.number == 1 and bool(c.widths),
    "two causes beside scatter": lambda c: c.number == 2 and bool(c.widths),
    "runs that repeat": lambda c: not c.widths,
    "fast rigs": lambda c: c.stated.scale.time < MIDDLE[0],
    "middle rigs": lambda c: MIDDLE[0] <= c.stated.scale.time <= MIDDLE[1],
    "slow rigs": lambda c: c.stated.scale.time > MIDDLE[1],
    "all": lambda _: True,
}


@dataclass(frozen=True)
class CausesFound:
    """Success in finding the causes of some campaigns.

    Args:
        exact: campaigns with exactly right causes.
        found: proportion of the relevant true causes that are named.
        false: proportion of the named causes that do not act. Small causes that act do not count.
        stated_wrongly: campaigns with a decided answer that names a wrong set.
        covered: campaigns with the true causes in the smallest set of answers that together have probability
            0.9.
        credible_size: mean number of answers in these sets; 0 if there are none.
    """

    exact: Proportion
    found: Proportion
    false: Proportion
    stated_wrongly: Proportion
    covered: Proportion
    credible_size: float


def found_by_group(cases: Sequence[Case]) -> dict[str, CausesFound]:
    """Causes found by group of campaigns, in the order of ``GROUPS``."""
    result = {}
    for group, belongs in GROUPS.items():
        inside = [c for c in cases if belongs(c)]
        if inside:
            hits = [name in c.named for c in inside for name in c.truth if c.truth != UNKNOWN]
            wrong = [name not in c.truth for c in inside for name in c.named if name not in c.small]
            covered = [c.covered for c in inside if c.covered is not None]
            sizes = [len(c.answer.decision.credible) for c in inside if c.answer.decision is not None]
            result[group] = CausesFound(
                exact=Proportion.of([c.right for c in inside]),
                found=Proportion.of(hits),
                false=Proportion.of(wrong),
                stated_wrongly=Proportion.of([c.stated_wrongly for c in inside]),
                covered=Proportion.of(covered),
                credible_size=sum(sizes) / len(sizes) if sizes else 0.0,
            )
    return result


def inclusions(cases: Sequence[Case]) -> list[tuple[list[float], list[bool]]]:
    """By campaign, the stated probability that each effect is among the causes, and whether it is.

    Small effects, scatter between runs, and campaigns without these probabilities are left out.
    """
    result = []
    for c in cases:
        beside = {*c.small, *SCATTERS}
        stated = {name: p for name, p in c.answer.inclusion.items() if name not in beside}
        if stated:
            result.append((list(stated.values()), [name in c.truth for name in stated]))
    return result
