"""Tables of a file: columns of numbers by name and unit, before their meaning is known."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import one_line
from tunnel_sim.vocabulary.freedom import FREEDOMS, Motion
from tunnel_sim.vocabulary.inputs import HOLDS, INPUT_KEYS
from tunnel_sim.vocabulary.quantities import Rows
from tunnel_sim.vocabulary.text_cells import from_text_cell

if TYPE_CHECKING:
    import polars as pl

INPUT_FACTS = INPUT_KEYS
"""Statements about the input of a run in a file, as an export writes them."""

_RUN_NAMES = re.compile(
    r"(?i)(run|trial|versuch|lauf)[ _]?(id|name|no|nr|number|nummer|#)?\.?|"
    r"(mess(ung|reihe)|versuchs)[ _]?(nr|nummer)\.?"
)
LEAST_ROWS = 16
"""Minimum number of rows of a record: a shorter table beside longer ones holds conditions or sizes."""
_APART = 3.0  # ratio of the roughness of a column to that of its series, above which they are several
_LEAST_EACH = 8  # rows of a run, on average: a column that changes more often does not number runs


@dataclass(frozen=True, eq=False)
class Channel:
    """One column of a table.

    Args:
        values: values in the unit of the file; NaN for a missing number.
        unit: one of `units.UNITS`, another text, or empty if none is stated.
        place: number of the column in the file, from 1 on; 0 if the file does not number its columns.
        fault: why its numbers are not those of one record, and the remedy; empty: they are, as far as is known.
    """

    name: str
    values: Rows
    unit: str = ""
    place: int = 0
    fault: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Make every NaN quiet: a damaged file may contain signalling ones, which turn a minimum into NaN.

        A name that is too long is cut: the search for units and numbers in it takes time with its length squared.
        """
        object.__setattr__(self, "name", self.name[: limits.NAME_CHARACTERS])
        object.__setattr__(self, "values", np.where(np.isnan(self.values), np.nan, self.values))

    @property
    def quoted(self) -> str:
        """The column's name in a message."""
        return f"'{one_line(self.name, 40)}'"


@dataclass(frozen=True, eq=False)
class RunColumn:
    """A column in its role in a run.

    Args:
        channel: channel of the file; `NO_CHANNEL` if the file has no such column.
        values: values in the SI unit of the role, or in the unit of the file until that is known.
        unit: unit of the channel, stated or assumed.
        role: ``time``, the quantity of a reading, or the kind of an input.
        why: remarks on the choice of the column and on its numbers.
        motion: motion that a reading measures.
    """

    channel: Channel
    values: Rows
    unit: str
    role: str
    why: tuple[str, ...] = ()
    motion: Motion = "angle"


NO_CHANNEL = Channel("", np.empty(0))


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of the same length.

    Args:
        part: sheet, group, structure or run in the file; empty if the file contains one table.
        facts: single numbers beside the columns, by name; NaN for a name with several numbers.
        remarks: how the table was read, and what was omitted.
        headed: whether the columns are named in the file.
        named: whether the part is the file's name for a run, which is then completely in the table.
        texts: single texts beside the columns, by name.
        native: names of the columns that were sampled on the clock of the table, if the columns of a part have
            several clocks; the part then has a table for each clock. Empty: all columns.
        apart: name, unit and reason of each column of the part that cannot be aligned with the clock of the table.
        aligned: for each column of another clock that was put onto the clock of the table: how, and how far
            off.
    """

    channels: tuple[Channel, ...]
    part: str = ""
    facts: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    headed: bool = True
    named: bool = False
    texts: Mapping[str, str] = field(default_factory=dict)
    native: tuple[str, ...] = ()
    apart: tuple[tuple[str, str, str], ...] = ()
    aligned: Mapping[str, str] = field(default_factory=dict)


def names_runs(heading: str) -> bool:
    """Whether a column of this name gives the run of each row."""
    return _RUN_NAMES.fullmatch(heading.strip()) is not None


def by_run(table: Table) -> list[Table]:
    """Split a table by a column of the numbers of its runs; a table without one is unchanged."""
    channel = next((c for c in table.channels if not table.named and names_runs(c.name) and not c.unit), None)
    if channel is None:
        return [table]
    number = np.nan_to_num(channel.values, nan=-np.inf)
    starts = np.flatnonzero(number[1:] != number[:-1]) + 1
    return by_label(
        table, channel.name, starts, [f"{n:.15g}" if n > -np.inf else "" for n in number[[0, *starts]]]
    )


def is_input(channel: Channel) -> bool:
    """Whether a column has the format's name for an input, so that it is not the reading."""
    return any(heading(channel) in freedom.inputs for freedom in FREEDOMS.values())


def heading(channel: Channel) -> str:
    """The name of a column with its unit, as the format writes it."""
    name = channel.name.strip().lower()
    return f"{name}_{channel.unit}".replace("/", "_") if channel.unit else name


def with_input_facts(table: Table) -> Table:
    """A table with single numbers for the columns `INPUT_KEYS`, as written by an export."""
    stated = [channel for channel in table.channels if channel.name in INPUT_FACTS]
    facts = {c.name: float(good[0]) for c in stated if (good := c.values[np.isfinite(c.values)]).size}
    channels = tuple(channel for channel in table.channels if channel not in stated)
    return replace(table, channels=channels, facts={**table.facts, **facts}) if stated else table


def hold_order(text: str) -> float:
    """The order of a hold from its text in a file: 0 for ``zero``, 1 for ``linear``, NaN for any other text."""
    return float(HOLDS.index(text)) if text in HOLDS else float("nan")


def are_series(column: Rows, parts: Iterable[Rows]) -> bool:
    """Whether the parts of a column are series of their own: each is smooth, and the column jumps between them."""
    apart = np.concatenate([np.diff(part, 4) for part in parts])
    return float(np.mean(np.diff(column, 4) ** 2)) > _APART**2 * float(np.mean(apart**2))


def by_texts(table: Table, column: str, texts: pl.Series) -> list[Table]:
    """Split a table by the runs named in a column of texts; it is unchanged if the column names none."""
    texts = texts.cast(str).fill_null("").str.strip_chars(" \t\r")
    changes = (texts != texts.shift()).fill_null(value=False).arg_true().to_numpy()
    names = texts.gather([0, *changes]).to_list() if texts.len() else []
    return by_label(table, column, changes, [from_text_cell(name) for name in names])


def by_label(table: Table, column: str, starts: NDArray[np.integer], names: Sequence[str]) -> list[Table]:
    """Split a table by the runs named in its column; it is unchanged if the column cannot name runs."""
    runs = [name for name in names if name]
    rows = table.channels[0].values.size if table.channels else 0
    if not 0 < len(names) <= rows / _LEAST_EACH or len(set(runs)) < len(runs):
        return [table]
    channels = [channel for channel in table.channels if channel.name != column]
    said = (*table.remarks, f"the column '{column}' names the runs")
    return [
        replace(
            table,
            channels=tuple(replace(channel, values=channel.values[a:b]) for channel in channels),
            part="-".join(filter(None, (table.part, name))),
            remarks=said,
            named=True,
        )
        for name, a, b in zip(names, [0, *starts], [*starts, rows], strict=True)
        if name
    ]
