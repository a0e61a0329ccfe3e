"""The stage Conditions: a table that one fills like a spreadsheet, saved in ``campaign.toml`` at every change."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from nicegui import events, ui

from tunnel_lab.bench import conditions
from tunnel_lab.bench.conditions import MISSING, RIG, UNITS, WORDS
from tunnel_lab.bench.parts import Fault, Frame
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.importing.choices import RUN_KEYS
from tunnel_sim.vocabulary.errors import TunnelError

_MOST_ROWS = 20  # of a table without a scroll bar
_MOST_LINES = 8  # of faults that are listed

_PASTE = """(event) => {
  const api = getElement(event.currentTarget.id.slice(1)).api;
  const cell = api.getFocusedCell();
  if (!cell || api.getEditingCells().length) return;
  event.preventDefault();
  emit({row: cell.rowIndex, key: cell.column.getColId(), text: event.clipboardData.getData("text/plain")});
}"""

_SHORT = (
    "(cell) => (cell.value === '' || isNaN(cell.value) ? cell.value : String(+(+cell.value).toPrecision(6)))"
)


def build(session: Session, frame: Frame) -> None:
    """Build the page."""
    _Conditions(session, frame)


class _Conditions:
    """The page: every change is checked, and saved in the campaign or as a draft."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session, self._frame = session, frame
        self._cells = conditions.typed(session)
        self._runs = [row for row in self._cells if row != RIG]
        ui.label(
            "Type, or paste a block from a spreadsheet into a cell. Valid values are saved at once in "
            f"{session.campaign / 'campaign.toml'}; nothing else of the campaign changes."
        ).classes("soft")
        self._all_runs()
        self._grid = self._table()
        self._rig = self._sizes()
        ui.checkbox(
            "Keep values that look like a wrong unit",
            value=not conditions.is_judged(session),
            on_change=self._judge,
        )
        self._fault = Fault()
        self._lines = ui.element("ul").classes("notes").props("role=status aria-live=polite")
        self._on = ui.element("p").classes("buttons")
        with self._fault.around():
            self._check()

    def _table(self) -> ui.aggrid:
        columns: list[dict[str, Any]] = [
            {"field": "run", "headerName": "run", "pinned": "left", "minWidth": 120}
        ]
        for key in RUN_KEYS:
            columns.append(
                {
                    "field": key,
                    "headerName": f"{WORDS[key]} [{UNITS[key]}]",
                    "editable": True,
                    "minWidth": 150,
                    "wrapHeaderText": True,
                    "autoHeaderHeight": True,
                    "cellClassRules": {
                        "wrong": "data.wrong.includes(colDef.field)",
                        "missing": "data.missing.includes(colDef.field)",
                    },
                    "tooltipField": f"{key}_why",
                    ":valueFormatter": _SHORT,
                }
            )
        grid = ui.aggrid(
            {
                "columnDefs": columns,
                "defaultColDef": {"sortable": False, "cellDataType": False, "suppressMovable": True},
                "rowData": [],
                ":getRowId": "(row) => row.data.run",
                "singleClickEdit": False,
                "stopEditingWhenCellsLoseFocus": True,
                "enterNavigatesVerticallyAfterEdit": True,
                "enterNavigatesVertically": True,
                "domLayout": "autoHeight" if len(self._runs) <= _MOST_ROWS else "normal",
                "tooltipShowDelay": 300,
            }
        )
        grid.classes("grid" if len(self._runs) <= _MOST_ROWS else "grid tall").props(
            'aria-label="Conditions of the runs"'
        )
        grid.on("cellValueChanged", self._edited, ["data", "colId", "newValue"])
        grid.on("paste", self._pasted, js_handler=_PASTE)
        return grid

    def _edited(self, event: events.GenericEventArguments) -> None:
        row, key = event.args["data"]["run"], event.args["colId"]
        value = event.args["newValue"]
        self._put({(row, key): "" if value is None else str(value)})

    def _put(self, texts: Mapping[tuple[str, str], str]) -> None:
        """Change cells of what is on the disk, which another tab may have changed meanwhile."""
        with self._fault.around():
            cells = conditions.typed(self._session)
            if cells.keys() != self._cells.keys():
                raise TunnelError("the campaign has other runs now", remedy="load the page again")
            for (row, key), text in texts.items():
                cells[row][key] = text
            self._cells = cells
            self._check()

    def _pasted(self, event: events.GenericEventArguments) -> None:
        row, key = self._runs[event.args["row"]], event.args["key"]
        if key in RUN_KEYS:
            found = conditions.pasted(self._cells, list(RUN_KEYS), row, key, event.args["text"])
            changed = {(run, one): text for run, texts in found.items() for one, text in texts.items()}
            self._put({(run, one): t for (run, one), t in changed.items() if self._cells[run][one] != t})

    def _all_runs(self) -> None:
        """Fill a column at once."""
        if len(self._runs) < 2:
            return
        with ui.element("div").classes("fields"):
            key = ui.select(
                {key: f"{WORDS[key]} [{UNITS[key]}]" for key in RUN_KEYS},
                label="Same for all runs",
                value="air_density",
            ).props("dense")
            value = ui.input("Value").props("dense")

            def fill() -> None:
                self._put({(row, str(key.value)): str(value.value or "") for row in self._runs})

            value.on("change", fill)

    def _sizes(self) -> dict[str, ui.input]:
        found = {}
        with ui.element("h2"):
            ui.html("The rig", sanitize=False, tag="span")
        with ui.element("div").classes("fields"):
            for key, text in self._cells[RIG].items():
                field = ui.input(f"{WORDS[key]} [{UNITS[key]}]", value=text).props("dense bottom-slots")

                found[key] = field.on("change", partial(self._resize, key, field))
        return found

    def _resize(self, key: str, field: ui.input) -> None:
        self._put({(RIG, key): str(field.value or "")})

    def _judge(self, event: events.ValueChangeEventArguments[bool | None]) -> None:
        with self._fault.around():
            conditions.judge(self._session, not event.value)
            self._check()

    def _check(self) -> None:
        """Save what is right, and mark what is not."""
        wrong = conditions.save(self._session, self._cells)
        missing = _missing(self._cells)
        self._grid.options["rowData"] = [self._row(run, wrong, missing) for run in self._runs]
        self._grid.update()
        for key, field in self._rig.items():
            field.value = self._cells[RIG][key]
            field.error = wrong.get((RIG, key))
            field.props["hint"] = missing.get((RIG, key), "")
        self._list(wrong, missing)
        self._frame.refresh()
        self._on.clear()
        with self._on:
            self._frame.way_on()

    def _row(
        self, run: str, wrong: dict[tuple[str, str], str], missing: dict[tuple[str, str], str]
    ) -> dict[str, Any]:
        why = wrong or {}
        return {
            "run": run,
            **self._cells[run],
            "wrong": [key for key in RUN_KEYS if (run, key) in wrong],
            "missing": [key for key in RUN_KEYS if (run, key) in missing and (run, key) not in wrong],
            **{f"{key}_why": why.get((run, key)) or missing.get((run, key), "") for key in RUN_KEYS},
        }

    def _list(self, wrong: dict[tuple[str, str], str], missing: dict[tuple[str, str], str]) -> None:
        """Say in words what the marks say."""
        self._lines.clear()
        kinds = {f"{WORDS[key]} is not stated: {why}": None for (_, key), why in missing.items()}
        lines = [(f"tunnel: {line}", "fault") for line in wrong.values()] + [(line, "") for line in kinds]
        with self._lines:
            for line, style in lines[:_MOST_LINES]:
                with ui.element("li"):
                    ui.label(line).classes(style)
            if len(lines) > _MOST_LINES:
                with ui.element("li"):
                    ui.label(f"and {len(lines) - _MOST_LINES} more")


def _missing(cells: conditions.Cells) -> dict[tuple[str, str], str]:
    """What could be stated, by row and key; the rig's sizes only where the wind is on."""
    windy = any(texts["wind_speed"].strip() not in ("", "0") for row, texts in cells.items() if row != RIG)
    return {
        (row, key): MISSING[key]
        for row, texts in cells.items()
        for key, text in texts.items()
        if key in MISSING and not text.strip() and (row != RIG or windy)
    }
