"""A sensor zero that drifts during the run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, exponent, parameter
from tunnel_sim.record import Array
from tunnel_sim.run_settings import RunSettings


@dataclass(frozen=True)
class SensorDrift(Effect):
    """A sensor zero that drifts during the run.

    Args:
        drift: drift over the run, rad.
        exponent: power of time with which it grows, dimensionless; 1 is the textbook's.
    """

    name = "sensor_drift"
    channel = "sensor"
    condition = "always"
    equation = "y = β + d t/T over a run of length T; bent: (t/T)^n"
    signature = "The centre of the oscillation moves with time and is the same at any wind and spring."
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)

    drift: float = parameter("d", "rad", "drift over the run", scale=0.002, lower=-1.0, upper=1.0)
    exponent: float = exponent("n", "power of time with which it grows", 1.0)

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, rng: np.random.Generator) -> Array:
        """Add the ramp."""
        del rng
        if self.is_null:
            return angle
        part = np.clip(time_s / stated.duration, 0.0, None)
        return angle + self.drift * (part if self.exponent == 1.0 else part**self.exponent)
