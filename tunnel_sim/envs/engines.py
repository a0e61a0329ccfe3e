"""The operator's controls, and the integration of the runs: one run with ``mj_step``, or many on ``mujoco.batch``.

Both give bit-identical results.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tunnel_sim.engine.model import Model, build_model
from tunnel_sim.engine.simulate import STATE, RunBatch
from tunnel_sim.envs import EnvError
from tunnel_sim.envs.episode_conditions import FreeDecayConfig
from tunnel_sim.physics.run_settings import RunSettings, sampling
from tunnel_sim.physics.steps import follow_fastest
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig


@dataclass(frozen=True, eq=False)
class Operation:
    """The operator's actions on the runs in one control period.

    Args:
        wind_departure: mean difference from the stated speed in each sample interval, shape (runs, samples), m/s.
        moment: moment on the rod's upper end, shape (runs,), N m.
    """

    wind_departure: Array
    moment: Array


class Models:
    """Models by layout, each compiled once.

    Args:
        sample_rate: sample rate, Hz.
    """

    def __init__(self, rig: Rig, sample_rate: float) -> None:
        self._rig = rig
        self._sample_rate = sample_rate
        self._compiled: dict[tuple[object, ...], Model] = {}

    def of(self, settings: RunSettings) -> tuple[tuple[object, ...], int, Model]:
        """The layout of a run, its number of steps between two samples, and its model."""
        settings = follow_fastest(self._rig, settings)
        _, steps = sampling(settings, self._sample_rate)
        layout = settings.layout()
        if layout not in self._compiled:
            self._compiled[layout] = build_model(self._rig, settings)
        return layout, steps, self._compiled[layout].with_settings(settings)


class OneRun:
    """A single run with its own model and some samples in each control period; its ``row`` is always 0."""

    def __init__(self, models: Models, samples: int) -> None:
        self._models = models
        self._samples = samples
        self._model: Model | None = None
        self._data: Any = None
        self._steps = 1

    def start(self, row: int, settings: RunSettings) -> float:
        """Start a run at its release; the angle of the rod's upper end, rad."""
        del row
        _, self._steps, self._model = self._models.of(settings)
        self._data = self._model.release_state()
        return float(self._data.qpos[self._model.yaw_address])

    def advance(self, operation: Operation | None) -> tuple[Array, Array]:
        """Integrate a control period: angle (rad) and rate (rad/s) at samples and end, shape (1, samples + 1)."""
        assert self._model is not None
        model, data, at, steps = self._model.mj, self._data, self._model.yaw_address, self._steps
        qpos, qvel, userdata = data.qpos, data.qvel, data.userdata
        angle, rate = [qpos[at]], [qvel[at]]
        departures = [None] * self._samples if operation is None else operation.wind_departure[0].tolist()
        if operation is not None:
            data.qfrc_applied[at] = operation.moment[0]
        for departure in departures:
            if departure is not None:
                userdata[0] = departure
            mujoco.mj_step(model, data, steps)
            angle.append(qpos[at])
            rate.append(qvel[at])
        return np.array([angle]), np.array([rate])

    def get_state(self, row: int) -> Array:
        """MuJoCo's state of a run, as from ``mj_getState`` for `STATE`, shape (n,)."""
        del row
        assert self._model is not None
        state = np.empty(mujoco.mj_stateSize(self._model.mj, STATE))
        mujoco.mj_getState(self._model.mj, self._data, state, STATE)
        return state

    def set_state(self, row: int, state: Array) -> None:
        """Set the state of a run.

        Args:
            state: from `get_state`, for a run of the same layout, shape (n,).
        """
        del row
        assert self._model is not None
        mujoco.mj_setState(self._model.mj, self._data, np.asarray(state, dtype=np.float64), STATE)

    def pose(self, row: int) -> tuple[float, float]:
        """Angle of the rod's upper end, and of the body relative to it, rad."""
        del row
        return _pose(self._data.qpos)


