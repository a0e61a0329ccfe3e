"""A wind speed that is off by a constant."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Effect, parameter
from tunnel_sim.run_settings import RunSettings, Series


@dataclass(frozen=True)
class WindSpeedOffset(Effect):
    """A wind speed that is off by a constant.

    Args:
        offset: true minus stated speed, m/s.
    """

    name = "wind_speed_offset"
    channel = "calibration"
    condition = "wind_on"
    equation = "true speed = stated speed + ΔV"
    signature = "The aerodynamic stiffness does not grow as the stated speed squared."
    references = ("Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",)

    offset: float = parameter("ΔV", "m/s", "true minus stated speed", scale=0.5, lower=-50.0, upper=50.0)

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Blow at the true speed."""
        del rng
        if stated.wind_speed <= 0.0 or self.is_null:
            return run
        series = dict(run.series)
        if "wind_speed" in series:  # as another effect left it: a drift, say
            given = series["wind_speed"]
            values = tuple(max(0.0, value + self.offset) for value in given.values)
            series["wind_speed"] = Series(values, given.interval)
        return dataclasses.replace(run, wind_speed=max(0.0, run.wind_speed + self.offset), series=series)
