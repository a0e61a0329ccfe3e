"""``tunnel springs``: the rig's inertia from a table of springs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tunnel_lab.terminal.spring_table import SpringTable

NAME = "springs"


def run(
    table: Annotated[
        Path | None,
        typer.Argument(
            help="CSV file: stiffness_N_m_per_rad and frequency_Hz. Default: the paper's Table II.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Compute Izz from springs of known stiffness and their wind-off frequencies.

    Izz (kg m²) is the gradient of Kr (N m/rad) against ωn² (rad²/s²) by least
    squares. The residual of a spring is the deviation of its stated stiffness
    from that line. Springs that deviate too far are marked: measure them again.

    [bold]Examples[/bold]
      tunnel springs
      tunnel springs my-springs.csv

    [bold]Exit status[/bold]
      0 fitted, 1 inertia not found, 2 bad input.
    """
    from tunnel_lab.terminal.spring_table import read_spring_table

    springs = read_spring_table(table) if table is not None else paper_table()
    show(springs, str(table) if table is not None else "the paper's Table II")


def paper_table() -> SpringTable:
    """The paper's Table II."""
    from identification.datasets import paper_springs
    from tunnel_lab.terminal.spring_table import SpringTable

    rows = paper_springs()
    return SpringTable(
        tuple(str(row.number) for row in rows),
        tuple(row.stiffness_n_m_per_rad for row in rows),
        tuple(row.frequency_hz for row in rows),
    )


def show(springs: SpringTable, source: str) -> None:
    """Fit and print.

    Args:
        source: where it comes from, for the heading.

    Raises:
        typer.Exit: with status 1 when the gradient is not above zero.
    """
    from math import pi

    from identification.campaign.springs import fit_springs
    from identification.printing.numbers import with_std
    from tunnel_lab.terminal import tables

    fit = fit_springs(springs.stiffness, springs.frequency_hz)
    rows = tables.table(
        f"Springs of {source}",
        *("spring", "Kr [N m/rad]", "f [Hz]", "ωn² [rad²/s²]", "residual [%]", ""),
        right=("Kr [N m/rad]", "f [Hz]", "ωn² [rad²/s²]", "residual [%]"),
    )
    for name, stiffness, frequency, residual, flag in zip(
        springs.names, springs.stiffness, springs.frequency_hz, fit.residual_percent, fit.flagged, strict=True
    ):
        square = (2.0 * pi * frequency) ** 2
        rows.add_row(
            name,
            f"{stiffness:g}",
            f"{frequency:g}",
            f"{square:.2f}",
            f"{residual:+.1f}",
            "off the line" if flag else "",
        )
    tables.show_tables(rows)
    if fit.inertia.value <= 0.0:
        problem = "stiffness does not rise with frequency, so this table gives no inertia: check it"
        tables.say(problem, stderr=True)
        raise typer.Exit(1)
    tables.say(f"Izz (gradient) = {with_std(fit.inertia.value, fit.inertia.std)} kg m²")
    tables.say(f"intercept      = {with_std(fit.intercept.value, fit.intercept.std)} N m/rad")
