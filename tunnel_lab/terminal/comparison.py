"""Diagnoses side by side: their gaps, answers, parameters and coefficients as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from diagnosis.printing import excess_std, probability, share
from identification.printing.numbers import coefficient_label, estimated, in_stds, unit_mark, with_std
from identification.printing.table import TextTable

Document = Mapping[str, Any]
Rows = tuple[tuple[str, ...], ...]
_NONE = "–"


def comparison_tables(names: Sequence[str], documents: Sequence[Document]) -> list[TextTable]:
    """All tables of a comparison.

    Args:
        names: of the documents, each different.
        documents: of diagnoses, the reference first.

    Returns:
        Gap and answer, parameters of the answers, coefficients, and the coefficients' differences from the first.
    """
    one, two = ("quantity",), ("effect", "parameter")
    change = f"Coefficients with the causes: difference from {names[0]}"
    return [
        TextTable("Gap and answer", (*one, *names), _answer_rows(documents)),
        TextTable("Parameters ± one standard deviation", (*two, *names), _parameter_rows(documents)),
        TextTable("Coefficients ± one standard deviation", (*one, *names), _coefficient_rows(documents)),
        TextTable(change, (*one, *names[1:]), _differences(documents)),
    ]


def _answer_rows(documents: Sequence[Document]) -> Rows:
    return (
        ("gap [noise powers]", *(_excess(d, "excess_before") for d in documents)),
        ("left [noise powers]", *(_left(d) for d in documents)),
        ("share closed", *(share(d["gap"]["closed"]) if _explained(d) else _NONE for d in documents)),
        ("causes", *(",\n".join(d["causes"]) or "none" for d in documents)),
        ("decided", *("yes" if d["decided"] else "no" for d in documents)),
        ("or", *(",\n".join(d["ambiguous_with"]) or _NONE for d in documents)),
        ("probability", *(probability(d["candidates"][0]["probability"]) for d in documents)),
    )


def _explained(document: Document) -> bool:
    return document["causes"] not in ([], ["unknown"])


def _left(document: Document) -> str:
    return _excess(document, "excess_after") if _explained(document) else _NONE


def _excess(document: Document, key: str) -> str:
    """An excess with its standard deviation by chance, where the document has the noise of its runs."""
    value, std = document["gap"][key], excess_std(document)
    return f"{value:.4g}" if std is None else with_std(value, std)


def _parameter_rows(documents: Sequence[Document]) -> Rows:
    found = [_parameters(document) for document in documents]
    names = dict.fromkeys(name for parameters in found for name in parameters)
    return tuple((*name, *(parameters.get(name, _NONE) for parameters in found)) for name in names)


def _parameters(document: Document) -> dict[tuple[str, str], str]:
    """The answer's parameters by effect and name."""
    answer, found = document["candidates"][0], {}
    for full, given in answer["parameters"].items():
        owner, _, name = full.rpartition(".")
        found[owner or answer["effect"], name] = estimated(given, _mark(given))
    return found


def _mark(given: Document) -> str:
    return "" if given["unit"] == "1" else unit_mark(given["unit"])


def _coefficient_rows(documents: Sequence[Document]) -> Rows:
    return tuple(
        (f"{label} {key}", *(_estimate(document, key, name) for document in documents))
        for name, label in _labels(documents).items()
        for key in ("before", "after")
    )


def _estimate(document: Document, key: str, name: str) -> str:
    given = document["coefficients"][key].get(name)
    return _NONE if given is None else estimated(given)


def _labels(documents: Sequence[Document]) -> dict[str, str]:
    """Symbol and unit of every coefficient by its name."""
    return {
        name: coefficient_label(name, given["unit"])
        for document in documents
        for name, given in document["coefficients"]["after"].items()
    }


def _differences(documents: Sequence[Document]) -> Rows:
    first, *others = (document["coefficients"]["after"] for document in documents)
    return tuple(
        (label, *(_difference(first.get(name), other.get(name)) for other in others))
        for name, label in _labels(documents).items()
    )


def _difference(one: Document | None, two: Document | None) -> str:
    """The second estimate minus the first, taken as independent of each other."""
    if one is None or two is None or one["std"] is None or two["std"] is None or one["unit"] != two["unit"]:
        return _NONE
    change, std = two["value"] - one["value"], math.hypot(one["std"], two["std"])
    return f"{with_std(change, std)} ({in_stds(change, std)})"
