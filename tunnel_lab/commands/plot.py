"""``tunnel plot``: the figures of a campaign on disk."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tunnel_lab.terminal.inputs import HELP as CAMPAIGN_HELP

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.campaign import Campaign, Run

NAME = "plot"


def run(
    campaign: Annotated[Path, typer.Argument(help=CAMPAIGN_HELP)],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FOLDER", help="Where the figures go, in a subfolder."),
    ] = Path("tunnel-output"),
) -> None:
    """Draw a campaign: angle traces, spectra, and ζ and ωn against the amplitude.

    Writes traces-1 (twelve runs to a page), spectrum and windows, each as a
    picture (PNG) and for print (PDF), into FOLDER/<name of the campaign's
    folder>. Angles in rad, times in s, spectral density in rad²/Hz.

    [bold]Examples[/bold]
      tunnel plot my-campaign
      tunnel plot my-campaign --out figures

    [bold]Exit status[/bold]
      0 drawn, 1 no run could be identified (windows is left out), 2 bad
      input.
    """
    from identification import identify
    from tunnel_lab.plotting import runs, style
    from tunnel_lab.plotting.runs import windows_figure
    from tunnel_lab.terminal.inputs import given_campaign
    from tunnel_lab.terminal.tables import say, say_written
    from tunnel_sim.files.writing import output_folder

    data = given_campaign(campaign)
    folder = output_folder(out / campaign.resolve().name)
    drawn = {f"traces-{number}": page for number, page in enumerate(runs.trace_pages(data), 1)}
    drawn["spectrum"] = runs.spectrum_figure(spread(data))
    estimate = identify(data, "output_error", throw=False)
    if any(run.windows for run in estimate.runs):
        drawn["windows"] = windows_figure(estimate)
    written = [style.save_both(figure, folder / f"{name}.png") for name, figure in drawn.items()]
    say_written(*(path for pair in written for path in pair))
    if estimate.status.failed:
        say(f"Note: {estimate.status.value}", stderr=True)
        raise typer.Exit(1)


def spread(campaign: Campaign, count: int = 4) -> tuple[Run, ...]:
    """A few runs that differ in spring and wind, to keep a plot readable.

    Args:
        count: at most this many runs (a count).

    Returns:
        The first runs of distinct spring and wind speed; the first runs where conditions are not stated.
    """
    chosen: dict[object, Run] = {}
    for run in campaign.runs:
        stated = (run.spring_stiffness, run.wind_speed)
        chosen.setdefault(run.id if run.spring_stiffness is None else stated, run)
    return tuple(chosen.values())[:count]
