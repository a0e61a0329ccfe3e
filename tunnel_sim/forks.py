"""Forks of this process, Python's default way to start processes on Linux before 3.14.

Polars keeps threads for its work. A fork has none of them and would wait for them for ever. Import this module
before any fork: it then notes whether Polars was loaded at the time.
"""

from __future__ import annotations

import os
import sys

_lost_threads = False


def _note() -> None:
    global _lost_threads
    _lost_threads = "polars" in sys.modules


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note)


def polars_works() -> bool:
    """Whether Polars can use its threads: not in a fork of a process that had loaded it."""
    return not _lost_threads
