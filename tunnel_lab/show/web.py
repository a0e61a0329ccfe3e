"""The rig in real time in a browser: MuJoCo Studio's web viewer.

A browser does not have the engine plugin and refuses a model that names it. Therefore the physics runs here,
with the plugin, and the browser shows a copy without it: the same bodies in the same pose.
"""

from __future__ import annotations

import socket
import textwrap
import time
from math import degrees
from typing import Any

from mujoco.studio import messages, plugin
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot

from tunnel_lab.show.live import LiveRun, Puppet
from tunnel_lab.show.request import ShownRun
from tunnel_lab.terminal.tables import say
from tunnel_sim.vocabulary.errors import TunnelError

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


def view_in_browser(
    run: ShownRun, *, port: int, camera: str, open_browser: bool, seconds: float | None = None
) -> None:
    """Serve the run to browsers until interrupted.

    Args:
        port: TCP port (index); 0 takes the first free one from 8080 on.
        camera: of ``mjcf/rig.xml``, from which the page looks first.
        seconds: time until it stops, s; None runs until interrupted.

    Raises:
        TunnelError: when the port is taken or MuJoCo Studio is not installed.
    """
    try:
        from mujoco.studio import app, launch_web, viewer_protocol
    except ImportError as error:
        remedy = "install the full mujoco package (pip install mujoco), not only mujoco-core"
        raise TunnelError("MuJoCo Studio is missing", where="tunnel view --web", remedy=remedy) from error
    from tunnel_lab.show.live import puppet_master

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
    plugins = [app.App(app.Config(show_inspector=False)), puppet_master(live), overlay(live, address)]
    begun = time.monotonic()
    try:
        with launch_web.launch(config, plugins=plugins) as handle:
            handle.set_model(puppet.model, data=puppet.data)
            while handle.is_running() and (seconds is None or time.monotonic() - begun < seconds):
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


class _Overlay(plugin.ViewerPlugin):  # type: ignore[misc]  # mujoco is untyped
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
        for line in (*self._head, readings(time, angle, self._wind), f"served at {self._address}"):
            imgui.TextUnformatted(line)
        if implot.BeginPlot("##angle against time", imgui.Vec2(-1.0, _PLOT)):
            self._plot(time)
            implot.EndPlot()
        imgui.End()

    def _plot(self, time: float) -> None:
        points = self._history.points
        span = self._history.span
        begin = max(0.0, time - span)
        implot.SetupAxes("time [s]", "angle [deg]")
        implot.SetupAxesLimits(begin, begin + span, -self._limit, self._limit, implot.Cond.Always)
        implot.PlotLine("", points[:, 0].tolist(), [degrees(value) for value in points[:, 1]])


def readings(time: float, angle: float, wind_speed: float) -> str:
    """Time, angle and wind speed in one line.

    Args:
        time: s.
        angle: rad.
        wind_speed: m/s.
    """
    wind = f"{wind_speed:.1f} m/s" if wind_speed > 0.0 else "off"
    return f"time {time:5.2f} s   angle {degrees(angle):+6.2f} deg   wind {wind}"


def overlay(live: LiveRun, address: str) -> Any:
    """The window of a run.

    Args:
        address: of the page.

    Returns:
        A plugin for ``mujoco.studio.launch_web.launch``.
    """
    return _Overlay(live, address)
