"""A user's model with one moving joint: the law of this joint, and the actuator that drives it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from tunnel_sim.engine.model import load_plugin
from tunnel_sim.engine.model_files import ModelFiles, engine_refusals, read_model_files
from tunnel_sim.engine.simulate import no_log
from tunnel_sim.sandbox import LimitReached, Message, in_sandbox
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, shown
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import FREE_PARAMETERS, Actuator, JointLaw, Term

_GRID = 361  # number of positions at which the moment is tabulated
# share of the greatest moment: allowed residual of the law's terms, due to the engine's rounding
_EXACT = 1e-8
_PRESENT = 1e-9  # share of the greatest moment: a smaller term is rounding
# rad/s, for an unrestrained joint: the reference for its moments is the inertial moment
_TURN = 2.0 * math.pi
_RATES = np.array([-3.0, -1.0, -0.3, 0.3, 1.0, 3.0])  # multiples of the motion's rate
_MOMENTS = (
    ("b", "N m/rad"),
    ("sin(b)-b", "N m"),
    ("cos(b)-1", "N m"),
    ("b^2", "N m/rad2"),
    ("b^3", "N m/rad3"),
)
_DAMPING = (("r", "N m s/rad"), ("abs(r)*r", "N m s2/rad2"), ("r^3", "N m s3/rad3"))
_TYPES = {int(mujoco.mjtJoint.mjJNT_HINGE): "hinge", int(mujoco.mjtJoint.mjJNT_SLIDE): "slide"}


@dataclass(frozen=True)
class Recorded:
    """Properties of a joint's motion from the records.

    Args:
        reach: greatest displacement from rest, or for driven runs from the middle, rad (m for a slide).
        middle: middle of driven runs, in positions of the joint, rad; None: all runs are free decays.
        controlled: whether the input of a run is the control of an actuator.
        actuator: the name of this actuator; None: the joint has only one.
    """

    reach: float
    middle: float | None = None
    controlled: bool = False
    actuator: str | None = None


@dataclass(frozen=True, eq=False)
class JointModel:
    """A model in which only the recorded joint moves."""

    path: Path
    joint: str
    law: JointLaw
    files: ModelFiles

    def spec(self) -> mujoco.MjSpec:
        """The model's specification, read again, to be changed."""
        return self.files.spec()


def read_joint_model(
    path: Path,
    joint: str,
    recorded: Recorded,
    free: Sequence[str] | None = None,
    asset_dir: Path | None = None,
) -> JointModel:
    """Read a model, and the law of one joint from the engine's moments, in a process with limits.

    The law is exact: gravity and springs give the restoring moment over the whole turn (for a slide, over twice
    the reach).

    Args:
        free: which of `FREE_PARAMETERS` are fitted; None: inertia, damping and rest position, and the stiffness
            if the joint has a spring, together with gravity or in driven runs.
    """
    files = read_model_files(path, asset_dir)
    names, contents = files.to_parts()
    request = {"joint": joint, "recorded": asdict(recorded), "names": names}
    try:
        answer, _ = in_sandbox(
            law_of_request,
            request,
            contents,
            prepare=prepare,
            seconds=limits.MODEL_SECONDS,
            memory=limits.MODEL_MEMORY,
        )
    except LimitReached as error:
        remedy = "leave out what the motion of the joint does not need"
        raise TunnelError(f"loading it {error}", where=shown(path), remedy=remedy) from None
    except TunnelError as error:
        where = f"{shown(path)}, joint {one_line(joint)!r}"
        raise TunnelError(error.what, where=where, remedy=error.remedy) from None
    given = answer["law"].pop("actuator")
    terms = tuple(Term(**one) for one in answer["law"].pop("terms"))
    actuator = None
    if given is not None:
        pairs: dict[str, Any] = {name: tuple(given.pop(name)) for name in ("control", "moment", "servo")}
        actuator = Actuator(**given, **pairs)
    law = JointLaw(**answer["law"], terms=terms, actuator=actuator)
    driven = recorded.middle is not None
    gravity = any(term.expression.startswith(("sin", "cos")) for term in law.terms)
    spring = answer["spring"] and (gravity or driven)
    usual = ("inertia", "damping", *(("stiffness",) if spring else ()), "rest")
    fitted = usual if free is None else tuple(free)
    for name in fitted:
        if name not in FREE_PARAMETERS:
            what, remedy = f"unknown parameter {one_line(name)!r}", did_you_mean(name, FREE_PARAMETERS)
            raise TunnelError(what, where="--free", remedy=remedy)
    if law.stiffness == 0.0 and "stiffness" in fitted:
        what = "the joint has no spring whose stiffness could be fitted"
        raise TunnelError(what, where="--free", remedy="leave out stiffness")
    if "gain" in fitted and (law.actuator is None or not law.actuator.servo[1] < 0.0):
        what = "no position servo drives the joint whose gain could be fitted"
        raise TunnelError(what, where="--free", remedy="name its actuator with --actuator, or leave out gain")
    if {"inertia", "gain"} <= set(fitted) and not law.terms:
        what = "inertia and gain cannot both be found where the servo alone holds the joint"
        raise TunnelError(what, where="--free", remedy="name one of the two")
    if {"gain", "stiffness"} <= set(fitted):
        what = "the gain of the servo is a stiffness of the joint, too, and only one of them can be fitted"
        raise TunnelError(what, where="--free", remedy="name one of the two")
    if {"inertia", "stiffness"} <= set(fitted) and not (law.terms or driven):
        what = "inertia and stiffness of a linear spring cannot both be found from free decays"
        raise TunnelError(what, where="--free", remedy="name one of the two")
    law = replace(law, free=tuple(name for name in FREE_PARAMETERS if name in fitted))
    return JointModel(path, joint, law, files)


