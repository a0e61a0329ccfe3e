"""A spring that hardens or softens with the angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, exponent, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class CubicStiffness(Effect):
    """A spring that hardens or softens with the angle.

    Args:
        coefficient: share of the stiffness per squared angle, positive: hardening, 1/rad2.
        exponent: power of the angle in the moment, the same moment at 0.2 rad, dimensionless; 3 is the textbook's.
    """

    name = "cubic_stiffness"
    channel = "stiffness"
    condition = "always"
    equation = "−κ Kr β³; bent: |β|^p sgn β for β³"
    signature = "The frequency departs from its small-amplitude value by the share (3/8) κ A²."
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)

    coefficient: float = parameter(
        "κ",
        "1/rad2",
        "share of the stiffness per squared angle, positive: hardening",
        scale=0.2,
        lower=-10.0,
        upper=50.0,
    )

    exponent: float = exponent("p", "power of the angle in the moment, the same moment at 0.2 rad", 3.0)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, stiffness_cubic=self.coefficient, stiffness_cubic_exponent=self.exponent)
