"""A spring that hardens or softens with the angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, exponent, parameter
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class CubicStiffness(Effect):
    """A spring that hardens or softens with the angle.

    Args:
        coefficient: share of the stiffness per squared angle, positive: hardening, 1/rad2.
        exponent: power of the angle in the moment, the same moment at 0.2 rad, dimensionless; 3 is the textbook's.
    """

    name = "cubic_stiffness"
    place = 4
    channel = "stiffness"
    condition = "always"
    equation = "−κ Kr β³; bent: |β|^p sgn β for β³"
    signature = "The frequency departs from its small-amplitude value by the share (3/8) κ A²."
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (1.0,)

    coefficient: float = parameter(
        "κ",
        "1/rad2",
        "share of the stiffness per squared angle, positive: hardening",
        scale=0.2,
        lower=-10.0,
        upper=50.0,
        per_stiffness=True,
    )

    exponent: float = exponent("p", "power of the angle in the moment, the same moment at 0.2 rad", 3.0)

    @classmethod
    def regressor(cls, angle: Array, rate: Array, spring: float) -> Array:
        """The textbook's term."""
        del rate
        return -spring * angle**3

    def law(self) -> Mapping[str, float]:
        """The term of the moment law."""
        return {"stiffness_cubic": self.coefficient, "stiffness_cubic_exponent": self.exponent}
