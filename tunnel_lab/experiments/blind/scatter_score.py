"""Success in finding scatter between runs: whether it is named rightly or falsely, and its width."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

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
        named: share of the cases with unstated scatter in which it is named.
        false: share of the cases with named scatter that have none.
        within: share of the cases with unstated scatter in which the width is right within a factor of 1.5.
        covered: share of the widths with a 90 % interval that contains the true width.
    """

    named: Proportion
    false: Proportion
    within: Proportion
    covered: Proportion


@dataclass(frozen=True)
class ScatterScore:
    """Success with scatter between runs in a set.

    Args:
        named_alone: scatter and no cause named, of campaigns without a cause and with unstated scatter.
        no_gap: no effect named, of campaigns without a cause and with scatter as stated.
        false_alarms: scatter named, of campaigns with runs that repeat.
        exact: causes exactly right, of campaigns with runs that scatter; scatter may be named.
        exact_repeating: causes exactly right, of campaigns with runs that repeat.
        by_number: for ``wind_speed``, ``spring_stiffness``, ``mechanical_damping``, then for ``all`` together.
    """

    named_alone: Proportion
    no_gap: Proportion
    false_alarms: Proportion
    exact: Proportion
    exact_repeating: Proportion
    by_number: Mapping[str, FoundScatter]


def scatter_score(cases: Sequence[Case]) -> ScatterScore:
    """Count the scatter found.

    Distributions outside the vocabulary, such as a drift, are excluded from campaigns without a cause and from the
    widths: the part of them that is scatter is a matter of convention.
    """
    scattering = [c for c in cases if c.widths]
    repeating = [c for c in cases if not c.widths]
    normal = [c for c in scattering if c.stated.scatter_form == "normal"]
    quantities: dict[str, Sequence[str]] = {**{name: (name,) for name in SCATTERED}, ALL: SCATTERED}
    bare = [c for c in normal if c.number == 0]
    return ScatterScore(
        named_alone=Proportion.of(
            [c.causes == () and bool(c.named_scatter) for c in bare if not c.stated.repeatability]
        ),
        no_gap=Proportion.of(
            [c.causes == () and not c.named_scatter for c in bare if c.stated.repeatability]
        ),
        false_alarms=Proportion.of([bool(c.named_scatter) for c in repeating]),
        exact=Proportion.of([c.right for c in scattering]),
        exact_repeating=Proportion.of([c.right for c in repeating]),
        by_number={name: _found(names, normal, repeating) for name, names in quantities.items()},
    )


def _found(names: Sequence[str], normal: Sequence[Case], repeating: Sequence[Case]) -> FoundScatter:
    acting = [
        (c, name, c.widths[name], c.spreads.get(name))
        for c in normal
        if not c.stated.repeatability
        for name in names
        if name in c.widths
    ]
    said = [(c, name) for c in (*normal, *repeating) for name in names if name in c.named_scatter]
    intervals = [(true, *spread.interval) for _, _, true, spread in acting if spread is not None]
    return FoundScatter(
        named=Proportion.of([name in c.named_scatter for c, name, _, _ in acting]),
        false=Proportion.of([name not in c.widths for c, name in said]),
        within=Proportion.of(
            [
                spread is not None and true / FACTOR <= spread.width <= true * FACTOR
                for _, _, true, spread in acting
            ]
        ),
        covered=Proportion.of([low <= true <= high for true, low, high in intervals if low < high]),
    )
