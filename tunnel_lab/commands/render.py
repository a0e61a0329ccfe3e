"""``tunnel render``: a run as a film and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tunnel_lab.terminal import options

if TYPE_CHECKING:
    from tunnel_lab.show.film import Look
    from tunnel_lab.show.request import Request

NAME = "render"
_DEFAULT = (Path("tunnel-output/rig.mp4"), Path("tunnel-output/rig.png"))


def run(
    plan: options.PlanArgument = None,
    out: Annotated[
        list[Path] | None,
        typer.Option("--out", "-o", metavar="FILE", help="An .mp4 or .png file. May be repeated."),
    ] = None,
    run_id: options.RunOption = None,
    spring: options.SpringOption = None,
    wind: options.WindOption = None,
    angle: options.AngleOption = None,
    duration: Annotated[float | None, typer.Option("--duration", help="Duration of the run, s.")] = None,
    effect: options.EffectOption = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the noise.")] = None,
    at: Annotated[float, typer.Option("--at", help="Time of the picture, s from the release.")] = 2.0,
    fps: Annotated[int, typer.Option("--fps", min=1, max=120, help="Frames per second of the film.")] = 25,
    speed: Annotated[
        float, typer.Option("--speed", min=0.01, max=100.0, help="Speed of the film; 0.5 is half as fast.")
    ] = 1.0,
    size: Annotated[str, typer.Option("--size", metavar="WIDTHxHEIGHT", help="Pixels.")] = "1280x720",
    camera: Annotated[str, typer.Option("--camera", help="overview, above or side.")] = "overview",
) -> None:
    """Film a run: the oscillating model, and the sensor's reading beside it.

    Writes MP4 (H.264) and PNG files; by default tunnel-output/rig.mp4 and
    tunnel-output/rig.png. Frames are drawn off-screen with EGL or OSMesa; no
    display is needed. A frame takes about a fifth of a second without a graphics
    card.

    [bold]Examples[/bold]
      tunnel render
      tunnel render plan.toml --run s5-v10-a20 --out swing.mp4
      tunnel render --spring 8 --wind 20 --angle 10 --out still.png --at 1.5

    [bold]Exit status[/bold]
      0 written, 2 bad input or no way to render here; nothing is written then.
    """
    from tunnel_lab.show.film import Look, checked_camera, write_still
    from tunnel_lab.show.request import Request, shown_run
    from tunnel_lab.terminal.tables import say_written

    targets = _targets(out)
    look = Look(*_pixels(size), fps=fps, speed=speed, camera=checked_camera(camera))
    request = Request(
        plan=None if plan is None else str(plan),
        run=run_id,
        spring=spring,
        wind_speed=wind,
        release_angle_deg=angle,
        duration=duration,
        effects=tuple(effect or ()),
        seed=seed,
    )
    length = shown_run(request).settings.duration  # refuses bad input before anything is drawn
    for path in targets:
        if path.suffix.lower() == ".png":
            write_still(request, look, path, min(at, length) if out is None else at)
        else:
            _film(request, look, path)
    say_written(*targets)


def _film(request: Request, look: Look, path: Path) -> None:
    """Write the film under a progress bar."""
    from tunnel_lab.show.film import write_film
    from tunnel_lab.terminal.progress import bar

    with bar("drawing frames") as progress:
        write_film(request, look, path, progress)


def _targets(out: list[Path] | None) -> list[Path]:
    """The files to write; those that cannot be written are refused before the work."""
    from tunnel_sim.files.writing import output_folder
    from tunnel_sim.vocabulary.errors import TunnelError, library

    targets = out if out else list(_DEFAULT)
    for path in targets:
        if path.suffix.lower() not in (".mp4", ".png"):
            raise TunnelError(
                "is neither .mp4 nor .png",
                where=f"--out {path}",
                remedy="name a file that ends in one of these",
            )
        if path.suffix.lower() == ".mp4":
            library("imageio_ffmpeg", "a film", "film", f"--out {path}")
        if path.is_dir():
            raise TunnelError("is a folder", where=f"--out {path}", remedy="name a file")
        if not out:
            output_folder(path.parent)
        elif not path.parent.is_dir():
            remedy = "make the folder, or name another file"
            raise TunnelError("its folder does not exist", where=f"--out {path}", remedy=remedy)
    return targets


def _pixels(size: str) -> tuple[int, int]:
    from tunnel_sim.vocabulary.errors import TunnelError

    width, cross, height = size.lower().partition("x")
    numbers = [int(part) if part.isdecimal() else 0 for part in (width, height)]
    if not cross or any(n % 2 or not 160 <= n <= 3840 for n in numbers):
        remedy = "give two even numbers from 160 to 3840, such as 1280x720"
        raise TunnelError(f"{size!r} is not a size", where="--size", remedy=remedy)
    return numbers[0], numbers[1]
