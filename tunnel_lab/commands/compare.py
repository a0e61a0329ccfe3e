"""``tunnel compare``: diagnoses side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from identification.printing import TextTable, coefficient_label, estimated, in_stds, unit_mark, with_std

NAME = "compare"
Document = Mapping[str, Any]
Rows = tuple[tuple[str, ...], ...]
_NONE = "–"


def run(
    documents: Annotated[
        list[Path], typer.Argument(metavar="DIAGNOSIS.json", help="Written by tunnel diagnose --json.")
    ],
) -> None:
    """Compare diagnoses, such as before and after a repair of the rig.

    For each diagnosis: the gap (noise powers) before and with the causes, the causes
    with their parameters, and the coefficients with standard deviations. Then the
    difference of each coefficient from the first diagnosis, for campaigns that are
    independent of each other.

    [bold]Examples[/bold]
      tunnel compare before.json after.json
      tunnel compare may.json june.json july.json --format csv

    [bold]Exit status[/bold]
      0 compared, 2 bad input.
    """
    from tunnel_lab.report.diagnosis_file import read_diagnosis
    from tunnel_lab.terminal.tables import rich_table, show_tables
    from tunnel_sim.vocabulary.errors import TunnelError, shown

    if len(documents) < 2:
        raise TunnelError("only one diagnosis", where=shown(documents[0]), remedy="name two files or more")
    diagnoses = [read_diagnosis(path) for path in documents]
    names = _names(documents, diagnoses)
    show_tables(*(rich_table(table) for table in comparison_tables(names, diagnoses)))


def _names(paths: Sequence[Path], documents: Sequence[Mapping[str, Any]]) -> list[str]:
    """A name for each document: the campaign's; the file's where campaigns share a name; else a number too."""
    from tunnel_sim.vocabulary.errors import one_line

    for names in ([str(d["campaign"]) for d in documents], [one_line(path.stem) for path in paths]):
        if len(set(names)) == len(names):
            return names
    return [f"{place}: {one_line(path.stem)}" for place, path in enumerate(paths, 1)]


def comparison_tables(names: Sequence[str], documents: Sequence[Document]) -> list[TextTable]:
    """All tables of a comparison.

    Args:
        names: of the documents, each different.
        documents: of diagnoses, the reference first.

    Returns:
        Gap and answer, parameters of the answers, coefficients, and the coefficients' differences from the first.
    """
    from diagnosis.printing import probability, share

    answers: Rows = (
        ("gap [noise powers]", *(_excess(d, "excess_before") for d in documents)),
        ("left [noise powers]", *(_excess(d, "excess_after") if _explained(d) else _NONE for d in documents)),
        ("share closed", *(share(d["gap"]["closed"]) if _explained(d) else _NONE for d in documents)),
        ("causes", *(",\n".join(d["causes"]) or "none" for d in documents)),
        ("decided", *("yes" if d["decided"] else "no" for d in documents)),
        ("or", *(",\n".join(d["ambiguous_with"]) or _NONE for d in documents)),
        ("probability", *(probability(d["candidates"][0]["probability"]) for d in documents)),
    )
    coefficients: Rows = tuple(
        (f"{label} {key}", *(_estimate(document, key, name) for document in documents))
        for name, label in _labels(documents).items()
        for key in ("before", "after")
    )
    quantity, parameter = ("quantity",), ("effect", "parameter")
    change = f"Coefficients with the causes: difference from {names[0]}"
    return [
        TextTable("Gap and answer", (*quantity, *names), answers),
        TextTable("Parameters ± one standard deviation", (*parameter, *names), _parameter_rows(documents)),
        TextTable("Coefficients ± one standard deviation", (*quantity, *names), coefficients),
        TextTable(change, (*quantity, *names[1:]), _differences(documents)),
    ]


def _explained(document: Document) -> bool:
    return document["causes"] not in ([], ["unknown"])


def _excess(document: Document, key: str) -> str:
    """An excess with its standard deviation by chance, where the document has the noise of its runs."""
    from diagnosis.printing import excess_std

    value, std = document["gap"][key], excess_std(document)
    return f"{value:.4g}" if std is None else with_std(value, std)


def _parameter_rows(documents: Sequence[Document]) -> Rows:
    by_document = [_parameters(document) for document in documents]
    names = dict.fromkeys(name for parameters in by_document for name in parameters)
    return tuple((*name, *(parameters.get(name, _NONE) for parameters in by_document)) for name in names)


def _parameters(document: Document) -> dict[tuple[str, str], str]:
    """The answer's parameters by effect and name."""
    answer, texts = document["candidates"][0], {}
    for full, given in answer["parameters"].items():
        owner, _, name = full.rpartition(".")
        mark = "" if given["unit"] == "1" else unit_mark(given["unit"])
        texts[owner or answer["effect"], name] = estimated(given, mark)
    return texts


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


def _difference(first: Document | None, second: Document | None) -> str:
    """The second estimate minus the first, taken as independent of each other."""
    if (
        first is None
        or second is None
        or first["std"] is None
        or second["std"] is None
        or first["unit"] != second["unit"]
    ):
        return _NONE
    change, std = second["value"] - first["value"], math.hypot(first["std"], second["std"])
    return f"{with_std(change, std)} ({in_stds(change, std)})"
