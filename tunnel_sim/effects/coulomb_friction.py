"""Dry friction in the rod's bearing and potentiometer."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Drawn, Effect, with_law
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics import steps
from tunnel_sim.physics.run_settings import RunSettings


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction in the rod's bearing and potentiometer.

    With a presliding range the contact deflects before it slides (Dahl 1968; Canudas de Wit et al. 1995,
    doi 10.1109/9.376053): z is the deflection, zero at the release; zs is the deflection at which it slides;
    2 Tc/zs is the stiffness just after the sliding reverses.

    Args:
        friction_moment: friction moment, N m.
        presliding: deflection at which the contact slides, rad; 0 in the textbook form.
    """

    name = "coulomb_friction"
    place = 1
    channel = "damping"
    condition = "always"
    advice = "Free the bearing and the potentiometer of their dry friction"
    equation = (
        "−Tc sgn β̇; rest while the other moments stay within ±Tc; general form: −Tc z/zs, ż = β̇ − |β̇| z/zs"
    )
    signature = (
        "The envelope falls linearly, by 4Tc/Kr per cycle, so the damping ratio rises "
        "as the amplitude decays, and the body can come to rest off centre."
    )
    references = (
        "Feeny & Liang, J. Sound Vib. 195 (1996) 149, doi 10.1006/jsvi.1996.0411",
        "Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419, doi 10.1109/9.376053",
    )
    example = (0.05,)

    friction_moment: float = parameter("Tc", "N m", "friction moment", scale=0.004, lower=0.0, upper=1e4)
    presliding: float = parameter(
        "zs",
        "rad",
        "deflection at which the contact slides",
        scale=0.005,
        lower=0.0,
        upper=0.2,
        fit_lower=5e-4,  # below it the contact moves faster than the integrator steps
        form=True,
    )

    def stands(self, stiffness: float) -> float:
        """The angle at which the spring's moment is that of the friction, rad."""
        return self.friction_moment / stiffness if stiffness > 0.0 else 0.0

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Set the terms of the moment law, with steps short enough to resolve the presliding range."""
        del stated, drawn
        if self.is_null or self.presliding == 0.0:
            return with_law(run, friction_moment=self.friction_moment)
        return steps.for_contact(
            with_law(run, friction_moment=self.friction_moment, presliding=self.presliding)
        )
