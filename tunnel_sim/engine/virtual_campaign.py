"""Simulation of a whole campaign from its plan."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from math import isclose
from typing import Any

import mujoco
import numpy as np

from tunnel_sim.effects import Effect, EffectChain, effect_from, known_effects
from tunnel_sim.effects.base import SPRING_TOLERANCE
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.engine.simulate import Progress, simulate_motions
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import DriveMoment, Motion, RunSettings
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import AeroDerivatives, CampaignPlan, Condition, EffectSetting, Truth
from tunnel_sim.vocabulary.record import Record
from tunnel_sim.vocabulary.rig import Rig


def simulate_campaign(
    plan: CampaignPlan, rig: Rig | None = None, *, nthread: int = 0, progress: Progress | None = None
) -> Campaign:
    """Simulate every run of a plan.

    Args:
        plan: conditions, truth, sensor, effects and seed.
        rig: geometry and mass; None uses the packaged rig.
        nthread: number of threads; 0 uses all processors. The result does not depend on it.
        progress: called with (runs done, runs in all).

    Returns:
        The campaign as a rig engineer would have measured it: it states the rig's nominal inertia, not that of
        the truth, and contains no other trace of the truth.

    Raises:
        TunnelError: when an effect is unknown or the motion of a run grows without bound.
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
    """Simulate every run of several plans, integrating the runs together.

    Args:
        plans: all with the same sample rate.
        rig: as in `simulate_campaign`.
        nthread: as in `simulate_campaign`.
        progress: called with (runs done, runs in all).

    Returns:
        One campaign per plan, bit-identical to those of `simulate_campaign`.

    Raises:
        TunnelError: when sample rates differ, an effect is unknown or the motion of a run grows without bound.
    """
    rig = load_rig() if rig is None else rig
    rates = {plan.sensor.sample_rate for plan in plans}
    if len(rates) != 1:
        raise TunnelError(
            f"the plans have {len(rates)} different sample rates", remedy="simulate each rate separately"
        )
    drawn = [_draw(plan) for plan in plans]
    true = [chain.physics() for runs in drawn for _, chain in runs]
    motions = iter(simulate_motions(rig, true, *rates, nthread=nthread, progress=progress))
    return [
        _campaign(plan, rig, list(islice(motions, len(runs))), runs)
        for plan, runs in zip(plans, drawn, strict=True)
    ]


_Drawn = list[tuple[np.random.Generator, EffectChain]]  # of every run, in the plan's order


def _draw(plan: CampaignPlan) -> _Drawn:
    """The random parts of the effects in every run, and the generator of its noise."""
    effects = plan_effects(plan)
    rate = plan.sensor.sample_rate
    stated = [run_settings(plan.truth, condition, sample_rate=rate) for condition in plan.conditions]
    rngs = [np.random.default_rng(child) for child in np.random.SeedSequence(plan.seed).spawn(len(stated))]
    return [(rng, EffectChain.draw(run, effects, rng)) for run, rng in zip(stated, rngs, strict=True)]


def stated_run(condition: Condition, record: Record) -> Run:
    """A run as a campaign lists it, without the truth."""
    return Run(
        id=condition.id,
        record=record,
        wind_speed=condition.wind_speed,
        spring_stiffness=condition.spring_stiffness,
        air_density=condition.air_density if condition.wind_speed > 0.0 else None,
        release_angle=condition.release_angle if condition.drive is None else None,
        drive=condition.drive,
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
        rig=RigProperties.of(rig),
        sensor=SensorProperties.of(plan.sensor),
        runs=runs,
    )


def run_settings(
    truth: Truth, condition: Condition, *, timestep: float = 1e-3, sample_rate: float | None = None
) -> RunSettings:
    """The stated physics of one run.

    Args:
        timestep: integration step, s.
        sample_rate: of the input of a driven run, Hz; not used for a free decay.
    """
    given, moment = condition.drive, None
    if given is not None:
        assert sample_rate is not None
        moment = DriveMoment(
            np.arange(given.values.size) / sample_rate,
            given.values,
            held=given.hold == "zero",
            on_body=given.on_body,
        )
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
        drive=moment,
    )


def plan_effects(plan: CampaignPlan) -> tuple[Effect, ...]:
    """The effects of a plan.

    Returns:
        The effects in the order of the vocabulary, which need not be the plan's; those between rod and sensor come
        before those of the sensor itself.

    Raises:
        TunnelError: when a name is unknown or given twice, a severity is missing, a value is out of range, a
            spring is not in the plan, or an effect acts on driven runs only.
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
        _check_driven(effect, plan)
    return tuple(
        sorted(effects, key=lambda effect: (not effect.ahead_of_sensor, known_effects().index(type(effect))))
    )


def _stated_effect(setting: EffectSetting) -> Effect:
    """An effect whose severity is given: with the default severity it would do nothing."""
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
    """Refuse an effect on a spring that no run has: it would do nothing."""
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


def _check_driven(effect: Effect, plan: CampaignPlan) -> None:
    """Refuse effects whose meaning with an input is not defined."""
    drives = [condition.drive for condition in plan.conditions if condition.drive is not None]
    if effect.is_null:
        return
    if effect.driven and not drives:
        raise TunnelError(
            "acts on driven runs only, and all runs of the plan are free decays",
            where=f"effect {effect.name}",
            remedy="leave it out, or add [drive]",
        )
    if not drives:
        return
    if effect.skips:
        raise TunnelError(
            "leaves samples out, which is not simulated for driven runs",
            where=f"effect {effect.name}",
            remedy="leave out the effect or [drive]",
        )
    if effect.on_spring and effect.channel == "damping" and not all(d.on_body for d in drives):
        raise TunnelError(
            "is a loss in the spring, which is not simulated where its root moves",
            where=f"effect {effect.name}",
            remedy="leave out the effect, or drive the body by amplitudes_nm",
        )


def truth_document(plan: CampaignPlan) -> dict[str, Any]:
    """The content of ``truth.json``, which estimators and diagnosis never read.

    Returns:
        Coefficients, sensor, active effects with their parameters, seed and versions, as plain JSON values.
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
