"""``tunnel effects``: the vocabulary of effects beyond the nominal model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tunnel_lab.terminal.options import EffectsFileOption

if TYPE_CHECKING:
    from tunnel_sim.effects import Effect

NAME = "effects"


def run(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME | check NAME]",
            help="An effect to show in full, or to check. Default: a list of all.",
            show_default=False,
        ),
    ] = None,
    checked: Annotated[str | None, typer.Argument(hidden=True)] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the effects as JSON.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option("--markdown", metavar="FILE", help="Write the effects as a reference page.")
    ] = None,
    effects_file: EffectsFileOption = None,
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
      tunnel effects check detent --effects-file my.toml

    tunnel effects check NAME tests an effect of your own by the laws that every
    effect obeys, and names other effects with the same influence on the motion.

    [bold]Exit status[/bold]
      0 shown, 1 a law is violated, 2 bad input.
    """
    from tunnel_lab.terminal import effect_listing, tables
    from tunnel_sim.effects import effect_class, known_effects
    from tunnel_sim.vocabulary.errors import TunnelError

    del effects_file  # its effects are known already
    if name == "check":
        if checked is None or json is not None or markdown is not None:
            raise TunnelError(
                "name one effect to check, and no file to write", remedy="tunnel effects check NAME"
            )
        _check(checked)
        return
    if checked is not None:
        raise TunnelError(f"one name too many: {checked!r}", remedy="name one effect")
    kinds = known_effects() if name is None else (effect_class(name),)
    if json is not None or markdown is not None:
        _write(kinds, json, markdown)
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


def _write(kinds: Sequence[type[Effect]], json: Path | None, markdown: Path | None) -> None:
    """Write effects to files."""
    from tunnel_lab.terminal import effect_listing, tables
    from tunnel_lab.terminal.options import refuse_unwritable_files
    from tunnel_sim.files.writing import write_json, write_whole

    refuse_unwritable_files(json, markdown)
    written = []
    if json is not None:
        written.append(write_json(json, effect_listing.document(kinds)))
    if markdown is not None:
        written.append(write_whole(markdown, effect_listing.markdown(kinds).encode()))
    tables.say_written(*written)


def _check(name: str) -> None:
    """Print which laws an effect obeys; exit with 1 where it violates one."""
    from diagnosis.identifiability import identifiability
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.effects import effect_class
    from tunnel_sim.engine.effect_laws import check

    kind = effect_class(name)
    verdicts = check(kind)
    seen = identifiability(kind)
    for law, fault in [*((v.law, v.fault) for v in verdicts), (seen.LAW, seen.fault)]:
        say(f"violated: {law}: {fault}." if fault else f"obeyed: {law}.")
    for line in seen.lines():
        say(line)
    if seen.fault or any(v.fault for v in verdicts):
        raise typer.Exit(1)
