"""``tunnel plot``, ``view``, ``render`` and ``bench``: figures of a campaign, the rig to look at, and a page."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from tunnel_lab.show.request import Request
from tunnel_lab.terminal.arguments import HELP as CAMPAIGN_HELP
from tunnel_lab.terminal.arguments import given_campaign, split_names
from tunnel_lab.terminal.outputs import say, say_written
from tunnel_lab.terminal.progress import bar
from tunnel_sim.files.reading import as_described
from tunnel_sim.vocabulary.errors import TunnelError, installing, library, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tunnel_sim.vocabulary.campaign import Campaign, Run


_DEFAULT = (Path("tunnel-output/rig.mp4"), Path("tunnel-output/rig.png"))


def plot(
    campaign: Annotated[
        Path, Argument(help=f"{CAMPAIGN_HELP} Or a file of tunnel diagnose --json, for its figures.")
    ],
    names: Annotated[
        tuple[str, ...],
        Argument(metavar="[FIGURE]...", help="Figures of a diagnosis. Default: fit and repeatability."),
    ] = (),
    out: Annotated[
        Path, Option("--out", "-o", metavar="FOLDER", help="Where the figures go, in a subfolder.")
    ] = Path("tunnel-output"),
    runs: Annotated[
        tuple[str, ...],
        Option(
            "--run",
            metavar="ID",
            help="Runs of a diagnosis to draw. Default: all.",
            callback=split_names,
        ),
    ] = (),
) -> None:
    """Draw a campaign: angle traces, spectra, and ζ and ωn against the amplitude.

    Writes traces-1 (twelve runs to a page), spectrum and windows, each as a
    picture (PNG) and for print (PDF), into FOLDER/<name of the campaign's
    folder>. Angles in rad, times in s, spectral density in rad²/Hz.

    For a diagnosis it writes fit-1 and so on, two runs to a page: the measured
    readings, the predictions of the nominal model and of the model with the
    causes, and their residuals in degrees, in the cycles where the models differ
    most. It also writes repeatability: frequency and damping of every run minus
    the model's, in per cent, with the scatter between runs. Other figures of the
    report are drawn by name, such as waterfall or where-backbones.

    [bold]Examples[/bold]
      tunnel plot my-campaign
      tunnel plot my-campaign --out figures
      tunnel plot answer.json --run r02
      tunnel plot answer.json repeatability waterfall

    [bold]Exit status[/bold]
      0 drawn, 1 no run could be identified (no figure of windows), 2 bad input.
    """
    from identification import identify
    from identification.show.style import save_both
    from tunnel_lab.plotting import runs as figures
    from tunnel_sim.files.writing import output_folder

    failure = ""
    if campaign.suffix.lower() == ".json":
        drawn = _of_diagnosis(campaign, names, runs)
        folder = output_folder(out / campaign.stem)
    else:
        if runs:
            raise TunnelError("--run is for the file of a diagnosis", remedy="leave it out for a campaign")
        if names:
            what = f"the figure {names[0]!r} is one of a diagnosis"
            raise TunnelError(what, where=shown(campaign), remedy="give the file of tunnel diagnose --json")
        data = given_campaign(campaign)
        folder = output_folder(out / campaign.resolve().name)
        drawn = {f"traces-{number}": page for number, page in enumerate(figures.trace_pages(data), 1)}
        drawn["spectrum"] = figures.spectrum_figure(spread(data), data.sensor.freedom)
        estimate = identify(data, "output_error", throw=False)
        if any(run.windows for run in estimate.runs):
            drawn["windows"] = figures.windows_figure(estimate)
        failure = estimate.status.value if estimate.status.failed else ""
    written = [save_both(figure, folder / f"{name}.png") for name, figure in drawn.items()]
    say_written(*(path for pair in written for path in pair))
    if failure:
        say(f"Note: {failure}", stderr=True)
        raise typer.Exit(1)


def _of_diagnosis(file: Path, names: tuple[str, ...], runs: tuple[str, ...]) -> dict[str, Figure]:
    """Figures of a diagnosis by the name of their file.

    Raises:
        TunnelError: for an unknown figure or run, or a diagnosis without curves.
    """
    from diagnosis.findings.fit_view import fit_pages
    from tunnel_lab.report import draw
    from tunnel_lab.report.diagnosis_file import read_diagnosis

    answer, drawn = read_diagnosis(file), dict[str, "Figure"]()
    where, again = shown(file), "diagnose the campaign again"
    with as_described("cannot be drawn", where, again):
        if not names or "fit" in names:
            pages = fit_pages(answer.maps, runs)
            if not pages:
                raise TunnelError("has no curves to draw", where=where, remedy=again)
            drawn = {f"fit-{number}": page for number, page in enumerate(pages, 1)}
        drawn |= {name: draw(answer, name) for name in names if name != "fit"}
        if not names and "repeatability" in answer.pictures:
            drawn["repeatability"] = draw(answer, "repeatability")
    return drawn


def spread(campaign: Campaign, count: int = 4) -> tuple[Run, ...]:
    """A few runs that differ in spring and wind, to keep a plot readable.

    Args:
        count: maximum number of runs.

    Returns:
        The first runs of distinct spring and wind speed; the first runs if conditions are not stated.
    """
    chosen: dict[object, Run] = {}
    for run in campaign.runs:
        stated = (run.spring_stiffness, run.wind_speed)
        chosen.setdefault(run.id if run.spring_stiffness is None else stated, run)
    return tuple(chosen.values())[:count]


def view(
    *,
    request: Annotated[
        Request, {"duration": "Duration of drawn effects, s.", "seed": "Seed of random effects."}
    ],
    speed: Annotated[float, Option("--speed", min=0.001, max=1.0, help="Factor on real time.")] = 1.0,
    camera: Annotated[
        str, Option("--camera", help="overview, above or side: where the view begins.")
    ] = "overview",
) -> None:
    """Watch the rig in real time, in MuJoCo's viewer.

    Space pauses, Ctrl+L releases the model again, - and = change the speed, the mouse
    turns the view, and F1 lists all keys. The window needs a display.

    [bold]Examples[/bold]
      tunnel view
      tunnel view plan.toml --run s5-v10-a20 --speed 0.5
      tunnel view --spring 8 --effect coulomb_friction:friction_moment=0.01

    [bold]Exit status[/bold]
      0 closed, 2 bad input or no display, 130 interrupted.
    """
    from tunnel_lab.show.film import checked_camera, shown_run

    name = checked_camera(camera)
    run = shown_run(request)
    from tunnel_lab.show.live import view_in_window  # refusals need no engine

    view_in_window(run, camera=name, speed=speed)


def render(
    *,
    out: Annotated[
        tuple[Path, ...],
        Option("--out", "-o", metavar="FILE", help="An .mp4 or .png file. May be repeated."),
    ] = (),
    request: Request,
    at: Annotated[float, Option("--at", help="Time of the picture, s from the release.")] = 2.0,
    fps: Annotated[int, Option("--fps", min=1, max=120, help="Frames per second of the film.")] = 25,
    speed: Annotated[
        float, Option("--speed", min=0.01, max=100.0, help="Speed of the film; 0.5 is half as fast.")
    ] = 1.0,
    size: Annotated[str, Option("--size", metavar="WIDTHxHEIGHT", help="Pixels.")] = "1280x720",
    camera: Annotated[str, Option("--camera", help="overview, above or side.")] = "overview",
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
    from tunnel_lab.show.film import Look, checked_camera, shown_run, write_film
    from tunnel_sim.files.writing import output_folder

    targets = out or _DEFAULT
    for path in targets:
        where = f"--out {path}"  # unwritable files are refused before the work is done
        if path.suffix.lower() not in (".mp4", ".png"):
            raise TunnelError(
                "is neither .mp4 nor .png", where=where, remedy="name a file that ends in one of these"
            )
        if path.suffix.lower() == ".mp4":
            library("imageio_ffmpeg", "a film", "film", where)
        if path.is_dir():
            raise TunnelError("is a folder", where=where, remedy="name a file")
        if not out:
            output_folder(path.parent)
        elif not path.parent.is_dir():
            remedy = "make the folder, or name another file"
            raise TunnelError("its folder does not exist", where=where, remedy=remedy)
    width, cross, height = size.lower().partition("x")
    pixels = [int(part) if part.isdecimal() else 0 for part in (width, height)]
    if not cross or any(n % 2 or not 160 <= n <= 3840 for n in pixels):
        remedy = "give two even numbers from 160 to 3840, such as 1280x720"
        raise TunnelError(f"{size!r} is not a size", where="--size", remedy=remedy)
    look = Look(pixels[0], pixels[1], fps=fps, speed=speed, camera=checked_camera(camera))
    length = shown_run(request).settings.duration  # refuses bad input before anything is drawn
    for path in targets:
        if path.suffix.lower() == ".png":
            write_film(request, look, path, at=at if out else min(at, length))
        else:
            with bar("drawing frames") as progress:
                write_film(request, look, path, progress)
    say_written(*targets)


def bench(
    folder: Annotated[Path, Argument(help="Folder of campaigns, or a campaign to open.")] = Path(),
    port: Annotated[
        int, Option("--port", metavar="N", min=0, max=65535, help="TCP port; 0 takes a free one.")
    ] = 0,
    browser: Annotated[bool, Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    r"""Go from a logger's files to a report in the browser.

    Each stage does the work of a command and writes the same files: drop records
    (import), state the conditions, identify, diagnose, find the run that would
    distinguish the answers, and write the report. You can continue in a terminal
    at any point. The address of the page contains a secret, so that only you can
    open it. It needs the extra bench (.venv/bin/pip install '.[bench]' in the clone
    of the project), and no network.

    [bold]Examples[/bold]
      tunnel bench
      tunnel bench campaigns --port 8050 --no-browser
      tunnel bench campaigns/my-rig

    [bold]Exit status[/bold]
      0 ended, by Ctrl-C; 2 bad input.
    """
    from importlib.util import find_spec
    from urllib.parse import quote

    from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE
    from tunnel_sim.files.writing import output_folder

    if find_spec("nicegui") is None:
        remedy = f"run {installing('bench')}"
        raise TunnelError("NiceGUI is not installed", where="tunnel bench", remedy=remedy)
    if find_spec("fcntl") is None:  # the bench follows its processes by locks
        raise TunnelError("needs Linux or macOS", where="tunnel bench", remedy="use the commands")
    from tunnel_lab.bench.server import serve

    if not folder.is_dir():
        quoted = shlex.quote(str(folder))
        remedy = f"make it with: mkdir -p {quoted}, or leave FOLDER out for the current folder"
        raise TunnelError("there is no such folder", where=shown(folder), remedy=remedy)
    opened = (folder / CAMPAIGN_FILE).is_file()
    campaign = folder.resolve()
    serve(
        output_folder(campaign.parent if opened else folder),
        port=port,
        browser=browser,
        first=f"/{quote(campaign.name)}/records" if opened else "/",
    )
