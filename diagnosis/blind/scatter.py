"""What is found of the scatter between runs, beside the causes: named or not, rightly or falsely, and how wide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from diagnosis.blind.cases import Case
from identification.statistics import Proportion
from tunnel_sim.vocabulary.between_runs import SCATTERED

FACTOR = 1.5
"""Within which a width counts as right: a convention."""

ALL = "all"


@dataclass(frozen=True)
class FoundScatter:
    """What is found of the scatter of one number, or of all of them together.

    Args:
        number: ``wind_speed``, ``spring_stiffness``, ``mechanical_damping`` or ``all``.
        named: where it scatters and nothing is stated, how often that is said.
        false: where it is said to scatter, how often it does not.
        within: where it scatters and nothing is stated, how often the width is right within a factor of 1.5.
        covered: where the width has an interval of 90 % as well, how often that holds the true one.
    """

    number: str
    named: Proportion
    false: Proportion
    within: Proportion
    covered: Proportion

    def to_json_dict(self) -> dict[str, Any]:
        """The shares by name."""
        return {name: getattr(self, name).to_json_dict() for name in ("named", "false", "within", "covered")}


@dataclass(frozen=True)
class ScatterScore:
    """How scatter between runs is dealt with in a set.

    Args:
        by_number: for each number, then for all of them together.
        named_alone: of campaigns without a cause whose runs scatter unstated, those of which that is said, and no
            cause named.
        no_gap: of campaigns without a cause whose scatter is as stated, those in which nothing is named.
        false_alarms: of campaigns whose runs repeat, those of which scatter is named.
        exact: of campaigns whose runs scatter, those whose causes are exactly right; scatter may be named.
        exact_repeating: of campaigns whose runs repeat, those whose causes are exactly right.
    """

    by_number: tuple[FoundScatter, ...]
    named_alone: Proportion
    no_gap: Proportion
    false_alarms: Proportion
    exact: Proportion
    exact_repeating: Proportion

    SHARES = ("named_alone", "no_gap", "false_alarms", "exact", "exact_repeating")

    def to_json_dict(self) -> dict[str, Any]:
        """The shares by name, and those of the numbers."""
        shares: dict[str, Any] = {name: getattr(self, name).to_json_dict() for name in self.SHARES}
        return shares | {"by_number": {one.number: one.to_json_dict() for one in self.by_number}}


def scatter_score(cases: Sequence[Case]) -> ScatterScore:
    """Count what is found of the scatter.

    A distribution that is not the one of the vocabulary, such as a drift, is no part of what is asked of campaigns
    without a cause, or of the widths: what of it is scatter is a matter of taste.
    """
    scattering = [c for c in cases if c.scatter.widths]
    repeating = [c for c in cases if not c.scatter.widths]
    normal = [c for c in scattering if c.scatter.form == "normal"]
    bare = [c for c in normal if c.number == 0]
    return ScatterScore(
        (*(_found([name], normal, repeating) for name in SCATTERED), _found(SCATTERED, normal, repeating)),
        named_alone=Proportion.of(
            [c.causes == () and bool(c.named_scatter) for c in bare if not c.scatter.stated]
        ),
        no_gap=Proportion.of([c.causes == () and not c.named_scatter for c in bare if c.scatter.stated]),
        false_alarms=Proportion.of([bool(c.named_scatter) for c in repeating]),
        exact=Proportion.of([c.right for c in scattering]),
        exact_repeating=Proportion.of([c.right for c in repeating]),
    )


def _found(names: Sequence[str], normal: Sequence[Case], repeating: Sequence[Case]) -> FoundScatter:
    acting = [
        (c, name, c.scatter.widths[name], c.spreads.get(name))
        for c in normal
        if not c.scatter.stated
        for name in names
        if name in c.scatter.widths
    ]
    said = [(c, name) for c in (*normal, *repeating) for name in names if name in c.named_scatter]
    intervals = [(true, *spread["interval"]) for _, _, true, spread in acting if spread is not None]
    return FoundScatter(
        names[0] if len(names) == 1 else ALL,
        named=Proportion.of([name in c.named_scatter for c, name, _, _ in acting]),
        false=Proportion.of([name not in c.scatter.widths for c, name in said]),
        within=Proportion.of(
            [
                spread is not None and true / FACTOR <= spread["width"] <= true * FACTOR
                for _, _, true, spread in acting
            ]
        ),
        covered=Proportion.of([low <= true <= high for true, low, high in intervals if low < high]),
    )
