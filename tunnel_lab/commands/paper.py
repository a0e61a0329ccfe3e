"""``tunnel springs`` and ``paper``: the paper's table of springs, its tables and figures."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from identification.show.blocks import TextTable
from tunnel_lab.terminal.outputs import say, say_written, show
from tunnel_lab.terminal.progress import bar
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, counted, did_you_mean, one_line, shown
from tunnel_sim.vocabulary.freedom import ANGLE, DISPLACEMENT, Freedom

STIFFNESS, FREQUENCY, SPRING = "stiffness_N_m_per_rad", "frequency_Hz", "spring"
STIFFNESSES = {STIFFNESS: ANGLE, "stiffness_N_per_m": DISPLACEMENT}
"""The columns of stiffness, each of springs of another motion."""
REMEDY = f"give a CSV file with the columns {STIFFNESS} and {FREQUENCY}, and optionally {SPRING}"


def springs(
    table: Annotated[
        Path | None,
        Argument(
            help="CSV file: stiffness_N_m_per_rad and frequency_Hz. Default: the paper's Table II.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Compute Izz from springs of known stiffness and their wind-off frequencies.

    Izz (kg m²) is the gradient of Kr (N m/rad) against ωn² (rad²/s²) by least
    squares. The residual of a spring is the deviation of its stated stiffness
    from that line. Springs that deviate too far are marked: measure them again.
    With a column stiffness_N_per_m the line gives the mass of a displacement.

    [bold]Examples[/bold]
      tunnel springs
      tunnel springs my-springs.csv

    [bold]Exit status[/bold]
      0 fitted, 1 inertia not found, 2 bad input.
    """
    given = read_spring_table(table) if table is not None else paper_table()
    show_springs(given, str(table) if table is not None else "the paper's Table II")


def paper_table() -> SpringTable:
    """The paper's Table II."""
    from identification.datasets import paper_springs

    rows = paper_springs()
    return SpringTable(
        tuple(str(row.number) for row in rows),
        tuple(row.stiffness_n_m_per_rad for row in rows),
        tuple(row.frequency_hz for row in rows),
    )


def show_springs(springs: SpringTable, source: str) -> None:
    """Fit and print the line; `typer.Exit` with status 1 when the gradient is not positive."""
    from identification.campaign.springs import fit_springs
    from identification.show.numbers import with_std

    fit = fit_springs(springs.stiffness, springs.frequency_hz)
    rows = []
    for name, stiffness, frequency, residual, flag in zip(
        springs.names, springs.stiffness, springs.frequency_hz, fit.residual_percent, fit.flagged, strict=True
    ):
        square = (2.0 * math.pi * frequency) ** 2
        numbers = (f"{stiffness:g}", f"{frequency:g}", f"{square:.2f}", f"{residual:+.1f}")
        rows.append((name, *numbers, "off the line" if flag else ""))
    heads = ("spring", "Kr [N m/rad]", "f [Hz]", "ωn² [rad²/s²]", "residual [%]", "remark")
    own = springs.freedom.words
    table = TextTable(f"Springs of {source}", heads, tuple(rows), heads[1:-1])
    show(springs.freedom.texts([table], [source, *springs.names]))
    if fit.inertia.value <= 0.0:
        problem = "stiffness does not rise with frequency, so this table gives no inertia: check it"
        say(own(problem), stderr=True)
        raise typer.Exit(1)
    say(own(f"Izz (gradient) = {with_std(fit.inertia.value, fit.inertia.std)} kg m²"))
    say(own(f"intercept      = {with_std(fit.intercept.value, fit.intercept.std)} N m/rad"))


@dataclass(frozen=True)
class SpringTable:
    """Names of springs, their stiffness Kr (N m/rad) and their wind-off frequency (Hz), both above zero.

    Args:
        freedom: of the body on them.
    """

    names: tuple[str, ...]
    stiffness: tuple[float, ...]
    frequency_hz: tuple[float, ...]
    freedom: Freedom = ANGLE


