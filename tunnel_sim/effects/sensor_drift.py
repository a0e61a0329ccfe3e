"""A sensor zero that drifts during the run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter
from tunnel_sim.record import Array
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class SensorDrift(Effect):
    """A sensor zero that drifts during the run.

    Args:
        drift: drift over the run, rad.
    """

    name = "sensor_drift"
    channel = "sensor"
    condition = "always"
    equation = "y = β + d t/T over a run of length T"
    signature = "The centre of the oscillation moves with time and is the same at any wind and spring."
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)

    drift: float = parameter("d", "rad", "drift over the run", scale=0.002, lower=-1.0, upper=1.0)

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, rng: np.random.Generator) -> Array:
        """Add the ramp."""
        del rng
        return angle + self.drift * time_s / stated.duration if self.drift else angle
