"""Damping that grows with the square of the rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, exponent, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class QuadraticDamping(Effect):
    """Damping that grows with the square of the rate.

    Args:
        coefficient: coefficient of the squared rate, N m s2/rad2.
        exponent: power of the rate in the moment, the same moment at 2 rad/s, dimensionless; 2 is the textbook's.
    """

    name = "quadratic_damping"
    channel = "damping"
    condition = "always"
    equation = "−C2 |β̇| β̇; bent: |β̇|^n sgn β̇"
    signature = "The damping ratio falls in proportion to the amplitude."
    references = ("ITTC Recommended Procedure 7.5-02-07-04.5, roll damping of ships: B1 p + B2 |p| p",)

    coefficient: float = parameter(
        "C2", "N m s2/rad2", "coefficient of the squared rate", scale=0.002, lower=-1e4, upper=1e4
    )

    exponent: float = exponent("n", "power of the rate in the moment, the same moment at 2 rad/s", 2.0)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, quadratic_damping=self.coefficient, quadratic_damping_exponent=self.exponent)
