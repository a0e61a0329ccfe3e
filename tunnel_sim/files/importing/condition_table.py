"""A user's table of conditions, with a row for each file or run."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path

from tunnel_sim.files.importing.condition_names import (
    RUN_KEYS,
    Conditions,
    condition_of,
    in_si,
    resembles,
    units_of,
)
from tunnel_sim.files.importing.formats.text import read_cells
from tunnel_sim.files.importing.tables import names_runs
from tunnel_sim.files.importing.units import split_unit
from tunnel_sim.files.reading import stem_of
from tunnel_sim.files.toml_input import validate
from tunnel_sim.vocabulary.errors import TunnelError, one_line, shown
from tunnel_sim.vocabulary.freedom import DISPLACEMENT


def _same(name: str) -> str:
    """A name in the form used for comparison: some systems decompose the accents of file names."""
    return unicodedata.normalize("NFC", name).lower()


_OF_FILES = re.compile(r"(?i)(file|datei)(_? ?name)?|sheet|blatt|tabelle|id")


class ConditionTable:
    """A table of conditions in a text file, one row for each file or run, with the names that files use too.

    Attributes:
        displaced: name of a column that only a displacement has; empty where there is none.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        names, rows = read_cells(path)
        split = [split_unit(name) for name in names]
        own = {i: twin for i, heading in enumerate(split) if (twin := _of_displacement(heading)) is not None}
        self.displaced = one_line(names[min(own)], 40) if own else ""
        split = [own[i][:2] if i in own else heading for i, heading in enumerate(split)]
        keys = [condition_of(*heading, alone=True) or resembles(*heading) for heading in split]
        of_runs = (names_runs(name) or _OF_FILES.fullmatch(name.strip()) for name in names)
        self._key = next((i for i, of_run in enumerate(of_runs) if of_run), None)
        used = {key: i for i, key in enumerate(keys) if key in RUN_KEYS}
        if self._key is None or not used:
            wanted = "file or run" if self._key is None else "of conditions"
            what = f"no column {wanted} (columns found: {one_line(', '.join(names), 80)})"
            remedy = f"name the columns file (or run) and {', '.join(RUN_KEYS)}"
            raise TunnelError(what, where=shown(path), remedy=remedy)
        factors = {key: in_si(key, split[i][1]) for key, i in used.items()}
        for key in (key for key, factor in factors.items() if factor is None):
            what = f"the column '{one_line(names[used[key]], 40)}' is not in a unit of {key}"
            raise TunnelError(what, where=shown(path), remedy=f"use one of {units_of(key)}")
        factors |= {key: own[i][2] for key, i in used.items() if i in own}
        self.ignored = tuple(n for i, n in enumerate(names) if i != self._key and i not in used.values())
        self.remarks = [
            f"{path.name}: {key} from '{names[i]}'"
            for key, i in used.items()
            if key and names[i].strip().lower() != key
        ]
        self._rows: dict[str, dict[str, float]] = {}
        for row in rows:
            name = row[self._key].strip()
            if _same(name) in self._rows:
                remedy = "leave one out"
                raise TunnelError(f"'{one_line(name)}' occurs twice", where=shown(path), remedy=remedy)
            values = {}
            for key, text in ((key, row[i]) for key, i in used.items() if row[i].strip()):
                try:
                    values[key] = float(text.replace(",", ".")) * (factors[key] or 1.0)
                except ValueError:
                    raise TunnelError(
                        f"{key} = '{one_line(text, 30)}' is not a number",
                        where=f"{shown(path)}, '{one_line(name)}'",
                        remedy="give a number",
                    ) from None
            validate(Conditions, values, path)
            self._rows[_same(name)] = values

    def of(self, path: Path, run: str) -> dict[str, float]:
        """Conditions of a run, looked up by its name or the name of its file."""
        for name in (run, path.name, path.stem, stem_of(path)):
            if _same(name) in self._rows:
                return self._rows[_same(name)]
        what = f"no row for run '{one_line(run)}' of {one_line(path.name)}"
        raise TunnelError(what, where=shown(self.path), remedy="add a row with that run or file")


def _of_displacement(heading: tuple[str, str]) -> tuple[str, str, float] | None:
    """Name and unit for an angle, and factor to SI, of a condition that only a displacement has; None of others."""
    name, unit, factor = DISPLACEMENT.condition(*heading)
    key = condition_of(name, unit, alone=True)
    if (name, unit) == heading or key not in RUN_KEYS or in_si(key, unit) is None:
        return None
    return name, unit, factor
