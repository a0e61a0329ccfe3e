"""A flow that meets the rig at an angle: a steady yaw moment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter, with_law
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class FlowMisalignment(Effect):
    """A flow that meets the rig at an angle: a steady yaw moment.

    Args:
        angle: angle of the flow against the rig's zero, rad.
    """

    name = "flow_misalignment"
    channel = "forcing"
    condition = "wind_on"
    equation = "Ka βf added"
    signature = "The centre of the oscillation shifts with wind speed squared over the stiffness."
    references = ("Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",)

    angle: float = parameter(
        "βf", "rad", "angle of the flow against the rig's zero", scale=0.01, lower=-0.8, upper=0.8
    )

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Set the moment law's term."""
        del stated, rng
        return with_law(run, flow_angle=self.angle)
