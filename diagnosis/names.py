"""Effect names in prose."""

from __future__ import annotations


def plain(*names: str) -> str:
    """Effect names as words: ``mains hum, free play and coulomb friction``."""
    *first, last = (name.replace("_", " ") for name in names)
    return f"{', '.join(first)} and {last}" if first else last
