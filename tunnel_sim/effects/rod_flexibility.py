"""A rod that twists between its upper end, which carries spring and sensor, and the body."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import Circumstances, Trial, parameter
from tunnel_sim.physics import steps
from tunnel_sim.physics.run_settings import RodTwist, RunSettings


@dataclass(frozen=True)
class RodFlexibility(Effect):
    """A rod that twists between its upper end, which carries spring and sensor, and the body.

    Args:
        compliance: twist per moment, rad/(N m).
        inertia_share: share of Izz at the rod's upper end, dimensionless.
    """

    name = "rod_flexibility"
    place = 8
    channel = "stiffness"
    condition = "always"
    advice = "Stiffen the rod, or put the sensor at the body's end"
    equation = (
        "s Izz θ̈ + Cr θ̇ + Kr θ = Krod φ + Crod φ̇; (1 − s) Izz β̈ = Ka β + Ca β̇ − Krod φ − Crod φ̇; φ = β − θ, "
        "the sensor reads θ, Crod is 1 % of critical"
    )
    signature = (
        "Spring and rod in series are softer than the spring alone, and the difference grows with the "
        "spring's stiffness; the aerodynamic stiffness acts at the lower end; the rod may ring after the release."
    )
    references = ("Meirovitch, Fundamentals of Vibrations, McGraw-Hill 2001",)
    example = (0.001, 0.3)
    autonomous = False
    tries = 3

    compliance: float = parameter(
        "1/Krod", "rad/(N m)", "twist per moment", scale=0.0005, lower=0.0, upper=1.0, fit_upper=0.01
    )
    inertia_share: float = parameter(
        "s",
        "1",
        "share of Izz at the rod's upper end",
        scale=0.1,
        lower=0.001,
        upper=0.999,
        fit_lower=0.02,  # outside these bounds the rod oscillates too fast for the integrator's steps
        fit_upper=0.9,
        default=0.1,
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Shares of inertia from a light upper end to an equal division."""
        del campaign
        scale = cls.parameters()[0].scale
        return [Trial({"compliance": scale, "inertia_share": s}, "compliance") for s in (0.05, 0.2, 0.5)]

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Let the rod twist, with steps short enough for its own oscillation."""
        del stated, drawn
        if self.is_null:
            return run
        return steps.for_rod(
            dataclasses.replace(run, rod_twist=RodTwist(self.compliance, self.inertia_share))
        )
