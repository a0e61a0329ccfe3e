"""The native elements of MuJoCo for writing a law: each is fitted, written, and states how it differs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self, TypeVar

import mujoco
import numpy as np

from diagnosis.model.fact import Fact
from diagnosis.patch.fitted_law import FittedLaw
from diagnosis.patch.native_moments import operation
from tunnel_sim.effects.capabilities import InputClock
from tunnel_sim.effects.drives import ActuatorEffect
from tunnel_sim.engine.joint_patch import Into, Start, creep_rate, history_of
from tunnel_sim.vocabulary.errors import TunnelError

# required by the plugin
_AIR = ("air_density", "wind_speed", "frontal_area", "reference_length", "cn_beta", "cn_r")
_PLUGIN = "vwt.yaw_moment"
_NO_MOTOR = 1e-9  # N m/A: torque constant of a motor that is only a friction; MuJoCo requires more than 0
_STIFF_STEPS = 2.0  # time constant of frictionloss in steps: the shortest that MuJoCo accepts


class NativeElement:
    """An element of MuJoCo with its values in SI units."""

    @classmethod
    def fit(cls, law: FittedLaw) -> Self | None:
        """The element for a law; None if the law does not need it."""
        raise NotImplementedError

    def write(self, into: Into) -> Into:
        """Write the element into a model, after the elements before it in `ELEMENTS`."""
        raise NotImplementedError

    def begin(self, into: Into, key: mujoco.MjsKey, start: Start) -> None:
        """Write the element's state at the start of a run into a key frame."""

    def limits(self, model: mujoco.MjModel, rest: float, *, slide: bool) -> tuple[Fact, ...]:
        """Differences between the element in the engine and the law.

        Args:
            model: the patched model, compiled.
            rest: position of the joint at its rest, rad.
        """
        del model, rest, slide
        return ()


@dataclass(frozen=True)
class Inertia(NativeElement):
    """The whole inertia about the joint.

    Args:
        inertia: kg m².
    """

    inertia: float

    @classmethod
    def fit(cls, law: FittedLaw) -> Self:
        """The inertia, less the part that the engine's steps cause."""
        found = law.own(law.physics.yaw_inertia, "kg m2")
        if law.steps is None:
            return cls(found)
        return cls(found - law.steps(law.own(float(law.moments.damping[0]), "N m s/rad")))

    def write(self, into: Into) -> Into:
        """Added inertia as armature; reduced inertia as a smaller armature, or as bodies moved towards the axis.

        Bodies with a times the mass at 1/a times the distance from the axis have the same moment of gravity and
        1/a times the inertia. On a slide they lose mass instead; the remaining share of the weight is
        `Into.weight`.
        """
        spec, before, law = into.spec, into.before, into.given.law
        written = replace(into, inertia=self.inertia)
        rotors = float(
            np.sum(before.actuator_gear[:, 0] ** 2 * before.actuator_armature)
        )  # the bodies are unchanged
        armature = float(before.dof_armature[0]) + self.inertia - law.inertia
        into.joint.armature = max(armature, 0.0)
        if armature >= 0.0:
            return written
        share = (self.inertia - rotors) / (law.inertia - float(before.dof_armature[0]) - rotors)
        if not share > 0.0:
            what = f"the inertia found, {self.inertia:.4g} kg m2, is less than the rotors' inertia of the actuators"
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
            across = (centre - along) * (1.0 if law.slide else share)
            moved = anchor + along + across - data.xpos[number]
            body.explicitinertial = True
            body.mass = float(before.body_mass[number]) * (share if law.slide else 1.0 / share)
            body.inertia = before.body_inertia[number] * share
            body.ipos = data.xmat[number].reshape(3, 3).T @ moved
            body.iquat = before.body_iquat[number]
            body.fullinertia = np.full(6, np.nan)
        return replace(written, weight=share if law.slide else 1.0)


