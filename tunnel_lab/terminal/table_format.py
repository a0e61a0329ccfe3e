"""The requested output of a command: the format of its tables, and whether it prints errors only."""

from __future__ import annotations

from contextvars import ContextVar
from enum import StrEnum


class TableFormat(StrEnum):
    """Format of printed tables."""

    TEXT = "text"
    CSV = "csv"
    MD = "md"
    JSON = "json"


chosen: ContextVar[TableFormat] = ContextVar("table format", default=TableFormat.TEXT)
"""The format of this command's tables."""

quiet: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether this command prints errors only."""
