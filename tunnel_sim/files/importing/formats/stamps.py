"""Columns with samples stamped by several clocks, such as topics of a robot or channel groups of a measurement.

Each clock has a table. The columns of the other clocks are put onto its stamps: a demand is held until the next
demand, as a controller does, and a measured quantity is interpolated.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tunnel_sim.files.importing.formats.arrays import check_size
from tunnel_sim.files.importing.tables import LEAST_ROWS, Channel, Table
from tunnel_sim.vocabulary.errors import counted, one_line
from tunnel_sim.vocabulary.quantities import Rows, Times

_SAME = 0.01  # share of a step: a shift this small does not change a phase
_DEMAND = re.compile(
    r"(?i)command|cmd|goal|target|set[ _]?point|soll|desired|demand|(?<![a-z])(ref|reference|des|sp)(?![a-z])"
)
"""Words in the name of a column or its clock that denote a demand on a controller."""


@dataclass(frozen=True, eq=False)
class StampedColumns:
    """Columns with the same stamps.

    Args:
        name: name of the clock in messages: a topic, or a channel group.
        time_s: stamps from an origin common to all clocks, in their order, each once.
        remarks: remarks on the stamps.
        facts: single numbers beside the columns, by name.
    """

    name: str
    time_s: Times
    channels: tuple[Channel, ...]
    remarks: tuple[str, ...] = ()
    facts: Mapping[str, float] = field(default_factory=dict)

    @property
    def quoted(self) -> str:
        """The clock's name in a message."""
        return f"'{one_line(self.name, 40)}'"

    @property
    def step(self) -> float:
        """The usual step between stamps, s; 0 for fewer than two."""
        return float(np.median(np.diff(self.time_s))) if self.time_s.size > 1 else 0.0


def in_order(time_s: Times, channels: Sequence[Channel]) -> tuple[Times, tuple[Channel, ...], int]:
    """Stamps in their order with their columns, each stamp once with its last values; and the number left out."""
    order = np.argsort(time_s, kind="stable")
    time_s = time_s[order]
    last = np.append(np.diff(time_s) > 0.0, np.ones(min(1, time_s.size), dtype=bool))
    ordered = tuple(replace(channel, values=channel.values[order][last]) for channel in channels)
    return time_s[last], ordered, int(time_s.size - last.sum())


def stamped_tables(clocks: Sequence[StampedColumns], kind: str, where: str) -> list[Table]:
    """A table for each clock, with the columns of all clocks on its stamps; the first column has its times.

    Args:
        kind: kind of file, for the note.
    """
    merged: list[StampedColumns] = []
    for clock in _with_own_names([clock for clock in clocks if clock.channels and clock.time_s.size]):
        same = next((at for at, other in enumerate(merged) if _one_clock(other, clock)), None)
        if same is None:
            merged.append(clock)
        else:
            first = merged[same]
            channels, remarks = (*first.channels, *clock.channels), (*first.remarks, *clock.remarks)
            merged[same] = replace(first, channels=channels, remarks=remarks)
    # the few stamps of a command are not a record
    long = [clock for clock in merged if clock.time_s.size >= LEAST_ROWS] or merged
    check_size(sum(clock.time_s.size for clock in long) * sum(len(clock.channels) for clock in merged), where)
    facts = {name: value for clock in clocks for name, value in clock.facts.items()}
    return [_table(clock, merged, facts, kind) for clock in long]


def _with_own_names(clocks: Sequence[StampedColumns]) -> list[StampedColumns]:
    """The clocks, with the clock's name prefixed to the name of a column that several clocks have."""
    names = [channel.name for clock in clocks for channel in clock.channels]
    return [
        replace(
            clock,
            channels=tuple(
                replace(one, name=f"{clock.name}/{one.name}") if names.count(one.name) > 1 else one
                for one in clock.channels
            ),
        )
        for clock in clocks
    ]


def _table(
    clock: StampedColumns, clocks: Sequence[StampedColumns], facts: Mapping[str, float], kind: str
) -> Table:
    channels = [Channel("time", clock.time_s, "s"), *clock.channels]
    apart: list[tuple[str, str, str]] = []
    aligned: dict[str, str] = {}
    for other in (other for other in clocks if other is not clock):
        for channel in other.channels:
            held = _DEMAND.search(channel.name) is not None or _DEMAND.search(other.name) is not None
            until = np.inf if held else other.time_s[-1]
            inside = (clock.time_s >= other.time_s[0]) & (clock.time_s <= until)
            if not inside.any():
                ends = [f"from {one.time_s[0]:.6g} to {one.time_s[-1]:.6g} s" for one in (other, clock)]
                why = f"it is stamped {ends[0]}, and {clock.quoted} {ends[1]}"
                apart.append((channel.name, channel.unit, why))
                continue
            values = (_held if held else _interpolated)(clock, other, channel.values)
            channels.append(replace(channel, values=values))
            aligned[channel.name] = (
                f"{channel.quoted} {_aligned(clock, other, clock.time_s[inside], held=held)}"
            )
    size = f"{counted(len(clock.channels), 'column')} of {counted(clock.time_s.size, 'sample')}"
    return Table(
        tuple(channels),
        facts=facts,
        remarks=(f"{kind}: {size} of {clock.quoted}", *clock.remarks),
        native=tuple(one.name for one in clock.channels) if len(clocks) > 1 else (),
        apart=tuple(apart),
        aligned=aligned,
    )


def _one_clock(first: StampedColumns, second: StampedColumns) -> bool:
    """Whether two clocks have the same stamps, to a hundredth of a step."""
    if first.time_s.size != second.time_s.size:
        return False
    return float(np.abs(first.time_s - second.time_s).max()) < _SAME * first.step


def _held(clock: StampedColumns, other: StampedColumns, column: Rows) -> Rows:
    """The last value before or at each stamp of a clock; NaN before the first."""
    good = np.isfinite(column)
    values = np.append(np.nan, column[good])
    # each clock rounds a common stamp differently
    return values[np.searchsorted(other.time_s[good], clock.time_s + _SAME * clock.step, side="right")]


def _interpolated(clock: StampedColumns, other: StampedColumns, column: Rows) -> Rows:
    """The values on straight lines between stamps; NaN before the first stamp and after the last."""
    good = np.isfinite(column)
    if not good.any():
        return np.full(clock.time_s.size, np.nan)
    return np.interp(clock.time_s, other.time_s[good], column[good], left=np.nan, right=np.nan)


def _aligned(clock: StampedColumns, other: StampedColumns, stamps: Times, *, held: bool) -> str:
    """The remark on a column put onto some stamps of a clock: how much the stamps differ."""
    after = np.searchsorted(other.time_s, stamps, side="right")
    age = stamps - other.time_s[after - 1]
    ahead = np.append(other.time_s, np.inf)[after] - stamps
    gap = 1e3 * (age if held else np.minimum(age, ahead))
    way, beside = ("held", "after its last stamp") if held else ("interpolated", "off its nearest stamp")
    by = f"by {np.median(gap):.3g} ms (median; at most {gap.max():.3g} ms)"
    sizes = f"({counted(other.time_s.size, 'stamp')} beside {clock.time_s.size})"
    return f"{sizes} is {way} onto the stamps of {clock.quoted}, {beside} {by}"
