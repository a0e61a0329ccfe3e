"""Simulation of a whole campaign from its plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from math import isclose
from typing import Any

import mujoco
import numpy as np

from tunnel_sim.effects import Effect, EffectChain, effect_from, known_effects
from tunnel_sim.effects.base import SPRING_TOLERANCE
from tunnel_sim.effects.capabilities import BetweenRuns, ReadingEffect
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.effects.drives import ActuatorEffect
from tunnel_sim.engine.simulate import Progress, simulate_motions
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import REFERENCE_SPEED, RunSettings
from tunnel_sim.vocabulary.between_runs import along, between_runs, together
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties, mean_wind_speed
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import ANGLE
from tunnel_sim.vocabulary.plan import AeroDerivatives, CampaignPlan, Condition, SensorModel, Truth
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
        The campaign as a rig engineer would have measured it: it states the rig's nominal inertia, not the true
            inertia, and contains no other trace of the truth.

    Raises:
        TunnelError: when an effect is unknown or the motion of a run diverges.
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
        One campaign per plan, bit-identical to the result of `simulate_campaign`.

    Raises:
        TunnelError: when sample rates differ, an effect is unknown or the motion of a run diverges.
    """
    rig = load_rig() if rig is None else rig
    rates = {plan.sensor.sample_rate for plan in plans}
    if len(rates) != 1:
        remedy = "simulate each rate separately"
        raise TunnelError(f"the plans have {len(rates)} different sample rates", remedy=remedy)
    drawn = [run for plan in plans for run in _drawn(plan)]  # for every run, in the plans' order
    true = [run.chain.physics() for run in drawn]
    motions = simulate_motions(rig, true, *rates, nthread=nthread, progress=progress)
    simulated = zip(motions, drawn, strict=True)
    campaigns = []
    for plan in plans:
        runs = tuple(
            stated_run(condition, read_motion(motion, run.sensor, run.rng, run.chain))
            for condition, (motion, run) in zip(
                plan.conditions, islice(simulated, len(plan.conditions)), strict=True
            )
        )
        stated = RigProperties.of(rig), SensorProperties.of(plan.sensor)
        known = plan.repeatability
        campaigns.append(Campaign(plan.name, *stated, runs, plan.description, repeatability=known))
    return campaigns


@dataclass(frozen=True, eq=False)
class _Drawn:
    """The draws of a run: its generator, its effects, its sensor, and its deviations from the plan."""

    rng: np.random.Generator
    chain: EffectChain
    sensor: SensorModel

    @property
    def between_runs(self) -> dict[str, float]:
        """The relative deviations of the run by name, from the effects and the plan together."""
        found = dict(self.chain.deviations)
        for effect, drawn in zip(self.chain.effects, self.chain.drawn, strict=True):
            if isinstance(effect, BetweenRuns):
                name = effect.scatters
                found[name] = together(effect.deviation(drawn), found.get(name, 0.0))
        return found


def _drawn(plan: CampaignPlan) -> list[_Drawn]:
    """The draws of every run of a plan before it is simulated."""
    effects = plan_effects(plan)
    for condition in plan.conditions:
        if condition.wind_speed > 0.0 and condition.drive is not None and condition.drive.kind.of_base:
            raise TunnelError(
                "a shaken base is not supported with the wind on",
                where=f"{plan.name}, run '{condition.id}'",
                remedy="give wind_speeds = [0], or drive the body by amplitudes_nm",
            )
    runs = len(plan.conditions)
    seeds = np.random.SeedSequence(plan.seed).spawn(runs)
    deviations = plan.scatter.deviations(between_runs(np.random.SeedSequence(plan.seed)), along(runs))
    speed = mean_wind_speed((condition.wind_speed for condition in plan.conditions), REFERENCE_SPEED)
    found = []
    for condition, seed, own in zip(plan.conditions, seeds, deviations, strict=True):
        rng, zero = np.random.default_rng(seed), own.pop("zero", 0.0)
        stated = run_settings(plan.truth, condition, sample_rate=plan.sensor.sample_rate, mean_speed=speed)
        chain = replace(EffectChain.draw(stated, effects, rng), deviations=own)
        found.append(_Drawn(rng, chain, replace(plan.sensor, zero=plan.sensor.zero + zero)))
    return found


def stated_run(condition: Condition, record: Record) -> Run:
    """A run as listed in a campaign, without the truth."""
    return Run(
        id=condition.id,
        record=record,
        wind_speed=condition.wind_speed,
        spring_stiffness=condition.spring_stiffness,
        air_density=condition.air_density if condition.wind_speed > 0.0 else None,
        release_angle=condition.release_angle if condition.drive is None else None,
        drive=condition.drive,
    )


