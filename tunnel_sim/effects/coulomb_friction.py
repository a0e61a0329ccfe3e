"""Dry friction in the rod's bearing and potentiometer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction in the rod's bearing and potentiometer.

    Args:
        friction_moment: moment of friction, N m.
    """

    name = "coulomb_friction"
    channel = "damping"
    condition = "always"
    equation = "−Tc sgn β̇; rest while the other moments stay within ±Tc"
    signature = (
        "The envelope falls along a straight line by 4Tc/Kr a cycle, so the damping ratio rises "
        "as the amplitude decays, and the body can come to rest off centre."
    )
    references = ("Feeny & Liang, J. Sound Vib. 195 (1996) 149, doi 10.1006/jsvi.1996.0411",)

    friction_moment: float = parameter("Tc", "N m", "moment of friction", scale=0.004, lower=0.0, upper=1e4)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, friction_moment=self.friction_moment)
