"""A wind speed that drifts during the run."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import EQUATION, Circumstances, Trial, parameter, ramp, settling
from tunnel_sim.physics.run_settings import RunSettings, Series

_SAMPLES = 201  # of an exponential drift, linear in between: within 1e-4 of the drift up to k = 5


@dataclass(frozen=True)
class WindSpeedDrift(Effect):
    """A wind speed that drifts during the run.

    Args:
        drift: relative gain of speed over the run, dimensionless.
        settling: length of the run over the drift's time constant, dimensionless; 0: linear (textbook form).
    """

    name = "wind_speed_drift"
    place = 10
    channel = "stiffness"
    condition = "wind_on"
    advice = "Hold the wind speed during the run, or record it"
    equation = "V(t) = V (1 + d t/T) over a run of length T; general form: " + EQUATION + " for t/T"
    signature = "The frequency of wind-on runs changes with time rather than with amplitude."
    references = ("Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",)
    example = (0.1,)
    autonomous = False

    drift: float = parameter(
        "d", "1", "relative gain of speed over the run", scale=0.02, lower=-0.9, upper=5.0
    )
    settling: float = settling()

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """None in normalised form."""
        return () if campaign.normalised else super().trials(campaign)

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Replace the constant wind speed by a sampled drift; two samples suffice where it is linear."""
        del drawn
        if stated.wind_speed <= 0.0 or self.is_null:
            return run
        part = ramp(np.linspace(0.0, 1.0, 2 if self.settling == 0.0 else _SAMPLES), self.settling)
        speeds = run.wind_speed * (1.0 + self.drift * part)
        drifting = Series(tuple(speeds.tolist()), stated.duration / (part.size - 1))
        return dataclasses.replace(run, series={**run.series, "wind_speed": drifting})
