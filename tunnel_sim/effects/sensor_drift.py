"""A sensor zero that drifts during the run."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import EQUATION, parameter, ramp, settling
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class SensorDrift(Effect):
    """A sensor zero that drifts during the run.

    Args:
        drift: drift over the run, rad.
        settling: length of the run over the drift's time constant, dimensionless; 0: linear (textbook form).
    """

    name = "sensor_drift"
    place = 19
    channel = "sensor"
    condition = "always"
    advice = "Let the sensor warm up, and record its zero before and after each run"
    equation = f"y = β + d t/T over a run of length T; general form: {EQUATION} for t/T"
    signature = (
        "The centre of the oscillation moves with time, in the same way for every wind speed and spring."
    )
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.01,)
    autonomous = False

    drift: float = parameter("d", "rad", "drift over the run", scale=0.002, lower=-1.0, upper=1.0)
    settling: float = settling()

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Add the drift."""
        del drawn
        if self.is_null:
            return angle
        return angle + self.drift * ramp(time_s / stated.duration, self.settling)
