"""The type of the fixture ``tunnel``: a command of the program, run in the process of the test."""

from __future__ import annotations

from collections.abc import Callable

Outcome = tuple[int, str, str]
"""Exit status, standard output and standard error."""
Tunnel = Callable[..., Outcome]
