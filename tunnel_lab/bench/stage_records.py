"""The stage Records: what the dropped files hold, what is stated about them, and the campaign that they become."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from nicegui import events, ui

from tunnel_lab.bench import preview
from tunnel_lab.bench.chart import Chart
from tunnel_lab.bench.parts import Fault, Frame, address, button, show_command, show_parts
from tunnel_lab.bench.start import drop_zone, keep
from tunnel_lab.bench.workspace import Session
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.files.importing.records import Imported

_TIME = "time [s], from the record's first sample"
_KINDS = {"start": "release", "end": "rest"}
_HELP = (
    "Drag a mark, or move it with the arrow keys, to where a run is released (circle) or has come to rest "
    "(square). Drag in a chart to zoom; double-click to see all of it."
)


def build(session: Session, frame: Frame) -> None:
    """Build the page."""
    _Records(session, frame)


class _Records:
    """The page: it reads the files again whenever a choice changes."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session, self._frame = session, frame
        self._imported: Imported | None = None
        if not preview.files_of(session):
            _as_it_is(session)
            frame.way_on()
            return
        self._files = ui.element("div")
        self._fault = Fault()
        with ui.element("p").classes("buttons"):
            button("Write the campaign", self._write, main=True)
            if session.imported:
                frame.way_on()
        self._written = Fault()
        self._form_place = ui.expansion("What the files do not say, or was found wrongly").classes("choices")
        self._reading = 0
        self._charts: list[Chart] = []
        self._drawn = ui.element("div")
        self._table = ui.element("div").props("role=status aria-live=polite")
        with self._table:
            ui.label("Reading the files …").classes("soft")
        ui.timer(0.0, self._first, once=True)

    async def _first(self) -> None:
        columns = await asyncio.to_thread(preview.column_names, self._session)
        with self._form_place:
            _Choices(self._session, columns, self._changed)
        self._show_files()
        await self._read()
        if self._imported is None:
            self._form_place.open()

    async def _changed(self, key: str, value: Any) -> None:
        with self._fault.around():
            preview.state(self._session, {key: value})
            await self._read()

    async def _moved(self, mark: preview.Mark, kind: str, at: float) -> None:
        with self._fault.around():
            preview.move(self._session, mark, **{kind: at})
            await self._read(redraw=False)

    async def _read(self, *, redraw: bool = True) -> None:
        """Read the files with the choices as they are; the charts stay where only a mark was moved."""
        self._reading += 1
        mine = self._reading
        imported, error = None, None
        try:
            imported = await asyncio.to_thread(preview.read, self._session)
        except TunnelError as refused:
            error = refused
        if (
            mine != self._reading or self._table.is_deleted
        ):  # a later choice is being read, or the page was left
            return
        self._imported = imported
        self._fault.show(error or "")
        self._table.clear()
        if redraw or imported is None:
            self._drawn.clear()
        if imported is None:
            return
        with self._drawn:
            self._draw(imported)
        with self._table:
            _show(imported)

    def _show_files(self) -> None:
        self._files.clear()
        with self._files:
            names = ", ".join(path.name for path in preview.files_of(self._session))
            ui.label(f"{names}; kept in {self._session.uploads}").classes("soft")
            with ui.expansion("Add files"):
                fault = Fault()

                async def dropped(given: events.MultiUploadEventArguments) -> None:
                    with fault.around():
                        await keep(self._session, given)
                        self._show_files()
                        await self._read()

                drop_zone(dropped, fault)

    def _draw(self, imported: Imported) -> None:
        """Draw the records, or only their marks where they are drawn already."""
        records = preview.drawn(imported)
        if not self._drawn.default_slot.children:
            self._charts = []
            ui.label(_HELP).classes("soft")
            with ui.element("div").classes("charts"):
                self._charts = [self._chart(one) for one in records]
            left = len({id(part.raw) for part in imported.parts}) - len(records)
            if left > 0:
                ui.label(f"{left} more records are not drawn.").classes("soft")
        for chart, one in zip(self._charts, records, strict=True):
            chart.show_marks(*_marks(one))

    def _chart(self, one: preview.Drawn) -> Chart:
        marks = {f"{mark.run} {kind}": (mark, kind) for mark in one.marks for kind in _KINDS}
        label = f"reading [{one.unit}]"
        return Chart(
            one.title,
            _TIME,
            label,
            [("reading", "after")],
            [one.time, one.reading],
            lambda name, at: self._moved(*marks[name], at),
        )

    async def _write(self) -> None:
        with self._written.around():
            if self._imported is None:
                raise TunnelError("the files cannot be read yet", remedy="state what is asked for above")
            await asyncio.to_thread(write, self._session, self._imported)
            ui.navigate.to(address(self._session, "conditions"))


def _marks(one: preview.Drawn) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The runs of a record as marks and resting levels of its chart."""
    marks = [
        {
            "id": f"{mark.run} {kind}",
            "at": getattr(mark, kind),
            "kind": kind,
            "label": f"{words} of {mark.run}",
        }
        for mark in one.marks
        for kind, words in _KINDS.items()
    ]
    return marks, [{"from": mark.start, "to": mark.end, "at": mark.rest} for mark in one.marks]


def _show(imported: Imported) -> None:
    """What was read, as ``tunnel import`` prints it."""
    from tunnel_lab.terminal.import_output import parts_table

    show_parts([parts_table(imported)])
    with ui.element("ul").classes("notes"):
        for line in imported.remarks():
            with ui.element("li"):
                ui.label(line)


def write(session: Session, imported: Imported) -> None:
    """Write the campaign, as ``tunnel import`` does; conditions that were stated before are kept.

    Raises:
        TunnelError: when the folder cannot be written.
    """
    from tunnel_lab.bench import conditions
    from tunnel_lab.plotting.import_figure import import_picture
    from tunnel_sim.files.importing.writing import write_imported

    before = conditions.stated(session) if session.imported else None
    write_imported(imported, session.campaign, overwrite=True, picture=import_picture)
    if before is not None:
        conditions.restore(session, before)


class _Choices:
    """Fields for what can be stated about the files, as the options of ``tunnel import``."""

    def __init__(self, session: Session, columns: list[str], changed: Any) -> None:
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


def _as_it_is(session: Session) -> None:
    """A campaign that was not made of dropped files: its runs, as they are."""
    ui.label(f"The campaign in {session.campaign}, as it is.").classes("soft")
    fault = Fault()
    place = ui.element("div")

    async def show() -> None:
        from tunnel_lab.plotting.import_figure import thinned
        from tunnel_sim.files.campaign_io import read_campaign

        with fault.around():
            campaign = await asyncio.to_thread(read_campaign, session.campaign)
            if place.is_deleted:  # the page was left
                return
            with place.classes("charts"):
                for one in campaign.runs[: preview.MOST_RECORDS]:
                    time, reading = thinned(one.record.time_s, one.record.yaw_rad)
                    label = f"reading [{campaign.sensor.unit}]"
                    Chart(
                        one.id, "time [s]", label, [("reading", "after")], [time.tolist(), reading.tolist()]
                    )

    ui.timer(0.0, show, once=True)
