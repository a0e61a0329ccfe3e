"""``tunnel demo``, ``springs`` and ``paper``: its campaign, its table of springs, its tables and figures."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from tunnel_lab.terminal.outputs import (
    bar,
    console,
    say,
    say_written,
    show_estimate,
    show_tables,
    table,
    truth_table,
)
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, shown

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign
    from tunnel_sim.vocabulary.plan import CampaignPlan

SHOWN = ("output_error", "conventional", "neural_network")
"""Estimators of the comparison: the default and the two of the paper. `tunnel score` compares them all."""
MEASURED = "rotary-pendulum"
CHECKED_ESTIMATOR = "output_error"
CHECK_STDS = 4.0
"""The check fails beyond this many standard deviations; its false-alarm rate is one in four thousand."""
STIFFNESS, FREQUENCY, SPRING = "stiffness_N_m_per_rad", "frequency_Hz", "spring"
REMEDY = f"give a CSV file with the columns {STIFFNESS} and {FREQUENCY}, and optionally {SPRING}"


def demo(
    out: Annotated[
        Path, Option("--out", "-o", metavar="FOLDER", help="Where campaign, estimates and figures go.")
    ] = Path("tunnel-output"),
    seed: Annotated[
        int | None, Option("--seed", min=0, help="Seed of the noise; overrides the plan's.")
    ] = None,
) -> None:
    """Simulate the paper's campaign, identify it, compare it with the truth.

    The paper's rig is simulated with the wind off and on. Three estimators give
    Cnβ and Cnr (1/rad), Izz (kg m²) and Cr (N m s/rad), shown beside the injected
    values. Measured swings of a pendulum follow, by windows of a few cycles.
    Campaign, estimates (JSON) and figures (PNG, PDF) are kept in FOLDER.

    [bold]Examples[/bold]
      tunnel demo
      tunnel demo --out here --seed 7

    [bold]Exit status[/bold]
      0 success, 1 an estimate failed or output_error missed the truth by more
      than four standard deviations, 2 bad input.
    """
    from identification import identify
    from identification.datasets import measured_campaign
    from tunnel_lab.plotting import runs
    from tunnel_lab.plotting.style import save_both
    from tunnel_lab.show.film import Look, Request, write_film
    from tunnel_sim.files.plan_file import paper_plan
    from tunnel_sim.files.writing import output_folder, write_json

    folder = output_folder(out)
    plan = paper_plan()
    if seed is not None:
        plan = replace(plan, seed=seed)
    # Everything is written before anything is printed: the reader of a pipe may close it early.
    campaign, estimates = simulated_part(plan, folder)
    measured = measured_campaign(MEASURED)
    estimate = identify(measured, CHECKED_ESTIMATOR, throw=False)
    write_json(folder / f"estimate-{MEASURED}.json", estimate.to_json_dict())
    off = next(run for run in campaign.runs if not run.wind_on)
    pairs = [run for run in campaign.runs if run.wind_on and run.spring_stiffness == off.spring_stiffness]
    on = max(pairs, key=lambda run: run.wind_speed)
    save_both(runs.wind_off_on_figure(off, on), folder / "traces.png")
    save_both(runs.spectrum_figure((off, on)), folder / "spectrum.png")
    save_both(runs.windows_figure(estimate), folder / "windows.png")
    save_both(runs.truth_figure(estimates, vars(plan.truth)), folder / "estimates.png")
    problem = ""  # why there is no picture of the rig
    with console(stderr=True).status("rendering the rig"):
        try:
            write_film(Request(), Look(height=800, trace=False), folder / "rig.png", at=0.0)
        except TunnelError as error:
            problem = str(error)
    show_simulated(campaign, estimates, plan)
    say(f"Measured: {measured.name}, {len(measured.runs)} runs. {measured.description}\n")
    show_estimate(measured, estimate, windows=True)
    say("\nFigures (.png and .pdf): traces, spectrum, windows, estimates")
    say(f"No picture of the rig: {problem}" if problem else "Picture of the rig: rig.png")
    say(f"Campaign, estimates (JSON) and figures are in {folder}")
    if missed := misses(estimates, plan):
        say(f"Check failed: {'; '.join(missed)}", stderr=True)
        raise typer.Exit(1)


def misses(estimates: Sequence[Estimate], plan: CampaignPlan) -> list[str]:
    """Clauses on the checks that fail: estimates that are missing, or too far from the truth for their std.

    The distance is checked for the maximum-likelihood estimator only, whose standard deviations should be exact.
    """
    lines = [f"{e.estimator}: {e.status.value}" for e in estimates if e.status.failed]
    for estimate in estimates:
        if estimate.estimator != CHECKED_ESTIMATOR or estimate.status.failed:
            continue
        for name, value in vars(plan.truth).items():
            quantity = getattr(estimate, name)
            if quantity is None:
                lines.append(f"{estimate.estimator}: no {name}")
            elif abs(quantity.value - value) > CHECK_STDS * quantity.std:
                lines.append(f"{estimate.estimator}: {name} misses the truth by more than {CHECK_STDS:g} std")
    return lines


def simulated_part(plan: CampaignPlan, folder: Path) -> tuple[Campaign, tuple[Estimate, ...]]:
    """Simulate, identify by the paper's two methods and the default one, and write all of it into the folder."""
    from identification import identify
    from tunnel_sim.engine.virtual_campaign import simulate_campaign, truth_document
    from tunnel_sim.files.campaign_folder import write_campaign
    from tunnel_sim.files.writing import write_json

    with bar("simulating runs", len(plan.conditions)) as progress:
        campaign = simulate_campaign(plan, progress=progress)
    write_campaign(campaign, folder / "campaign", truth=truth_document(plan), overwrite=True)
    estimates = []
    for name in SHOWN:
        with console(stderr=True).status(f"identifying by {name}"):
            estimate = identify(campaign, name, throw=False)
        write_json(folder / f"estimate-{name}.json", estimate.to_json_dict())
        estimates.append(estimate)
    return campaign, tuple(estimates)


