"""The user's own model with the causes written into it, and the share of the gap that it explains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from diagnosis.answer.held_out import (
    ON_RUNS,
    ON_STRETCHES,
    HeldOut,
    predict_held_out,
    predict_stretches,
    turns_of,
)
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.motions import blocks_beyond, condensed, sample_means
from diagnosis.likelihood.partial import fit_seen
from diagnosis.likelihood.problem import Problem
from diagnosis.model.data import FOLDS
from diagnosis.model.fact import Fact
from diagnosis.model.joint import Joint, LooseJoint, ServoJoint, reach
from diagnosis.model.similarity import REFERENCE_FREQUENCY
from diagnosis.patch.native_actuator import controlled, native_actuator
from diagnosis.patch.native_friction import Carried, native_friction, nearest_polynomial
from diagnosis.patch.written_model import EngineModel, NativeClosure, NativeForm, PatchedModel
from diagnosis.search.study import Study
from tunnel_sim.effects.capabilities import InputClock
from tunnel_sim.effects.drives import ActuatorEffect
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.engine.joint_patch import (
    ActuatorPatch,
    JointPatch,
    Start,
    creep_rate,
    history_of,
    inertia_of_steps,
    patched,
    patched_xml,
    simulate_joint,
)
from tunnel_sim.physics.expression import OF_ANGLE, OF_RATE, TEXTBOOK_POWERS, parse
from tunnel_sim.physics.moment_law import operation_names
from tunnel_sim.physics.run_settings import Motion, RunSettings
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

PATCHED_MISSES: Final = 0.02
"""Maximum error of a polynomial in the patched model, as a share of the largest moment. Judgement."""

_GRID = 201
_NAMES = frozenset(
    {"b", "r", "Kr", "gravity_angle", *TEXTBOOK_POWERS, *(name for name, *_ in (*OF_ANGLE, *OF_RATE))}
)


@dataclass(frozen=True)
class FoundLaw:
    """The law found for a joint, in the units of the given model.

    Args:
        patch: changes of the model: native elements, and the rest as a program.
        differences: where the native element follows another law, and causes left out.
    """

    patch: JointPatch
    differences: tuple[Fact, ...]


def found_law(
    problem: Problem,
    common: Array,
    release: Array,
    noise: float,
    index: int = 0,
    actuator: ActuatorPatch | None = None,
    *,
    native_only: bool = False,
) -> FoundLaw:
    """The law of a fit, in the units of the measured campaign.

    Args:
        common: its common parameters, shape (common,).
        release: of a run, shape (own,).
        noise: of the sensor, rad; 0: not written.
        index: of that run, with the wind off.
        actuator: changes of the actuator that drives the joint; None: none.
        native_only: whether every moment is written as the nearest native element, however far it is.
    """
    data = problem.data
    assert isinstance(data.model, Joint | LooseJoint)
    law, to_own_unit = data.model.law, data.similarity.own
    chain = problem.chain(common, release, data.runs[index])
    physics = condensed(chain.physics(), data)
    zero = problem.zero(common, release)
    reach = max(float(np.max(np.abs(run.reading - zero))) for run in data.runs)
    b = np.linspace(-reach, reach, _GRID)
    turn = np.sqrt(physics.spring_stiffness / physics.yaw_inertia) or 2.0 * np.pi * REFERENCE_FREQUENCY
    rate = reach * turn
    r = np.linspace(-rate, rate, _GRID)
    differences: list[Fact] = []
    loss = physics.parameters.get("loss_factor", 0.0) * np.sqrt(
        physics.spring_stiffness * physics.yaw_inertia
    )
    fitted = dict(zip(problem.names, common.tolist(), strict=True))
    kp = fitted.get("servo_kp")
    of_servo = kp - data.model.kp if kp is not None and isinstance(data.model, ServoJoint) else 0.0
    added = physics.spring_stiffness - law.stiffness - of_servo
    spring = np.array([-fitted.get("moment_offset", 0.0), added, 0.0, 0.0])
    damping = np.array([physics.mechanical_damping + loss - law.damping, 0.0, 0.0])
    # the part of the program that effects add to the model's own
    own_program = problem.stated(common, release, data.runs[index]).program
    program = physics.program[len(own_program) :]
    if native_only and program:
        program = ()
        differences.append(Fact("own law left out"))
    if own_program and program:
        program = (_number("number"), 0.0, *program)
    spring, of_angle, said_of_angle = _native(
        physics, OF_ANGLE, np.array((b**0, b, b**2, b**3)).T, ("b", b), spring, native_only=native_only
    )
    damping, of_rate, said_of_rate = _native(
        physics, OF_RATE, np.array((r, np.abs(r) * r, r**3)).T, ("r", r), damping, law.damping,
        native_only=native_only,
    )  # fmt: skip
    program = reduce(_added, (*of_angle, *of_rate), program)
    differences += [*said_of_angle, *said_of_rate]
    loads = _loads(problem, common, release) if physics.parameters.get("friction_load", 0.0) else ()
    carried = Carried.over(physics.parameters, loads) if loads else Carried()
    may_miss = np.inf if native_only else PATCHED_MISSES
    friction = native_friction(physics.parameters, r[r > 0.0], law, float(damping[0]), may_miss, carried)
    damping = damping + friction.damping
    program = _added(program, friction.program)
    differences += friction.differences
    rest = law.rest + data.similarity.rest
    units = ("N m", "N m/rad", "N m/rad2", "N m/rad3"), ("N m s/rad", "N m s2/rad2", "N m s3/rad3")
    k0, k1, k2, k3 = (to_own_unit(float(v), unit) for v, unit in zip(spring, units[0], strict=True))
    c0, c1, c2 = (to_own_unit(float(v), unit) for v, unit in zip(damping, units[1], strict=True))
    patch = JointPatch(
        inertia=to_own_unit(physics.yaw_inertia, "kg m2"),
        spring=(k0, k1, k2, k3),
        damping=(c0, c1, c2),
        friction=to_own_unit(friction.loss, "N m"),
        presliding=to_own_unit(friction.presliding, "rad"),
        program=_own_program(program, rest, to_own_unit) if program else (),
        contact=tuple(
            (name, to_own_unit(value, unit) + (rest if name == "load_angle" else 0.0))
            for name, value, unit in friction.contact
        ),
        actuator=actuator,
        kp=None if kp is None else to_own_unit(kp, "N m/rad"),
        noise=noise,
    )
    return FoundLaw(patch, (*differences, *_unwritten(physics, problem, actuator)))


def _native(
    physics: RunSettings,
    terms: Sequence[tuple[str, str, str]],
    columns: Array,
    known: tuple[str, Array],
    native: Array,
    beside: float | None = None,
    *,
    native_only: bool,
) -> tuple[Array, list[tuple[float, ...]], list[Fact]]:
    """The polynomial of a spring or damper with the terms of a law that are near one.

    Args:
        terms: coefficient, words and formula of each.
        columns: powers on a grid, shape (n, m).
        known: the formulas' variable and its values on the grid, shape (n,).
        native: the polynomial without the terms, shape (m,).
        beside: damping of the joint as given, N m s/rad: no sum may be negative; None: any may be.
        native_only: as in `found_law`.

    Returns:
        The polynomial, shape (m,), the programs of the other terms, and the differences.
    """
    constants = {"Kr": physics.spring_stiffness, **physics.parameters}
    programs, differences = list[tuple[float, ...]](), list[Fact]()
    for coefficient, words, text in terms:
        if physics.parameters.get(coefficient, 0.0) == 0.0:
            continue
        formula = parse(text, _NAMES)
        values = {
            constant: constants.get(constant, 0.0) or TEXTBOOK_POWERS.get(constant, 0.0)
            for constant in formula.names - {"b", "r"}
        }
        wanted = -formula.value({**values, known[0]: known[1]})
        greatest, least = np.max(np.abs(wanted)), np.full(native.size, -np.inf)
        if native_only and beside is not None:
            least[0] = -(native[0] + beside)
        found = nearest_polynomial(columns, wanted, least)
        found[np.abs(found) * np.max(np.abs(columns), axis=0) < 1e-9 * greatest] = 0.0
        missed = float(np.max(np.abs(columns @ found - wanted)) / greatest)
        falls = beside is not None and native[0] + beside + found[0] < 0.0
        if native_only or (missed < PATCHED_MISSES and not falls):
            native = native + found
            if missed >= 1e-6:
                differences.append(Fact("polynomial", {"moment": words, "missed_percent": 100.0 * missed}))
        else:
            programs.append(formula.program(values, {"b": "angle", "r": "rate"}))
            differences.append(Fact("no native element", {"moment": words}))
    return native, programs, differences


def _loads(problem: Problem, common: Array, release: Array) -> list[tuple[Array, Array]]:
    """Every run's angle from rest, rad, and its actuator's moment, N m, each of shape (n,)."""
    zero, found = problem.zero(common, release), list[tuple[Array, Array]]()
    for run in problem.data.runs:
        drive, moment = problem.chain(common, release, run).physics().drive, np.zeros(run.reading.size)
        if drive is not None and drive.through_actuator:
            acting = drive.acting
            moment = acting.scale * np.interp(run.times - acting.delay, acting.time_s, acting.values)
        found.append((run.reading - zero, moment))
    return found


def _unwritten(physics: RunSettings, problem: Problem, written: ActuatorPatch | None) -> list[Fact]:
    """Differences of the patched model from the law found, and omissions.

    Args:
        written: changes of the actuator.
    """
    sensors = [kind.name for kind in problem.effects if kind.channel == "sensor"]
    left_out = {
        "rod": physics.rod_twist is not None,
        "delayed input": written is None and any(issubclass(kind, InputClock) for kind in problem.effects),
        "actuator": written is None and any(issubclass(kind, ActuatorEffect) for kind in problem.effects),
        "air": problem.data.wind_on,
    }
    found = [Fact(kind) for kind, left in left_out.items() if left]
    return [*found, Fact("sensor", {"effects": sensors})] if sensors else found


def _added(program: tuple[float, ...], further: tuple[float, ...]) -> tuple[float, ...]:
    """The program of the sum of two; either may be empty."""
    return (*program, *further, _number("add")) if program and further else (*program, *further)


def _number(operation: str) -> float:
    return float(operation_names().index(operation))


def _own_program(
    program: tuple[float, ...], rest: float, own: Callable[[float, str], float]
) -> tuple[float, ...]:
    """A program of the similar campaign in terms of the model's joint: its position, rate, time and moment."""
    value = _number("number")
    replaced = {
        _number("angle"): (value, rest, _number("subtract")),
        _number("rate"): (value, 1.0 / own(1.0, "rad/s"), _number("multiply")),
        _number("time"): (value, 1.0 / own(1.0, "s"), _number("multiply")),
    }
    code: list[float] = []
    elements = iter(program)
    for element in elements:
        code.append(element)
        if element == value:
            code.append(next(elements))
        code += replaced.get(element, ())
    return (*code, value, own(1.0, "N m"), _number("multiply"))


