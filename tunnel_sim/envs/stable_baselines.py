"""A bridge from the native vector environment to Stable-Baselines3; needs the extra ``train``.

Gymnasium's vector environment restarts a run in the step after its end. Stable-Baselines3 expects the first
observation of the next run together with the last reward, and the last observation in ``info``. Ended runs are
therefore restarted at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from tunnel_sim.envs.errors import EnvError
from tunnel_sim.envs.free_decay_vector import FreeDecayVectorEnv
from tunnel_sim.vocabulary.record import Array

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise EnvError(
        "stable-baselines3 is missing", remedy="install it with pip install 'virtual-wind-tunnel[train]'"
    ) from error


class NativeVecEnv(VecEnv):
    """The native vector environment as Stable-Baselines3's.

    Args:
        envs: from ``gymnasium.make_vec("tunnel_sim/FreeDecay-v0", ...)``.
        options: of every reset, as in `FreeDecayEnv.reset`; properties that they leave out are drawn.
    """

    def __init__(self, envs: FreeDecayVectorEnv, options: dict[str, Any] | None = None) -> None:
        self._envs, self._common = envs, dict(options or {})
        self._actions: Any = None
        self.render_mode = envs.render_mode
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> Array:
        """Start all runs, with the seeds of ``seed()`` where there are any."""
        # Stable-Baselines3 types its seeds as a list of None.
        seeds: Sequence[int | None] = list(self._seeds)
        observations, infos = self._envs.reset(seed=seeds, options=self._common)
        self.reset_infos = _by_run(infos, self.num_envs)
        self._reset_seeds()
        return observations

    def step_async(self, actions: np.ndarray[Any, Any]) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, np.ndarray[Any, np.dtype[np.bool_]], list[dict[str, Any]]]:
        """Advance all runs by one control period and restart those that ended.

        Returns:
            Observations, information gained (nats), whether runs ended, and infos by run.
        """
        observations, rewards, terminated, truncated, many = self._envs.step(self._actions)
        done = terminated | truncated
        infos = _by_run(many, self.num_envs)
        if done.any():
            last = observations.copy()
            fresh, started = self._envs.reset(options={**self._common, "reset_mask": done})
            observations[done] = fresh[done]
            begun = _by_run(started, self.num_envs)
            for row in np.flatnonzero(done).tolist():
                infos[row]["terminal_observation"] = last[row]
                infos[row]["TimeLimit.truncated"] = bool(truncated[row] and not terminated[row])
                self.reset_infos[row] = begun[row]
        return observations, rewards, done, infos

    def close(self) -> None:
        """Close the vector environment."""
        self._envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the vector environment, once for each index."""
        return [getattr(self._envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the runs share one environment."""
        del value, indices
        raise EnvError(f"{attr_name} cannot be set", where="NativeVecEnv", remedy="give it to make_vec")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the vector environment that takes the index of a run first."""
        method = getattr(self._envs, method_name)
        return [method(row, *method_args, **method_kwargs) for row in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Always False: the native environment has no wrappers of single runs."""
        del wrapper_class
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[Any]:
        """A picture of every run."""
        return self._envs.render() or ()


def _by_run(infos: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """Gymnasium's infos of a vector environment as one mapping for each run."""
    names: Iterable[str] = [name for name in infos if not name.startswith("_")]
    found: list[dict[str, Any]] = [{} for _ in range(count)]
    for name in names:
        for row in np.flatnonzero(infos[f"_{name}"]).tolist():
            found[row][name] = infos[name][row]
    return found
