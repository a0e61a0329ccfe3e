"""``tunnel identify``: the coefficients of a campaign on disk, measured or simulated."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.campaign import Campaign

NAME = "identify"
FEW_RUNS = 3
"""Up to this many runs, the windows are shown without being asked for."""


def run(
    campaign: Annotated[Path, typer.Argument(help="Folder of the campaign: campaign.toml and its runs.")],
    estimator: Annotated[
        str, typer.Option("--estimator", "-e", metavar="NAME", help="output_error or conventional.")
    ] = "output_error",
    json: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Write the estimate as JSON; - for standard output."),
    ] = None,
    windows: Annotated[
        bool | None,
        typer.Option(
            "--windows/--no-windows",
            help="Show ζ and ωn by windows of a few cycles. Default: for up to three runs.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Identify Cnβ, Cnr, Izz and Cr of a campaign, measured or simulated.

    Every run gives its natural frequency ωn (rad/s) and damping ratio ζ. Runs
    with a stated spring, with the wind off and on, together give Cnβ and Cnr
    (1/rad), Izz (kg m²) and Cr (N m s/rad). Without spring_stiffness the runs
    stay in normalised form: ωn and ζ. Every estimate comes with one standard
    deviation, and every note with what to do about it.

    [bold]Estimators[/bold]
      output_error  maximum likelihood over all runs at once (default)
      conventional  the paper's: spectrum, time to half amplitude, each wind-on
                    run paired with a wind-off run of its spring

    [bold]Examples[/bold]
      tunnel identify my-campaign
      tunnel identify my-campaign --estimator conventional --json estimate.json
      tunnel identify my-campaign --json - | jq .cn_beta

    [bold]Exit status[/bold]
      0 identified, 1 nothing could be identified, 2 bad input.
    """
    from identification import identify
    from tunnel_lab.files import json_text, write_json
    from tunnel_lab.tables import say
    from tunnel_sim.campaign_io import read_campaign

    known_estimator(estimator)
    data = read_campaign(campaign)
    estimate = identify(data, estimator, throw=False)
    if json is not None and str(json) == "-":
        typer.echo(json_text(estimate.to_json_dict()), nl=False)
    else:
        if json is not None:
            write_json(json, estimate.to_json_dict())
        show(data, estimate, windows=len(data.runs) <= FEW_RUNS if windows is None else windows)
        if json is not None:
            say(f"Written: {json}")
    if estimate.status.failed:
        raise typer.Exit(1)


def known_estimator(name: str) -> None:
    """Refuse a name that is no estimator's.

    Args:
        name: as typed.

    Raises:
        TunnelError: when there is no such estimator, with the closest name.
    """
    from identification.estimators import ALL_ESTIMATORS
    from tunnel_sim.errors import TunnelError, did_you_mean

    if name not in ALL_ESTIMATORS:
        raise TunnelError(
            f"there is no estimator {name!r}", where="--estimator", remedy=did_you_mean(name, ALL_ESTIMATORS)
        )


def show(campaign: Campaign, estimate: Estimate, *, windows: bool) -> None:
    """Print an estimate.

    Args:
        campaign: what was identified.
        estimate: its estimate.
        windows: whether to show every run's windows, too.
    """
    from tunnel_lab import tables

    tables.show_tables(tables.coefficients_table(estimate), tables.runs_table(campaign, estimate))
    if windows:
        tables.show_tables(*map(tables.windows_table, estimate.runs))
    tables.say(tables.BRACKETS)
    for line in tables.status_lines(estimate):
        tables.say(f"Note: {line}")
