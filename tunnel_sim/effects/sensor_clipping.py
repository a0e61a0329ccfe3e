"""A reading that saturates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect
from tunnel_sim.effects.parameters import Circumstances, Trial, parameter
from tunnel_sim.vocabulary.record import Array

_FAR = 2.0  # rad: the other limit, where only one side clips


@dataclass(frozen=True)
class SensorClipping(Effect):
    """A reading that saturates.

    Args:
        limit: greatest possible reading, rad; 0: no limit.
        centre: middle of the possible readings, rad; 0 in the textbook form.
        knee: share of the limit over which the reading saturates gradually, dimensionless; 0 in the textbook form.
    """

    name = "sensor_clipping"
    place = 21
    channel = "sensor"
    condition = "always"
    advice = "Widen the sensor's range, or release from smaller angles"
    equation = "|y| ≤ L; general form: |y − c| ≤ L, approached exponentially within k L of the limit"
    signature = "The peaks of the largest swings are flat; all other readings are unchanged."
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.2,)
    tries = 2

    limit: float = parameter(
        "L", "rad", "greatest possible reading (0: no limit)", scale=0.3, lower=0.0, upper=10.0
    )
    centre: float = parameter(
        "c", "rad", "middle of the possible readings", scale=0.05, lower=-5.0, upper=5.0, form=True
    )
    knee: float = parameter(
        "k",
        "1",
        "share of the limit over which the reading saturates gradually",
        scale=0.05,
        lower=0.0,
        upper=0.9,
        form=True,
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Limits slightly below the greatest reading: first on both sides, then on one side only."""
        limits = [campaign.greatest_reading * share for share in (0.999, 0.99, 0.97, 0.93, 0.87, 0.8)]
        both = [Trial({"limit": limit}, None) for limit in limits]
        one = [
            Trial({"limit": _FAR, "centre": side * (_FAR - limit)}, None)
            for limit in limits
            for side in (-1.0, 1.0)
        ]
        return [*both, *one]

    def on_reading(self, reading: Array) -> Array:
        """Clip at the limit, or saturate gradually."""
        if self.is_null:
            return reading
        if self.knee == 0.0:
            return np.clip(reading, self.centre - self.limit, self.centre + self.limit)
        room = self.knee * self.limit
        size = np.abs(reading - self.centre)
        linear = self.limit - room
        over = np.maximum(size - linear, 0.0)
        limited = np.minimum(size, linear) - room * np.expm1(-over / room)
        return self.centre + np.copysign(limited, reading - self.centre)
