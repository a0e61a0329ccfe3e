"""A model of one's own with the causes written into it, and how far it closes the gap by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from diagnosis.answer.held_out import FOLDS, HeldOut, fit_seen, predict_held_out, predict_stretches, turns_of
from diagnosis.diagnosable import reach
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.problem import Problem, blocks_beyond, sample_means
from diagnosis.patch.joint_law import FoundLaw, found_law, start_of
from diagnosis.patched import NativeClosure, PatchedModel
from diagnosis.search.investigate import Study
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.engine.joint_patch import JointPatch, Start, patched, patched_xml, simulate_joint
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

Simulate = Callable[[Array, Array, Start, float], Motion]
"""From common parameters, the run's own, its start and a duration (s) to a motion in the measured rig's units."""

_RELEASE_STEPS = 2  # Gauss–Newton steps of a run's start in the engine
_SHIFT = 1e-4  # of the start, for its derivatives


def native_closure(
    nominal: Fit, chosen: Fit, nominal_out: HeldOut, chosen_out: HeldOut, simulate: Simulate
) -> NativeClosure:
    """Simulate what was held out with the patched model of the fit that has not seen it.

    Args:
        nominal: fit of the model as given.
        chosen: fit with the causes.
        nominal_out: runs held out of the first.
        chosen_out: runs held out of the second.
        simulate: the patched model of a fit.

    Returns:
        The closure; runs with the wind on do not count.

    Raises:
        TunnelError: when nothing could be held out, or the patched model's motion grows without bound.
    """
    runs = chosen.problem.data.runs
    known = chosen_out.points.keys() & nominal_out.residuals.keys()
    held = [i for i, run in enumerate(runs) if run.id in known and not run.wind_on]
    before: list[Array] = []
    fitted: list[Array] = []
    native: list[Array] = []
    if held:
        for i in held:
            common, own = chosen_out.points[runs[i].id]
            before.append(nominal_out.residuals[runs[i].id])
            fitted.append(chosen_out.residuals[runs[i].id])
            native.append(_residual(chosen.problem, common, own, i, simulate))
        return NativeClosure(_power(before), _power(fitted), _power(native), "on runs held out of the fit")
    ids = [run.id for run in runs if not run.wind_on]
    turns = turns_of(nominal, ids)
    plain, caused = predict_stretches(nominal, turns), predict_stretches(chosen, turns)
    for number in range(FOLDS if ids else 0):
        out = [turn == number for turn in turns]
        try:
            point, _ = fit_seen(chosen, [~left for left in out])
        except np.linalg.LinAlgError:
            continue
        for i, left in enumerate(out):
            if left.any():
                seen = _residual(chosen.problem, point.common, point.release[i], i, simulate, seen=~left)
                before.append(plain[runs[i].id][left])
                fitted.append(caused[runs[i].id][left])
                native.append(seen[left])
    if not native:
        raise TunnelError("no run with the wind off could be held out", remedy="add runs with the wind off")
    return NativeClosure(
        _power(before), _power(fitted), _power(native), "on stretches of time held out of the fit"
    )


def _power(residuals: Sequence[Array]) -> float:
    return float(np.mean(np.concatenate(residuals) ** 2))


def _residual(
    problem: Problem,
    common: Array,
    own: Array,
    index: int,
    simulate: Simulate,
    seen: NDArray[np.bool_] | None = None,
) -> Array:
    """Reading minus the engine's prediction, in noise standard deviations, its start refitted to what was seen."""
    seen = np.ones(problem.data.runs[index].reading.size, bool) if seen is None else seen

    def left(release: Array) -> Array:
        return _left(problem, common, release, index, simulate)

    best = left(own)
    for _ in range(_RELEASE_STEPS):
        size = max(abs(float(own[0])), 1e-3)
        steps = _SHIFT * size * np.array([1.0, 10.0])
        slopes = [(best - left(own + step * np.eye(own.size)[k])) / step for k, step in enumerate(steps)]
        move = np.linalg.lstsq(np.array(slopes).T[seen], best[seen], rcond=1e-10)[0]
        trial = own + np.concatenate([move, np.zeros(own.size - 2)])
        moved = left(trial)
        if not moved[seen] @ moved[seen] < best[seen] @ best[seen]:
            break
        own, best = trial, moved
    return best


def _left(problem: Problem, common: Array, own: Array, index: int, simulate: Simulate) -> Array:
    run, change = problem.data.runs[index], problem.data.similarity
    chain = problem.chain(common, own, run)
    blocks = run.reading.size + blocks_beyond(chain.physics(), run) + 1
    measured = change.own(blocks * run.interval, "s")
    motion = simulate(common, own, start_of(problem, own, index), measured)
    scaled = Motion(
        motion.time_s * change.similar(1.0, "s"), motion.angle, motion.rate * change.similar(1.0, "rad/s")
    )
    return run.scaled(run.reading - sample_means(chain, scaled, run, problem.zero(common, own)))


def refuse_unpatchable(model: JointModel, campaign: Campaign, path: Path) -> None:
    """Refuse a model that no answer could be written into, before the work.

    Args:
        model: as given.
        campaign: to be diagnosed with it.
        path: where the patched model is to be written.

    Raises:
        TunnelError: when every run has the wind on, or the engine cannot write or simulate the model as given.
    """
    still = [run for run in campaign.runs if not run.wind_on]
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
    """Write the answer of a study into the model, and simulate it against what was held out.

    Args:
        study: whose nominal model is the law of the model's joint.

    Returns:
        The patched model: with the causes, or with the free parameters alone where none is named.

    Raises:
        TunnelError: when the engine refuses the patched model, or its motion grows without bound.
    """
    chosen = study.chosen
    problem, change = chosen.problem, study.similarity
    noise = change.own(study.noise.std, change.reading) if not study.campaign.sensor.derivative else 0.0

    still = next((i for i, run in enumerate(problem.data.runs) if not run.wind_on), 0)

    def law(common: Array) -> FoundLaw:
        return found_law(problem, common, chosen.point.release[still], noise, still)

    @lru_cache(maxsize=4)
    def compiled(common: bytes) -> mujoco.MjModel:
        return patched(model, law(np.frombuffer(common)).patch)[0].compile()

    def simulate(common: Array, own: Array, start: Start, duration: float) -> Motion:
        del own
        return simulate_joint(compiled(common.tobytes()), model.law.rest, start, duration)

    nominal_out = predict_held_out(study.nominal)
    chosen_out = nominal_out if chosen is study.nominal else predict_held_out(chosen)
    closure = native_closure(study.nominal, chosen, nominal_out, chosen_out, simulate)
    found = law(chosen.point.common)
    starts = [start_of(problem, own, i) for i, own in enumerate(chosen.point.release)]
    spec, written = patched(model, found.patch, starts)
    zeros = [problem.zero(chosen.point.common, own) for own in chosen.point.release]
    zero = float(np.median(zeros)) + change.rest - model.law.rest
    return PatchedModel(model, spec, written, found.notes, zero, closure)
