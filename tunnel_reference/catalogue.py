"""The definition of a form of an effect: family, law, and how its parameters are drawn and bound to runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tunnel_reference.conditions import Array, Conditions
from tunnel_reference.readings import ReadingTerm
from tunnel_reference.terms import Term

Extra = Mapping[str, float]
Draw = Callable[[np.random.Generator, Conditions], dict[str, float]]
Bound = Term | ReadingTerm
Bind = Callable[[float, Extra, Conditions], tuple[Conditions, Bound | None]]


class Group(StrEnum):
    """How far a form is from the textbook."""

    TEXTBOOK = "textbook"
    COMMON = "common"
    RARE = "rare"  # not in tuning sets


def nothing(_rng: np.random.Generator, _conditions: Conditions) -> dict[str, float]:
    """No secondary parameters."""
    return {}


@dataclass(frozen=True, eq=False)
class Form:
    """One form of one family of effects.

    Args:
        family: public name of the effect, or ``unknown``.
        symbol: of its severity parameter, with unit.
        start: a typical magnitude of the severity parameter.
        bind: (severity parameter, secondary parameters, conditions) → changed conditions and term.
        signs: possible signs of the severity parameter.
        draw: draws secondary parameters, including random seeds.
        limits: least and greatest magnitude of the severity parameter.
    """

    family: str
    name: str
    group: Group
    symbol: str
    start: float
    bind: Bind
    signs: tuple[int, ...] = (1,)
    draw: Draw = nothing
    limits: tuple[float, float] = (1e-9, 1e9)


def spread(value: float | Array, conditions: Conditions) -> Array:
    """A parameter as one value per run."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (conditions.runs,)).copy()
