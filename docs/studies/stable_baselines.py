"""A bridge from Gymnasium's vector environments to Stable-Baselines3; needs the extra ``train``.

Gymnasium restarts a run in the step after its end. Stable-Baselines3 expects the first observation of the
next run together with the last reward, so ended runs are restarted at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import NormalizeObservation

from tunnel_sim.envs import EnvError
from tunnel_sim.vocabulary.errors import installing
from tunnel_sim.vocabulary.record import Array

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise EnvError("stable-baselines3 is missing", remedy=f"run {installing('train')}") from error


class BaselinesVecEnv(VecEnv):
    """A vector environment of Gymnasium as one of Stable-Baselines3.

    Args:
        envs: the native ``gymnasium.make_vec("tunnel_sim/FreeDecay-v0", ...)``, or a ``SyncVectorEnv`` with box
            observations; either may be in Gymnasium's ``NormalizeObservation``, but in no other wrapper.
        options: options of every reset; the other properties are drawn.
    """

    def __init__(self, envs: VectorEnv[Any, Any, Any], options: dict[str, Any] | None = None) -> None:
        self._envs, self._common = envs, dict(options or {})
        self._normal = envs if isinstance(envs, NormalizeObservation) else None
        self._inner = envs if self._normal is None else self._normal.env
        self._actions: Any = None
        self.render_mode = envs.render_mode
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> Array:
        """Start all runs, with the seeds of ``seed()`` if there are any."""
        seeds: Any = list(self._seeds)
        observations, infos = self._envs.reset(seed=seeds, options=dict(self._common))
        self.reset_infos = [_of_run(infos, row) for row in range(self.num_envs)]
        self._reset_seeds()
        return np.asarray(observations)

    def step_async(self, actions: np.ndarray[Any, Any]) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, np.ndarray[Any, np.dtype[np.bool_]], list[dict[str, Any]]]:
        """Make a step in all runs, and restart those that ended."""
        observations, rewards, terminated, truncated, many = self._envs.step(self._actions)
        done = terminated | truncated
        infos = [_of_run(many, row) for row in range(self.num_envs)]
        if done.any():
            last, observations = observations, observations.copy()
            # Gymnasium's NormalizeObservation refuses to restart only some of the runs. So they are restarted
            # inside it, and their observations are added to its statistics here.
            first, started = self._inner.reset(options={**self._common, "reset_mask": done})
            fresh = first[done]
            if self._normal is not None:
                statistics: Any = self._normal.obs_rms  # Gymnasium's class is only partly typed
                if self._normal.update_running_mean:
                    statistics.update(fresh)
                fresh = (fresh - statistics.mean) / np.sqrt(statistics.var + self._normal.epsilon)
            observations[done] = fresh
            for row in np.flatnonzero(done).tolist():
                infos[row]["terminal_observation"] = last[row]
                infos[row]["TimeLimit.truncated"] = bool(truncated[row] and not terminated[row])
                self.reset_infos[row] = _of_run(started, row)
        return observations, rewards, done, infos

    def close(self) -> None:
        """Close the vector environment."""
        self._envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the vector environment, once for each index."""
        return [getattr(self._inner, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the runs share one environment."""
        del value, indices
        raise EnvError(f"{attr_name} cannot be set", where="BaselinesVecEnv", remedy="give it to make_vec")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the vector environment that takes the index of a run as its first argument."""
        method = getattr(self._inner, method_name)
        return [method(row, *method_args, **method_kwargs) for row in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Always False: single runs are not wrapped for Stable-Baselines3."""
        del wrapper_class
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[Any]:
        """A picture of every run."""
        return self._envs.render() or ()


def _of_run(infos: dict[str, Any], row: int) -> dict[str, Any]:
    """The infos of one run from the infos of a vector environment."""
    return {
        name: _of_run(value, row) if isinstance(value, dict) else value[row]
        for name, value in infos.items()
        if not name.startswith("_") and infos[f"_{name}"][row]
    }
