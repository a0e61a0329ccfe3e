"""A run from a plan or from a few options, and its film: the model beside the trace of its angle.

Frames are rendered off-screen with OpenGL. Many machines lack some of its back ends, and a missing back end may
end the whole process. Therefore a child process draws, trying one back end after another. The trace is drawn
twice, faint and full; every frame shows the full trace up to its time.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from math import degrees, isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from identification.show.style import with_breaks
from tunnel_lab.show.request import Request
from tunnel_lab.terminal.arguments import parse_effect
from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.files.writing import write_whole
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, SensorModel, Truth
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.rig import Rig

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tunnel_sim.effects import EffectChain


Image = NDArray[np.uint8]
CAMERAS = ("overview", "above", "side")
BODY_SHARE = 0.52
"""Share of the width for the picture of the model."""
FIRST_FRAME_S = 60.0
"""Time limit of a back end for its first frame, s."""
_SHADOW, _SAMPLES = 2048, 4  # quality for a film: a quarter of a still's time, without visible difference

REMEDY = "install EGL or OSMesa (Debian and Ubuntu: libegl1 or libosmesa6) to get the picture"
_DPI = 100
_DOT = 5  # pixels
_CURSOR = (90, 90, 90)
_VERMILION = (213, 94, 0)


PAPER = {"cn_beta": 0.4719, "cn_r": -0.1033}
"""Coefficients for a run without a plan, 1/rad: the paper's Table IV, neural network."""


@dataclass(frozen=True)
class ShownRun:
    """A run ready to be simulated."""

    rig: Rig
    chain: EffectChain
    sensor: SensorModel
    title: str
    seed: int

    @cached_property
    def settings(self) -> RunSettings:
        """The run's physics, effects included."""
        from tunnel_sim.physics.steps import follow_fastest

        return follow_fastest(self.rig, self.chain.physics())

    def record(self) -> Record:
        """The potentiometer's reading; each call simulates it with bit-identical results."""
        from tunnel_sim.effects.chain import read_motion
        from tunnel_sim.engine.model import build_model
        from tunnel_sim.engine.simulate import simulate_motion

        motion = simulate_motion(build_model(self.rig, self.settings), self.sensor.sample_rate)
        return read_motion(motion, self.sensor, np.random.default_rng([self.seed, 1]), self.chain)


def shown_run(request: Request) -> ShownRun:
    """Prepare a run; a `TunnelError` for a bad plan, an unknown run, spring or effect, or a number out of range."""
    from tunnel_sim.effects import EffectChain
    from tunnel_sim.engine.virtual_campaign import plan_effects, run_settings

    rig = load_rig()
    if request.plan is None:
        dynamics = rig.dynamics
        condition = Condition(
            id="run",
            spring_stiffness=rig.spring(dynamics.default_spring),
            wind_speed=10.0,
            air_density=rig.air.density,
            release_angle=radians(20.0),
            duration=10.0,
        )
        truth = Truth(
            **PAPER, yaw_inertia=dynamics.yaw_inertia, mechanical_damping=dynamics.mechanical_damping
        )
        plan = CampaignPlan("run", 1, truth, (condition,))
    else:
        plan = load_plan(request.plan)
    if request.seed is not None:
        plan = replace(plan, seed=request.seed)
    added = tuple(parse_effect(text) for text in request.effects)
    condition = plan.conditions[0]
    if request.run is not None:
        if request.plan is None:
            raise TunnelError(
                "there is no plan", where=f"--run {request.run}", remedy="name the plan of this run"
            )
        by_id = {condition.id: condition for condition in plan.conditions}
        if request.run not in by_id:
            raise TunnelError(
                f"has no run {request.run!r}",
                where=str(request.plan),
                remedy=did_you_mean(request.run, by_id),
            )
        condition = by_id[request.run]
    speed = _number("--wind", request.wind_speed, condition.wind_speed, 0.0, 60.0, "m/s")
    released = degrees(condition.release_angle)
    angle = _number("--angle", request.release_angle_deg, released, -60.0, 60.0, "degrees")
    condition = replace(
        condition,
        wind_speed=speed,
        release_angle=condition.release_angle if request.release_angle_deg is None else radians(angle),
        duration=_number("--duration", request.duration, condition.duration, 0.5, 600.0, "s"),
        spring_stiffness=condition.spring_stiffness if request.spring is None else rig.spring(request.spring),
    )
    # keep only this run, so that effects are checked against its spring alone
    plan = replace(plan, effects=plan.effects + added, conditions=(condition,))
    stated = run_settings(plan.truth, condition, sample_rate=plan.sensor.sample_rate)
    effects = plan_effects(plan)
    chain = EffectChain.draw(stated, effects, np.random.default_rng([plan.seed, 0]))
    wind = f"{condition.wind_speed:g} m/s" if condition.wind_speed > 0.0 else "wind off"
    names = "".join(f", {effect.name.replace('_', ' ')}" for effect in effects if not effect.is_null)
    start = "driven" if condition.drive else f"released at {degrees(condition.release_angle):.3g}°"
    title = f"{condition.spring_stiffness:g} N m/rad, {wind}, {start}{names}"
    return ShownRun(rig, chain, plan.sensor, title, plan.seed)


