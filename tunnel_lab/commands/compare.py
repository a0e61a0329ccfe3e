"""``tunnel compare``: diagnoses side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

NAME = "compare"


def run(
    documents: Annotated[
        list[Path], typer.Argument(metavar="DIAGNOSIS.json", help="Written by tunnel diagnose --json.")
    ],
) -> None:
    """Compare diagnoses, such as before and after a repair of the rig.

    For each diagnosis: the gap (noise powers) before and with the causes, the causes
    with their parameters, and the coefficients with standard deviations. Then the
    difference of each coefficient from the first diagnosis, for campaigns that are
    independent of each other.

    [bold]Examples[/bold]
      tunnel compare before.json after.json
      tunnel compare may.json june.json july.json --format csv

    [bold]Exit status[/bold]
      0 compared, 2 bad input.
    """
    from tunnel_lab.terminal.comparison import comparison_tables
    from tunnel_lab.terminal.diagnosis_file import read_diagnosis
    from tunnel_lab.terminal.tables import rich_table, show_tables
    from tunnel_sim.vocabulary.errors import TunnelError, shown

    if len(documents) < 2:
        raise TunnelError("only one diagnosis", where=shown(documents[0]), remedy="name two files or more")
    found = [read_diagnosis(path) for path in documents]
    names = _names(documents, found)
    show_tables(*(rich_table(table) for table in comparison_tables(names, found)))


def _names(paths: Sequence[Path], documents: Sequence[Mapping[str, Any]]) -> list[str]:
    """A name for each document: the campaign's; the file's where campaigns share a name; else a number too."""
    from tunnel_sim.vocabulary.errors import one_line

    for names in ([str(d["campaign"]) for d in documents], [one_line(path.stem) for path in paths]):
        if len(set(names)) == len(names):
            return names
    return [f"{place}: {one_line(path.stem)}" for place, path in enumerate(paths, 1)]
