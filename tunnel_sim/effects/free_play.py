"""Play between spring and rod: the spring acts through a dead zone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class FreePlay(Effect):
    """Play between spring and rod: the spring acts through a dead zone.

    Args:
        half_width: half width of the dead zone, rad.
    """

    name = "free_play"
    channel = "stiffness"
    condition = "always"
    equation = "−Kr dz(β), dz = 0 within ±δ and β ∓ δ beyond"
    signature = "The frequency falls steeply as the amplitude nears the dead zone."
    references = ("Conner, Tang, Dowell & Virgin, J. Fluids Struct. 11 (1997) 89",)

    half_width: float = parameter(
        "δ", "rad", "half width of the dead zone", scale=0.002, lower=0.0, upper=0.2
    )

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, free_play=self.half_width)
