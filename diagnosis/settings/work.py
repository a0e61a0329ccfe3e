"""Settings of how the work is shared out."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import setting


@dataclass(frozen=True)
class WorkSettings:
    """How the work is shared out; every answer has the same bits with any of these."""

    threads: int = setting(
        2,
        "Threads in which runs are integrated.",
        "judgement",
        "What is done between two predictions waits for all of them.",
        unit="threads",
    )
