"""Steps 1 to 4 of an import: from files to the runs of a campaign."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.cleaning import resolution
from tunnel_sim.files.importing.column_names import stem
from tunnel_sim.files.importing.condition_names import (
    OF_CAMPAIGN,
    OF_REPEATABILITY,
    RIG_KEYS,
    SPREAD_KEYS,
)
from tunnel_sim.files.importing.condition_table import ConditionTable
from tunnel_sim.files.importing.conditions import Unstated
from tunnel_sim.files.importing.import_statements import ImportStatements
from tunnel_sim.files.importing.imported_run import ImportedRun, imported_run
from tunnel_sim.files.importing.raw_records import RawRecord, raw_records
from tunnel_sim.files.importing.releases import RecordPiece, find_runs, find_runs_of_rate, with_added
from tunnel_sim.files.importing.remarks import ImportRemark
from tunnel_sim.files.importing.source import Source, read_source
from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.reading import check_count, stem_of
from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import (
    Campaign,
    Quantity,
    Repeatability,
    RigProperties,
    SensorProperties,
)
from tunnel_sim.vocabulary.errors import TunnelError, asking, attempt, did_you_mean, together
from tunnel_sim.vocabulary.freedom import ANGLE
from tunnel_sim.vocabulary.record import Array

_FINDERS: Mapping[Quantity, Callable[[Array, Array], list[RecordPiece]]] = {
    "angle": find_runs,
    "rate": find_runs_of_rate,
}
"""How releases are found; a hand that holds the body does not show in accelerations."""


@dataclass(frozen=True, eq=False)
class Imported:
    """The result of reading files.

    Args:
        sizes: of the rig and the scatter between runs, by key of `Conditions`.
    """

    campaign: Campaign
    parts: tuple[ImportedRun, ...]
    sources: tuple[Source, ...]
    choices: ImportChoices
    campaign_remarks: tuple[str, ...]
    sizes: Mapping[str, float] = field(default_factory=dict)

    @property
    def held(self) -> dict[str, dict[str, float]]:
        """Conditions by run, and sizes under the empty name, that become used once the air density is stated."""
        if not any(part.without_density for part in self.parts):
            return {}
        rig = {key: value for key, value in self.sizes.items() if key in _WITH_DENSITY}
        return {"": rig, **{part.id: dict(part.held) for part in self.parts if part.held}}

    def remarks(self, path: Path | None = None) -> list[str]:
        """Remarks on the reading of all files or one, and on changes, each once with its runs."""
        return [*self._with_places(path), *self._own(self.campaign_remarks)]

    def summary(self) -> tuple[list[str], list[str]]:
        """The remarks beside the table of runs, without its numbers: remarks to know, and remarks to judge."""
        lines = self._with_places(short=True)
        judged = [line for line in lines if line.doubt]
        known = [line for line in lines if not line.doubt]
        return [*known, *self._own(self.campaign_remarks)], list(judged)

    def _own(self, remarks: Iterable[str]) -> list[ImportRemark]:
        """Remarks in the words of the campaign's freedom; names of columns, files and runs are kept."""
        channels = {c.quoted for s in self.sources for table in s.tables for c in table.channels}
        names = {*channels, *(s.path.name for s in self.sources), *(part.id for part in self.parts)}
        own = partial(self.campaign.sensor.freedom.words, names=names)
        return [
            ImportRemark(own(one), own(one.short), doubt=one.doubt, motion=one.motion)
            for one in (one if isinstance(one, ImportRemark) else ImportRemark(one) for one in remarks)
        ]

    def _with_places(self, path: Path | None = None, *, short: bool = False) -> list[ImportRemark]:
        """The remarks on files and runs, each once after the places that it concerns."""
        sources = [source for source in self.sources if path in (None, source.path)]
        parts = [part for part in self.parts if path in (None, part.raw.source)]
        found = [(text, s.path.name) for s in sources for table in s.tables for text in table.remarks]
        found += [(text, part.id) for part in parts for text in (*part.raw.remarks, *part.remarks)]
        places: dict[ImportRemark, list[str]] = {}
        found = list(dict.fromkeys(found))
        for remark, place in zip(
            self._own(text for text, _ in found), (place for _, place in found), strict=True
        ):
            key = ImportRemark(remark.short, doubt=remark.doubt) if short else remark
            if place not in places.setdefault(key, []):
                places[key].append(place)
        lines = []
        for remark, names in places.items():
            more = f" and {len(names) - 6} more" if len(names) > 6 else ""
            everywhere = "all runs" if len(names) == len(self.parts) > 1 else ""
            lines.append(
                ImportRemark(f"{everywhere or ', '.join(names[:6]) + more}: {remark}", doubt=remark.doubt)
            )
        return lines


