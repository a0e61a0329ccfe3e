"""The operator's controls during a run: wind-speed set-point and applied yaw moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from tunnel_sim.envs.conditions import FreeDecayConfig
from tunnel_sim.envs.errors import EnvError
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True, eq=False)
class OperatorLog:
    """The operator's actions in a run, one entry per control period.

    Args:
        time_s: start of the period, shape (n,), s.
        set_point: of the wind speed, shape (n,), m/s.
        wind_speed: at the period's end, shape (n,), m/s.
        moment: applied to the rod's upper end, shape (n,), N m.
    """

    time_s: Array
    set_point: Array
    wind_speed: Array
    moment: Array


def action_space(config: FreeDecayConfig) -> spaces.Space[Any]:
    """The space of one environment's actions: ``Discrete(1)`` in the plain preset, else a box from −1 to 1."""
    if config.preset == "plain":
        return spaces.Discrete(1)
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def operator_action(
    config: FreeDecayConfig, *, wind_speed: float, moment: float = 0.0
) -> np.ndarray[Any, Any]:
    """The action of the operator preset, shape (2,), from values in SI units within their limits.

    Args:
        wind_speed: set-point, m/s, from 0 to the limit.
        moment: applied yaw moment, N m, within the limit to either side.
    """
    action = np.array([2.0 * wind_speed / config.wind_limit - 1.0, moment / config.moment_limit], np.float32)
    decode(config, action[None])
    return action


def decode(config: FreeDecayConfig, actions: np.ndarray[Any, Any]) -> tuple[Array, Array]:
    """Actions, shape (runs, 2), as wind-speed set-points (m/s) and moments (N m), each of shape (runs,)."""
    values = np.asarray(actions, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != 2:
        raise EnvError(
            f"an action has shape {values.shape[1:]}, not (2,)",
            where="action",
            remedy="give set-point and moment",
        )
    bad = ~(np.abs(values) <= 1.0)
    if bad.any():
        value = values[bad][0]
        raise EnvError(
            f"{value:g} is outside the space",
            where="action",
            remedy="give numbers from -1 to 1 (operator_action)",
        )
    return 0.5 * config.wind_limit * (values[:, 0] + 1.0), config.moment_limit * values[:, 1]


def check_plain(actions: np.ndarray[Any, Any], count: int) -> None:
    """Refuse all actions except 0, the only action of the plain preset."""
    values = np.asarray(actions)
    if values.size != count or values.dtype.kind not in "iu" or np.any(values != 0):
        raise EnvError(
            f"{actions!r} is not an action of the plain preset",
            where="action",
            remedy="give 0, or make the environment with preset='operator'",
        )


@dataclass(frozen=True)
class WindAnswer:
    """The tunnel's first-order response to its set-point over one control period.

    Args:
        period: s.
        samples: number of sample intervals in the period.
        time_constant: s.
    """

    period: float
    samples: int
    time_constant: float

    def speeds(self, begin: Array, set_point: Array) -> tuple[Array, Array]:
        """Exact solution of τ V̇ = Vs − V over the period.

        Args:
            begin: speed at the start, shape (runs,), m/s.
            set_point: shape (runs,), m/s.

        Returns:
            Mean speeds in the sample intervals, shape (runs, samples), and speed at the end, shape (runs,), m/s.
        """
        left = np.exp(-np.arange(self.samples + 1) * (self.period / self.samples / self.time_constant))
        mean = (left[:-1] - left[1:]) * (self.time_constant * self.samples / self.period)
        departure = begin - set_point
        return set_point[:, None] + departure[:, None] * mean, set_point + departure * left[-1]
