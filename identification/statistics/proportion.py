"""A share of trials with its confidence interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Proportion:
    """How many of how many, such as the trials that failed.

    Args:
        total: number of all; the share is defined above 0 only.
    """

    count: int
    total: int

    @classmethod
    def of(cls, flags: Sequence[bool]) -> Proportion:
        """How many are true."""
        return cls(sum(map(bool, flags)), len(flags))

    @property
    def value(self) -> float:
        """The share."""
        return self.count / self.total

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval of 95 % (J. Am. Stat. Assoc. 22 (1927) 209–212), as shares; 0 to 1 of none."""
        from scipy.stats import binomtest

        if not self.total:
            return 0.0, 1.0
        found = binomtest(self.count, self.total).proportion_ci(method="wilson")
        return float(found.low), float(found.high)

    def to_json_dict(self) -> dict[str, Any]:
        """Count, total, share (None of none) and interval."""
        share = self.value if self.total else None
        return {"count": self.count, "total": self.total, "share": share, "wilson_95": list(self.interval)}