def prepare() -> None:
    """Load the dependencies of `law_of_request`, while files can still be opened."""
    for name in ("scipy.optimize", "tunnel_sim.physics.expression"):
        import_module(name)
    load_plugin()


def law_of_request(request: dict[str, Any], contents: Sequence[bytes]) -> Message:
    """The law of a joint, from its name, the fields of `Recorded` and the parts of `ModelFiles`."""
    joint, recorded = request["joint"], Recorded(**request["recorded"])
    with no_log(), np.errstate(all="ignore"):
        with engine_refusals("MuJoCo cannot load it", "correct the file"):
            model = ModelFiles.from_parts(request["names"], contents).spec().compile()
        if not model.opt.timestep > 0.0:
            remedy = "correct the model's option"
            raise TunnelError(f"its timestep of {model.opt.timestep} s is not above zero", remedy=remedy)
        names = [model.joint(i).name for i in range(model.njnt)]
        if joint not in names:
            known = [name for name in names if name]
            remedy = did_you_mean(joint, known) if known else "give the joint a name in the file"
            raise TunnelError("there is no such joint", remedy=remedy)
        others = [name or "without a name" for name in names if name != joint]
        if others:
            remedy = "remove them, so that the bodies are welded; one joint is recorded"
            raise TunnelError(f"other joints move too: {one_line(', '.join(others), 200)}", remedy=remedy)
        if model.neq or model.nflex or model.na:
            what = (
                "equality constraints, deformable bodies and actuators with states cannot be part of the law"
            )
            raise TunnelError(what, remedy="remove them")
        kind = _TYPES.get(int(model.jnt_type[0]))
        if kind is None:
            raise TunnelError("is not a hinge or slide", remedy="name the joint that the sensor reads")
        actuator = _actuator(model, recorded)  # removes its limits
        law = replace(_law(model, recorded, slide=kind == "slide"), actuator=actuator)
    return {"law": asdict(law), "spring": bool(model.jnt_stiffness[0])}, []


