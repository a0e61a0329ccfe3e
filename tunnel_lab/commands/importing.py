"""``tunnel import``: from files as instruments write them to a campaign."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

NAME = "import"
INPUT, UNITS, RUNS, CONDITIONS, OUTPUT = "Columns", "Units", "Runs", "Conditions", "Output"


def run(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Files of a data logger, of any format.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FOLDER", rich_help_panel=OUTPUT, help="Where the campaign goes."
        ),
    ] = None,
    angle: Annotated[
        list[str] | None,
        typer.Option(
            "--angle",
            metavar="NAME",
            rich_help_panel=INPUT,
            help="Column of the angle, by name or number. May be repeated.",
        ),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            "--unit",
            rich_help_panel=UNITS,
            help="Unit of the angle: rad, mrad, deg, turns, counts, V, deg/s, …",
        ),
    ] = None,
    drive: Annotated[
        str | None,
        typer.Option(
            "--input", metavar="NAME", rich_help_panel=INPUT, help="Column of a driven run's input, or none."
        ),
    ] = None,
    input_as: Annotated[
        str | None,
        typer.Option(
            "--input-as",
            metavar="COLUMN",
            rich_help_panel=INPUT,
            help="What the input is: moment_nm, drive or base_rad.",
        ),
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(
            "--time", metavar="NAME", rich_help_panel=INPUT, help="Column of the times, by name or number."
        ),
    ] = None,
    time_unit: Annotated[
        str | None,
        typer.Option("--time-unit", rich_help_panel=UNITS, help="Unit of the times: s, ms, us, min, …"),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option("--rate", rich_help_panel=UNITS, help="Sample rate, Hz, where there are no times."),
    ] = None,
    counts_per_turn: Annotated[
        float | None,
        typer.Option("--counts-per-turn", rich_help_panel=UNITS, help="Counts of an encoder per turn."),
    ] = None,
    calibration: Annotated[
        str | None,
        typer.Option(
            "--calibration",
            metavar="'a + b*V'",
            rich_help_panel=UNITS,
            help="Volts to angle: a formula, or a file of two columns.",
        ),
    ] = None,
    conditions: Annotated[
        Path | None,
        typer.Option(
            "--conditions",
            metavar="RUNS.csv",
            rich_help_panel=CONDITIONS,
            help="Table of conditions: file or run, wind_speed, …",
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            "--name",
            metavar="PATTERN",
            rich_help_panel=CONDITIONS,
            help="Conditions in the file names: S{spring}_V{wind_speed}_*",
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=NUMBER",
            rich_help_panel=CONDITIONS,
            help="A condition of all runs, or a size. May be repeated.",
        ),
    ] = None,
    start: Annotated[
        float | None, typer.Option("--start", rich_help_panel=RUNS, help="Leave out earlier samples, s.")
    ] = None,
    end: Annotated[
        float | None, typer.Option("--end", rich_help_panel=RUNS, help="Leave out later samples, s.")
    ] = None,
    rest: Annotated[
        float | None,
        typer.Option(
            "--rest", rich_help_panel=CONDITIONS, help="Reading at rest of every run, rad: it is subtracted."
        ),
    ] = None,
    cut: Annotated[
        bool | None,
        typer.Option(
            "--cut/--no-cut", rich_help_panel=RUNS, help="Cut records at releases.", show_default="--cut"
        ),
    ] = None,
    delimiter: Annotated[
        str | None,
        typer.Option(
            "--delimiter", hidden=True, help="Delimiter of a text file: tab, blank, ';', ',' or '|'."
        ),
    ] = None,
    decimal: Annotated[
        str | None, typer.Option("--decimal", hidden=True, help="Decimal sign of a text file.")
    ] = None,
    recipe: Annotated[
        Path | None,
        typer.Option(
            "--recipe", metavar="import.toml", rich_help_panel=INPUT, help="Choices of an earlier import."
        ),
    ] = None,
    preview: Annotated[
        Path | None,
        typer.Option(
            "--preview",
            metavar="FILE.png",
            rich_help_panel=OUTPUT,
            help="Draw what was read; write no campaign.",
        ),
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", rich_help_panel=OUTPUT, help="Write without asking.")
    ] = False,
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite", rich_help_panel=OUTPUT, help="Replace a campaign that is already in the folder."
        ),
    ] = False,
) -> None:
    """Make a campaign from the files of a data logger, a spreadsheet or MATLAB.

    Text of any dialect, Excel, MAT, TDMS, HDF5 and Parquet are read. Columns, units,
    sample rate, runs and releases are found; what was found, and why, is printed
    before anything is written. Options correct what was found wrongly; a recipe also
    states delimiter and decimal sign of a text file. The campaign gets a picture
    (import.png), the choices made (import.toml, for --recipe), and comments in
    campaign.toml on what the files do not state, such as the stiffness.

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
    from tunnel_lab.terminal.outputs import show_import
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.files.importing.conditions import ImportChoices, read_recipe
    from tunnel_sim.files.importing.records import read_records, write_imported
    from tunnel_sim.files.toml_input import validate
    from tunnel_sim.files.writing import refuse_unwritable, write_whole
    from tunnel_sim.vocabulary.errors import TunnelError

    if (out is None) == (preview is None):
        raise TunnelError("give one of them", where="--out, --preview", remedy="name a folder or a picture")
    if preview is not None:
        refuse_unwritable(preview)
    stated = {
        "angle": tuple(angle or ()) or None,
        "unit": unit,
        "input": drive,
        "input_as": input_as,
        "time": time,
        "time_unit": time_unit,
        "rate": rate,
        "counts_per_turn": counts_per_turn,
        "calibration": calibration,
        "name": name,
        "start": start,
        "end": end,
        "rest": rest,
        "cut": cut,
        "delimiter": delimiter,
        "decimal": decimal,
        "conditions": settings_of(settings or []) or None,
    }
    kept = {} if recipe is None else read_recipe(recipe).model_dump(exclude_defaults=True)
    given = kept | {key: value for key, value in stated.items() if value is not None}
    choices = validate(ImportChoices, given, Path("options"))
    imported = read_records(files, choices, conditions=conditions, name=out.resolve().name if out else "")
    show_import(imported)
    if preview is not None:
        write_whole(preview, import_picture(imported))
        say(f"Written: {preview}")
        return
    assert out is not None
    confirm(out, yes=yes)
    write_imported(imported, out, overwrite=overwrite, picture=import_picture)
    count = len(imported.campaign.runs)
    say(f"Written: {out} ({count} run{'s' if count > 1 else ''}, {out / 'import.png'} shows them)")


def settings_of(words: list[str]) -> dict[str, float]:
    """The conditions that ``--set`` states.

    Args:
        words: each of the form ``key=number``, or several of them with commas between.
    """
    from tunnel_sim.files.importing.conditions import parse_setting

    values: dict[str, float] = {}
    for word in words:
        values |= parse_setting(word, "--set").model_dump(exclude_none=True)
    return values


def confirm(out: Path, *, yes: bool) -> None:
    """Ask whether the campaign is to be written.

    Raises:
        TunnelError: when there is no terminal to ask.
        typer.Exit: with status 1 when it is declined.
    """
    from tunnel_sim.vocabulary.errors import TunnelError

    if yes:
        return
    if not sys.stdin.isatty():
        raise TunnelError("cannot be confirmed without a terminal", where=str(out), remedy="add --yes")
    if not typer.confirm(f"Write {out}?", default=True):
        raise typer.Exit(1)
