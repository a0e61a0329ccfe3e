"""Effects of the spring, the rod and gravity, and of mechanical damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, cos, exp, log, pi, sqrt
from typing import Self

import numpy as np

from tunnel_sim.effects.base import SPRING_TOLERANCE, Drawn, Effect
from tunnel_sim.effects.capabilities import Backlash
from tunnel_sim.effects.parameters import Circumstances, Trial, WindOnRun, exponent, parameter
from tunnel_sim.effects.traits import Text
from tunnel_sim.physics.expression import parse
from tunnel_sim.physics.run_settings import RodTwist, SettingsTable
from tunnel_sim.vocabulary.quantities import PerRun

_RINGING_STEP = 0.02  # relative: the half-power width of a rod's ringing with a damping of 1 % of critical


@dataclass(frozen=True)
class CubicStiffness(Effect):
    """A spring that hardens or softens with the angle."""

    name = "cubic_stiffness"
    place = 4
    channel = "stiffness"
    condition = "always"
    on_spring = True
    advice = "Model the spring's cubic stiffness, or use smaller angles"
    advice_for_joint = "Model the cubic stiffness of the joint, or use smaller angles"
    equation = "−κ Kr β³; general form: |β|^p sgn β for β³"
    signature = "The relative change of frequency from its small-amplitude value is (3/8) κ A²."
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (1.0,)
    law_terms = ("stiffness_cubic", "stiffness_cubic_exponent")

    coefficient: float = parameter(
        "κ", "1/rad2", "relative change of stiffness per squared angle, positive when hardening",
        scale=0.2, lower=-1e6, upper=1e6, fit_lower=-10.0, fit_upper=50.0,
    )  # fmt: skip
    exponent: float = exponent("p", "power of the angle in the moment (unchanged at 0.2 rad)", 3.0)


@dataclass(frozen=True)
class AsymmetricStiffness(Effect):
    """A spring that is stiffer to one side."""

    name = "asymmetric_stiffness"
    place = 5
    channel = "stiffness"
    condition = "always"
    on_spring = True
    advice = "Seat the spring so that it is equally stiff to both sides"
    advice_for_joint = "Model a stiffness of the joint that differs to the two sides"
    equation = "−κ Kr β²; general form: |β|^p for β²"
    signature = (
        "The centre of the oscillation shifts by −κ A²/2 and a second harmonic appears; the "
        "frequency changes only in second order."
    )
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (0.2,)
    law_terms = ("stiffness_quadratic", "stiffness_quadratic_exponent")

    coefficient: float = parameter(
        "κ", "1/rad", "relative change of stiffness per angle",
        scale=0.05, lower=-1e6, upper=1e6, fit_lower=-2.0, fit_upper=2.0,
    )  # fmt: skip
    exponent: float = exponent("p", "power of the angle in the moment (unchanged at 0.2 rad)", 2.0)


@dataclass(frozen=True)
class FreePlay(Backlash):
    """Play between spring and rod: the spring acts through a dead zone."""

    name = "free_play"
    place = 6
    channel = "stiffness"
    condition = "always"
    on_spring = True
    jumps = True
    size = "play of {half_width} to each side between spring and rod"
    advice = "Remove the play between spring and rod"
    advice_for_joint = "Remove the play in the gear of the joint, or add it to the model"
    equation = "−Kr dz(β); dz = 0 within ±δ, β ∓ δ beyond"
    signature = "The frequency falls steeply as the amplitude nears the dead zone."
    references = ("Conner, Tang, Dowell & Virgin, J. Fluids Struct. 11 (1997) 89",)
    example = (0.01,)
    law_terms = ("free_play",)

    half_width: float = parameter(
        "δ", "rad", "half width of the dead zone", scale=0.002, lower=0.0, upper=0.2
    )


@dataclass(frozen=True)
class GravityStiffness(Effect):
    """Gravity acting on an offset centre of mass about a tilted axis."""

    name = "gravity_stiffness"
    place = 7
    channel = "stiffness"
    condition = "always"
    by_angle_in_room = True
    size = "gravity of up to {stiffness}"
    advice = "Model gravity's sine, or level the axis and balance the body on it"
    advice_for_joint = "Correct gravity's moment in the model: mass and centre of mass of the links"
    equation = "−Kg sin(β − βg)"
    signature = (
        "The same stiffness is added to every spring, so the line of Kr against ωn² keeps its gradient "
        "but misses the origin; the shift of the centre depends on the spring."
    )
    references = ("Nayfeh & Mook, Nonlinear Oscillations, Wiley 1979, doi 10.1002/9783527617586",)
    example = (0.4, 0.2)
    law_terms = ("gravity_stiffness", "gravity_angle")
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
        fit_lower=-1.6,  # beyond a right angle the same moment has the opposite sign of Kg
        fit_upper=1.6,
        beside_spring=True,  # without a spring the effect cannot be separated from the sensor's zero
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Gravity together with stated springs, or instead of an unstated spring.

        An unstated spring absorbs a small gravity except for its curvature. Gravity that replaces the spring
        leaves the frequency of small swings unchanged, so that the curvature shows.
        """
        (trial,) = super().trials(campaign)
        return (replace(trial, replaces="stiffness") if campaign.normalised else trial,)

    @property
    def stiffness_at_rest(self) -> float:
        """Stiffness that gravity adds to the rig at rest, N m/rad."""
        return self.stiffness * cos(self.rest_angle)


