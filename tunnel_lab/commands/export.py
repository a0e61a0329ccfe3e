"""``tunnel export``: a campaign as one file for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

NAME = "export"


class ExportFormat(StrEnum):
    """What the file is."""

    MAT = "mat"
    CSV = "csv"
    XLSX = "xlsx"
    HDF5 = "hdf5"


def run(
    campaign: Annotated[Path, typer.Argument(help="Folder of the campaign: campaign.toml and its runs.")],
    format: Annotated[ExportFormat, typer.Option("--format", help="Format of the file.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="The file. Default: the name of the campaign's folder, here."
        ),
    ] = None,
) -> None:
    """Write a campaign as one file: MAT, CSV, Excel or HDF5.

    Times are in s, angles in rad, conditions in SI units. MAT holds a structure
    array runs; HDF5 a group for each run with its conditions as attributes;
    Excel a sheet for each run and one of conditions; CSV one row for each sample
    with the run's id and conditions. tunnel import reads the same runs again.

    [bold]Examples[/bold]
      tunnel export my-campaign --format mat
      tunnel export my-campaign --format csv --out all-runs.csv

    [bold]Exit status[/bold]
      0 written, 2 bad input; the file is written completely or not at all.
    """
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.files.campaign_folder import read_campaign
    from tunnel_sim.files.exporting import export_campaign
    from tunnel_sim.files.writing import refuse_unwritable

    path = out or Path(f"{campaign.resolve().name}.{'h5' if format is ExportFormat.HDF5 else format.value}")
    refuse_unwritable(path)
    data = read_campaign(campaign)
    export_campaign(data, path, format.value)
    count = len(data.runs)
    say(f"Written: {path} ({count} run{'s' if count > 1 else ''})")
