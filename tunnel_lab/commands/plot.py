"""``tunnel plot``: the figures of a campaign on disk, and the fit of a diagnosis over its data."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tunnel_lab.terminal.inputs import HELP as CAMPAIGN_HELP

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tunnel_sim.vocabulary.campaign import Campaign, Run

NAME = "plot"


def run(
    campaign: Annotated[
        Path,
        typer.Argument(help=f"{CAMPAIGN_HELP} Or a file of tunnel diagnose --json, for its fit."),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FOLDER", help="Where the figures go, in a subfolder."),
    ] = Path("tunnel-output"),
    runs: Annotated[
        list[str] | None,
        typer.Option("--run", metavar="ID", help="Runs of a diagnosis to draw. Default: all."),
    ] = None,
) -> None:
    """Draw a campaign: angle traces, spectra, and ζ and ωn against the amplitude.

    Writes traces-1 (twelve runs to a page), spectrum and windows, each as a
    picture (PNG) and for print (PDF), into FOLDER/<name of the campaign's
    folder>. Angles in rad, times in s, spectral density in rad²/Hz.

    Of a diagnosis it writes fit-1 and so on, two runs to a page: what was
    measured, what the nominal model and the model with the causes predict, and
    their residuals in degrees, in the cycles where the models differ most.

    [bold]Examples[/bold]
      tunnel plot my-campaign
      tunnel plot my-campaign --out figures
      tunnel plot answer.json --run r02

    [bold]Exit status[/bold]
      0 drawn, 1 no run could be identified (windows is left out), 2 bad
      input.
    """
    from tunnel_lab.plotting.style import save_both
    from tunnel_lab.terminal.inputs import given_campaign
    from tunnel_lab.terminal.options import split_names
    from tunnel_lab.terminal.tables import say, say_written
    from tunnel_sim.files.writing import output_folder
    from tunnel_sim.vocabulary.errors import TunnelError

    failure = ""
    if campaign.suffix.lower() == ".json":
        drawn = _fit(campaign, split_names(runs))
        folder = output_folder(out / campaign.stem)
    else:
        if runs:
            raise TunnelError("--run is for the file of a diagnosis", remedy="leave it out for a campaign")
        data = given_campaign(campaign)
        folder = output_folder(out / campaign.resolve().name)
        drawn, failure = _campaign(data)
    written = [save_both(figure, folder / f"{name}.png") for name, figure in drawn.items()]
    say_written(*(path for pair in written for path in pair))
    if failure:
        say(f"Note: {failure}", stderr=True)
        raise typer.Exit(1)


def _fit(path: Path, ids: Sequence[str]) -> dict[str, Figure]:
    """The pages of a diagnosis' fit, by name."""
    from tunnel_lab.report.diagnosis_file import read_document
    from tunnel_lab.report.where import fit_pages
    from tunnel_sim.vocabulary.errors import TunnelError, shown

    pages = fit_pages(read_document(path), ids)
    if not pages:
        raise TunnelError("has no curves to draw", where=shown(path), remedy="diagnose the campaign again")
    return {f"fit-{number}": page for number, page in enumerate(pages, 1)}


def _campaign(data: Campaign) -> tuple[dict[str, Figure], str]:
    """The figures of a campaign by name, and why it could not be identified; empty where it could."""
    from identification import identify
    from tunnel_lab.plotting import runs
    from tunnel_lab.plotting.runs import windows_figure

    drawn = {f"traces-{number}": page for number, page in enumerate(runs.trace_pages(data), 1)}
    drawn["spectrum"] = runs.spectrum_figure(spread(data))
    estimate = identify(data, "output_error", throw=False)
    if any(run.windows for run in estimate.runs):
        drawn["windows"] = windows_figure(estimate)
    return drawn, estimate.status.value if estimate.status.failed else ""


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
