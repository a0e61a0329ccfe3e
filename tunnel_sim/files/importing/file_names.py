"""Conditions in the names of files: by a user's pattern, or as hints only."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tunnel_sim.files.importing.condition_names import RUN_KEYS, Hint
from tunnel_sim.files.importing.units import UNITS
from tunnel_sim.files.reading import PACKED, stem_of
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, shown

_ALIASES = {
    "spring": "spring_stiffness",
    "speed": "wind_speed",
    "density": "air_density",
    "angle": "release_angle",
}
_NUMBER = r"[+-]?\d+(?:[.,p]\d+)?"


def name_pattern(text: str) -> re.Pattern[str]:
    """The regular expression of a pattern such as ``S{spring}_V{wind_speed}_*``; ``*`` stands for anything."""
    parts = re.split(r"(\{\w*\}|\*)", text)
    expression = ""
    for part in parts:
        key = part[1:-1]
        if part == "*":
            expression += ".*"
        elif part.startswith("{"):
            known = _ALIASES.get(key, key)
            if known not in RUN_KEYS or f"<{known}>" in expression:
                what = f"'{part}' is not a condition" if known not in RUN_KEYS else f"'{part}' occurs twice"
                remedy = did_you_mean(key, (*_ALIASES, *RUN_KEYS))
                raise TunnelError(what, where=f"--name {one_line(text, 60)}", remedy=remedy)
            expression += f"(?P<{known}>{_NUMBER})"
        else:
            expression += re.escape(part)
    return re.compile(expression + r"(?:\.\w+)?$")


def from_name(pattern: re.Pattern[str] | None, path: Path) -> dict[str, float]:
    """Conditions in the name of a file, which must match the pattern if there is one."""
    if pattern is None:
        return {}
    found = pattern.match(path.stem if path.suffix.lower() == PACKED else path.name)
    if found is None:
        remedy = "correct the pattern, or rename the file"
        raise TunnelError("the name does not match --name", where=shown(path), remedy=remedy)
    return {key: float(re.sub("[,p]", ".", text)) for key, text in found.groupdict().items()}


_DIGITS = r"\d+(?:[.,p]\d+)?"
_LABELS = {
    "wind_speed": r"(?:air|wind)?[ _-]?speed|wind|[vu](?:_?inf)?",
    "spring_stiffness": r"stiffness|spring|feder|kr|k|s",
    "air_density": r"density|rho",
}
_LABEL = "|".join(_LABELS.values())
_AFTER = {  # units after a number in a file's name, and the factor to SI; "ms" is as often a time
    "wind_speed": dict.fromkeys(("m_s", "m-s", "mps"), 1.0)
    | dict.fromkeys(("kmh", "km_h", "kph"), UNITS["speed"]["km/h"])
    | dict.fromkeys(("kn", "kts"), UNITS["speed"]["kn"])
    | {"mph": UNITS["speed"]["mph"], "fps": UNITS["speed"]["ft/s"]},
    "release_angle": {"deg": np.pi / 180.0, "grad": np.pi / 180.0, "°": np.pi / 180.0},
    "spring_stiffness": {"nm_rad": 1.0, "nmrad": 1.0},
}
_UNIT = "|".join(sorted((re.escape(unit) for units in _AFTER.values() for unit in units), key=len)[::-1])
_LABELLED = re.compile(
    rf"(?i)(?<![^\W\d_])(?P<label>{_LABEL})(?P<gap>[ _=-]?)(?P<number>{_DIGITS})"
    rf"(?P<unit>[ _-]?(?:m[_-]?s|{_UNIT}))?"
    rf"(?=$|[^a-z0-9]|(?:{_LABEL})\d)"
)
_BEFORE = rf"(?i)(?<![^\W_])(?P<number>{_DIGITS})"
_MEASURED = re.compile(rf"{_BEFORE}(?P<unit>[ _-]?(?:{_UNIT}))(?![^\W_])")
_SPEED_OR_TIME = re.compile(rf"{_BEFORE}(?P<unit>[ _-]?ms)(?![^\W_])")
_PLACES = {"spring_stiffness": "spring", "air_density": "density", "release_angle": "angle"}


@dataclass(frozen=True)
class NamePart:
    """A part of a file's name that may state a condition.

    Args:
        value: value in SI units.
        before: text before the number, as in the name.
        behind: text after it.
        written: whether the number equals the value, so that a pattern of names can read it.
    """

    key: str
    value: float
    start: int
    end: int
    before: str
    behind: str
    written: bool

    @property
    def text(self) -> str:
        """The part, with a placeholder for its number."""
        return f"{self.before}{{{_PLACES.get(self.key, self.key)}}}{self.behind}"


def name_parts(stem: str, *, speeds: bool = False) -> list[NamePart]:
    """Parts of a file's name that may state conditions, in their order, one for each condition.

    Args:
        speeds: whether a number before "ms" may be a speed in m/s.
    """
    return list({part.key: part for part in [*_parts(stem, speeds=speeds)][::-1]}.values())[::-1]


def _parts(stem: str, *, speeds: bool) -> Iterator[NamePart]:
    found = []
    for match in _LABELLED.finditer(stem):
        label = match["label"].lower()
        key = next(key for key, names in _LABELS.items() if re.fullmatch(names, label))
        unit = (match["unit"] or "").strip(" _-").lower()
        factor = _AFTER.get(key, {}).get(unit, 1.0 if unit in ("", "ms") else None)
        found.append((match, key, match["label"] + match["gap"], factor))
    for match in (*_MEASURED.finditer(stem), *(_SPEED_OR_TIME.finditer(stem) if speeds else ())):
        if any(match.start() < other.end() and other.start() < match.end() for other, *_ in found):
            continue
        unit = match["unit"].strip(" _-").lower()
        key = next((key for key, units in _AFTER.items() if unit in units), "wind_speed")
        found.append((match, key, "", _AFTER[key].get(unit, 1.0)))
    for match, key, before, factor in sorted(found, key=lambda one: one[0].start()):
        if factor is not None:
            value = float(re.sub("[,p]", ".", match["number"])) * factor
            yield NamePart(key, value, match.start(), match.end(), before, match["unit"] or "", factor == 1.0)


def name_hints(files: Sequence[Path]) -> dict[Path, list[Hint]]:
    """Apparent statements in the names of files, with a pattern for them if all names have the same parts."""
    # the number before "ms" differs between runs of several speeds; a logger's sampling does not
    numbers = [[match["number"] for match in _SPEED_OR_TIME.finditer(stem_of(path))] for path in files]
    speeds = all(map(len, numbers)) and len({tuple(one) for one in numbers}) > 1
    pattern = _pattern(files, speeds=speeds)
    found = {}
    for path in files:
        hints = []
        for part in name_parts(stem_of(path), speeds=speeds):
            what = f"'{stem_of(path)[part.start : part.end]}' in the file's name"
            why = f"it may state {part.key} = {part.value:g}"
            use = "--conditions RUNS.csv states it run by run"
            option, place = "", part.text
            if pattern and place in pattern:
                option = f'--name "{pattern}"'
            elif len(files) == 1:
                option = f"--set {part.key}={part.value:g}"
            use = f"{option} uses it" if option else use
            brief = f"a number in the files' names is left out: it may state {part.key}; {use}"
            brief = brief if len(files) > 1 else ""
            hints.append(Hint(part.key, part.value, what, why, use, brief=brief, option=option))
        found[path] = hints
    return found


def _pattern(files: Sequence[Path], *, speeds: bool) -> str:
    """A pattern for `name_pattern` from the first name; empty if it does not fit all of them."""
    stem = stem_of(files[0])
    text, at = "", 0
    parts = [part for part in name_parts(stem, speeds=speeds) if part.written]
    for part in parts:
        between = stem[at : part.start]
        text += re.sub(r".*[^\W_]|[{}*]", "*", between) + part.text
        at = part.end
    if not parts:
        return ""
    text += "*" if at < len(stem) else ""
    compiled = name_pattern(text)
    keys = [part.key for part in parts]
    for path in files:
        parts = name_parts(stem_of(path), speeds=speeds)
        stated = {part.key: part.value for part in parts if part.written}
        try:
            if from_name(compiled, path) != {key: stated.get(key) for key in keys}:
                return ""
        except TunnelError:
            return ""
    return text