def _number(option: str, given: float | None, plan: float, low: float, high: float, unit: str) -> float:
    if given is None:
        return plan
    if not (isfinite(given) and low <= given <= high):
        raise TunnelError(
            f"{given:g} is out of range", where=option, remedy=f"give {low:g} to {high:g} {unit}"
        )
    return given


def backends() -> tuple[str, ...]:
    """The OpenGL back ends to try, best first: values for ``MUJOCO_GL``.

    If that variable is set, only its value; if the platform has only one back end, an empty string (MuJoCo's
    default).
    """
    chosen = os.environ.get("MUJOCO_GL")
    if chosen:
        return (chosen,)
    if not sys.platform.startswith("linux"):
        return ("",)
    return ("egl", "osmesa", "glfw") if os.environ.get("DISPLAY") else ("egl", "osmesa")


def checked_camera(name: str) -> str:
    """The name of a camera; a `TunnelError` with the closest name when the rig does not have this camera."""
    if name not in CAMERAS:
        raise TunnelError(
            f"there is no camera {name!r}", where="--camera", remedy=did_you_mean(name, CAMERAS)
        )
    return name


@dataclass(frozen=True)
class Look:
    """The appearance of a film or a picture.

    Args:
        width: width, pixels, even.
        height: height, pixels, even.
        fps: frames per second of the film.
        speed: speed of the film as a ratio; 0.5 is half as fast as the run.
        camera: name of a camera of ``mjcf/rig.xml``.
        trace: whether the trace is shown beside the model.
    """

    width: int = 1280
    height: int = 720
    fps: int = 25
    speed: float = 1.0
    camera: str = "overview"
    trace: bool = True


def write_film(
    request: Request,
    look: Look,
    path: Path,
    progress: Callable[[int, int], None] | None = None,
    *,
    at: float | None = None,
) -> None:
    """Write a run as MP4 (H.264), or one frame of it as PNG, completely or not at all.

    A child process draws into a temporary folder; the result is then moved to its place.

    Args:
        progress: function called with (frames done, frames in all).
        at: time of the frame, s from the release; None for the film.

    Raises:
        TunnelError: when the machine cannot render off-screen, the file cannot be written, or the run is shorter.
    """
    duration = shown_run(request).settings.duration
    if at is not None and not 0.0 <= at <= duration:
        raise TunnelError(f"{at:g} s is not in the run", where="--at", remedy=f"give 0 to {duration:g} s")
    order = {"request": asdict(request), "look": asdict(look), "at": at}
    reasons = []
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / f"drawn{'.png' if at is not None else '.mp4'}"
        for backend in backends():
            reason = _one_backend(backend, {**order, "path": str(target)}, progress)
            if not reason:
                write_whole(path, target.read_bytes())
                return
            reasons.append(f"{backend or 'default'}: {reason}")
    raise TunnelError(f"off-screen rendering does not work here ({'; '.join(reasons)})", remedy=REMEDY)


def _one_backend(backend: str, order: dict[str, Any], progress: Callable[[int, int], None] | None) -> str:
    """Draw with one back end; return an empty text on success, else the reason."""
    import threading

    environment = {**os.environ, "MUJOCO_GL": backend} if backend else dict(os.environ)
    arguments = [
        sys.executable,
        "-m",
        "tunnel_lab.show.film",
        json.dumps(order, default=str),  # paths
    ]  # a module of this package, without a shell
    silent = threading.Event()
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(
            arguments, env=environment, stdout=subprocess.PIPE, stderr=errors, text=True
        ) as child,
    ):

        def give_up() -> None:
            silent.set()
            child.kill()

        patience = threading.Timer(FIRST_FRAME_S, give_up)
        patience.start()
        try:
            assert child.stdout is not None
            for line in child.stdout:
                patience.cancel()
                done, _, total = line.partition("/")
                if progress is not None and total.strip().isdigit():
                    progress(int(done), int(total))
            child.wait()
        finally:  # also when interrupted: `Popen` would then wait for only a quarter of a second
            patience.cancel()
            child.kill()
            child.wait()
        if silent.is_set():
            return f"no answer in {FIRST_FRAME_S:.0f} s"
        if child.returncode == 0:
            return ""
        errors.seek(0)
        lines = errors.read().strip().splitlines()
    return (lines or [f"ended with status {child.returncode}"])[-1][:80]


