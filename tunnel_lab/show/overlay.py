"""Trace, wind speed and address over the picture of MuJoCo Studio's web viewer; imported only when used."""

from __future__ import annotations

import textwrap
from math import degrees
from typing import Any

from mujoco.studio import messages, plugin
from mujoco.studio.dear_imgui import dear_imgui as imgui
from mujoco.studio.implot import implot

from tunnel_lab.show.live import LiveRun

_WIDTH, _PLOT, _MARGIN, _TOP = (
    380.0,
    170.0,
    12.0,
    36.0,
)  # pixels; the height is that of the lines and the plot
_CHARACTERS = 54  # in a line: Studio's own wrapping breaks words


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
