"""The stage Conditions: conditions of the runs and sizes of the rig, typed in a table and kept in the campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from nicegui import events, ui

from tunnel_lab.bench.parts import Fault, Frame, label_of, name_of, page_words, show_items, text_of
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, NO_CAMPAIGN, parse_document, read_campaign
from tunnel_sim.files.importing.condition_names import RIG_KEYS, RUN_KEYS, Conditions
from tunnel_sim.files.importing.writing import NEEDED, ORIGINAL, STIFFNESS_OF_JOINT, campaign_text
from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.toml_input import load_toml, one_line, validate
from tunnel_sim.files.writing import write_json, write_whole
from tunnel_sim.vocabulary.campaign import needs_density
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import ANGLE, FREEDOMS, Freedom
from tunnel_sim.vocabulary.inputs import without_spring_needs_input

Cells = dict[str, dict[str, str]]
"""Texts by run and key; the rig's texts under `RIG`."""
Words = dict[tuple[str, str], str]
"""Faults by row and key: one line for each cell."""
RIG = ""
"""The row of the rig's sizes: no run has an empty name."""
_DENSITY = "air_density"
_MOST_ROWS = 20  # in a table without a scroll bar
_MOST_LINES = 8  # maximum number of listed faults
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


def stated(session: Session) -> Cells:
    """The conditions in ``campaign.toml``."""
    document = _document(session)
    own = freedom_in(document).own_keys
    rows = {run["id"]: _texts(run, own(RUN_KEYS)) for run in document["runs"]}
    return {RIG: _texts(document.get("rig", {}), own(RIG_KEYS)), **rows}


def freedom_in(document: Mapping[str, Any]) -> Freedom:
    """The freedom that a ``campaign.toml`` states."""
    return FREEDOMS[document.get("sensor", {}).get("motion", ANGLE.motion)]


def typed(session: Session) -> Cells:
    """The conditions as last typed, whether saved in the campaign or not."""
    saved = stated(session)
    if not session.draft.is_file():
        return saved
    draft = read_json(session.draft, remedy="delete it; what was saved in the campaign is not lost")
    return {
        row: {key: str(draft.get(row, cells).get(key, text)) for key, text in cells.items()}
        for row, cells in saved.items()
    }


def faults(cells: Cells, *, plausible: bool) -> Words:
    """The faults, as a command would print them; with ``plausible`` also values that look like a wrong unit."""
    faults_by_cell = {}
    for row, texts in cells.items():
        where = f"run '{row}'" if row else "the rig"
        for key, text in texts.items():
            try:
                value = number(text, f"{where}, {key}")
                if value is not None:
                    validate(Conditions, {key: value}, Path(where))
                    plausible_values({key: value} if plausible else {}, where)
            except TunnelError as error:
                faults_by_cell[row, key] = str(error)
        if (
            not row
            or _DENSITY not in texts
            or texts[_DENSITY].strip()
            or (row, "wind_speed") in faults_by_cell
        ):
            continue
        scales = (texts["spring_stiffness"], cells[RIG]["frontal_area"], cells[RIG]["reference_length"])
        speed = number(texts["wind_speed"], where) or 0.0
        if needs_density(speed, *(1.0 if text.strip() else None for text in scales)):
            remedy = "give it in kg/m3 (about 1.2 for air)"
            faults_by_cell[row, "air_density"] = str(
                TunnelError("wind-on without air_density", where=where, remedy=remedy)
            )
    return faults_by_cell


def number(text: str, where: str) -> float | None:
    """The number in a cell, with a decimal point or comma; None if the cell is empty."""
    if not text.strip():
        return None
    try:
        return float(text.strip().replace("−", "-").replace(",", "."))
    except ValueError:
        raise TunnelError(
            f"'{one_line(text, 30)}' is not a number", where=where, remedy="give a number in SI units"
        ) from None


def save(session: Session, cells: Cells) -> Words:
    """Save conditions in the campaign, or as a draft beside it while there are `faults`.

    Raises:
        TunnelError: when the campaign would not be readable for another reason.
    """
    document = _document(session)
    wrong = faults(cells, plausible=is_judged(session))
    key = "spring_stiffness"
    loose = [row for row in cells if row and (row, key) not in wrong and number(cells[row][key], row) == 0.0]
    drives = {run.id: run.drive for run in read_campaign(session.campaign).runs} if loose else {}
    for row in loose:
        try:
            without_spring_needs_input(0.0, drives[row], f"run '{row}'")
        except TunnelError as error:
            wrong[row, key] = str(error)
    if wrong:
        write_json(session.draft, cells)
        return wrong
    own = freedom_in(document).own_keys
    document["rig"] = _with(document.get("rig", {}), cells[RIG], own(RIG_KEYS))
    document["runs"] = [_with(run, cells[run["id"]], own(RUN_KEYS)) for run in document["runs"]]
    if stated(session) != cells:
        _write(session, document)
    session.draft.unlink(missing_ok=True)
    return {}


