"""Searches for an effect's own parameters in every run, in the residuals of a fit without the effect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class Sought:
    """The result of a search for an effect that has parameters of its own in every run.

    Args:
        values: of the parameters of the effect's textbook form, in their order and units.
        numbers: phase of every run (rad), shape (runs,), or its instants (shares of the run), shape (runs, n).
        drop: drop of χ² when the effect is removed, dimensionless.
        of_input: the value of the parameter that relates the effect to the input, dimensionless.
    """

    values: tuple[float, ...]
    numbers: Array
    drop: float
    of_input: float = 0.0


class Residuals(Protocol):
    """The residuals of a fit, with searches that effects share; each returns None if nothing is found."""

    def mains_line(self) -> Sought | None:
        """The strongest line at a frequency of the mains in the readings: amplitude (rad) and frequency (Hz)."""

    def wind_line(self, least: float, greatest: float, size: str) -> Sought | None:
        """The strongest line of a moment whose frequency is proportional to the wind speed.

        Args:
            least: least ratio of frequency times size to wind speed, dimensionless.
            greatest: greatest such ratio, dimensionless.
            size: size of the body in this ratio: ``width`` or ``length``.

        Returns:
            The moment coefficient and this ratio.
        """

    def ringing(self) -> Sought | None:
        """The strongest decaying line from the release on: amplitude (rad), frequency (rad/s) and damping ratio."""

    def excited(self) -> Sought | None:
        """The strongest oscillation that the input of driven runs excites; values as in `ringing`."""

    def skips(self, *, with_input: bool) -> Sought | None:
        """The instants at which the runs jump ahead by one common time, and that time (s).

        Args:
            with_input: whether the input of driven runs jumps as well.
        """
