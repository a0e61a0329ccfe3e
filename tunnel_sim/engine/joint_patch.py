"""A user's model with native elements written into it, and its motion in the engine."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import mujoco
import numpy as np

from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.engine.model_files import engine_refusals
from tunnel_sim.engine.simulate import no_log
from tunnel_sim.files.reading import check_count
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, shown
from tunnel_sim.vocabulary.rig import WrittenAttribute

# number of samples of a delayed control beyond the delay: both neighbours of a time between samples
_SPARE = 2
_SLOW = 1e-9  # rad/s: slower than any creep


@dataclass(frozen=True)
class Start:
    """The start of a run.

    Args:
        time: time since the start of the record, s.
        angle, rate: displacement from rest, rad, and its rate, rad/s.
        drive: drive of the run from then on; None: a free decay.
    """

    run: str
    time: float
    angle: float
    rate: float
    drive: InputMoment | None = None


@dataclass(frozen=True, eq=False)
class Into:
    """A model that elements are written into.

    Args:
        before: the given model, compiled.
        inertia: inertia about the joint, as written so far, kg m².
        weight: remaining share of the weight of the bodies, a fraction.
        states: number of written elements with a state.
    """

    given: JointModel
    spec: mujoco.MjSpec
    before: mujoco.MjModel
    inertia: float
    weight: float = 1.0
    states: int = 0

    @property
    def joint(self) -> mujoco.MjsJoint:
        """The recorded joint."""
        return self.spec.joint(self.given.joint)


class Element(Protocol):
    """A part of a law that can be written into a model."""

    def write(self, into: Into) -> Into:
        """Write the element."""

    def begin(self, into: Into, key: mujoco.MjsKey, start: Start) -> None:
        """Begin the element's state at the start of a run in a key frame."""


def patched(
    model: JointModel, elements: Sequence[Element], starts: Sequence[Start] = ()
) -> tuple[mujoco.MjSpec, tuple[WrittenAttribute, ...]]:
    """The model with a law written into it, the starts of its runs as keyframes, and the written attributes."""
    spec = model.spec()
    before = spec.compile()
    into = Into(model, spec, before, model.law.inertia)
    into.joint.springdamper = (0.0, 0.0)  # stiffness and damping are written explicitly
    for element in elements:
        into = element.write(into)
    for start in starts:
        name = f"{start.run} at {start.time:.6g} s"
        if (known := spec.key(name)) is not None:
            spec.delete(known)
        key = spec.add_key(name=name, qpos=[model.law.rest + start.angle], qvel=[start.rate])
        for element in elements:
            element.begin(into, key, start)
    with _refusals(model):
        after = spec.compile()
    old, new = _attributes(before), _attributes(after)
    spring = any(new["joint stiffness", "N m/rad, /rad2, /rad3"])
    return spec, tuple(
        WrittenAttribute(name, was, value, unit)
        for (name, unit), value in new.items()
        # an added actuator has no values before
        if not np.allclose(value, was := old.get((name, unit), (0.0,) * len(value)), rtol=1e-9, atol=0.0)
        and (spring or name != "joint springref")
    )


def history_of(delay: float, timestep: float) -> int:
    """The samples of a delayed control that an actuator keeps.

    Args:
        delay, timestep: delay and time step, s.
    """
    return math.ceil(delay / timestep) + _SPARE


def _refusals(model: JointModel) -> AbstractContextManager[None]:
    return engine_refusals("MuJoCo refuses the patched model", "simplify the model", shown(model.path))


def patched_xml(spec: mujoco.MjSpec, model: JointModel, folder: Path) -> str:
    """The MJCF of a model from `patched`; its meshes have paths from ``folder``."""
    for name in ("meshdir", "texturedir") if spec.meshes or spec.textures or spec.hfields else ():
        assets = model.path.parent.resolve() / getattr(spec.compiler, name)
        setattr(spec.compiler, name, os.path.relpath(assets, folder.resolve()))
    with _refusals(model):
        return str(spec.to_xml())


def inertia_of_steps(model: mujoco.MjModel, damping: float) -> float:
    """Apparent additional inertia of a joint due to simulation in steps, kg m².

    A first-order integrator with steps h uses the moment of a damper C at the step's end or start instead of its
    middle: this adds C h/2 to the inertia, or subtracts it.

    Args:
        damping: damping of the joint, added to the model's, N m s/rad.
    """
    options, kinds = model.opt, mujoco.mjtIntegrator
    damping = float(model.dof_damping[0]) + damping
    if options.integrator == int(kinds.mjINT_RK4):
        return 0.0
    affine = model.actuator_biastype == int(mujoco.mjtBias.mjBIAS_AFFINE)
    servos = -float(np.sum(model.actuator_gear[affine, 0] ** 2 * model.actuator_biasprm[affine, 2]))
    explicit = options.integrator == int(kinds.mjINT_EULER)
    late = not explicit or not options.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    ends = (damping if late else -damping) + (-servos if explicit else servos)
    return 0.5 * float(options.timestep) * ends


def creep_rate(model: mujoco.MjModel, rest: float) -> float:
    """The rate up to which ``frictionloss`` acts as a damper, computed by the engine at rest, rad/s.

    Args:
        model: model with a ``frictionloss`` in its joint.
        rest: position of the joint at which no other moment acts, rad.

    Returns:
        0 if another moment at rest exceeds the friction, so that the engine shows no such rate.
    """
    data, forces = mujoco.MjData(model), []
    for rate in (0.0, _SLOW):
        data.qpos[0], data.qvel[0] = rest, rate
        mujoco.mj_forward(model, data)
        forces.append(float(data.qfrc_constraint[0]))
    rise = forces[0] - forces[1]
    return float(model.dof_frictionloss[0]) * _SLOW / rise if rise > 0.0 else 0.0


