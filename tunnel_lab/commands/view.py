"""``tunnel view``: the rig in real time, in a window or a browser."""

from __future__ import annotations

from typing import Annotated

import typer

from tunnel_lab.terminal import options

NAME = "view"


def run(
    plan: options.PlanArgument = None,
    run_id: options.RunOption = None,
    spring: options.SpringOption = None,
    wind: options.WindOption = None,
    angle: options.AngleOption = None,
    effect: options.EffectOption = None,
    duration: Annotated[
        float | None, typer.Option("--duration", help="Time until the next release, s.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of random effects.")] = None,
    speed: Annotated[
        float, typer.Option("--speed", min=0.01, max=100.0, help="Factor on real time; window only.")
    ] = 1.0,
    camera: Annotated[
        str, typer.Option("--camera", help="overview, above or side: where the view begins.")
    ] = "overview",
    web: Annotated[bool, typer.Option("--web", help="Show it in a browser instead of a window.")] = False,
    port: Annotated[
        int,
        typer.Option("--port", min=0, max=65535, help="Port of --web; 0 takes the first free one from 8080."),
    ] = 0,
    browser: Annotated[bool, typer.Option("--browser", help="With --web: open a browser tab.")] = False,
) -> None:
    """Watch the rig in real time; the model is released again when a run is over.

    In the window (MuJoCo's viewer) space pauses, R releases the model again and the
    mouse turns the view; a figure shows the angle. The window needs a display.

    --web serves the same to a browser (MuJoCo Studio's web viewer, WebGL 2), which
    has controls for pause, speed and reset, and shows trace, wind speed and its
    address. It needs no display. It listens on all network interfaces, asks for no
    password and does not check the Origin of a page: use it only in a network that
    you trust.

    [bold]Examples[/bold]
      tunnel view
      tunnel view plan.toml --run s5-v10-a20 --speed 0.5
      tunnel view --spring 8 --effect coulomb_friction:friction_moment=0.01
      tunnel view --web --port 8080

    [bold]Exit status[/bold]
      0 closed, 2 bad input, no display or no free port, 130 interrupted.
    """
    from tunnel_lab.show.film import checked_camera
    from tunnel_lab.show.request import Request, shown_run
    from tunnel_sim.vocabulary.errors import TunnelError

    file, effects = None if plan is None else str(plan), tuple(effect or ())
    request = Request(file, run_id, spring, wind, angle, duration, effects, seed)
    if not web and (port or browser):
        raise TunnelError("needs --web", where="--port" if port else "--browser", remedy="add --web")
    name = checked_camera(camera)
    shown = shown_run(request)
    if web:
        from tunnel_lab.show.live import view_in_browser

        view_in_browser(shown, port=port, camera=name, open_browser=browser)
    else:
        from tunnel_lab.show.live import view_in_window

        view_in_window(shown, camera=name, speed=speed)