@dataclass(frozen=True)
class RodFlexibility(Effect):
    """A rod that twists between its upper end, which carries spring and sensor, and the body."""

    name = "rod_flexibility"
    place = 8
    channel = "stiffness"
    condition = "always"
    by_angle_in_room = True
    size = "a rod that twists by {compliance}"
    advice = "Stiffen the rod, or put the sensor at the body's end"
    advice_for_joint = "Stiffen the transmission, or put the sensor at the side of the link"
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

    def alike(self) -> Sequence[Trial]:
        """Other frequencies of the ringing, within the width of its line: the slow motion shows (1 − s)²/Krod."""
        if self.is_null:
            return ()
        first, last = (
            log(s / (1.0 - s)) for s in (self.parameters()[1].fit_lower, self.parameters()[1].fit_upper)
        )
        count = ceil((last - first) / (2.0 * _RINGING_STEP))  # s/(1 − s) is inversely proportional to ω²
        ratios = (exp(first + (last - first) * i / count) for i in range(count + 1))
        slow = self.compliance * (1.0 - self.inertia_share) ** 2
        return [
            Trial({"compliance": slow * (1.0 + r) ** 2, "inertia_share": r / (1.0 + r)}, "compliance")
            for r in ratios
        ]

    @classmethod
    def small_swings(
        cls, stiffness: float, damping: float, values: Mapping[str, float]
    ) -> tuple[float, float]:
        """The slow mode, in which the rod twists little."""
        twist, share = values["compliance"], values["inertia_share"]
        if twist <= 0.0 or stiffness <= 0.0:
            return stiffness, damping
        rod = 1.0 / twist
        upper, lower = np.array([-stiffness - rod, rod]) / share, np.array([rod, -rod]) / (1.0 - share)
        motion = np.zeros((4, 4))  # of both angles, then of both rates
        motion[:2, 2:] = np.eye(2)
        motion[2:, :2] = upper, lower
        motion[2, 2] = -damping / share
        slow = min(np.linalg.eigvals(motion), key=abs)
        return float(abs(slow) ** 2), float(-2.0 * slow.real)

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Let the rods twist."""
        del stated, drawn
        columns = (cls.column(effects, name).tolist() for name in ("compliance", "inertia_share"))
        for place, (compliance, share) in enumerate(zip(*columns, strict=True)):
            if compliance:
                runs.rod_twist[place] = RodTwist(compliance, share)


@dataclass(frozen=True)
class SpringMiscalibration(Effect):
    """One spring whose stiffness differs from the stated one."""

    name = "spring_miscalibration"
    place = 22
    channel = "calibration"
    condition = "always"
    on_spring = True
    advice = "Measure the stiffness of the spring of {spring_stiffness} again"
    equation = "(1 + x) Kr instead of the stated Kr, in the runs of one spring"
    signature = (
        "All runs of one spring deviate from the line of stiffness against squared frequency by the same relative "
        "amount."
    )
    references = ("Paper, Table II: springs 4 and 7 lie off the line by −12 % and +10 %",)
    example = (0.05, 16.12)
    tries = 2

    error: float = parameter(
        "x", "1", "true over stated stiffness, minus one", scale=0.02, lower=-0.9, upper=9.0, relative=True
    )
    spring_stiffness: float = parameter(
        "Kr", "N m/rad", "stated stiffness of the spring concerned",
        scale=16.12, lower=0.0, upper=1e6, chosen_spring=True,
    )  # fmt: skip

    @classmethod
    def phrase(cls, values: Mapping[str, float], stds: Mapping[str, float | None], text: Text) -> str:
        """The spring, and its relative deviation from the stated stiffness."""
        error, stated, std = values["error"], values["spring_stiffness"], stds["error"]
        size = text(100.0 * abs(error), None if std is None else 100.0 * std, "%")
        side = "stiffer" if error > 0.0 else "softer"
        true = f"({stated * (1.0 + error):#.4g} N m/rad)"
        return f"a spring of {stated:g} N m/rad that is {size} {side} than stated {true}"

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Every spring, if there is another spring for comparison."""
        springs = campaign.springs if len(campaign.springs) > 1 else ()
        scale = cls.parameters()[0].scale
        return [Trial({"error": scale, "spring_stiffness": spring}, "error") for spring in springs]

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Correct the stiffness of the spring's runs."""
        del drawn
        runs.spring_stiffness[:] *= cls.scales(stated, effects)

    @classmethod
    def scales(cls, stated: SettingsTable, effects: Sequence[Self]) -> PerRun:
        """True over stated value by run: 1 plus the error with the spring concerned, else 1; shape (runs,)."""
        spring, its = stated.spring_stiffness, cls.column(effects, "spring_stiffness")
        concerned = np.abs(spring - its) <= SPRING_TOLERANCE * np.maximum(np.abs(spring), np.abs(its))
        return np.where(concerned, 1.0 + cls.column(effects, "error"), 1.0)


