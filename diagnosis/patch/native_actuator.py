"""An actuator's effects on its control in MuJoCo: a range, a filter and a delay."""

from __future__ import annotations

from diagnosis.likelihood.problem import Problem
from diagnosis.model.similarity import Similarity
from tunnel_sim.engine.joint_patch import ActuatorPatch
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Actuator


def controlled(campaign: Campaign, actuator: Actuator | None) -> frozenset[str]:
    """Ids of the runs whose input is the control of the model's actuator; the others' is a moment on the joint."""
    runs = campaign.driven_by("drive") if actuator is not None else ()
    return frozenset(run.id for run in runs)


def native_actuator(
    problem: Problem, common: Array, release: Array, index: int, actuator: Actuator, change: Similarity
) -> ActuatorPatch | None:
    """An actuator with the effects of a fit, in the units of the measured campaign.

    Args:
        common: parameters of all runs, shape (common,).
        release: of a driven run, shape (own,).
        index: of that run.
        actuator: of the model, which drives it.

    Returns:
        The limits; None where there are none, or where MuJoCo has no element for one of them: a rate limit, which
        acts between the other two, a soft limit, and an input that acts earlier than stated.
    """
    chain = problem.chain(common, release, problem.data.runs[index])
    stated, found = chain.stated.drive, chain.physics().drive
    assert stated is not None
    assert found is not None
    made, delay = found.actuator, found.delay - stated.delay
    if made.rate > 0.0 or made.softness > 0.0 or delay < 0.0 or (made == stated.actuator and delay == 0.0):
        return None
    return ActuatorPatch(
        actuator.index,
        change.own(made.limit, "N m") / abs(actuator.gain),
        change.own(made.lag, "s"),
        change.own(delay, "s"),
    )
