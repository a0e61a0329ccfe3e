"""A built-in effect is checked when the vocabulary is made, as one's own is, and has a place of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from tunnel_sim import TunnelError
from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.mechanics import CubicStiffness
from tunnel_sim.effects.registry import built_in, check_kind

NEXT = len(ALL_EFFECTS) + 1


class Base(Effect):
    """What several effects share: no effect itself."""


def made(**changes: Any) -> type[Effect]:
    """An effect like cubic stiffness, with changes; those that are None are not stated."""
    texts = ("channel", "condition", "equation", "signature", "references", "example")
    stated = {"name": "made", **{text: getattr(CubicStiffness, text) for text in texts}, **changes}
    members = {name: value for name, value in stated.items() if value is not None}
    parameter = CubicStiffness.__dataclass_fields__["coefficient"]
    described: dict[str, Any] = {"coefficient": parameter, "__annotations__": {"coefficient": float}}
    return dataclass(frozen=True)(type("Made", (Base,), members | described))


@pytest.mark.parametrize(
    ("place", "reason"), [(None, "no place"), (3, f"the place of {ALL_EFFECTS[2].name}")]
)
def test_a_missing_or_taken_place_is_said_with_the_next(place: int | None, reason: str) -> None:
    with pytest.raises(TunnelError, match=rf"effect zz_made: has {reason} in the .*; write place = {NEXT}$"):
        built_in([*ALL_EFFECTS, made(name="zz_made", place=place)])


@pytest.mark.parametrize("check", [check_kind, lambda kind: built_in([*ALL_EFFECTS, kind])])
@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"channel": "stifness"}, "effect made: unknown channel 'stifness'; use one of"),
        ({"condition": "sometimes"}, "effect made: unknown condition 'sometimes'"),
        ({"equation": None}, "effect made: states no equation; state it in the class"),
        ({"name": None}, "effect Made: states no name"),
        ({"name": "none"}, "effect none: is not a name for an effect"),
    ],
)
def test_an_incomplete_effect_is_refused_alike(
    check: Callable[[type[Effect]], object], changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(TunnelError, match=said):
        check(made(place=NEXT, **changes))


@pytest.mark.parametrize("check", [check_kind, lambda kind: built_in([*ALL_EFFECTS, kind])])
def test_an_effect_without_a_parameter_is_refused_alike(check: Callable[[type[Effect]], object]) -> None:
    @dataclass(frozen=True)
    class Bare(Base):
        name = "bare"
        place = NEXT
        channel, condition = CubicStiffness.channel, CubicStiffness.condition
        equation, signature, references, example = "", "", (), ()

    with pytest.raises(TunnelError, match="effect bare: the first parameter is its severity"):
        check(Bare)


def test_order_is_by_place_whatever_the_order_of_files() -> None:
    assert built_in([Base, *reversed(ALL_EFFECTS), made(place=NEXT)])[:-1] == ALL_EFFECTS
