"""The run that is shown in a window, film or picture, from a plan or from a few options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees, isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tunnel_lab.terminal.inputs import parse_effect
from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, SensorModel, Truth
from tunnel_sim.vocabulary.rig import Rig

if TYPE_CHECKING:
    from tunnel_sim.effects import EffectChain
    from tunnel_sim.vocabulary.record import Record

PAPER = {"cn_beta": 0.4719, "cn_r": -0.1033}
"""Coefficients of a run that no plan describes, 1/rad: the paper's Table IV, neural network."""


@dataclass(frozen=True)
class Request:
    """The options; None takes the value of the plan or the rig.

    Args:
        plan: a campaign's description.
        run: id of a run of the plan; None takes its first.
        spring: number in the rig's table.
        wind_speed: m/s.
        release_angle_deg: degrees.
        duration: s.
        effects: ``NAME:PARAMETER=VALUE``, beyond the plan's.
        seed: of the sensor's noise and of what effects draw; None takes the plan's, or 1.
    """

    plan: str | None = None
    run: str | None = None
    spring: int | None = None
    wind_speed: float | None = None
    release_angle_deg: float | None = None
    duration: float | None = None
    effects: tuple[str, ...] = ()
    seed: int | None = None

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> Request:
        """From the fields by name."""
        return cls(**{**data, "effects": tuple(data["effects"])})


@dataclass(frozen=True)
class ShownRun:
    """A run ready to be simulated."""

    rig: Rig
    chain: EffectChain
    sensor: SensorModel
    title: str
    request: Request

    @cached_property
    def settings(self) -> RunSettings:
        """The run's physics, effects included."""
        from tunnel_sim.physics.steps import follow_fastest

        return follow_fastest(self.rig, self.chain.physics())

    def record(self) -> Record:
        """The potentiometer's reading, simulated at each call with the same bits."""
        from tunnel_sim.effects.base import read_motion
        from tunnel_sim.engine.model import build_model
        from tunnel_sim.engine.simulate import simulate_motion

        plan, _ = _plan_and_condition(self.request, self.rig)
        motion = simulate_motion(build_model(self.rig, self.settings), self.sensor.sample_rate)
        return read_motion(motion, self.sensor, np.random.default_rng([plan.seed, 1]), self.chain)


def shown_run(request: Request) -> ShownRun:
    """Prepare a run.

    Raises:
        TunnelError: for a plan that cannot be read, an unknown run, spring or effect, or a number that is out
            of range.
    """
    from tunnel_sim.effects import EffectChain
    from tunnel_sim.engine.virtual_campaign import plan_effects, run_settings

    rig = load_rig()
    plan, condition = _plan_and_condition(request, rig)
    stated = run_settings(plan.truth, condition, sample_rate=plan.sensor.sample_rate)
    effects = plan_effects(plan)
    chain = EffectChain.draw(stated, effects, np.random.default_rng([plan.seed, 0]))
    wind = f"{condition.wind_speed:g} m/s" if condition.wind_speed > 0.0 else "wind off"
    names = "".join(f", {effect.name.replace('_', ' ')}" for effect in effects if not effect.is_null)
    start = "driven" if condition.drive else f"released at {degrees(condition.release_angle):.3g}°"
    title = f"{condition.spring_stiffness:g} N m/rad, {wind}, {start}{names}"
    return ShownRun(rig, chain, plan.sensor, title, request)


def _plan_and_condition(request: Request, rig: Rig) -> tuple[CampaignPlan, Condition]:
    """The plan with the request's effects and seed, and the condition of the run."""
    plan = _no_plan(rig) if request.plan is None else load_plan(Path(request.plan))
    if request.seed is not None:
        plan = replace(plan, seed=request.seed)
    added = tuple(parse_effect(text) for text in request.effects)
    condition = _changed(_run_of(plan, request), request, rig)
    # Keep only this run, so that effects are checked against its spring alone.
    return replace(plan, effects=plan.effects + added, conditions=(condition,)), condition


def _run_of(plan: CampaignPlan, request: Request) -> Condition:
    if request.run is None:
        return plan.conditions[0]
    if request.plan is None:
        raise TunnelError(
            "there is no plan", where=f"--run {request.run}", remedy="name the plan of this run"
        )
    by_id = {condition.id: condition for condition in plan.conditions}
    if request.run not in by_id:
        raise TunnelError(
            f"has no run {request.run!r}", where=request.plan, remedy=did_you_mean(request.run, by_id)
        )
    return by_id[request.run]


def _changed(condition: Condition, request: Request, rig: Rig) -> Condition:
    wind = _number("--wind", request.wind_speed, condition.wind_speed, 0.0, 60.0, "m/s")
    angle = _number(
        "--angle", request.release_angle_deg, degrees(condition.release_angle), -60.0, 60.0, "degrees"
    )
    duration = _number("--duration", request.duration, condition.duration, 0.5, 600.0, "s")
    stiffness = condition.spring_stiffness if request.spring is None else rig.spring(request.spring)
    return replace(
        condition,
        spring_stiffness=stiffness,
        wind_speed=wind,
        release_angle=condition.release_angle if request.release_angle_deg is None else radians(angle),
        duration=duration,
    )


def _number(option: str, given: float | None, plan: float, low: float, high: float, unit: str) -> float:
    if given is None:
        return plan
    if not (isfinite(given) and low <= given <= high):
        raise TunnelError(
            f"{given:g} is out of range", where=option, remedy=f"give {low:g} to {high:g} {unit}"
        )
    return given


def _no_plan(rig: Rig) -> CampaignPlan:
    """The default run: the rig's default spring, 20°, the paper's coefficients, 10 m/s."""
    dynamics = rig.dynamics
    condition = Condition(
        id="run",
        spring_stiffness=rig.spring(dynamics.default_spring),
        wind_speed=10.0,
        air_density=rig.air.density,
        release_angle=radians(20.0),
        duration=10.0,
    )
    truth = Truth(**PAPER, yaw_inertia=dynamics.yaw_inertia, mechanical_damping=dynamics.mechanical_damping)
    return CampaignPlan("run", 1, truth, (condition,))
