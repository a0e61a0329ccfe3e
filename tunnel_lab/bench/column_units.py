"""The columns of dropped files: meaning, use, and fields for their units."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from nicegui import events, ui

from tunnel_lab.bench.preview import choices_of, files_of, points
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.vocabulary.errors import TunnelError, counted

if TYPE_CHECKING:
    from tunnel_sim.files.importing.columns import RunColumns
    from tunnel_sim.files.importing.tables import Channel, Table

MOST_COLUMNS = 8
"""Maximum number of raw columns drawn."""
READINGS = ("angle", "counts", "voltage", "rate", "acceleration")
"""Kinds of units that a reading may have."""
Role = Literal["time", "angle", "condition", "input"]


def _tables(session: Session) -> Iterator[tuple[Path, Sequence[Table]]]:
    """The tables of the files that can be read."""
    from tunnel_sim.files.importing.source import read_source

    for path in files_of(session):
        try:
            tables = read_source(path, choices_of(session)).tables
        except TunnelError:
            continue
        yield path, tables


def raw_columns(session: Session) -> list[tuple[str, str, list[float], list[float | None]]]:
    """The columns of the first readable table, unchanged.

    Returns:
        Name, unit (if stated), row numbers and values of each numeric column; as many columns as can be drawn.
    """
    import numpy as np

    for _, tables in _tables(session):
        shown = []
        for channel in tables[0].channels[:MOST_COLUMNS] if tables else ():
            if channel.values.size > 1 and np.isfinite(channel.values).any():
                rows = np.arange(channel.values.size, dtype=np.float64)
                shown.append((channel.name, channel.unit, *points(rows, channel.values)))
        if shown:
            return shown
    return []


def column_names(session: Session) -> list[str]:
    """Names of the columns in the dropped files; empty if a file cannot be read."""
    found = list(_tables(session))
    if len(found) < len(files_of(session)):
        return []
    return list(
        dict.fromkeys(channel.name for _, tables in found for table in tables for channel in table.channels)
    )


@dataclass(frozen=True)
class Column:
    """A column of the dropped files: its actual or possible meaning, whether it is used, and its unit if known."""

    name: str
    unit: str
    source: str
    role: Role
    used: bool

    @property
    def units(self) -> list[str]:
        """The units that the user can state for the column; none if only the file can state the unit."""
        from tunnel_sim.files.importing.units import UNITS
        from tunnel_sim.vocabulary.freedom import DISPLACEMENT

        kinds = {"time": ("time",), "angle": READINGS}.get(self.role, ())
        own = DISPLACEMENT.units.values() if self.role == "angle" else ()
        return [unit for units in (*(UNITS[kind] for kind in kinds), *own) for unit in units]

    def stating(self, unit: str | None) -> dict[str, Any]:
        """The choices that state one of the column's `units`; an unused column is thereby chosen."""
        key = "time_unit" if self.role == "time" else "unit"
        if self.used or unit is None:
            return {key: unit}
        return {key: unit, self.role: self.name if self.role == "time" else (self.name,)}


def columns_of(session: Session) -> list[Column]:
    """The columns of all readable dropped files, each name once."""
    from tunnel_sim.files.importing.columns import find_pairs

    choices = choices_of(session)
    found: dict[str, Column] = {}
    for path, tables in _tables(session):
        for table in tables:
            try:
                pairs = find_pairs(table, choices, path.name)
            except TunnelError:  # it has to be chosen first
                pairs = []
            for channel in table.channels:
                found.setdefault(channel.name, _column(channel, table.channels, pairs, choices))
    return list(found.values())


def _column(
    channel: Channel, channels: Sequence[Channel], pairs: list[RunColumns], choices: ImportChoices
) -> Column:
    import numpy as np

    from tunnel_sim.files.importing.column_names import is_time, named_kind
    from tunnel_sim.files.importing.column_numbers import guessed_angle_unit, guessed_time_unit
    from tunnel_sim.files.importing.condition_names import condition_of
    from tunnel_sim.files.importing.inputs import stated_input
    from tunnel_sim.files.importing.tables import is_input
    from tunnel_sim.vocabulary.freedom import column_unit

    role: Role
    if any(channel is pair.time.channel for pair in pairs) or (not pairs and is_time(channel)):
        role, used, stated = "time", True, choices.time_unit
    elif condition_of(channel.name, channel.unit) is not None:
        return Column(channel.name, channel.unit, "a condition of the runs", "condition", True)
    elif is_input(channel) or channel is stated_input(channels, choices):
        return Column(channel.name, channel.unit, "the input of a driven run", "input", True)
    else:
        used = any(channel is pair.reading.channel for pair in pairs)
        role, stated = "angle", choices.unit if used else None
    if stated is not None:
        return Column(channel.name, stated, "stated here", role, used)
    if unit := channel.unit or (column_unit(channel.name) if role == "angle" else ""):
        return Column(channel.name, unit, "stated in the file", role, used)
    if not np.isfinite(channel.values).any():
        return Column(channel.name, "", "it has no numbers", role, used)
    if role == "angle" and (kind := named_kind(channel.name)):
        return Column(channel.name, "", f"{kind} by its name; nothing states its unit", role, used)
    guess = guessed_time_unit if role == "time" else guessed_angle_unit
    unit, size = guess(channel.values)
    what = f"steps of {size:.4g}" if role == "time" else f"a swing of ±{size:.4g}"
    return Column(channel.name, unit, f"guessed from {what}", role, used)


def show_columns(columns: list[Column], state: Callable[[dict[str, Any]], Awaitable[None]]) -> None:
    """A field for the unit of each of the first columns; a changed unit calls ``state`` with the choices."""
    with ui.element("div").classes("fields wide"):
        for column in columns[:MOST_COLUMNS]:
            units = column.units
            if column.unit not in units:  # the unit in the file, neither of a time nor of an angle
                units = [*units, *([column.unit] if column.unit else [])]

            async def change(event: events.ValueChangeEventArguments[Any], column: Column = column) -> None:
                await state(column.stating(event.value))

            source, use = column.source, "not read; a unit chosen here makes it the angle"
            if column.used:
                use = {"time": "read as the times", "angle": "read as the angle"}.get(column.role, "")
            elif column.unit:  # the field is empty, so that this unit can be chosen as well
                source = f"{column.unit}, {source}"
            value = column.unit if column.used and column.unit else None
            label = f"Unit of {column.name}"
            field = ui.select(units, label=label, value=value, clearable=True, on_change=change).props(
                "dense"
            )
            field.props["hint"] = "; ".join(filter(None, (source, use)))
            if not column.units:
                field.props("disable")
    if len(columns) > MOST_COLUMNS:
        ui.label(f"{counted(len(columns) - MOST_COLUMNS, 'more column')} not shown.").classes("soft")