def run_settings(
    truth: Truth,
    condition: Condition,
    *,
    sample_rate: float | None = None,
    mean_speed: float = REFERENCE_SPEED,
) -> RunSettings:
    """The stated physics of one run.

    Args:
        sample_rate: sample rate of the input of a driven run, Hz; not used for a free decay.
        mean_speed: mean speed of the campaign, m/s, as in `RunSettings`.
    """
    given, moment = condition.drive, None
    if given is not None:
        assert sample_rate is not None
        scale = given.kind.true_scale(condition.gain, condition.spring_stiffness, truth.yaw_inertia)
        moment = InputMoment.of(given, np.arange(given.values.size) / sample_rate, scale)
    return RunSettings(
        spring_stiffness=condition.spring_stiffness,
        derivatives=AeroDerivatives(truth.cn_beta, truth.cn_r),
        yaw_inertia=truth.yaw_inertia,
        mechanical_damping=truth.mechanical_damping,
        wind_speed=condition.wind_speed,
        air_density=condition.air_density,
        mean_speed=mean_speed,
        release_angle=condition.release_angle,
        duration=condition.duration,
        drive=moment,
    )


def plan_effects(plan: CampaignPlan) -> tuple[Effect, ...]:
    """The effects of a plan in the order of the vocabulary, but those ahead of the sensor before its own."""
    effects = []
    for setting in plan.effects:
        effect = effect_from(setting.name, setting.parameters)
        severity = effect.parameters()[0]
        if severity.name not in setting.parameters:  # its default severity has no effect
            remedy = f"give the {severity.meaning}{beside(severity.unit, ' in ')}, such as {severity.scale:g}"
            raise TunnelError(f"{severity.name} is missing", where=f"effect {effect.name}", remedy=remedy)
        effects.append(effect)
    names = [effect.name for effect in effects]
    springs = sorted({condition.spring_stiffness for condition in plan.conditions})
    drives = [condition.drive for condition in plan.conditions if condition.drive is not None]
    for effect in effects:
        where = f"effect {effect.name}"
        if effect.motion not in ("", ANGLE.motion):
            what = f"is stated with motion = '{effect.motion}', and the simulated rig turns"
            raise TunnelError(what, where=where, remedy="state it in the units of an angle")
        if isinstance(effect, BetweenRuns) and effect.scatters in plan.scatter.stated:
            what = f"{effect.scatters} scatters twice, by this effect and in [scatter]"
            raise TunnelError(what, where=where, remedy="give one of them")
        if names.count(effect.name) > 1:
            remedy = "give it once, with all its parameters"
            raise TunnelError("is given twice", where=where, remedy=remedy)
        if effect.is_null:
            continue
        parameter = effect.chosen_spring()
        chosen = None if parameter is None else getattr(effect, parameter)
        if chosen is not None and not any(isclose(k, chosen, rel_tol=SPRING_TOLERANCE) for k in springs):
            # without a spring the effect would do nothing
            what = f"no run has a spring_stiffness of {chosen:g} N m/rad"
            remedy = f"give one of {', '.join(f'{spring:g}' for spring in springs)}"
            raise TunnelError(what, where=where, remedy=remedy)
        if effect.driven and not drives:
            what = "acts on driven runs only, and all runs of the plan are free decays"
            raise TunnelError(what, where=where, remedy="leave it out, or add [drive]")
        if isinstance(effect, ActuatorEffect) and not any(drive.kind.by_actuator for drive in drives):
            what = "changes the moment of a drive, but this drive moves the spring's root or the base"
            raise TunnelError(what, where=where, remedy="leave it out, or drive the body by amplitudes_nm")
        if effect.on_spring and effect.channel == "damping" and not all(d.on_body for d in drives):
            what = "is a loss in the spring; it is not simulated where the spring's root moves"
            remedy = "leave out the effect, or drive the body by amplitudes_nm"
            raise TunnelError(what, where=where, remedy=remedy)
        if effect.by_angle_in_room and any(drive.kind.by_inertia for drive in drives):
            what = "is not simulated where the base turns: its moment depends on more than the base's acceleration"
            remedy = "leave out the effect, or drive the body by amplitudes_nm"
            raise TunnelError(what, where=where, remedy=remedy)
    known = known_effects()
    return tuple(
        sorted(effects, key=lambda effect: (not _ahead_of_sensor(effect), known.index(type(effect))))
    )


def _ahead_of_sensor(effect: Effect) -> bool:
    return isinstance(effect, ReadingEffect) and effect.ahead_of_sensor


def truth_document(plan: CampaignPlan) -> dict[str, Any]:
    """The content of ``truth.json``, as plain JSON values; estimators and diagnosis never read it.

    Scatter between runs is listed beside the effects: its widths, and the deviations of every run.
    """
    effects = [effect for effect in plan_effects(plan) if not effect.is_null]
    scattering = [effect for effect in effects if isinstance(effect, BetweenRuns)]
    effects = [effect for effect in effects if not isinstance(effect, BetweenRuns)]
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
        **_scatter_truth(plan, scattering),
        "seed": plan.seed,
        "versions": {"mujoco": mujoco.__version__, "numpy": np.__version__},
    }


def _scatter_truth(plan: CampaignPlan, scattering: Sequence[BetweenRuns]) -> dict[str, Any]:
    """The widths of the scatter between the runs, and every run's own deviations; empty if the runs repeat."""
    widths = plan.scatter.stated | {effect.scatters: effect.severity for effect in scattering}
    if not widths:
        return {}
    runs = {}
    for condition, run in zip(plan.conditions, _drawn(plan), strict=True):
        zero = {"zero": run.sensor.zero - plan.sensor.zero} if plan.scatter.zero else {}
        runs[condition.id] = run.between_runs | zero
    return {"scatter": widths, "runs": runs}
