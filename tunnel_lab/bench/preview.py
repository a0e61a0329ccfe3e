"""Contents of dropped files under the current choices, and the fields for these choices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w
from nicegui import ui

from tunnel_lab.bench.fields import Changed, field_of
from tunnel_lab.bench.parts import asked_in, label_of, name_of, text_of
from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.importing.choices import ImportChoices, Stretch, read_recipe, stated_settings
from tunnel_sim.files.importing.condition_names import SETTABLE
from tunnel_sim.files.importing.imported_run import LEFT_OUT, ImportedRun
from tunnel_sim.files.importing.remarks import ImportRemark
from tunnel_sim.files.toml_input import validate
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.files.importing.raw_records import RawRecord
    from tunnel_sim.files.importing.records import Imported
    from tunnel_sim.vocabulary.record import Array


MOST_RECORDS = 24
"""Maximum number of records drawn."""
CORRECTIONS = tuple(
    key for key in ImportChoices.model_fields if key not in ("leave_out", "stretches", "stated_by")
)
"""The choices with a field; the others are made in the charts, and by leaving runs out."""
_STILL = 0.01  # share of the range of a run's readings: a smaller range looks flat


@dataclass(frozen=True, eq=False)
class Mark:
    """A run in the chart of its record; times by the file's clock.

    Args:
        start: start of the run (the release), s.
        end: time at which the run has come to rest or the next run begins, s.
        rest: the reading at rest, in the reading's unit.
        about: the source of ``rest`` in words, with its uncertainty; or that the user has stated it.
        fault: the reason for leaving the run out; empty if it is used.
        doubts: doubts for the user to judge, in one line each; empty if the run looks like a free decay.
        added: whether the user has added the run.
    """

    run: str
    file: str
    start: float
    end: float
    rest: float
    about: str
    fault: str
    doubts: tuple[str, ...] = ()
    added: bool = False

    @property
    def is_left_out(self) -> bool:
        """Whether the user has left the run out."""
        return self.fault == LEFT_OUT


@dataclass(frozen=True, eq=False)
class DrawnRecord:
    """A record as it is drawn: the time in s, and the reading in its unit, None within a gap.

    Args:
        cut: whether releases can be added: the record is neither driven nor kept whole.
    """

    title: str
    file: str
    cut: bool
    unit: str
    time: list[float]
    reading: list[float | None]
    marks: tuple[Mark, ...]

    @property
    def key(self) -> str:
        """File and name of the record."""
        return f"{self.file}/{self.title}"


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
    """The conditions that are stated for all runs, in the format of ``--set``."""
    numbers = choices.conditions.model_dump(include={*SETTABLE}, exclude_none=True)
    names = choices.stated_by.model_dump(exclude_none=True)
    stated = [f"{key}={text_of(value)}" for key, value in numbers.items()]
    return ", ".join([*stated, *(f"{key}={name}" for key, name in names.items())])


def settings_from(text: str | None) -> dict[str, Any]:
    """The conditions of all runs as choices, from a text in the format of ``--set``.

    Raises:
        TunnelError: when the text is not in this format.
    """
    words = [text] if text and text.strip() else []
    return stated_settings(words, name_of(ImportChoices, "conditions"))


def move(session: Session, mark: Mark, places: Mapping[str, float | None]) -> None:
    """State where a run begins, ends or rests.

    Args:
        places: ``start`` and ``end`` in s by the file's clock, ``rest`` in the reading's unit;
        None: as detected.

    Raises:
        TunnelError: when the end is not after the start.
    """
    stated = choices_of(session).stretch_of(mark.file, mark.run).model_dump() | dict(places)
    first = mark.start if stated["start"] is None else stated["start"]
    last = mark.end if stated["end"] is None else stated["end"]
    if last <= first:
        raise TunnelError(
            f"the end ({last:.4g} s) is not after the release ({first:.4g} s)",
            where=f"run '{mark.run}'",
            remedy="move one of them",
        )
    state(session, {"stretches": [*_stretches_beside(session, mark), stated]})


def _stretches_beside(session: Session, mark: Mark) -> list[Stretch]:
    """The statements on other runs."""
    stretches = choices_of(session).stretches
    return [one for one in stretches if (one.file, one.run) != (mark.file, mark.run)]


def add(session: Session, record: DrawnRecord, at: float) -> str:
    """Add a run with its release at a time of its record, s by the file's clock.

    Returns:
        Name of the run.
    """
    taken = {mark.run for mark in record.marks}
    names = (f"{record.title}-added-{number}" for number in range(1, len(taken) + 2))
    name = next(name for name in names if name not in taken)
    added = {"file": record.file, "run": name, "start": at, "record": record.title}
    state(session, {"stretches": [*choices_of(session).stretches, added]})
    return name


def remove(session: Session, mark: Mark) -> None:
    """Remove an added run with its release, or leave out a detected run."""
    if mark.added:
        state(session, {"stretches": _stretches_beside(session, mark)})
    elif not mark.is_left_out:
        leave_out(session, [*choices_of(session).leave_out, mark.run])


def restore(session: Session, mark: Mark) -> None:
    """Use a run again that the user has left out."""
    leave_out(session, [name for name in choices_of(session).leave_out if name != mark.run])


def read(session: Session) -> tuple[Imported, tuple[TunnelError, ...]]:
    """Read the dropped files; missing air densities are stated on the next page.

    Returns:
        The import, and the faults of the unreadable files.

    Raises:
        TunnelError: for the first fault, as from ``tunnel import``, if no file can be read, or if only the user
            can state a missing condition.
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
        TunnelError: when no file or run has a given name.
    """
    state(session, {"leave_out": tuple(names)})


def drawn(imported: Imported, order: Sequence[str] = ()) -> list[DrawnRecord]:
    """The first records, with their runs; records with a run to judge come first.

    Args:
        order: keys of the records that are already drawn; these keep their places.
    """
    stretches, unit = imported.choices.stretches, imported.campaign.sensor.unit
    added = {(one.file, one.run) for one in stretches if one.record is not None}
    raws = {
        id(part.raw): (part.raw, [each for each in imported.parts if each.raw is part.raw])
        for part in imported.parts
    }
    doubts = {part.id: doubts_of(part) for part in imported.parts}
    places = {key: place for place, key in enumerate(order)}

    def place(found: tuple[RawRecord, list[ImportedRun]]) -> int:
        raw, parts = found
        return places.get(
            f"{raw.source.name}/{raw.id}", len(places) + (not any(doubts[part.id] for part in parts))
        )

    records = []
    for raw, parts in sorted(raws.values(), key=place)[:MOST_RECORDS]:
        time, file, marks = raw.cleaned.file_time_s, raw.source.name, []
        for part in parts:
            start, end = float(time[part.piece.first]), float(time[part.piece.last - 1])
            rest, of_user = _rest(part, unit), (file, part.id) in added
            marks.append(Mark(part.id, file, start, end, *rest, part.left_out, doubts[part.id], of_user))
        cut = imported.choices.cut and not raw.whole and raw.input is None
        curve = points(time, raw.cleaned.reading)
        records.append(DrawnRecord(raw.id, file, cut, unit, *curve, tuple(marks)))
    return records


def doubts_of(part: ImportedRun) -> tuple[str, ...]:
    """The doubts about the motion of a run for the user to judge, one line each, as stated by the import."""
    if part.left_out:
        return () if part.left_out == LEFT_OUT else (part.left_out,)
    return tuple(
        remark.motion for remark in part.remarks if isinstance(remark, ImportRemark) and remark.motion
    )


def points(time: Array, reading: Array) -> tuple[list[float], list[float | None]]:
    """The curve of a record for a chart, with few enough points to draw; None within a gap.

    Args:
        time: times, shape (n,), s.
        reading: readings, shape (n,).
    """
    from tunnel_lab.plotting.runs import thinned

    when, values = thinned(time, reading)
    return when.tolist(), [None if isnan(value) else value for value in values.tolist()]


def _rest(part: ImportedRun, unit: str) -> tuple[float, str]:
    """The reading at rest, and its source in words: a statement, the oscillation's centre, or the run's end."""
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


def choices_to_show(session: Session, asked: str) -> list[str]:
    """The choices, as fields of `ImportChoices`, for which a fault asks, or that the user has stated."""
    stated = choices_of(session).model_fields_set | (
        {"conditions"} if settings_of(choices_of(session)) else set()
    )
    wanted = {*asked_in(asked), *stated}
    return [key for key in CORRECTIONS if key in wanted]


def show_choices(session: Session, keys: Sequence[str], columns: list[str], changed: Changed) -> None:
    """A field for each of some choices."""
    from tunnel_sim.files.importing.units import UNITS

    now = choices_of(session)
    options = {
        "angle": columns,
        "unit": [unit for kind, units in UNITS.items() if kind != "time" for unit in units],
        "time": columns,
        "time_unit": list(UNITS["time"]),
        "input": [*columns, "none"],
    }
    with ui.element("div").classes("fields wide"):
        for key in keys:
            if key == "conditions":
                field = ui.input(label_of(ImportChoices, key), value=settings_of(now)).props(
                    "dense bottom-slots"
                )
                field.props["hint"] = "such as wind_speed=0, air_density=1.2"
                field.on("change", lambda field=field: changed("conditions", field.value))
            else:
                field_of(ImportChoices, key, getattr(now, key), changed, options.get(key))
