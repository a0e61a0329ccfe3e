"""The remaining time of a diagnosis, from its stage and the elapsed time.

The number of sets of effects to fit is not known beforehand, so the answer is a range. At the start of a stage
the ratio of remaining to elapsed time is taken as lognormal, with the percentiles of recorded diagnoses. During
the stage, times that have already passed are ruled out.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log
from statistics import NormalDist

LEFT = {
    "where": (7.5, 80.0),
    "effects": (3.2, 35.0),
    "random moments": (0.32, 2.2),
    "pruning": (0.12, 1.2),
    "polishing": (0.14, 1.1),
    "explained share": (0.12, 1.3),
    "remainder": (0.04, 0.54),
}
"""Remaining over elapsed time at the start of each stage: the 10th and the 90th percentile of the 248 diagnoses
of the blind check that found a gap, by the times in their documents and of their files. At other instants the range
covered 86 % of them, and 84 % of the 100 diagnoses of a later blind set (seed 20271126). Before a gap is found
there is no estimate: without a gap the answer follows at once."""
_SPREAD = NormalDist().inv_cdf(0.9)
_UNUSUAL = 0.98
"""Maximum share of the range that has already passed for an estimate to be given."""


@dataclass(frozen=True)
class Reached:
    """The stage that a diagnosis has reached.

    Args:
        stage: stage as reported by `diagnosis.diagnose`; empty before the first one.
        begun: start of the stage, s since the start.
    """

    stage: str = ""
    begun: float = 0.0

    def left(self, now: float) -> tuple[float, float] | None:
        """The range of the remaining time, s, with a probability of 80 % for campaigns like the recorded ones.

        Args:
            now: present time, s since the start.

        Returns:
            None before a gap is found, and if a stage takes unusually long.
        """
        if self.stage not in LEFT or self.begun <= 0.0:
            return None
        low, high = map(log, LEFT[self.stage])
        multiple = NormalDist(0.5 * (low + high), 0.5 * (high - low) / _SPREAD)
        since = now - self.begun
        passed = multiple.cdf(log(since / self.begun)) if since > 0.0 else 0.0
        if passed > _UNUSUAL:
            return None
        least, most = (
            self.begun * exp(multiple.inv_cdf(passed + share * (1.0 - passed))) - max(since, 0.0)
            for share in (0.1, 0.9)
        )
        return max(least, 0.0), most

    def words(self, now: float) -> str:
        """The remaining time in words, such as ``about 20 to 60 s left``."""
        found = self.left(now)
        if found is None:
            return "time left not known" if self.stage in LEFT else "time left not known yet"
        (low, small), (high, large) = (
            (round(s / 60.0), "min") if s >= 120.0 else (round(s) if s < 20.0 else 5 * round(s / 5.0), "s")
            for s in found
        )
        if low == 0:
            return f"less than {max(high, 1)} {large} left"
        if (low, small) == (high, large):
            return f"about {high} {large} left"
        return f"about {low}{'' if small == large else f' {small}'} to {high} {large} left"
