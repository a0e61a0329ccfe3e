"""Backlash between rod and sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.forward import backlash
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class SensorHysteresis(Effect):
    """Backlash between rod and sensor.

    Args:
        half_width: half width of the play, rad.
        roundness: relative difference k of two plays, (1 ± k) times as wide, whose mean is read, dimensionless;
            0 in the textbook form.
    """

    name = "sensor_hysteresis"
    place = 18
    channel = "sensor"
    condition = "always"
    advice = "Take up the backlash between rod and sensor"
    equation = "y follows β when pushed: play of half width w; general form: mean of two plays, (1 ± k) w"
    signature = (
        "The reading stands still for a moment at each reversal of the motion and lags by w in between."
    )
    references = (
        "Visintin, Differential Models of Hysteresis, Springer 1994, doi 10.1007/978-3-662-11557-2",
    )
    example = (0.003,)
    autonomous = False
    remembers = True
    ahead_of_sensor = True

    half_width: float = parameter("w", "rad", "half width of the play", scale=0.001, lower=0.0, upper=0.2)
    roundness: float = parameter(
        "k",
        "1",
        "relative difference of two plays whose mean is read",
        scale=0.3,
        lower=0.0,
        upper=1.0,
        form=True,
    )

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Follow when pushed; the release has just pushed the reading outward."""
        del time_s, stated, drawn
        if self.is_null:
            return angle
        widths = {self.half_width * (1.0 + self.roundness), self.half_width * (1.0 - self.roundness)}
        plays = [backlash(angle, w, float(angle[0] - np.sign(angle[0]) * w)) for w in sorted(widths)]
        return np.asarray(sum(plays) / len(plays), dtype=np.float64)
