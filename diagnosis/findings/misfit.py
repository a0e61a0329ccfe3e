"""The misfit of a model in the units of the readings, as numbers and as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from diagnosis.where.maps import RunMap
from identification.show.numbers import held_out_excess, reading_shown, significant, unit_shown

NO_MISFIT = "none (within the noise)"
"""Text for a gap below the level that chance adds to the noise."""
_NONE = 5e-4  # excess in noise variances that is shown as 0.000


@dataclass(frozen=True)
class Misfit:
    """Conversion from an excess, in noise variances of a sample, to a misfit.

    Args:
        noise: standard deviation of one sample's noise, the reference of the excess, in ``unit``.
        swing: root mean square of the readings about the mean of each run, in ``unit``.
        unit: unit of the readings: ``rad``, ``rad/s`` or ``rad/s2``.
    """

    noise: float
    swing: float
    unit: str

    def rms(self, excess: float) -> float:
        """Root mean square misfit in ``unit``; zero for a negative excess, which is chance."""
        return self.noise * math.sqrt(max(excess, 0.0))

    def shows(self, excess: float) -> bool:
        """Whether a gap shows as a root mean square beyond the noise."""
        return excess >= _NONE

    def of_swing(self, excess: float) -> float | None:
        """The misfit as a share of the swing; None where the readings do not move."""
        return self.rms(excess) / self.swing if self.swing > 0.0 else None

    def rms_words(self, excess: float) -> str:
        """A misfit to three digits, such as ``0.134°``."""
        return reading_shown(self.rms(excess), 3, self.unit)

    def swing_words(self, excess: float) -> str:
        """A misfit as a share of the swing, such as ``2.1 % of the swing``."""
        share = 100.0 * (self.of_swing(excess) or 0.0)
        return f"{significant(share, 2) if share else '0'} % of the swing"

    def words(self, excess: float, *, times: bool = False) -> str:
        """A gap as a root mean square, or the statement that there is none.

        Args:
            times: adds the multiple of the noise variance, such as ``0.134° (19.34)``.
        """
        if not self.shows(excess):
            return NO_MISFIT
        return f"{self.rms_words(excess)} ({held_out_excess(excess)})" if times else self.rms_words(excess)

    def scale(self) -> tuple[str, Callable[[float], float]]:
        """The unit in which gaps are drawn, degrees for angles, and the function from an excess to this unit."""
        unit, factor = unit_shown(self.unit)
        return unit, lambda excess: factor * self.rms(excess)


def run_labels(runs: Sequence[RunMap]) -> list[str]:
    """Runs with their conditions, such as ``r02 · 16.1 N m/rad · 15 m/s``.

    A spring is named where stated, and the wind speed where any run had wind.
    """
    windy = any(run.wind_speed > 0.0 for run in runs)
    labels = []
    for run in runs:
        parts = [run.id]
        if run.spring_stiffness:
            parts.append(f"{run.spring_stiffness:g} N m/rad")
        if windy:
            parts.append(f"{run.wind_speed:g} m/s" if run.wind_speed > 0.0 else "wind off")
        labels.append(" · ".join(parts))
    return labels
