"""The environment ``tunnel_sim/FreeDecay-v0``: an episode is one run of the rig."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np

from tunnel_sim.envs.config import free_decay_config
from tunnel_sim.envs.controls import action_space, operator_action
from tunnel_sim.envs.engines import Models, OneRun
from tunnel_sim.envs.episodes import Episodes, EpisodeState, observation_space
from tunnel_sim.envs.errors import EnvError
from tunnel_sim.envs.rendering import RENDER_MODES, RigView, render_modes
from tunnel_sim.vocabulary.record import Array, Record


class FreeDecayEnv(gymnasium.Env[Any, Any]):
    """One run of the oscillating-model rig, from the release onwards; see docs/reference/envs/free-decay.md.

    Args:
        render_mode: ``human``: MuJoCo's viewer; ``rgb_array``: pictures; None: nothing is drawn.
        width: of a picture, pixels.
        height: of a picture, pixels.
        camera: name of a camera of ``mjcf/rig.xml``.
        **arguments: fields of `FreeDecayConfig`.

    Raises:
        EnvError: when an argument is unknown or out of range.
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
        self.config = free_decay_config(arguments)
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
        """Start a run.

        Args:
            seed: of all random draws, as in Gymnasium.
            options: properties of the run; the others are drawn. See the environment's page.

        Returns:
            The observation (readings before the release, time 0 and wind speed), and the stated conditions of the
            run.

        Raises:
            EnvError: when an option is unknown or out of range.
        """
        super().reset(seed=seed)
        observation, info = self._episodes.start(0, options, self.np_random)
        if self.render_mode == "human":
            self.render()
        return observation, info

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Advance the run by one control period.

        Args:
            action: 0 in the plain preset; set-point and moment, each from −1 to 1, in the operator preset.

        Returns:
            Observation, information gained (nats), whether the angle left the sensor's range, whether the run
            has ended, and info.

        Raises:
            EnvError: when the action is outside the space, or no run is in progress.
        """
        if self._episodes.ended[0]:
            raise EnvError("no run is in progress", where="step", remedy="call reset() first")
        many = self._episodes.advance(np.asarray(action)[None])
        observation, reward, terminated, truncated = (values[0] for values in many)
        info = self._episodes.outcome(0) if terminated or truncated else {}
        if self.render_mode == "human":
            self.render()
        return observation, float(reward), bool(terminated), bool(truncated), info

    def operator_action(self, *, wind_speed: float, moment: float = 0.0) -> np.ndarray[Any, Any]:
        """The action of the operator preset from values in SI units.

        Args:
            wind_speed: set-point, m/s.
            moment: applied yaw moment, N m.

        Returns:
            The action, shape (2,).

        Raises:
            EnvError: when one is beyond its limit.
        """
        return operator_action(self.config, wind_speed=wind_speed, moment=moment)

    def information(self) -> Array:
        """The Fisher information so far, including the prior.

        It is computed at the true coefficients, so an agent must not observe it.

        Returns:
            Shape (7, 7), in the order of ``tunnel_sim.envs.information.UNKNOWNS``.
        """
        return self._episodes.matrix(0)

    def record(self) -> Record:
        """The record so far, for example of a run ended by ``TimeLimit``.

        Raises:
            EnvError: before the first step.
        """
        return self._episodes.record(0)

    def get_state(self) -> EpisodeState:
        """The complete state of the episode in progress, including the states of MuJoCo and the plugin.

        Raises:
            EnvError: when no episode has begun.
        """
        return self._episodes.get_state(0)

    def set_state(self, state: EpisodeState) -> None:
        """Continue from a saved state of this environment, or of one with the same configuration.

        Raises:
            EnvError: when the state belongs to a different configuration.
        """
        self.np_random = self._episodes.set_state(0, state)

    def render(self) -> Any:
        """Draw the rig in its present position.

        Returns:
            A picture of shape (height, width, 3), uint8, in mode ``rgb_array``; None otherwise.

        Raises:
            EnvError: when rendering does not work on this machine, with the remedy.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render() is called without a render_mode; give one to gymnasium.make")
            return None
        return self._view.draw(*self._engine.pose(0))

    def close(self) -> None:
        """Close the window or rendering context; a second call does nothing."""
        self._view.close()


def render_fps(control_period: float) -> float | int:
    """Pictures per second of real time, 1/dt.

    Args:
        control_period: s.

    Returns:
        Hz, as an integer where possible.
    """
    rate = 1.0 / control_period
    return round(rate) if abs(rate - round(rate)) < 1e-9 * rate else rate
