"""Columns with their own clocks, as in TDMS and LabVIEW files: aligned by the times that the file states.

Samples that coincide are put in one row. Nothing is interpolated: a column is not in the table of another
column unless their samples coincide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.tables import Channel, Table
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import counted, one_line
from tunnel_sim.vocabulary.quantities import Rows, Seconds

_SAME = 0.01  # share of a step: stamps are rounded, and a shift this small does not change a phase
_FOLLOWS = 0.01  # share of its standard deviation: maximum distance of samples from a straight line


@dataclass(frozen=True, eq=False)
class Waveform:
    """A column with its clock.

    Args:
        step: step, s; 0 if none is stated.
        offset: offset of its first sample from the start, s.
        since: the start, ns since 1970; None if none is stated.
        facts: numbers that are stated beside it.
        texts: texts that are stated beside it.
    """

    channel: Channel
    step: Seconds
    offset: Seconds = 0.0
    since: int | None = None
    facts: Mapping[str, float] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.channel.values.size)

    @property
    def timed(self) -> bool:
        """Whether the clock states a step that is possible."""
        return 1.0 / limits.FASTEST_RATE <= self.step <= 1.0 / limits.SLOWEST_RATE

    def after(self, other: Waveform) -> Seconds:
        """The time from the first sample of another waveform to its own first sample."""
        between = 0 if self.since is None or other.since is None else self.since - other.since
        return 1e-9 * between + (self.offset - other.offset)


def aligned_tables(waves: Sequence[Waveform], kind: str, step_fact: str) -> list[Table]:
    """A table for each clock of some waveforms, with the columns that can be aligned with it.

    Args:
        kind: kind of file, and the place in it, for the note.
        step_fact: name of the number that states the step of a table.
    """
    clocks: list[list[Waveform]] = []
    for wave in sorted(waves, key=lambda one: not one.timed):
        own = [clock for clock in clocks if _one_clock(clock[0], wave)]
        if len(own) == 1:
            own[0].append(wave)
        else:
            clocks.append([wave])
    return [_table(clock, waves, kind, step_fact, several=len(clocks) > 1) for clock in clocks]


def _table(
    clock: Sequence[Waveform], waves: Sequence[Waveform], kind: str, step_fact: str, *, several: bool
) -> Table:
    first = clock[0]
    channels, apart, remarks = [], [], []
    for wave in waves:
        values = wave.channel.values if wave in clock else _on_clock(first, wave)
        if isinstance(values, str):
            apart.append((wave.channel.name, wave.channel.unit, values))
            continue
        channels.append(replace(wave.channel, values=values))
        if wave not in clock and wave.step < first.step * (1.0 - _SAME):
            name = one_line(wave.channel.name, 40)
            remarks.append(f"'{name}' is sampled more often: its samples at the times of the table are used")
    facts: dict[str, float] = {}
    texts: dict[str, str] = {}
    for wave in sorted(waves, key=lambda one: one in clock):  # the waveforms of the clock take precedence
        facts |= wave.facts
        texts |= wave.texts
    if first.timed:
        facts[step_fact] = first.step
    names = tuple(wave.channel.name for wave in clock)
    size = f"{counted(len(clock), 'channel')} of {counted(first.size, 'sample')}"
    said = (f"{kind}, {size}", *remarks)
    return Table(
        tuple(channels),
        facts=facts,
        remarks=said,
        texts=texts,
        native=names if several else (),
        apart=tuple(apart),
    )


def _one_clock(first: Waveform, second: Waveform) -> bool:
    """Whether two waveforms have the same times; without a step, any waveform of the same length may share them."""
    if first.size != second.size:
        return False
    if not second.timed:
        return second.offset in (0.0, first.offset) and second.since in (None, first.since)
    if (first.since is None) != (second.since is None):
        return False
    drift = abs(first.step - second.step) * first.size
    return abs(second.after(first)) < _SAME * first.step and drift < _SAME * first.step


def _on_clock(clock: Waveform, wave: Waveform) -> Rows | str:
    """The samples of a waveform at the times of another one, NaN where it has none; or why there are none."""
    name = one_line(clock.channel.name, 40)
    if not (clock.timed and wave.timed):
        return f"it has {counted(wave.size, 'sample')}, and its times are not stated beside those of '{name}'"
    if (clock.since is None) != (wave.since is None):
        return f"only one of it and '{name}' states when it starts"
    fast, slow = (wave, clock) if wave.step <= clock.step else (clock, wave)
    places = (slow.after(fast) + slow.step * np.arange(slow.size)) / fast.step  # in samples of the faster one
    nearest = np.round(places)
    rate = f"it is sampled every {wave.step:.6g} s from {wave.after(clock):.6g} s on by the clock of '{name}'"
    if np.abs(places - nearest).max() > _SAME:
        return f"{rate} ({clock.step:.6g} s), and the samples do not coincide"
    inside = (nearest >= 0.0) & (nearest < fast.size)
    if not inside.any():
        return f"{rate}, and they do not overlap"
    at = nearest[inside].astype(np.intp)
    values = np.full(clock.size, np.nan)
    if wave is slow:
        values[at] = wave.channel.values[inside]
    else:
        values[inside] = wave.channel.values[at]
        if not _follows(wave.channel.values, at):
            return f"{rate}, and changes between the samples of '{name}'"
    return values


def _follows(values: Rows, at: NDArray[np.intp]) -> bool:
    """Whether straight lines between some samples pass through all samples between them."""
    between = values[at[0] : at[-1] + 1]
    good = np.isfinite(between)
    if not good.any() or at.size < 2:
        return True
    line = np.interp(np.arange(at[0], at[-1] + 1), at, values[at])
    error = float(np.sqrt(np.nanmean((between - line) ** 2)))
    return error <= _FOLLOWS * float(np.nanstd(between))