def read_records(
    files: Sequence[Path],
    choices: ImportChoices = ImportChoices(),  # noqa: B008 - frozen
    *,
    conditions: Path | None = None,
    name: str = "",
    later: bool = False,
) -> Imported:
    """Read files as instruments write them; nothing is written, and open ``choices`` are found from the files.

    Args:
        conditions: a table of conditions; None: none.
        name: name of the campaign; empty: the name of the first file.
        later: whether missing air densities may be stated later (`Imported.held`).
    """
    kept = [path for path in files if path.name not in choices.leave_out]
    beside = ImportStatements.of(kept, choices, conditions, several=len(files) > 1, later=later)
    faults: list[TunnelError] = []  # all questions about files and runs are asked at once
    sources: list[Source] = []
    raws: list[RawRecord] = []
    for path in kept:
        try:
            source = read_source(path, choices)
            raws += raw_records(source, beside)
            sources.append(source)
        except TunnelError as fault:
            faults.append(fault)
    freedom = raws[0].sensor.freedom if raws else ANGLE
    beside = beside.about(freedom) if raws or not faults else beside
    with freedom.errors():
        parts, refused = _parts(raws, beside)
    faults += refused
    if faults:
        raise _refusal(faults)
    if not raws:
        what = "every file is left out" if files else "no files"
        raise TunnelError(what, remedy="name at least one")
    kinds = {raw.quantity if raw.reading.motion == "angle" else raw.sensor.unit for raw in raws}
    if len(kinds) > 1:
        remedy = "import one quantity at a time, with --angle"
        raise TunnelError(f"the runs contain {' and '.join(sorted(kinds))}", remedy=remedy)
    runs = {part.id for part in parts}
    for one in (one for one in choices.stretches if one.file is None and one.run not in runs):
        raise TunnelError(f"no run '{one.run}'", where="--start, --end", remedy=did_you_mean(one.run, runs))
    names = {*(part.id for part in parts), *(path.name for path in files)}
    for left in (left for left in choices.leave_out if left not in names):
        what = f"no run or file '{one_line(left, 60)}' to leave out"
        raise TunnelError(what, where="--leave-out", remedy=did_you_mean(left, names))
    count = sum(part.piece.last - part.piece.first for part in parts)
    check_count(count, limits.CAMPAIGN_SAMPLES, "samples in all files", "", "import fewer files at a time")
    sizes = _sizes(parts, beside.choices)
    campaign = _campaign(parts, sizes, name or one_line(stem_of(files[0])), raws[0].sensor)
    resolved, said = _resolved(choices, sources, raws), _campaign_remarks(campaign, beside.table)
    return Imported(campaign, tuple(parts), tuple(sources), resolved, tuple(said), sizes)


def _resolved(choices: ImportChoices, sources: Sequence[Source], raws: Sequence[RawRecord]) -> ImportChoices:
    """The choices, with the properties that all records share, for the recipe."""
    known: dict[str, Any] = {**sources[0].known}
    units = {raw.reading.unit for raw in raws}
    columns = tuple(dict.fromkeys(stem(raw.reading.channel.name) for raw in raws))
    if len(units) == 1 and choices.counts_per_turn is None and choices.calibration is None:
        known["unit"] = units.pop()
    if len(columns) == 1:
        known["angle"] = columns
    found = {key: value for key, value in known.items() if getattr(choices, key) in (None, ())}
    return choices.model_copy(update=found)


def _campaign_remarks(campaign: Campaign, table: ConditionTable | None) -> list[str]:
    """Remarks on the campaign."""
    remarks: list[str] = []
    if (step := campaign.sensor.resolution) is not None:
        levels = "the readings lie on levels that far apart"
        remarks.append(f"resolution {step:.4g} {campaign.sensor.unit}: {levels}")
    if campaign.sensor.zero is not None:
        remarks.append(
            "the runs' stated rests differ: a separate zero is fitted to every run (zero = 'per_run')"
        )
    remarks += [] if table is None else table.remarks
    if table is not None and table.ignored:
        remarks.append(f"columns of {table.path.name} that are not conditions: {', '.join(table.ignored)}")
    return remarks


