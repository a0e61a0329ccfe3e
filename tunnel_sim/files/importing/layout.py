"""Where the numbers of a sheet of texts begin, and what the lines above them say."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from tunnel_sim.files.importing.tables import names_runs
from tunnel_sim.files.importing.units import UNITS, kind_of, known_unit, split_unit

MISSING = ("", "nan", "-nan", "#n/a", "n/a", "na", "null", "none", "-", "--", "inf", "-inf", "#num!")
"""Texts, in lower case, that stand for a missing number."""
_NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_FACT = re.compile(
    r"(?:^|[,;|\t])\W*([^\W\d_][^\d:=,;\t]*?)\s*[:=,;\t]\s*([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)"
    r" *([;,\t]? *[^\s\d;,\t|=:][^;,\t|=:]*(?![^;,\t|]))?"
)
"""A name, a number, and its unit, perhaps in the next cell."""
_HERTZ = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}
_LONG_UNIT = 8  # characters: a longer text is a name


def is_number(text: str, decimal: str = ".") -> bool:
    """Whether a text is a number.

    Args:
        decimal: the decimal sign.
    """
    return _NUMBER[decimal].fullmatch(text) is not None


def is_missing(text: str) -> bool:
    """Whether a text stands for a missing number."""
    return text.lower() in MISSING


@dataclass(frozen=True)
class Layout:
    """The head of a sheet.

    Args:
        first: index of the first row of numbers.
        names: of the columns, without units.
        units: of the columns, as `split_unit` gives them.
        headed: whether the names are those of the file.
        facts: numbers that the lines above the table state, by name, in SI units where their unit is known.
    """

    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    headed: bool
    facts: Mapping[str, float]

    @property
    def runs(self) -> int | None:
        """Index of the column that says to which run a row belongs."""
        found = (
            i
            for i, (name, unit) in enumerate(zip(self.names, self.units, strict=True))
            if names_runs(name) and not unit
        )
        return next(found, None)


def find_layout(
    rows: Sequence[Sequence[str]], lines: Sequence[str], decimal: str, width: int
) -> Layout | None:
    """Find names, units and the first row of numbers.

    Args:
        rows: the first rows of the sheet, split into cells.
        lines: the same rows as they are, for numbers stated in them.
        decimal: the decimal sign.
        width: number of columns (a count).

    Returns:
        The layout; None where no row holds numbers.
    """
    first = _first_row(rows, decimal, width)
    if first is None:
        return None
    above = [
        (index, cells)
        for index, row in enumerate(rows[:first])
        if (cells := _heading(row, width, lambda text: is_number(text, decimal))) is not None
    ]
    units: list[str] = [""] * width
    if len(above) > 1 and _are_units(above[-1][1]):
        units = [known_unit(cell) or cell.strip("()[]{} -") for cell in above.pop()[1]]
    names = list(above[-1][1]) if above else []
    split = [split_unit(name) for name in names]
    named = [name or f"column {i + 1}" for i, (name, _) in enumerate(split)]
    if len(set(named)) < len(named):  # ambiguous names: the position distinguishes them
        named = [name if named.count(name) == 1 else f"{name} #{i + 1}" for i, name in enumerate(named)]
    return Layout(
        first,
        tuple(named) or tuple(f"column {i + 1}" for i in range(width)),
        tuple(stated or own for (_, stated), own in zip(split or [("", "")] * width, units, strict=True)),
        bool(names),
        _facts(lines[: above[-1][0] if above else first]),
    )


def _first_row(rows: Sequence[Sequence[str]], decimal: str, width: int) -> int | None:
    """The first row from which on the columns of numbers hold numbers."""
    tail = [row for row in rows[len(rows) // 2 :] if any(cell for cell in row)]
    numeric = [
        column
        for column in range(width)
        if 2 * sum(column < len(row) and is_number(row[column], decimal) for row in tail) > len(tail)
    ]
    if not numeric:
        return None

    def is_data(row: Sequence[str]) -> bool:
        cells = [row[column] if column < len(row) else "" for column in numeric]
        filled = sum(is_number(cell, decimal) for cell in cells)
        return filled > 0 and all(is_number(cell, decimal) or is_missing(cell) for cell in cells)

    return next((i for i in range(len(rows)) if all(map(is_data, rows[i : i + 3]))), None)


def _heading(row: Sequence[str], width: int, number: Callable[[str], bool]) -> list[str] | None:
    """The cells of a row that may name every column; None where it may not."""
    cells = [cell.strip().strip('"').strip() for cell in row]
    if cells:
        cells[0] = cells[0].lstrip("#%!*/;").strip()
    while len(cells) > width and not cells[-1]:
        cells.pop()
    texts = [cell for cell in cells if cell and not number(cell)]
    if len(cells) > width or 2 * len(texts) < width or (width > 1 and len(texts) < 2):
        return None
    return cells + [""] * (width - len(cells))


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a row holds units: known ones or others in brackets, or as many known ones as short texts."""
    said = [cell for cell in cells if cell.strip("-")]
    known = sum(known_unit(cell) is not None for cell in said)
    others = [cell for cell in said if known_unit(cell) is None and not re.fullmatch(r"[\[({].*[\])}]", cell)]
    return known > 0 and (
        not others or (known > len(others) and all(len(cell) <= _LONG_UNIT for cell in others))
    )


def _facts(lines: Sequence[str]) -> dict[str, float]:
    """Numbers such as ``Sample rate: 1000 Hz`` or ``V = 54 km/h``, in SI units where the unit is known."""
    found = {}
    for line in lines:
        for name, number, text in _FACT.findall(line):
            text = text.lstrip(";,\t ").strip("()[] ")
            unit = known_unit(text) or ""
            factor = _HERTZ.get(text.lower()) or UNITS.get(kind_of(unit), {}).get(unit, 1.0)
            value = float(number.replace(",", ".")) * factor
            strange = text and not unit and text.lower() not in _HERTZ
            found[f"{name.strip()} ({text})" if strange else name.strip()] = value
    return found
