"""Converting finished episodes to a campaign."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol

from tunnel_sim.envs.config import FreeDecayConfig
from tunnel_sim.envs.errors import EnvError
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.rig import Rig


class _HasRig(Protocol):
    """A free-decay environment or vector environment, unwrapped."""

    config: FreeDecayConfig
    rig: Rig


def campaign_of(runs: Iterable[Run], env: _HasRig, *, name: str = "episodes") -> Campaign:
    """The runs of finished episodes as one campaign.

    Args:
        runs: ``info["run"]`` of each, in the plain preset.

    Returns:
        The campaign. It states the rig's nominal inertia and the configured sensor, and contains no trace of the
        truth. Runs with equal conditions are numbered.

    Raises:
        EnvError: when no run is given.
    """
    listed = list(runs)
    if not listed:
        raise EnvError("no run is given", where="campaign_of", remedy="give info['run'] of finished episodes")
    repeated = {label for label, count in Counter(run.id for run in listed).items() if count > 1}
    seen: Counter[str] = Counter()
    numbered = []
    for run in listed:
        seen[run.id] += 1
        numbered.append(replace(run, id=f"{run.id}-{seen[run.id]}") if run.id in repeated else run)
    sensor = SensorProperties.of(env.config.sensor(0.0))
    return Campaign(name, RigProperties.of(env.rig), sensor, tuple(numbered))