def _attributes(model: mujoco.MjModel) -> dict[tuple[str, str], tuple[float, ...]]:
    """The attributes of a model that may be written, by name and unit."""
    moving = [i for i in range(model.nbody) if model.body_weldid[i]]
    spring = model.jnt_stiffness[0], *model.jnt_stiffnesspoly[0]
    damping = model.dof_damping[0], *model.dof_dampingpoly[0]
    affine = model.actuator_biastype == int(mujoco.mjtBias.mjBIAS_AFFINE)
    constant = np.sum(model.actuator_gear[affine, 0] * model.actuator_biasprm[affine, 0])
    rubs = model.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_DCMOTOR)
    attributes = {
        ("joint armature", "kg m2"): [model.dof_armature[0]],
        ("joint stiffness", "N m/rad, /rad2, /rad3"): spring,
        ("joint springref", "rad"): [model.qpos_spring[0]],
        ("joint damping", "N m s/rad, s2/rad2, s3/rad3"): damping,
        ("joint frictionloss", "N m"): [model.dof_frictionloss[0]],
        ("dcmotor lugre friction", "N m"): [np.sum(model.actuator_biasprm[rubs, 3])],
        ("dcmotor lugre stiffness", "N m/rad"): [np.sum(model.actuator_dynprm[rubs, 5])],
        ("actuator moment without control", "N m"): [constant],
        **{
            (f"actuator {model.actuator(i).name or i + 1} {name}", unit): values
            for i in range(model.nu)
            for name, unit, values in (
                ("gain", "1", [model.actuator_gainprm[i, 0]]),
                ("ctrlrange", "1", model.actuator_ctrlrange[i] * model.actuator_ctrllimited[i]),
                ("time constant", "s", [model.actuator_dynprm[i, 0] * _filters(model, i)]),
                ("delay", "s", [model.actuator_delay[i]]),
            )
        },
        **{(f"body {model.body(i).name or i} mass", "kg"): [model.body_mass[i]] for i in moving},
        ("sensor noise", "rad"): [np.max(model.sensor_noise, initial=0.0)],
        ("plugin vwt.yaw_moment", "1"): [model.nplugin],
    }
    return {name: tuple(map(float, values)) for name, values in attributes.items()}


def _filters(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator follows its control with a lag."""
    return int(model.actuator_dyntype[actuator]) == int(mujoco.mjtDyn.mjDYN_FILTEREXACT)


def simulate_joint(
    model: mujoco.MjModel, law_rest: float, start: Start, duration: float, actuator: int | None = None
) -> Motion:
    """Simulate one run of a patched model, by displacement from rest, with the model's own integrator and steps.

    In every step the input has its mean over the step. Higher-order integrators read a delayed control between
    steps: they use the means around the steps' starts.

    Args:
        law_rest: the joint's position at rest, rad.
        duration: duration, s.
        actuator: the actuator with the input as its control; None: the input is a moment on the joint
            (``qfrc_applied``).
    """
    steps = duration / model.opt.timestep
    remedy = "lengthen the model's timestep"
    check_count(steps, limits.RUN_SAMPLES, "steps", f"run {start.run}", remedy)
    count = math.ceil(steps) + 1
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = law_rest + start.angle, start.rate
    angle, rate, given = np.empty(count), np.empty(count), np.zeros(count)
    if start.drive is not None:
        delayed = actuator is not None and model.actuator_delay[actuator] > 0.0
        staged = delayed and int(model.opt.integrator) == int(mujoco.mjtIntegrator.mjINT_RK4)
        given = start.drive.means(model.opt.timestep * (np.arange(count + 1) - 0.5 * staged))
        given = given * start.drive.scale if actuator is None else given
        if actuator is not None:
            _begin(model, data, actuator, float(given[0]))
    pushed, at = (data.qfrc_applied, 0) if actuator is None else (data.ctrl, model.actuator_ctrladr[actuator])
    with no_log():
        for i in range(count):
            angle[i], rate[i], pushed[at] = data.qpos[0], data.qvel[0], given[i]
            mujoco.mj_step(model, data)
    if data.time < 0.5 * count * model.opt.timestep:  # the engine has reset a diverging motion
        what = "the patched model's motion grows without bound"
        raise TunnelError(what, where=f"run {start.run}", remedy="shorten its timestep")
    return Motion(np.arange(count) * model.opt.timestep, angle - law_rest, rate)


def _begin(model: mujoco.MjModel, data: mujoco.MjData, actuator: int, control: float) -> None:
    """Start an actuator as if its control had been constant for long."""
    low, high = model.actuator_ctrlrange[actuator]
    if _filters(model, actuator):
        held = min(max(control, low), high) if model.actuator_ctrllimited[actuator] else control
        data.act[model.actuator_actadr[actuator]] = held
    if model.actuator_delay[actuator] > 0.0:
        samples = int(model.actuator_history[actuator, 0])
        times = model.opt.timestep * (np.arange(samples) - float(samples))
        mujoco.mj_initCtrlHistory(model, data, actuator, times, np.full((samples, 1), control))
