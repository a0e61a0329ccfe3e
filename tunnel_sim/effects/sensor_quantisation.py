"""A resolution that is coarser than stated."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from tunnel_sim.effects.base import Effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.vocabulary.plan import SensorModel


@dataclass(frozen=True)
class SensorQuantisation(Effect):
    """A resolution that is coarser than stated.

    Args:
        step: true step of the reading, rad.
    """

    name = "sensor_quantisation"
    place = 17
    channel = "sensor"
    condition = "always"
    advice = "State the sensor's real resolution, or use a finer one"
    equation = "y = q round(y/q); a step finer than the stated resolution does nothing"
    signature = (
        "The readings are multiples of a coarser step than stated; their error is a sawtooth of the angle."
    )
    references = ("Widrow & Kollár, Quantization Noise, CUP 2008, doi 10.1017/CBO9780511754661",)
    example = (0.004,)
    fitted = False
    lattice = True

    step: float = parameter("q", "rad", "true step of the reading", scale=0.002, lower=0.0, upper=1.0)

    def on_sensor(self, sensor: SensorModel) -> SensorModel:
        """Use the true step where it is coarser than the stated one."""
        return dataclasses.replace(sensor, resolution=max(self.step, sensor.resolution))
