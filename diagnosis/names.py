"""Effect names in prose."""

from __future__ import annotations

from collections.abc import Sequence


def plain(names: Sequence[str]) -> str:
    """Effect names as words: ``mains hum, free play and coulomb friction``."""
    *first, last = (name.replace("_", " ") for name in names)
    return f"{', '.join(first)} and {last}" if first else last
