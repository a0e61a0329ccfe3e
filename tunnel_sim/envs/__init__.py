"""Gymnasium environments of the rig; ``import tunnel_sim.envs`` registers them, which ``gymnasium.make`` needs.

``tunnel_sim/FreeDecay-v0``: an episode is one run (docs/reference/envs/free-decay.md).
``tunnel_sim/Campaign-v0``: an episode is a campaign and a step is a run. It needs identification and diagnosis, so
its module is in ``tunnel_lab.envs``; it is referred to by name here and not imported.
"""

from __future__ import annotations

# The environments' modules, and MuJoCo with them, are imported when an environment is made.
from gymnasium.envs.registration import register, registry

from tunnel_sim.vocabulary.errors import TunnelError


class EnvError(TunnelError, ValueError):
    """A bad argument, option or action of an environment, described in one line."""


def as_env_error(error: TunnelError, where: str) -> EnvError:
    """Convert an error of a lower layer to an `EnvError`, which concerns ``where`` if it does not say itself."""
    return EnvError(error.what, where=error.where or where, remedy=error.remedy)


#: Entry points by identifier: of the environment, and of its native vector environment or None.
ENVIRONMENTS: dict[str, tuple[str, str | None]] = {
    "tunnel_sim/FreeDecay-v0": (
        "tunnel_sim.envs.free_decay:FreeDecayEnv",
        "tunnel_sim.envs.free_decay:FreeDecayVectorEnv",
    ),
    "tunnel_sim/Campaign-v0": ("tunnel_lab.envs.campaign:CampaignEnv", None),
}


def register_environments() -> None:
    """Add the environments to Gymnasium's registry; a second call does nothing."""
    for name, (single, vector) in ENVIRONMENTS.items():
        if name not in registry:
            register(id=name, entry_point=single, vector_entry_point=vector)


register_environments()