Simulate = Callable[[Array, Start, float], Motion]
"""From common parameters, a run's start and a duration (s) to a motion in the measured rig's units."""

_RELEASE_STEPS = 2  # Gauss–Newton steps of a run's start in the engine
_SHIFT = 1e-4  # of the start, for its derivatives
_NO_DROP = 1e-6  # of the mean squared residual: a step that promises less is not simulated


def native_closure(
    nominal: Fit,
    chosen: Fit,
    nominal_out: HeldOut,
    chosen_out: HeldOut,
    simulate: Simulate,
    native: frozenset[str] = frozenset(),
) -> NativeClosure:
    """Simulate held-out runs with the patched model of the fit that has not used them; only with the wind off.

    Args:
        nominal: fit of the given model.
        chosen: fit with the causes.
        nominal_out: runs held out of the first.
        chosen_out: runs held out of the second.
        native: as in `engine_residual`.

    Raises:
        TunnelError: when nothing could be held out, or the patched model's motion diverges.
    """
    runs = chosen.problem.data.runs
    known = chosen_out.points.keys() & nominal_out.residuals.keys()
    still = [run.id for run in chosen.problem.data.in_still_air]
    held = [i for i, run in enumerate(runs) if run.id in known.intersection(still)]
    before: list[Array] = []
    fitted: list[Array] = []
    engine: list[Array] = []
    for i in held:
        common, start = chosen_out.points[runs[i].id]
        before.append(nominal_out.residuals[runs[i].id])
        fitted.append(chosen_out.residuals[runs[i].id])
        engine.append(_restarted(chosen.problem, common, start, i, simulate, native)[1])
    ids = [] if held else still
    if ids:
        turns = turns_of(nominal, ids)
        plain, caused = predict_stretches(nominal, turns), predict_stretches(chosen, turns)
        for number in range(FOLDS):
            out = [turn == number for turn in turns]
            try:
                point, _ = fit_seen(chosen, [~left for left in out])
            except np.linalg.LinAlgError:
                continue
            for i, left in enumerate(out):
                if left.any():
                    start = point.per_run[i]
                    seen = _restarted(chosen.problem, point.common, start, i, simulate, native, seen=~left)[1]
                    before.append(plain[runs[i].id][left])
                    fitted.append(caused[runs[i].id][left])
                    engine.append(seen[left])
    if not engine:
        raise TunnelError("no run with the wind off could be held out", remedy="add runs with the wind off")
    nominal_power, fit_power, native_power = (
        float(np.mean(np.concatenate(left) ** 2)) for left in (before, fitted, engine)
    )
    count = sum(left.size for left in before)
    p_value = float(chdtrc(count, count * nominal_power))
    return NativeClosure(nominal_power, fit_power, native_power, ON_RUNS if held else ON_STRETCHES, p_value)


