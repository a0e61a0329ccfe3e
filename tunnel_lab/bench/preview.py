"""What is read from dropped files, with the choices stated so far; nothing of it is written."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w
from nicegui import events, ui

from tunnel_lab.bench.parts import show_command
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.importing.conditions import ImportChoices, read_recipe
from tunnel_sim.files.toml_input import validate
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.files.importing.raw_records import RawRecord
    from tunnel_sim.files.importing.records import Imported, ImportedRun
    from tunnel_sim.vocabulary.record import Array


MOST_COLUMNS = 8
"""At most this many raw columns are drawn."""

MOST_RECORDS = 24
"""At most this many records are drawn."""
_STILL = 0.01  # of a run's readings from the least to the greatest: a range that looks flat
Changed = Callable[[str, Any], Awaitable[None]]


@dataclass(frozen=True, eq=False)
class Mark:
    """A run in the chart of its record, times from the record's first sample.

    Args:
        file: the file that holds it.
        start: of the run: the release, s.
        end: where it has come to rest, or the next run begins, s.
        rest: the reading at which it rests, in the reading's unit.
        about: the rest in words: how well it is known, or that it is stated.
        fault: why the run is left out; empty where it is used.
    """

    run: str
    file: str
    start: float
    end: float
    rest: float
    about: str
    fault: str


@dataclass(frozen=True, eq=False)
class Drawn:
    """A record as it is drawn.

    Args:
        title: of the chart.
        unit: of the readings.
        time: s, few enough to draw.
        reading: in the unit; None within a gap.
        marks: the runs in it.
    """

    title: str
    unit: str
    time: list[float]
    reading: list[float | None]
    marks: tuple[Mark, ...]


def files_of(session: Session) -> list[Path]:
    """The dropped files, by name."""
    return sorted(path for path in session.uploads.glob("*") if path.is_file())


def choices_of(session: Session) -> ImportChoices:
    """What has been stated about the files.

    Raises:
        TunnelError: when the recipe beside the campaign cannot be read.
    """
    return read_recipe(session.choices) if session.choices.is_file() else ImportChoices()


def state(session: Session, changes: Mapping[str, Any]) -> None:
    """Keep choices, as a recipe beside the campaign.

    Args:
        changes: by field of `ImportChoices`; None: found from the files.

    Raises:
        TunnelError: when a value is not one.
    """
    now = choices_of(session).model_dump(exclude_defaults=True) | dict(changes)
    kept = {key: value for key, value in now.items() if value is not None}
    stated = validate(ImportChoices, kept, Path("choices")).model_dump(mode="json", exclude_defaults=True)
    write_whole(session.choices, tomli_w.dumps({"schema_version": 1, "choices": stated}).encode())


def move(session: Session, mark: Mark, places: Mapping[str, float | None]) -> None:
    """State where a run begins, ends or rests.

    Args:
        mark: the run as it is.
        places: ``start`` and ``end`` in s from the record's first sample, ``rest`` in the reading's unit;
            None: as found.

    Raises:
        TunnelError: when the end is not after the start.
    """
    choices = choices_of(session)
    now = choices.stretch_of(mark.file, mark.run)
    others = [
        stretch for stretch in choices.stretches if (stretch.file, stretch.run) != (mark.file, mark.run)
    ]
    stated = now.model_dump() | dict(places)
    first = mark.start if stated["start"] is None else stated["start"]
    last = mark.end if stated["end"] is None else stated["end"]
    if last <= first:
        raise TunnelError(
            f"the end ({last:.4g} s) is not after the release ({first:.4g} s)",
            where=f"run '{mark.run}'",
            remedy="move one of them",
        )
    state(session, {"stretches": [*(stretch.model_dump() for stretch in others), stated]})


def read(session: Session) -> tuple[Imported, tuple[TunnelError, ...]]:
    """Read the dropped files.

    Returns:
        What was read, and the faults of the files that are left out because they cannot be read beside the others.

    Raises:
        TunnelError: for the first fault, as ``tunnel import`` does, where no file can be read.
    """
    from tunnel_sim.files.importing.records import read_records

    files, choices = files_of(session), choices_of(session)
    try:
        return read_records(files, choices, name=session.name), ()
    except TunnelError as error:
        good, faults = [], []
        for path in files if len(files) > 1 else ():
            try:
                read_records([path], choices, name=session.name)
                good.append(path)
            except TunnelError as fault:
                faults.append(fault)
        if not good or not faults:
            raise error from None
        return read_records(good, choices, name=session.name), tuple(faults)


def raw_columns(session: Session) -> list[tuple[str, str, list[float], list[float | None]]]:
    """The columns of the first table that can be read, as they are in the file.

    Returns:
        Name, unit where one is stated, row numbers and values of each column with numbers; few enough to draw.
    """
    import numpy as np

    from tunnel_sim.files.importing.source import read_source

    for path in files_of(session):
        try:
            tables = read_source(path, choices_of(session)).tables
        except TunnelError:
            continue
        shown = [
            (
                channel.name,
                channel.unit,
                *points(np.arange(channel.values.size, dtype=np.float64), channel.values),
            )
            for table in tables[:1]
            for channel in table.channels[:MOST_COLUMNS]
            if channel.values.size > 1 and np.isfinite(channel.values).any()
        ]
        if shown:
            return shown
    return []


def column_names(session: Session) -> list[str]:
    """Names of the columns in the dropped files; empty where they cannot be read."""
    from tunnel_sim.files.importing.source import read_source

    names: dict[str, None] = {}
    try:
        for path in files_of(session):
            for table in read_source(path, choices_of(session)).tables:
                names |= dict.fromkeys(channel.name for channel in table.channels)
    except TunnelError:
        return []
    return list(names)


def drawn(imported: Imported) -> list[Drawn]:
    """The first records, with their runs."""
    raws = {id(part.raw): part.raw for part in imported.parts}
    unit = imported.campaign.sensor.unit
    return [
        _drawn(raw, [part for part in imported.parts if part.raw is raw], unit)
        for raw in list(raws.values())[:MOST_RECORDS]
    ]


def _drawn(raw: RawRecord, parts: list[ImportedRun], unit: str) -> Drawn:
    marks = tuple(_mark(part, unit) for part in parts)
    return Drawn(raw.id, unit, *points(raw.cleaned.time_s, raw.cleaned.reading), marks)


def points(time: Array, reading: Array) -> tuple[list[float], list[float | None]]:
    """The curve of a record for a chart.

    Args:
        time: shape (n,), s.
        reading: shape (n,).

    Returns:
        Times and readings, few enough to draw; None within a gap.
    """
    from tunnel_lab.plotting.runs import thinned

    when, values = thinned(time, reading)
    return when.tolist(), [None if isnan(value) else value for value in values.tolist()]


def _mark(part: ImportedRun, unit: str) -> Mark:
    time = part.raw.cleaned.time_s
    return Mark(
        part.id,
        part.raw.source.name,
        float(time[part.piece.first]),
        float(time[part.piece.last - 1]),
        *_rest(part, unit),
        part.said[-1] if part.run is None else "",
    )


def _rest(part: ImportedRun, unit: str) -> tuple[float, str]:
    """Where a run rests: as stated, at the centre of its oscillation, or at its end; and that in words."""
    import numpy as np

    from identification.examination.free_motion import centre_of
    from identification.printing import significant, with_std

    if part.rest is not None:
        return part.rest, f"{significant(part.rest)} {unit}, stated and subtracted"
    end = float(np.median(part.reading[-max(part.reading.size // 10, 2) :]))
    if _flat(part.reading):
        return end, f"{significant(end)} {unit}, found where the motion has ended"
    centre = None if part.run is None else centre_of(part.run, 0.0)
    if centre is not None:
        return centre.zero, f"{with_std(centre.zero, centre.std)} {unit}, found"
    return end, f"about {significant(end, 2)} {unit}, found"


def _flat(reading: Array) -> bool:
    """Whether the last tenth of a run visibly stands still."""
    import numpy as np

    tail = reading[-max(reading.size // 10, 2) :]
    low, high = np.quantile(tail, (0.05, 0.95))
    return bool(high - low < _STILL * float(np.ptp(reading)))


class ChoicesPart:
    """The fields.

    Args:
        session: whose files they are about.
        columns: names of the columns in the files.
        changed: called with the name of a choice and its new value; None: found from the files.
    """

    def __init__(self, session: Session, columns: list[str], changed: Changed) -> None:
        from tunnel_sim.files.importing.tables import UNITS

        self._now = choices_of(session)
        self._changed = changed
        angle = [unit for kind, units in UNITS.items() if kind != "time" for unit in units]
        with ui.element("div").classes("fields wide"):
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
            self._text("name", "Conditions in the file names: S{spring}_V{wind_speed}_*")
            self._text("delimiter", "Delimiter of a text file: tab, blank, ; , or |")
            self._text("decimal", "Decimal sign of a text file")
            ui.checkbox(
                "Cut records at releases", value=self._now.cut, on_change=lambda e: changed("cut", e.value)
            )
        show_command(
            f"tunnel import {session.uploads}/* --recipe {session.choices} --out {session.campaign} --yes"
        )

    def _select(self, key: str, label: str, options: list[str], *, several: bool = False) -> None:
        now = getattr(self._now, key)
        value = list(now) if several else now
        shown = [
            *options,
            *(choice for choice in (value if several else [value]) if choice and choice not in options),
        ]

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
