"""The environment ``tunnel_sim/FreeDecay-v0``: one run of the rig, and many at once on ``mujoco.batch``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from tunnel_sim.envs import EnvError, arguments_of
from tunnel_sim.envs.engines import ManyRuns, Models, OneRun, action_space, operator_action
from tunnel_sim.envs.episode_conditions import WHERE, free_decay_config
from tunnel_sim.envs.episodes import Episodes, EpisodeState, observation_space
from tunnel_sim.envs.rendering import RENDER_MODES, RigView, render_modes
from tunnel_sim.vocabulary.arguments import COUNT, Number
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.record import Array, Record


class FreeDecayEnv(gymnasium.Env[Any, Any]):
    """One run of the oscillating-model rig, from the release onwards; see docs/reference/envs/free-decay.md.

    Args:
        render_mode: ``human``: MuJoCo's viewer; ``rgb_array``: pictures; None: nothing is drawn.
        width, height: of a picture, pixels.
        camera: name of a camera of ``mjcf/rig.xml``.
        **arguments: fields of `FreeDecayConfig`.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 100}  # type: ignore[misc]

    def __init__(
        self,
        render_mode: str | None = None,
        width: int = 640,
        height: int = 480,
        camera: str = "overview",
        **arguments: Any,
    ) -> None:
        self.config = free_decay_config(arguments, arguments_of(FreeDecayEnv))
        self.rig = self.config.rig()
        fps = render_fps(self.config.control_period)
        self.metadata = {**self.metadata, "render_modes": render_modes(), "render_fps": fps}  # type: ignore[misc]
        self.observation_space = observation_space(self.config)
        self.action_space = action_space(self.config)
        self.render_mode = render_mode
        self._view = RigView(self.rig, render_mode, width, height, camera, self.dt)
        self._engine = OneRun(Models(self.rig, self.config.sample_rate), self.config.samples_per_step)
        self._episodes = Episodes(self.config, self.rig, self._engine, 1)

    @property
    def dt(self) -> float:
        """The control period, s."""
        return self.config.control_period

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start a run; the options on the environment's page fix its properties, the others are drawn."""
        super().reset(seed=seed)
        observation, info = self._episodes.start(0, options, self.np_random)
        if self.render_mode == "human":
            self.render()
        return observation, info

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Advance the run by one control period; the reward is the information gained, nats, less any penalty."""
        if self._episodes.ended[0]:
            raise EnvError("no run is in progress", where="step", remedy="call reset() first")
        many = self._episodes.advance(np.asarray(action)[None])
        observation, reward, terminated, truncated = (values[0] for values in many)
        info = self._episodes.outcome(0) if terminated or truncated else {}
        if self.render_mode == "human":
            self.render()
        return observation, float(reward), bool(terminated), bool(truncated), info

    def operator_action(self, *, wind_speed: float, moment: float = 0.0) -> np.ndarray[Any, Any]:
        """The action of the operator preset, shape (2,), from values in SI units within their limits.

        Args:
            wind_speed: set-point, m/s.
            moment: applied yaw moment, N m.
        """
        return operator_action(self.config, wind_speed=wind_speed, moment=moment)

    def information(self) -> Array:
        """The Fisher information so far with the prior, shape (7, 7), at the truth: not for the agent."""
        return self._episodes.information.matrix(0)

    def record(self) -> Record:
        """The record so far, for example of a run ended by ``TimeLimit``."""
        return self._episodes.record(0)

    def get_state(self) -> EpisodeState:
        """The complete state of the episode in progress, including the states of MuJoCo and the plugin."""
        return self._episodes.get_state(0)

    def set_state(self, state: EpisodeState) -> None:
        """Continue from a saved state of this environment, or of one with the same configuration."""
        self.np_random = self._episodes.set_state(0, state)

    def render(self) -> Any:
        """Draw the rig in its present position: a picture, shape (height, width, 3), in mode ``rgb_array``."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() is called without a render_mode; give one to gymnasium.make")
            return None
        return self._view.draw(*self._engine.pose(0))

    def close(self) -> None:
        """Close the window or rendering context; a second call does nothing."""
        self._view.close()


def render_fps(control_period: float) -> float | int:
    """Pictures per second of real time for a control period in s, 1/dt, Hz; an integer where possible."""
    rate = 1.0 / control_period
    return round(rate) if abs(rate - round(rate)) < 1e-9 * rate else rate


