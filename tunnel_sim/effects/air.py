"""Effects of the air: steady flow and its lag, wind speed, turbulence and vortices."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Self

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.capabilities import AtRandom, OutOfPhase, Periodic
from tunnel_sim.effects.evidence import Residuals, Sought
from tunnel_sim.effects.parameters import (
    EQUATION,
    Circumstances,
    Trial,
    WindOnRun,
    exponent,
    mean_of_ramp,
    parameter,
    ramp,
    settling,
)
from tunnel_sim.physics.run_settings import REFERENCE_SPEED, Series, SettingsTable
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class NonlinearYawMoment(Effect):
    """An aerodynamic yaw moment that is not linear in the yaw angle."""

    name = "nonlinear_yaw_moment"
    place = 9
    channel = "stiffness"
    condition = "wind_on"
    advice = "Model the nonlinear moment, or use smaller angles"
    equation = "Ka (1 + κa β²) β instead of Ka β; general form: |β|^p for β²"
    signature = "Like cubic stiffness, but proportional to V² and absent with the wind off."
    references = ("Mansor & Passmore, J. Wind Eng. Ind. Aerodyn. 96 (2008) 1218",)
    example = (3.0,)
    law_terms = ("moment_cubic", "moment_cubic_exponent")

    coefficient: float = parameter(
        "κa", "1/rad2", "relative change of Ka per squared angle",
        scale=1.0, lower=-1e6, upper=1e6, fit_lower=-100.0, fit_upper=100.0,
    )  # fmt: skip
    exponent: float = exponent("p", "power of the angle in the factor (unchanged at 0.2 rad)", 2.0)


@dataclass(frozen=True)
class NonlinearYawDamping(Effect):
    """Aerodynamic damping that depends on the yaw angle."""

    name = "nonlinear_yaw_damping"
    place = 11
    channel = "damping"
    condition = "wind_on"
    advice = "Model the damping that depends on the angle, or use smaller angles"
    equation = "Ca (1 + μa β²) β̇ instead of Ca β̇; general form: |β|^p for β²"
    signature = (
        "The aerodynamic part of the damping ratio in wind-on runs changes by the relative amount μa A²/4."
    )
    references = ("van der Pol, Phil. Mag. 2 (1926) 978, doi 10.1080/14786442608564127",)
    example = (20.0,)
    law_terms = ("damping_quadratic", "damping_quadratic_exponent")

    coefficient: float = parameter(
        "μa", "1/rad2", "relative change of Ca per squared angle",
        scale=5.0, lower=-1e6, upper=1e6, fit_lower=-500.0, fit_upper=500.0,
    )  # fmt: skip
    exponent: float = exponent("p", "power of the angle in the factor (unchanged at 0.2 rad)", 2.0)


#: Uncertainty of Cnr as a share of the first-order effect a·Cnβ, chosen from the errors in the tuning sets.
_UNSEEN_SHARE = 0.2


@dataclass(frozen=True)
class UnsteadyAeroLag(OutOfPhase):
    """An aerodynamic moment that lags or leads the yaw angle."""

    name = "unsteady_aero_lag"
    place = 12
    channel = "damping"
    condition = "wind_on"
    size = "an aerodynamic moment that lags by {lag}"
    advice = "Model the lag of the aerodynamic moment"
    equation = (
        "Ka x instead of Ka β, with τ ẋ = β − x, τ = a l/V; for a < 0 a phase lead: Ka (2β − x) with |τ|"
    )
    signature = (
        "To first order Cnr absorbs it; the remainder is of second order in τω, and shows when springs and speeds "
        "are compared."
    )
    references = (
        "Theissen, Unsteady Vehicle Aerodynamics in Gusty Crosswind (dissertation), TU München 2012",
        "Jones, NACA Report 681 (1940)",
    )
    example = (1.5,)
    law_terms = ("aero_lag",)
    tries = 2
    caveat = (
        "With the lag, Cnr describes the damping term alone; the lag also damps the motion. In a slow oscillation "
        "both act as Cnr − a Cnβ, the derivative in phase with the rate, which the nominal model shows."
    )
    undetected = (
        "Cnr is the derivative in phase with the rate; its part due to the rate alone differs by up to {changes} "
        "if a lag of {size} acts"
    )

    lag: float = parameter("a", "l/V", "time constant in units of l/V", scale=0.5, lower=-20.0, upper=20.0)

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """First a phase lag, then a phase lead; to first order Cnr absorbs both."""
        del campaign
        scale = cls.parameters()[0].scale
        return [
            Trial({"lag": size}, "lag", second_order=True, passive=size > 0.0) for size in (scale, -scale)
        ]

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """To first order a lag only changes Cnr by a·Cnβ; runs show only the second-order remainder.

        With two time constants, as in Jones's approximation (NACA Report 681, 1940), their mean is up to a
        third below the best-fitting single constant; the same is true for a phase lead.
        """
        del runs
        return 0.0, _UNSEEN_SHARE * abs(self.lag * cn_beta)

    def in_phase(self, cn_beta: float, cn_r: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """A lag of a l/V has the response 1/(1 + iωτ) to the angle, a lead 2 − 1/(1 + iωτ), with τ = |a| l/V."""
        if not runs:
            return cn_beta, cn_r
        reduced = [self.lag * run.omega * run.per_cn_r / run.per_cn_beta for run in runs]
        slow = sum(1.0 / (1.0 + one**2) for one in reduced) / len(reduced)
        angle = slow if self.lag >= 0.0 else 2.0 - slow
        return cn_beta * angle, cn_r - self.lag * cn_beta * slow


@dataclass(frozen=True)
class ReynoldsDependence(Effect):
    """A yaw moment coefficient that depends on the wind speed."""

    name = "reynolds_dependence"
    place = 34
    channel = "stiffness"
    condition = "wind_on"
    size = "a Cnβ that changes by {per_e_fold} per e-fold of the wind speed"
    advice = "State Cnβ for every wind speed, or measure at the Reynolds number of interest"
    equation = (
        "Cnβ (1 + k ln(V/V0)) instead of Cnβ; V0: mean wind speed of the campaign's wind-on runs, 20 m/s for a run "
        "without a campaign"
    )
    signature = (
        "The aerodynamic stiffness is not proportional to the square of the speed, and the damping is as "
        "without it."
    )
    references = (
        "Schewe, J. Wind Eng. Ind. Aerodyn. 89 (2001) 1267",
        "Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",
    )
    example = (0.2,)
    caveat = "Cnβ is the value at the mean wind speed of the runs with the wind on."

    per_e_fold: float = parameter(
        "k", "1", "relative change of Cnβ per e-fold of the wind speed",
        scale=0.05, lower=-5.0, upper=5.0, relative=True,
    )  # fmt: skip

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """The coefficient at the mean speed depends on the form between the speeds of the runs.

        A power law, and a change that saturates within half an e-fold, are fitted like the logarithm, with the
        weights of the moments. The truth may be between either of them and the logarithm: a rectangular
        half-width.
        """
        if len(runs) < 2:
            return 0.0, 0.0
        moment = np.array([run.per_cn_beta for run in runs])
        speed = moment / np.array([run.per_cn_r for run in runs])
        folds = np.log(speed / np.mean(speed))
        forms = np.expm1(self.per_e_fold * folds), self.per_e_fold * 0.5 * np.tanh(folds / 0.5)
        at_mean = np.polyfit(folds, np.stack(forms, axis=1), 1, w=moment)[1]
        return float(np.max(np.abs(at_mean))) * abs(cn_beta) / sqrt(3.0), 0.0

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """None with one wind speed: its Cnβ absorbs the effect."""
        return super().trials(campaign) if len(campaign.wind_speeds) > 1 else ()

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Use the coefficients at the stated speeds."""
        del drawn
        on = stated.wind_speed > 0.0
        share = np.where(on, stated.wind_speed, 1.0) / np.where(on, stated["mean_speed"], 1.0)
        runs["cn_beta"][:] *= 1.0 + cls.column(effects, "per_e_fold") * np.log(share)