def read_spring_table(path: Path) -> SpringTable:
    """Read a spring table in CSV; lines starting with ``#`` are comments.

    Columns are ``stiffness_N_m_per_rad`` (N m/rad) or ``stiffness_N_per_m`` (N/m), ``frequency_Hz`` (Hz) and,
    optionally, ``spring``, its name.

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
    rows = []
    for number, line in lines:
        where = f"{path}, line {number}"
        try:
            rows.append((where, next(csv.reader([line]))))
        except csv.Error as error:
            raise TunnelError(f"is not a line of CSV ({error})", where=where, remedy=REMEDY) from None
    if not rows:
        raise TunnelError("is empty", where=str(path), remedy=REMEDY)
    header = [name.strip() for name in rows[0][1]]
    of_motion = next((name for name in STIFFNESSES if name in header), STIFFNESS)
    known = (SPRING, of_motion, FREQUENCY)
    for name in header:
        if name not in known:
            what = f"unknown column '{one_line(name, 40)}'"
            raise TunnelError(what, where=str(path), remedy=did_you_mean(name, known))
    for name in (of_motion, FREQUENCY):
        if header.count(name) != 1:
            raise TunnelError(f"needs one column {name}", where=str(path), remedy=REMEDY)
    columns = {name: header.index(name) for name in known if name in header}
    names, stiffness, frequency = [], [], []
    for number, (where, row) in enumerate(rows[1:], 1):
        if len(row) <= max(columns.values()):
            raise TunnelError(
                f"has {counted(len(row), 'value')}", where=where, remedy="give one for each column"
            )
        name = row[columns[SPRING]].strip() if SPRING in columns else ""
        if len(name) > limits.NAME_CHARACTERS:
            what = f"the spring's name has {len(name)} characters"
            raise TunnelError(what, where=where, remedy=f"give it {limits.NAME_CHARACTERS} at most")
        names.append(name or str(number))
        stiffness.append(_positive(row[columns[of_motion]], where))
        frequency.append(_positive(row[columns[FREQUENCY]], where))
    if len(names) < 3:
        raise TunnelError(
            f"has {counted(len(names), 'spring')}", where=str(path), remedy="give three or more"
        )
    return SpringTable(tuple(names), tuple(stiffness), tuple(frequency), STIFFNESSES[of_motion])


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


def paper(
    out: Annotated[
        Path, Option("--out", "-o", metavar="FOLDER", help="Where the page and its figures go.")
    ] = Path("tunnel-output/paper"),
    only: Annotated[
        tuple[str, ...],
        Option("--only", metavar="PART", help="Only this part, such as table-2. May be repeated."),
    ] = (),
) -> None:
    """Reproduce the paper's tables and figures, ours beside theirs.

    A page (index.html) with a summary, Tables I to IV, Figs 1 to 6 and the
    misprints in the equations is written to FOLDER, with its figures as PNG and
    PDF. It states which results cannot be reproduced, and why. The runs are
    simulated, and identified by the paper's two methods, in a minute or two.
    After an interruption the same command computes the unfinished parts. Delete
    the folder to compute everything again.

    [bold]Examples[/bold]
      tunnel paper
      tunnel paper --out here --only table-2 --only equations

    [bold]Exit status[/bold]
      0 written, 2 bad input, 130 interrupted (finished parts are kept).
    """
    from tunnel_lab.paper import networks, rig_tables
    from tunnel_lab.paper.paper_page import write_paper

    known = {
        "table-1": rig_tables.table_1,
        "table-2": rig_tables.table_2,
        "equations": rig_tables.equations,
        "figure-1": rig_tables.figure_1,
        "figure-2": rig_tables.figure_2,
        "figure-3": networks.figure_3,
        "table-3": networks.table_3,
        "table-4": networks.table_4,
        "figures-4-to-6": networks.figures_4_to_6,
    }
    for name in only:
        if name not in known:
            raise TunnelError(f"no part '{name}'", where="--only", remedy=did_you_mean(name, tuple(known)))
    with bar("paper") as progress:
        page, sections = write_paper(out, known, list(dict.fromkeys(only or known)), progress=progress)
    rows = tuple((part.title, part.theirs, part.ours, part.outcome) for part in sections.values())
    show([TextTable("The paper, ours beside theirs", ("item", "paper", "here", "outcome"), rows)])
    say_written(page)
