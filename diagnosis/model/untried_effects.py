"""Effects that the inputs of driven runs exclude, with the reason for each."""

from __future__ import annotations

from collections.abc import Sequence

from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.campaign import Campaign

_MOVING_ROOT = "These effects are not tried, since their loss depends on the motion of the spring's root: {}."
_TURNING_BASE = (
    "These effects are not tried, since they depend on more than the acceleration of the base: {}."
)


def untried_by_inputs(campaign: Campaign, kinds: Sequence[type[Effect]]) -> dict[str, list[type[Effect]]]:
    """The effects with a moment that does not follow from an input, by the sentence that gives the reason.

    Args:
        kinds: effects to try.

    Returns:
        By a sentence with a place for their names, the untried members of ``kinds``; none where all follow.
    """
    inputs = {drive.kind for drive in campaign.inputs}
    found: dict[str, list[type[Effect]]] = {}
    if any(one.of_spring for one in inputs):
        found[_MOVING_ROOT] = [kind for kind in kinds if kind.on_spring and kind.channel == "damping"]
    if any(one.by_inertia for one in inputs):
        found[_TURNING_BASE] = [kind for kind in kinds if kind.by_angle_in_room]
    return found
