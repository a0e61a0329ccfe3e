"""The vocabulary by name: built-in effects, registered ones, and the effects of a diagnosis in progress."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TypeVar, cast, get_args

from tunnel_sim.effects import capabilities
from tunnel_sim.effects.base import Effect, make_effect
from tunnel_sim.effects.capabilities import AtRandom, BetweenRuns
from tunnel_sim.effects.traits import Channel, Condition
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.errors import TunnelError, added_to, did_you_mean, loading, one_line

ENTRY_POINTS = "tunnel.effects"
"""Group of the entry points by which an installed package adds effects."""

RESERVED = frozenset({"unknown", "none", "check"})
"""Names that mean something else in an answer or on the command line."""

KindT = TypeVar("KindT", bound=type[Effect])

_registered: dict[str, type[Effect]] = {}
_under_way: ContextVar[tuple[type[Effect], ...]] = ContextVar(
    "effects of the diagnosis under way", default=()
)

_OF_SPECTRUM = 2  # parameters of a random moment
_CAPABILITIES = tuple(
    one
    for one in vars(capabilities).values()
    if isinstance(one, type) and issubclass(one, Effect) and one not in (Effect, BetweenRuns)
)  # of users' effects too


def check_described(kind: object) -> None:
    """Refuse a class that cannot be an effect of the vocabulary, built in or a user's."""
    where = f"effect {one_line(getattr(kind, 'name', getattr(kind, '__qualname__', kind)))}"
    if not (isinstance(kind, type) and issubclass(kind, Effect) and dataclasses.is_dataclass(kind)):
        remedy = "derive it from Effect, and write @dataclass(frozen=True) above it"
        raise TunnelError("is not a dataclass derived from Effect", where=where, remedy=remedy)
    stated = ("name", "channel", "condition", "equation", "signature", "references", "example")
    missing = [text for text in stated if not hasattr(kind, text)]
    if missing:
        raise TunnelError(f"states no {missing[0]}", where=where, remedy="state it in the class")
    if not kind.name.isidentifier() or kind.name in RESERVED:
        raise TunnelError("is not a name for an effect", where=where, remedy="use letters, digits and _")
    for text, allowed in (("channel", get_args(Channel)), ("condition", get_args(Condition))):
        if getattr(kind, text) not in allowed:
            what = f"unknown {text} {getattr(kind, text)!r}"
            raise TunnelError(what, where=where, remedy=f"use one of {', '.join(allowed)}")
    try:
        severity = kind.parameters()[0]
        has_null = severity.default == 0.0 and severity.lower <= 0.0 <= severity.upper
    except (TypeError, LookupError):  # parameters without a description, or none at all
        has_null = False
    if not has_null:
        what = "the first parameter is its severity, whose default must be 0 within its bounds"
        remedy = "declare its parameters with tunnel_sim.effects.parameters.parameter"
        raise TunnelError(what, where=where, remedy=remedy)
    for info in kind.parameters():  # its unit converts the answer
        try:
            dimension(info.unit)
        except TunnelError as error:
            place = f"{where}, parameter {info.name}"
            raise TunnelError(error.what, where=place, remedy=error.remedy) from None
    for one in _CAPABILITIES:
        asked = [hook for hook, of in vars(one).items() if callable(of) and not hasattr(Effect, hook)]
        unasked = [hook for hook in asked if hasattr(kind, hook) and not issubclass(kind, one)]
        if unasked:
            what, remedy = f"has {unasked[0]}, which nothing asks it for", f"derive it from {one.__name__}"
            raise TunnelError(what, where=where, remedy=remedy)
    hooks = {hook for one in (Effect, *_CAPABILITIES) for hook in dir(one)}
    own = sorted(name for name in set(dir(kind)) - hooks if callable(getattr(kind, name)))
    if strange := [name for name in own if name.startswith("on_")]:
        what, remedy = f"has {strange[0]}, which nothing asks it for", "change the physics in on_runs"
        raise TunnelError(what, where=where, remedy=remedy)
    unstated = sorted(
        name for name in dir(kind) if getattr(getattr(kind, name), "__isabstractmethod__", False)
    )
    if unstated:
        raise TunnelError(f"does not state its {unstated[0]}", where=where, remedy=f"override {unstated[0]}")
    if issubclass(kind, AtRandom) and len(kind.parameters()) != _OF_SPECTRUM:
        what = "is a random moment, whose parameters are an intensity and a bandwidth or Strouhal number"
        raise TunnelError(what, where=where, remedy="declare these two")