@dataclass(frozen=True)
class FlowMisalignment(Effect):
    """Flow at an angle to the rig's axis, which gives a steady yaw moment."""

    name = "flow_misalignment"
    place = 15
    channel = "forcing"
    condition = "wind_on"
    size = "flow at an angle of {angle}"
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

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Set the flow angle in the moment law."""
        del drawn
        speed = np.where(stated.wind_speed > 0.0, stated.wind_speed, REFERENCE_SPEED) / REFERENCE_SPEED
        runs["flow_angle"][:] = cls.column(effects, "angle") * speed ** cls.column(effects, "exponent")


@dataclass(frozen=True)
class WindSpeedOffset(Effect):
    """A constant error of the stated wind speed."""

    name = "wind_speed_offset"
    place = 23
    channel = "calibration"
    condition = "wind_on"
    size = "wind speeds that are off by {offset}"
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
        """An offset that leaves at least half of the slowest wind: without wind no derivative can be fitted."""
        at_most = 0.5 * min(campaign.wind_speeds, default=0.0)
        return [dataclasses.replace(trial, at_most=at_most) for trial in super().trials(campaign)]

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Use the true speeds."""
        del drawn
        acts = stated.wind_speed > 0.0
        share = np.where(acts, stated.wind_speed, REFERENCE_SPEED) / REFERENCE_SPEED
        grown = cls.column(effects, "offset") * share ** cls.column(effects, "exponent")
        runs.wind_speed[acts] = np.maximum(0.0, runs.wind_speed + grown)[acts]
        for place in np.flatnonzero(acts & (grown != 0.0)).tolist():
            runs.series[place] = _faster(runs.series[place], float(grown[place]))


