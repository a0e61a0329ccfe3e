"""An aerodynamic yaw moment that is not linear in the yaw angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, exponent, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class NonlinearYawMoment(Effect):
    """An aerodynamic yaw moment that is not linear in the yaw angle.

    Args:
        coefficient: share of Ka per squared angle, 1/rad2.
        exponent: power of the angle in the factor, the same factor at 0.2 rad, dimensionless; 2 is the textbook's.
    """

    name = "nonlinear_yaw_moment"
    channel = "stiffness"
    condition = "wind_on"
    equation = "Ka (1 + κa β²) β in place of Ka β; bent: |β|^p for β²"
    signature = "As cubic stiffness, but in proportion to V² and absent with the wind off."
    references = ("Mansor & Passmore, J. Wind Eng. Ind. Aerodyn. 96 (2008) 1218",)

    coefficient: float = parameter(
        "κa", "1/rad2", "share of Ka per squared angle", scale=1.0, lower=-100.0, upper=100.0
    )

    exponent: float = exponent("p", "power of the angle in the factor, the same factor at 0.2 rad", 2.0)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, moment_cubic=self.coefficient, moment_cubic_exponent=self.exponent)
