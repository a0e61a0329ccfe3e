"""A spring that hardens or softens with the angle."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import exponent, parameter


@dataclass(frozen=True)
class CubicStiffness(Effect):
    """A spring that hardens or softens with the angle.

    Args:
        coefficient: relative change of stiffness per squared angle, positive when hardening, 1/rad2.
        exponent: power of the angle in the moment (unchanged at 0.2 rad), dimensionless; 3 in the textbook form.
    """

    name = "cubic_stiffness"
    place = 4
    channel = "stiffness"
    condition = "always"
    advice = "Model the spring's cubic stiffness, or release from smaller angles"
    equation = "−κ Kr β³; general form: |β|^p sgn β for β³"
    signature = "The relative change of frequency from its small-amplitude value is (3/8) κ A²."
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (1.0,)

    coefficient: float = parameter(
        "κ",
        "1/rad2",
        "relative change of stiffness per squared angle, positive when hardening",
        scale=0.2,
        lower=-1e6,
        upper=1e6,
        fit_lower=-10.0,
        fit_upper=50.0,
    )

    exponent: float = exponent("p", "power of the angle in the moment (unchanged at 0.2 rad)", 3.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"stiffness_cubic": self.coefficient, "stiffness_cubic_exponent": self.exponent}