@dataclass(frozen=True)
class Spring(NativeElement):
    """A restoring moment added to the model's.

    Args:
        added: coefficients of 1, b, b² and b³ of the displacement b from rest, N m, N m/rad, N m/rad² and N m/rad³.
    """

    added: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    units: ClassVar = ("N m", "N m/rad", "N m/rad2", "N m/rad3")

    @classmethod
    def fit(cls, law: FittedLaw) -> Self:
        """The added stiffness, constant moment, and polynomials of angle."""
        k0, k1, k2, k3 = (law.own(float(v), u) for v, u in zip(law.moments.spring, cls.units, strict=True))
        return cls((k0, k1, k2, k3))

    def write(self, into: Into) -> Into:
        """The sum of the joint's own spring and the added one, about the position at which the sum vanishes."""
        spec, before, given = into.spec, into.before, into.given
        spring = np.polynomial.Polynomial([0.0, before.jnt_stiffness[0], *before.jnt_stiffnesspoly[0]])
        offset = given.law.rest - float(before.qpos_spring[0])
        total = spring(np.polynomial.Polynomial([offset, 1.0])) + np.polynomial.Polynomial(self.added)
        total -= (1.0 - into.weight) * spring(offset)  # the spring carries the weight
        total = total.trim(1e-12 * float(np.max(np.abs(total.coef))))
        if not total.degree():
            self._write_bias(into, -float(total.coef[0]))
            return into
        roots = total.roots()
        real = roots.real[np.abs(roots.imag) < 1e-6]
        if real.size == 0:
            remedy = "add a spring to the joint"
            raise TunnelError("the patched model would have no rest position", remedy=remedy)
        usual = -offset if np.any(spring.coef) else 0.0
        zero = float(real[np.argmin(np.abs(real - usual))])
        about = total(np.polynomial.Polynomial([zero, 1.0])).coef
        into.joint.stiffness = np.array([*about[1:], 0.0, 0.0, 0.0])[:3]
        place = given.law.rest + zero
        into.joint.springref = math.degrees(place) if spec.compiler.degree and not given.law.slide else place
        return into

    @staticmethod
    def _write_bias(into: Into, moment: float) -> None:
        """A constant moment as the bias of the actuator that drives the joint, or of an added actuator."""
        own, name = into.given.law.actuator, into.given.joint
        if moment == 0.0:
            return
        if own is None:
            kind = mujoco.mjtTrn.mjTRN_JOINT
            actuator = into.spec.add_actuator(name=f"{name}_moment", trntype=kind, target=name)
            actuator.gainprm[0] = 0.0
        else:
            actuator = into.spec.actuators[own.index]
        if actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
            actuator.biastype, actuator.biasprm[:] = mujoco.mjtBias.mjBIAS_AFFINE, 0.0
        actuator.biasprm[0] += moment / actuator.gear[0]


@dataclass(frozen=True)
class Damper(NativeElement):
    """Damping added to the joint's.

    Args:
        added: coefficients of ḃ, |ḃ|ḃ and ḃ³, N m s/rad, N m s²/rad² and N m s³/rad³.
    """

    added: tuple[float, float, float] = (0.0, 0.0, 0.0)

    units: ClassVar = ("N m s/rad", "N m s2/rad2", "N m s3/rad3")

    @classmethod
    def fit(cls, law: FittedLaw) -> Self:
        """The added damping, and polynomials of the rate."""
        c0, c1, c2 = (law.own(float(v), u) for v, u in zip(law.moments.damping, cls.units, strict=True))
        return cls((c0, c1, c2))

    def write(self, into: Into) -> Into:
        """The damping of the joint: the sum of its own and the added damping."""
        before, joint = into.before, into.joint
        joint.damping = np.array([before.dof_damping[0], *before.dof_dampingpoly[0]]) + self.added
        joint.damping[0] = max(joint.damping[0], 0.0)  # a sum that should be 0, rounded below it
        return into


@dataclass(frozen=True)
class DryFriction(NativeElement):
    """The whole dry friction of the joint.

    Args:
        moment: friction moment; for the plugin's own friction its greatest value, N m.
        presliding: deflection at which its contact slides, rad; 0: none.
        own: numerics of the plugin's own friction, by name, N m and rad/s; empty: MuJoCo's friction.
    """

    moment: float
    presliding: float = 0.0
    own: tuple[tuple[str, float], ...] = ()

    @classmethod
    def fit(cls, law: FittedLaw) -> Self:
        """The friction and its range; angles are positions of the joint."""
        moments, numerics = law.moments, dict[str, float]()
        for name, size, unit in moments.contact:
            numerics[name] = law.own(size, unit) + (law.rest if name == "load_angle" else 0.0)
        if power := numerics.get("friction_exponent"):  # rates in the campaign's own time
            numerics["friction_moment"] *= law.own(1.0, "rad/s") ** -power
        return cls(law.own(moments.loss, "N m"), law.own(moments.presliding, "rad"), tuple(numerics.items()))

    def write(self, into: Into) -> Into:
        """Friction as ``frictionloss``; with presliding as a motor without a control; or as the plugin's friction.

        MuJoCo has LuGre's friction in motors only. Without contact damping and a rise near rest it is Dahl's
        friction. The deflection has a lower limit, which keeps the oscillation of the contact stable with the
        model's steps.
        """
        joint, step = into.joint, into.spec.option.timestep
        rigid = self.presliding == 0.0 and not self.own
        joint.frictionloss = self.moment if rigid else 0.0
        if joint.frictionloss != into.before.dof_frictionloss[0]:
            joint.solref_friction = (_STIFF_STEPS * step, 1.0)
        least = self.moment * step**2 / (2.0 * into.inertia)
        presliding = max(self.presliding, least) if self.presliding else 0.0
        if self.own:
            return with_plugin(into, {**dict(self.own), "presliding": presliding})
        if rigid or self.moment == 0.0:
            return into
        actuator, name = into.spec.add_actuator(), into.given.joint
        actuator.name = f"{name}_friction"
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, name
        actuator.set_to_dcmotor(
            motorconst=(_NO_MOTOR, _NO_MOTOR), resistance=1.0, ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
            lugre=(self.moment / presliding, 0.0, self.moment, self.moment, 1.0),
        )  # fmt: skip
        return replace(into, states=into.states + 1)

    def limits(self, model: mujoco.MjModel, rest: float, *, slide: bool) -> tuple[Fact, ...]:
        """The rate up to which ``frictionloss`` acts as a damper."""
        soft = self.moment > 0.0 and self.presliding == 0.0 and not self.own
        creep = creep_rate(model, rest) if soft else 0.0
        return (
            (Fact("soft friction", {"below_per_s": creep, "unit": "m" if slide else "rad"}),)
            if creep > 0.0
            else ()
        )


