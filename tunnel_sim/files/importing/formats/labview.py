"""LabVIEW measurement files (LVM): text in segments with headers that state the units and clocks of the columns."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np

from tunnel_sim.files.importing.formats.layout import Layout, distinct, facts_in
from tunnel_sim.files.importing.formats.text import Dialect, as_utf8, check_table, frame_of, tables_of
from tunnel_sim.files.importing.formats.waveforms import Waveform, aligned_tables
from tunnel_sim.files.importing.tables import Channel, Table
from tunnel_sim.files.importing.units import known_unit, split_unit
from tunnel_sim.files.reading import check_lines
from tunnel_sim.vocabulary.errors import TunnelError, counted
from tunnel_sim.vocabulary.quantities import Rows

MAGIC = b"LabVIEW Measurement"
_END = re.compile(rb"(?m)^\*\*\*End_of_Header\*\*\*.*$\n?")
_BEGIN = re.compile(rb"(?m)^Channels\b")
_SIGNS = {"tab": "\t", "comma": ",", "semicolon": ";"}
_KEYS = (
    "LabVIEW Measurement", "Writer_Version", "Reader_Version", "Separator", "Decimal_Separator", "Multi_Headings",
    "X_Columns", "Time_Pref", "Date", "Time", "Channels", "Samples", "Y_Unit_Label", "Y_Dimension", "X_Dimension",
    "X_Unit_Label", "X0", "Delta_X",
)  # fmt: skip
"""Keys of the format; others are the user's own."""
_X, _COMMENT = "X_Value", "Comment"
_NEAR = 0.1  # share of a step: the next segment of a record begins one step after the last sample
_RIGHT = 1e-3  # share of a step: a stated step is rounded
_SINCE_1904 = 1e9  # s: a greater X0 is counted from 1904


@dataclass(frozen=True)
class _Header:
    """The statements of a header, by key: the cells after the key, each above its column of numbers."""

    cells: Mapping[str, Sequence[str]]
    lines: Sequence[str]

    def text(self, key: str, column: int) -> str:
        """The header's statements about a column."""
        cells = self.cells.get(key, ())
        return cells[column - 1].strip() if 0 < column <= len(cells) else ""

    def number(self, key: str, column: int) -> float:
        """A number that the header states for a column; NaN if it states none."""
        try:
            return float(self.text(key, column).replace(",", "."))
        except ValueError:
            return float("nan")

    def since(self, column: int) -> int | None:
        """The start of a column, ns since 1970; None if it is not stated."""
        date = re.fullmatch(r"(\d{4})/(\d{1,2})/(\d{1,2})", self.text("Date", column))
        time = re.fullmatch(r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d+))?", self.text("Time", column))
        if date is None or time is None:
            return None
        year, month, day = map(int, date.groups())
        hour, minute, second = map(int, time.groups()[:3])
        try:
            whole = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:
            return None
        return int(whole.timestamp()) * 10**9 + int((time[4] or "0")[:9].ljust(9, "0"))


def read_labview_tables(content: bytes, where: str) -> tuple[list[Table], dict[str, str]]:
    """The tables of an LVM file, one for each segment and clock; segments of one record are joined."""
    content, encoding = as_utf8(content, where)
    check_lines(content, where, "export the file again")
    content = content.replace(b"\r\n", b"\n")
    ends = list(_END.finditer(content))
    head = _header(content[: ends[0].start()] if ends else b"", None)
    if len(ends) < 2:
        remedy = "export the file again with its segment headers, or remove all lines above the names"
        raise TunnelError("an LVM file without a header of its columns", where=where, remedy=remedy)
    sign = _SIGNS.get(head.text("Separator", 1).lower(), "\t")
    comma = any(re.match(r"Decimal_Separator[\t;,],", line) for line in head.lines)
    dialect = Dialect(sign, "," if comma else ".", 0)
    begins = []
    for before, end in pairwise(ends):
        marks = list(_BEGIN.finditer(content, before.end(), end.start()))
        if not marks:
            raise TunnelError("an LVM header without Channels", where=where, remedy="export the file again")
        begins.append(marks[-1].start())
    segments: list[list[Table]] = []
    for begin, end, after in zip(begins, ends[1:], [*begins[1:], len(content)], strict=True):
        header = _header(content[begin : end.start()], dialect)
        name = f"LabVIEW file ({encoding})"
        found = _segment(content[end.end() : after], header, head, dialect, name, where)
        if segments and found and (joined := _joined(segments[-1], found)):
            segments[-1] = joined
        elif found:
            segments.append(found)
    parts = [f"segment {i}" if len(segments) > 1 else "" for i in range(1, len(segments) + 1)]
    return [
        replace(table, part=part) for part, tables in zip(parts, segments, strict=True) for table in tables
    ], {}