def show_simulated(campaign: Campaign, estimates: Sequence[Estimate], plan: CampaignPlan) -> None:
    """Print the comparison with the truth."""
    from identification.printing import status_lines

    say(f"Simulated: {campaign.name}, {len(campaign.runs)} runs, seed {plan.seed}\n")
    show_tables(truth_table(estimates, vars(plan.truth)))
    for estimate in estimates:
        for line in status_lines(estimate.to_json_dict()):
            say(f"Note, {estimate.estimator}: {line}")


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
    """Fit and print; `typer.Exit` with status 1 when the gradient is not above zero."""
    from identification.campaign.springs import fit_springs
    from identification.printing import with_std

    fit = fit_springs(springs.stiffness, springs.frequency_hz)
    rows = table(
        f"Springs of {source}",
        *("spring", "Kr [N m/rad]", "f [Hz]", "ωn² [rad²/s²]", "residual [%]", ""),
        right=("Kr [N m/rad]", "f [Hz]", "ωn² [rad²/s²]", "residual [%]"),
    )
    for name, stiffness, frequency, residual, flag in zip(
        springs.names, springs.stiffness, springs.frequency_hz, fit.residual_percent, fit.flagged, strict=True
    ):
        square = (2.0 * math.pi * frequency) ** 2
        rows.add_row(
            name,
            f"{stiffness:g}",
            f"{frequency:g}",
            f"{square:.2f}",
            f"{residual:+.1f}",
            "off the line" if flag else "",
        )
    show_tables(rows)
    if fit.inertia.value <= 0.0:
        problem = "stiffness does not rise with frequency, so this table gives no inertia: check it"
        say(problem, stderr=True)
        raise typer.Exit(1)
    say(f"Izz (gradient) = {with_std(fit.inertia.value, fit.inertia.std)} kg m²")
    say(f"intercept      = {with_std(fit.intercept.value, fit.intercept.std)} N m/rad")


@dataclass(frozen=True)
class SpringTable:
    """Names of springs, their stiffness Kr (N m/rad) and their wind-off frequency (Hz), both above zero."""

    names: tuple[str, ...]
    stiffness: tuple[float, ...]
    frequency_hz: tuple[float, ...]


def read_spring_table(path: Path) -> SpringTable:
    """Read a spring table in CSV; lines starting with ``#`` are comments.

    Columns are ``stiffness_N_m_per_rad`` (N m/rad), ``frequency_Hz`` (Hz) and, optionally, ``spring``, its name.

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
    header, known = [name.strip() for name in rows[0][1]], (SPRING, STIFFNESS, FREQUENCY)
    for name in header:
        if name not in known:
            what = f"unknown column '{one_line(name, 40)}'"
            raise TunnelError(what, where=str(path), remedy=did_you_mean(name, known))
    for name in (STIFFNESS, FREQUENCY):
        if header.count(name) != 1:
            raise TunnelError(f"needs one column {name}", where=str(path), remedy=REMEDY)
    columns = {name: header.index(name) for name in known if name in header}
    names, stiffness, frequency = [], [], []
    for number, (where, row) in enumerate(rows[1:], 1):
        if len(row) <= max(columns.values()):
            raise TunnelError(f"has {len(row)} values", where=where, remedy="give one for each column")
        name = row[columns[SPRING]].strip() if SPRING in columns else ""
        if len(name) > limits.NAME_CHARACTERS:
            what = f"the spring's name has {len(name)} characters"
            raise TunnelError(what, where=where, remedy=f"give it {limits.NAME_CHARACTERS} at most")
        names.append(name or str(number))
        stiffness.append(_positive(row[columns[STIFFNESS]], where))
        frequency.append(_positive(row[columns[FREQUENCY]], where))
    if len(names) < 3:
        raise TunnelError(f"has {len(names)} springs", where=str(path), remedy="give three or more")
    return SpringTable(tuple(names), tuple(stiffness), tuple(frequency))


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
        list[str] | None,
        Option("--only", metavar="PART", help="Only this part, such as table-2. May be repeated."),
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
    from tunnel_lab.paper import networks, rig
    from tunnel_lab.paper.page import write_paper

    known = {
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
