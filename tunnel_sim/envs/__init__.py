"""Gymnasium environments of the rig; ``import tunnel_sim.envs`` registers them, which ``gymnasium.make`` requires.

``gymnasium.make("tunnel_sim.envs:tunnel_sim/FreeDecay-v0")`` imports this module by itself. Gymnasium does not
read entry points since its version 1.0.

``tunnel_sim/FreeDecay-v0``: an episode is one run (docs/reference/envs/free-decay.md).
``tunnel_sim/Campaign-v0``: an episode is a campaign and a step is a run. It needs identification and diagnosis,
so its module is in ``tunnel_lab.envs``; this package refers to it by name and does not import it.
"""

from __future__ import annotations

from collections.abc import Iterable
from inspect import Parameter, signature

# The environments' modules, and MuJoCo with them, are imported when an environment is made.
from gymnasium.envs.registration import register, registry

from tunnel_sim.vocabulary.arguments import EnvError as EnvError
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean


def as_env_error(error: TunnelError, where: str) -> EnvError:
    """Convert an error of a lower layer to an `EnvError` about ``where``, unless it names a place itself."""
    return EnvError(error.what, where=error.where or where, remedy=error.remedy)


def refuse_unknown(given: Iterable[str], known: Iterable[str], where: str) -> None:
    """Refuse the first argument that an environment does not have, and suggest the closest one."""
    names = tuple(known)
    for name in given:
        if name not in names:
            raise EnvError(f"unknown argument {name!r}", where=where, remedy=did_you_mean(name, names))


def arguments_of(environment: type) -> tuple[str, ...]:
    """The named arguments of an environment's class."""
    own = list(signature(environment).parameters.values())
    return tuple(one.name for one in own if one.kind is not Parameter.VAR_KEYWORD)


#: Entry points by identifier: environment, and native vector environment or None.
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
