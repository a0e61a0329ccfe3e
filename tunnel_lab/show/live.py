"""A run in real time, in a window; at its end the model is released again."""

from __future__ import annotations

import os
import sys
import time
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from tunnel_lab.show.film import ShownRun
from tunnel_sim.engine.model import build_model
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from collections.abc import Callable


FRAME_S = 1.0 / 60.0
_KEY_SPACE, _KEY_R = 32, 82
_NO_DISPLAY = "use tunnel render for a film"


class LiveRun:
    """A run of the rig with its full physics, including the plugin.

    Its history follows the physics, not the frames: a viewer may take a second for a frame.
    """

    def __init__(self, run: ShownRun) -> None:
        self.run = run
        self.history = History()
        self.model = build_model(run.rig, run.settings)
        self.data = self.model.release_state()
        self._released = self.model.release_state()
        self.release()

    def release(self) -> None:
        """Return the model to its release angle and release it again."""
        mujoco.mj_copyData(self.data, self.model.mj, self._released)
        mujoco.mj_forward(self.model.mj, self.data)
        self._record()

    def advance(self, seconds: float) -> None:
        """Advance by seconds of the run; a finished run is released again."""
        if self.data.time >= self.run.settings.duration:
            self.release()
        steps, apart = self._steps(seconds), self._steps(self.history.interval) or 1
        for done in range(0, steps, apart):  # stops at every point of the history
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


class History:
    """The last seconds of the angle, for a figure in the viewer.

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


def missing_display() -> str:
    """The reason why a window cannot be opened; empty where the environment shows none."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        return "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)"
    return ""


class Controls:
    """The keys of the window: space pauses, R releases again."""

    def __init__(self, live: LiveRun) -> None:
        self._live = live
        self.paused = False
        self.released = False

    def key(self, code: int) -> None:
        """Record a GLFW key; called from the viewer's thread, so it only sets a flag."""
        if code == _KEY_SPACE:
            self.paused = not self.paused
        elif code == _KEY_R:
            self.released = True

    def advance(self, seconds: float) -> None:
        """Advance by the seconds since the last call, according to the keys."""
        if self.released:
            self.released = False
            self._live.release()
        elif not self.paused:
            self._live.advance(seconds)


def view_in_window(run: ShownRun, *, camera: str, speed: float) -> None:
    """Open a window and show the run until it is closed.

    Args:
        camera: of ``mjcf/rig.xml``.
        speed: factor on real time (ratio).

    Raises:
        TunnelError: when there is no display, or the window cannot be opened.
    """
    missing = missing_display()
    if missing:
        raise TunnelError(missing, where="tunnel view", remedy=_NO_DISPLAY)
    import glfw

    # Checked first: a failure inside the viewer's thread would leave this process waiting for ever.
    if not glfw.init():
        raise TunnelError("the display cannot be opened", where="tunnel view", remedy=_NO_DISPLAY)
    import mujoco.viewer

    live = LiveRun(run)
    controls = Controls(live)
    try:
        handle = mujoco.viewer.launch_passive(
            live.model.mj, live.data, key_callback=controls.key, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # macOS wants its own interpreter
        remedy = "start it with mjpython -m tunnel_lab.cli view"
        raise TunnelError(str(error), where="tunnel view", remedy=remedy) from error
    with handle:
        with handle.lock():
            handle.cam.type = mujoco.mjtCamera.mjCAMERA_FIXED
            handle.cam.fixedcamid = live.model.mj.camera(camera).id
        window_loop(handle, live, controls, speed)


def window_loop(
    handle: Any,
    live: LiveRun,
    controls: Controls,
    speed: float,
    *,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Advance and show until the window is closed.

    Args:
        handle: of MuJoCo's passive viewer.
        speed: factor on real time (ratio).
        clock: wall time, s.
        sleep: waits for s.
    """
    last = clock()
    while handle.is_running():
        now = clock()
        with handle.lock():
            controls.advance(min(now - last, 0.1) * speed)
        last = now
        width, height = (
            (handle.viewport.width, handle.viewport.height) if handle.viewport is not None else (1200, 900)
        )
        figure = mujoco.MjvFigure()
        mujoco.mjv_defaultFigure(figure)
        figure.title = "angle [rad] against time [s]"
        figure.flg_extend = 1
        figure.gridsize[:] = 3, 3
        figure.linergb[0][:] = 0.84, 0.37, 0.0
        points = live.history.points.astype(np.float32)
        figure.linepnt[0] = len(points)
        figure.linedata[0][: 2 * len(points)] = points.ravel()
        handle.set_figures((mujoco.MjrRect(width - width // 3, 0, width // 3, height // 4), figure))
        handle.set_texts((None, None, "space\nR", "pause\nrelease again"))
        handle.sync()
        sleep(max(0.0, FRAME_S - (clock() - now)))
