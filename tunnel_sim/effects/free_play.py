"""Play between spring and rod: the spring acts through a dead zone."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import parameter


@dataclass(frozen=True)
class FreePlay(Effect):
    """Play between spring and rod: the spring acts through a dead zone.

    Args:
        half_width: half width of the dead zone, rad.
    """

    name = "free_play"
    place = 6
    channel = "stiffness"
    condition = "always"
    advice = "Take up the play between spring and rod"
    equation = "−Kr dz(β); dz = 0 within ±δ, β ∓ δ beyond"
    signature = "The frequency falls steeply as the amplitude nears the dead zone."
    references = ("Conner, Tang, Dowell & Virgin, J. Fluids Struct. 11 (1997) 89",)
    example = (0.01,)

    half_width: float = parameter(
        "δ", "rad", "half width of the dead zone", scale=0.002, lower=0.0, upper=0.2
    )

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"free_play": self.half_width}
