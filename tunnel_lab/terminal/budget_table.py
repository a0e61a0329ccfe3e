"""An uncertainty budget as a table: the share of every source, and which dominates."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from identification.estimate import PARAMETERS
from identification.printing.numbers import SYMBOLS, significant, unit
from tunnel_lab.terminal.tables import table

if TYPE_CHECKING:
    from rich.table import Table

    from identification.uncertainty.budget import Budget, Component

_DOMINANT = 0.5  # of the variance: more than all others together


def budget_table(budget: Budget) -> Table:
    """Standard uncertainties, source by source.

    Returns:
        A row for each source and one for all of them, in the quantities' units; a negative value is the
        reduction by a correlation.
    """
    shown = [name for name in budget.names if name in PARAMETERS]
    headings = [f"{SYMBOLS[name]}\n{unit(budget.units[budget.names.index(name)])}" for name in shown]
    result = table("Uncertainty budget: one standard uncertainty each", "source", *headings, right=headings)
    for component in budget.components:
        result.add_row(Text(component.name), *(_cell(budget, component, name) for name in shown))
    result.add_section()
    result.add_row("all together", *(significant(budget.std(name), 2) for name in shown))
    return result


def _cell(budget: Budget, component: Component, name: str) -> str:
    place = budget.names.index(name)
    variance = float(component.covariance[place, place])
    if variance == 0.0:
        return "0" if component.known else "–"
    return f"{'−' if variance < 0.0 else ''}{significant(sqrt(abs(variance)), 2)}"


def budget_lines(budget: Budget) -> list[str]:
    """The dominant source of each quantity, and the notes of the sources."""
    lines = []
    for name in budget.names:
        if name not in PARAMETERS:
            continue
        place = budget.names.index(name)
        variances = [float(component.covariance[place, place]) for component in budget.components]
        largest = int(np.argmax(variances))
        share = 100.0 * variances[largest] / sum(variances)
        verb = "dominates" if share > 100.0 * _DOMINANT else "is the largest source"
        lines.append(
            f"{SYMBOLS[name]}: {budget.components[largest].name} {verb}, {share:.0f} % of the variance"
        )
    lines += [f"{component.name}: {component.note}" for component in budget.components if component.note]
    return lines
