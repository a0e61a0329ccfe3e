"""Settings of the division of the work."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import setting


@dataclass(frozen=True)
class WorkSettings:
    """Division of the work; the answers are bit-identical with any of these."""

    threads: int = setting(
        2,
        "Number of threads that integrate runs.",
        "judgement",
        "The work between two predictions waits for all threads.",
        unit="threads",
    )