@dataclass(frozen=True)
class QuadraticDamping(Effect):
    """Damping that grows with the square of the rate."""

    name = "quadratic_damping"
    place = 2
    channel = "damping"
    condition = "always"
    size = "a damping moment of {coefficient} that grows with {power}"
    advice = "Model the damping that grows with the rate"
    equation = "−C2 |β̇| β̇; general form: |β̇|^n sgn β̇ for |β̇| β̇"
    signature = "The damping ratio falls in proportion to the amplitude."
    references = ("ITTC Recommended Procedure 7.5-02-07-04.5, roll damping of ships: B1 p + B2 |p| p",)
    example = (0.01,)
    law_terms = ("quadratic_damping", "quadratic_damping_exponent")

    coefficient: float = parameter(
        "C2", "N m s2/rad2", "coefficient of the squared rate",
        scale=0.002, lower=-1e4, upper=1e4, fit_lower=0.0, rate_exponent="exponent",
    )  # fmt: skip
    exponent: float = exponent(
        "n", "power of the rate in the moment (unchanged at 2 rad/s)", 2.0, fit_lower=1.0
    )  # with a lower power it would be dry friction

    @classmethod
    def phrase(cls, values: Mapping[str, float], stds: Mapping[str, float | None], text: Text) -> str:
        """The damping moment, with the fitted power of the rate where it is not the square."""
        power = f"{values.get('exponent', 2.0):.1f}"
        said = "the square of the rate" if power == "2.0" else f"the rate to the power of {power}"
        return super().phrase(values, stds, text).replace("{power}", said)


_AFTER_EFFECT = parse("size*log((t + lead)/length)", frozenset({"size", "t", "lead", "length"}))


@dataclass(frozen=True)
class StructuralDamping(Effect):
    """Hysteretic loss in spring and rod: the same share of the energy per cycle at every frequency."""

    name = "structural_damping"
    place = 3
    channel = "damping"
    condition = "always"
    on_spring = True
    size = "hysteretic damping with a loss factor of {loss_factor}"
    advice = "Model the hysteretic loss: the same share of the energy per cycle at every frequency"
    equation = (
        "−(η Kr/ωn) β̇ with ωn = √(Kr/Izz); general form: with an after-effect −m (2η/π) Kr β0 ln((t + 1/ωn)/T) of "
        "the release angle β0 in a run of length T"
    )
    signature = (
        "Each run is linear, but the damping moment grows with the square root of the spring's stiffness; the "
        "centre of the oscillation may creep back from the side of the release."
    )
    references = (
        "Crandall, J. Sound Vib. 11 (1970) 3, doi 10.1016/S0022-460X(70)80105-5",
        "Nowick & Berry, Anelastic Relaxation in Crystalline Solids, Academic Press 1972",
    )
    example = (0.02,)
    law_terms = ("loss_factor",)

    loss_factor: float = parameter("η", "1", "loss factor", scale=0.005, lower=-1.0, upper=1.0, fit_lower=0.0)
    after_effect: float = parameter(
        "m", "1", "after-effect of the release, relative to a loss factor equal at all frequencies",
        scale=1.0, lower=0.0, upper=10.0, form=True,
    )  # fmt: skip

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Add the loss and, where the body was held at its release angle, the spring's after-effect.

        An equal loss at all frequencies comes from relaxing elements at all frequencies. The slow elements have
        yielded to the release angle, and recover while the body swings.
        """
        del drawn
        loss, after_effect = cls.column(effects, "loss_factor"), cls.column(effects, "after_effect")
        runs["loss_factor"][:] = loss
        for place in np.flatnonzero((loss != 0.0) & (after_effect != 0.0)).tolist():
            run = stated.row(place)
            if run.drive is not None or not run.spring_stiffness:
                continue
            share = -2.0 / pi * effects[place].after_effect * effects[place].loss_factor
            size = share * run.spring_stiffness * run.release_angle
            lead = sqrt(run.yaw_inertia / run.spring_stiffness)
            constants = {"size": size, "lead": lead, "length": run.duration}
            runs.add_moment(place, _AFTER_EFFECT.program(constants, {"t": "time"}))

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """Runs cannot show which frequency determines the loss: the motion's, or the rig's in still air.

        Causality may also stiffen the spring by (2η/π) ln(ω/ωn) (Crandall 1970). The truth may be between the
        two cases; half their difference is a rectangular half-width.
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
