"""Effects of the spring, the rod and gravity."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, isclose

from tunnel_sim.effects.base import SPRING_TOLERANCE, Drawn, Effect, Law
from tunnel_sim.effects.parameters import Circumstances, Trial, exponent, parameter
from tunnel_sim.physics import steps
from tunnel_sim.physics.run_settings import RodTwist, RunSettings


@dataclass(frozen=True)
class CubicStiffness(Effect):
    """A spring that hardens or softens with the angle.

    Args:
        coefficient: relative change of stiffness per squared angle, positive when hardening, 1/rad2.
        exponent: power of the angle in the moment (unchanged at 0.2 rad), dimensionless; 3 in the textbook form.
    """

    name = "cubic_stiffness"
    place = 4
    channel = "stiffness"
    condition = "always"
    on_spring = True
    advice = "Model the spring's cubic stiffness, or release from smaller angles"
    equation = "−κ Kr β³; general form: |β|^p sgn β for β³"
    signature = "The relative change of frequency from its small-amplitude value is (3/8) κ A²."
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (1.0,)

    coefficient: float = parameter(
        "κ",
        "1/rad2",
        "relative change of stiffness per squared angle, positive when hardening",
        scale=0.2,
        lower=-1e6,
        upper=1e6,
        fit_lower=-10.0,
        fit_upper=50.0,
    )

    exponent: float = exponent("p", "power of the angle in the moment (unchanged at 0.2 rad)", 3.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"stiffness_cubic": self.coefficient, "stiffness_cubic_exponent": self.exponent}


@dataclass(frozen=True)
class AsymmetricStiffness(Effect):
    """A spring that is stiffer to one side.

    Args:
        coefficient: relative change of stiffness per angle, 1/rad.
        exponent: power of the angle in the moment (unchanged at 0.2 rad), dimensionless; 2 in the textbook form.
    """

    name = "asymmetric_stiffness"
    place = 5
    channel = "stiffness"
    condition = "always"
    on_spring = True
    advice = "Seat the spring so that it is as stiff to both sides"
    equation = "−κ Kr β²; general form: |β|^p for β²"
    signature = (
        "The centre of the oscillation shifts by −κ A²/2 and a second harmonic appears; the "
        "frequency changes only in second order."
    )
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (0.2,)

    coefficient: float = parameter(
        "κ",
        "1/rad",
        "relative change of stiffness per angle",
        scale=0.05,
        lower=-1e6,
        upper=1e6,
        fit_lower=-2.0,
        fit_upper=2.0,
    )

    exponent: float = exponent("p", "power of the angle in the moment (unchanged at 0.2 rad)", 2.0)

    def law(self) -> Law:
        """The effect's terms of the moment law."""
        return {"stiffness_quadratic": self.coefficient, "stiffness_quadratic_exponent": self.exponent}


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
    on_spring = True
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


@dataclass(frozen=True)
class SpringMiscalibration(Effect):
    """One spring that is not as stiff as stated.

    Args:
        error: true over stated stiffness, less one, dimensionless.
        spring_stiffness: stated stiffness of the spring concerned, N m/rad.
    """

    name = "spring_miscalibration"
    place = 22
    channel = "calibration"
    condition = "always"
    on_spring = True
    advice = "Measure the stiffness of that spring again"
    equation = "(1 + x) Kr instead of the stated Kr, in the runs of one spring"
    signature = (
        "All runs of one spring lie off the line of stiffness against squared frequency by the same relative "
        "amount."
    )
    references = ("Paper, Table II: springs 4 and 7 lie off the line by −12 % and +10 %",)
    example = (0.05, 16.12)
    tries = 2

    error: float = parameter(
        "x",
        "1",
        "true over stated stiffness, less one",
        scale=0.02,
        lower=-0.9,
        upper=9.0,
    )
    spring_stiffness: float = parameter(
        "Kr",
        "N m/rad",
        "stated stiffness of the spring concerned",
        scale=16.12,
        lower=0.0,
        upper=1e6,
        chosen_spring=True,
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Every spring, where there is another to compare it with."""
        springs = campaign.springs if len(campaign.springs) > 1 else ()
        scale = cls.parameters()[0].scale
        return [Trial({"error": scale, "spring_stiffness": spring}, "error") for spring in springs]

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Correct the stiffness of the spring's runs."""
        del drawn
        concerned = isclose(stated.spring_stiffness, self.spring_stiffness, rel_tol=SPRING_TOLERANCE)
        if self.is_null or not concerned:
            return run
        return dataclasses.replace(run, spring_stiffness=run.spring_stiffness * (1.0 + self.error))
