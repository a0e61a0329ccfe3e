"""Writing a joint's law into a user's model, as native elements and, where these do not suffice, the plugin."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.engine.model_files import engine_refusals
from tunnel_sim.engine.simulate import no_log
from tunnel_sim.files.reading import check_count
from tunnel_sim.physics.drive import DriveMoment
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, shown
from tunnel_sim.vocabulary.rig import WrittenAttribute

# the plugin wants them
_AIR = ("air_density", "wind_speed", "frontal_area", "reference_length", "cn_beta", "cn_r")
_SPARE = 2  # samples of a delayed control beyond the delay: both neighbours of a time between samples
_SLOW = 1e-9  # rad/s: slower than any creep
_NO_MOTOR = 1e-9  # N m/A: of a motor that is a friction alone; MuJoCo wants more than 0
_STIFF_STEPS = 2.0  # time constant of frictionloss in steps: the shortest that MuJoCo accepts


@dataclass(frozen=True)
class ActuatorPatch:
    """Elements between the control of an actuator and its moment.

    MuJoCo delays the control, clips it and then filters it. The range of the control clips it before the filter,
    and excludes the bias of a servo; ``forcerange`` would do neither.

    Args:
        limit: greatest control, in its own unit; 0: the model's own range.
        lag: time constant of its filter, s; 0: none.
        delay: of the control, s; 0: none.
    """

    index: int
    limit: float = 0.0
    lag: float = 0.0
    delay: float = 0.0


@dataclass(frozen=True)
class JointPatch:
    """The law to write, in SI units; moments are of the displacement b from rest and its rate.

    Args:
        inertia: the whole inertia about the joint, kg m².
        spring: added restoring moment, the coefficients of 1, b, b² and b³, N m, N m/rad, N m/rad² and N m/rad³.
        damping: added damping, the coefficients of ḃ, |ḃ|ḃ and ḃ³, N m s/rad, N m s²/rad² and N m s³/rad³.
        friction: the whole moment of dry friction, N m.
        presliding: deflection at which its contact slides, rad; 0: none.
        program: of a further moment, for the plugin (``mjcf/plugin/expression.h``), in the joint's position.
        kp: of the position servo that drives the joint, N m/rad; None: as in the model.
        contact: numerics of the plugin's own friction, by name, N m and rad; empty: ``friction`` is all.
        noise: standard deviation of the sensor's noise, rad; 0: not written.
    """

    inertia: float
    spring: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    damping: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float = 0.0
    presliding: float = 0.0
    program: tuple[float, ...] = ()
    contact: tuple[tuple[str, float], ...] = ()
    actuator: ActuatorPatch | None = None
    kp: float | None = None
    noise: float = 0.0

    @property
    def by_plugin(self) -> bool:
        """Whether MuJoCo's own elements do not suffice."""
        return bool(self.program or self.contact)


@dataclass(frozen=True)
class Start:
    """The start of a run.

    Args:
        time: since the start of the record, s.
        angle, rate: displacement from rest, rad, and its rate, rad/s.
        drive: its drive from then on; None: a free decay.
    """

    run: str
    time: float
    angle: float
    rate: float
    drive: DriveMoment | None = None