class FreeDecayVectorEnv(VectorEnv[Array, Any, Any]):
    """Parallel runs, each bit-identical to a `FreeDecayEnv` with the same seed.

    A run that has ended is restarted in the next step (``AutoresetMode.NEXT_STEP``), with all properties drawn.

    Args:
        max_episode_steps: number of steps after which runs are truncated; None: at their end only.
        nthread: number of threads; 0 uses all processors. The result does not depend on it.
        width, height, camera: as in `FreeDecayEnv`.
        **arguments: fields of `FreeDecayConfig`.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": ["rgb_array"],
        "render_fps": 100,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        nthread: int = 0,
        width: int = 640,
        height: int = 480,
        camera: str = "overview",
        **arguments: Any,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise EnvError(f"unknown mode {render_mode!r}", where="render_mode", remedy="use 'rgb_array'")
        self.config = free_decay_config(arguments, arguments_of(FreeDecayVectorEnv))
        self.rig = self.config.rig()
        self.metadata = {**self.metadata, "render_fps": render_fps(self.config.control_period)}  # type: ignore[misc]
        self.num_envs, self.render_mode = int(COUNT.checked(num_envs, "num_envs", WHERE)), render_mode
        if max_episode_steps is not None:
            COUNT.checked(max_episode_steps, "max_episode_steps", WHERE)
        Number(whole=True).checked(nthread, "nthread", WHERE)
        self._most_steps = max_episode_steps
        self.single_observation_space = observation_space(self.config)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.single_action_space = action_space(self.config)
        self.action_space = batch_space(self.single_action_space, num_envs)
        models = Models(self.rig, self.config.sample_rate)
        self._engine = ManyRuns(models, self.config.samples_per_step, num_envs, nthread)
        self._episodes = Episodes(self.config, self.rig, self._engine, num_envs)
        self._rngs: list[np.random.Generator | None] = [None] * num_envs
        self._view = RigView(self.rig, render_mode, width, height, camera, self.config.control_period)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start all runs, or those selected by a mask.

        Args:
            seed: one per run, or the first of consecutive seeds, or None, as in ``SyncVectorEnv``.
            options: as in `FreeDecayEnv.reset`, for all runs. ``reset_mask``, a boolean array, selects the runs to
                start; ``runs``, a sequence of mappings, overrides the common options run by run.
        """
        common = dict(options or {})
        mask, each = common.pop("reset_mask", None), common.pop("runs", None)
        mask = np.ones(self.num_envs, dtype=np.bool_) if mask is None else np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            what = f"reset_mask is not a boolean array of length {self.num_envs} with at least one True"
            raise EnvError(what, where="option reset_mask", remedy="give one boolean per run")
        each = [{}] * self.num_envs if each is None else each
        if not isinstance(each, Sequence) or len(each) != self.num_envs:
            what = f"runs is not a sequence of length {self.num_envs}"
            raise EnvError(what, where="option runs", remedy="give one mapping per run")
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + row for row in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            what = f"{counted(len(seeds), 'seed')} for {counted(self.num_envs, 'run')}"
            raise EnvError(what, where="seed", remedy="give one per run")
        observations = np.zeros(self.observation_space.shape or ())
        infos: dict[str, Any] = {}
        for row in np.flatnonzero(mask).tolist():
            if seeds[row] is not None or self._rngs[row] is None:
                self._rngs[row], _ = seeding.np_random(seeds[row])
            observations[row], infos = self._start(row, {**common, **each[row]}, infos)
        return observations, infos

    def _start(
        self, row: int, options: Mapping[str, Any] | None, infos: dict[str, Any]
    ) -> tuple[Array, dict[str, Any]]:
        rng = self._rngs[row]
        assert rng is not None
        observation, info = self._episodes.start(row, options, rng)
        return observation, self._add_info(infos, info, row)

    def step(self, actions: Any) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Advance all runs as `FreeDecayEnv.step` does, or restart runs that ended in the previous step."""
        if any(rng is None for rng in self._rngs):
            raise EnvError("no run is in progress", where="step", remedy="call reset() first")
        renewed = np.flatnonzero(self._episodes.ended)
        observations, rewards, terminated, truncated = self._episodes.advance(actions)
        if self._most_steps is not None:
            truncated |= self._episodes.step_count >= self._most_steps
            self._episodes.ended |= truncated
        infos: dict[str, Any] = {}
        for row in renewed.tolist():
            observations[row], infos = self._start(row, None, infos)
            rewards[row], terminated[row], truncated[row] = 0.0, False, False
        for row in np.flatnonzero(terminated | truncated).tolist():
            infos = self._add_info(infos, self._episodes.outcome(row), row)
        return observations, rewards, terminated, truncated, infos

    def get_state(self, index: int) -> EpisodeState:
        """The state of one run, also for `FreeDecayEnv.set_state`."""
        return self._episodes.get_state(index)

    def set_state(self, index: int, state: EpisodeState) -> None:
        """Set one run to a state of an environment of the same configuration."""
        self._rngs[index] = self._episodes.set_state(index, state)

    def information(self, index: int) -> Array:
        """The Fisher information of one run so far, shape (7, 7), as `FreeDecayEnv.information`."""
        return self._episodes.information.matrix(index)

    def render(self) -> tuple[Any, ...] | None:
        """A picture of every run; result and arguments as in `FreeDecayEnv.render`."""
        if self.render_mode is None:
            return None
        return tuple(self._view.draw(*self._engine.pose(row)) for row in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Close the rendering context."""
        del kwargs
        if hasattr(self, "_view"):  # Gymnasium before 1.3 also closes environments that could not be made
            self._view.close()
