"""From files to the runs of a campaign."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tunnel_sim.files.campaign_io import checked_record
from tunnel_sim.files.importing.choices import RIG_KEYS, RUN_KEYS, Conditions, ImportChoices
from tunnel_sim.files.importing.cleaning import (
    Cleaned,
    cleaned,
    from_zero,
    resolution,
    restarts,
    without_overflow,
)
from tunnel_sim.files.importing.columns import Pair, find_pairs, stem
from tunnel_sim.files.importing.conditions import ConditionTable, from_facts, from_name, name_pattern
from tunnel_sim.files.importing.conversion import (
    Calibration,
    in_radians,
    in_seconds,
    read_calibration,
    sample_interval,
)
from tunnel_sim.files.importing.cutting import Piece, find_runs
from tunnel_sim.files.importing.source import Channel, Source, Table, read_source
from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.reading import check_count
from tunnel_sim.files.toml_input import one_line, shown, validate
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import Campaign, Quantity, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array, Record

_LEAST_ROWS = 16  # a shorter table beside longer ones is one of conditions or sizes
_JUDGED = 500_000  # samples in which the cycles of a long record are counted
_WIND_ON = re.compile(r"wind[\s_-]*on(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Raw:
    """A record of a file, cleaned but not yet cut.

    Args:
        id: of its runs, without their number.
        source: the file.
        column: the reading's column.
        cleaned: times and readings.
        quantity: what the readings are.
        unit: that the readings had in the file.
        stated: conditions in the file.
        said: how it was read, and what was changed.
    """

    id: str
    source: Path
    column: str
    cleaned: Cleaned
    quantity: Quantity
    unit: str
    stated: dict[str, float]
    said: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Part:
    """A run, or what was taken for one.

    Args:
        id: of the run.
        raw: the record in which it lies.
        piece: its samples.
        run: the run; None where it is left out.
        said: why it is left out, or what is assumed of it.
    """

    id: str
    raw: Raw
    piece: Piece
    run: Run | None
    said: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Imported:
    """What was read from files.

    Args:
        campaign: the runs that can be used.
        parts: these and the others, in the order of the files.
        sources: the files.
        choices: those of the user, and what was found instead of the others.
        said: remarks on the campaign.
    """

    campaign: Campaign
    parts: tuple[Part, ...]
    sources: tuple[Source, ...]
    choices: ImportChoices
    said: tuple[str, ...]

    def remarks(self, path: Path | None = None) -> list[str]:
        """How the files were read and what was changed, each once with the runs that it concerns.

        Args:
            path: of the file to speak of; None: of all files.
        """
        sources = [source for source in self.sources if path in (None, source.path)]
        parts = [part for part in self.parts if path in (None, part.raw.source)]
        found = [(text, s.path.name) for s in sources for table in s.tables for text in table.said]
        found += [(text, part.id) for part in parts for text in (*part.raw.said, *part.said)]
        places: dict[str, list[str]] = {}
        for text, place in found:
            places.setdefault(text, []).append(place)
        everywhere = len(self.parts)
        lines = [
            f"{'all runs' if len(names) == everywhere > 1 else _listed(names)}: {text}"
            for text, names in places.items()
        ]
        return [*lines, *self.said]


def _listed(names: Sequence[str]) -> str:
    names = list(dict.fromkeys(names))
    return ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")


def read_records(
    files: Sequence[Path],
    choices: ImportChoices = ImportChoices(),  # noqa: B008 - frozen
    *,
    conditions: Path | None = None,
    name: str = "",
) -> Imported:
    """Read files as instruments write them.

    Args:
        files: one or more; each holds one run, several side by side, or several one after another.
        choices: what is known about them; the rest is found.
        conditions: a table of conditions of the files or runs.
        name: of the campaign; the first file's when empty.

    Returns:
        The runs, with remarks on how they were read. Nothing is written.

    Raises:
        TunnelError: for the first fault, in one line that says what to give.
    """
    calibration = read_calibration(choices.calibration)
    pattern = None if choices.name is None else name_pattern(choices.name)
    table = None if conditions is None else ConditionTable(conditions)
    sources: list[Source] = []
    raws: list[Raw] = []
    for path in files:
        source = read_source(path, choices)
        named = from_name(pattern, path)
        for one in _records_of(source):
            raws += _raws(source, one, choices, calibration, named, several=len(files) > 1)
        sources.append(source)
    if not raws:
        raise TunnelError("no files", remedy="name at least one")
    kinds = {raw.quantity for raw in raws}
    if len(kinds) > 1:
        raise TunnelError(
            f"the runs hold {' and '.join(sorted(kinds))}",
            remedy="import one quantity at a time, with --angle",
        )
    parts = _parts(_with_unique_ids(raws), choices, table)
    count = sum(part.piece.last - part.piece.first for part in parts)
    check_count(count, limits.CAMPAIGN_SAMPLES, "samples in all files", "", "import fewer files at a time")
    campaign = _campaign(parts, choices, name or one_line(files[0].stem), raws[0].quantity)
    known = {**sources[0].known, **_found(raws, choices)}
    resolved = choices.model_copy(
        update={k: v for k, v in known.items() if getattr(choices, k) in (None, ())}
    )
    return Imported(campaign, tuple(parts), tuple(sources), resolved, _on_campaign(campaign, table))


def _records_of(source: Source) -> list[Table]:
    """The tables of a file that are long enough for a record; all, where none is."""
    long = [table for table in source.tables if table.channels[0].values.size >= _LEAST_ROWS]
    return long or list(source.tables)


def _raws(
    source: Source,
    table: Table,
    choices: ImportChoices,
    calibration: Calibration | None,
    named: dict[str, float],
    *,
    several: bool,
) -> list[Raw]:
    """The records of a table."""
    where = shown(source.path) + (f", {one_line(table.part)}" if table.part else "")
    found = []
    for pair in find_pairs(table, choices, where):
        said = [*pair.said]
        time = _times(pair, table, choices, said, where)
        values = without_overflow(pair.reading.values, said)
        reading = Channel(pair.reading.name, values, pair.reading.unit)
        readings, quantity, unit = in_radians(reading, choices, calibration, said, where)
        time, readings = _within(time, readings, choices, said)
        names = [source.path.stem if several or not (table.part or pair.run) else "", table.part, pair.run]
        name = one_line("-".join(part for part in names if part))
        stated = from_facts(table.facts) | named
        said += [f"{key} = {value:g} from the file" for key, value in stated.items()]
        starts = [0, *restarts(time[np.isfinite(time)] if np.isfinite(time).all() else time), time.size]
        if len(starts) > 2:
            said.append(f"the clock starts anew {len(starts) - 2} times: another run each")
        for place, (a, b) in enumerate(itertools.pairwise(starts), 1):
            clean = cleaned(time[a:b], readings[a:b])
            label = name if len(starts) == 2 else f"{name}-{place}"
            if clean.time_s.size < 2:
                raise TunnelError("fewer than two samples", where=where, remedy="leave it out")
            found.append(
                Raw(
                    label, source.path, pair.reading.name, clean, quantity, unit, stated, (*said, *clean.said)
                )
            )
    return found


def _times(pair: Pair, table: Table, choices: ImportChoices, said: list[str], where: str) -> Array:
    """The times of a run, s."""
    if pair.time is not None:
        values = without_overflow(pair.time.values, said)
        return in_seconds(Channel(pair.time.name, values, pair.time.unit), choices, said)
    interval, origin = sample_interval(table.facts, choices)
    if interval is None:
        raise TunnelError("no column of times", where=where, remedy="give --time NAME, or --rate in Hz")
    said.append(f"times at {1.0 / interval:.6g} Hz: {origin}")
    return np.arange(pair.reading.values.size, dtype=np.float64) * interval


def _within(time: Array, reading: Array, choices: ImportChoices, said: list[str]) -> tuple[Array, Array]:
    """The samples between the stated start and end."""
    first = -np.inf if choices.start is None else choices.start
    last = np.inf if choices.end is None else choices.end
    if choices.start is None and choices.end is None:
        return time, reading
    # Stamps are decimals: a start at one of them includes it.
    slack = 1e-9 * max(abs(first) if np.isfinite(first) else 0.0, abs(last) if np.isfinite(last) else 0.0)
    kept = (time >= first - slack) & (time <= last + slack)
    said.append(f"{int(kept.sum())} of {time.size} samples lie from --start to --end")
    return time[kept], reading[kept]


def _with_unique_ids(raws: Sequence[Raw]) -> list[tuple[str, Raw]]:
    names = [raw.id for raw in raws]
    seen: dict[str, int] = {}
    result = []
    for raw in raws:
        seen[raw.id] = seen.get(raw.id, 0) + 1
        result.append((raw.id if names.count(raw.id) == 1 else f"{raw.id}-{seen[raw.id]}", raw))
    return result


def _parts(
    named: Sequence[tuple[str, Raw]], choices: ImportChoices, table: ConditionTable | None
) -> list[Part]:
    parts = []
    for label, raw in named:
        time, reading = raw.cleaned.time_s, raw.cleaned.reading
        angle = raw.quantity == "angle"
        pieces = find_runs(time, reading) if choices.cut and angle else [Piece(0, time.size)]
        for number, piece in enumerate(pieces, 1):
            name = label if len(pieces) == 1 else f"{label}-{number}"
            parts.append(_part(name, raw, piece, choices, table))
    return parts


def _part(name: str, raw: Raw, piece: Piece, choices: ImportChoices, table: ConditionTable | None) -> Part:
    time, reading = (
        raw.cleaned.time_s[piece.first : piece.last],
        raw.cleaned.reading[piece.first : piece.last],
    )
    said = _on_cut(raw.cleaned.time_s, piece)
    given = choices.conditions.model_dump(include=set(RUN_KEYS), exclude_none=True)
    stated = raw.stated | (table.of(raw.source, name) if table is not None else {}) | given
    where = f"{shown(raw.source)}, run '{name}'"
    validate(Conditions, stated, raw.source)
    plausible_values(stated, where)
    if "wind_speed" not in stated:
        if _WIND_ON.search(f"{raw.source.stem} {name}"):
            raise TunnelError(
                "the name says that the wind is on, but not how fast",
                where=where,
                remedy="give --set wind_speed=SPEED (m/s), --conditions or --name",
            )
        said.append("wind_speed is not stated: wind-off is assumed")
    if stated.get("wind_speed", 0.0) > 0.0 and "air_density" not in stated:
        raise TunnelError(
            f"wind-on ({stated['wind_speed']:g} m/s) without air_density",
            where=where,
            remedy="give --set air_density=1.2 (kg/m3, about 1.2 for air)",
        )
    try:
        record = _judged(from_zero(time), reading, raw.quantity, stated.get("release_angle"), where)
    except TunnelError as error:
        return Part(name, raw, piece, None, (*said, f"left out: {error.what}"))
    run = Run(name, record, **({"wind_speed": 0.0} | stated))
    return Part(name, raw, piece, run, tuple(said))


def _judged(
    time: Array, reading: Array, quantity: Quantity, release_angle: float | None, where: str
) -> Record:
    """The record, unless a campaign cannot hold it."""
    sensor = SensorProperties(quantity=quantity)
    stride = time.size // _JUDGED
    if stride > 1:
        # A long record that passes when thinned out passes as a whole, which takes seconds to find out.
        with suppress(TunnelError):
            checked_record(time[::stride], reading[::stride], "the reading", sensor, release_angle, where)
            return Record(time, reading)
    return checked_record(time, reading, "the reading", sensor, release_angle, where)


def _on_cut(time: Array, piece: Piece) -> list[str]:
    said = []
    if piece.first:
        said.append(f"begins at {time[piece.first]:.4g} s, where the body is released")
    if piece.last < time.size:
        said.append(f"ends at {time[piece.last - 1]:.4g} s, with the motion or before the next run")
    return said


def _campaign(parts: Sequence[Part], choices: ImportChoices, name: str, quantity: Quantity) -> Campaign:
    runs = tuple(part.run for part in parts if part.run is not None)
    if not runs:
        part = parts[0]
        raise TunnelError(
            f"no run can be used; the first one is {part.said[-1]}",
            where=f"{shown(part.raw.source)}, run '{part.id}'",
            remedy="check --time, --time-unit, --rate, --angle and --unit, or keep it whole with --no-cut",
        )
    files = list(dict.fromkeys(part.raw.source.name for part in parts))
    rig = choices.conditions.model_dump(include=set(RIG_KEYS))
    plausible_values(rig, "--set")
    return Campaign(
        name,
        RigProperties(**rig),
        SensorProperties(
            resolution=resolution([run.record.yaw_rad for run in runs]),
            quantity=None if quantity == "angle" else quantity,
        ),
        runs,
        one_line(f"Imported from {', '.join(files[:3])}{' and others' if len(files) > 3 else ''}"),
    )


def _found(raws: Sequence[Raw], choices: ImportChoices) -> dict[str, object]:
    """What was found, for a recipe: names and units that all records share."""
    units = {raw.unit for raw in raws}
    columns = tuple(dict.fromkeys(stem(raw.column) for raw in raws))
    counted = choices.counts_per_turn is not None or choices.calibration is not None
    return {
        **({"unit": units.pop()} if len(units) == 1 and not counted else {}),
        **({"angle": columns} if len(columns) == 1 else {}),
    }


def _on_campaign(campaign: Campaign, table: ConditionTable | None) -> tuple[str, ...]:
    said = []
    step = campaign.sensor.resolution
    if step is not None:
        said.append(
            f"resolution {step:.4g} {campaign.sensor.unit}: the readings lie on levels that far apart"
        )
    if table is not None and table.ignored:
        said.append(f"columns of {table.path.name} that are not conditions: {', '.join(table.ignored)}")
    return tuple(said)
