"""A spring stiffer to one side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, exponent, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class AsymmetricStiffness(Effect):
    """A spring stiffer to one side.

    Args:
        coefficient: share of the stiffness per angle, 1/rad.
        exponent: power of the angle in the moment, the same moment at 0.2 rad, dimensionless; 2 is the textbook's.
    """

    name = "asymmetric_stiffness"
    channel = "stiffness"
    condition = "always"
    equation = "−κ Kr β²; bent: |β|^p for β²"
    signature = (
        "The centre of the oscillation shifts by −κ A²/2 and a second harmonic appears; the "
        "frequency changes only in second order."
    )
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)

    coefficient: float = parameter(
        "κ", "1/rad", "share of the stiffness per angle", scale=0.05, lower=-2.0, upper=2.0
    )

    exponent: float = exponent("p", "power of the angle in the moment, the same moment at 0.2 rad", 2.0)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, stiffness_quadratic=self.coefficient, stiffness_quadratic_exponent=self.exponent)
