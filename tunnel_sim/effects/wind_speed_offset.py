"""A constant error of the stated wind speed."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from tunnel_sim.effects.base import REFERENCE_SPEED, Drawn, Effect
from tunnel_sim.effects.parameters import Circumstances, Trial, parameter
from tunnel_sim.physics.run_settings import RunSettings, Series


@dataclass(frozen=True)
class WindSpeedOffset(Effect):
    """A constant error of the stated wind speed.

    Args:
        offset: true minus stated speed (at 20 m/s where it depends on the speed), m/s.
        exponent: power of the stated speed in the offset, dimensionless; 0 in the textbook form.
    """

    name = "wind_speed_offset"
    place = 23
    channel = "calibration"
    condition = "wind_on"
    advice = "Calibrate the wind speed"
    equation = "true speed = stated speed + ΔV; general form: ΔV (V/20 m/s)^n for ΔV"
    signature = "The aerodynamic stiffness is not proportional to the square of the stated speed."
    references = ("Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",)
    example = (1.0,)

    offset: float = parameter("ΔV", "m/s", "true minus stated speed", scale=0.5, lower=-50.0, upper=50.0)
    exponent: float = parameter(
        "n", "1", "power of the stated speed in the offset", scale=0.5, lower=-3.0, upper=3.0, form=True
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """An offset that leaves half of the slowest wind at least: without wind there is no derivative to fit."""
        at_most = 0.5 * campaign.slowest_wind
        return [dataclasses.replace(trial, at_most=at_most) for trial in super().trials(campaign)]

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Use the true speed."""
        del drawn
        if stated.wind_speed <= 0.0 or self.is_null:
            return run
        grown = self.offset * (stated.wind_speed / REFERENCE_SPEED) ** self.exponent
        series = dict(run.series)
        if "wind_speed" in series:  # set by another effect, such as a drift
            given = series["wind_speed"]
            values = tuple(max(0.0, value + grown) for value in given.values)
            series["wind_speed"] = Series(values, given.interval)
        return dataclasses.replace(run, wind_speed=max(0.0, run.wind_speed + grown), series=series)
