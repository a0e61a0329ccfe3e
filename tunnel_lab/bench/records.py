"""The stage Records: contents of the dropped files, choices about them, and the campaign made of them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import ui

from tunnel_lab.bench import column_units, preview
from tunnel_lab.bench.parts import (
    Chart,
    Fault,
    Frame,
    address,
    button,
    page_words,
    show_blocks,
    show_command,
    show_items,
)
from tunnel_lab.bench.uploads import drop_zone
from tunnel_lab.bench.workspace import Session, rename
from tunnel_sim.vocabulary.errors import TunnelError, counted

if TYPE_CHECKING:
    from tunnel_sim.files.importing.records import Imported


_TIME = "time of the file [s]"
_MOST_NAMES = 8  # maximum number of runs in a line
_KINDS = {"start": "release", "end": "end", "rest": "rest"}
_HELP = (
    "Drag a mark, or move it with the arrow keys, to where a run is released (circle) or ends (square), and the "
    "dashed line to the angle at which it rests: that angle is then subtracted. Delete on a circle leaves the run "
    "out. Drag in a chart to zoom; double-click to see all of it. A release is added in the middle of the view."
)


class RecordsPage:
    """The page: it reads the files again whenever a choice changes."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session = session
        self._imported: Imported | None = None
        if not preview.files_of(session):
            ui.label(f"The campaign in {session.campaign}, as it is.").classes("soft")
            self._fault, self._drawn = Fault(), ui.element("div")
            ui.timer(0.0, self._draw_runs, once=True)
            with ui.element("p").classes("buttons"):
                frame.way_on()
            return
        self._files = ui.element("div")
        self._fault = Fault()
        self._asked = ui.element("div")
        with ui.element("p").classes("buttons"):
            self._write_button = button("Write the campaign", self._write, main=True)
            self._write_button.props("disabled")
            if session.imported:
                frame.way_on()
        self._judged = ui.label().classes("doubt").props("role=status aria-live=polite")
        self._judged.set_visibility(False)
        self._written = Fault()
        self._naming = ui.element("div").classes("fields")
        self._left_out = ui.element("div").classes("fields")
        if not session.imported:
            with self._naming:
                name = ui.input("Name of the campaign", value=session.name).props("dense")
                name.on("change", lambda: self._rename(str(name.value)))
        self._corrections = ui.expansion("Corrections").classes("choices")
        self._reading = 0
        self._charts: list[Chart] = []
        self._rests: list[ui.number] = []
        self._names: list[str] = []
        self._runs: dict[str, ui.element] = {}
        self._shown_runs: dict[str, object] = {}
        self._shown_choices: list[str] | None = None
        self._focus = ""
        self._units = ui.expansion("Columns of the files, and their units").classes("choices")
        self._drawn = ui.element("div")
        self._table = ui.element("div").props("role=status aria-live=polite")
        with self._table:
            ui.label("Reading the files …").classes("soft")
        ui.timer(0.0, self._first, once=True)

    async def _draw_runs(self) -> None:
        """The runs of a campaign that was not made from dropped files."""
        from tunnel_sim.files.campaign_folder import read_campaign

        with self._fault.around():
            campaign = await asyncio.to_thread(read_campaign, self._session.campaign)
            if self._drawn.is_deleted:  # the page was left
                return
            with self._drawn.classes("charts"):
                for run in campaign.runs[: preview.MOST_RECORDS]:
                    label = f"reading [{campaign.sensor.unit}]"
                    curve = preview.points(run.record.time_s, run.record.yaw_rad)
                    Chart(run.id, "time [s]", label, [("reading", "after")], curve)

    async def _first(self) -> None:
        self._names = await asyncio.to_thread(column_units.column_names, self._session)
        self._show_files()
        await self._read()

    def _show_choices(self, asked: str) -> None:
        """The fields for which a fault asks, the stated fields, and the others folded."""
        keys = preview.choices_to_show(self._session, asked)
        if keys == self._shown_choices:
            return  # the field that the user is filling keeps the focus
        self._shown_choices = keys
        self._asked.clear()
        with self._asked:
            preview.show_choices(self._session, keys, self._names, self._changed)
        self._corrections.clear()
        with self._corrections:
            others = [key for key in preview.CORRECTIONS if key not in keys]
            preview.show_choices(self._session, others, self._names, self._changed)
            repeated = f"--recipe {self._session.choices} --out {self._session.campaign} --yes"
            show_command(f"tunnel import {self._session.uploads}/* {repeated}")

    def _rename(self, name: str) -> None:
        with self._fault.around():
            ui.navigate.to(address(rename(self._session, name), "records"))

    def _show_left_out(self, imported: Imported | None) -> None:
        """The field for files and runs to leave out, with the runs that were found."""
        chosen = list(preview.choices_of(self._session).leave_out)
        files = [path.name for path in preview.files_of(self._session)]
        runs = [] if imported is None else [part.id for part in imported.parts]
        options = list(dict.fromkeys([*(files if len(files) > 1 else ()), *runs, *chosen]))
        self._left_out.clear()
        if len(options) < 2 and not chosen:
            return
        with self._left_out:
            field = ui.select(options, label="Leave out files or runs", value=chosen, multiple=True)
            field.props("dense use-chips").on_value_change(
                lambda event: self._changed("leave_out", event.value)
            )

    async def _changed(self, key: str, value: Any) -> None:
        with self._fault.around():
            preview.state(
                self._session, preview.settings_from(value) if key == "conditions" else {key: value}
            )
            await self._read()

    async def _stated(self, changes: dict[str, Any]) -> None:
        """Save the unit of a column; the fields of the choices also show it."""
        with self._fault.around():
            preview.state(self._session, changes)
            self._shown_choices = None
            await self._read()

    async def _added(self, record: preview.DrawnRecord, at: float) -> None:
        """Add a release; its mark takes the focus."""

        def add() -> None:
            self._focus = preview.add(self._session, record, at)

        await self._cut(add)

    async def _cut(self, change: Callable[[], None]) -> None:
        """Change the runs of a record; nothing changes if the files cannot be read with the change."""
        with self._fault.around():
            before = preview.choices_of(self._session)
            try:
                change()
                await asyncio.to_thread(preview.read, self._session)
            except TunnelError:
                changed = {"stretches": before.stretches, "leave_out": before.leave_out}
                preview.state(self._session, changed)
                raise
            await self._read()

    async def _moved(self, mark: preview.Mark, kind: str, at: float | None) -> None:
        """Save the new position of a mark; the mark moves back if the files cannot be read with it."""
        with self._fault.around():
            before = preview.choices_of(self._session).stretch_of(mark.file, mark.run)
            preview.move(self._session, mark, {kind: at})
            if await self._read(redraw=False):
                return
            preview.move(self._session, mark, {kind: getattr(before, kind)})
        if self._imported is not None:
            self._draw(self._imported)

    async def _read(self, *, redraw: bool = True) -> bool:
        """Read the files with the current choices; the charts are not redrawn if only a mark was moved.

        Returns:
            False if the files cannot be read.
        """
        self._reading += 1
        mine = self._reading
        imported = None
        faults: tuple[TunnelError, ...] = ()
        try:
            imported, faults = await asyncio.to_thread(preview.read, self._session)
            said: TunnelError | str = "; ".join(map(str, faults))
            said = f"{said}; give the missing information, or leave out the file" if faults else ""
        except TunnelError as refused:
            said = refused
        if self._is_past(mine):
            return True
        self._fault.show(said)
        if imported is None and not redraw:
            return False
        self._show_choices(str(said))
        self._imported = imported
        # A campaign without some of the dropped files is written only where the user has left these out.
        if imported is not None and not faults:
            self._write_button.props(remove="disabled")
        else:
            self._write_button.props("disabled")
        self._show_left_out(imported)
        self._table.clear()
        if redraw:
            self._drawn.clear()
            columns = await asyncio.to_thread(column_units.columns_of, self._session)
            if self._is_past(mine):
                return True
            self._units.clear()
            self._units.set_visibility(bool(columns))
            with self._units:
                column_units.show_columns(columns, self._stated)
            if imported is None:
                self._units.open()
        if imported is None:
            self._judged.set_visibility(False)
            curves = await asyncio.to_thread(column_units.raw_columns, self._session)
            if self._drawn.is_deleted or not curves:
                return False
            with self._drawn:
                ui.label("The columns as they are in the file:").classes("soft")
                with ui.element("div").classes("charts"):
                    for name, unit, rows, values in curves:
                        label = f"{name} [{unit or 'unit not stated'}]"
                        Chart(name, "row", label, [("value", "after")], [rows, values])
            return False
        with self._drawn:
            self._draw(imported)
        with self._table:
            from tunnel_lab.report.import_table import parts_table

            show_blocks([parts_table(imported)])
            with ui.element("ul").classes("notes"):
                show_items(map(page_words, imported.remarks()))
        return True

    def _is_past(self, reading: int) -> bool:
        """Whether a later choice is being read, or the page was left."""
        return reading != self._reading or self._table.is_deleted

    def _show_files(self) -> None:
        self._files.clear()
        with self._files:
            names = ", ".join(path.name for path in preview.files_of(self._session))
            ui.label(f"{names}; kept in {self._session.uploads}").classes("soft")
            with ui.expansion("Add files"):

                async def kept(_: str) -> None:
                    self._show_files()
                    await self._read()

                drop_zone(address(self._session, "upload"), kept, Fault())

    def _draw(self, imported: Imported) -> None:
        """Draw the records, or only their marks if the records are already drawn."""
        doubtful = [part.id for part in imported.parts if preview.doubts_of(part)]
        more = f" and {len(doubtful) - _MOST_NAMES} more" if len(doubtful) > _MOST_NAMES else ""
        self._judged.set_text(f"To judge, below: {', '.join(doubtful[:_MOST_NAMES])}{more}")
        self._judged.set_visibility(bool(doubtful))
        if not self._drawn.default_slot.children:
            self._runs, self._shown_runs = {}, {}
        records = preview.drawn(imported, list(self._runs))
        marks = [mark for record in records for mark in record.marks]
        unit = imported.campaign.sensor.unit
        if not self._drawn.default_slot.children:
            ui.label(_HELP).classes("soft")
            with ui.element("div").classes("charts"):
                self._charts = [self._record(record) for record in records]
            hidden = len({id(part.raw) for part in imported.parts}) - len(records)
            if hidden > 0:
                ui.label(f"{counted(hidden, 'more record')} not drawn.").classes("soft")
            with ui.expansion("Resting angles as numbers"), ui.element("div").classes("fields"):
                self._rests = []
                for mark in marks:
                    field = ui.number(f"Rest of {mark.run}, to be subtracted [{unit}]")
                    field.props("dense step=any").on("change", partial(self._rest_typed, mark, field))
                    self._rests.append(field)
        for chart, record in zip(self._charts, records, strict=True):
            chart.show_marks(
                [
                    {
                        "id": f"{mark.run} {kind}",
                        "at": getattr(mark, kind),
                        "kind": kind,
                        "label": f"{words} of {mark.run}",
                        "unit": unit if kind == "rest" else "s",
                        "from": mark.start,
                        "to": mark.end,
                        "about": f"rest {mark.about}",
                        "out": bool(mark.fault),
                    }
                    for mark in record.marks
                    for kind, words in _KINDS.items()
                ],
                f"{self._focus} start" if self._focus in [mark.run for mark in record.marks] else "",
            )
            self._show_runs(record, alone=len(imported.parts) == 1)
        self._focus = ""
        for field, mark in zip(self._rests, marks, strict=True):
            field.set_value(float(f"{mark.rest:.6g}"))
            field.props["hint"] = mark.about
            field.update()

    async def _rest_typed(self, mark: preview.Mark, field: ui.number) -> None:
        """Save a reading at rest; if the field is emptied, the reading at rest is detected again."""
        await self._moved(mark, "rest", field.value)

    def _record(self, record: preview.DrawnRecord) -> Chart:
        """The chart of a record, and the place for its runs below it."""
        marks = {f"{mark.run} {kind}": (mark, kind) for mark in record.marks for kind in _KINDS}
        curves: list[Sequence[float | None]] = [record.time, record.reading]
        with ui.element("div"):
            chart = Chart(
                record.title, _TIME, f"reading [{record.unit}]", [("reading", "after")], curves,
                moved=lambda name, at: self._moved(*marks[name], at),
                added=(lambda at: self._added(record, at)) if record.cut else None,
                removed=lambda name: self._cut(lambda: preview.remove(self._session, marks[name][0])),
            )  # fmt: skip
            self._runs[record.key] = ui.element("div").props("role=status aria-live=polite")
        return chart

    def _show_runs(self, record: preview.DrawnRecord, *, alone: bool) -> None:
        """The doubts about a record, and buttons for its runs, unless one is ``alone`` in the campaign."""
        shown = alone, [(mark.run, mark.doubts, mark.added, mark.is_left_out) for mark in record.marks]
        if self._shown_runs.get(record.key) == shown:
            return  # a button that is being pressed stays
        self._shown_runs[record.key] = shown
        self._runs[record.key].clear()
        with self._runs[record.key]:
            for mark in record.marks:
                for line in mark.doubts:
                    ui.label(f"{mark.run}: {line}").classes("doubt")
            with ui.element("p").classes("buttons of-runs"):
                for mark in () if alone else record.marks:
                    words = "Remove" if mark.added else "Use again" if mark.is_left_out else "Leave out"
                    change = preview.restore if mark.is_left_out else preview.remove
                    button(f"{words}: {mark.run}", partial(self._cut, partial(change, self._session, mark)))

    async def _write(self) -> None:
        with self._written.around():
            if self._imported is None:
                raise TunnelError("the files cannot be read yet", remedy="give the missing information above")
            await asyncio.to_thread(write, self._session, self._imported)
            ui.navigate.to(address(self._session, "conditions"))


def write(session: Session, imported: Imported) -> None:
    """Write the campaign, as ``tunnel import`` does; conditions stated earlier are kept.

    Conditions that a campaign takes only with an air density stay in the draft until the density is stated.

    Raises:
        TunnelError: when the folder cannot be written.
    """
    from tunnel_lab.bench import conditions
    from tunnel_lab.plotting.runs import import_picture
    from tunnel_sim.files.importing.writing import write_imported

    before = conditions.stated(session) if session.imported else {}
    write_imported(imported, session.campaign, overwrite=True, picture=import_picture)
    if before or imported.held:
        conditions.restore(session, before, imported.held)
