"""Success in finding scatter between runs: whether it is named rightly or falsely, and its width."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from identification.statistics import Proportion
from tunnel_lab.experiments.blind.cases import Case
from tunnel_sim.vocabulary.between_runs import SCATTERED

FACTOR = 1.5
"""Factor within which a width counts as right: a convention."""

ALL = "all"


@dataclass(frozen=True)
class FoundScatter:
    """Success in finding the scatter of one quantity, or of all together.

    Args:
        number: ``wind_speed``, ``spring_stiffness``, ``mechanical_damping`` or ``all``.
        named: share of the cases with unstated scatter in which it is named.
        false: share of the cases with named scatter that have none.
        within: share of the cases with unstated scatter in which the width is right within a factor of 1.5.
        covered: share of the widths with a 90 % interval that contains the true width.
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
    """Success with scatter between runs in a set.

    Args:
        by_number: for each quantity, then for all together.
        named_alone: scatter and no cause named, of campaigns without a cause and with unstated scatter.
        no_gap: no effect named, of campaigns without a cause and with scatter as stated.
        false_alarms: scatter named, of campaigns with runs that repeat.
        exact: causes exactly right, of campaigns with runs that scatter; scatter may be named.
        exact_repeating: causes exactly right, of campaigns with runs that repeat.
    """

    by_number: tuple[FoundScatter, ...]
    named_alone: Proportion
    no_gap: Proportion
    false_alarms: Proportion
    exact: Proportion
    exact_repeating: Proportion

    SHARES = ("named_alone", "no_gap", "false_alarms", "exact", "exact_repeating")

    def to_json_dict(self) -> dict[str, Any]:
        """The shares by name, and by quantity."""
        shares: dict[str, Any] = {name: getattr(self, name).to_json_dict() for name in self.SHARES}
        return shares | {"by_number": {one.number: one.to_json_dict() for one in self.by_number}}


def scatter_score(cases: Sequence[Case]) -> ScatterScore:
    """Count the scatter found.

    Distributions outside the vocabulary, such as a drift, are excluded from campaigns without a cause and from
    the
    widths: the part of them that is scatter is a matter of convention.
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
    intervals = [(true, *spread.interval) for _, _, true, spread in acting if spread is not None]
    return FoundScatter(
        names[0] if len(names) == 1 else ALL,
        named=Proportion.of([name in c.named_scatter for c, name, _, _ in acting]),
        false=Proportion.of([name not in c.scatter.widths for c, name in said]),
        within=Proportion.of(
            [
                spread is not None and true / FACTOR <= spread.width <= true * FACTOR
                for _, _, true, spread in acting
            ]
        ),
        covered=Proportion.of([low <= true <= high for true, low, high in intervals if low < high]),
    )