def judge(session: Session, plausible: bool) -> None:
    """Set whether values that look like a wrong unit are refused.

    Raises:
        TunnelError: when a saved value would then be refused.
    """
    document = _document(session)
    document["sensor"] = {**document.get("sensor", {}), "plausible": False}
    if plausible:
        del document["sensor"]["plausible"]
    _write(session, document)


def is_judged(session: Session) -> bool:
    """Whether values that look like a wrong unit are refused."""
    return _document(session).get("sensor", {}).get("plausible") is not False


def _write(session: Session, document: dict[str, Any]) -> None:
    path = session.campaign / CAMPAIGN_FILE
    parse_document(document, path)
    comments = [line for line in path.read_text("utf-8").splitlines() if line.startswith(ORIGINAL)]
    write_whole(path, campaign_text(document, comments, driven_runs(session)).encode())


def driven_runs(session: Session) -> frozenset[str]:
    """The ids of the driven runs of the campaign."""
    files = [session.campaign / run["file"] for run in _document(session)["runs"]]
    return _driven(session.campaign, tuple((file.stat().st_mtime_ns, file.stat().st_size) for file in files))


@lru_cache(maxsize=16)
def _driven(folder: Path, versions: tuple[tuple[int, int], ...]) -> frozenset[str]:
    """The driven runs of a folder while its run files keep their ``versions``: conditions do not change them."""
    del versions
    return frozenset(run.id for run in read_campaign(folder).driven_runs)


def restore(
    session: Session, before: Cells, held: Mapping[str, Mapping[str, float]] = MappingProxyType({})
) -> None:
    """Restore the conditions stated before a campaign was rewritten; errors as in `save`.

    Args:
        held: conditions from the files that the campaign takes only with an air density, by row and key.
    """
    kept = {
        row: {
            key: before.get(row, {}).get(key) or _texts(held.get(row, {}), (key,))[key] or text
            for key, text in cells.items()
        }
        for row, cells in stated(session).items()
    }
    save(session, kept)


def pasted(cells: Cells, columns: list[str], row: str, key: str, text: str) -> Cells:
    """The cells after a block from a spreadsheet is inserted, its upper left cell at ``row`` and ``key``.

    The block has rows on lines and cells separated by tabs; cells outside the table are left out.
    """
    rows = [name for name in cells if name != RIG]
    result = {name: dict(texts) for name, texts in cells.items()}
    block = [line.split("\t") for line in text.replace("\r\n", "\n").rstrip("\n").split("\n")]
    for name, line in zip(rows[rows.index(row) :], block, strict=False):
        for place, cell in zip(columns[columns.index(key) :], line, strict=False):
            result[name][place] = cell.strip()
    return result


def _document(session: Session) -> dict[str, Any]:
    document = load_toml(session.campaign / CAMPAIGN_FILE, missing=NO_CAMPAIGN)
    parse_document(document, session.campaign / CAMPAIGN_FILE)
    return document


def _texts(table: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, str]:
    return {key: "" if table.get(key) is None else text_of(float(table[key])) for key in keys}


def _with(table: Mapping[str, Any], cells: Mapping[str, str], keys: tuple[str, ...]) -> dict[str, Any]:
    """A table of ``campaign.toml`` with the conditions typed; a run without a wind speed is wind-off."""
    values = {key: number(cells[key], key) for key in keys}
    if "wind_speed" in values and values["wind_speed"] is None:
        values["wind_speed"] = 0.0
    others = {key: value for key, value in table.items() if key not in keys}
    return others | {key: value for key, value in values.items() if value is not None}


def _without_density(runs: Sequence[str], count: int) -> str:
    """The air density that wind-on runs lack, in one line."""
    more = f" and {len(runs) - _MOST_LINES} more" if len(runs) > _MOST_LINES else ""
    once = ", or once under “Same for all runs”" if count > 1 else ""
    words = f"wind-on without air density: give it in kg/m³ (about 1.2 for air) in the marked cells{once}"
    return f"{', '.join(runs[:_MOST_LINES])}{more}: {words}"


