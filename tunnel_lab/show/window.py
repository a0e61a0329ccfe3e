"""The rig in real time in MuJoCo's viewer."""

from __future__ import annotations

import os
import sys
import time
from typing import TYPE_CHECKING

import numpy as np

from tunnel_lab.show.live import History, LiveRun
from tunnel_lab.show.request import ShownRun
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

FRAME_S = 1.0 / 60.0
_KEY_SPACE, _KEY_R = 32, 82
_NO_DISPLAY = "use tunnel view --web, or tunnel render for a film"


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
        """Record a key; called from the viewer's thread, so it only sets a flag.

        Args:
            code: of the key, a GLFW number (count).
        """
        if code == _KEY_SPACE:
            self.paused = not self.paused
        elif code == _KEY_R:
            self.released = True

    def advance(self, seconds: float) -> None:
        """Advance by the clock, as the keys demand.

        Args:
            seconds: since the last call, s.
        """
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
        handle.set_figures((_corner(handle.viewport), _figure(live.history)))
        handle.set_texts((None, None, "space\nR", "pause\nrelease again"))
        handle.sync()
        sleep(max(0.0, FRAME_S - (clock() - now)))


def _corner(viewport: Any) -> Any:
    """The lower right part of the window, for the trace."""
    import mujoco

    width, height = (viewport.width, viewport.height) if viewport is not None else (1200, 900)
    return mujoco.MjrRect(width - width // 3, 0, width // 3, height // 4)


def _figure(history: History) -> Any:
    """The trace as a figure of MuJoCo's."""
    import mujoco

    figure = mujoco.MjvFigure()
    mujoco.mjv_defaultFigure(figure)
    figure.title = "angle [rad] against time [s]"
    figure.flg_extend = 1
    figure.gridsize[:] = 3, 3
    figure.linergb[0][:] = 0.84, 0.37, 0.0
    points = history.points.astype(np.float32)
    figure.linepnt[0] = len(points)
    figure.linedata[0][: 2 * len(points)] = points.ravel()
    return figure