def patched(
    model: JointModel, patch: JointPatch, starts: Sequence[Start] = ()
) -> tuple[mujoco.MjSpec, tuple[WrittenAttribute, ...]]:
    """The model with a law written into it, its runs' starts as keyframes, and the written attributes."""
    spec = model.spec()
    before = spec.compile()
    joint = spec.joint(model.joint)
    joint.springdamper = (0.0, 0.0)  # stiffness and damping are written explicitly
    weight = _write_inertia(spec, before, model, patch)
    _write_spring(spec, before, model, patch, weight)
    joint.damping = np.array([before.dof_damping[0], *before.dof_dampingpoly[0]]) + patch.damping
    joint.damping[0] = max(joint.damping[0], 0.0)  # a damping fitted as 0 less the model's own, rounded
    _write_friction(spec, before, model, patch)
    if patch.actuator is not None:
        _write_actuator(spec, patch.actuator)
    if patch.kp is not None and model.law.actuator is not None:
        servo, share = spec.actuators[model.law.actuator.index], -patch.kp / model.law.actuator.servo[1]
        servo.gainprm[0] *= share
        servo.biasprm[1] *= share
    if patch.by_plugin:
        if model.law.slide:
            raise TunnelError("the plugin acts on hinges only", remedy="leave out --patch")
        plugin = spec.add_plugin(name="tunnel", plugin_name="vwt.yaw_moment", active=True)
        plugin.config = {"joint": model.joint}
        spec.activate_plugin("vwt.yaw_moment")
        for name in _AIR:
            spec.add_numeric(name=name, data=[0.0], size=1)
        for name, value in patch.contact:
            spec.add_numeric(name=name, data=[value], size=1)
        if patch.program:
            spec.add_numeric(name="moment_program", data=list(patch.program), size=len(patch.program))
    if patch.noise != 0.0:  # on the joint's position sensor, which is added if missing
        kind = mujoco.mjtSensor.mjSENS_JOINTPOS
        own = (one for one in spec.sensors if one.type == kind and one.objname == model.joint)
        if (sensor := next(own, None)) is None:
            joint_type = mujoco.mjtObj.mjOBJ_JOINT
            sensor = spec.add_sensor(
                name=f"{model.joint}_reading", type=kind, objtype=joint_type, objname=model.joint
            )
        sensor.noise = patch.noise
    for start in starts:
        name = f"{start.run} at {start.time:.6g} s"
        if (known := spec.key(name)) is not None:
            spec.delete(known)
        key = spec.add_key(name=name, qpos=[model.law.rest + start.angle], qvel=[start.rate])
        if patch.actuator is not None and start.drive is not None:
            first = float(start.drive.values[0])
            # no key frame holds the history of a delayed control: the note on it takes this control
            key.ctrl = [first if i == patch.actuator.index else 0.0 for i in range(before.nu)]
            if patch.actuator.lag > 0.0:
                key.act = [first, *([0.0] if patch.presliding > 0.0 else [])]
    with _refusals(model):
        after = spec.compile()
    old, new = _attributes(before), _attributes(after)
    spring = any(new["joint stiffness", "N m/rad, /rad2, /rad3"])
    return spec, tuple(
        WrittenAttribute(name, before, value, unit)
        for (name, unit), value in new.items()
        # an added actuator has no values before
        if not np.allclose(value, before := old.get((name, unit), (0.0,) * len(value)), rtol=1e-9, atol=0.0)
        and (spring or name != "joint springref")
    )


def _write_friction(
    spec: mujoco.MjSpec, before: mujoco.MjModel, model: JointModel, patch: JointPatch
) -> None:
    """Friction as ``frictionloss``, or with presliding as that of a motor without a control.

    MuJoCo has LuGre's friction in motors alone. Without a damping of its own and a rise near rest it is Dahl's. The
    deflection is limited from below so that the oscillation of the contact is stable with the model's steps.
    """
    joint, friction = spec.joint(model.joint), patch.friction
    joint.frictionloss = friction if patch.presliding == 0.0 else 0.0
    if joint.frictionloss != before.dof_frictionloss[0]:
        joint.solref_friction = (_STIFF_STEPS * spec.option.timestep, 1.0)
    if patch.presliding == 0.0 or friction == 0.0:
        return
    actuator = spec.add_actuator()
    actuator.name = f"{model.joint}_friction"
    actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, model.joint
    least = friction * spec.option.timestep**2 / (2.0 * patch.inertia)
    stiffness = friction / max(patch.presliding, least)
    actuator.set_to_dcmotor(
        motorconst=(_NO_MOTOR, _NO_MOTOR), resistance=1.0, lugre=(stiffness, 0.0, friction, friction, 1.0),
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
    )  # fmt: skip


