"""A run in real time, which is released again when it is over: in a window, or in a browser."""

from __future__ import annotations

import os
import socket
import sys
import textwrap
import time
from math import degrees
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from mujoco.studio import messages, plugin, step_control
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot

from tunnel_lab.show.film import ShownRun
from tunnel_lab.terminal.outputs import say
from tunnel_sim.engine.model import build_model, build_spec
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from collections.abc import Callable


_YIELD_S = 1e-3  # as in Studio's own stepper: otherwise the loop starves the viewer's threads
FRAME_S = 1.0 / 60.0
_KEY_SPACE, _KEY_R = 32, 82
_NO_DISPLAY = "use tunnel view --web, or tunnel render for a film"
WARNING = (
    "The server listens on all network interfaces, without a password or a check of the Origin. Anyone who reaches "
    "this port, and any web page in a browser of this machine, can watch and control the view. "
    "Use it only in a network that you trust."
)
"""MuJoCo 4.0 has no option that binds the loopback only; see docs/reference/limits.md."""
_FIRST_PORT, _PORTS = 8080, 100
_WIDTH, _PLOT, _MARGIN, _TOP = (
    380.0,
    170.0,
    12.0,
    36.0,
)  # pixels; the height is that of the lines and the plot
_CHARACTERS = 54  # in a line: Studio's own wrapping breaks words


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
        """Advance by seconds of the run; a run that is over is released again."""

        def step() -> None:
            steps, apart = self._steps(seconds), self._steps(self.history.interval) or 1
            for done in range(0, steps, apart):  # a stop for every point of the history
                mujoco.mj_step(self.model.mj, self.data, min(apart, steps - done))
                self._record()

        self.advance_by(step)

    def advance_by(self, step: Callable[[], object]) -> None:
        """Advance by an external clock, which steps ``data`` or leaves it; a run that is over is released again."""
        if self.data.time >= self.run.settings.duration:
            self.release()
        step()
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
        for unused in list(spec.plugins):
            spec.delete(unused)
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


class PuppetMaster(step_control.StepControl):  # type: ignore[misc]  # mujoco is untyped
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


def missing_display() -> str:
    """Why no window can be opened; empty where the environment shows no reason."""
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
        """Advance by the seconds since the last call, as the keys demand."""
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
        remedy = "start it with mjpython -m tunnel_lab.cli view, or use tunnel view --web"
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


def view_in_browser(run: ShownRun, *, port: int, camera: str, open_browser: bool) -> None:
    """Serve the run to browsers until interrupted.

    Args:
        port: TCP port (index); 0 takes the first free one from 8080 on.
        camera: of ``mjcf/rig.xml``, from which the page looks first.

    Raises:
        TunnelError: when the port is taken or MuJoCo Studio is not installed.
    """
    try:
        from mujoco.studio import app, launch_web, viewer_protocol
    except ImportError as error:
        remedy = "install the full mujoco package (pip install mujoco), not only mujoco-core"
        raise TunnelError("MuJoCo Studio is missing", where="tunnel view --web", remedy=remedy) from error

    live = LiveRun(run)
    puppet = Puppet(live)
    puppet.model.vis.global_.cameraid = puppet.model.camera(camera).id
    port = port or _free_port()
    address = f"http://localhost:{port}/"
    say(f"Serving {address}; Ctrl-C ends it. {WARNING}", stderr=True)
    config = viewer_protocol.ViewerConfig(
        gfx="web", http_port=port, open_browser=open_browser, title="virtual wind tunnel"
    )
    # The inspector lies where the trace is, and shows the copy rather than the physics.
    plugins = [app.App(app.Config(show_inspector=False)), PuppetMaster(live), Overlay(live, address)]
    try:
        with launch_web.launch(config, plugins=plugins) as handle:
            handle.set_model(puppet.model, data=puppet.data)
            while handle.is_running():
                handle.sync()
    except RuntimeError as error:
        raise TunnelError(str(error), where="tunnel view --web", remedy="name another --port") from error


def _free_port() -> int:
    """The first free TCP port from 8080 on; 0, which lets Studio choose, where there is none."""
    for port in range(_FIRST_PORT, _FIRST_PORT + _PORTS):
        with socket.socket(socket.AF_INET6 if socket.has_ipv6 else socket.AF_INET) as trial:
            try:
                trial.bind(("", port))
            except OSError:
                continue
            return port
    return 0


class Overlay(plugin.ViewerPlugin):  # type: ignore[misc]  # mujoco is untyped
    """A window in the upper right corner, drawn with every frame from the shown pose."""

    def __init__(self, live: LiveRun, address: str) -> None:
        self._head = textwrap.wrap(live.run.title, _CHARACTERS)
        self._address = address
        self._wind, self._at = live.run.settings.wind_speed, live.model.yaw_address
        self._limit = 1.3 * abs(degrees(live.run.settings.release_angle))
        self._history = live.history

    @messages.handler  # type: ignore[untyped-decorator]
    def _on_build_gui(self, event: messages.BuildGuiEvent) -> None:
        del event
        data = self.viewer.data
        time, angle = float(data.time), float(data.qpos[self._at])
        size = imgui.GetIO().DisplaySize
        place, corner = imgui.Vec2(size.x - _MARGIN, _TOP), imgui.Vec2(1.0, 0.0)
        imgui.SetNextWindowPos(place, imgui.Cond.Always, corner)
        imgui.SetNextWindowSize(imgui.Vec2(_WIDTH, 0.0), imgui.Cond.Always)
        imgui.Begin("Run")
        wind = f"{self._wind:.1f} m/s" if self._wind > 0.0 else "off"
        readings = f"time {time:5.2f} s   angle {degrees(angle):+6.2f} deg   wind {wind}"
        for line in (*self._head, readings, f"served at {self._address}"):
            imgui.TextUnformatted(line)
        if implot.BeginPlot("##angle against time", imgui.Vec2(-1.0, _PLOT)):
            points, span = self._history.points, self._history.span
            begin = max(0.0, time - span)
            implot.SetupAxes("time [s]", "angle [deg]")
            implot.SetupAxesLimits(begin, begin + span, -self._limit, self._limit, implot.Cond.Always)
            implot.PlotLine("", points[:, 0].tolist(), [degrees(value) for value in points[:, 1]])
            implot.EndPlot()
        imgui.End()
