"""Flow at an angle to the rig's axis, which gives a steady yaw moment."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import REFERENCE_SPEED, Drawn, Effect, with_law
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings


@dataclass(frozen=True)
class FlowMisalignment(Effect):
    """Flow at an angle to the rig's axis, which gives a steady yaw moment.

    Args:
        angle: angle of the flow against the rig's zero (at 20 m/s where it depends on the speed), rad.
        exponent: power of the speed in the angle, dimensionless; 0 in the textbook form.
    """

    name = "flow_misalignment"
    place = 15
    channel = "forcing"
    condition = "wind_on"
    advice = "Align the rig with the flow"
    equation = "moment Ka βf added; general form: βf (V/20 m/s)^n for βf"
    signature = (
        "The centre of the oscillation shifts in proportion to the wind speed squared over the stiffness."
    )
    references = ("Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",)
    example = (0.02,)

    angle: float = parameter(
        "βf", "rad", "angle of the flow against the rig's zero", scale=0.01, lower=-0.8, upper=0.8
    )
    exponent: float = parameter(
        "n", "1", "power of the speed in the angle", scale=0.5, lower=-3.0, upper=3.0, form=True
    )

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Set the flow angle in the moment law."""
        del drawn
        if stated.wind_speed <= 0.0:
            return with_law(run, flow_angle=self.angle)
        grown = self.angle * (stated.wind_speed / REFERENCE_SPEED) ** self.exponent
        return with_law(run, flow_angle=grown)
