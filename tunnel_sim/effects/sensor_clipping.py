"""A reading that saturates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter
from tunnel_sim.record import Array


@dataclass(frozen=True)
class SensorClipping(Effect):
    """A reading that saturates.

    Args:
        limit: greatest reading; 0 stands for none, rad.
    """

    name = "sensor_clipping"
    channel = "sensor"
    condition = "always"
    equation = "|y| ≤ L"
    signature = "The tops of the largest swings are flat, and nothing else is touched."
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)

    limit: float = parameter(
        "L", "rad", "greatest reading; 0 stands for none", scale=0.3, lower=0.0, upper=10.0
    )

    def on_reading(self, reading: Array) -> Array:
        """Cut off beyond the limit."""
        return np.clip(reading, -self.limit, self.limit) if self.limit else reading
