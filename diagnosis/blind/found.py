"""True causes found and false ones named, by number of causes and by circumstances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from diagnosis.attribution.decide import UNKNOWN
from diagnosis.blind.cases import Case
from identification.statistics import Proportion

MIDDLE = (1.0 / 3.0, 3.0)
"""Time scales of the middle rigs: about a third of those drawn evenly in the logarithm from 1/30 to 30."""

GROUPS: dict[str, Callable[[Case], bool]] = {
    "none acts": lambda c: c.number == 0,
    "one cause": lambda c: c.number == 1,
    "two causes": lambda c: c.number == 2,
    "three causes": lambda c: c.number == 3,
    "four causes": lambda c: c.number == 4,
    "none acts, coloured noise": lambda c: c.number == 0 and c.coloured,
    "none acts, rounded or jittered stamps": lambda c: c.number == 0 and c.stamps != "even",
    "outside the vocabulary": lambda c: c.truth == UNKNOWN,
    "small causes beside": lambda c: bool(c.small),
    "coloured noise": lambda c: c.coloured,
    "rounded stamps": lambda c: c.stamps == "rounded",
    "jittered stamps": lambda c: c.stamps == "jittered",
    "few runs": lambda c: c.few_runs,
    "fast rigs": lambda c: c.time_scale < MIDDLE[0],
    "middle rigs": lambda c: MIDDLE[0] <= c.time_scale <= MIDDLE[1],
    "slow rigs": lambda c: c.time_scale > MIDDLE[1],
    "all": lambda _: True,
}


@dataclass(frozen=True)
class Found:
    """How well the causes of some campaigns were found.

    Args:
        group: which campaigns.
        exact: campaigns whose causes are exactly right.
        found: of the true causes that matter, those named.
        false: of the causes named, those that do not act. Small ones that act are not counted at all.
        stated_wrongly: campaigns with a decided answer that names a wrong set.
        covered: campaigns whose true causes are in the smallest set of answers that together have 0.9.
        credible_size: mean number of answers in these sets; 0 where there are none.
    """

    group: str
    exact: Proportion
    found: Proportion
    false: Proportion
    stated_wrongly: Proportion
    covered: Proportion
    credible_size: float

    def to_json_dict(self) -> dict[str, Any]:
        """The shares by name, and ``credible_size``."""
        shares = ("exact", "found", "false", "stated_wrongly", "covered")
        found: dict[str, Any] = {name: getattr(self, name).to_json_dict() for name in shares}
        return found | {"credible_size": self.credible_size}


def found_by_group(cases: Sequence[Case]) -> list[Found]:
    """Causes found by group of campaigns, in the order of ``GROUPS``.

    Args:
        cases: truth and answer of every campaign.
    """
    result = []
    for group, belongs in GROUPS.items():
        inside = [c for c in cases if belongs(c)]
        if inside:
            hits = [name in c.named for c in inside for name in c.truth if c.truth != UNKNOWN]
            wrong = [name not in c.truth for c in inside for name in c.named if name not in c.small]
            covered = [c.covered for c in inside if c.covered is not None]
            sizes = [len(c.decision.credible) for c in inside if c.decision is not None]
            found = Found(
                group,
                exact=Proportion.of([c.right for c in inside]),
                found=Proportion.of(hits),
                false=Proportion.of(wrong),
                stated_wrongly=Proportion.of([c.stated_wrongly for c in inside]),
                covered=Proportion.of(covered),
                credible_size=sum(sizes) / len(sizes) if sizes else 0.0,
            )
            result.append(found)
    return result


def inclusions(cases: Sequence[Case]) -> list[tuple[list[float], list[bool]]]:
    """By campaign, the stated probability that each effect is among the causes, and whether it is.

    Args:
        cases: truth and answer of every campaign.

    Returns:
        Probabilities and flags. Small effects are left out, and so are campaigns without these probabilities.
    """
    result = []
    for c in cases:
        stated = {name: p for name, p in c.answer.get("inclusion", {}).items() if name not in c.small}
        if stated:
            result.append((list(stated.values()), [name in c.truth for name in stated]))
    return result