def built_in(kinds: Iterable[type[Effect]]) -> tuple[type[Effect], ...]:
    """Effects of this package by their place in the vocabulary, with the same checks as users' effects.

    Args:
        kinds: classes; base classes are left out: classes without a name from which others derive, and private
            ones.

    Raises:
        TunnelError: when an effect is not complete, or its place is missing or taken.
    """
    bases = [
        kind
        for kind in kinds
        if not hasattr(kind, "name") and (kind.__subclasses__() or kind.__name__.startswith("_"))
    ]
    stated = [kind for kind in kinds if kind not in bases]
    for kind in stated:
        check_described(kind)
    places: dict[int, type[Effect]] = {}
    following = 1 + max((kind.place for kind in stated if hasattr(kind, "place")), default=0)
    for kind in sorted(stated, key=lambda kind: kind.name):
        place = getattr(kind, "place", None)
        if place is None or place in places:
            other = "no place" if place is None else f"the place of {places[place].name}"
            what = f"has {other} in the vocabulary"
            raise TunnelError(what, where=f"effect {kind.name}", remedy=f"write place = {following}")
        places[place] = kind
    return tuple(places[place] for place in sorted(places))


_room = __name__.rpartition(".")[0]
_names = [f"{_room}.{module.name}" for module in iter_modules([str(Path(__file__).parent)])]
_modules = [import_module(name) for name in _names if name != __name__]
_defined = [
    kind
    for module in _modules
    for kind in vars(module).values()
    if isinstance(kind, type) and issubclass(kind, Effect) and kind.__module__ == module.__name__
]

#: Every built-in effect, in the order of the vocabulary: defining one in a module of this package is enough.
ALL_EFFECTS: tuple[type[Effect], ...] = built_in(_defined)


def known_effects() -> tuple[type[Effect], ...]:
    """All effects that have a name now: the built-in ones, then the registered ones in their order."""
    _load_entry_points()
    own = _registered | {kind.name: kind for kind in _under_way.get()}
    return (*ALL_EFFECTS, *(kind for kind in own.values() if kind not in ALL_EFFECTS))


def register_effect(kind: KindT) -> KindT:
    """Add your own effect to the vocabulary; also as a decorator.

    Args:
        kind: a frozen dataclass derived from `Effect`. It replaces an earlier class of the same name.

    Raises:
        TunnelError: when it has the name of a built-in effect, no severity, or lacks what the vocabulary needs.
    """
    check_kind(kind)
    _registered[kind.name] = kind
    return kind


def check_kind(kind: object) -> None:
    """Refuse a class that cannot be a user's effect."""
    check_described(kind)
    kind = cast("type[Effect]", kind)
    where = f"effect {kind.name}"
    if any(kind.name == one.name and kind is not one for one in ALL_EFFECTS):
        raise TunnelError("is the name of a built-in effect", where=where, remedy="choose another name")
    if issubclass(kind, BetweenRuns):
        what = "differs between runs by chance; effects that do so are built in"
        raise TunnelError(what, where=where, remedy="derive it from another class")


@functools.cache
def _load_entry_points() -> None:
    """Register the effects of installed packages, once."""
    for name, point in added_to(ENTRY_POINTS).items():
        with loading(f"entry point {ENTRY_POINTS}: {name}"):
            register_effect(point.load())


@contextmanager
def answering_with(kinds: Sequence[type[Effect]]) -> Iterator[None]:
    """Within the block, unregistered effects that a diagnosis may answer with are known by name."""
    own = [kind for kind in kinds if kind not in ALL_EFFECTS]
    for kind in own:
        check_kind(kind)
    at_random = [kind for kind in kinds if issubclass(kind, AtRandom)]
    for spectrum in {(kind.random, kind.condition) for kind in at_random if kind in own}:
        same = [kind.name for kind in at_random if (kind.random, kind.condition) == spectrum]
        if len(same) > 1:
            what = f"has the spectrum of {same[0]}, so no run can distinguish them"
            raise TunnelError(what, where=f"effect {same[-1]}", remedy="leave one of them out")
    names = [kind.name for kind in kinds]
    for name in names:
        if names.count(name) > 1:
            raise TunnelError("is given twice", where=f"effect {name}", remedy="give it once")
    token = _under_way.set((*_under_way.get(), *own))
    try:
        yield
    finally:
        _under_way.reset(token)


def effect_class(name: str) -> type[Effect]:
    """The class of the effect with a given name.

    Args:
        name: name such as ``coulomb_friction``.

    Raises:
        TunnelError: when there is no such effect; the message suggests the closest name.
    """
    for kind in known_effects():
        if kind.name == name:
            return kind
    remedy = did_you_mean(name, [kind.name for kind in known_effects()])
    raise TunnelError(f"unknown effect {name!r}", remedy=remedy)


def the_effect(capability: type) -> type[Effect]:
    """The only built-in effect of a type.

    Args:
        capability: type such as `tunnel_sim.effects.capabilities.MainsPickup`.

    Raises:
        LookupError: when there is no such effect, or more than one.
    """
    found = [kind for kind in ALL_EFFECTS if issubclass(kind, capability)]
    if len(found) != 1:
        raise LookupError(f"{len(found)} effects are of type {capability.__name__}")
    return found[0]


def effect_from(name: str, parameters: Mapping[str, float]) -> Effect:
    """An effect by name.

    Args:
        name: name such as ``coulomb_friction``.
        parameters: parameters by name, in their units; the others take their defaults.

    Raises:
        TunnelError: when a name is unknown or a value out of range.
    """
    return make_effect(effect_class(name), parameters)
