"""A run in real time, which is released again when it is over."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from mujoco.studio import messages, step_control

from tunnel_lab.show.request import ShownRun
from tunnel_sim.engine.model import build_model, build_spec
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from collections.abc import Callable

_YIELD_S = 1e-3  # as in Studio's own stepper: otherwise the loop starves the viewer's threads


class LiveRun:
    """A run of the rig with its full physics, including the plugin.

    Its history is that of the physics, not of the frames that a viewer shows: a viewer may take a second for one.
    """

    def __init__(self, run: ShownRun) -> None:
        self.run = run
        self.history = History()
        self.model = build_model(run.rig, run.settings)
        self.data = self.model.release_state()
        self._released = self.model.release_state()
        self.release()

    def release(self) -> None:
        """Hold the model at its release angle and release it again."""
        mujoco.mj_copyData(self.data, self.model.mj, self._released)
        mujoco.mj_forward(self.model.mj, self.data)
        self._record()

    def advance(self, seconds: float) -> None:
        """Advance; a run that is over is released again.

        Args:
            seconds: of the run, s.
        """
        self.advance_by(lambda: self._step(self._steps(seconds)))

    def advance_by(self, step: Callable[[], object]) -> None:
        """Advance by an external clock; a run that is over is released again.

        Args:
            step: advances ``data``, or leaves it unchanged.
        """
        if self.data.time >= self.run.settings.duration:
            self.release()
        step()
        self._record()

    def _step(self, steps: int) -> None:
        """Step, with a stop for every point of the history."""
        apart = self._steps(self.history.interval) or 1
        for done in range(0, steps, apart):
            mujoco.mj_step(self.model.mj, self.data, min(apart, steps - done))
            self._record()

    def _record(self) -> None:
        self.history.add(float(self.data.time), self.angle)

    def _steps(self, seconds: float) -> int:
        return max(0, round(seconds / float(self.model.mj.opt.timestep)))

    @property
    def angle(self) -> float:
        """Present angle at the spring and sensor, rad."""
        return float(self.data.qpos[self.model.yaw_address])


class Puppet:
    """The same bodies without the engine plugin, for viewers that do not have it (a browser)."""

    def __init__(self, live: LiveRun) -> None:
        spec = build_spec(live.run.rig, live.run.settings)
        for sensor in [sensor for sensor in spec.sensors if sensor.type == mujoco.mjtSensor.mjSENS_PLUGIN]:
            spec.delete(sensor)
        for plugin in list(spec.plugins):
            spec.delete(plugin)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.follow(live)

    def follow(self, live: LiveRun) -> None:
        """Take the pose of the run."""
        pose(self.data, live.data)
        mujoco.mj_forward(self.model, self.data)


def pose(target: mujoco.MjData, source: mujoco.MjData) -> None:
    """Copy time, positions and rates; the two models have the same joints."""
    target.time = source.time
    target.qpos[:] = source.qpos
    target.qvel[:] = source.qvel


class History:
    """The last seconds of the angle, for a figure in the viewer; another thread may read it.

    Args:
        span: s.
        points: number of points kept.
    """

    def __init__(self, span: float = 10.0, points: int = 500) -> None:
        self.span = span
        self.interval = span / points
        self._most = points
        self._points: list[tuple[float, float]] = []

    def add(self, time: float, angle: float) -> None:
        """Add a point unless it is too close to the last one; a time before the last one starts a new trace.

        Args:
            time: s from the release.
            angle: rad.
        """
        before = self._points
        if before and time < before[-1][0]:
            before = []
        if not before or time - before[-1][0] > 0.99 * self.interval:  # sums of steps are not exact
            self._points = [*before[1 - self._most :], (time, angle)]

    @property
    def points(self) -> Array:
        """Time [s] and angle [rad], shape (n, 2)."""
        return np.array(self._points, dtype=np.float64).reshape(-1, 2)


class _PuppetMaster(step_control.StepControl):  # type: ignore[misc]  # mujoco is untyped
    """Studio's pause, speed and single step, applied to the full physics instead of the shown model."""

    def __init__(self, live: LiveRun) -> None:
        super().__init__()
        self._live = live

    @messages.handler(priority=messages.Priority.INTERNAL)  # type: ignore[untyped-decorator]
    def _on_step(self, event: messages.StepEvent) -> None:
        live = self._live
        with self._send_if_changes():
            live.advance_by(lambda: self.step_control.advance(live.model.mj, live.data))
        pose(event.data, live.data)
        mujoco.mj_forward(event.model, event.data)
        time.sleep(_YIELD_S)

    @messages.handler(priority=messages.Priority.INTERNAL)  # type: ignore[untyped-decorator]
    def _on_reset_button(self, event: messages.ResetEvent) -> None:
        del event
        self._live.release()


def puppet_master(live: LiveRun) -> Any:
    """Studio's stepper for a run.

    Returns:
        A plugin for ``mujoco.studio.launch_web.launch``.
    """
    return _PuppetMaster(live)
