"""Damping that grows with the square of the rate."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import exponent, parameter


@dataclass(frozen=True)
class QuadraticDamping(Effect):
    """Damping that grows with the square of the rate.

    Args:
        coefficient: coefficient of the squared rate, N m s2/rad2.
        exponent: power of the rate in the moment (unchanged at 2 rad/s), dimensionless; 2 in the textbook form.
    """

    name = "quadratic_damping"
    place = 2
    channel = "damping"
    condition = "always"
    advice = "Model the damping that grows with the rate"
    equation = "−C2 |β̇| β̇; general form: |β̇|^n sgn β̇ for |β̇| β̇"
    signature = "The damping ratio falls in proportion to the amplitude."
    references = ("ITTC Recommended Procedure 7.5-02-07-04.5, roll damping of ships: B1 p + B2 |p| p",)
    example = (0.01,)

    coefficient: float = parameter(
        "C2",
        "N m s2/rad2",
        "coefficient of the squared rate",
        scale=0.002,
        lower=-1e4,
        upper=1e4,
        fit_lower=0.0,
        rate_exponent="exponent",
    )

    exponent: float = exponent("n", "power of the rate in the moment (unchanged at 2 rad/s)", 2.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"quadratic_damping": self.coefficient, "quadratic_damping_exponent": self.exponent}
