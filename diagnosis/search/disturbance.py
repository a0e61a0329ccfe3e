"""A disturbed run, as a fact."""

from __future__ import annotations

from dataclasses import dataclass

from identification.show.quantity import Quantity


@dataclass(frozen=True)
class Disturbance:
    """A run that differs as a whole, or jumps at an instant at which no other run does.

    Args:
        run: id of the run.
        at_s: the instant, by the clock of the run's file, s; None where the run differs as a whole.
        kept_until_s: end of the used part, by the same clock, s; None where the run is left out, used as a
            whole, or used from ``kept_from_s`` on.
        p_value: probability of as large a jump among all runs and instants, or of as large a misfit to the
            model of the other runs, by chance and by causes that act in all runs, a fraction.
        used: whether the run is used as a whole, because the other runs do not determine the model.
        kept_from_s: start of the used part, by the same clock, s; None: the start of the run.
        frequency: frequency of a run that differs as a whole over the prediction by the model of the other runs,
            minus one, dimensionless; None: not known.
        damping: the same for the damping ratio.
        as_they: whether the run moves as the others do but for these two numbers.
    """

    run: str
    at_s: float | None
    kept_until_s: float | None
    p_value: float
    used: bool = False
    kept_from_s: float | None = None
    frequency: Quantity | None = None
    damping: Quantity | None = None
    as_they: bool = False

    @property
    def as_a_whole(self) -> bool:
        """Whether the run differs as a whole."""
        return self.at_s is None and self.kept_from_s is None

    @property
    def left_out(self) -> bool:
        """Whether no part of the run is used."""
        return not self.used and self.kept_until_s is None and self.kept_from_s is None
