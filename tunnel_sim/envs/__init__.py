"""Gymnasium environments of the rig; importing this package registers them.

``tunnel_sim/FreeDecay-v0``: an episode is one run (docs/reference/envs/free-decay.md).
``tunnel_sim/Campaign-v0``: an episode is a campaign, a step is a run; it identifies and diagnoses, so it lives in
``tunnel_lab.envs``, which is named here and not imported.
"""

from __future__ import annotations

# The environments' own modules, and MuJoCo with them, load when one is made.
from gymnasium.envs.registration import register, registry

#: Entry points by identifier: of one environment, and of the native vector environment where there is one.
ENVIRONMENTS: dict[str, tuple[str, str | None]] = {
    "tunnel_sim/FreeDecay-v0": (
        "tunnel_sim.envs.free_decay:FreeDecayEnv",
        "tunnel_sim.envs.free_decay_vector:FreeDecayVectorEnv",
    ),
    "tunnel_sim/Campaign-v0": ("tunnel_lab.envs.campaign:CampaignEnv", None),
}


def register_environments() -> None:
    """Add the environments to Gymnasium's registry; a second call does nothing."""
    for name, (single, vector) in ENVIRONMENTS.items():
        if name not in registry:
            register(id=name, entry_point=single, vector_entry_point=vector)


register_environments()
