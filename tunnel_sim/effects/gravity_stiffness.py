"""Gravity acting on an offset centre of mass about a tilted axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos

from tunnel_sim.effects.base import Effect, Law
from tunnel_sim.effects.parameters import Circumstances, Trial, parameter


@dataclass(frozen=True)
class GravityStiffness(Effect):
    """Gravity acting on an offset centre of mass about a tilted axis.

    Args:
        stiffness: greatest restoring moment, N m/rad.
        rest_angle: equilibrium angle under gravity alone, rad.
    """

    name = "gravity_stiffness"
    place = 7
    channel = "stiffness"
    condition = "always"
    advice = "Model gravity's sine, or level the axis and balance the body on it"
    equation = "−Kg sin(β − βg)"
    signature = (
        "The same stiffness is added to every spring, so the line of Kr against ωn² keeps its gradient "
        "but misses the origin; the shift of the centre depends on the spring."
    )
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (0.4, 0.2)
    turns = "stiffness"

    stiffness: float = parameter(
        "Kg", "N m/rad", "greatest restoring moment", scale=0.3, lower=-1e5, upper=1e5
    )
    rest_angle: float = parameter(
        "βg",
        "rad",
        "equilibrium angle under gravity alone",
        scale=0.1,
        lower=-3.2,
        upper=3.2,
        fit_lower=-1.6,  # beyond a right angle the same moment has the other sign of Kg
        fit_upper=1.6,
        beside_spring=True,  # without a spring it is one with the sensor's zero
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Gravity beside stated springs, or in place of an unstated one.

        An unstated spring absorbs all of a small gravity but its curvature. In place of the spring it leaves the
        frequency of small swings as it is, so that the curvature shows.
        """
        (trial,) = super().trials(campaign)
        return (replace(trial, replaces="stiffness") if campaign.normalised else trial,)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"gravity_stiffness": self.stiffness, "gravity_angle": self.rest_angle}

    @property
    def stiffness_at_rest(self) -> float:
        """Stiffness that gravity adds to the rig at rest, N m/rad."""
        return self.stiffness * cos(self.rest_angle)
