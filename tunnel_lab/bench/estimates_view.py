"""Estimates side by side as tables, from the JSON documents of ``tunnel identify``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from identification.estimate import UNITS
from identification.printing.numbers import SYMBOLS, unit, with_std
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
