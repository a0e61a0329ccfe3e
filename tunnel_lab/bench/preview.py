"""Contents of dropped files under the current choices, and the fields for these choices."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tomli_w
from nicegui import events, ui

from tunnel_lab.bench.parts import FIELDS, show_command
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.importing.choices import ImportChoices, read_recipe
from tunnel_sim.files.toml_input import validate
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.errors import TunnelError, counted

if TYPE_CHECKING:
    from tunnel_sim.files.importing.columns import ColumnPair
    from tunnel_sim.files.importing.imported_run import ImportedRun
    from tunnel_sim.files.importing.records import Imported
    from tunnel_sim.files.importing.tables import Channel, Table
    from tunnel_sim.vocabulary.record import Array


MOST_COLUMNS = 8
"""At most this many raw columns are drawn."""
MOST_RECORDS = 24
"""At most this many records are drawn."""
READINGS = ("angle", "counts", "voltage", "rate", "acceleration")
"""Kinds of unit that a reading may have."""
Role = Literal["time", "angle", "condition", "input"]
_STILL = 0.01  # of the range of a run's readings: a smaller range looks flat
_WRITTEN = {
    "rate": "Sample rate, where there are no times [Hz]",
    "counts_per_turn": "Counts of an encoder per turn",
    "calibration": "Angle of a voltage, such as 0.1 + 20*V",
    "start": "Leave out samples before [s]",
    "end": "Leave out samples after [s]",
    "rest": "Reading at rest, to be subtracted [rad]",
    "name": "Conditions in the file names: V{wind_speed}",
    "set": "Conditions of all runs, such as wind_speed=0",
    "delimiter": "Delimiter of a text file: tab, blank, ; , or |",
    "decimal": "Decimal sign of a text file",
}
"""Labels of the choices that are typed."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A run in the chart of its record; times by the file's clock.

    Args:
        start: of the run: the release, s.
        end: where the run has come to rest, or the next run begins, s.
        rest: the reading at rest, in the reading's unit.
        about: the source of ``rest`` in words: its uncertainty, or that it is stated.
        fault: the reason for leaving the run out; empty where it is used.
    """

    run: str
    file: str
    start: float
    end: float
    rest: float
    about: str
    fault: str


@dataclass(frozen=True, eq=False)
class DrawnRecord:
    """A record as it is drawn: the time in s, and the reading in its unit, None within a gap."""

    title: str
    unit: str
    time: list[float]
    reading: list[float | None]
    marks: tuple[Mark, ...]


def files_of(session: Session) -> list[Path]:
    """The dropped files, by name."""
    return sorted(
        path for path in session.uploads.glob("[!.]*") if path.is_file()
    )  # without files being written


def choices_of(session: Session) -> ImportChoices:
    """The choices stated about the files."""
    return read_recipe(session.choices) if session.choices.is_file() else ImportChoices()


def state(session: Session, changes: Mapping[str, Any]) -> None:
    """Save changed choices as a recipe beside the campaign; None stands for detection from the files.

    Raises:
        TunnelError: when a value is not valid.
    """
    now = choices_of(session).model_dump(exclude_defaults=True) | dict(changes)
    kept = {key: value for key, value in now.items() if value is not None}
    stated = validate(ImportChoices, kept, Path("choices")).model_dump(mode="json", exclude_defaults=True)
    write_whole(session.choices, tomli_w.dumps({"schema_version": 1, "choices": stated}).encode())


def settings_of(choices: ImportChoices) -> str:
    """The conditions that are stated for all runs, as ``--set`` takes them."""
    numbers = choices.conditions.model_dump(exclude_none=True)
    names = choices.stated_by.model_dump(exclude_none=True)
    stated = [f"{key}={value:g}" for key, value in numbers.items()]
    return ", ".join([*stated, *(f"{key}={name}" for key, name in names.items())])


def settings_from(text: str | None) -> dict[str, Any]:
    """The conditions of all runs as choices, from a text in the format of ``--set``.

    Raises:
        TunnelError: when the text is not in this format.
    """
    from tunnel_sim.files.importing.choices import parse_setting

    if not (text or "").strip():
        return {"conditions": None, "stated_by": None}
    numbers, names = parse_setting(text or "", FIELDS["set"])
    return {
        "conditions": numbers.model_dump(exclude_none=True),
        "stated_by": names.model_dump(exclude_none=True),
    }


def move(session: Session, mark: Mark, places: Mapping[str, float | None]) -> None:
    """State where a run begins, ends or rests.

    Args:
        places: ``start`` and ``end`` in s by the file's clock, ``rest`` in the reading's unit;
            None: as found.

    Raises:
        TunnelError: when the end is not after the start.
    """
    choices = choices_of(session)
    now = choices.stretch_of(mark.file, mark.run)
    others = [one for one in choices.stretches if (one.file, one.run) != (mark.file, mark.run)]
    stated = now.model_dump() | dict(places)
    first = mark.start if stated["start"] is None else stated["start"]
    last = mark.end if stated["end"] is None else stated["end"]
    if last <= first:
        raise TunnelError(
            f"the end ({last:.4g} s) is not after the release ({first:.4g} s)",
            where=f"run '{mark.run}'",
            remedy="move one of them",
        )
    state(session, {"stretches": [*(one.model_dump() for one in others), stated]})


def read(session: Session) -> tuple[Imported, tuple[TunnelError, ...]]:
    """Read the dropped files; missing air densities are stated on the next page.

    Returns:
        The import, and the faults of the unreadable files.

    Raises:
        TunnelError: for the first fault, as from ``tunnel import``, where no file can be read, or where a missing
            condition can be stated only by the user.
    """
    from tunnel_sim.files.importing.conditions import Unstated
    from tunnel_sim.files.importing.records import read_records

    files, choices = files_of(session), choices_of(session)
    try:
        return read_records(files, choices, name=session.name, later=True), ()
    except Unstated:
        raise
    except TunnelError as error:
        good, faults = [], []
        for path in (path for path in files if path.name not in choices.leave_out):
            if len(files) == 1:
                break
            try:
                alone = choices.model_copy(update={"leave_out": ()})
                read_records([path], alone, name=session.name, later=True)
                good.append(path)
            except TunnelError as fault:
                faults.append(fault)
        if not good or not faults:
            raise error from None
        others = tuple(path.name for path in files if path not in good)
        left_out = choices.model_copy(update={"leave_out": (*choices.leave_out, *others)})
        return read_records(files, left_out, name=session.name, later=True), tuple(faults)


def leave_out(session: Session, names: Sequence[str]) -> None:
    """State which files and runs are left out.

    Raises:
        TunnelError: when a name is not that of a file or run.
    """
    state(session, {"leave_out": tuple(names)})


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
        Name, unit (if stated), row numbers and values of each numeric column; few enough to draw.
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
    """Names of the columns in the dropped files; empty where a file cannot be read."""
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
        """The units that the user can state for it; none where only the file can state the unit."""
        from tunnel_sim.files.importing.units import UNITS

        kinds = {"time": ("time",), "angle": READINGS}.get(self.role, ())
        return [unit for kind in kinds for unit in UNITS[kind]]

    def stating(self, unit: str | None) -> dict[str, Any]:
        """The choices that state one of its `units`; an unused column is thereby chosen."""
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
    channel: Channel, channels: Sequence[Channel], pairs: list[ColumnPair], choices: ImportChoices
) -> Column:
    import numpy as np

    from tunnel_sim.files.importing.column_names import is_time, named_kind
    from tunnel_sim.files.importing.column_numbers import guessed_angle_unit, guessed_time_unit
    from tunnel_sim.files.importing.condition_names import condition_of
    from tunnel_sim.files.importing.inputs import stated_input
    from tunnel_sim.files.importing.tables import is_input

    role: Role
    if any(channel is pair.time for pair in pairs) or (not pairs and is_time(channel)):
        role, used, stated = "time", True, choices.time_unit
    elif condition_of(channel.name, channel.unit) is not None:
        return Column(channel.name, channel.unit, "a condition of the runs", "condition", True)
    elif is_input(channel) or channel is stated_input(channels, choices):
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
    if role == "angle" and (kind := named_kind(channel.name)):
        return Column(channel.name, "", f"{kind} by its name; nothing states its unit", role, used)
    guess = guessed_time_unit if role == "time" else guessed_angle_unit
    unit, size = guess(channel.values)
    what = f"steps of {size:.4g}" if role == "time" else f"a swing of ±{size:.4g}"
    return Column(channel.name, unit, f"guessed from {what}", role, used)


def drawn(imported: Imported) -> list[DrawnRecord]:
    """The first records, with their runs."""
    raws = {id(part.raw): part.raw for part in imported.parts}
    unit = imported.campaign.sensor.unit
    records = []
    for raw in list(raws.values())[:MOST_RECORDS]:
        time, marks = raw.cleaned.file_time_s, []
        for part in (part for part in imported.parts if part.raw is raw):
            start, end = float(time[part.piece.first]), float(time[part.piece.last - 1])
            fault = part.said[-1] if part.run is None else ""
            marks.append(Mark(part.id, raw.source.name, start, end, *_rest(part, unit), fault))
        records.append(DrawnRecord(raw.id, unit, *points(time, raw.cleaned.reading), tuple(marks)))
    return records


def points(time: Array, reading: Array) -> tuple[list[float], list[float | None]]:
    """The curve of a record for a chart, few enough points to draw; None within a gap.

    Args:
        time: shape (n,), s.
        reading: shape (n,).
    """
    from tunnel_lab.plotting.runs import thinned

    when, values = thinned(time, reading)
    return when.tolist(), [None if isnan(value) else value for value in values.tolist()]


def _rest(part: ImportedRun, unit: str) -> tuple[float, str]:
    """The reading at rest, and its source in words: as stated, the oscillation's centre, or the run's end."""
    import numpy as np

    from identification.examination.free_motion import centre_of
    from identification.show.numbers import significant, with_std

    if part.rest is not None:
        return part.rest, f"{significant(part.rest)} {unit}, stated and subtracted"
    tail = part.reading[-max(part.reading.size // 10, 2) :]
    end = float(np.median(tail))
    low, high = np.quantile(tail, (0.05, 0.95))
    if high - low < _STILL * float(np.ptp(part.reading)):
        return end, f"{significant(end)} {unit}, found at the end"
    centre = None if part.run is None else centre_of(part.run, 0.0)
    if centre is not None:
        return centre.zero, f"{with_std(centre.zero, centre.std)} {unit}, found"
    return end, f"about {significant(end, 2)} {unit}, found"


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
            elif column.unit:  # the field is empty, so that this unit can be chosen too
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


def show_choices(
    session: Session, columns: list[str], changed: Callable[[str, Any], Awaitable[None]]
) -> None:
    """The fields of the choices; a change calls back with name and new value, None for detection from the files."""
    from tunnel_sim.files.importing.units import UNITS
    from tunnel_sim.vocabulary.drive import HOLDS
    from tunnel_sim.vocabulary.inputs import INPUT_COLUMNS

    now = choices_of(session)
    angle = [unit for kind, units in UNITS.items() if kind != "time" for unit in units]

    async def choose(key: str, event: events.ValueChangeEventArguments[Any]) -> None:
        await changed(key, event.value or (() if key == "angle" else None))

    async def write(key: str, field: ui.number | ui.input) -> None:
        await changed(key, None if field.value == "" else field.value)

    with ui.element("div").classes("fields wide"):
        for key, options in (
            ("angle", columns),
            ("unit", angle),
            ("time", columns),
            ("time_unit", list(UNITS["time"])),
            ("input", [*columns, "none"]),
            ("input_as", list(INPUT_COLUMNS)),
            ("input_hold", list(HOLDS)),
        ):
            several = key == "angle"
            value = list(now.angle) if several else getattr(now, key)
            chosen = value if several else [value]
            ui.select(
                [*options, *(choice for choice in chosen if choice and choice not in options)],
                label=FIELDS[key.replace("_", "-")],
                value=value,
                multiple=several,
                clearable=True,
                on_change=partial(choose, key),
            ).props("dense")
        for key, label in _WRITTEN.items():
            field: ui.number | ui.input
            if key == "set":
                field = ui.input(label, value=settings_of(now)).props("dense")
            elif key in ("calibration", "name", "delimiter", "decimal"):
                field = ui.input(label, value=getattr(now, key) or "").props("dense")
            else:
                field = ui.number(label, value=getattr(now, key)).props("dense step=any")
            field.on("change", partial(write, key, field))
        ui.checkbox("Cut records at releases", value=now.cut, on_change=lambda e: changed("cut", e.value))
    show_command(
        f"tunnel import {session.uploads}/* --recipe {session.choices} --out {session.campaign} --yes"
    )
