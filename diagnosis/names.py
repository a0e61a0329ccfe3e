"""Effect names in prose."""

from __future__ import annotations

from collections.abc import Sequence


def plain(names: Sequence[str]) -> str:
    """Effect names as words: ``coulomb friction and mains hum``."""
    return " and ".join(name.replace("_", " ") for name in names)
