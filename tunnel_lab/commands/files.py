"""``tunnel import`` and ``export``: a campaign from files of instruments, and as one file for other programs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, make_dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer
from typer import Argument, Option

from tunnel_lab.report.import_table import parts_table
from tunnel_lab.terminal.arguments import LeaveOutOption, ending, output_file, refuse_unwritable_files
from tunnel_lab.terminal.outputs import say, say_sentence, say_written, show
from tunnel_sim.files.importing.choice_options import CHOICES
from tunnel_sim.vocabulary.errors import TunnelError, counted

if TYPE_CHECKING:
    from tunnel_sim.files.importing.choices import ImportChoices
    from tunnel_sim.files.importing.records import Imported

_output = partial(Option, rich_help_panel="Output")
StatedT = TypeVar("StatedT")


def _number(option: str) -> Callable[[str], float]:
    """A parser for a number in an option, which may have a decimal comma."""

    def parsed(text: str) -> float:
        from tunnel_sim.files.importing.choices import option_number

        try:
            return option_number(text, option)
        except ValueError:
            raise TunnelError(f"'{text}' is not a number", where=option, remedy="give a number") from None

    return parsed


def _with_choices(own: type[StatedT]) -> type[StatedT]:
    """A dataclass of options with an option for each entry of `CHOICES` before its own."""
    options: list[tuple[str, Any, Any]] = []
    for key, words in CHOICES.items():
        flag, kind = f"--{key.replace('_', '-')}", words.kind
        option = Option(
            *(() if kind is bool else (flag,)),  # Typer names both options of a truth value
            metavar=words.metavar or None,
            help=words.help,
            parser=_number(flag) if kind is float else None,
            show_default=flag if kind is bool else True,
            rich_help_panel=words.group,
        )
        given: Any = tuple[kind, ...] if words.several else kind | None  # type: ignore[valid-type]  # known when it runs
        options.append((key, Annotated[given, option], () if words.several else None))
    chosen = make_dataclass("ImportOptions", options, frozen=True)
    return dataclass(frozen=True)(type(own.__name__, (own, chosen), {"__doc__": own.__doc__}))


@_with_choices
@dataclass(frozen=True)
class StatedChoices:
    """How files are read, as options; `ImportChoices` has the fields of `CHOICES` and checks the values."""

    table: Annotated[
        Path | None,
        Option(
            "--conditions",
            metavar="RUNS.csv",
            rich_help_panel="Conditions",
            help="Table of conditions: file or run, wind_speed, …",
        ),
    ] = None
    settings: Annotated[
        tuple[str, ...],
        Option(
            "--set",
            metavar="KEY=NUMBER",
            rich_help_panel="Conditions",
            help="A condition of all runs, or a size, also with a unit. KEY=NAME names the column or variable that "
            "states it. May be repeated.",
        ),
    ] = ()
    start: Annotated[
        tuple[str, ...],
        Option(
            "--start",
            metavar="[RUN=]S",
            rich_help_panel="Runs",
            help="First time of all files, or of one run, s. May be repeated.",
        ),
    ] = ()
    end: Annotated[
        tuple[str, ...],
        Option(
            "--end",
            metavar="[RUN=]S",
            rich_help_panel="Runs",
            help="Last time of all files, or of one run, s. May be repeated.",
        ),
    ] = ()
    leave_out: LeaveOutOption = ()
    recipe: Annotated[
        Path | None,
        Option(
            "--recipe",
            metavar="import.toml",
            rich_help_panel="Columns",
            help="Choices of an earlier import.",
        ),
    ] = None

    def choices(self) -> ImportChoices:
        """The choices of the recipe, replaced if an option states another."""
        from tunnel_sim.files.importing.choices import (
            ImportChoices,
            parse_times,
            read_recipe,
            stated_settings,
        )
        from tunnel_sim.files.toml_input import validate

        settings = stated_settings(self.settings, "--set")
        ends = {key: parse_times(getattr(self, key), f"--{key}") for key in ("start", "end")}
        kept = {} if self.recipe is None else read_recipe(self.recipe).model_dump(exclude_defaults=True)
        others = {"table", "settings", "recipe"}
        stated = {name: value for name, value in vars(self).items() if name not in others} | settings
        stretches: dict[str, dict[str, Any]] = {}
        for key, times in ends.items():
            stated[key] = times.pop("", None)
            for run, time in times.items():
                stretches.setdefault(run, {"run": run})[key] = time
        if stretches:
            stated["stretches"] = (*stretches.values(), *kept.get("stretches", ()))
        given = {name: value for name, value in stated.items() if value not in (None, (), {})}
        return validate(ImportChoices, kept | given, Path("options"))


def import_files(
    files: Annotated[
        tuple[Path, ...], Argument(metavar="FILE...", help="Files of a data logger, of any format.")
    ],
    *,
    out: Annotated[
        Path | None, _output("--out", "-o", metavar="FOLDER", help="Where the campaign goes.")
    ] = None,
    stated: StatedChoices,
    preview: Annotated[
        Path | None,
        output_file("--preview", ".png", help="Draw the records; write no campaign.", panel="Output"),
    ] = None,
    yes: Annotated[bool, _output("--yes", "-y", help="Write without asking.")] = False,
    dry_run: Annotated[
        bool, _output("--dry-run", help="Show the files that would be written; write nothing.")
    ] = False,
    overwrite: Annotated[
        bool, _output("--overwrite", help="Replace a campaign that is already in the folder.")
    ] = False,
) -> None:
    """Make a campaign from the files of a data logger, a spreadsheet or MATLAB.

    Text of any dialect, LVM, Excel, MAT, TDMS, HDF5, Parquet, JSON, MDF 4 and logs of
    ROS 2 (MCAP, rosbag2) are read, also compressed (.csv.gz). Columns, units, sample
    rate, runs and releases are detected; the choices and their reasons are printed
    before anything is written, at the end the points to check, each with the option
    that settles it. The campaign has a picture (import.png), the choices
    (import.toml, for --recipe), and comments in campaign.toml on conditions that the
    files do not state, such as the stiffness.

    [bold]Examples[/bold]
      tunnel import log.csv --out my-rig
      tunnel import log.csv --preview import.png
      tunnel import S*.csv --out my-rig --name "S{spring}_V{wind_speed}_*" --set air_density=1.2
      tunnel import shaker.csv --out my-rig --input torque --input-as moment_nm
      tunnel import rig.mat --out my-rig --angle "data[1]" --unit deg
      tunnel import next.csv --out next --recipe my-rig/import.toml --yes

    [bold]Exit status[/bold]
      0 imported, 1 declined, 2 bad input; nothing is left half written.
    """
    from tunnel_lab.plotting.runs import import_picture
    from tunnel_sim.files.campaign_folder import IMPORT_PICTURE
    from tunnel_sim.files.importing.records import read_records
    from tunnel_sim.files.importing.writing import write_imported
    from tunnel_sim.files.writing import write_whole

    if (out is None) == (preview is None):
        raise TunnelError("give one of them", where="--out, --preview", remedy="name a folder or a picture")
    refuse_unwritable_files(preview)
    name = out.resolve().name if out else ""
    imported = read_records(files, stated.choices(), conditions=stated.table, name=name)
    show([parts_table(imported)])
    notes, judged = imported.summary()
    for word, lines in (("Note", notes), ("Check", judged)):
        for line in lines:
            say_sentence(f"{word}: {line}")
    if out is None:
        assert preview is not None
        write_whole(preview, import_picture(imported))
        say_written(preview)
        return
    if dry_run:
        say(_would_be_written(imported, out, overwrite=overwrite))
        return
    if not yes and not sys.stdin.isatty():
        raise TunnelError("cannot be confirmed without a terminal", where=str(out), remedy="add --yes")
    if not yes and not typer.confirm(f"Write {out}?", default=True):
        raise typer.Exit(1)
    write_imported(imported, out, overwrite=overwrite, picture=import_picture)
    count = len(imported.campaign.runs)
    say_written(out, more=counted(count, "run"), picture=out / IMPORT_PICTURE)


def _would_be_written(imported: Imported, out: Path, *, overwrite: bool) -> str:
    """The names of the files that an import would write, and its campaign.toml."""
    from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, IMPORT_PICTURE, check_target
    from tunnel_sim.files.importing.writing import write_imported

    check_target(out, overwrite=overwrite)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / "campaign"
        write_imported(imported, folder)
        names = [path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file()]
        text = (folder / CAMPAIGN_FILE).read_text(encoding="utf-8")
    listed = "\n".join(f"  {out / name}" for name in (*names, Path(IMPORT_PICTURE)))
    return f"Nothing is written. Without --dry-run:\n{listed}\n\n{out / CAMPAIGN_FILE}:\n\n{text.rstrip()}"


def export(
    campaign: Annotated[Path, Argument(help="Folder of the campaign: campaign.toml and its runs.")],
    format: Annotated[
        Literal["mat", "csv", "xlsx", "hdf5"], Option("--file-format", help="Format of the file.")
    ],
    out: Annotated[
        Path | None,
        Option(
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
      tunnel export my-campaign --file-format mat
      tunnel export my-campaign --file-format csv --out all-runs.csv

    [bold]Exit status[/bold]
      0 written, 2 bad input; the file is written completely or not at all.
    """
    from tunnel_sim.files.campaign_folder import read_campaign
    from tunnel_sim.files.exporting import export_campaign
    from tunnel_sim.files.writing import refuse_unwritable

    endings = (".h5", ".hdf5") if format == "hdf5" else (f".{format}",)
    path = ending(*endings)(out) or Path(f"{campaign.resolve().name}{endings[0]}")
    refuse_unwritable(path)
    data = read_campaign(campaign)
    export_campaign(data, path, format)
    count = len(data.runs)
    say(f"Written: {path} ({counted(count, 'run')})")