def _restarted(
    problem: Problem,
    common: Array,
    own: Array,
    index: int,
    simulate: Simulate,
    native: frozenset[str],
    seen: NDArray[np.bool_] | None = None,
) -> tuple[Array, Array]:
    """A run's own parameters, its start refitted in the engine to the fitted part, and its `engine_residual`."""
    seen = np.ones(problem.data.runs[index].reading.size, bool) if seen is None else seen

    def left(per_run: Array) -> Array:
        return engine_residual(problem, common, per_run, index, simulate, native)

    best = left(own)
    # derivatives of the engine: its frequency may depend on the amplitude where that of the fit does not
    size = max(abs(float(own[0])), 1e-3)
    steps = _SHIFT * size * np.array([1.0, 10.0])
    slopes = [(best - left(own + step * np.eye(own.size)[k])) / step for k, step in enumerate(steps)]
    columns = np.array(slopes).T[seen]
    for _ in range(_RELEASE_STEPS):  # the start moves too little to change them
        move = np.linalg.lstsq(columns, best[seen], rcond=1e-10)[0]
        if np.sum((columns @ move) ** 2) <= _NO_DROP * np.sum(best[seen] ** 2):
            break
        trial = own + np.concatenate([move, np.zeros(own.size - 2)])
        moved = left(trial)
        if not moved[seen] @ moved[seen] < best[seen] @ best[seen]:
            break
        own, best = trial, moved
    return own, best


