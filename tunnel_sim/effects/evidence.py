"""Searches in the residuals of a fit without an effect, for the effect's own parameters in every run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class Sought:
    """The result of a search for an effect that has parameters of its own in every run.

    Args:
        values: of the parameters of the effect's textbook form, in their order and units.
        numbers: of every run its phase (rad), shape (runs,), or its instants (shares of the run), shape (runs, n).
        drop: of χ² by removing the effect, dimensionless.
        of_input: the value of the parameter that relates the effect to the input, dimensionless.
    """

    values: tuple[float, ...]
    numbers: Array
    drop: float
    of_input: float = 0.0


class Residuals(Protocol):
    """The residuals of a fit, with searches that effects share; each gives None where nothing can be found."""

    def mains_line(self) -> Sought | None:
        """The strongest line at a frequency of the mains in the readings: amplitude (rad) and frequency (Hz)."""

    def wind_line(self, least: float, greatest: float, size: str) -> Sought | None:
        """The strongest line of a moment whose frequency is proportional to the wind speed.

        Args:
            least: least ratio of frequency times size to wind speed, dimensionless.
            greatest: greatest such ratio, dimensionless.
            size: of the body in that ratio: ``width`` or ``length``.

        Returns:
            Its moment coefficient and that ratio.
        """

    def ringing(self) -> Sought | None:
        """The strongest decaying line from the release on: amplitude (rad), frequency (rad/s) and damping ratio."""

    def excited(self) -> Sought | None:
        """The strongest oscillation that the input of driven runs excites; values as in `ringing`."""

    def skips(self, *, with_input: bool) -> Sought | None:
        """The instants at which the runs jump ahead by one common time, and that time (s).

        Args:
            with_input: whether the input of driven runs jumps too.
        """
