"""A disturbed run, as a fact."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Disturbance:
    """A run whose motion jumps at an instant at which no other run's does.

    Args:
        run: id of the run.
        at_s: the instant, by the clock of the run's file, s.
        kept_until_s: end of the part that is used, by the same clock, s; None where the run is left out, or used
            as a whole.
        p_value: probability of as large a jump among all runs and instants, by chance and by causes that act in
            all runs, a fraction.
        used: whether the run is used as a whole, since the other runs do not determine the model.
    """

    run: str
    at_s: float
    kept_until_s: float | None
    p_value: float
    used: bool = False
