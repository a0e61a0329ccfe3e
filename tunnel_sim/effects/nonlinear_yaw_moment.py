"""An aerodynamic yaw moment that is not linear in the yaw angle."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import exponent, parameter


@dataclass(frozen=True)
class NonlinearYawMoment(Effect):
    """An aerodynamic yaw moment that is not linear in the yaw angle.

    Args:
        coefficient: relative change of Ka per squared angle, 1/rad2.
        exponent: power of the angle in the factor (unchanged at 0.2 rad), dimensionless; 2 in the textbook form.
    """

    name = "nonlinear_yaw_moment"
    place = 9
    channel = "stiffness"
    condition = "wind_on"
    advice = "Model the moment that is not linear in the angle, or release from smaller angles"
    equation = "Ka (1 + κa β²) β instead of Ka β; general form: |β|^p for β²"
    signature = "Like cubic stiffness, but proportional to V² and absent with the wind off."
    references = ("Mansor & Passmore, J. Wind Eng. Ind. Aerodyn. 96 (2008) 1218",)
    example = (3.0,)

    coefficient: float = parameter(
        "κa",
        "1/rad2",
        "relative change of Ka per squared angle",
        scale=1.0,
        lower=-1e6,
        upper=1e6,
        fit_lower=-100.0,
        fit_upper=100.0,
    )

    exponent: float = exponent("p", "power of the angle in the factor (unchanged at 0.2 rad)", 2.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"moment_cubic": self.coefficient, "moment_cubic_exponent": self.exponent}
