"""A spring that is stiffer to one side."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import exponent, parameter


@dataclass(frozen=True)
class AsymmetricStiffness(Effect):
    """A spring that is stiffer to one side.

    Args:
        coefficient: relative change of stiffness per angle, 1/rad.
        exponent: power of the angle in the moment (unchanged at 0.2 rad), dimensionless; 2 in the textbook form.
    """

    name = "asymmetric_stiffness"
    place = 5
    channel = "stiffness"
    condition = "always"
    advice = "Seat the spring so that it is as stiff to both sides"
    equation = "−κ Kr β²; general form: |β|^p for β²"
    signature = (
        "The centre of the oscillation shifts by −κ A²/2 and a second harmonic appears; the "
        "frequency changes only in second order."
    )
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (0.2,)

    coefficient: float = parameter(
        "κ",
        "1/rad",
        "relative change of stiffness per angle",
        scale=0.05,
        lower=-1e6,
        upper=1e6,
        fit_lower=-2.0,
        fit_upper=2.0,
    )

    exponent: float = exponent("p", "power of the angle in the moment (unchanged at 0.2 rad)", 2.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"stiffness_quadratic": self.coefficient, "stiffness_quadratic_exponent": self.exponent}