def engine_residual(
    problem: Problem,
    common: Array,
    own: Array,
    index: int,
    simulate: Simulate,
    native: frozenset[str] = frozenset(),
) -> Array:
    """Reading minus the engine's prediction of one run.

    Args:
        common: parameters of all runs, shape (common,).
        own: parameters of the run, shape (own,).
        native: ids of the runs in which the model's actuator itself has the effects on the input.

    Returns:
        In noise standard deviations, shape (n,).
    """
    run, change = problem.data.runs[index], problem.data.similarity
    chain = problem.chain(common, own, run)
    blocks = run.reading.size + blocks_beyond(chain.physics(), run) + 1
    measured = change.own(blocks * run.interval, "s")
    start, given = _start(problem, own, index), (chain.stated if run.id in native else chain.physics()).drive
    if given is not None:  # without the constant moment, which is written into the model
        acting = replace(given, offset=0.0).acting
        seconds, scale = change.own(1.0, "s"), change.own(given.scale, "N m")
        lead = problem.data.model.lead  # the engine has its own
        times, delay = acting.time_s * seconds, (given.delay + lead) * seconds
        start = replace(start, drive=replace(acting, time_s=times, scale=scale, delay=delay))
    motion = simulate(common, start, measured)
    scaled = Motion(
        motion.time_s * change.similar(1.0, "s"), motion.angle, motion.rate * change.similar(1.0, "rad/s")
    )
    return run.scaled(run.reading - sample_means(chain, scaled, run, problem.zero(common, own)))


def _start(problem: Problem, own: Array, index: int) -> Start:
    """The initial state of a run with these own parameters, shape (own,), in the units of the measured campaign."""
    run, change = problem.data.runs[index], problem.data.similarity
    return Start(run.id, change.own(run.start, "s"), float(own[0]), change.own(float(own[1]), "rad/s"))


def refuse_unpatchable(model: JointModel, campaign: Campaign, path: Path) -> None:
    """Refuse a model that no answer about a campaign could be written into, before the diagnosis.

    Raises:
        TunnelError: when every run has the wind on, or the engine cannot write or simulate the given model.
    """
    still = campaign.in_still_air
    if not still:
        raise TunnelError(
            "a patched model is simulated against runs with the wind off, and there are none",
            where="--patch",
            remedy="add runs with the wind off, or leave out --patch",
        )
    spec, _ = patched(model, JointPatch(model.law.inertia, friction=model.law.friction))
    patched_xml(spec, model, path.parent)
    duration = max(float(np.ptp(run.record.time_s)) for run in still)
    simulate_joint(spec.compile(), model.law.rest, Start(still[0].id, 0.0, reach(campaign), 0.0), duration)


