"""A model of one's own with the causes written into it, and how far it closes the gap by itself."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np

from diagnosis.answer.held_out import predict_held_out
from diagnosis.answer.joint_law import FoundLaw, found_law, start_of
from diagnosis.answer.native_closure import native_closure
from diagnosis.detection.own_model import reach
from diagnosis.patch import PatchedModel
from diagnosis.study import Study
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.engine.joint_patch import JointPatch, Start, patched, patched_xml, simulate_joint
from tunnel_sim.physics.run_settings import Motion
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array


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
