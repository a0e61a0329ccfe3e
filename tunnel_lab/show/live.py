"""A run in MuJoCo's own viewer."""

from __future__ import annotations

import os
import sys

from tunnel_lab.show.film import ShownRun
from tunnel_sim.engine.model import build_model
from tunnel_sim.vocabulary.errors import TunnelError

_NO_DISPLAY = "use tunnel render for a film"


def missing_display() -> str:
    """The reason why a window cannot be opened; empty if the environment shows no reason."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        return "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set)"
    return ""


def view_in_window(run: ShownRun, *, camera: str, speed: float) -> None:
    """Open MuJoCo's viewer and show the run from its release until the window is closed.

    The viewer's reset ignores the release and the state of the plugin. Its reload uses both.

    Args:
        camera: name of a camera of ``mjcf/rig.xml``.
        speed: factor on real time, at most 1 (ratio).

    Raises:
        TunnelError: when there is no display, or the window cannot be opened.
    """
    missing = missing_display()
    if missing:
        raise TunnelError(missing, where="tunnel view", remedy=_NO_DISPLAY)
    import glfw

    # Checked first: the viewer starts its threads before it opens the window.
    if not glfw.init():
        raise TunnelError("the display cannot be opened", where="tunnel view", remedy=_NO_DISPLAY)
    import mujoco.viewer

    model = build_model(run.rig, run.settings)
    shown = model.mj.vis.global_
    shown.cameraid, shown.realtime = model.mj.camera(camera).id, speed
    mujoco.viewer.launch(
        loader=lambda: (model.mj, model.release_state()), show_left_ui=False, show_right_ui=False
    )
