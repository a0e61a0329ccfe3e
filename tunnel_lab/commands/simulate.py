"""``tunnel simulate``: simulate a campaign."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tunnel_lab.terminal.options import EffectsFileOption

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.campaign import Campaign

NAME = "simulate"


class RunFormat(StrEnum):
    """How the runs are written."""

    PARQUET = "parquet"
    CSV = "csv"


def run(
    plan: Annotated[Path, typer.Argument(help="Plan of the campaign, a TOML file.")],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FOLDER", help="Where the campaign goes.")],
    format: Annotated[
        RunFormat, typer.Option("--format", help="Format of the run files.")
    ] = RunFormat.PARQUET,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of the noise; overrides the plan's.")
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME:PARAMETER=VALUE",
            help="Add an effect to the nominal model; separate further parameters by commas. May be repeated; "
            "tunnel effects lists the effects.",
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a campaign that is already in the folder.")
    ] = False,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture",
            metavar="FILE.png",
            help="Draw the runs, input and response; more than twelve go on further pages, FILE-2.png and so on.",
        ),
    ] = None,
    effects_file: EffectsFileOption = None,
) -> None:
    r"""Simulate a campaign: springs × wind speeds × release angles × repeats.

    The folder then holds campaign.toml, a file for each run (time in s, yaw
    angle in rad), and truth.json with the injected values. The same plan and seed
    give the same campaign, to the last bit.

    A [drive] in the plan adds driven runs, which start at rest: springs × wind
    speeds × amplitudes × repeats. Their files have an input column besides. Kinds
    are sine, stepped_sine, chirp, multisine, random, square and file.

    [bold]A plan[/bold]
      name = "two-speeds"
      seed = 1
      springs = [5, 8]             # of the paper's Table II
      wind_speeds = [0.0, 10.0]    # m/s; 0 is wind-off
      release_angles_deg = [20.0]
      repeats = 1
      duration = 20.0              # s
      truth.cn_beta = 0.495        # 1/rad
      truth.cn_r = -0.114          # 1/rad

    [bold]A drive[/bold]
      drive.kind = "multisine"
      drive.from_hz = 0.5
      drive.to_hz = 5.0
      drive.amplitudes_nm = [0.2]  # N m on the body; amplitudes_rad: the spring's root

    [bold]Examples[/bold]
      tunnel simulate plan.toml --out my-campaign
      tunnel simulate plan.toml --out again --format csv --seed 7
      tunnel simulate plan.toml --out dry \
        --effect coulomb_friction:friction_moment=0.004

    [bold]Exit status[/bold]
      0 written, 2 bad input; nothing is written then.
    """
    from tunnel_lab.terminal.inputs import parse_effect
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import say, say_written
    from tunnel_sim.engine.virtual_campaign import plan_effects, simulate_campaign, truth_document
    from tunnel_sim.files.campaign_folder import write_campaign
    from tunnel_sim.files.plan_file import load_plan
    from tunnel_sim.files.writing import refuse_unwritable
    from tunnel_sim.vocabulary.errors import TunnelError

    del effects_file  # its effects are known already
    added = tuple(parse_effect(text) for text in effect or ())
    loaded = load_plan(plan)
    if seed is not None:
        loaded = replace(loaded, seed=seed)
    loaded = replace(loaded, effects=loaded.effects + added)
    plan_effects(loaded)  # refuses what cannot be injected before anything is simulated
    refuse_occupied(out, overwrite=overwrite)
    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise TunnelError("is not a .png", where=str(picture), remedy="name a file such as runs.png")
        refuse_unwritable(picture)
    with bar("simulating runs", len(loaded.conditions)) as progress:
        campaign = simulate_campaign(loaded, progress=progress)
    folder = write_campaign(
        campaign, out, run_format=format.value, truth=truth_document(loaded), overwrite=overwrite
    )
    say(f"Written: {folder} ({len(campaign.runs)} runs)")
    if picture is not None:
        say_written(*_draw(campaign, picture))


def _draw(campaign: Campaign, path: Path) -> list[Path]:
    """The pages of a campaign's runs."""
    from tunnel_lab.plotting.runs import trace_pages
    from tunnel_lab.plotting.style import save

    pages = enumerate(trace_pages(campaign), 1)
    return [save(page, path if i == 1 else path.with_stem(f"{path.stem}-{i}")) for i, page in pages]


def refuse_occupied(folder: Path, *, overwrite: bool) -> None:
    """Refuse an unsuitable folder before the work is done.

    Args:
        folder: where the campaign is to go.
        overwrite: whether what is there may be replaced.

    Raises:
        TunnelError: when it is a file, or exists and may not be replaced.
    """
    from tunnel_sim.files.writing import clear_leftovers
    from tunnel_sim.vocabulary.errors import TunnelError

    clear_leftovers(folder.resolve().parent)  # restore what a killed command had set aside
    if folder.exists() and not folder.is_dir():
        raise TunnelError("is a file, not a folder", where=str(folder), remedy="name another --out")
    if folder.exists() and not overwrite:
        raise TunnelError("exists already", where=str(folder), remedy="name another --out or add --overwrite")
