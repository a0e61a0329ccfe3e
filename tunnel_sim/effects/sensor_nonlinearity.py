"""A sensor whose gain changes with the angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter
from tunnel_sim.record import Array
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class SensorNonlinearity(Effect):
    """A sensor whose gain changes with the angle.

    Args:
        coefficient: cubic coefficient, 1/rad2.
    """

    name = "sensor_nonlinearity"
    channel = "sensor"
    condition = "always"
    equation = "y = β + s β³"
    signature = (
        "A third harmonic of s A³/4; the frequency is untouched, and the decay looks faster by the share "
        "(3/2) s A², whatever spring and wind."
    )
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)

    coefficient: float = parameter("s", "1/rad2", "cubic coefficient", scale=0.05, lower=-1.0, upper=1.0)

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, rng: np.random.Generator) -> Array:
        """Bend the characteristic."""
        del time_s, stated, rng
        return angle + self.coefficient * angle**3 if self.coefficient else angle
