"""Step 4 of an import: a run, cut from its record, with its stated and open conditions."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import cast

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.cleaning import clipped, clock_text, from_rest, from_zero
from tunnel_sim.files.importing.conditions import conditions_of, open_conditions
from tunnel_sim.files.importing.import_statements import ImportStatements
from tunnel_sim.files.importing.raw_records import RawRecord
from tunnel_sim.files.importing.releases import RecordPiece, stated_piece
from tunnel_sim.files.importing.remarks import ImportRemark, doubt, doubt_of_motion
from tunnel_sim.files.plausible import KEEP, checked_record, few_samples
from tunnel_sim.files.reading import stem_of
from tunnel_sim.files.toml_input import one_line, shown
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.errors import TunnelError, counted
from tunnel_sim.vocabulary.input_kinds import INPUTS, InputColumn
from tunnel_sim.vocabulary.inputs import HOLDS, Hold, Input, without_spring_needs_input
from tunnel_sim.vocabulary.quantities import Readings, Times
from tunnel_sim.vocabulary.record import Record

LEFT_OUT = "left out as stated"
"""The remark on a run that the user leaves out."""
_JUDGED = 500_000  # number of samples for counting the cycles of a long record


@dataclass(frozen=True, eq=False)
class ImportedRun:
    """A run, or a stretch mistaken for a run.

    Args:
        rest: the stated reading at rest, which is subtracted, rad (rad/s or rad/s²); None: not stated.
        sizes: sizes of the rig, and scatter between runs, as stated by the file.
        held: conditions that a campaign uses only with an air density that is not yet stated.
        without_density: whether the air density is not yet stated.
    """

    id: str
    raw: RawRecord
    piece: RecordPiece
    run: Run | None
    remarks: tuple[str, ...]
    rest: float | None = None
    sizes: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    without_density: bool = False

    @property
    def reading(self) -> Readings:
        """Reading of the run, before its rest is subtracted."""
        return self.raw.cleaned.reading[self.piece.first : self.piece.last]

    @property
    def left_out(self) -> str:
        """The remark with the reason for leaving the run out; empty if it is used."""
        return self.remarks[-1] if self.run is None else ""


def imported_run(name: str, raw: RawRecord, piece: RecordPiece, beside: ImportStatements) -> ImportedRun:
    """A run of a record.

    Args:
        piece: the part of the record with the run.

    Raises:
        Unstated: when a condition is open that only the user can state.
    """
    choices = beside.choices
    where = shown(raw.source) + ("" if name == one_line(stem_of(raw.source)) else f", run '{name}'")
    stretch = choices.stretch_of(raw.source.name, name)
    piece = stated_piece(raw.cleaned.file_time_s, piece, stretch, where)
    if name in choices.leave_out:
        return ImportedRun(name, raw, piece, None, (LEFT_OUT,))
    if piece.doubt:
        return ImportedRun(name, raw, piece, None, (doubt(f"left out: {piece.doubt}"),))
    kept, sensor = slice(piece.first, piece.last), raw.sensor
    time, reading = raw.cleaned.time_s[kept], raw.cleaned.reading[kept]
    clock = raw.cleaned.file_time_s[kept]
    remarks = _on_the_cut(name, raw, piece, clock, reading, sensor.unit)
    rest = choices.rest if stretch.rest is None else stretch.rest
    if rest is not None:
        reading, remark = from_rest(reading, rest, sensor.unit, where)
        remarks.append(remark)
    rows = raw.rows(float(time[0]), float(time[-1]))
    stated, sizes, said = conditions_of(raw.stated, raw.source, name, rows, beside, where)
    hints = [*raw.stated.unused(rows), *beside.hints[raw.source]]
    named_by = f"{stem_of(raw.source)} {name}"
    driven, common = raw.input is not None, choices.conditions.model_dump()
    asked, windy = open_conditions(stated, common, hints, named_by, where, driven=driven, later=beside.later)
    remarks += [*said, *asked]
    held: dict[str, float] = {}
    if windy:
        held = {key: stated.pop(key) for key in ("spring_stiffness",) if key in stated}
        remarks.append(doubt(f"air_density is not stated (wind-on, {stated['wind_speed']:g} m/s)"))
    drive, said = _input(raw, kept, choices)
    remarks += said
    without_spring_needs_input((stated | held).get("spring_stiffness"), drive, where)
    time = from_zero(time)
    try:
        record, stride = None, time.size // _JUDGED
        release = None if drive is not None else stated.get("release_angle")
        if drive is None and stride > 1:
            # a long record that passes when thinned also passes as a whole, which would take seconds to check
            with suppress(TunnelError):
                checked_record(time[::stride], reading[::stride], "the reading", sensor, release, where)
                record = Record(time, reading)
        if record is None:
            record = checked_record(time, reading, "the reading", sensor, release, where, drive)
    except TunnelError as error:
        return ImportedRun(name, raw, piece, None, (*remarks, doubt(_left_out(error))), rest, sizes)
    if drive is None and stride <= 1 and (few := few_samples(record)):
        remarks.append(doubt_of_motion(few))
    begun = float(clock[0] - record.time_s[0])
    run = Run(name, record, **({"wind_speed": 0.0} | stated), drive=drive, clock_s=begun)
    return ImportedRun(name, raw, piece, run, tuple(remarks), rest, sizes, held, windy)


def _on_the_cut(
    name: str, raw: RawRecord, piece: RecordPiece, clock: Times, reading: Readings, unit: str
) -> list[str]:
    """Remarks on the first and the last sample of a run, and on peaks that its sensor cuts off."""
    remarks: list[str] = []
    first, last = clock_text(float(clock[0])), clock_text(float(clock[-1]))
    if piece.first and piece.held > 0.0:
        free = (
            f"from where on the motion is free: the {piece.held:.3g} s before it are not part of a free decay"
        )
        short = "begins after its release, from where on the motion is free; --start RUN=SECONDS changes it"
        remarks.append(
            doubt_of_motion(f"begins at {first} s, {free}", f"--start {name}=SECONDS changes it", short)
        )
    elif piece.first:
        rate = raw.quantity == "rate"
        at = "at the largest rate after the release" if rate else "where the body is released"
        remarks.append(ImportRemark(f"begins at {first} s, {at}", f"begins {at}"))
    if piece.last < raw.cleaned.time_s.size and piece.stopped:
        fact = f"ends at {last} s, where something stops or pushes the body"
        remarks.append(doubt_of_motion(fact, f"--end {name}=SECONDS changes it"))
    elif piece.last < raw.cleaned.time_s.size:
        why = "with the motion or before the next run"
        remarks.append(ImportRemark(f"ends at {last} s, {why}", f"ends {why}"))
    if piece.again:
        again = clock_text(float(raw.cleaned.file_time_s[piece.again]))
        fact = f"a second release at {again} s, though the file names one run"
        remarks.append(doubt_of_motion(fact, f"--end {name}={again} ends it there"))
    if cut := clipped(reading):
        levels = " and ".join(f"{level:.4g}" for level, _ in cut)
        count = counted(sum(samples.size for _, samples in cut), "sample")
        until = clock_text(max(float(clock[samples[-1]]) for _, samples in cut))
        fact = f"the peaks are cut off at {levels} {unit}: {count} until {until} s"
        remarks.append(doubt_of_motion(fact, f"a later start, --start {name}={until}, leaves them out"))
    return remarks


def _left_out(error: TunnelError) -> str:
    """Why a run is left out, and how to keep it if a statement in the campaign's file permits it."""
    kept = f"; {KEEP} in a campaign.toml" if KEEP in error.remedy else ""
    return f"left out: {error.what}{kept}"


def _input(raw: RawRecord, kept: slice, choices: ImportChoices) -> tuple[Input | None, list[str]]:
    """The input of a run, and remarks; None for a free decay."""
    if raw.input is None:
        return None, []
    column = cast(InputColumn, raw.input.role)
    said: list[str] = []
    order, gain = raw.input_facts.get("drive_hold"), raw.input_facts.get("drive_gain") or None
    hold: Hold | None = choices.input_hold or (HOLDS[int(order)] if order in (0.0, 1.0) else None)
    gain = gain if "drive_gain" in INPUTS[column].keys else None
    kv = raw.input_facts.get("servo_kv") if "servo_kv" in INPUTS[column].keys else None
    if choices.input_hold is None:
        asked = "not stated, linear is assumed; --input-hold zero if a controller holds each command"
        found = f"drive_hold = {hold} from the file"
        said.append(found if order in (0.0, 1.0) else doubt(f"drive_hold: {asked}"))
    said += [] if gain is None else [f"drive_gain = {gain:g} from the file"]
    said += [] if kv is None else [f"servo_kv = {kv:g} from the file"]
    return Input(column, raw.input.values[kept], hold, gain, kv), said
