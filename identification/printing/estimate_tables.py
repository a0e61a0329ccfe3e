"""An estimate as tables and notes, from its JSON document."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identification.printing.numbers import SYMBOLS, unit, unit_mark, with_std
from identification.printing.table import TextTable
from identification.remark import Remark
from identification.status import Status

SHOWN_RUNS = 16
"""At most this many runs are listed."""

Document = Mapping[str, Any]


def estimate_parts(document: Document) -> list[str | TextTable]:
    """What is printed of an estimate.

    Returns:
        The coefficients, the runs, and a paragraph for each note.
    """
    notes = [str(Remark.from_json_dict(remark)) for remark in document["remarks"]]
    notes += status_lines(document)
    left = len(document["runs"]) - SHOWN_RUNS
    more = f"and {left} more runs, which runs_frame() lists" if left > 0 else ""
    return [coefficients_table(document), runs_table(document), more, *(f"Note: {note}" for note in notes)]


def estimate_brief(document: Document) -> str:
    """An estimate in three lines: its coefficients, its runs, and where to go from here."""
    names = {**SYMBOLS, "omega_n": "ωn", "zeta": "ζ"}
    run: Document = document["runs"][0] if document["runs"] else {}
    whole = [(name, document[name]) for name in SYMBOLS if document[name] is not None]
    shown = whole or [(name, run[name]) for name in ("omega_n", "zeta") if run.get(name) is not None]
    found = [f"{names[name]} = {_with_std(given)} {unit_mark(given['unit'])}" for name, given in shown]
    place = "" if whole or not run else f" of {run['id']}"
    status = document["status"].replace("_", " ")
    count = f"{len(document['runs'])} run{'' if len(document['runs']) == 1 else 's'}"
    return (
        f"Estimate of {document['campaign']!r} by {document['estimator']}: {status}, {count}\n"
        f"  {', '.join(found) + place or 'no value'}\n"
        "  print() shows all; .to_frame(), .runs_frame(), .windows_frame()"
    )


def coefficients_table(document: Document) -> TextTable:
    """The campaign's coefficients that could be identified.

    Returns:
        A table; without rows when the campaign gives normalised form only.
    """
    names = {**SYMBOLS, "wind_off_inertia": "Izz, gradient of Kr over ωn²"}
    rows = tuple(
        (f"{symbol} {unit(document[name]['unit'])}", _with_std(document[name]))
        for name, symbol in names.items()
        if document[name] is not None
    )
    title = f"{document['campaign']} by {document['estimator']}"
    return TextTable(title, ("quantity", "estimate ± std"), rows)


def runs_table(document: Document) -> TextTable:
    """Natural frequency and damping ratio of the first runs.

    Returns:
        A table with a row for each run, `SHOWN_RUNS` of them at most.
    """
    rows = tuple(
        (run["id"], _with_std(run["omega_n"]), _with_std(run["zeta"]), run["status"].replace("_", " "))
        for run in document["runs"][:SHOWN_RUNS]
    )
    title = f"Runs of {document['campaign']} ± one standard deviation"
    return TextTable(title, ("run", "ωn [rad/s]", "ζ [1]", "status"), rows)


def status_lines(document: Document) -> list[str]:
    """What the estimate and its runs have to say, each thing once.

    Returns:
        A line for each status other than "identified", with the runs it concerns and the remedy.
    """
    runs: dict[str, list[str]] = {name: [] for name in document["statuses"] if name != "ok"}
    for run in document["runs"]:
        for name in run["statuses"]:
            if name != "ok":
                runs.setdefault(name, []).append(run["id"])
    count = len(document["runs"])
    return [
        Status[name.upper()].value + (f" ({', '.join(ids)})" if ids and len(ids) < count else "")
        for name, ids in runs.items()
    ]


def _with_std(quantity: Document | None) -> str:
    return "–" if quantity is None else with_std(quantity["value"], quantity["std"])
