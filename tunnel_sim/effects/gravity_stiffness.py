"""Gravity on a tilted axis with an offset centre of mass: a restoring moment of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class GravityStiffness(Effect):
    """Gravity on a tilted axis with an offset centre of mass: a restoring moment of its own.

    Args:
        stiffness: greatest restoring moment, N m/rad.
        rest_angle: angle at which gravity is in balance, rad.
    """

    name = "gravity_stiffness"
    channel = "stiffness"
    condition = "always"
    equation = "−Kg sin(β − βg)"
    signature = (
        "The same stiffness is added to every spring, so the gradient of Kr against ωn² keeps its "
        "slope and leaves the origin; the centre shifts by the spring."
    )
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)

    stiffness: float = parameter(
        "Kg", "N m/rad", "greatest restoring moment", scale=0.3, lower=-1e5, upper=1e5
    )
    rest_angle: float = parameter(
        "βg", "rad", "angle at which gravity is in balance", scale=0.1, lower=-3.2, upper=3.2
    )

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, gravity_stiffness=self.stiffness, gravity_angle=self.rest_angle)
