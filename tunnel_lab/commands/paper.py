"""``tunnel paper``: every table and figure of the paper, ours beside theirs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tunnel_lab.paper.page import Part

NAME = "paper"


def run(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FOLDER", help="Where the page and its figures go.")
    ] = Path("tunnel-output/paper"),
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="PART", help="Only this part, such as table-2. May be repeated."),
    ] = None,
) -> None:
    """Reproduce the paper's tables and figures, ours beside theirs.

    FOLDER gets a page (index.html) with a summary, Tables I to IV, Figs 1 to 6
    and the slips of the equations, and its figures as pictures (PNG) and for
    print (PDF). It says what cannot be reproduced, and why. The runs are
    simulated, and identified by the paper's two methods, in a minute or two.
    What is finished is kept: after an interruption the same command does the
    rest. Delete the folder to compute everything again.

    [bold]Examples[/bold]
      tunnel paper
      tunnel paper --out here --only table-2 --only equations

    [bold]Exit status[/bold]
      0 written, 2 bad input, 130 interrupted (finished parts are kept).
    """
    from tunnel_lab.paper.page import write_paper
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import say_written, show_tables, table
    from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

    known = parts()
    for name in only or ():
        if name not in known:
            raise TunnelError(f"no part '{name}'", where="--only", remedy=did_you_mean(name, tuple(known)))
    with bar("paper") as progress:
        page, sections = write_paper(out, known, list(dict.fromkeys(only or known)), progress=progress)
    summary = table("The paper, ours beside theirs", "item", "paper", "here", "outcome")
    for section in sections.values():
        summary.add_row(section.title, section.theirs, section.ours, section.outcome)
    show_tables(summary)
    say_written(page)


def parts() -> dict[str, Part]:
    """The parts by name, in the order of the page."""
    from tunnel_lab.paper import networks, rig

    return {
        "table-1": rig.table_1,
        "table-2": rig.table_2,
        "equations": rig.equations,
        "figure-1": rig.figure_1,
        "figure-2": rig.figure_2,
        "figure-3": networks.figure_3,
        "table-3": networks.table_3,
        "table-4": networks.table_4,
        "figures-4-to-6": networks.figures_4_to_6,
    }