def _header(content: bytes, dialect: Dialect | None) -> _Header:
    lines = content.decode(errors="replace").splitlines()
    cells: dict[str, Sequence[str]] = {}
    for line in lines:
        key, *rest = dialect.split(line) if dialect else re.split(r"[\t,;]", line)
        if key:
            cells.setdefault(key.strip(), rest)
    return _Header(cells, lines)


def _segment(
    content: bytes, header: _Header, head: _Header, dialect: Dialect, kind: str, where: str
) -> list[Table]:
    """The tables of the numbers of a segment."""
    line, _, body = content.strip(b"\n").partition(b"\n")
    names = dialect.split(line.decode(errors="replace"))
    while names and not names[-1]:
        names.pop()
    if not names or not body.strip():
        return []
    check_table(body, len(names), where)
    dialect = replace(dialect, width=len(names))
    texts = {i for i, name in enumerate(names) if name == _COMMENT}
    split = [split_unit(name) for name in names]
    labels = _labels(names, header)
    units = [
        (_unit(header, labels[i]) or own) if i in labels else "s" if _is_time(header) else ""
        for i, (_, own) in enumerate(split)
    ]
    layout = Layout(0, tuple(distinct([name for name, _ in split])), tuple(units), headed=True, facts={})
    frame = frame_of(body, dialect, layout, texts, None, where)
    (table,) = tables_of(frame, layout, dialect.decimal, None, Table((), remarks=(kind,)))
    own = [one for one in (*head.lines, *header.lines) if re.split(r"[\t,;]", one)[0] not in _KEYS]
    stated = {key: " ".join(filter(None, cells)) for h in (head, header) for key, cells in h.cells.items()}
    facts = facts_in(own)
    notes = {
        key: text
        for key, text in stated.items()
        if key not in _KEYS and text.strip() and not facts_in([f"{key}: {text}"])
    }
    tables = _by_clocks(table.channels, labels, header, kind)
    return [
        replace(
            one,
            facts={**facts, **one.facts},
            texts={**notes, **one.texts},
            remarks=(*one.remarks, *table.remarks[1:]),
        )
        for one in tables
    ]


def _labels(names: Sequence[str], header: _Header) -> dict[int, int]:
    """The place in the header of each column of readings, by its index."""
    readings = [i for i, name in enumerate(names) if not name.startswith((_X, _COMMENT))]
    cells = [cell.strip() for cell in header.cells.get("Delta_X", header.cells.get("Samples", ()))]
    filled = [i for i, cell in enumerate(cells, 1) if cell]
    # The statements are above their columns, or one after another.
    compact = filled == list(range(1, len(readings) + 1)) and filled != readings
    return {i: (place if compact else i) for place, i in enumerate(readings, 1)}


def _unit(header: _Header, place: int) -> str:
    text = header.text("Y_Unit_Label", place)
    return known_unit(text) or text


def _is_time(header: _Header) -> bool:
    dimensions = {cell.strip().lower() for cell in header.cells.get("X_Dimension", ()) if cell.strip()}
    return dimensions <= {"time"}


