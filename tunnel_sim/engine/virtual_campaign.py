"""A whole campaign on the virtual rig, from its plan."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from math import isclose
from typing import Any

import mujoco
import numpy as np

from tunnel_sim.effects import ALL_EFFECTS, Effect, EffectChain, effect_from
from tunnel_sim.effects.base import SPRING_TOLERANCE
from tunnel_sim.engine.sensor import read_motion
from tunnel_sim.engine.simulate import Progress, simulate_motions
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.motion import Motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.aero import AeroDerivatives
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, Truth
from tunnel_sim.vocabulary.record import Record
from tunnel_sim.vocabulary.rig import Rig


def simulate_campaign(
    plan: CampaignPlan, rig: Rig | None = None, *, nthread: int = 0, progress: Progress | None = None
) -> Campaign:
    """Make every run of a plan.

    Args:
        plan: conditions, truth, sensor, effects and seed.
        rig: geometry and mass; None takes the packaged rig.
        nthread: threads; 0 takes all processors. The result is the same to the bit whatever the number.
        progress: called with (runs done, runs in all).

    Returns:
        The campaign, as a rig engineer would have measured it: it states the rig's nominal inertia, not
        the injected one, and knows nothing of the truth.

    Raises:
        TunnelError: when an effect is unknown or a run leaves the finite range.
    """
    (campaign,) = simulate_campaigns([plan], rig, nthread=nthread, progress=progress)
    return campaign


def simulate_campaigns(
    plans: Sequence[CampaignPlan],
    rig: Rig | None = None,
    *,
    nthread: int = 0,
    progress: Progress | None = None,
) -> list[Campaign]:
    """Make every run of several plans, their runs integrated together.

    Args:
        plans: of one sample rate.
        rig: as in `simulate_campaign`.
        nthread: likewise.
        progress: called with (runs done, runs in all).

    Returns:
        One campaign per plan, to the bit those of `simulate_campaign`.

    Raises:
        TunnelError: when sample rates differ, an effect is unknown or a run leaves the finite range.
    """
    rig = load_rig() if rig is None else rig
    rates = {plan.sensor.sample_rate for plan in plans}
    if len(rates) != 1:
        raise TunnelError(f"plans of {len(rates)} sample rates", remedy="simulate those of one rate together")
    drawn = [_draw(plan) for plan in plans]
    true = [chain.physics() for runs in drawn for _, chain in runs]
    motions = iter(simulate_motions(rig, true, *rates, nthread=nthread, progress=progress))
    return [
        _campaign(plan, rig, list(islice(motions, len(runs))), runs)
        for plan, runs in zip(plans, drawn, strict=True)
    ]


_Drawn = list[tuple[np.random.Generator, EffectChain]]  # of every run, in the plan's order


def _draw(plan: CampaignPlan) -> _Drawn:
    """The effects of every run with what they draw, and the generator of its noise."""
    effects = plan_effects(plan)
    stated = [run_settings(plan.truth, condition) for condition in plan.conditions]
    rngs = [np.random.default_rng(child) for child in np.random.SeedSequence(plan.seed).spawn(len(stated))]
    return [(rng, EffectChain.draw(run, effects, rng)) for run, rng in zip(stated, rngs, strict=True)]


def stated_run(condition: Condition, record: Record) -> Run:
    """A run as a campaign lists it, without the truth.

    Args:
        condition: the stated conditions.
        record: what the sensor read.
    """
    return Run(
        id=condition.id,
        record=record,
        wind_speed=condition.wind_speed,
        spring_stiffness=condition.spring_stiffness,
        air_density=condition.air_density if condition.wind_speed > 0.0 else None,
        release_angle=condition.release_angle,
    )


def _campaign(plan: CampaignPlan, rig: Rig, motions: Sequence[Motion], drawn: _Drawn) -> Campaign:
    records = [
        read_motion(motion, plan.sensor, rng, chain)
        for motion, (rng, chain) in zip(motions, drawn, strict=True)
    ]
    runs = tuple(
        stated_run(condition, record) for condition, record in zip(plan.conditions, records, strict=True)
    )
    return Campaign(
        name=plan.name,
        description=plan.description,
        rig=RigProperties(
            yaw_inertia=rig.dynamics.yaw_inertia,
            frontal_area=rig.body.frontal_area,
            reference_length=rig.body.length,
            width=rig.body.width,
        ),
        sensor=SensorProperties(
            sample_rate=plan.sensor.sample_rate,
            resolution=plan.sensor.resolution or None,
            noise_std=plan.sensor.noise_std or None,
        ),
        runs=runs,
    )


def run_settings(truth: Truth, condition: Condition, *, timestep: float = 1e-3) -> RunSettings:
    """The stated physics of one run.

    Args:
        truth: coefficients.
        condition: spring, wind and release.
        timestep: integration step, s.

    Returns:
        The run without any effect.
    """
    return RunSettings(
        spring_stiffness=condition.spring_stiffness,
        derivatives=AeroDerivatives(truth.cn_beta, truth.cn_r),
        yaw_inertia=truth.yaw_inertia,
        mechanical_damping=truth.mechanical_damping,
        wind_speed=condition.wind_speed,
        air_density=condition.air_density,
        release_angle=condition.release_angle,
        duration=condition.duration,
        timestep=timestep,
    )


def plan_effects(plan: CampaignPlan) -> tuple[Effect, ...]:
    """The effects a plan names.

    Args:
        plan: its effects, by name and parameters.

    Returns:
        The effects in the vocabulary's order, whatever the plan's; what sits between rod and sensor comes
        ahead of what the sensor itself does.

    Raises:
        TunnelError: when a name is unknown or given twice, a severity missing, a value out of range, or a
            spring none of the plan's.
    """
    effects = [_stated_effect(setting) for setting in plan.effects]
    names = [effect.name for effect in effects]
    for effect in effects:
        if names.count(effect.name) > 1:
            raise TunnelError(
                "is given twice",
                where=f"effect {effect.name}",
                remedy="give it once, with all its parameters",
            )
        _check_spring(effect, plan)
    return tuple(
        sorted(effects, key=lambda effect: (not effect.ahead_of_sensor, ALL_EFFECTS.index(type(effect))))
    )


def _stated_effect(setting: EffectSetting) -> Effect:
    """An effect whose severity is given: by its default it would be injected in name only."""
    effect = effect_from(setting.name, setting.parameters)
    severity = effect.parameters()[0]
    if severity.name not in setting.parameters:
        raise TunnelError(
            f"{severity.name} is missing",
            where=f"effect {effect.name}",
            remedy=f"give the {severity.meaning} in {severity.unit}, such as {severity.scale:g}",
        )
    return effect


def _check_spring(effect: Effect, plan: CampaignPlan) -> None:
    """A spring that no run has would be injected in name only."""
    springs = sorted({condition.spring_stiffness for condition in plan.conditions})
    parameter = effect.chosen_spring()
    if parameter is None or effect.is_null:
        return
    chosen = getattr(effect, parameter)
    if not any(isclose(spring, chosen, rel_tol=SPRING_TOLERANCE) for spring in springs):
        raise TunnelError(
            f"no run has a spring_stiffness of {chosen:g} N m/rad",
            where=f"effect {effect.name}",
            remedy=f"give one of {', '.join(f'{spring:g}' for spring in springs)}",
        )


def truth_document(plan: CampaignPlan) -> dict[str, Any]:
    """What was injected, for ``truth.json``; no estimator or diagnosis reads it.

    Args:
        plan: the plan that was simulated.

    Returns:
        Coefficients, sensor, effects that act with their parameters, seed and versions, in JSON's types.
    """
    effects = [effect for effect in plan_effects(plan) if not effect.is_null]
    return {
        "schema_version": 1,
        "cn_beta": plan.truth.cn_beta,
        "cn_r": plan.truth.cn_r,
        "yaw_inertia": plan.truth.yaw_inertia,
        "mechanical_damping": plan.truth.mechanical_damping,
        "noise_std": plan.sensor.noise_std,
        "sensor_zero": plan.sensor.zero,
        "effects": sorted(effect.name for effect in effects),
        "parameters": {effect.name: effect.to_json_dict()["parameters"] for effect in effects},
        "seed": plan.seed,
        "versions": {"mujoco": mujoco.__version__, "numpy": np.__version__},
    }