def _write_actuator(spec: mujoco.MjSpec, patch: ActuatorPatch) -> None:
    """The limit of a control as its range, a lag as a filter, and a delay as a history of the control."""
    actuator = spec.actuators[patch.index]
    if patch.limit > 0.0:
        low, high = (
            actuator.ctrlrange if spec.compile().actuator_ctrllimited[patch.index] else (-np.inf, np.inf)
        )
        actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.ctrlrange = np.array([max(low, -patch.limit), min(high, patch.limit)])
    if patch.lag > 0.0:
        actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
        actuator.dynprm[0] = patch.lag
    if patch.delay > 0.0:
        actuator.delay = patch.delay
        actuator.nsample = history_of(patch.delay, spec.option.timestep)
        actuator.interp = 1


def history_of(delay: float, timestep: float) -> int:
    """The samples of a delayed control that an actuator keeps.

    Args:
        delay, timestep: s.
    """
    return math.ceil(delay / timestep) + _SPARE


def _refusals(model: JointModel) -> AbstractContextManager[None]:
    return engine_refusals("MuJoCo refuses the patched model", "simplify the model", shown(model.path))


def patched_xml(spec: mujoco.MjSpec, model: JointModel, folder: Path) -> str:
    """The MJCF of a model from `patched`, with paths of its meshes from ``folder``."""
    for name in ("meshdir", "texturedir") if spec.meshes or spec.textures or spec.hfields else ():
        assets = model.path.parent.resolve() / getattr(spec.compiler, name)
        setattr(spec.compiler, name, os.path.relpath(assets, folder.resolve()))
    with _refusals(model):
        return str(spec.to_xml())


def _write_inertia(
    spec: mujoco.MjSpec, before: mujoco.MjModel, model: JointModel, patch: JointPatch
) -> float:
    """Added inertia as armature; reduced inertia as a smaller armature, or as bodies drawn in towards the axis.

    Bodies of a times the mass at 1/a times the distance from the axis have the same moment of gravity and 1/a times
    the inertia. On a slide they lose mass instead; the result is the share of the weight that remains.
    """
    rotors = float(np.sum(before.actuator_gear[:, 0] ** 2 * before.actuator_armature))  # they are unchanged
    armature = float(before.dof_armature[0]) + patch.inertia - model.law.inertia
    if armature >= 0.0:
        spec.joint(model.joint).armature = armature
        return 1.0
    spec.joint(model.joint).armature = 0.0
    share = (patch.inertia - rotors) / (model.law.inertia - float(before.dof_armature[0]) - rotors)
    if not share > 0.0:
        what = f"the inertia found, {patch.inertia:.4g} kg m2, is less than that of the actuators' rotors"
        raise TunnelError(what, remedy="correct the armature of the actuators")
    data = mujoco.MjData(before)
    mujoco.mj_forward(before, data)
    axis, anchor = data.xaxis[0], data.xanchor[0]
    for body in spec.bodies:
        number = body.id
        if before.body_weldid[number] == 0 or before.body_mass[number] == 0.0:
            continue
        centre = data.xipos[number] - anchor
        along = axis * float(axis @ centre)
        across = (centre - along) * (1.0 if model.law.slide else share)
        moved = anchor + along + across - data.xpos[number]
        body.explicitinertial = True
        body.mass = float(before.body_mass[number]) * (share if model.law.slide else 1.0 / share)
        body.inertia = before.body_inertia[number] * share
        body.ipos = data.xmat[number].reshape(3, 3).T @ moved
        body.iquat = before.body_iquat[number]
        body.fullinertia = np.full(6, np.nan)
    return share if model.law.slide else 1.0