class ConditionsPage:
    """The page: every change is checked, and saved in the campaign or as a draft."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session, self._frame = session, frame
        self._cells = typed(session)
        self._runs = [row for row in self._cells if row != RIG]
        self._driven = driven_runs(session).issuperset(self._runs)
        self._freedom = freedom_in(_document(session))
        self._keys = self._freedom.own_keys(RUN_KEYS)
        ui.label(
            "Type, or paste a block from a spreadsheet into a cell. Valid values are saved at once in "
            f"{session.campaign / 'campaign.toml'}; nothing else of the campaign changes."
        ).classes("soft")
        if len(self._runs) > 1:
            with ui.element("div").classes("fields"):
                keys = {key: self._label(key) for key in self._keys}
                usual = _DENSITY if _DENSITY in keys else self._keys[0]
                self._key = ui.select(keys, label="Same for all runs", value=usual).props("dense")
                self._value = ui.input("Value").props("dense").on("change", self._fill)
        self._grid = self._table()
        with ui.element("h2"):
            ui.html("The rig", sanitize=False, tag="span")
        self._rig: dict[str, ui.input] = {}
        with ui.element("div").classes("fields"):
            for key, text in self._cells[RIG].items():
                field = ui.input(self._label(key), value=text).props("dense bottom-slots")
                self._rig[key] = field.on("change", partial(self._resize, key, field))
        ui.checkbox(
            "Keep values that look like a wrong unit", value=not is_judged(session), on_change=self._judge
        )
        self._fault = Fault()
        self._lines = ui.element("ul").classes("notes").props("role=status aria-live=polite")
        self._on = ui.element("p").classes("buttons")
        with self._fault.around():
            self._check()

    def _label(self, key: str) -> str:
        return self._freedom.words(label_of(Conditions, key))

    def _table(self) -> ui.aggrid:
        columns: list[dict[str, Any]] = [{"field": "run", "headerName": "run", "minWidth": 80, "flex": 1}]
        for key in self._keys:
            columns.append(
                {
                    "field": key,
                    "headerName": self._label(key),
                    "editable": True,
                    "minWidth": 64,
                    "flex": 1,
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
        short = len(self._runs) <= _MOST_ROWS
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
                "domLayout": "autoHeight" if short else "normal",
                "tooltipShowDelay": 300,
            },
            auto_size_columns=False,  # columns share the width, also after resizing
        )
        grid.classes("grid" if short else "grid tall").props('aria-label="Conditions of the runs"')
        grid.on("cellValueChanged", self._edited, ["data", "colId", "newValue"])
        grid.on("paste", self._pasted, js_handler=_PASTE)
        return grid

    def _edited(self, event: events.GenericEventArguments) -> None:
        row, key = event.args["data"]["run"], event.args["colId"]
        value = event.args["newValue"]
        self._put({(row, key): "" if value is None else str(value)})

    def _put(self, texts: Mapping[tuple[str, str], str]) -> None:
        """Change cells on the disk, which another tab may have changed meanwhile."""
        with self._fault.around():
            cells = typed(self._session)
            if cells.keys() != self._cells.keys():
                raise TunnelError("the campaign has other runs now", remedy="load the page again")
            for (row, key), text in texts.items():
                cells[row][key] = text
            self._cells = cells
            self._check()

    def _pasted(self, event: events.GenericEventArguments) -> None:
        row, key = self._runs[event.args["row"]], event.args["key"]
        if key in self._keys:
            texts_by_run = pasted(self._cells, list(self._keys), row, key, event.args["text"])
            changed = {
                (run, column): text
                for run, texts in texts_by_run.items()
                for column, text in texts.items()
                if self._cells[run][column] != text
            }
            self._put(changed)

    def _fill(self) -> None:
        """Fill a column at once."""
        self._put({(row, str(self._key.value)): str(self._value.value or "") for row in self._runs})

    def _resize(self, key: str, field: ui.input) -> None:
        self._put({(RIG, key): str(field.value or "")})

    def _judge(self, event: events.ValueChangeEventArguments[bool | None]) -> None:
        with self._fault.around():
            judge(self._session, not event.value)
            self._check()

    def _check(self) -> None:
        """Save the valid cells, and mark the others: in the table, in the fields and in words."""
        cells = self._cells
        wrong = save(self._session, cells)
        windy = any(cells[run].get("wind_speed", "").strip() not in ("", "0") for run in self._runs)
        words = NEEDED | ({"spring_stiffness": STIFFNESS_OF_JOINT} if self._driven and not windy else {})
        missing = {
            (row, key): self._freedom.words(words[key])
            for row, texts in cells.items()
            for key, text in texts.items()
            if key in NEEDED and not text.strip() and (row != RIG or windy)
        }
        why = missing | wrong
        self._grid.options["rowData"] = [
            {
                "run": run,
                **cells[run],
                "wrong": [key for key in self._keys if (run, key) in wrong],
                "missing": [key for key in self._keys if (run, key) in missing and (run, key) not in wrong],
                **{f"{key}_why": why.get((run, key), "") for key in self._keys},
            }
            for run in self._runs
        ]
        self._grid.update()
        for key, field in self._rig.items():
            field.value = cells[RIG][key]
            field.error = wrong.get((RIG, key))
            field.props["hint"] = missing.get((RIG, key), "")
        unstated = [(name_of(Conditions, key), said) for (_, key), said in missing.items()]
        notes = dict.fromkeys(f"{words} is not stated: {said}" for words, said in unstated)
        empty = [run for run in self._runs if (run, _DENSITY) in wrong and not cells[run][_DENSITY].strip()]
        others = {
            place: line for place, line in wrong.items() if place[1] != _DENSITY or place[0] not in empty
        }
        lines = [(page_words(line), "fault") for line in others.values()] + [(line, "") for line in notes]
        if empty:
            lines.insert(0, (_without_density(empty, len(self._runs)), "fault"))
        self._lines.clear()
        with self._lines:
            for line, style in lines[:_MOST_LINES]:
                with ui.element("li"):
                    ui.label(line).classes(style)
            if len(lines) > _MOST_LINES:
                show_items([f"and {len(lines) - _MOST_LINES} more"])
        self._frame.refresh(self._on)
