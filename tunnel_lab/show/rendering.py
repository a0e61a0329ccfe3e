"""A picture of the rig, rendered off-screen.

Rendering needs an OpenGL back end, which many machines lack, and a missing back end may end the whole process.
Therefore the picture is made in a child process, trying one back end after another, and a failure is returned
as a reason, not raised.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

TIMEOUT_S = 60.0
"""Time limit of a back end for one picture, s."""

SHOWN_ANGLE_DEG = 20.0
"""The yaw angle of the model in the picture, degrees: the largest release of the paper's campaign."""

REMEDY = "install EGL or OSMesa (Debian and Ubuntu: libegl1 or libosmesa6) to get the picture"


def backends() -> tuple[str, ...]:
    """The OpenGL back ends to try, best first.

    Returns:
        Values for ``MUJOCO_GL``; only the user's own choice where that variable is set, and an empty
        string (MuJoCo's default) where the platform has only one.
    """
    chosen = os.environ.get("MUJOCO_GL")
    if chosen:
        return (chosen,)
    if not sys.platform.startswith("linux"):
        return ("",)
    return ("egl", "osmesa", "glfw") if os.environ.get("DISPLAY") else ("egl", "osmesa")


def render_rig(path: Path, *, width: int = 1280, height: int = 800, camera: str = "overview") -> str:
    """Draw the rig with its model at a release angle as a PNG.

    Args:
        width: of the picture, pixels.
        height: of the picture, pixels.
        camera: name of a camera of ``mjcf/rig.xml``.

    Returns:
        Empty when the picture was written; otherwise why not, with the remedy.
    """
    reasons = []
    for backend in backends():
        environment = {**os.environ, "MUJOCO_GL": backend} if backend else dict(os.environ)
        arguments = [
            sys.executable,
            "-m",
            "tunnel_lab.show.rendering",
            str(path),
            str(width),
            str(height),
            camera,
        ]
        try:
            outcome = subprocess.run(  # our own interpreter and module, no shell
                arguments, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
            )
        except subprocess.TimeoutExpired:
            reasons.append(f"{backend or 'default'}: no answer in {TIMEOUT_S:.0f} s")
            continue
        if outcome.returncode == 0:
            return ""
        last = (outcome.stderr.strip().splitlines() or [f"ended with status {outcome.returncode}"])[-1]
        reasons.append(f"{backend or 'default'}: {last[:80]}")
    return f"off-screen rendering does not work here ({'; '.join(reasons)}); {REMEDY}"


def _draw(path: Path, width: int, height: int, camera: str) -> None:
    """Render in this process; an error ends it."""
    from math import radians

    import mujoco
    from matplotlib import image

    from tunnel_sim.engine.model import build_model
    from tunnel_sim.files.rig_file import load_rig
    from tunnel_sim.files.writing import write_encoded
    from tunnel_sim.physics.run_settings import RunSettings
    from tunnel_sim.vocabulary.aero import AeroDerivatives

    rig = load_rig()
    settings = RunSettings(
        rig.spring(rig.dynamics.default_spring),
        AeroDerivatives(0.0, 0.0),
        rig.dynamics.yaw_inertia,
        rig.dynamics.mechanical_damping,
        release_angle=radians(SHOWN_ANGLE_DEG),
    )
    model = build_model(rig, settings)
    model.mj.vis.global_.offwidth = max(width, model.mj.vis.global_.offwidth)
    model.mj.vis.global_.offheight = max(height, model.mj.vis.global_.offheight)
    data = model.release_state()
    mujoco.mj_forward(model.mj, data)
    with mujoco.Renderer(model.mj, height, width) as renderer:
        renderer.update_scene(data, camera=camera)
        picture = renderer.render()
    write_encoded(path, lambda stream: image.imsave(stream, picture, format="png"))


if __name__ == "__main__":
    _draw(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
