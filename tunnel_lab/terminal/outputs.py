"""What several commands print: an estimate, an import, an uncertainty budget."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identification import printing
from identification.estimate import UNITS
from identification.printing import SYMBOLS, TextTable, significant, unit
from tunnel_lab.terminal import tables

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.files.importing.records import Imported, ImportedRun
    from tunnel_sim.vocabulary.campaign import Campaign


DIAGNOSE = "run the diagnosis"
"""How notes end whose remedy is the diagnosis."""
Document = Mapping[str, Any]
_DOMINANT = 0.5  # of the variance: more than all others together


def show_estimate(
    campaign: Campaign, estimate: Estimate, *, windows: bool, source: Path | None = None
) -> None:
    """Print an estimate.

    Args:
        source: what the campaign was read from, for commands to copy; None: nowhere.
    """
    document = estimate.to_json_dict()
    coefficients = tables.rich_table(printing.coefficients_table(document))
    tables.show_tables(coefficients, tables.runs_table(campaign, estimate))
    if windows:
        tables.show_tables(*map(tables.windows_table, estimate.runs))
    tables.say(tables.BRACKETS)
    command = DIAGNOSE if source is None else f"run: tunnel diagnose {shlex.quote(str(source))}"
    for line in (*map(str, estimate.remarks), *printing.status_lines(document)):
        tables.say(f"Note: {line.replace(DIAGNOSE, command)}")


def show_import(imported: Imported) -> None:
    """Print what was read, and how."""
    tables.show_tables(tables.rich_table(parts_table(imported)))
    for line in imported.remarks():
        tables.say(f"Note: {line}")


def parts_table(imported: Imported) -> TextTable:
    """The runs of an import, a row for each.

    Returns:
        The file where there are several, samples, rate, the stretch of the record, the swing and the conditions.
    """
    unit = imported.campaign.sensor.unit
    headings = (
        "samples",
        "rate\n[Hz]",
        "from\n[s]",
        "to\n[s]",
        f"swing\n[{unit}]",
        "V\n[m/s]",
        "Kr\n[N m/rad]",
    )
    several = len(imported.sources) > 1
    rows = tuple(
        (part.id, *([part.raw.source.name] if several else []), *_figures(part)) for part in imported.parts
    )
    return TextTable("Read", ("run", *(["file"] if several else []), *headings), rows, right=headings)


def _figures(part: ImportedRun) -> tuple[str, ...]:
    time = part.raw.cleaned.time_s[part.piece.first : part.piece.last]
    run = part.run
    if run is None:
        return (f"{time.size}", "left out", "", "", "", "", "")
    return (
        f"{time.size}",
        f"{run.record.sample_rate:.4g}",
        f"{time[0]:.2f}",
        f"{time[-1]:.2f}",
        f"±{0.5 * (part.reading.max() - part.reading.min()):.3g}",
        f"{run.wind_speed:g}",
        "not stated" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
    )


def budget_table(budget: Document) -> TextTable:
    """Standard uncertainties, source by source.

    Returns:
        A row for each source and one for all of them, in the quantities' units; a negative value is the
        reduction by a correlation.
    """
    names = _names(budget)
    headings = tuple(f"{SYMBOLS[name]}\n{unit(UNITS[name])}" for name in names)
    rows = [
        (component["name"], *(_cell(component, name) for name in names)) for component in budget["components"]
    ]
    rows.append(("all together", *(significant(budget["combined_std"][name], 2) for name in names)))
    title = "Uncertainty budget: one standard uncertainty each"
    return TextTable(title, ("source", *headings), tuple(rows), right=headings)


def _names(budget: Document) -> list[str]:
    return [name for name in UNITS if name in budget["combined_std"]]


def _cell(component: Document, name: str) -> str:
    variance = float(component["variance"][name])
    if variance == 0.0:
        return "0" if component["known"] else "–"
    return f"{'−' if variance < 0.0 else ''}{significant(sqrt(abs(variance)), 2)}"


def budget_lines(budget: Document) -> list[str]:
    """The dominant source of each quantity, and the notes of the sources."""
    components = budget["components"]
    notes = [f"{component['name']}: {component['note']}" for component in components if component["note"]]
    return [*(_largest(components, name) for name in _names(budget)), *notes]


def _largest(components: Sequence[Document], name: str) -> str:
    variances = [float(component["variance"][name]) for component in components]
    largest, total = max(variances), sum(variances)
    share = largest / total if total > 0.0 else 0.0
    verb = "dominates" if share > _DOMINANT else "is the largest source"
    source = components[variances.index(largest)]["name"]
    return f"{SYMBOLS[name]}: {source} {verb}, {100.0 * share:.0f} % of the variance"
