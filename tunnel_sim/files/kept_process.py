"""Reading in a process with limits, which is kept for the next file.

A fork of a process reads there, too: Polars works in the new process, and would wait for ever in the fork.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from tunnel_sim.forks import polars_works
from tunnel_sim.sandbox import LimitReached, Sandbox, Work
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError

_lock = threading.Lock()
_kept: list[Sandbox] = []


def read_apart(
    work: Work, given: dict[str, Any], content: bytes, where: str
) -> tuple[dict[str, Any], Sequence[bytes]]:
    """Work on the content of a file in the kept process.

    Args:
        work: as for `Sandbox.do`; it gets the content as its only part.

    Raises:
        TunnelError: at ``where``, when the work refuses the content or reaches a limit.
    """
    seconds = limits.READER_SECONDS + len(content) / limits.READER_PACE
    with _lock:
        if _kept and not _kept[0].usable:
            _kept.pop().end()
        if not _kept:
            _kept.append(Sandbox(_prepare, limits.READER_MEMORY, files=True))
        try:
            return _kept[0].do(work, given, [content], seconds)
        except LimitReached as error:
            remedy = "split it if it is large; if it is damaged, export it again, or as text"
            raise TunnelError(f"reading it {error}", where=where, remedy=remedy) from None
        except TunnelError as error:
            raise TunnelError(error.what, where=where, remedy=error.remedy) from None


def check_polars() -> None:
    """Refuse work that needs Polars if it cannot run in this process."""
    if not polars_works():
        what = "this process is a fork of one that had loaded Polars, and Polars would wait for ever"
        remedy = "start processes by multiprocessing.get_context('spawn'), or do this in the first process"
        raise TunnelError(what, remedy=remedy)


def _prepare() -> None:
    """Load what every reader needs: this module."""
