"""The number of runs that an identification has finished, for a display."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

ItemT = TypeVar("ItemT")
Progress = Callable[[int, int], None]
"""Called with the number of finished runs, and of all runs."""
_shown: ContextVar[Progress | None] = ContextVar("shown", default=None)


@contextmanager
def shown_by(progress: Progress | None) -> Iterator[None]:
    """Let `counted` report within the block; None: nothing is reported."""
    token = _shown.set(progress)
    try:
        yield
    finally:
        _shown.reset(token)


def counted(runs: Sequence[ItemT]) -> Iterator[ItemT]:
    """The runs in turn, each reported when the next one is requested."""
    progress = _shown.get()
    for number, run in enumerate(runs):
        if progress is not None:
            progress(number, len(runs))
        yield run
    if progress is not None:
        progress(len(runs), len(runs))