def patched_model(study: Study, model: JointModel) -> PatchedModel:
    """Write the answer of a study into the model of its joint, and simulate held-out readings.

    Without causes only the free parameters are written.

    Raises:
        TunnelError: when the engine refuses the patched model, or its motion diverges.
    """
    chosen = study.chosen
    nominal_out = predict_held_out(study.nominal)
    chosen_out = predict_held_out(chosen)
    found, needs_plugin = _written_model(study, model, nominal_out, chosen_out)
    if not needs_plugin:
        return found
    native, _ = _written_model(study, model, nominal_out, chosen_out, native_only=True)
    shares = {"percent": found.closed, "native_percent": native.closed}
    said = Fact("by plugin", {name: 100.0 * share for name, share in shares.items()})
    form = NativeForm(native.written, native.closed, native.engine)
    return replace(found, native=form, differences=(*found.differences, said))


def _written_model(
    study: Study, model: JointModel, nominal_out: HeldOut, chosen_out: HeldOut, *, native_only: bool = False
) -> tuple[PatchedModel, bool]:
    """The model with the answer, and whether it needs the plugin; arguments of `native_closure` and `found_law`."""
    chosen = study.chosen
    problem, change = chosen.problem, study.similarity
    noise = (
        change.own(study.prepared.noise.std, change.reading) if not study.campaign.sensor.derivative else 0.0
    )

    still = next((i for i, run in enumerate(problem.data.runs) if not run.wind_on), 0)

    given = model.spec().compile() if study.campaign.driven else None
    runs, actuator = controlled(study.campaign, model.law.actuator), model.law.actuator
    at = next((i for i, run in enumerate(problem.data.runs) if run.id in runs), None)

    def actuated(common: Array) -> ActuatorPatch | None:
        if actuator is None or at is None:
            return None
        return native_actuator(problem, common, chosen.point.per_run[at], at, actuator, change)

    def law(common: Array) -> FoundLaw:
        release = chosen.point.per_run[still]
        made = actuated(common)
        identified = found_law(problem, common, release, noise, still, made, native_only=native_only)
        if given is None:
            return identified
        steps = inertia_of_steps(given, float(given.dof_damping[0]) + identified.patch.damping[0])
        return replace(identified, patch=replace(identified.patch, inertia=identified.patch.inertia - steps))

    @lru_cache(maxsize=4)
    def compiled(common: bytes) -> mujoco.MjModel:
        return patched(model, law(np.frombuffer(common)).patch)[0].compile()

    def simulate(common: Array, start: Start, duration: float) -> Motion:
        by = actuator.index if actuator is not None and start.run in runs else None
        return simulate_joint(compiled(common.tobytes()), model.law.rest, start, duration, by)

    native = frozenset[str]() if actuated(chosen.point.common) is None else runs
    closure = native_closure(study.nominal, chosen, nominal_out, chosen_out, simulate, native)
    identified = law(chosen.point.common)
    differences = identified.differences
    if identified.patch.friction > 0.0 and identified.patch.presliding == 0.0:
        creep = creep_rate(compiled(chosen.point.common.tobytes()), model.law.rest)
        if creep > 0.0:
            unit = "m" if model.law.slide else "rad"
            differences += (Fact("soft friction", {"below_per_s": creep, "unit": unit}),)
    if given is not None and given.opt.integrator != int(mujoco.mjtIntegrator.mjINT_RK4):
        differences += (Fact("early steps", {"half_step_ms": 500.0 * given.opt.timestep}),)
    if (made := identified.patch.actuator) is not None and made.delay > 0.0:
        samples = history_of(made.delay, model.law.step)
        differences += (Fact("delayed control", {"index": made.index, "samples": samples}),)
    own = list(chosen.point.per_run)
    if given is not None:  # the engine's steps and its input do not begin as those of the fit
        common = chosen.point.common
        own = [_restarted(chosen.problem, common, one, i, simulate, native)[0] for i, one in enumerate(own)]
    inputs = [run.moment(1.0) if run.id in runs else None for run in problem.data.runs]
    starts = [replace(_start(problem, one, i), drive=inputs[i]) for i, one in enumerate(own)]
    spec, written = patched(model, identified.patch, starts)
    zeros = [problem.zero(chosen.point.common, own) for own in chosen.point.per_run]
    zero = float(np.median(zeros)) + change.rest - model.law.rest
    found = PatchedModel.of(EngineModel(model, spec, closure), written, differences, zero)
    return found, identified.patch.by_plugin