@dataclass(frozen=True)
class Control(NativeElement):
    """Elements between the control of an actuator and its moment.

    MuJoCo delays the control, clips it and then filters it. The range of the control clips it before the
    filter, and does not include the bias of a servo; ``forcerange`` would clip after the filter, with the bias.

    Args:
        limit: greatest control, in its own unit; 0: the model's own range.
        lag: time constant of the actuator's filter, s; 0: none.
        delay: delay of the control, s; 0: none.
    """

    index: int
    limit: float = 0.0
    lag: float = 0.0
    delay: float = 0.0

    @classmethod
    def fit(cls, law: FittedLaw) -> Self | None:
        """The limits; None if there are none, or MuJoCo has no element for one of them.

        MuJoCo has no element for a rate limit, which acts between the other two, for a soft limit, or for an
        input that acts earlier than stated.
        """
        actuator = law.law.actuator
        if actuator is None or law.controlled is None:
            return None
        release, index = law.controlled
        chain = law.problem.chain(law.common, release, law.problem.data.runs[index])
        stated, found = chain.stated.drive, chain.physics().drive
        assert stated is not None
        assert found is not None
        made, delay = found.actuator, found.delay - stated.delay
        plain = made == stated.actuator and delay == 0.0
        if made.rate > 0.0 or made.softness > 0.0 or delay < 0.0 or plain:
            return None
        limit = law.own(made.limit, "N m") / abs(actuator.gain)
        return cls(actuator.index, limit, law.own(made.lag, "s"), law.own(delay, "s"))

    def write(self, into: Into) -> Into:
        """The limit of a control as its range, a lag as a filter, and a delay as a history of the control."""
        spec, index = into.spec, self.index
        actuator = spec.actuators[index]
        if self.limit > 0.0:
            limited = spec.compile().actuator_ctrllimited[index]
            low, high = actuator.ctrlrange if limited else (-np.inf, np.inf)
            actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
            actuator.ctrlrange = np.array([max(low, -self.limit), min(high, self.limit)])
        if self.lag > 0.0:
            actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            actuator.dynprm[0] = self.lag
        if self.delay > 0.0:
            actuator.delay = self.delay
            actuator.nsample = history_of(self.delay, spec.option.timestep)
            actuator.interp = 1
        return replace(into, states=into.states + (self.lag > 0.0))

    def begin(self, into: Into, key: mujoco.MjsKey, start: Start) -> None:
        """The first control; no key frame holds the history of a delayed control: `limits` says how to fill it."""
        if start.drive is None:
            return
        first = float(start.drive.values[0])
        key.ctrl = [first if i == self.index else 0.0 for i in range(into.before.nu)]
        if self.lag > 0.0:
            key.act = [first, *[0.0] * (into.states - 1)]

    def limits(self, model: mujoco.MjModel, rest: float, *, slide: bool) -> tuple[Fact, ...]:
        """The history of a delayed control."""
        del rest, slide
        samples = history_of(self.delay, model.opt.timestep)
        return (Fact("delayed control", {"index": self.index, "samples": samples}),) if self.delay else ()


@dataclass(frozen=True)
class ServoGain(NativeElement):
    """The gain of the position servo that drives the joint.

    Args:
        kp: N m/rad.
    """

    kp: float

    @classmethod
    def fit(cls, law: FittedLaw) -> Self | None:
        """The kp, if it is fitted."""
        kp = law.fitted.get("servo_kp")
        return None if kp is None else cls(law.own(kp, "N m/rad"))

    def write(self, into: Into) -> Into:
        """Gain and bias of the servo's actuator."""
        if (own := into.given.law.actuator) is not None:
            servo, share = into.spec.actuators[own.index], -self.kp / own.servo[1]
            servo.gainprm[0] *= share
            servo.biasprm[1] *= share
        return into


