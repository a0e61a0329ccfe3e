"""What a reader of run files gives: a table that nobody has looked into yet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import polars as pl

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "angle": ("yaw_rad", "yaw_deg"),
    "rate": ("yaw_rate_rad_s", "yaw_rate_deg_s"),
    "acceleration": ("yaw_acceleration_rad_s2",),
}
"""The columns that may hold the reading, by the sensor's quantity; the first one is written."""

USED_COLUMNS = ("time_s", *(name for names in COLUMNS.values() for name in names))
"""The columns of a run file that are read; others are left alone."""


@dataclass(frozen=True)
class FileTable:
    """The table of a run file.

    Args:
        frame: at least those of `USED_COLUMNS` that the file has.
        names: of all columns.
        text: whether values are still texts, below a line of headings.
    """

    frame: pl.DataFrame
    names: Sequence[str]
    text: bool = False


class RunReader(Protocol):
    """A module that reads one kind of run file."""

    LIMIT: int
    """The largest file it reads, bytes."""

    def read(self, content: bytes, where: str, most: int) -> FileTable:
        """The table.

        Args:
            most: how many samples it may hold.

        Raises:
            TunnelError: when it is no such table, or too large.
        """
