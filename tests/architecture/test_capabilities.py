"""What one effect alone can do is a type or that effect's own method, not a switch that all effects carry."""

from __future__ import annotations

import inspect

from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.traits import Traits

#: Overridden by one effect, and asked of all: a default that is right for all others. A further one is a type.
OF_ONE = {
    "alike",  # other minima of χ²: a rod's own oscillation
    "forms",  # by default one form of all form parameters
    "is_null",  # by default a severity of zero
    "small_swings",
    "stiffness_at_rest",
    "turns",
    "undetected",  # words
}


def overriding(name: str) -> list[str]:
    """The effects whose class, or a base of it other than that of all effects, states an attribute."""
    return [kind.name for kind in ALL_EFFECTS if inspect.getattr_static(kind, name) is not stated(name)]


def stated(name: str) -> object:
    return inspect.getattr_static(Effect, name)


def test_no_trait_and_no_hook_of_all_effects_is_for_one_alone() -> None:
    names = {name for of in (Traits, Effect) for name in vars(of) if not name.startswith("_")}
    assert {name for name in names if len(overriding(name)) == 1} == OF_ONE
