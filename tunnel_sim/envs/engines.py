"""Integration of the runs: one with ``mj_step``, many with ``mujoco.batch``, with bit-identical results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch

from tunnel_sim.engine.model import Model, build_model
from tunnel_sim.physics.run_settings import RunSettings, sampling
from tunnel_sim.physics.steps import follow_fastest
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""State for a bit-identical continuation: full physics with plugin state, inputs, and the solver's warm start."""

_CONTROL = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED) | int(mujoco.mjtState.mjSTATE_USERDATA)
_VARIED = ("jnt_stiffness", "dof_damping", "numeric_data", "body_inertia")


@dataclass(frozen=True, eq=False)
class Operation:
    """The operator's actions on the runs in one control period.

    Args:
        wind_departure: mean difference from the stated speed in each sample interval, shape (runs, samples), m/s.
        moment: on the rod's upper end, shape (runs,), N m.
    """

    wind_departure: Array
    moment: Array


class Models:
    """Models by layout, each compiled once.

    Args:
        sample_rate: Hz.
    """

    def __init__(self, rig: Rig, sample_rate: float) -> None:
        self._rig = rig
        self._sample_rate = sample_rate
        self._compiled: dict[tuple[object, ...], Model] = {}

    def of(self, settings: RunSettings) -> tuple[tuple[object, ...], int, Model]:
        """The model of a run.

        Returns:
            Layout, number of steps between two samples, model.
        """
        settings = follow_fastest(self._rig, settings)
        _, steps = sampling(settings, self._sample_rate)
        layout = settings.layout()
        if layout not in self._compiled:
            self._compiled[layout] = build_model(self._rig, settings)
        return layout, steps, self._compiled[layout].with_settings(settings)


class OneRun:
    """A single run with its own model; its ``row`` is always 0.

    Args:
        samples: in one control period.
    """

    def __init__(self, models: Models, samples: int) -> None:
        self._models = models
        self._samples = samples
        self._model: Model | None = None
        self._data: Any = None
        self._steps = 1

    def start(self, row: int, settings: RunSettings) -> float:
        """Start a run at its release.

        Returns:
            Angle of the rod's upper end, rad.
        """
        del row
        _, self._steps, self._model = self._models.of(settings)
        self._data = self._model.release_state()
        return float(self._data.qpos[self._model.yaw_address])

    def advance(self, operation: Operation | None) -> tuple[Array, Array]:
        """Integrate one control period.

        Args:
            operation: the operator's actions; None: nothing acts.

        Returns:
            Angle (rad) and rate (rad/s) of the rod's upper end at the samples and at the period's end, each of
            shape (1, samples + 1).
        """
        assert self._model is not None
        model, data, at = self._model.mj, self._data, self._model.yaw_address
        angle, rate = np.empty((1, self._samples + 1)), np.empty((1, self._samples + 1))
        angle[0, 0], rate[0, 0] = data.qpos[at], data.qvel[at]
        if operation is not None:
            data.qfrc_applied[at] = operation.moment[0]
        for j in range(self._samples):
            if operation is not None:
                data.userdata[0] = operation.wind_departure[0, j]
            mujoco.mj_step(model, data, self._steps)
            angle[0, j + 1], rate[0, j + 1] = data.qpos[at], data.qvel[at]
        return angle, rate

    def get_state(self, row: int) -> Array:
        """MuJoCo's state of a run.

        Returns:
            The result of ``mj_getState`` for `STATE`, shape (n,).
        """
        del row
        assert self._model is not None
        state = np.empty(mujoco.mj_stateSize(self._model.mj, STATE))
        mujoco.mj_getState(self._model.mj, self._data, state, STATE)
        return state

    def set_state(self, row: int, state: Array) -> None:
        """Put a run into a state.

        Args:
            state: from `get_state`, for a run of the same layout, shape (n,).
        """
        del row
        assert self._model is not None
        mujoco.mj_setState(self._model.mj, self._data, np.asarray(state, dtype=np.float64), STATE)

    def pose(self, row: int) -> tuple[float, float]:
        """Angle of the rod's upper end, and of the body relative to it, rad."""
        return _pose(self.get_qpos(row))

    def get_qpos(self, row: int) -> Array:
        """Positions of a run's joints, rad; arguments as in `pose`."""
        del row
        return np.array(self._data.qpos)


