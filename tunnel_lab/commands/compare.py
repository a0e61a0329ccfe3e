"""``tunnel compare``: diagnoses side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument

from identification.printing import COEFFICIENTS
from identification.show.blocks import TextTable
from identification.show.numbers import estimated, in_stds, probability, share, unit, unit_mark, with_std
from identification.show.quantity import Quantity
from tunnel_lab.terminal.outputs import show
from tunnel_lab.terminal.table_format import TableFormat, chosen
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError, one_line, shown

if TYPE_CHECKING:
    from diagnosis.result import Diagnosis

_NONE = "–"


def compare(
    documents: Annotated[
        tuple[Path, ...], Argument(metavar="DIAGNOSIS.json", help="Written by tunnel diagnose --json.")
    ],
) -> None:
    """Compare diagnoses, such as before and after a repair of the rig.

    For each diagnosis: the gap (its power over the noise's) without and with
    the causes, the causes with their parameters, and the coefficients with standard
    deviations. The last table shows the difference of each coefficient from the
    first diagnosis; it assumes that the campaigns are independent. In CSV and JSON
    every number has a column of its own, and another for its standard deviation.

    [bold]Examples[/bold]
      tunnel compare before.json after.json
      tunnel compare may.json june.json july.json --format csv

    [bold]Exit status[/bold]
      0 compared, 2 bad input.
    """
    from tunnel_lab.report.diagnosis_file import read_diagnosis

    if len(documents) < 2:
        raise TunnelError("only one diagnosis", where=shown(documents[0]), remedy="name two files or more")
    diagnoses = [read_diagnosis(path) for path in documents]
    if other := next((one for one in diagnoses if one.motion != diagnoses[0].motion), None):
        path, motions = documents[diagnoses.index(other)], (other.motion, diagnoses[0].motion)
        what = "has motion = '{}', and the first one has '{}'".format(*motions)
        raise TunnelError(what, where=shown(path), remedy="compare diagnoses of one kind of motion")
    # the campaign's name; the file's if campaigns share a name; with a number if files share it too
    names, stems = [d.campaign for d in diagnoses], [one_line(path.stem) for path in documents]
    if len(set(names)) < len(names):
        names = stems
    if len(set(names)) < len(names):
        names = [f"{place}: {stem}" for place, stem in enumerate(stems, 1)]
    numbers = chosen.get() in (TableFormat.CSV, TableFormat.JSON)
    tables = [table.numbers() if numbers else table.texts() for table in comparisons(names, diagnoses)]
    show(diagnoses[0].freedom.texts(tables, names))


@dataclass(frozen=True)
class Entry:
    """A quantity in one diagnosis: in words, and as a number if there is one."""

    text: str = _NONE
    number: Quantity | None = None


@dataclass(frozen=True)
class ComparedRow:
    """A quantity of every diagnosis.

    Args:
        unit: unit of its numbers; empty if the cells are words.
        labelled: whether a reader finds the unit beside the first label instead of in the cells.
    """

    labels: tuple[str, ...]
    cells: Sequence[Entry]
    unit: str = ""
    labelled: bool = True


@dataclass(frozen=True)
class SideBySide:
    """A table of a comparison.

    Args:
        names: names of the diagnoses, a column each.
    """

    title: str
    labels: tuple[str, ...]
    names: tuple[str, ...]
    rows: Sequence[ComparedRow]

    def texts(self) -> TextTable:
        """The table for a reader: a value and its standard deviation share a cell."""
        rows = []
        for row in self.rows:
            first, *others = row.labels
            label = f"{first} {unit(row.unit)}" if row.labelled and row.unit else first
            rows.append((label, *others, *(cell.text for cell in row.cells)))
        return TextTable(self.title, (*self.labels, *self.names), tuple(rows))

    def numbers(self) -> TextTable:
        """The table for a program: each number alone in its cell; a missing number leaves the cell empty."""
        given = [cell.number for row in self.rows for cell in row.cells if cell.number is not None]
        ends = ("low", "high") if any(number.interval is not None for number in given) else ()
        heads = [
            f"{name}{part}" for name in self.names for part in ("", ": std", *(f": {end}" for end in ends))
        ]
        rows = (
            (
                *row.labels,
                row.unit if row.unit != "1" else "",
                *(text for cell in row.cells for text in _alone(cell)[: 2 + len(ends)]),
            )
            for row in self.rows
        )
        return TextTable(self.title, (*self.labels, "unit", *heads), tuple(rows), right=tuple(heads))


def _alone(cell: Entry) -> list[str]:
    """The texts of a cell and of the columns beside it: value, deviation and ends of the interval, or words."""
    one = cell.number
    if one is None:
        return ["" if cell.text == _NONE else cell.text, "", "", ""]
    numbers = (one.value if one.determined else None, one.std, *(one.interval or (None, None)))
    return ["" if number is None else f"{number:.7g}" for number in numbers]


def comparisons(names: Sequence[str], answers: Sequence[Diagnosis]) -> list[SideBySide]:
    """All tables of a comparison: gap and answer, parameters, coefficients, and their differences from the first.

    Args:
        names: names of the diagnoses, all different.
        answers: the diagnoses, the reference first.
    """
    units = {name: given.unit for answer in answers for name, given in answer.coefficients.after.items()}
    symbols = {name: COEFFICIENTS.get(name, name) for name in units}
    coefficients = [
        ComparedRow((symbols[name], model), [_estimate(given.get(name)) for given in coefficients], of)
        for name, of in units.items()
        for model, coefficients in (
            ("without the causes", [answer.coefficients.before for answer in answers]),
            ("with the causes", [answer.coefficients.after for answer in answers]),
        )
    ]
    first, *others = (answer.coefficients.after for answer in answers)
    differences = [
        ComparedRow((symbols[name],), [_difference(first.get(name), other.get(name)) for other in others], of)
        for name, of in units.items()
    ]
    parameters = [_parameters(answer) for answer in answers]
    keys = dict.fromkeys(key for cells in parameters for key in cells)
    rows = [
        ComparedRow(key[:2], [each.get(key, Entry()) for each in parameters], key[2], labelled=False)
        for key in keys
    ]
    given, change = tuple(names), f"Coefficients with the causes: difference from {names[0]}"
    return [
        SideBySide("Gap and answer", ("quantity",), given, _gap_and_answer(answers)),
        SideBySide("Parameters ± one standard deviation", ("effect", "parameter"), given, rows),
        SideBySide("Coefficients ± one standard deviation", ("quantity", "model"), given, coefficients),
        SideBySide(change, ("quantity",), given[1:], differences),
    ]


def _gap_and_answer(answers: Sequence[Diagnosis]) -> list[ComparedRow]:
    """Gap and causes of each diagnosis."""

    def excess(answer: Diagnosis, value: float) -> Entry:
        """An excess with its standard deviation by chance, if the diagnosis has the noise of its runs."""
        std = None if answer.maps is None else answer.maps.excess_std
        text = f"{value:.4g}" if std is None else with_std(value, std)
        return Entry(text, Quantity(value, std, "1"))

    def percent(value: float, text: str) -> Entry:
        return Entry(text, Quantity(100.0 * value, None, "%"))

    after = [excess(d, d.gap.excess_after) if d.names_effects else Entry() for d in answers]
    explained = [percent(d.gap.closed, share(d.gap.closed)) if d.names_effects else Entry() for d in answers]
    chances = [answer.candidates[0].probability for answer in answers]
    return [
        ComparedRow(("gap",), [excess(d, d.gap.excess_before) for d in answers], "× noise variance"),
        ComparedRow(("residual gap",), after, "× noise variance"),
        ComparedRow(("share explained",), explained, "%", labelled=False),
        ComparedRow(("causes",), [Entry(",\n".join(d.causes) or "none") for d in answers]),
        ComparedRow(("decided",), [Entry("yes" if d.decided else "no") for d in answers]),
        ComparedRow(("or instead",), [Entry(",\n".join(d.ambiguous_with) or _NONE) for d in answers]),
        ComparedRow(
            ("probability",),
            [percent(chance, probability(chance)) for chance in chances],
            "%",
            labelled=False,
        ),
    ]


def _parameters(answer: Diagnosis) -> dict[tuple[str, str, str], Entry]:
    """The parameters of an answer by effect, name and unit; a scatter has its interval."""
    first, cells = answer.candidates[0], {}
    spreads = {one.effect: _in_percent(one.width, one.interval) for one in answer.repeated.spreads}
    for full, given in first.parameters.items():
        owner, _, name = full.rpartition(".")
        owner = owner or first.effect
        width = answer.repeated.spread_estimate(owner, given)
        text = width or estimated(given, unit_mark(beside(given.unit, "")))
        number = given if width is None else spreads.get(owner, _in_percent(given.value))
        cells[owner, name, number.unit] = Entry(text, number)
    return cells


def _in_percent(width: float, interval: tuple[float, float] | None = None) -> Quantity:
    """A relative width of scatter with its interval."""
    ends = None if interval is None else (100.0 * interval[0], 100.0 * interval[1])
    return Quantity(100.0 * width, None, "%", ends)


def _estimate(given: Quantity | None) -> Entry:
    return Entry() if given is None else Entry(estimated(given), given)


def _difference(mine: Quantity | None, theirs: Quantity | None) -> Entry:
    """The difference of a coefficient from the first diagnosis, with independent errors."""
    if mine is None or theirs is None or mine.unit != theirs.unit or mine.std is None or theirs.std is None:
        return Entry()
    moved, std = theirs.value - mine.value, math.hypot(mine.std, theirs.std)
    return Entry(f"{with_std(moved, std)} ({in_stds(moved, std)})", Quantity(moved, std, mine.unit))
