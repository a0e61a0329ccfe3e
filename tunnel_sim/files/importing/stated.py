"""The conditions stated in files: in numbers, columns and names, and content that only resembles one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.condition_names import condition_of, in_si, resembles, units_of
from tunnel_sim.files.importing.conditions import ImportChoices, from_name, name_pattern
from tunnel_sim.files.importing.tables import Channel, Table
from tunnel_sim.files.importing.units import claims, split_unit
from tunnel_sim.vocabulary.errors import TunnelError, counted, did_you_mean, one_line

_OFF = 0.5  # of the range: the median of a wind speed that starts late is further from zero
_EVEN = 1e-9  # of a value: a column that varies less is constant


@dataclass(frozen=True)
class Hint:
    """Content that resembles a condition and is not used as one.

    Args:
        key: of `Conditions`.
        value: in SI units if it is that condition; NaN if its unit is not known.
        what: its description in the file or its name, for a message.
        why: the reason for not using it.
        use: the option that uses or states it.
        symbol: whether only a column's letter suggests it, which in a robot's log is a command or a velocity.
    """

    key: str
    value: float
    what: str
    why: str
    use: str
    symbol: bool = False

    @property
    def words(self) -> str:
        """The whole hint in a line."""
        return f"{self.what} is left out: {self.why}; {self.use}"


@dataclass(frozen=True, eq=False)
class Stated:
    """The statements of the table of a record.

    Args:
        numbers: conditions and sizes by key of `Conditions`, in its units.
        columns: columns of conditions by key, with the rows of the record.
        hints: unused numbers of the file.
        like: unused columns that resemble conditions, with their hints.
    """

    numbers: Mapping[str, float]
    columns: Mapping[str, Channel]
    hints: tuple[Hint, ...] = ()
    like: tuple[tuple[Channel, Hint], ...] = ()

    def of_rows(self, first: int, last: int) -> Stated:
        """The statements from one row to before another."""
        return replace(
            self,
            columns={key: _rows(c, slice(first, last)) for key, c in self.columns.items()},
            like=tuple((_rows(c, slice(first, last)), hint) for c, hint in self.like),
        )

    def measured(self, rows: NDArray[np.bool_], said: list[str]) -> dict[str, float]:
        """Conditions stated by columns in some rows, shape (n,)."""
        found = {
            key: value
            for key, column in self.columns.items()
            if (value := from_column(key, column, rows, said)) is not None
        }
        names = [(key, self.columns[key].name) for key in found]
        if names:
            listed = ", ".join(
                key if key == name else f"{key} ('{one_line(name, 40)}')" for key, name in names
            )
            said.append(f"from columns: {listed}")
        return found

    def unused(self, rows: NDArray[np.bool_]) -> list[Hint]:
        """Unused content that resembles a condition in some rows, shape (n,); a column about zero does not."""
        found = [*self.hints]
        for column, hint in self.like:
            value = from_column(hint.key, replace(column, unit=""), rows, [])
            if value is not None and np.isfinite(value):
                found.append(replace(hint, value=value))
        return found


def stated_in(
    table: Table,
    beside: Sequence[Channel | None],
    kept: NDArray[np.bool_],
    choices: ImportChoices,
    said: list[str],
    where: str,
) -> Stated:
    """The statements of a table on the conditions of a record.

    Args:
        beside: the columns of times, reading and input.
        kept: which rows of the table belong to the record, shape (n,).
    """
    claimed = choices.stated_by.model_dump(exclude_none=True)
    numbers, hints = from_facts(table.facts, claimed, said, where)
    columns: dict[str, Channel] = {}
    like = []
    for channel in table.channels:
        if any(channel is one for one in beside):
            continue
        key = next((key for key, text in claimed.items() if claims(text, channel.name, channel.unit)), None)
        key = key or condition_of(channel.name, channel.unit)
        if key is not None and in_si(key, channel.unit) is not None:
            columns.setdefault(key, _rows(channel, kept))  # the first of several that state the same
        elif hint := _hint(channel.name, channel.unit, key, float("nan")):
            like.append((_rows(channel, kept), hint))
    known = {**table.facts, **{channel.name: 0.0 for channel in table.channels}}
    for key, text in claimed.items():
        if key not in numbers and key not in columns:
            what = f"no column or number '{one_line(text, 40)}' that states {key}"
            raise TunnelError(what, where=where, remedy=f"--set {key}: {did_you_mean(text, known)}")
    return Stated(numbers, columns, tuple(hints), tuple(like))


def from_facts(
    facts: Mapping[str, float], claimed: Mapping[str, str], said: list[str], where: str
) -> tuple[dict[str, float], list[Hint]]:
    """Conditions and sizes stated by numbers of a file, each reported, and numbers that only resemble one.

    Args:
        claimed: by key, the names of numbers that the user has declared to state a condition.

    Returns:
        Values by key of `Conditions`, in its units, and hints.
    """
    found: dict[str, float] = {}
    names: dict[str, str] = {}
    hints = []
    for heading, value in facts.items():
        name, unit = split_unit(heading)
        key = next((key for key, text in claimed.items() if claims(text, name, unit)), None)
        sure = key is not None
        key = key or condition_of(name, unit, alone=True)
        if key is not None and (factor := in_si(key, unit)) is not None:
            if sure or names.get(key) not in claimed.values():
                found[key], names[key] = float(value) * factor, name
        elif sure:
            what = f"'{one_line(heading, 60)}' is not in a unit of {key} ({units_of(key or '')})"
            raise TunnelError(what, where=where, remedy=f"give --set {key}=NUMBER")
        elif hint := _hint(name, unit, key, float(value)):
            hints.append(hint)
    symbols = [hint for hint in hints if hint.key == "wind_speed" and np.isfinite(hint.value)]
    # A density is stated for the wind alone: the only symbol of a speed beside it means the wind.
    if "air_density" in found and "wind_speed" not in found and len(symbols) == 1:
        found["wind_speed"], names["wind_speed"] = symbols[0].value, f"{symbols[0].what}, in m/s"
        hints.remove(symbols[0])
    for key, value in found.items():
        named = "" if names[key] == key else f" ({names[key]})"
        said.append(f"{key} = {value:g} from the file{named}")
    return found, hints


def _hint(name: str, unit: str, key: str | None, value: float) -> Hint | None:
    """The hint of an unused column or number; ``key``: the condition stated by its name."""
    shown_name = one_line(name, 60)
    number = "" if np.isnan(value) else f" = {value:g}"
    if key is not None:
        why = f"its unit is not one of {units_of(key)}"
        what = (
            f"'{shown_name}'{number}" if unit in shown_name else f"'{shown_name}' in '{one_line(unit, 20)}'"
        )
        return Hint(key, float("nan"), what, why, f"--set {key}=NUMBER states it")
    key = resembles(name, unit)
    if key is None:
        return None
    use = f'--set {key}="{shown_name}" uses it' if " " in shown_name else f"--set {key}={shown_name} uses it"
    if key == "wind_speed" and not unit and np.isnan(value) and len(name.strip()) == 1:
        use = f"{use}, --input {shown_name} if it drives the body"
        return Hint(
            key,
            value,
            f"'{shown_name}'",
            "it may be wind_speed or an input, but has no unit",
            use,
            symbol=True,
        )
    if unit:
        value = value * (in_si(key, unit) or 1.0)
        return Hint(
            key, value, f"'{shown_name}'{number} in {unit}", "its name is not that of a condition", use
        )
    return Hint(key, value, f"'{shown_name}'{number}", f"it may be {key}, but has no unit", use)


def from_column(key: str, column: Channel, rows: NDArray[np.bool_], said: list[str]) -> float | None:
    """The condition of a run stated by a column, in the unit of `Conditions`; None if it does not state one."""
    values = column.values[rows]
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    factor = in_si(key, column.unit) or 1.0
    low, middle, high = map(float, np.quantile(values, (0.05, 0.5, 0.95)))
    if high - low <= _EVEN * abs(middle):
        return middle * factor
    off = key == "wind_speed" and low <= 0.0 and middle < _OFF * (high - low)
    said.append(
        f"the column '{column.name}' varies from {low:.4g} to {high:.4g}: {key} is "
        + ("zero, about which it lies" if off else f"its median, {middle * factor:.6g}")
    )
    return 0.0 if off else middle * factor


def of_short_table(table: Table) -> list[Hint]:
    """Apparent statements on the runs in a table too short for a record."""
    found = []
    for channel in table.channels:
        key = condition_of(channel.name, channel.unit) or resembles(channel.name, channel.unit)
        values = channel.values[np.isfinite(channel.values)]
        if key is None or not values.any():
            continue
        what = f"'{one_line(channel.name, 60)}' of {counted(values.size, 'value')}"
        part = f" in '{one_line(table.part, 40)}'" if table.part else ""
        why = f"it may state {key}, but not of which run"
        found.append(Hint(key, float("nan"), what + part, why, "--conditions RUNS.csv states it run by run"))
    return found


def _rows(channel: Channel, kept: NDArray[np.bool_] | slice) -> Channel:
    return replace(channel, values=channel.values[kept])


_DIGITS = r"\d+(?:[.,p]\d+)?"
_LABELS = {
    "wind_speed": r"(?:air|wind)?[ _-]?speed|wind|[vu](?:_?inf)?",
    "spring_stiffness": r"stiffness|spring|feder|kr|k|s",
    "air_density": r"density|rho",
}
_LABEL = "|".join(_LABELS.values())
_AFTER = {  # units behind a number in a file's name, and the factor to SI; "ms" is as often a time
    "wind_speed": {"m_s": 1.0, "m-s": 1.0, "mps": 1.0, "kmh": 1 / 3.6, "km_h": 1 / 3.6, "kph": 1 / 3.6}
    | {"mph": 0.44704, "kn": 0.514444, "kts": 0.514444, "fps": 0.3048},
    "release_angle": {"deg": np.pi / 180.0, "grad": np.pi / 180.0, "°": np.pi / 180.0},
    "spring_stiffness": {"nm_rad": 1.0, "nmrad": 1.0},
}
_UNIT = "|".join(sorted((re.escape(unit) for units in _AFTER.values() for unit in units), key=len)[::-1])
_LABELLED = re.compile(
    rf"(?i)(?<![^\W\d_])(?P<label>{_LABEL})(?P<gap>[ _=-]?)(?P<number>{_DIGITS})"
    rf"(?P<unit>[ _-]?(?:m[_-]?s|{_UNIT}))?"
    rf"(?=$|[^a-z0-9]|(?:{_LABEL})\d)"
)
_MEASURED = re.compile(rf"(?i)(?<![^\W_])(?P<number>{_DIGITS})(?P<unit>[ _-]?(?:{_UNIT}))(?![^\W_])")
_PLACES = {"spring_stiffness": "spring", "air_density": "density", "release_angle": "angle"}


@dataclass(frozen=True)
class NamePart:
    """A part of a file's name that may state a condition.

    Args:
        value: in SI units.
        before: text before the number, as in the name.
        behind: text after it.
        written: whether the number is that value, so that a pattern of names can read it.
    """

    key: str
    value: float
    start: int
    end: int
    before: str
    behind: str
    written: bool = field(default=True)

    @property
    def text(self) -> str:
        """The part with a place for its number."""
        return f"{self.before}{{{_PLACES.get(self.key, self.key)}}}{self.behind}"


def name_parts(stem: str) -> list[NamePart]:
    """Parts of a file's name that may state conditions, in their order, one for each condition."""
    return list({part.key: part for part in [*_parts(stem)][::-1]}.values())[::-1]


