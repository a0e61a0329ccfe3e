"""Aerodynamic damping that depends on the yaw angle."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import exponent, parameter


@dataclass(frozen=True)
class NonlinearYawDamping(Effect):
    """Aerodynamic damping that depends on the yaw angle.

    Args:
        coefficient: relative change of Ca per squared angle, 1/rad2.
        exponent: power of the angle in the factor (unchanged at 0.2 rad), dimensionless; 2 in the textbook form.
    """

    name = "nonlinear_yaw_damping"
    place = 11
    channel = "damping"
    condition = "wind_on"
    advice = "Model the damping that depends on the angle, or release from smaller angles"
    equation = "Ca (1 + μa β²) β̇ instead of Ca β̇; general form: |β|^p for β²"
    signature = (
        "The aerodynamic part of the damping ratio in wind-on runs changes by the relative amount μa A²/4."
    )
    references = ("van der Pol, Phil. Mag. 2 (1926) 978, doi 10.1080/14786442608564127",)
    example = (20.0,)

    coefficient: float = parameter(
        "μa",
        "1/rad2",
        "relative change of Ca per squared angle",
        scale=5.0,
        lower=-1e6,
        upper=1e6,
        fit_lower=-500.0,
        fit_upper=500.0,
    )

    exponent: float = exponent("p", "power of the angle in the factor (unchanged at 0.2 rad)", 2.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"damping_quadratic": self.coefficient, "damping_quadratic_exponent": self.exponent}
