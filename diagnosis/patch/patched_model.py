"""The user's own model with the causes written into it, and the share of the gap that it explains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

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
from diagnosis.likelihood.motions import blocks_beyond, sample_means
from diagnosis.likelihood.partial import fit_seen
from diagnosis.likelihood.problem import Problem
from diagnosis.model.data import FOLDS
from diagnosis.model.fact import Fact
from diagnosis.model.similarity import reach
from diagnosis.patch.elements import Control, DryFriction, FoundLaw, Inertia
from diagnosis.patch.fitted_law import FittedLaw
from diagnosis.patch.written_model import EngineModel, NativeClosure, NativeForm, PatchedModel
from diagnosis.search.study import Study
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.engine.joint_patch import Start, inertia_of_steps, patched, patched_xml, simulate_joint
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Actuator

Simulate = Callable[[Array, Start, float], Motion]
"""Function from common parameters, a run's start and a duration (s) to a motion in the measured rig's units."""

_RELEASE_STEPS = 2  # Gauss–Newton steps of a run's start in the engine
_SHIFT = 1e-4  # shift of the start, for its derivatives
_NO_DROP = 1e-6  # share of the mean squared residual: a step with a smaller predicted gain is not simulated


def native_closure(
    nominal: Fit,
    chosen: Fit,
    nominal_out: HeldOut,
    chosen_out: HeldOut,
    simulate: Simulate,
    native: frozenset[str] = frozenset(),
) -> tuple[NativeClosure, dict[int, Restart]]:
    """Simulate held-out runs with the patched model of a fit that did not use them; only with the wind off.

    Returns:
        Also return the restarts of the runs held out as a whole, by index.

    Args:
        nominal: fit of the given model.
        chosen: fit with the causes.
        nominal_out: runs held out of the nominal fit.
        chosen_out: runs held out of the fit with the causes.
        native: as in `engine_residual`.

    Raises:
        TunnelError: when nothing could be held out, or the patched model's motion diverges.
    """
    runs = chosen.problem.data.runs
    known = chosen_out.points.keys() & nominal_out.residuals.keys()
    still = [run.id for run in chosen.problem.data.in_still_air]
    held = [i for i, run in enumerate(runs) if run.id in known.intersection(still)]
    restarts: dict[int, Restart] = {}
    before: list[Array] = []
    fitted: list[Array] = []
    engine: list[Array] = []
    for i in held:
        common, start = chosen_out.points[runs[i].id]
        before.append(nominal_out.residuals[runs[i].id])
        fitted.append(chosen_out.residuals[runs[i].id])
        restarts[i] = _restarted(chosen.problem, common, start, i, simulate, native)
        engine.append(restarts[i].residual)
    ids = [] if held else still
    if ids:
        turns = turns_of(nominal, ids)
        plain, caused = predict_stretches(nominal, turns), predict_stretches(chosen, turns)
        for number in range(FOLDS):
            out = [turn == number for turn in turns]
            try:
                point, _ = fit_seen(chosen, [~held_out for held_out in out])
            except np.linalg.LinAlgError:
                continue
            for i, held_out in enumerate(out):
                if held_out.any():
                    start = point.per_run[i]
                    restart = _restarted(
                        chosen.problem, point.common, start, i, simulate, native, seen=~held_out
                    )
                    before.append(plain[runs[i].id][held_out])
                    fitted.append(caused[runs[i].id][held_out])
                    engine.append(restart.residual[held_out])
    if not engine:
        raise TunnelError("no run with the wind off could be held out", remedy="add runs with the wind off")
    nominal_power, fit_power, native_power = (
        float(np.mean(np.concatenate(residuals) ** 2)) for residuals in (before, fitted, engine)
    )
    count = sum(residuals.size for residuals in before)
    p_value = float(chdtrc(count, count * nominal_power))
    on = ON_RUNS if held else ON_STRETCHES
    return NativeClosure(nominal_power, fit_power, native_power, on, p_value), restarts


@dataclass(frozen=True, eq=False)
class Restart:
    """A run with its start refitted in the engine.

    Args:
        own: the run's own parameters, shape (own,).
        residual: as from `engine_residual`, shape (n,).
        slopes: minus the derivatives of the residual by the angle and the rate at the start, shape (n, 2).
    """

    own: Array
    residual: Array
    slopes: Array


def _restarted(
    problem: Problem,
    common: Array,
    own: Array,
    index: int,
    simulate: Simulate,
    native: frozenset[str],
    seen: NDArray[np.bool_] | None = None,
    slopes: Array | None = None,
) -> Restart:
    """Refit the start of a run in the engine to the fitted part of the run.

    Args:
        slopes: from another restart of the run at nearly the same parameters; None: simulated here.
    """
    seen = np.ones(problem.data.runs[index].reading.size, bool) if seen is None else seen

    def residual_at(per_run: Array) -> Array:
        return engine_residual(problem, common, per_run, index, simulate, native)

    best = residual_at(own)
    # derivatives in the engine: its frequency may depend on the amplitude, unlike the fit's
    if slopes is None:
        steps = _SHIFT * max(abs(float(own[0])), 1e-3) * np.array([1.0, 10.0])
        moved = [
            (best - residual_at(own + step * np.eye(own.size)[k])) / step for k, step in enumerate(steps)
        ]
        slopes = np.array(moved).T
    columns = slopes[seen]
    for _ in range(_RELEASE_STEPS):  # the start changes too little to change the slopes
        move = np.linalg.lstsq(columns, best[seen], rcond=1e-10)[0]
        if np.sum((columns @ move) ** 2) <= _NO_DROP * np.sum(best[seen] ** 2):
            break
        trial = own + np.concatenate([move, np.zeros(own.size - 2)])
        there = residual_at(trial)
        if not there[seen] @ there[seen] < best[seen] @ best[seen]:
            break
        own, best = trial, there
    return Restart(own, best, slopes)


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
        native: ids of the runs in which the model's own actuator has the effects on the input.

    Returns:
        In noise standard deviations, shape (n,).
    """
    run, change = problem.data.runs[index], problem.data.similarity
    chain = problem.chain(common, own, run)
    blocks = run.reading.size + blocks_beyond(chain.physics(), run) + 1
    measured = change.own(blocks * run.interval, "s")
    start, given = _start(problem, own, index), (chain.stated if run.id in native else chain.physics()).drive
    if given is not None:  # without the constant moment, which is already in the model
        acting = replace(given, offset=0.0).acting
        seconds, scale = change.own(1.0, "s"), change.own(given.scale, "N m")
        lead = problem.data.model.lead  # the engine has its own value
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


