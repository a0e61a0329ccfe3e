"""The columns of dropped files as they are, with the unit of each: stated in the file, stated here, or guessed."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from nicegui import events, ui

from tunnel_lab.bench.preview import MOST_COLUMNS, choices_of, files_of
from tunnel_lab.bench.workspace import Session
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.files.importing.columns import ColumnPair
    from tunnel_sim.files.importing.conditions import ImportChoices
    from tunnel_sim.files.importing.tables import Channel

READINGS = ("angle", "counts", "voltage", "rate", "acceleration")
"""Kinds of unit that a reading may have."""
Role = Literal["time", "angle", "condition", "input"]
Stated = Callable[[dict[str, Any]], Awaitable[None]]


@dataclass(frozen=True)
class Column:
    """A column of the dropped files.

    Args:
        unit: of its numbers; empty where the column has none that is known.
        source: where the unit is from, in words.
        role: what the column is, or would be.
        used: whether it is read now as what it is.
    """

    name: str
    unit: str
    source: str
    role: Role
    used: bool

    @property
    def units(self) -> list[str]:
        """The units that can be stated for it; none where the file alone can."""
        from tunnel_sim.files.importing.tables import UNITS

        kinds = {"time": ("time",), "angle": READINGS}.get(self.role, ())
        return [unit for kind in kinds for unit in UNITS[kind]]

    def stating(self, unit: str | None) -> dict[str, Any]:
        """The choices that state its unit.

        Args:
            unit: one of `units`; None: found from the files.

        Returns:
            By field of `ImportChoices`. A column that is not used is then the one to use.
        """
        key = "time_unit" if self.role == "time" else "unit"
        if self.used or unit is None:
            return {key: unit}
        return {key: unit, self.role: self.name if self.role == "time" else (self.name,)}


def columns_of(session: Session) -> list[Column]:
    """The columns of all dropped files that can be read, each name once."""
    from tunnel_sim.files.importing.columns import find_pairs
    from tunnel_sim.files.importing.source import read_source

    choices = choices_of(session)
    found: dict[str, Column] = {}
    for path in files_of(session):
        try:
            tables = read_source(path, choices).tables
        except TunnelError:
            continue
        for table in tables:
            try:
                pairs = find_pairs(table, choices, path.name)
            except TunnelError:  # it has to be chosen first
                pairs = []
            for channel in table.channels:
                found.setdefault(channel.name, _column(channel, pairs, choices))
    return list(found.values())


def _column(channel: Channel, pairs: list[ColumnPair], choices: ImportChoices) -> Column:
    import numpy as np

    from tunnel_sim.files.importing.columns import guessed_angle_unit, guessed_time_unit, is_stated, is_time
    from tunnel_sim.files.importing.conditions import condition_of
    from tunnel_sim.files.importing.tables import is_input

    role: Role
    if any(channel is pair.time for pair in pairs) or (not pairs and is_time(channel)):
        role, used, stated = "time", True, choices.time_unit
    elif condition_of(channel.name, channel.unit) is not None:
        return Column(channel.name, channel.unit, "a condition of the runs", "condition", True)
    elif is_input(channel) or is_stated(channel, choices):
        return Column(channel.name, channel.unit, "the input of a driven run", "input", True)
    else:
        used = any(channel is pair.reading for pair in pairs)
        role, stated = "angle", choices.unit if used else None
    if stated is not None:
        return Column(channel.name, stated, "stated here", role, used)
    if channel.unit:
        return Column(channel.name, channel.unit, "stated in the file", role, used)
    if not np.isfinite(channel.values).any():
        return Column(channel.name, "", "it has no numbers", role, used)
    guess = guessed_time_unit if role == "time" else guessed_angle_unit
    unit, size = guess(channel.values)
    what = f"steps of {size:.4g}" if role == "time" else f"a swing of ±{size:.4g}"
    return Column(channel.name, unit, f"guessed from {what}", role, used)


class ColumnsPart:
    """A field for the unit of each column.

    Args:
        columns: to show; the first few are.
        stated: called with the choices that a changed unit makes.
    """

    def __init__(self, columns: list[Column], stated: Stated) -> None:
        self._stated = stated
        with ui.element("div").classes("fields wide"):
            for column in columns[:MOST_COLUMNS]:
                self._field(column)
        if len(columns) > MOST_COLUMNS:
            ui.label(f"{len(columns) - MOST_COLUMNS} more columns are not shown.").classes("soft")

    def _field(self, column: Column) -> None:
        units = column.units
        if column.unit not in units:  # the unit of the file, which is not one of a time or an angle
            units = [*units, *([column.unit] if column.unit else [])]

        async def change(event: events.ValueChangeEventArguments[Any]) -> None:
            await self._stated(column.stating(event.value))

        reads = {"time": "read as the times", "angle": "read as the angle"}.get(column.role, "")
        source = column.source
        if not column.used and column.unit:  # the field is empty, so that this unit can be chosen too
            source = f"{column.unit}, {source}"
        use = reads if column.used else "not read; a unit chosen here makes it the angle"
        hint = "; ".join(filter(None, (source, use)))
        value = column.unit if column.used and column.unit else None
        field = ui.select(
            units, label=f"Unit of {column.name}", value=value, clearable=True, on_change=change
        ).props("dense")
        field.props["hint"] = hint
        if not column.units:
            field.props("disable")
