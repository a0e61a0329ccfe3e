"""The head of a sheet: its first row of numbers, the names and units of its columns, and numbers stated above."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from tunnel_sim.files.importing.formats.cells import is_missing, is_number, like_number
from tunnel_sim.files.importing.tables import LEAST_ROWS, names_runs
from tunnel_sim.files.importing.units import HERTZ, UNITS, kind_of, known_unit, split_unit, unit_beside

_FACT = re.compile(
    r"(?:^|[,;|\t])\W*([^\W\d_](?:[^\d:=,;\t]|(?<=[^\W_])\d|(?<=\^)-?\d)*?)\s*[:=,;\t]\s*"
    r"(?:([^\s\d:=,;\t|][^:=,;\t|]{0,14}?)\s*[;,\t]\s*)?([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)"
    r"(?!\d|[.:/-]\d) *([;,\t]? *[^\s\d;,\t|=:][^;,\t|=:]*(?![^;,\t|]))?"
)
"""A name, perhaps a cell with its unit, a number, and its unit, perhaps in the next cell; not a date or time."""
_SI = {kind: next(unit for unit, factor in units.items() if factor == 1.0) for kind, units in UNITS.items()}
_AXIS = re.compile(r"(?i)\W*(horizontal|vertical) units?\s*[,:;=\t]\s*(.+)$")
_COUNTS = ("sequence", "points")  # beside units: the column counts samples
_LONG_UNIT = 8  # characters: a longer text is a name
LONGEST_LINE = 1000  # characters: a longer line above a table does not state a number


@dataclass(frozen=True)
class Layout:
    """The head of a sheet: its first row of numbers, its columns, and numbers stated above, in SI units.

    Args:
        beside: indices of columns that hold the header of others, as in the files of some oscilloscopes.
    """

    first: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    headed: bool
    facts: Mapping[str, float]
    beside: tuple[int, ...] = ()

    @property
    def runs(self) -> int | None:
        """Index of the column that gives the run of a row."""
        columns = enumerate(zip(self.names, self.units, strict=True))
        return next((i for i, (name, unit) in columns if names_runs(name) and not unit), None)


def changed_columns(layout: Layout, row: Sequence[object]) -> dict[int, str]:
    """The columns that another heading below the first one gives another unit or place, and what it states."""
    cells = [cell.strip(' "') if isinstance(cell, str) else "" for cell in row]
    found = {}
    for i, (name, unit) in enumerate(map(split_unit, cells)):
        moved = name != layout.names[i] and name in layout.names
        other_unit = known_unit(unit) is not None and layout.units[i] not in ("", unit)
        if cells[i] and (moved or other_unit):
            found[i] = cells[i]
    return found


def facts_in(lines: Sequence[str]) -> dict[str, float]:
    """Numbers stated in lines, such as ``Sample rate: 1000 Hz`` or ``V = 54 km/h``, by name and unit.

    Returns:
        Values in SI units if the unit is known; the name then ends with it in brackets. NaN for a name with
        several numbers: which of them belongs to a run is not known.
    """
    facts: dict[str, float] = {}
    for line in (line.replace('"', "") for line in lines if len(line) <= LONGEST_LINE):
        for name, before, number, behind in _FACT.findall(line):
            name = name.strip()
            if before and known_unit(before) is None:  # a cell with the name, after a heading
                name, before = before, ""
            text = (before or behind.lstrip(";,\t ")).strip("()[] ")
            unit, value = known_unit(text), float(number.replace(",", "."))
            if unit is not None:
                text, value = _SI[kind_of(unit)], value * UNITS[kind_of(unit)][unit]
            elif text.lower() in HERTZ:
                text, value = "", value * HERTZ[text.lower()]
            heading = f"{name} ({text})" if text else name
            facts[heading] = value if facts.get(heading, value) == value else float("nan")
    return facts


def find_layout(
    rows: Sequence[Sequence[str]], lines: Sequence[str], decimal: str, width: int
) -> Layout | None:
    """Names, units and the first row of numbers of a sheet, given the cells and lines of its head; or None."""
    tail = [row for row in rows[len(rows) // 2 :] if any(cell for cell in row)]
    # a column with both signs has no separators of thousands
    other = "." if decimal == "," else ","
    pointed = {
        i
        for row in rows
        for i, cell in enumerate(row)
        if is_number(cell, other) and not like_number(cell, decimal)
    }

    def is_read(cell: str, column: int) -> bool:
        return is_number(cell, decimal) or (column not in pointed and like_number(cell, decimal))

    numeric = [
        column
        for column in range(width)
        if 2 * sum(column < len(row) and is_read(row[column], column) for row in tail) > len(tail)
    ]

    def is_data(row: Sequence[str]) -> bool:
        cells = [(row[column] if column < len(row) else "", column) for column in numeric]
        unread = [cell for cell, column in cells if not is_read(cell, column)]
        return len(unread) < len(cells) and all(map(is_missing, unread))

    data = [is_data(row) for row in rows]
    starts = [i for i in range(len(rows)) if all(data[i : i + 3])]
    headings = [i for i, row in enumerate(rows) if len(row) > 1 and _is_heading(row, numeric, decimal)]
    first = next(iter(starts), None)
    if first is None:
        return None
    # a short table above the record has another heading below it
    for heading in (i for i in headings if i > first):
        following = next((i for i in starts if i > heading), None)
        if following is None or sum(data[first:heading]) >= LEAST_ROWS:
            break
        first = following
    above = []  # the rows that may name every column
    for index, row in enumerate(rows[:first]):
        cells = [cell.strip().strip('"').strip() for cell in row]
        if cells:
            cells[0] = cells[0].lstrip("#%!*/;").strip()
        while len(cells) > width and not cells[-1]:
            cells.pop()
        texts = [cell for cell in cells if cell and not is_number(cell, decimal)]
        if len(cells) <= width and 2 * len(texts) >= width and (width <= 1 or len(texts) > 1):
            above.append((index, cells + [""] * (width - len(cells))))
    units, numbers = _units_row(above, width, decimal)
    names = list(above[-1][1]) if above else []
    if names and numeric[:2] == [0, 1] and not names[-1] and _counts_rows(rows[first:], decimal):
        names = ["", *names[:-1]]  # the numbers of the rows have no name
    split = [split_unit(name) for name in names]
    named = [name or f"column {i + 1}" for i, (name, _) in enumerate(split)]
    stated = list(lines[: above[-1][0] if above else first])
    beside: tuple[int, ...] = ()
    if not names:
        beside, found = _beside(rows, numeric)
        stated += found
    given = [one or own for (_, one), own in zip(split or [("", "")] * width, units, strict=True)]
    return Layout(
        first,
        tuple(distinct(named)) or tuple(f"column {i + 1}" for i in range(width)),
        tuple(_of_scope(stated, given, numeric)),
        bool(names),
        facts_in(stated) | numbers,
        beside,
    )


def _counts_rows(rows: Sequence[Sequence[str]], decimal: str) -> bool:
    """Whether the first column numbers the rows, and the second one increases as times do."""
    pairs = [
        row[:2] for row in rows[:LEAST_ROWS] if len(row) > 1 and all(is_number(c, decimal) for c in row[:2])
    ]
    if len(pairs) < LEAST_ROWS:
        return False
    counts, times = ([float(pair[i].replace(",", ".")) for pair in pairs] for i in (0, 1))
    steps = [[b - a for a, b in pairwise(numbers)] for numbers in (counts, times)]
    return counts[0] in (0.0, 1.0) and set(steps[0]) == {1.0} and min(steps[1]) > 0.0


def _is_heading(row: Sequence[str], numeric: Sequence[int], decimal: str) -> bool:
    """Whether a row names every column of numbers."""
    cells = [row[i].strip(' "') if i < len(row) else "" for i in numeric]
    return len(set(cells)) > 1 and all(cell and not like_number(cell, decimal) for cell in cells)


def _units_row(
    above: list[tuple[int, list[str]]], width: int, decimal: str
) -> tuple[list[str], dict[str, float]]:
    """The units in the last of the rows that may name columns, and numbers there; it is removed if it states them.

    Known units, or others in brackets; or more known units than short texts. Numbers stand below their names.
    """
    units = [""] * width
    stated = [cell for cell in above[-1][1] if cell.strip("-")] if len(above) > 1 else []
    numbers = [cell for cell in stated if is_number(cell, decimal)]
    stated = [cell for cell in stated if cell not in numbers and cell.lower() not in _COUNTS]
    known = [cell for cell in stated if known_unit(cell) is not None]
    bare = [cell for cell in stated if cell not in known and not re.fullmatch(r"[\[({].*[\])}]", cell)]
    few = len(known) > len(bare) and all(len(cell) <= _LONG_UNIT for cell in bare)
    if not known or (bare and not few):
        return units, {}
    beside = above.pop()[1]
    pairs = list(zip(above[-1][1], beside, strict=True))
    facts = {name: float(cell.replace(",", ".")) for name, cell in pairs if name and cell in numbers}
    return ["" if cell in numbers else unit_beside(name, cell) for name, cell in pairs], facts


def _beside(rows: Sequence[Sequence[str]], numeric: Sequence[int]) -> tuple[tuple[int, ...], list[str]]:
    """Columns that hold a header beside the first rows of numbers, and their lines; empty: there are none."""
    columns = [i for i in range(numeric[-1]) if i not in numeric]
    blocks = [[i for i in columns if i < end] for end in (i for i in numeric if i - 1 in columns)]
    found: list[int] = []
    lines = []
    for block in blocks:
        block = [i for i in block if i not in found]
        texts = [[row[i].strip() for i in block if i < len(row)] for row in rows]
        filled = [index for index, cells in enumerate(texts) if any(cells)]
        pairs = [cells for cells in texts if len(cells) > 1 and cells[0] and any(cells[1:])]
        if filled and 2 * filled[-1] < len(rows) and 2 * len(pairs) >= len(filled):
            lines += [",".join(filter(None, cells)) for cells in pairs]
            found += block
    return tuple(found), lines


def _of_scope(lines: Sequence[str], units: Sequence[str], numeric: Sequence[int]) -> list[str]:
    """The units of columns; if they have none, from an oscilloscope's statements for both axes."""
    stated: dict[str, list[str]] = {}
    for line in lines:
        found = _AXIS.match(line.replace('"', ""))
        if found is not None:
            cells = [cell.strip() for cell in re.split(r"[,;\t]", found[2]) if cell.strip()]
            stated.setdefault(found[1].lower(), []).extend(cells)
    result = list(units)
    if not {"horizontal", "vertical"} <= set(stated) or any(units[i] for i in numeric):
        return result
    after = 0
    for column in numeric:
        first = column - 1 not in numeric and column + 1 in numeric  # of a block: the times
        cells = stated["horizontal"] if first else stated["vertical"]
        text = cells[0] if first else cells[min(after, len(cells) - 1)] if cells else ""
        after += not first
        result[column] = known_unit(text) or text
    return result


def distinct(names: Sequence[str]) -> list[str]:
    """Names of columns, with the position added to an ambiguous name."""
    counts = Counter(names)
    return [name if counts[name] == 1 else f"{name} #{i + 1}" for i, name in enumerate(names)]