class _Engine:
    """Moments on the joint as computed by the engine."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data = model, mujoco.MjData(model)

    def moment(self, position: float, rate: float = 0.0, control: tuple[int, float] = (0, 0.0)) -> float:
        """Moment of gravity, springs, dampers and actuators, without constraints, N m.

        Args:
            control: index of a control in the model, and its value; the others are zero.
        """
        self.data.qpos[0], self.data.qvel[0] = position, rate
        if self.model.nu:
            self.data.ctrl[:] = 0.0
            self.data.ctrl[control[0]] = control[1]
        mujoco.mj_forward(self.model, self.data)
        moment = float(self.data.qfrc_passive[0] + self.data.qfrc_actuator[0] - self.data.qfrc_bias[0])
        if not abs(moment) <= limits.LARGEST_NUMBER:
            remedy = "correct gravity, masses and stiffness, in SI units"
            raise TunnelError("its moment overflows", remedy=remedy)
        return moment

    def inertia(self) -> float:
        """Inertia at the position of the last moment, kg m²."""
        full = np.zeros((1, 1))
        mujoco.mj_fullM(self.model, self.data, full)
        return float(full[0, 0])


def _actuator(model: mujoco.MjModel, recorded: Recorded) -> Actuator | None:
    """The actuator with the control that drives the runs, and its measured moment; None if no control drives them.

    The limits of its force are removed from the model, because they are checked along the records.
    """
    if not recorded.controlled and recorded.actuator is None:
        return None
    on_joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    known = [i for i in range(model.nu) if model.actuator_trntype[i] in on_joint]
    names = {model.actuator(i).name or f"{i + 1}": i for i in known}
    if recorded.actuator is not None and recorded.actuator not in names:
        what = f"it has no actuator {one_line(recorded.actuator)!r}"
        raise TunnelError(what, remedy=did_you_mean(recorded.actuator, list(names)))
    if len(names) > 1 and recorded.actuator is None:
        what = f"it has several actuators: {one_line(', '.join(names), 200)}"
        raise TunnelError(
            what, remedy="name the actuator whose control is in the column drive with --actuator"
        )
    if not names:
        return None
    name = recorded.actuator or next(iter(names))
    i = names[name]
    if model.actuator_ctrlnum[i] != 1 or model.actuator_delay[i] > 0.0:
        what = f"its actuator {one_line(name)!r} has several controls, or delays its control"
        raise TunnelError(
            what, remedy="leave out the delay, which the diagnosis looks for, or record moment_nm"
        )
    moments = [(-math.inf, math.inf)]
    if model.actuator_forcelimited[i]:
        moments.append(model.actuator_forcerange[i] * model.actuator_gear[i, 0])
    if model.jnt_actfrclimited[0]:
        moments.append(model.jnt_actfrcrange[0])
    control = model.actuator_ctrlrange[i].tolist() if model.actuator_ctrllimited[i] else (-math.inf, math.inf)
    model.actuator_forcelimited[i] = model.jnt_actfrclimited[0] = model.actuator_ctrllimited[i] = 0
    engine, at = _Engine(model), int(model.actuator_ctrladr[i])
    places = [(0.0, 0.0), (recorded.reach, 1.0), (-2.0 * recorded.reach, -3.0)]
    found = [
        (engine.moment(x, rate, (at, u)) - engine.moment(x, rate)) / u
        for x, rate in places
        for u in (1.0, -7.0)
    ]
    gain = found[0]
    if not abs(gain) > 0.0 or np.ptp(found) > _EXACT * abs(gain):
        what = f"the moment of its actuator {one_line(name)!r} is not in proportion to the control"
        raise TunnelError(
            what, remedy="take a motor or servo with a fixed gain, or record the moment as moment_nm"
        )
    servo = [(engine.moment(x), float(engine.data.qfrc_actuator[0]))[1] for x in (0.0, 1.0)]
    unclipped = float(max(min(m) for m in moments)), float(min(max(m) for m in moments))
    return Actuator(name, i, gain, (control[0], control[1]), unclipped, (servo[0], servo[1] - servo[0]))


def _rest(engine: _Engine, grid: Array, moments: Array) -> float:
    """The stable rest position closest to the model's own configuration, rad."""
    from scipy.optimize import brentq  # imported here because it is slow to load

    moments = np.where(np.abs(moments) < 1e-12 * np.max(np.abs(moments)), 0.0, moments)
    falls = np.flatnonzero((moments[:-1] >= 0.0) & (moments[1:] < 0.0))
    if falls.size == 0:
        what = "does not oscillate: it has no stable rest position nearby"
        raise TunnelError(what, remedy="add the spring, or gravity, that restores it")
    at = falls[np.argmin(np.abs(grid[falls] - float(engine.model.qpos0[0])))]
    if engine.moment(grid[at]) > 0.0:  # rest is between the grid's positions
        return float(brentq(engine.moment, grid[at], grid[at + 1], xtol=1e-13))
    return float(grid[at])