def _parts(
    raws: Sequence[RawRecord], beside: ImportStatements
) -> tuple[list[ImportedRun], list[TunnelError]]:
    """The runs of all records, cut at releases, and the refusals of others."""
    ids = [raw.id for raw in raws]
    parts: list[ImportedRun] = []
    faults: list[TunnelError] = []
    for at, raw in enumerate(raws):
        label = raw.id if ids.count(raw.id) == 1 else f"{raw.id}-{ids[: at + 1].count(raw.id)}"
        pieces = _pieces(raw, beside.choices)
        found = dict(zip(_names(label, pieces), pieces, strict=True))
        stated = beside.choices.stretches
        added = [one for one in stated if (one.file, one.record) == (raw.source.name, raw.id)]
        for run, piece in with_added(raw.cleaned.time_s, found, added).items():
            part = attempt(faults, partial(imported_run, run, raw, piece, beside))
            parts += [] if part is None else [part]
    return parts, faults


def _pieces(raw: RawRecord, choices: ImportChoices) -> list[RecordPiece]:
    """The runs of a record; a record that the file names is one run, without the hand before its release."""
    time, reading = raw.cleaned.time_s, raw.cleaned.reading
    find = _FINDERS.get(raw.quantity)
    if find is None or not choices.cut or raw.input is not None:
        return [RecordPiece(0, time.size)]
    pieces = find(time, reading)
    if not raw.whole:
        return pieces
    runs = [piece for piece in pieces if not piece.doubt]
    if len(runs) > 1:
        return [RecordPiece(0, time.size, again=runs[1].first)]
    return [RecordPiece(one.first, time.size, held=one.held) for one in runs] or [RecordPiece(0, time.size)]


def _refusal(faults: Sequence[TunnelError]) -> TunnelError:
    """All refusals as one, which is `Unstated` if only the user can answer."""
    found = together(faults)
    if all(isinstance(fault, Unstated) for fault in faults):
        return Unstated(found.what, where=found.where, remedy=found.remedy, options=found.options)
    return found


def _names(label: str, pieces: Sequence[RecordPiece]) -> list[str]:
    """The names of the runs of a record: its own for the only one; other parts are counted separately."""
    kept = sum(not piece.doubt for piece in pieces)
    runs = iter([label] if kept == 1 else [f"{label}-{k}" for k in range(1, kept + 1)])
    others = iter(f"{label}-other-{k}" for k in range(1, len(pieces) - kept + 1))
    return [next(others if piece.doubt else runs) for piece in pieces]


_WITH_DENSITY = ("frontal_area", "reference_length")
"""Sizes that a campaign with wind-on runs takes only if these state their air density."""


def _sizes(parts: Sequence[ImportedRun], choices: ImportChoices) -> dict[str, float]:
    """The sizes of the rig and the scatter between runs, as stated or else from the files."""
    common = choices.conditions.model_dump(include=set(OF_CAMPAIGN), exclude_none=True)
    plausible_values(common, "--set")
    for part in parts:
        for key, value in part.sizes.items():
            if common.setdefault(key, value) != value and getattr(choices.conditions, key) is None:
                what = f"{key} = {value:g}, and {common[key]:g} in another run"
                where = f"{shown(part.raw.source)}, run '{part.id}'"
                raise asking(f"--set {key}=NUMBER", what, where, ", or import them separately")
    return common


def _campaign(
    parts: Sequence[ImportedRun], sizes: Mapping[str, float], name: str, sensor: SensorProperties
) -> Campaign:
    runs = tuple(part.run for part in parts if part.run is not None)
    if not runs:
        part = parts[0]
        what = f"no run can be used; the first one is {part.left_out}"
        remedy = "check --time, --time-unit, --rate, --angle and --unit, or keep it whole with --no-cut"
        raise TunnelError(what, where=f"{shown(part.raw.source)}, run '{part.id}'", remedy=remedy)
    open_density = any(part.without_density for part in parts)
    rig = {
        key: sizes[key] for key in RIG_KEYS if key in sizes and not (open_density and key in _WITH_DENSITY)
    }
    files = list(dict.fromkeys(part.raw.source.name for part in parts))
    used = [part for part in parts if part.run is not None]
    spread = {key.removeprefix(OF_REPEATABILITY): sizes[key] for key in SPREAD_KEYS if key in sizes}
    return Campaign(
        name,
        RigProperties(**rig),
        replace(
            sensor,
            # from the readings in the files, because the subtracted value need not be a whole number of steps
            resolution=resolution([part.reading for part in used]),
            # the subtracted value is as uncertain as a line drawn by hand, independently in each run
            zero="per_run" if len({part.rest for part in used}) > 1 else None,
        ),
        runs,
        one_line(f"Imported from {', '.join(files[:3])}{' and others' if len(files) > 3 else ''}"),
        repeatability=Repeatability(**spread) if spread else None,
    )