def with_plugin(into: Into, numerics: Mapping[str, float | Sequence[float]]) -> Into:
    """The plugin with further numerics."""
    spec = into.spec
    if all(one.plugin_name != _PLUGIN for one in spec.plugins):
        plugin = spec.add_plugin(name="tunnel", plugin_name=_PLUGIN, active=True)
        plugin.config = {"joint": into.given.joint}
        spec.activate_plugin(_PLUGIN)
        numerics = {**dict.fromkeys(_AIR, 0.0), **numerics}
    for name, value in numerics.items():
        data = np.ravel(value).tolist()
        spec.add_numeric(name=name, data=data, size=len(data))
    return into


@dataclass(frozen=True)
class PluginMoment(NativeElement):
    """A moment of the plugin that MuJoCo's own elements do not have.

    Args:
        program: program of the moment (``mjcf/plugin/expression.h``), in the joint's position.
    """

    program: tuple[float, ...]

    @classmethod
    def fit(cls, law: FittedLaw) -> Self | None:
        """The program in terms of the model's joint: its position, rate, time and moment."""
        if not law.moments.program:
            return None
        value, times = operation("number"), operation("multiply")
        replaced = {
            operation("angle"): (value, law.rest, operation("subtract")),
            operation("rate"): (value, 1.0 / law.own(1.0, "rad/s"), times),
            operation("time"): (value, 1.0 / law.own(1.0, "s"), times),
        }
        code: list[float] = []
        given = iter(law.moments.program)
        for one in given:
            code.append(one)
            if one == value:
                code.append(next(given))
            code += replaced.get(one, ())
        return cls((*code, value, law.own(1.0, "N m"), times))

    def write(self, into: Into) -> Into:
        """The plugin with the program."""
        return with_plugin(into, {"moment_program": self.program})


@dataclass(frozen=True)
class SensorNoise(NativeElement):
    """Noise on the joint's position sensor; the sensor is added if missing.

    Args:
        std: rad.
    """

    std: float

    @classmethod
    def fit(cls, law: FittedLaw) -> Self | None:
        """The noise of the sensor."""
        return cls(law.noise) if law.noise != 0.0 else None

    def write(self, into: Into) -> Into:
        """The attribute of the sensor."""
        name, kind = into.given.joint, mujoco.mjtSensor.mjSENS_JOINTPOS
        own = (one for one in into.spec.sensors if one.type == kind and one.objname == name)
        if (sensor := next(own, None)) is None:
            on_joint = mujoco.mjtObj.mjOBJ_JOINT
            sensor = into.spec.add_sensor(name=f"{name}_reading", type=kind, objtype=on_joint, objname=name)
        sensor.noise = self.std
        return into


ELEMENTS: tuple[type[NativeElement], ...] = (
    Inertia, Spring, Damper, DryFriction, Control, ServoGain, PluginMoment, SensorNoise,
)  # fmt: skip
"""In the order of writing: the spring carries the weight that the inertia leaves."""

Element = TypeVar("Element", bound=NativeElement)


@dataclass(frozen=True)
class FoundLaw:
    """The law found for a joint, in the units of the given model.

    Args:
        differences: differences between a native element and the law, and causes left out.
    """

    elements: tuple[NativeElement, ...]
    differences: tuple[Fact, ...]

    @classmethod
    def of(cls, law: FittedLaw) -> FoundLaw:
        """The elements of a law."""
        fitted = (kind.fit(law) for kind in ELEMENTS)
        elements = tuple(one for one in fitted if one is not None)
        return cls(elements, (*law.moments.differences, *_unwritten(law, elements)))

    def element(self, kind: type[Element]) -> Element | None:
        """The element of a kind; None if the law has none."""
        return next((one for one in self.elements if isinstance(one, kind)), None)

    @property
    def by_plugin(self) -> bool:
        """Whether the law needs the plugin beside MuJoCo's own elements."""
        friction = self.element(DryFriction)
        return self.element(PluginMoment) is not None or (friction is not None and bool(friction.own))


def _unwritten(law: FittedLaw, elements: Sequence[NativeElement]) -> tuple[Fact, ...]:
    """The causes for which there is no element."""
    effects, by_control = law.problem.effects, any(isinstance(one, Control) for one in elements)
    left_out = {
        "rod": law.physics.rod_twist is not None,
        "delayed input": not by_control and any(issubclass(kind, InputClock) for kind in effects),
        "actuator": not by_control and any(issubclass(kind, ActuatorEffect) for kind in effects),
        "air": law.problem.data.wind_on,
    }
    found = tuple(Fact(kind) for kind, left in left_out.items() if left)
    sensors = [kind.name for kind in effects if kind.channel == "sensor"]
    return (*found, Fact("sensor", {"effects": sensors})) if sensors else found
