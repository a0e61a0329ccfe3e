"""Pictures of the rig during an episode, off-screen or in MuJoCo's viewer.

A separate model is drawn in the pose of the run, so that one window lasts for all episodes and many runs
share one rendering context.
"""

from __future__ import annotations

import importlib
import os
import sys
import time
from typing import Any

import mujoco
import numpy as np

from tunnel_sim.engine.model import build_model
from tunnel_sim.envs import EnvError
from tunnel_sim.physics.run_settings import RodTwist, RunSettings
from tunnel_sim.vocabulary.arguments import COUNT
from tunnel_sim.vocabulary.errors import did_you_mean
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.rig import Rig

RENDER_MODES = ("human", "rgb_array")
_FILM_QUALITY = (2048, 4)
"""Quality of shadows and edges: it takes a fifth of the time of a still picture, and looks the same at this
size."""

_REMEDY = "install EGL or OSMesa (Debian and Ubuntu: libegl1 or libosmesa6), or set MUJOCO_GL"


class RigView:
    """Draws the rig.

    Args:
        width, height: size of a picture, pixels.
        period: time between two frames in a window, s.
    """

    def __init__(
        self, rig: Rig, mode: str | None, width: int, height: int, camera: str, period: float
    ) -> None:
        if mode is not None and mode not in RENDER_MODES:
            remedy = did_you_mean(str(mode), RENDER_MODES)
            raise EnvError(f"unknown mode {mode!r}", where="render_mode", remedy=remedy)
        for name, pixels in (("width", width), ("height", height)):
            COUNT.checked(pixels, name, "render_mode")
        self._rig, self._mode, self._period = rig, mode, period
        self._width, self._height, self._camera = width, height, camera
        self._model: Any = None
        self._data: Any = None
        self._window: Any = None
        self._canvas: _Canvas | None = None
        self._shown = 0.0

    def draw(self, end: float, twist: float) -> Any:
        """Draw one pose: a picture of shape (height, width, 3), uint8; None in a window.

        Args:
            end: angle of the rod's upper end, rad.
            twist: angle of the body relative to it, rad.
        """
        if self._model is None:
            dynamics = self._rig.dynamics
            settings = RunSettings(
                self._rig.spring(dynamics.default_spring),
                AeroDerivatives(0.0, 0.0),
                dynamics.yaw_inertia,
                dynamics.mechanical_damping,
                rod_twist=RodTwist(1e-3, 0.5),  # two joints, so that any run can be shown
            )
            model = build_model(self._rig, settings).mj
            cameras = [model.camera(i).name for i in range(model.ncam)]
            if self._camera not in cameras:
                remedy = did_you_mean(self._camera, cameras)
                raise EnvError(f"unknown camera {self._camera!r}", where="camera", remedy=remedy)
            model.vis.quality.shadowsize, model.vis.quality.offsamples = _FILM_QUALITY
            model.vis.global_.offwidth = max(self._width, model.vis.global_.offwidth)
            model.vis.global_.offheight = max(self._height, model.vis.global_.offheight)
            self._model, self._data = model, mujoco.MjData(model)
        self._data.qpos[:] = end, twist
        mujoco.mj_forward(self._model, self._data)
        if self._mode == "human":
            if self._window is None:
                if not _has_display():
                    remedy = "use render_mode='rgb_array'"
                    raise EnvError("there is no display", where="render_mode human", remedy=remedy)
                from mujoco import viewer  # imported here because it needs the libraries of a display

                sides = {"show_left_ui": False, "show_right_ui": False}
                self._window = viewer.launch_passive(self._model, self._data, **sides)
                self._shown = time.monotonic()
            self._window.sync()
            wait = self._period - (time.monotonic() - self._shown)  # wait, to show real time
            if wait > 0.0:
                time.sleep(wait)
            self._shown = time.monotonic()
            return None
        if self._canvas is None:
            self._canvas = _Canvas(self._model, self._width, self._height)
        return self._canvas.picture(self._data, self._model.camera(self._camera).id)

    def close(self) -> None:
        """Close the window and the rendering context; a second call does nothing."""
        if self._window is not None:
            self._window.close()
        if self._canvas is not None:
            self._canvas.close()
        self._window = self._canvas = None


def render_modes() -> list[str]:
    """The modes in which this machine can draw: a window needs a display."""
    return [mode for mode in RENDER_MODES if mode != "human" or _has_display()]


def _has_display() -> bool:
    return not sys.platform.startswith("linux") or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


class _Canvas:
    """An off-screen rendering context.

    `mujoco.Renderer` chooses its back end when MuJoCo is first imported, and without a display chooses one that
    needs a window. Here the back end is chosen when the first picture is drawn.
    """

    def __init__(self, model: Any, width: int, height: int) -> None:
        self._model, self._rectangle = model, mujoco.MjrRect(0, 0, width, height)
        self._gl = _context(width, height)
        self._scene = mujoco.MjvScene(model, maxgeom=1000)
        self._camera, self._option = mujoco.MjvCamera(), mujoco.MjvOption()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)

    def picture(self, data: Any, camera: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
        self._gl.make_current()
        self._camera.type, self._camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED.value, camera
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._camera, everything, self._scene)
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        pixels = np.empty((self._rectangle.height, self._rectangle.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rectangle, self._context)
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        self._gl.make_current()
        self._context.free()
        self._gl.free()


def _context(width: int, height: int) -> Any:
    """A current OpenGL context from the first back end that works."""
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    if chosen in ("egl", "osmesa", "glfw", "cgl"):
        names: tuple[str, ...] = (chosen,)
    elif sys.platform == "darwin":
        names = ("cgl",)
    elif sys.platform.startswith("linux"):
        names = ("egl", "osmesa")
    else:
        names = ("glfw",)
    reasons = []
    for name in names:
        try:
            context = importlib.import_module(f"mujoco.{name}").GLContext(width, height)
            context.make_current()
        except (ImportError, OSError, RuntimeError, AttributeError) as error:
            reasons.append(f"{name}: {' '.join(str(error).split())[:80]}")
            if "MUJOCO_GL" not in os.environ and "OpenGL.platform" not in sys.modules:
                os.environ.pop("PYOPENGL_PLATFORM", None)  # set by the failed back end
        else:
            return context
    raise EnvError(f"off-screen rendering does not work here ({'; '.join(reasons)})", remedy=_REMEDY)
