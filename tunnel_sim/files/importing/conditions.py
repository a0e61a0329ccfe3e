"""Conditions of runs: from a table, from the names of files, from the files themselves, or stated for all."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from tunnel_sim.files.importing.choices import RUN_KEYS, Conditions
from tunnel_sim.files.importing.text import read_cells
from tunnel_sim.files.toml_input import validate
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, shown

_ALIASES = {
    "spring": "spring_stiffness",
    "speed": "wind_speed",
    "density": "air_density",
    "angle": "release_angle",
}
_NUMBER = r"[+-]?\d+(?:[.,p]\d+)?"
_FACTS = {
    "wind_speed": re.compile(r"(?i)^(wind[ _]?speed|speed|airspeed|v_?wind)$"),
    "air_density": re.compile(r"(?i)^(air[ _]?density|rho|density)$"),
    "spring_stiffness": re.compile(r"(?i)^(spring[ _]?stiffness|stiffness)$"),
}


def from_facts(facts: Mapping[str, float]) -> dict[str, float]:
    """Conditions that a file states beside its columns."""
    found = {}
    for key, pattern in _FACTS.items():
        for name, value in facts.items():
            if pattern.match(name):
                found[key] = float(value)
    return found


def name_pattern(text: str) -> re.Pattern[str]:
    """The pattern of file names as a regular expression.

    Args:
        text: such as ``S{spring}_V{wind_speed}_*``; ``*`` stands for anything, ``{}`` for a number.

    Raises:
        TunnelError: an unknown name in braces.
    """
    parts = re.split(r"(\{\w*\}|\*)", text)
    expression = ""
    for part in parts:
        key = part[1:-1]
        if part == "*":
            expression += ".*"
        elif part.startswith("{"):
            known = _ALIASES.get(key, key)
            if known not in RUN_KEYS or f"<{known}>" in expression:
                raise TunnelError(
                    f"'{part}' is not a condition" if known not in RUN_KEYS else f"'{part}' occurs twice",
                    where=f"--name {one_line(text, 60)}",
                    remedy=did_you_mean(key, (*_ALIASES, *RUN_KEYS)),
                )
            expression += f"(?P<{known}>{_NUMBER})"
        else:
            expression += re.escape(part)
    return re.compile(expression + r"(?:\.\w+)?$")


def from_name(pattern: re.Pattern[str] | None, path: Path) -> dict[str, float]:
    """Conditions in the name of a file.

    Args:
        pattern: of `name_pattern`; None: the name says nothing.

    Raises:
        TunnelError: when the name is not of that pattern.
    """
    if pattern is None:
        return {}
    found = pattern.match(path.name)
    if found is None:
        raise TunnelError(
            "the name does not match --name",
            where=shown(path),
            remedy="correct the pattern, or rename the file",
        )
    return {key: float(re.sub("[,p]", ".", text)) for key, text in found.groupdict().items()}


class ConditionTable:
    """A table of conditions, one row for each file or run.

    Args:
        path: a text file with a column ``file`` or ``run``, and columns named as in ``campaign.toml``.

    Raises:
        TunnelError: not such a table, a name that occurs twice, or a value out of range.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        names, rows = read_cells(path)
        keys = [name.strip().lower() for name in names]
        self._key = next((i for i, name in enumerate(keys) if name in ("file", "run", "id")), None)
        used = {name: i for i, name in enumerate(keys) if name in RUN_KEYS}
        if self._key is None or not used:
            raise TunnelError(
                f"no column {'file or run' if self._key is None else 'of conditions'} "
                f"(columns found: {one_line(', '.join(names), 80)})",
                where=shown(path),
                remedy=f"name the columns file (or run) and {', '.join(RUN_KEYS)}",
            )
        self.ignored = tuple(n for i, n in enumerate(names) if i != self._key and keys[i] not in used)
        self._rows: dict[str, dict[str, float]] = {}
        for row in rows:
            name = row[self._key].strip()
            if name.lower() in self._rows:
                raise TunnelError(
                    f"'{one_line(name)}' occurs twice", where=shown(path), remedy="leave one out"
                )
            self._rows[name.lower()] = _numbers({key: row[i] for key, i in used.items()}, name, path)

    def of(self, path: Path, run: str) -> dict[str, float]:
        """Conditions of a run.

        Args:
            path: the file that holds it.

        Raises:
            TunnelError: when no row names the file or the run.
        """
        for name in (run, path.name, path.stem):
            if name.lower() in self._rows:
                return self._rows[name.lower()]
        raise TunnelError(
            f"no row for run '{one_line(run)}' of {one_line(path.name)}",
            where=shown(self.path),
            remedy="add a row with that run or file",
        )


def _numbers(cells: Mapping[str, str], name: str, path: Path) -> dict[str, float]:
    where = f"{shown(path)}, '{one_line(name)}'"
    values = {}
    for key, text in cells.items():
        if not text.strip():
            continue
        try:
            values[key] = float(text.replace(",", "."))
        except ValueError:
            raise TunnelError(
                f"{key} = '{one_line(text, 30)}' is not a number",
                where=where,
                remedy="give a number in SI units",
            ) from None
    validate(Conditions, values, path)
    return values
