"""What is read from dropped files, with the choices stated so far; nothing of it is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from tunnel_lab.bench.workspace import Session
from tunnel_sim.files.importing.choices import ImportChoices, read_recipe
from tunnel_sim.files.toml_input import validate
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.files.importing.raw_records import Raw
    from tunnel_sim.files.importing.records import Imported, Part

MOST_RECORDS = 24
"""At most this many records are drawn."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A run in the chart of its record, times from the record's first sample.

    Args:
        file: the file that holds it.
        start: of the run: the release, s.
        end: where it has come to rest, or the next run begins, s.
        rest: the angle at which it rests at the end, in the reading's unit.
        fault: why the run is left out; empty where it is used.
    """

    run: str
    file: str
    start: float
    end: float
    rest: float
    fault: str


@dataclass(frozen=True, eq=False)
class Drawn:
    """A record as it is drawn.

    Args:
        title: of the chart.
        unit: of the readings.
        time: s, few enough to draw.
        reading: in the unit.
        marks: the runs in it.
    """

    title: str
    unit: str
    time: list[float]
    reading: list[float]
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
    write_whole(
        session.choices, tomli_w.dumps({"schema_version": 1, "choices": _without_none(stated)}).encode()
    )


def move(session: Session, mark: Mark, *, start: float | None = None, end: float | None = None) -> None:
    """State where a run begins or ends.

    Args:
        mark: the run as it is.
        start: s from the record's first sample; None: as it is.
        end: s from the record's first sample; None: as it is.

    Raises:
        TunnelError: when the end is not after the start.
    """
    choices = choices_of(session)
    kept = {(one.file, one.run): one for one in choices.stretches}
    now = kept.pop((mark.file, mark.run), None)
    first, last = (mark.start, mark.end) if now is None else (now.start, now.end)
    first, last = first if start is None else max(start, 0.0), last if end is None else end
    if last <= first:
        raise TunnelError(
            f"the end ({last:.4g} s) is not after the release ({first:.4g} s)",
            where=f"run '{mark.run}'",
            remedy="move one of them",
        )
    stated = {"file": mark.file, "run": mark.run, "start": first, "end": last}
    state(session, {"stretches": [*(one.model_dump() for one in kept.values()), stated]})


def read(session: Session) -> Imported:
    """Read the dropped files.

    Raises:
        TunnelError: for the first fault, as ``tunnel import`` does.
    """
    from tunnel_sim.files.importing.records import read_records

    return read_records(files_of(session), choices_of(session), name=session.name)


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


def _drawn(raw: Raw, parts: list[Part], unit: str) -> Drawn:
    from tunnel_lab.plotting.import_figure import thinned

    time, reading = thinned(raw.cleaned.time_s, raw.cleaned.reading)
    marks = tuple(_mark(part) for part in parts)
    return Drawn(raw.id, unit, time.tolist(), reading.tolist(), marks)


def _mark(part: Part) -> Mark:
    import numpy as np

    time, reading = part.raw.cleaned.time_s, part.raw.cleaned.reading
    last = part.piece.last - 1
    end = reading[max(part.piece.first, last - max((last - part.piece.first) // 10, 1)) : last + 1]
    fault = part.said[-1] if part.run is None else ""
    return Mark(
        part.id,
        part.raw.source.name,
        float(time[part.piece.first]),
        float(time[last]),
        float(np.median(end)),
        fault,
    )


def _without_none(value: Any) -> Any:
    """TOML has no null."""
    if isinstance(value, dict):
        return {key: _without_none(one) for key, one in value.items() if one is not None}
    return [_without_none(one) for one in value] if isinstance(value, list) else value
