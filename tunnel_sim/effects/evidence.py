"""What an effect may search for what is its own in every run: the residuals of a fit without it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class Sought:
    """What was found of an effect that has numbers of its own in every run.

    Args:
        values: of the effect's parameters that belong to its textbook form, in their order and units.
        numbers: of every run its phase (rad), shape (runs,), or its instants (shares of the run), shape (runs, n).
        drop: of χ² by taking it out, dimensionless.
        of_input: the value of the parameter that says what the effect has to do with the input, dimensionless.
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
        """The strongest line of a moment whose frequency is in proportion to the wind speed.

        Args:
            least: frequency times size over wind speed, dimensionless.
            greatest: likewise.
            size: of the body that it refers to: ``width`` or ``length``.

        Returns:
            Its moment coefficient and that number.
        """

    def ringing(self) -> Sought | None:
        """The strongest decaying line from the release on: amplitude (rad), frequency (rad/s) and damping ratio."""

    def excited(self) -> Sought | None:
        """The strongest oscillation that the input of driven runs excites, likewise."""

    def skips(self, *, with_input: bool) -> Sought | None:
        """The instants at which the runs jump ahead by one common time, and that time (s).

        Args:
            with_input: whether the input of driven runs jumps too.
        """
