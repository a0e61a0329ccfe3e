"""Effects by expression, read from a TOML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tunnel_sim.effects.base import Effect
from tunnel_sim.effects.expression_effect import Quantity, expression_effect
from tunnel_sim.vocabulary.errors import TunnelError, shown

if TYPE_CHECKING:
    from tunnel_sim.files.effects_schema import OwnEffectTable


def read_effects(path: Path) -> tuple[type[Effect], ...]:
    """The effects of an effects file.

    Args:
        path: as described in docs/how-to/add-an-effect.md.

    Returns:
        Their classes in the file's order; they are not registered.

    Raises:
        TunnelError: for the first fault, with its place.
    """
    from tunnel_sim.files.effects_schema import read_effect_tables  # only here: slow to load

    tables = read_effect_tables(path)
    names = [table.name for table in tables]
    found = []
    for table in tables:
        where = f"{shown(path)}, effect '{table.name}'"
        if names.count(table.name) > 1:
            raise TunnelError("is given twice", where=where, remedy="give every effect its own name")
        try:
            found.append(_effect(table))
        except TunnelError as error:
            raise TunnelError(error.what, where=where, remedy=error.remedy) from error
    return tuple(found)


def _effect(table: OwnEffectTable) -> type[Effect]:
    severity = next(iter(table.parameters))
    quantities = {}
    for name, given in table.parameters.items():
        usual = 0.0 if name == severity else given.scale
        default = usual if given.default is None else given.default
        quantities[name] = Quantity(
            given.unit, given.scale, given.lower, given.upper, default, given.meaning or f"parameter {name}"
        )
    return expression_effect(
        table.name,
        channel=table.channel,
        condition=table.condition,
        moment=table.moment,
        reading=table.reading,
        summary=table.summary,
        parameters=quantities,
    )
