"""Fields for what can be stated about dropped files, as the options of ``tunnel import``."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import events, ui

from tunnel_lab.bench import preview
from tunnel_lab.bench.parts import show_command
from tunnel_lab.bench.workspace import Session

Changed = Callable[[str, Any], Awaitable[None]]


class ChoicesPart:
    """The fields.

    Args:
        session: whose files they are about.
        columns: names of the columns in the files.
        changed: called with the name of a choice and its new value; None: found from the files.
    """

    def __init__(self, session: Session, columns: list[str], changed: Changed) -> None:
        from tunnel_sim.files.importing.units import UNITS

        self._now = preview.choices_of(session)
        self._changed = changed
        angle = [unit for kind, units in UNITS.items() if kind != "time" for unit in units]
        with ui.element("div").classes("fields"):
            self._select("angle", "Column of the angle", columns, several=True)
            self._select("unit", "Unit of the angle", angle)
            self._select("time", "Column of the times", columns)
            self._select("time_unit", "Unit of the times", list(UNITS["time"]))
            self._number("rate", "Sample rate, where there are no times [Hz]")
            self._number("counts_per_turn", "Counts of an encoder per turn")
            self._text("calibration", "Angle of a voltage, such as 0.1 + 20*V")
            self._number("start", "Leave out samples before [s]")
            self._number("end", "Leave out samples after [s]")
            self._number("rest", "Reading at rest of every run, to be subtracted [rad]")
            self._text("name", "Conditions in the file names, such as S{spring}_V{wind_speed}_*")
            ui.checkbox(
                "Cut records at releases", value=self._now.cut, on_change=lambda e: changed("cut", e.value)
            )
        show_command(
            f"tunnel import {session.uploads}/* --recipe {session.choices} --out {session.campaign} --yes"
        )

    def _select(self, key: str, label: str, options: list[str], *, several: bool = False) -> None:
        now = getattr(self._now, key)
        value = list(now) if several else now
        shown = [*options, *(one for one in (value if several else [value]) if one and one not in options)]

        async def change(event: events.ValueChangeEventArguments[Any]) -> None:
            await self._changed(key, event.value or (() if several else None))

        ui.select(shown, label=label, value=value, multiple=several, clearable=True, on_change=change).props(
            "dense"
        )

    def _number(self, key: str, label: str) -> None:
        async def change() -> None:
            await self._changed(key, field.value)

        field = ui.number(label, value=getattr(self._now, key)).props("dense step=any")
        field.on("change", change)

    def _text(self, key: str, label: str) -> None:
        async def change() -> None:
            await self._changed(key, field.value or None)

        field = ui.input(label, value=getattr(self._now, key) or "").props("dense")
        field.on("change", change)
