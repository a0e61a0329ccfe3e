"""Episodes in one line."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

import tunnel_sim.envs  # noqa: F401  registers the environments

NAME = "tunnel_sim/FreeDecay-v0"


def make(**arguments: Any) -> gymnasium.Env[Any, Any]:
    """Without control, where no preset is given."""
    return gymnasium.make(NAME, **{"preset": "plain", **arguments})


def episode(
    env: gymnasium.Env[Any, Any], action: Any = 0, **reset: Any
) -> tuple[list[Any], list[float], dict[str, Any]]:
    """Observations with the first, rewards, and the last info of one run."""
    observation, info = env.reset(**reset)
    observations, rewards, over = [observation], [], False
    while not over:
        observation, reward, terminated, truncated, info = env.step(action)
        observations.append(observation)
        rewards.append(float(reward))
        over = terminated or truncated
    return observations, rewards, info


def same(one: Any, other: Any) -> bool:
    return bool(np.array_equal(np.asarray(one), np.asarray(other)))