def _by_clocks(
    channels: Sequence[Channel], labels: Mapping[int, int], header: _Header, kind: str
) -> list[Table]:
    """One table if all readings share the columns of times; else one for each stated clock."""
    readings = [channel for channel in channels if channel.place - 1 in labels]
    clocks = [channel for channel in channels if channel.place - 1 not in labels and channel.name != _COMMENT]
    waves = []
    for channel in readings:
        before = [clock for clock in clocks if clock.place < channel.place]
        clock = before[-1] if before else None
        place = labels[channel.place - 1]
        step, offset = (header.number(key, place) for key in ("Delta_X", "X0"))
        values = channel.values
        known = np.flatnonzero(np.isfinite(values))
        if clock is not None and len(clocks) > 1:  # a column of times for each reading
            times = clock.values[known]
            offset = float(times[0]) if times.size else offset
            steps = np.diff(times)
            usual = float(np.median(steps)) if steps.size else 0.0
            step = usual if steps.size and float(np.ptp(steps)) < _NEAR * usual else 0.0  # else not even
        count = int(known[-1]) + 1 if known.size else 0
        since = header.since(place) if not offset > _SINCE_1904 else None
        step, offset = (number if np.isfinite(number) else 0.0 for number in (step, offset))
        waves.append(Waveform(replace(channel, values=values[:count]), step, offset, since))
    pairs = zip(readings, waves, strict=True)
    if clocks and all(_agree(clocks, channel, wave, waves[0], readings[0]) for channel, wave in pairs):
        size = f"{counted(len(readings), 'column')} of {counted(clocks[0].values.size, 'sample')}"
        return [Table((clocks[0], *readings), remarks=(f"{kind}, {size} beside their times",))]
    tables = aligned_tables(waves, kind, "Delta_X")
    if len(tables) > 1 or not waves or not waves[0].timed:
        return tables
    first, table = waves[0], tables[0]
    clock = Channel(_X, first.offset + first.step * np.arange(first.size, dtype=np.float64), "s")
    remarks = (f"{table.remarks[0]}, at the times X0 + i Delta_X of the header", *table.remarks[1:])
    return [replace(table, channels=(clock, *table.channels), remarks=remarks)]


def _agree(
    clocks: Sequence[Channel], channel: Channel, wave: Waveform, first: Waveform, of_first: Channel
) -> bool:
    """Whether the rows of a reading are at its times according to the header, by the first column of times."""
    if len(clocks) > 1:
        own = [clock for clock in clocks if clock.place < channel.place][-1]
        known = np.isfinite(channel.values)
        return bool(np.array_equal(own.values[known], clocks[0].values[known]))
    known, before = (np.flatnonzero(np.isfinite(one.values)) for one in (channel, of_first))
    if known.size < 2 or before.size < 2 or not wave.timed:
        return True
    times: Rows = clocks[0].values
    step = float(np.median(np.diff(times[known])))
    start = float(times[known[0]] - times[before[0]])
    late = abs(start - wave.after(first)) > 0.5 * wave.step
    return not late and abs(step - wave.step) < _RIGHT * wave.step


def _joined(before: Sequence[Table], after: Sequence[Table]) -> list[Table]:
    """Two segments of one record with consecutive times, joined; empty if they are two records."""
    if len(before) != 1 or len(after) != 1:
        return []
    first, second = before[0], after[0]
    columns = [[(c.name, c.unit, c.place) for c in table.channels] for table in (first, second)]
    clock = first.channels[0] if first.channels[0].name.startswith(_X) else None
    if columns[0] != columns[1] or clock is None or clock.values.size < 2 or first.native or second.native:
        return []
    step = float(np.median(np.diff(clock.values)))
    if not abs(second.channels[0].values[0] - clock.values[-1] - step) < _NEAR * step:
        return []
    channels = tuple(
        replace(c, values=np.concatenate([c.values, d.values]))
        for c, d in zip(first.channels, second.channels, strict=True)
    )
    remark = "segments that follow one another are joined"
    said = first.remarks if remark in first.remarks else (*first.remarks, remark)
    return [replace(first, channels=channels, remarks=said)]
