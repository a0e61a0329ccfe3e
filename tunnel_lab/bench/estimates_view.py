"""Estimates side by side, and an uncertainty budget, as tables, from the JSON documents of ``tunnel identify``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Any

from identification.estimate import UNITS
from identification.printing.numbers import SYMBOLS, significant, unit, with_std
from identification.printing.table import TextTable

Document = Mapping[str, Any]
_MOST_RUNS = 50


def side_by_side(documents: Sequence[Document]) -> list[str | TextTable]:
    """Estimates of one campaign by several estimators.

    Args:
        documents: one for each estimator.

    Returns:
        The coefficients, ωn and ζ of the runs, and what the estimators say.
    """
    names = tuple(str(document["estimator"]) for document in documents)
    given = [name for name in UNITS if any(document[name] for document in documents)]
    rows = tuple(
        (f"{SYMBOLS[name]} {unit(UNITS[name])}", *(_cell(document[name]) for document in documents))
        for name in given
    )
    notes: dict[str, list[str]] = {}
    for document in documents:
        for line in _notes(document):
            notes.setdefault(line, []).append(document["estimator"])
    return [
        TextTable("Coefficients ± one standard deviation", ("quantity", *names), rows),
        _runs("ωn [rad/s] of the runs ± one standard deviation", "omega_n", documents, names),
        _runs("ζ [1] of the runs ± one standard deviation", "zeta", documents, names),
        *(f"{', '.join(names)}: {line}" for line, names in notes.items()),
    ]


def _runs(title: str, key: str, documents: Sequence[Document], names: tuple[str, ...]) -> TextTable:
    found = [{run["id"]: run[key] for run in document["runs"]} for document in documents]
    ids = list(dict.fromkeys(name for runs in found for name in runs))[:_MOST_RUNS]
    rows = tuple((name, *(_cell(runs.get(name)) for runs in found)) for name in ids)
    return TextTable(title, ("run", *names), rows)


def _cell(quantity: Document | None) -> str:
    return "–" if quantity is None else with_std(quantity["value"], quantity["std"])


def _notes(document: Document) -> list[str]:
    from identification.printing.estimate_tables import status_lines
    from identification.remark import Remark

    said = [str(Remark.from_json_dict(remark)) for remark in document["remarks"]]
    return [*said, *status_lines(document)]


def budget_parts(document: Document) -> list[str | TextTable]:
    """The budget of an estimate: the standard uncertainty from every source, and which dominates.

    Args:
        document: an estimate with its ``budget``.
    """
    components = document["budget"]["components"]
    combined = document["budget"]["combined_std"]
    names = [name for name in UNITS if name in combined]
    headings = tuple(f"{SYMBOLS[name]}\n{unit(UNITS[name])}" for name in names)
    rows = [(one["name"], *(_share(one, name) for name in names)) for one in components]
    rows.append(("all together", *(significant(combined[name], 2) for name in names)))
    title = "Uncertainty budget: one standard uncertainty each"
    table = TextTable(title, ("source", *headings), tuple(rows), right=headings)
    notes = [f"{one['name']}: {one['note']}" for one in components if one["note"]]
    return [table, *(_dominant(components, name) for name in names), *notes]


def _share(component: Document, name: str) -> str:
    variance = float(component["variance"][name])
    if variance == 0.0:
        return "0" if component["known"] else "–"
    return f"{'−' if variance < 0.0 else ''}{significant(sqrt(abs(variance)), 2)}"


def _dominant(components: Sequence[Document], name: str) -> str:
    largest = max(components, key=lambda one: float(one["variance"][name]))
    total = sum(float(one["variance"][name]) for one in components)
    share = 100.0 * float(largest["variance"][name]) / total if total > 0.0 else 0.0
    return f"{SYMBOLS[name]}: most comes from {largest['name']}, {share:.0f} % of the variance"