def _parts(stem: str) -> Iterator[NamePart]:
    found = []
    for match in _LABELLED.finditer(stem):
        label = match["label"].lower()
        key = next(key for key, names in _LABELS.items() if re.fullmatch(names, label))
        unit = (match["unit"] or "").strip(" _-").lower()
        factor = _AFTER.get(key, {}).get(unit, 1.0 if unit in ("", "ms") else None)
        found.append((match, key, match["label"] + match["gap"], factor))
    for match in _MEASURED.finditer(stem):
        if any(match.start() < other.end() and other.start() < match.end() for other, *_ in found):
            continue
        unit = match["unit"].strip(" _-").lower()
        key = next(key for key, units in _AFTER.items() if unit in units)
        found.append((match, key, "", _AFTER[key][unit]))
    for match, key, before, factor in sorted(found, key=lambda one: one[0].start()):
        if factor is not None:
            value = float(re.sub("[,p]", ".", match["number"])) * factor
            yield NamePart(key, value, match.start(), match.end(), before, match["unit"] or "", factor == 1.0)


def name_hints(files: Sequence[Path]) -> dict[Path, list[Hint]]:
    """Apparent statements in the names of files, with a pattern for them where all names have the same parts."""
    pattern = _pattern(files)
    found = {}
    for path in files:
        hints = []
        for part in name_parts(path.stem):
            what = f"'{path.stem[part.start : part.end]}' in the file's name"
            why = f"it may state {part.key} = {part.value:g}"
            use = "--conditions RUNS.csv states it run by run"
            place = part.text
            if pattern and place in pattern:
                use = f'--name "{pattern}" uses it'
            elif len(files) == 1:
                use = f"--set {part.key}={part.value:g} uses it"
            hints.append(Hint(part.key, part.value, what, why, use))
        found[path] = hints
    return found


def _pattern(files: Sequence[Path]) -> str:
    """A pattern for `name_pattern` from the first name; empty if it does not fit all of them."""
    stem = files[0].stem
    text, at = "", 0
    parts = [part for part in name_parts(stem) if part.written]
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
        stated = {part.key: part.value for part in name_parts(path.stem) if part.written}
        try:
            if from_name(compiled, path) != {key: stated.get(key) for key in keys}:
                return ""
        except TunnelError:
            return ""
    return text
