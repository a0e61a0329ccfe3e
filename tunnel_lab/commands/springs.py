"""``tunnel springs``: the rig's inertia from a table of springs."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, shown

NAME = "springs"
STIFFNESS = "stiffness_N_m_per_rad"
FREQUENCY = "frequency_Hz"
SPRING = "spring"
REMEDY = f"give a CSV file with the columns {STIFFNESS} and {FREQUENCY}, and optionally {SPRING}"


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
    springs = read_spring_table(table) if table is not None else paper_table()
    show(springs, str(table) if table is not None else "the paper's Table II")


def paper_table() -> SpringTable:
    """The paper's Table II."""
    from identification.datasets import paper_springs

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
    from identification.printing import with_std
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


@dataclass(frozen=True)
class SpringTable:
    """Springs and the wind-off frequencies measured with them.

    Args:
        names: of the springs, n of them.
        stiffness: Kr of each, N m/rad, above zero.
        frequency_hz: wind-off frequency of each, Hz, above zero.
    """

    names: tuple[str, ...]
    stiffness: tuple[float, ...]
    frequency_hz: tuple[float, ...]


def read_spring_table(path: Path) -> SpringTable:
    """Read a spring table; lines starting with ``#`` are comments.

    Args:
        path: CSV file with the columns ``stiffness_N_m_per_rad`` (N m/rad) and ``frequency_Hz`` (Hz), and
            optionally ``spring``, its name or number.

    Raises:
        TunnelError: when the file cannot be read or is too large, a column is missing or unknown, a value is not a
            number above zero, or there are fewer than three springs.
    """
    from tunnel_sim.files.reading import check_count, read_text

    text = read_text(path, limits.DOCUMENT_BYTES, missing=REMEDY)
    lines = [
        (n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")
    ]
    check_count(len(lines) - 1, limits.SPRINGS, "springs", shown(path), "leave some out")
    # Line by line: quoted line feeds are not allowed in this table.
    rows = [(number, _values(line, f"{path}, line {number}")) for number, line in lines]
    if not rows:
        raise TunnelError("is empty", where=str(path), remedy=REMEDY)
    columns = _columns([name.strip() for name in rows[0][1]], path)
    table = [_row(row, columns, f"{path}, line {number}") for number, row in rows[1:]]
    if len(table) < 3:
        raise TunnelError(f"has {len(table)} springs", where=str(path), remedy="give three or more")
    names = tuple(name or str(number) for number, (name, _, _) in enumerate(table, 1))
    return SpringTable(names, tuple(row[1] for row in table), tuple(row[2] for row in table))


def _values(line: str, where: str) -> list[str]:
    try:
        return next(csv.reader([line]))
    except csv.Error as error:
        raise TunnelError(f"is not a line of CSV ({error})", where=where, remedy=REMEDY) from None


def _columns(header: list[str], path: Path) -> dict[str, int]:
    """Index of each known column."""
    known = (SPRING, STIFFNESS, FREQUENCY)
    for name in header:
        if name not in known:
            what = f"unknown column '{one_line(name, 40)}'"
            raise TunnelError(what, where=str(path), remedy=did_you_mean(name, known))
    for name in (STIFFNESS, FREQUENCY):
        if header.count(name) != 1:
            raise TunnelError(f"needs one column {name}", where=str(path), remedy=REMEDY)
    return {name: header.index(name) for name in known if name in header}


def _row(row: list[str], columns: dict[str, int], where: str) -> tuple[str, float, float]:
    """Name (may be empty), stiffness and frequency of one line."""
    if len(row) <= max(columns.values()):
        raise TunnelError(f"has {len(row)} values", where=where, remedy="give one for each column")
    name = row[columns[SPRING]].strip() if SPRING in columns else ""
    if len(name) > limits.NAME_CHARACTERS:
        what = f"the spring's name has {len(name)} characters"
        raise TunnelError(what, where=where, remedy=f"give it {limits.NAME_CHARACTERS} at most")
    return name, _positive(row[columns[STIFFNESS]], where), _positive(row[columns[FREQUENCY]], where)


def _positive(text: str, where: str) -> float:
    """A number above zero and within the limits."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not limits.SMALLEST_NUMBER <= value <= limits.LARGEST_NUMBER:
        raise TunnelError(
            f"'{one_line(text, 40)}' is not a number above zero", where=where, remedy="correct it (SI units)"
        )
    return value