def _law(model: mujoco.MjModel, recorded: Recorded, *, slide: bool) -> JointLaw:
    engine, reach, middle = _Engine(model), recorded.reach, recorded.middle
    around = 10.0 * reach if slide else math.pi
    grid = float(model.qpos0[0]) + np.linspace(-around, around, _GRID) * (1.0 + 1e-9)
    moments = np.array([engine.moment(x) for x in grid])
    terms: dict[str, float] | None
    if middle is not None and np.ptp(moments) < _PRESENT * engine.inertia() * _TURN**2:
        rest, span, constant = middle, reach, -float(np.mean(moments))  # unrestrained; a slide has weight
        terms = {"1": constant} if abs(constant) > _PRESENT * engine.inertia() * _TURN**2 else {}
    else:
        rest = _rest(engine, grid, moments)
        span = 2.0 * (reach if middle is None else reach + abs(middle - rest)) if slide else math.pi
        b = np.linspace(-span, span, _GRID)
        restoring = np.array([-engine.moment(rest + x) for x in b])
        terms = _fitted(_MOMENTS, {"b": b}, restoring, float(np.max(np.abs(restoring))))
    if terms is None:
        what = "its restoring moment comes not only from gravity and springs up to the third power"
        raise TunnelError(
            what, remedy="write tendons, dead bands and actuators as the stiffness of the joint"
        )
    stiffness = terms.pop("b", 0.0)
    own, centre = int(model.dof_frictionloss[0] > 0.0), rest if middle is None else middle
    # no other moment may act within the reach
    for x in np.linspace(centre - reach, centre + reach, _GRID // 4):
        engine.moment(float(x))
        if engine.data.ncon:
            pair = [model.geom(g).name or f"geom {g}" for g in engine.data.contact.geom[0]]
            raise TunnelError(
                f"{' and '.join(map(one_line, pair))} touch at {x:.3g} rad, within the records' reach",
                remedy="exclude the contact, or set contype and conaffinity to 0",
            )
        if engine.data.nefc > own:
            what = f"a limit or another constraint acts at {x:.3g} rad, within the records' reach"
            raise TunnelError(what, remedy="widen the joint's range, or check the units of range and records")
    inertias = [(engine.moment(rest + x), engine.inertia())[1] for x in (0.0, 0.4 * span, -0.7 * span)]
    if not limits.SMALLEST_NUMBER <= inertias[0] <= limits.LARGEST_NUMBER:
        remedy = "correct its axis and the masses, in SI units"
        raise TunnelError(f"its inertia is {inertias[0]:g} kg m2", remedy=remedy)
    if np.ptp(inertias) > _EXACT * inertias[0]:
        raise TunnelError("its inertia changes with its position", remedy="remove the tendon's armature")
    if not stiffness > 0.0 and (middle is None or terms.keys() - {"1"}):
        raise TunnelError("does not oscillate: no restoring moment acts", remedy="add the spring, or gravity")
    turn = math.sqrt(stiffness / inertias[0]) or _TURN
    rates, scale = _RATES * (turn * reach), inertias[0] * turn**2 * reach
    lost = np.array([engine.moment(rest) - engine.moment(rest, r) for r in rates])
    damping = _fitted(_DAMPING, {"r": rates}, lost, scale)
    elsewhere = engine.moment(rest + 0.1) - engine.moment(rest + 0.1, rates[-1])
    if damping is None or abs(elsewhere - lost[-1]) > _EXACT * scale:
        raise TunnelError(
            "it has losses other than the joint's damping and frictionloss, such as a fluid's",
            remedy="write them as damping, or leave them out: the diagnosis looks for them",
        )
    linear = damping.pop("r", 0.0)
    units = dict((("1", "N m"), *_MOMENTS, *_DAMPING))
    return JointLaw(
        inertias[0],
        stiffness,
        linear,
        float(model.dof_frictionloss[0]),
        rest,
        tuple(Term(text, value, units[text]) for text, value in {**terms, **damping}.items()),
        slide=slide,
        step=float(model.opt.timestep),
    )


def _fitted(
    forms: Sequence[tuple[str, str]], moving: dict[str, Array], wanted: Array, scale: float
) -> dict[str, float] | None:
    """Coefficients by expression, without terms that are mere rounding; None if the forms do not fit the moment.

    Rounding is judged against the moment ``scale`` (N m). The linear term includes the slope of the sine at
    rest, so that it is the whole slope.
    """
    from tunnel_sim.physics.expression import parse

    columns = np.array([parse(text, frozenset(moving)).value(moving) for text, _ in forms]).T
    sizes = np.max(np.abs(columns), axis=0)
    found = np.linalg.lstsq(columns / sizes, wanted, rcond=1e-13)[0]
    kept = np.abs(found) > _PRESENT * scale
    found = np.zeros(len(forms))
    if kept.any():
        found[kept] = np.linalg.lstsq(columns[:, kept] / sizes[kept], wanted, rcond=1e-13)[0] / sizes[kept]
    if np.max(np.abs(columns @ found - wanted)) > _EXACT * scale:
        return None
    return {text: float(value) for (text, _), value in zip(forms, found, strict=True) if value != 0.0}
