"""The vocabulary's order: an effect without a place of its own is refused with the next one."""

from __future__ import annotations

import pytest

from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.registry import in_order

NEXT = len(ALL_EFFECTS) + 1


class Without(Effect):
    """An effect whose author does not know of places."""

    name = "without"


class Taken(Without):
    """One that has the place of another."""

    name = "zz_taken"
    place = 3


class Base(Effect):
    """What several effects share: no effect itself."""


@pytest.mark.parametrize(
    ("kind", "reason"), [(Without, "no place"), (Taken, f"the place of {ALL_EFFECTS[2].name}")]
)
def test_a_missing_or_taken_place_is_said_with_the_next(kind: type[Effect], reason: str) -> None:
    with pytest.raises(TypeError, match=rf"{kind.__name__} has {reason} .*: write place = {NEXT}$"):
        in_order([*ALL_EFFECTS, kind])


def test_order_is_by_place_whatever_the_order_of_files() -> None:
    assert in_order([Base, *reversed(ALL_EFFECTS)]) == ALL_EFFECTS