class ManyRuns:
    """Many runs on ``mujoco.batch``, one batch per layout; ``row`` is the index of a run.

    Args:
        samples: number of samples in one control period.
        nthread: number of threads; 0 uses all processors. The result does not depend on it.
    """

    def __init__(self, models: Models, samples: int, count: int, nthread: int) -> None:
        self._models, self._samples, self._count, self._nthread = models, samples, count, nthread
        self._groups: dict[tuple[object, ...], _Group] = {}
        self._layout: list[tuple[object, ...]] = [()] * count
        self._members: dict[tuple[object, ...], np.ndarray[Any, Any] | None] = {}
        self._last = np.zeros((2, count))  # angle and rate at the last period's end

    def start(self, row: int, settings: RunSettings) -> float:
        """Start a run at its release; result and arguments as in `OneRun.start`."""
        layout, steps, model = self._models.of(settings)
        if layout not in self._groups:
            batch = mujoco_batch.Batch(model.mj, nsim=self._count, nthread=self._nthread)
            self._groups[layout] = _Group(batch, model.yaw_address, steps, self._samples)
        group = self._groups[layout]
        data = model.release_state()
        for name in _VARIED:
            group.fields[name][row] = getattr(model.mj, name)
        mujoco.mj_getState(model.mj, data, group.batch.state[row], STATE)
        group.changed.append(row)
        if self._layout[row] != layout:
            self._layout[row] = layout
            self._members = {}
        at = model.yaw_address
        self._last[:, row] = data.qpos[at], data.qvel[at]
        return float(data.qpos[at])

    def advance(self, operation: Operation | None) -> tuple[Array, Array]:
        """Integrate one control period of all runs; result and arguments as in `OneRun.advance`."""
        if not self._members:
            self._members = self._sorted()
        if len(self._members) == 1:
            (layout,) = self._members
            angle, rate = self._groups[layout].advance(None, self._last, operation)
        else:
            angle, rate = (np.empty((self._count, self._samples + 1)) for _ in range(2))
            for layout, rows in self._members.items():
                angle[rows], rate[rows] = self._groups[layout].advance(rows, self._last, operation)
        self._last = np.stack((angle[:, -1], rate[:, -1]))
        return angle, rate

    def _sorted(self) -> dict[tuple[object, ...], np.ndarray[Any, Any] | None]:
        layouts = dict.fromkeys(self._layout)
        return {one: np.flatnonzero([at == one for at in self._layout]) for one in layouts}

    def get_state(self, row: int) -> Array:
        """MuJoCo's state of a run; result and arguments as in `OneRun.get_state`."""
        return np.array(self._groups[self._layout[row]].batch.state[row])

    def set_state(self, row: int, state: Array) -> None:
        """Put a run into a state; arguments as in `OneRun.set_state`."""
        group = self._groups[self._layout[row]]
        group.batch.state[row] = state
        at = group.address
        self._last[:, row] = group.states["qpos"][row, at], group.states["qvel"][row, at]

    def pose(self, row: int) -> tuple[float, float]:
        """Angles of the rod's upper end and of the body; result and arguments as in `OneRun.pose`."""
        return _pose(self._groups[self._layout[row]].states["qpos"][row])


class _Group:
    """The batch of one layout; it has idle rows for the runs of other layouts."""

    def __init__(self, batch: mujoco_batch.Batch, address: int, steps: int, samples: int) -> None:
        self.batch, self.address, self._steps = batch, address, steps
        self.fields = {name: batch.expand(name) for name in _VARIED}
        self.states = {name: batch.bind(name) for name in ("qpos", "qvel")}
        self.changed: list[int] = []
        self._nstep = samples * steps
        self._out: dict[str, Array] = {}

    def advance(self, rows: Any, last: Array, operation: Operation | None) -> tuple[Array, Array]:
        if self.changed:
            self.batch.set_const(np.array(sorted(set(self.changed)), dtype=np.int32))
            self.changed = []
        chosen = slice(None) if rows is None else rows
        control = self._control(chosen, operation) if operation is not None else None
        recorded = self.batch.rollout(
            self._nstep,
            control,
            _CONTROL,
            ("qpos", "qvel"),
            ids=rows,
            out=self._out if rows is None else None,
        )
        if rows is None:
            self._out = recorded  # the same buffers again
        return tuple(
            np.concatenate(
                (last[i, chosen, None], recorded[name][:, self._steps - 1 :: self._steps, self.address]),
                axis=1,
            )
            for i, name in enumerate(("qpos", "qvel"))
        )  # type: ignore[return-value]

    def _control(self, chosen: Any, operation: Operation) -> Array:
        departure = np.repeat(operation.wind_departure[chosen], self._steps, axis=1)
        joints = self.batch.model.nv
        control = np.zeros((*departure.shape, joints + self.batch.model.nuserdata))
        control[..., self.address] = operation.moment[chosen, None]
        control[..., joints] = departure
        return control


def _pose(qpos: Array) -> tuple[float, float]:
    return float(qpos[0]), float(qpos[1]) if len(qpos) > 1 else 0.0