def _faster(series: Mapping[str, Series], grown: float) -> Mapping[str, Series]:
    """Inputs with a greater wind speed, m/s, if another effect, such as a drift, has already set a series."""
    given = series.get("wind_speed")
    if given is None:
        return series
    values = tuple(max(0.0, value + grown) for value in given.values)
    return {**series, "wind_speed": Series(values, given.interval)}


_SAMPLES = 201  # of an exponential drift, linear in between: within 1e-4 of the drift up to k = 5


@dataclass(frozen=True)
class WindSpeedDrift(Effect):
    """A wind speed that drifts during the run."""

    name = "wind_speed_drift"
    place = 10
    channel = "stiffness"
    condition = "wind_on"
    advice = "Keep the wind speed constant during the run, or record it"
    equation = "V(t) = V (1 + d t/T) over a run of length T; general form: " + EQUATION + " for t/T"
    signature = "The frequency of wind-on runs changes with time rather than with amplitude."
    references = ("Barlow, Rae & Pope, Low-Speed Wind Tunnel Testing, Wiley 1999",)
    example = (0.1,)
    autonomous = False
    caveat = (
        "The stated wind speed counts as the speed at the release. The uncertainty of Cnβ includes that it may be "
        "the mean over the run."
    )

    drift: float = parameter(
        "d", "1", "relative gain of speed over the run", scale=0.02, lower=-0.9, upper=5.0, relative=True
    )
    settling: float = settling()

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """Runs cannot show whether the stated speed holds at the release or is the mean over the run.

        The truth may be between the two cases; half their difference is a rectangular half-width.
        """
        mean = 1.0 + self.drift * mean_of_ramp(self.settling)
        return (abs(cn_beta * (mean**2 - 1.0)) / sqrt(3.0) if runs else 0.0), 0.0

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """None in normalised form."""
        return () if campaign.normalised else super().trials(campaign)

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Replace the constant wind speeds by sampled drifts; two samples suffice where they are linear."""
        del drawn
        acts, duration = (stated.wind_speed > 0.0) & (cls.column(effects, "drift") != 0.0), stated["duration"]
        shapes: dict[float, Array] = {}
        for place in np.flatnonzero(acts).tolist():
            drift, settling = effects[place].drift, effects[place].settling
            if settling not in shapes:
                count = 2 if settling == 0.0 else _SAMPLES
                shapes[settling] = ramp(np.linspace(0.0, 1.0, count), settling)
            part = shapes[settling]
            speeds = runs.wind_speed[place] * (1.0 + drift * part)
            drifting = Series(tuple(speeds.tolist()), float(duration[place]) / (part.size - 1))
            runs.series[place] = {**runs.series[place], "wind_speed": drifting}


@dataclass(frozen=True)
class VortexShedding(Periodic, AtRandom):
    """A periodic moment from vortices shed by the body."""

    name = "vortex_shedding"
    place = 14
    channel = "forcing"
    condition = "wind_on"
    advice = "Choose wind speeds at which the vortices are shed far from the rig's frequency"
    equation = "c ½ρV²Al sin(2π St V t/width + φ), φ drawn for every run"
    signature = "A spectral line whose frequency is proportional to the wind speed."
    references = ("Bearman, Annu. Rev. Fluid Mech. 16 (1984) 195, doi 10.1146/annurev.fl.16.010184.001211",)
    example = (0.1, 0.02)
    frequency_by_wind = "strouhal_number"
    random = "narrow_band"

    amplitude: float = parameter(
        "c", "1", "coefficient of the moment", scale=0.01, lower=0.0, upper=5.0, per_pressure=True
    )
    strouhal_number: float = parameter(
        "St", "1", "Strouhal number based on the body's width",
        scale=0.15, lower=0.001, upper=2.0, default=0.15,
    )  # fmt: skip

    @classmethod
    def sought(cls, residuals: Residuals) -> Iterable[Sought | None]:
        """A line at one Strouhal number."""
        return (residuals.wind_line(0.02, 0.60, "width"),)

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Set the terms of the moment law, with the phases drawn for the runs."""
        del stated
        acts = np.array([not effect.is_null for effect in effects])
        phase = [
            0.0 if effect.is_null else effect.drawn_number(d)
            for effect, d in zip(effects, drawn, strict=True)
        ]
        for name, values in (
            ("shedding_amplitude", cls.column(effects, "amplitude")),
            ("strouhal_number", cls.column(effects, "strouhal_number")),
            ("shedding_phase", np.array(phase)),
        ):
            runs[name][acts] = values[acts]
