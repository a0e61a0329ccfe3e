"""Settings of the division of the work."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import setting


@dataclass(frozen=True)
class WorkSettings:
    """The division of the work; answers are bit-identical with any of these."""

    threads: int = setting(
        2,
        "Threads in which runs are integrated.",
        "judgement",
        "The work between two predictions waits for all of them.",
        unit="threads",
    )
