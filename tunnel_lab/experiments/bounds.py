"""Cramér–Rao bounds for comparison with errors: of the nominal model, including any scatter between runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tunnel_sim.effects import Effect, effect_from
from tunnel_sim.effects.capabilities import OutOfPhase
from tunnel_sim.effects.parameters import WindOnRun
from tunnel_sim.vocabulary.between_runs import Repeatability
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, SensorProperties
from tunnel_sim.vocabulary.plan import (
    CampaignPlan,
    Condition,
    SensorModel,
    Truth,
    aerodynamic_damping,
    aerodynamic_stiffness,
)
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import Rig


def reading_deviation(sensor: SensorModel) -> float:
    """Standard deviation of a reading, quantisation included, rad."""
    return float(np.hypot(sensor.noise_std, sensor.resolution / np.sqrt(12.0)))


def decay_bound(time: Array, release: float, omega_n: float, zeta: float, noise: float) -> dict[str, float]:
    """The bound of ``zeta`` (1) and ``omega_n`` (rad/s) of one run released at rest, with unknown zero.

    Args:
        time: sample times from the release, shape (n,), s.
        release: release angle, rad.
        omega_n: true natural frequency, rad/s.
        zeta: true damping ratio.
        noise: standard deviation of a reading, rad.

    Returns:
        By quantity; empty without an oscillation, or without noise, for which the bound is zero.
    """
    from identification.uncertainty.cramer_rao import damped_sinusoid_bound

    if not (noise > 0.0 and omega_n > 0.0 and abs(zeta) < 1.0 and release):
        return {}
    # Released at rest: A cos φ is the angle and A sin φ = −(decay rate)·angle/ωd.
    damped = omega_n * np.sqrt(1.0 - zeta**2)
    lag = -zeta * omega_n / damped
    bound = damped_sinusoid_bound(
        time,
        amplitude=abs(release) * float(np.hypot(1.0, lag)),
        phase=float(np.arctan2(lag, 1.0)),
        frequency=float(damped) / (2.0 * np.pi),
        zeta=zeta,
        noise_std=noise,
    )
    return {"zeta": bound.zeta, "omega_n": bound.omega_n}


def coefficients_bound(
    campaign: Campaign,
    truth: Truth,
    releases: Sequence[float],
    noise: float,
    scatter: Repeatability | None = None,
) -> Mapping[str, float]:
    """The bound of Cnβ, Cnr, Izz and Cr by name, SI; coefficients not determined by the campaign are left out.

    Args:
        releases: release angle of each run, at rest, rad.
        noise: standard deviation of a reading, rad.
        scatter: scatter of the runs; None: they repeat exactly.

    Returns:
        By quantity; empty without noise, for which the bound is zero.
    """
    from identification.uncertainty.cramer_rao import campaign_bound

    if noise <= 0.0:
        return {}
    states = [(release, 0.0) for release in releases]
    bound = campaign_bound(campaign, truth, noise_std=noise, initial_states=states, repeatability=scatter)
    return {name: bound.std(name) for name in bound.parameters}


@dataclass(frozen=True)
class PlanBounds:
    """The bounds of a planned campaign.

    Args:
        runs: bounds of ``omega_n`` and ``zeta`` of each run, from `decay_bound`.
        campaign: bounds of the coefficients, from `coefficients_bound`.
    """

    runs: tuple[Mapping[str, float], ...]
    campaign: Mapping[str, float]


def nominal_oscillation(condition: Condition, truth: Truth, rig: Rig) -> dict[str, float] | None:
    """ωn [rad/s] and ζ of a run in the nominal model at small angles; None where its stiffness is not positive."""
    air = rig.body.flow(condition.air_density, condition.wind_speed)
    stiffness = condition.spring_stiffness - aerodynamic_stiffness(truth.cn_beta, **air)
    damping = truth.mechanical_damping - aerodynamic_damping(truth.cn_r, **air)
    if stiffness <= 0.0:
        return None
    omega_n = float(np.sqrt(stiffness / truth.yaw_inertia))
    return {"omega_n": omega_n, "zeta": damping / (2.0 * truth.yaw_inertia * omega_n)}


def in_phase(
    truth: Truth, effects: Sequence[Effect], conditions: Sequence[tuple[float, float, float]], rig: Rig
) -> Truth:
    """The truth that an estimator should recover: Cnβ and Cnr in phase with angle and rate (decision 0004).

    Args:
        effects: all acting effects, with or without a lag of the air.
        conditions: spring stiffness (N m/rad), wind speed (m/s) and air density (kg/m³) of every run.
    """
    runs = []
    for spring, speed, density in conditions:
        air = rig.body.flow(density, speed)
        loads = aerodynamic_stiffness(1.0, **air), aerodynamic_damping(1.0, **air)
        stiffness = spring - loads[0] * truth.cn_beta
        if speed > 0.0 and stiffness > 0.0:
            omega, still = (float(np.sqrt(one / truth.yaw_inertia)) for one in (stiffness, spring))
            runs.append(WindOnRun(spring, omega, still, *loads))
    found = truth.cn_beta, truth.cn_r
    for effect in effects:
        found = effect.in_phase(*found, runs) if isinstance(effect, OutOfPhase) else found
    return replace(truth, cn_beta=found[0], cn_r=found[1])


def recovered(plan: CampaignPlan, rig: Rig) -> Truth:
    """The truth of a planned campaign as `in_phase` states it."""
    conditions = [(one.spring_stiffness, one.wind_speed, one.air_density) for one in plan.conditions]
    effects = [effect_from(one.name, one.parameters) for one in plan.effects]
    return in_phase(plan.truth, effects, conditions, rig)


def plan_bounds(plan: CampaignPlan, rig: Rig, widths: Mapping[str, float]) -> PlanBounds:
    """The bounds of a planned campaign of free decays, at the truth of `recovered`, without its other effects.

    Args:
        widths: relative standard deviations between runs by name, as in `Repeatability`; zero: none.
    """
    from tunnel_sim.engine.virtual_campaign import stated_run  # imported here because it loads MuJoCo

    noise, rate = reading_deviation(plan.sensor), plan.sensor.sample_rate
    truth = recovered(plan, rig)
    nominal = [nominal_oscillation(one, truth, rig) for one in plan.conditions]
    times = [np.arange(max(2, round(one.duration * rate))) / rate for one in plan.conditions]
    runs = tuple(
        {} if found is None else decay_bound(time, one.release_angle, **found, noise=noise)
        for one, found, time in zip(plan.conditions, nominal, times, strict=True)
    )
    if not all(runs):  # a run does not oscillate, or the sensor has no noise
        return PlanBounds(runs, {})
    bare = tuple(
        stated_run(one, Record(time, np.zeros(time.size)))
        for one, time in zip(plan.conditions, times, strict=True)
    )
    campaign = Campaign(plan.name, RigProperties.of(rig), SensorProperties.of(plan.sensor), bare)
    scatter = Repeatability(**{name: width for name, width in widths.items() if width})
    releases = [one.release_angle for one in plan.conditions]
    return PlanBounds(runs, coefficients_bound(campaign, truth, releases, noise, scatter))
