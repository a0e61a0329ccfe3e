"""An uncertainty budget as a table, and which source dominates, from the JSON document of an estimate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Any

from identification.estimate import UNITS
from identification.printing.numbers import SYMBOLS, significant, unit
from identification.printing.table import TextTable

Document = Mapping[str, Any]
_DOMINANT = 0.5  # of the variance: more than all others together


def budget_table(budget: Document) -> TextTable:
    """Standard uncertainties, source by source.

    Returns:
        A row for each source and one for all of them, in the quantities' units; a negative value is the
        reduction by a correlation.
    """
    names = _names(budget)
    headings = tuple(f"{SYMBOLS[name]}\n{unit(UNITS[name])}" for name in names)
    rows = [(one["name"], *(_cell(one, name) for name in names)) for one in budget["components"]]
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
    notes = [f"{one['name']}: {one['note']}" for one in components if one["note"]]
    return [*(_largest(components, name) for name in _names(budget)), *notes]


def _largest(components: Sequence[Document], name: str) -> str:
    variances = [float(one["variance"][name]) for one in components]
    largest, total = max(variances), sum(variances)
    share = largest / total if total > 0.0 else 0.0
    verb = "dominates" if share > _DOMINANT else "is the largest source"
    source = components[variances.index(largest)]["name"]
    return f"{SYMBOLS[name]}: {source} {verb}, {100.0 * share:.0f} % of the variance"
