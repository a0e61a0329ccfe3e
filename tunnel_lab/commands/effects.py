"""``tunnel effects``: the vocabulary of effects beyond the nominal model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

NAME = "effects"


def run(
    name: Annotated[
        str | None,
        typer.Argument(help="An effect to show in full. Default: a list of all.", show_default=False),
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the effects as JSON.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option("--markdown", metavar="FILE", help="Write the effects as a reference page.")
    ] = None,
) -> None:
    """List the effects that the nominal model leaves out.

    tunnel simulate injects them by these names, and tunnel diagnose finds them.
    Each effect has a channel (stiffness, damping, forcing, sensor or
    calibration), a condition (always or wind_on), an equation, and parameters
    with units. The first parameter is the severity.

    [bold]Examples[/bold]
      tunnel effects
      tunnel effects coulomb_friction
      tunnel effects --json effects.json

    [bold]Exit status[/bold]
      0 shown, 2 bad input.
    """
    from tunnel_lab.terminal import effect_listing, tables
    from tunnel_lab.terminal.options import refuse_unwritable_files
    from tunnel_sim.effects import ALL_EFFECTS, effect_class
    from tunnel_sim.files.writing import write_json, write_whole

    kinds = ALL_EFFECTS if name is None else (effect_class(name),)
    refuse_unwritable_files(json, markdown)
    written = []
    if json is not None:
        written.append(write_json(json, effect_listing.document(kinds)))
    if markdown is not None:
        written.append(write_whole(markdown, effect_listing.markdown(kinds).encode()))
    tables.say_written(*written)
    if written:
        return
    if name is None:
        tables.show_tables(effect_listing.listing(kinds))
        tables.say(effect_listing.ABOUT_DIRECTIONS)
        tables.say("Details of one effect: tunnel effects NAME")
        return
    for line in effect_listing.lines(kinds[0]):
        tables.say(line)
    tables.show_tables(effect_listing.parameter_table(kinds[0]))
    tables.say(effect_listing.ABOUT_DIRECTIONS)
    tables.say(f"To inject it: tunnel simulate plan.toml --out FOLDER {effect_listing.example(kinds[0])}")