class ManyRuns:
    """Many runs on ``mujoco.batch``, one batch per layout; ``row`` is the index of a run."""

    def __init__(self, models: Models, samples: int, count: int, nthread: int) -> None:
        self._models, self._samples, self._count, self._nthread = models, samples, count, nthread
        self._batches: dict[tuple[object, ...], RunBatch] = {}
        self._layout: list[tuple[object, ...]] = [()] * count
        self._members: dict[tuple[object, ...], NDArray[np.intp]] = {}
        self._last = np.zeros((2, count))  # angle and rate at the end of the last period

    def start(self, row: int, settings: RunSettings) -> float:
        """Start a run at its release; result and arguments as in `OneRun.start`."""
        layout, steps, model = self._models.of(settings)
        if layout not in self._batches:
            self._batches[layout] = RunBatch(model, self._count, steps, self._nthread)
        if self._layout[row] != layout:
            self._layout[row] = layout
            self._members = {}
        self._last[:, row] = self._batches[layout].start(row, model)
        return float(self._last[0, row])

    def advance(self, operation: Operation | None) -> tuple[Array, Array]:
        """Integrate one control period of all runs; result and arguments as in `OneRun.advance`."""
        if not self._members:
            for layout in dict.fromkeys(self._layout):
                self._members[layout] = np.flatnonzero([other == layout for other in self._layout])
        control = None if operation is None else (operation.wind_departure, operation.moment)
        if len(self._members) == 1:
            (layout,) = self._members
            angle, rate = self._batches[layout].advance(self._samples, self._last, None, control)
        else:
            angle, rate = (np.empty((self._count, self._samples + 1)) for _ in range(2))
            for layout, rows in self._members.items():
                if operation is not None:
                    control = operation.wind_departure[rows], operation.moment[rows]
                first = self._last[:, rows]
                angle[rows], rate[rows] = self._batches[layout].advance(self._samples, first, rows, control)
        self._last = np.stack((angle[:, -1], rate[:, -1]))
        return angle, rate

    def get_state(self, row: int) -> Array:
        """MuJoCo's state of a run; result and arguments as in `OneRun.get_state`."""
        return np.array(self._batches[self._layout[row]].state[row])

    def set_state(self, row: int, state: Array) -> None:
        """Set the state of a run; arguments as in `OneRun.set_state`."""
        batch = self._batches[self._layout[row]]
        batch.state[row] = state
        self._last[:, row] = batch.now(row)

    def pose(self, row: int) -> tuple[float, float]:
        """Angles of the rod's upper end and of the body; result and arguments as in `OneRun.pose`."""
        return _pose(self._batches[self._layout[row]].qpos(row))


def _pose(qpos: Array) -> tuple[float, float]:
    return float(qpos[0]), float(qpos[1]) if len(qpos) > 1 else 0.0


@dataclass(frozen=True, eq=False)
class OperatorLog:
    """The operator's actions in a run, one entry per control period.

    Args:
        time_s: start of the period, shape (n,), s.
        set_point, wind_speed: set-point and, at the period's end, the speed, shape (n,), m/s.
        moment: moment applied to the rod's upper end, shape (n,), N m.
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
    limits = {
        "wind_speed": (wind_speed, 0.0, config.wind_limit, "wind_limit", "m/s"),
        "moment": (moment, -config.moment_limit, config.moment_limit, "moment_limit", "N m"),
    }
    for name, (value, least, most, limit, unit) in limits.items():
        if not least <= value <= most:
            what = f"{name} = {value:g} {unit} is beyond {limit} = {most:g} {unit}"
            if name == "wind_speed" and value < 0.0:
                what = f"{name} = {value:g} {unit} is negative"
            remedy = f"give {least:g} to {most:g} {unit}, or make the environment with a greater {limit}"
            raise EnvError(what, where="operator_action", remedy=remedy)
    action = np.array([2.0 * wind_speed / config.wind_limit - 1.0, moment / config.moment_limit], np.float32)
    decode(config, action[None])
    return action


def decode(config: FreeDecayConfig, actions: np.ndarray[Any, Any]) -> tuple[Array, Array]:
    """Actions, shape (runs, 2), as wind-speed set-points (m/s) and moments (N m), each of shape (runs,)."""
    values = np.asarray(actions, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != 2:
        remedy = "give set-point and moment"
        raise EnvError(f"an action has shape {values.shape[1:]}, not (2,)", where="action", remedy=remedy)
    bad = ~(np.abs(values) <= 1.0)
    if bad.any():
        value = values[bad][0]
        remedy = "give numbers from -1 to 1 (operator_action)"
        raise EnvError(f"{value:g} is outside the space", where="action", remedy=remedy)
    return 0.5 * config.wind_limit * (values[:, 0] + 1.0), config.moment_limit * values[:, 1]


def check_plain(actions: np.ndarray[Any, Any], count: int) -> None:
    """Refuse all actions except 0, the only action of the plain preset."""
    values = np.asarray(actions)
    if values.size != count or values.dtype.kind not in "iu" or np.any(values != 0):
        remedy = "give 0, or make the environment with preset='operator'"
        raise EnvError(f"{actions!r} is not an action of the plain preset", where="action", remedy=remedy)


@dataclass(frozen=True)
class WindAnswer:
    """The tunnel's first-order response to its set-point over one control period.

    Args:
        period: control period, s.
        samples: number of sample intervals in the period.
        time_constant: time constant, s.
    """

    period: float
    samples: int
    time_constant: float

    def speeds(self, begin: Array, set_point: Array) -> tuple[Array, Array]:
        """Exact solution of τ V̇ = Vs − V over the period, m/s.

        Mean speeds in the sample intervals, shape (runs, samples), and speed at the end, shape (runs,).

        Args:
            begin, set_point: speed at the start, and set-point, shape (runs,), m/s.
        """
        left = np.exp(-np.arange(self.samples + 1) * (self.period / self.samples / self.time_constant))
        mean = (left[:-1] - left[1:]) * (self.time_constant * self.samples / self.period)
        departure = begin - set_point
        return set_point[:, None] + departure[:, None] * mean, set_point + departure * left[-1]
