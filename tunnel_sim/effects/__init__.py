"""The unmodelled effects: each is defined once and serves injection, fitting and reports."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules

from tunnel_sim.effects.base import Effect, make_effect
from tunnel_sim.effects.chain import EffectChain
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean


def _found() -> tuple[type[Effect], ...]:
    """The effects that this package's modules define, by their place."""
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    defined = {
        kind
        for module in modules
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, Effect) and kind.__module__ == module.__name__
    }
    return tuple(sorted(defined - {Effect}, key=lambda kind: kind.place))


#: Every effect, in the order of the vocabulary: a module of this package that defines one is enough.
ALL_EFFECTS: tuple[type[Effect], ...] = _found()


def effect_class(name: str) -> type[Effect]:
    """The class of the effect with a given name.

    Args:
        name: such as ``coulomb_friction``.

    Raises:
        TunnelError: when there is none; the message suggests the closest name.
    """
    for kind in ALL_EFFECTS:
        if kind.name == name:
            return kind
    raise TunnelError(
        f"unknown effect {name!r}", remedy=did_you_mean(name, [kind.name for kind in ALL_EFFECTS])
    )


def the_effect(**traits: object) -> type[Effect]:
    """The class of the only effect with given traits.

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
    "the_effect",
]