def inertia_of_steps(model: mujoco.MjModel, damping: float) -> float:
    """Apparent additional inertia of a joint due to simulation in steps, kg m².

    A first-order integrator with steps h uses the moment of a damper C at the step's end or start instead of its
    middle: this adds C h/2 to the inertia, or subtracts it.

    Args:
        damping: of the joint itself, N m s/rad; the damping of its actuators is taken from the model.
    """
    options, kinds = model.opt, mujoco.mjtIntegrator
    if options.integrator == int(kinds.mjINT_RK4):
        return 0.0
    affine = model.actuator_biastype == int(mujoco.mjtBias.mjBIAS_AFFINE)
    servos = -float(np.sum(model.actuator_gear[affine, 0] ** 2 * model.actuator_biasprm[affine, 2]))
    explicit = options.integrator == int(kinds.mjINT_EULER)
    late = not explicit or not options.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    ends = (damping if late else -damping) + (-servos if explicit else servos)
    return 0.5 * float(options.timestep) * ends


def creep_rate(model: mujoco.MjModel, rest: float) -> float:
    """The rate up to which ``frictionloss`` yields as a damper, computed by the engine at rest, rad/s.

    Args:
        model: its joint has a ``frictionloss``.
        rest: position of the joint at which no other moment acts, rad.

    Returns:
        0 where another moment at the rest exceeds the friction, so that the engine shows no such rate.
    """
    data, forces = mujoco.MjData(model), []
    for rate in (0.0, _SLOW):
        data.qpos[0], data.qvel[0] = rest, rate
        mujoco.mj_forward(model, data)
        forces.append(float(data.qfrc_constraint[0]))
    rise = forces[0] - forces[1]
    return float(model.dof_frictionloss[0]) * _SLOW / rise if rise > 0.0 else 0.0


def _write_spring(
    spec: mujoco.MjSpec, before: mujoco.MjModel, model: JointModel, patch: JointPatch, weight: float
) -> None:
    """The sum of the joint's own spring and the added one, about the position at which it vanishes."""
    spring = np.polynomial.Polynomial([0.0, before.jnt_stiffness[0], *before.jnt_stiffnesspoly[0]])
    offset = model.law.rest - float(before.qpos_spring[0])
    total = spring(np.polynomial.Polynomial([offset, 1.0])) + np.polynomial.Polynomial(patch.spring)
    total -= (1.0 - weight) * spring(offset)  # the spring carries the weight
    total = total.trim(1e-12 * float(np.max(np.abs(total.coef))))
    if not total.degree():
        moment, own_actuator = -float(total.coef[0]), model.law.actuator
        if moment == 0.0:
            return
        # a constant moment is the bias of the actuator that drives the joint, or of an added one
        if own_actuator is None:
            name, kind = f"{model.joint}_moment", mujoco.mjtTrn.mjTRN_JOINT
            actuator = spec.add_actuator(name=name, trntype=kind, target=model.joint)
            actuator.gainprm[0] = 0.0
        else:
            actuator = spec.actuators[own_actuator.index]
        if actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
            actuator.biastype, actuator.biasprm[:] = mujoco.mjtBias.mjBIAS_AFFINE, 0.0
        actuator.biasprm[0] += moment / actuator.gear[0]
        return
    roots = total.roots()
    real = roots.real[np.abs(roots.imag) < 1e-6]
    if real.size == 0:
        remedy = "add a spring to the joint"
        raise TunnelError("the patched model would have no rest position", remedy=remedy)
    usual = -offset if np.any(spring.coef) else 0.0
    zero = float(real[np.argmin(np.abs(real - usual))])
    about = total(np.polynomial.Polynomial([zero, 1.0])).coef
    joint = spec.joint(model.joint)
    joint.stiffness = np.array([*about[1:], 0.0, 0.0, 0.0])[:3]
    place = model.law.rest + zero
    joint.springref = math.degrees(place) if spec.compiler.degree and not model.law.slide else place


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
    steps: they use its means around the steps' starts.

    Args:
        law_rest: the joint's position at rest, rad.
        duration: s.
        actuator: its control is the input; None: the input is a moment on the joint (``qfrc_applied``).
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