def frames(run: ShownRun, look: Look, times: NDArray[np.float64]) -> Iterator[Image]:
    """Pictures of the run; needs OpenGL in this process.

    Args:
        times: times of the frames, ascending, shape (frames,), s from the release.

    Yields:
        RGB, shape (height, width, 3).
    """
    import mujoco

    from tunnel_sim.engine.model import build_model

    model = build_model(run.rig, run.settings)
    width = 2 * round(BODY_SHARE * look.width / 2) if look.trace else look.width
    trace = draw_trace(run.record(), look.width - width, look.height, run.title) if look.trace else None
    model.mj.vis.global_.offwidth = max(width, model.mj.vis.global_.offwidth)
    model.mj.vis.global_.offheight = max(look.height, model.mj.vis.global_.offheight)
    model.mj.vis.quality.shadowsize = _SHADOW
    model.mj.vis.quality.offsamples = _SAMPLES
    data = model.release_state()
    with mujoco.Renderer(model.mj, look.height, width) as renderer:
        for time in times:
            steps = round(time / run.settings.timestep) - round(data.time / run.settings.timestep)
            if steps > 0:
                mujoco.mj_step(model.mj, data, steps)
            mujoco.mj_forward(model.mj, data)
            renderer.update_scene(data, camera=look.camera)
            picture = renderer.render()
            yield picture if trace is None else np.concatenate((picture, trace.at(float(time))), axis=1)


@dataclass(frozen=True, eq=False)
class DrawnAxes:
    """Two drawings of the same axes, and the positions of the samples.

    Args:
        faint: the whole trace in grey, shape (height, width, 3).
        full: the whole trace in colour, shape (height, width, 3).
        time: times of the samples, shape (n,), s.
        columns: positions of the samples, shape (n,), pixels from the left.
        rows: positions of the samples, shape (n,), pixels from the top.
        top: first row of the axes, pixels.
        bottom: last row, pixels.
    """

    faint: Image
    full: Image
    time: Array
    columns: Array
    rows: Array
    top: int
    bottom: int

    def at(self, time: float) -> Image:
        """The trace up to a time in s from the release, RGB, shape (height, width, 3)."""
        picture = self.faint.copy()
        column = round(float(np.interp(time, self.time, self.columns)))
        row = round(float(np.interp(time, self.time, self.rows)))
        picture[:, : column + 1] = self.full[:, : column + 1]
        picture[self.top : self.bottom, column] = _CURSOR
        down, across = np.ogrid[: picture.shape[0], : picture.shape[1]]
        picture[(down - row) ** 2 + (across - column) ** 2 <= _DOT**2] = _VERMILION
        return picture


def draw_trace(record: Record, width: int, height: int, title: str) -> DrawnAxes:
    """Draw a record's axes once; width and height in pixels."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    figure.set_layout_engine("constrained", w_pad=0.15, h_pad=0.1)  # inches
    canvas: Any = FigureCanvasAgg(figure)  # only partly typed by matplotlib
    axes = figure.add_subplot()
    time, angle = record.time_s - record.time_s[0], record.yaw_rad
    (line,) = axes.plot(*with_breaks(time, angle), color="0.85", linewidth=1.2)
    axes.set_xlim(time[0], time[-1])
    axes.set_xlabel("time [s]")
    axes.set_ylabel("angle β [rad]")
    axes.set_title(title, fontsize=10, wrap=True)
    axes.grid(alpha=0.3)
    faint = _pixels(canvas)
    line.set_color("#0072B2")
    full = _pixels(canvas)
    places = axes.transData.transform(np.column_stack((time, angle)))
    box = axes.get_window_extent()
    return DrawnAxes(
        faint,
        full,
        time,
        np.clip(places[:, 0], 0.0, width - 1.0),
        np.clip(height - 1.0 - places[:, 1], 0.0, height - 1.0),
        round(height - box.y1),
        round(height - box.y0),
    )


def _pixels(canvas: Any) -> Image:
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3], dtype=np.uint8)


def _draw(order: dict[str, Any]) -> None:
    """Draw in this process; an error ends it."""
    run = shown_run(Request.from_json_dict(order["request"]))
    look, path = Look(**order["look"]), Path(order["path"])
    if order["at"] is not None:
        from matplotlib import image

        (picture,) = frames(run, look, np.array([float(order["at"])]))
        image.imsave(path, picture, format="png")
        return
    import imageio.v2 as imageio

    count = max(1, int(run.settings.duration * look.fps / look.speed))
    times = np.arange(count) * look.speed / look.fps
    writer: Any = imageio.get_writer(
        path, format="FFMPEG", mode="I", fps=look.fps, codec="libx264", quality=7, macro_block_size=2
    )
    with writer:
        for number, frame in enumerate(frames(run, look, times), 1):
            writer.append_data(frame)
            print(f"{number}/{len(times)}", flush=True)


if __name__ == "__main__":
    _draw(json.loads(sys.argv[1]))
