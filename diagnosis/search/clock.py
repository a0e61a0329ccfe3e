"""Wall time of the steps of a diagnosis, and the progress call at each step."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str], None]


class StepClock:
    """Wall time by step, and the progress call.

    Args:
        progress: called with the name of each step as it begins; None: no calls.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        #: By name of the step, s.
        self.seconds: dict[str, float] = {}
        self.progress = progress
        self._last = ""

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step, and announce it unless it continues the last one."""
        if self.progress is not None and name != self._last:
            self.progress(name)
        self._last, begun = name, time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begun
