"""Mains hum in the reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class MainsHum(Effect):
    """Mains hum in the reading.

    Args:
        amplitude: amplitude of the hum, rad.
        frequency: mains frequency, Hz.
    """

    name = "mains_hum"
    place = 20
    channel = "sensor"
    condition = "always"
    advice = "Shield the sensor's cable, or ground it at one end only"
    equation = "y = β + a sin(2π f t + φ), φ drawn for every run"
    signature = "A spectral line at the mains frequency in every run, independent of the motion."
    references = ("Doebelin, Measurement Systems, McGraw-Hill 2003",)
    example = (0.002, 60.0)
    autonomous = False
    fitted = False
    line = "mains"

    amplitude: float = parameter("a", "rad", "amplitude of the hum", scale=0.0005, lower=0.0, upper=1.0)
    frequency: float = parameter(
        "f", "Hz", "mains frequency", scale=0.05, lower=45.0, upper=65.0, default=50.0
    )

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Add the hum at the phase drawn for the run."""
        del stated
        if self.is_null:
            return angle
        phase = self.drawn_number(drawn)
        return angle + self.amplitude * np.sin(2.0 * np.pi * self.frequency * time_s + phase)