def controlled(campaign: Campaign, actuator: Actuator | None) -> frozenset[str]:
    """Ids of the runs that control the model's actuator; the input of the other runs is a moment on the joint."""
    runs = campaign.driven_by("drive") if actuator is not None else ()
    return frozenset(run.id for run in runs)


def refuse_unpatchable(model: JointModel, campaign: Campaign, path: Path) -> None:
    """Refuse, before the diagnosis, a model into which no answer could be written.

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
    spec, _ = patched(model, (Inertia(model.law.inertia), DryFriction(model.law.friction)))
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
    """The model with the answer, and whether it needs the plugin; arguments of `native_closure` and `FittedLaw`."""
    chosen = study.chosen
    problem, change = chosen.problem, study.similarity
    noise = (
        change.own(study.prepared.noise.std, change.reading) if not study.campaign.sensor.derivative else 0.0
    )
    still = next((i for i, run in enumerate(problem.data.runs) if not run.wind_on), 0)
    given = model.spec().compile() if study.campaign.driven else None
    runs, actuator = controlled(study.campaign, model.law.actuator), model.law.actuator
    at = next((i for i, run in enumerate(problem.data.runs) if run.id in runs), None)
    steps = None if given is None else partial(inertia_of_steps, given)

    def law(common: Array) -> FoundLaw:
        own = chosen.point.per_run
        by = None if at is None else (own[at], at)
        return FoundLaw.of(
            FittedLaw(problem, common, own[still], still, noise, by, steps, native_only=native_only)
        )

    @lru_cache(maxsize=4)
    def compiled(common: bytes) -> mujoco.MjModel:
        return patched(model, law(np.frombuffer(common)).elements)[0].compile()

    def simulate(common: Array, start: Start, duration: float) -> Motion:
        by = actuator.index if actuator is not None and start.run in runs else None
        return simulate_joint(compiled(common.tobytes()), model.law.rest, start, duration, by)

    identified = law(chosen.point.common)
    native = frozenset[str]() if identified.element(Control) is None else runs
    closure, restarts = native_closure(study.nominal, chosen, nominal_out, chosen_out, simulate, native)
    engine = compiled(chosen.point.common.tobytes())
    rest, slide = model.law.rest, model.law.slide
    limits = (fact for per_run in identified.elements for fact in per_run.limits(engine, rest, slide=slide))
    differences = (*identified.differences, *limits)
    if given is not None and given.opt.integrator != int(mujoco.mjtIntegrator.mjINT_RK4):
        differences += (Fact("early steps", {"half_step_ms": 500.0 * given.opt.timestep}),)
    own = list(chosen.point.per_run)
    if given is not None:  # the engine's steps and its input do not begin as in the fit
        common = chosen.point.common
        for i, per_run in enumerate(own):
            held, slopes = restarts.get(i), None
            if held is not None:
                per_run, slopes = np.concatenate([held.own[:2], per_run[2:]]), held.slopes
            own[i] = _restarted(chosen.problem, common, per_run, i, simulate, native, slopes=slopes).own
    inputs = [run.moment(1.0) if run.id in runs else None for run in problem.data.runs]
    starts = [replace(_start(problem, per_run, i), drive=inputs[i]) for i, per_run in enumerate(own)]
    spec, written = patched(model, identified.elements, starts)
    zeros = [problem.zero(chosen.point.common, own) for own in chosen.point.per_run]
    zero = float(np.median(zeros)) + change.rest - model.law.rest
    found = PatchedModel.of(EngineModel(model, spec, closure), written, differences, zero)
    return found, identified.by_plugin
