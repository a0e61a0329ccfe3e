"""Effects of friction and of mechanical damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, pi, sqrt

from tunnel_sim.effects.base import Drawn, Effect, Law, with_law
from tunnel_sim.effects.parameters import WindOnRun, exponent, parameter
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


@dataclass(frozen=True)
class QuadraticDamping(Effect):
    """Damping that grows with the square of the rate.

    Args:
        coefficient: coefficient of the squared rate, N m s2/rad2.
        exponent: power of the rate in the moment (unchanged at 2 rad/s), dimensionless; 2 in the textbook form.
    """

    name = "quadratic_damping"
    place = 2
    channel = "damping"
    condition = "always"
    advice = "Model the damping that grows with the rate"
    equation = "−C2 |β̇| β̇; general form: |β̇|^n sgn β̇ for |β̇| β̇"
    signature = "The damping ratio falls in proportion to the amplitude."
    references = ("ITTC Recommended Procedure 7.5-02-07-04.5, roll damping of ships: B1 p + B2 |p| p",)
    example = (0.01,)

    coefficient: float = parameter(
        "C2",
        "N m s2/rad2",
        "coefficient of the squared rate",
        scale=0.002,
        lower=-1e4,
        upper=1e4,
        fit_lower=0.0,
        rate_exponent="exponent",
    )

    exponent: float = exponent("n", "power of the rate in the moment (unchanged at 2 rad/s)", 2.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"quadratic_damping": self.coefficient, "quadratic_damping_exponent": self.exponent}


@dataclass(frozen=True)
class StructuralDamping(Effect):
    """Hysteretic loss in spring and rod: the same share of the energy per cycle at every frequency.

    Args:
        loss_factor: loss factor, dimensionless.
    """

    name = "structural_damping"
    place = 3
    channel = "damping"
    condition = "always"
    on_spring = True
    advice = "Model the hysteretic loss: the same share of the energy per cycle at every frequency"
    equation = "−(η Kr/ωn) β̇ with ωn = √(Kr/Izz)"
    signature = (
        "Each run is linear, but the damping moment grows with the square root of the spring's stiffness."
    )
    references = ("Crandall, J. Sound Vib. 11 (1970) 3, doi 10.1016/S0022-460X(70)80105-5",)
    example = (0.02,)

    loss_factor: float = parameter("η", "1", "loss factor", scale=0.005, lower=-1.0, upper=1.0, fit_lower=0.0)

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """Runs cannot show which frequency sets the loss: that of the motion, or that of the rig in still air.

        Causality may also stiffen the spring by (2η/π) ln(ω/ωn) (Crandall, J. Sound Vib. 11 (1970) 3). The
        truth may lie between the two cases; their difference counts as a rectangular half-width.
        """
        del cn_beta
        if not runs:
            return 0.0, 0.0
        stiffening = [
            2.0 * self.loss_factor / pi * r.spring_stiffness * log(r.still_omega / r.omega) / r.per_cn_beta
            for r in runs
        ]
        loss = [
            self.loss_factor
            * (r.spring_stiffness / r.omega - r.spring_stiffness / r.still_omega)
            / r.per_cn_r
            for r in runs
        ]
        cn_beta_std, cn_r_std = (abs(sum(s)) / len(s) / sqrt(3.0) for s in (stiffening, loss))
        return cn_beta_std, cn_r_std

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"loss_factor": self.loss_factor}
