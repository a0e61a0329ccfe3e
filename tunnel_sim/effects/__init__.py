"""The unmodelled effects: each is defined once and serves injection, fitting and reports."""

from __future__ import annotations

from collections.abc import Mapping

from tunnel_sim.effects.base import Effect, make_effect
from tunnel_sim.effects.chain import EffectChain
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.effects.registry import ALL_EFFECTS, effect_class, known_effects, register_effect


def the_effect(**traits: object) -> type[Effect]:
    """The class of the only built-in effect with given traits.

    Args:
        **traits: as listed in `Effect`.

    Raises:
        LookupError: when there is none, or more than one.
    """
    found = [kind for kind in ALL_EFFECTS if all(getattr(kind, t) == v for t, v in traits.items())]
    if len(found) != 1:
        raise LookupError(f"{len(found)} effects have the traits {traits}")
    return found[0]


def effect_from(name: str, parameters: Mapping[str, float]) -> Effect:
    """An effect by name.

    Args:
        name: such as ``coulomb_friction``.
        parameters: by name, in their units; the others take their defaults.

    Raises:
        TunnelError: when a name is unknown or a value out of range.
    """
    return make_effect(effect_class(name), parameters)


__all__ = [
    "ALL_EFFECTS",
    "Effect",
    "EffectChain",
    "ParameterInfo",
    "effect_class",
    "effect_from",
    "known_effects",
    "register_effect",
    "the_effect",
]
