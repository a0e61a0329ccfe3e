"""What a user states about files, and the conditions of runs: from tables, names of files, or the files."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tunnel_sim.files.campaign_folder import IMPORT_RECIPE
from tunnel_sim.files.importing.tables import Channel
from tunnel_sim.files.importing.text import read_cells
from tunnel_sim.files.importing.units import UNITS, kind_of, split_unit
from tunnel_sim.files.scatter_tables import SPREAD, Spread
from tunnel_sim.files.toml_input import (
    NotNegative,
    OneLine,
    Positive,
    SampleRate,
    StrictModel,
    optional,
    read_document,
    validate,
)
from tunnel_sim.vocabulary.drive import InputColumn
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, shown


class Conditions(StrictModel):
    """Conditions of runs, sizes of the rig and the scatter between runs, as in ``campaign.toml``."""

    wind_speed: NotNegative | None = optional("a number in m/s, 0 for wind-off")
    spring_stiffness: NotNegative | None = optional(
        "a number in N m/rad, 0 for a driven body without a spring"
    )
    air_density: Positive | None = optional("a positive number in kg/m3")
    release_angle: float | None = optional("a number in rad")
    yaw_inertia: Positive | None = optional("a positive number in kg m2")
    frontal_area: Positive | None = optional("a positive number in m2")
    reference_length: Positive | None = optional("a positive number in m")
    width: Positive | None = optional("a positive number in m")
    repeatability_wind_speed: Spread | None = optional(SPREAD)
    repeatability_spring_stiffness: Spread | None = optional(SPREAD)
    repeatability_mechanical_damping: Spread | None = optional(SPREAD)


RIG_KEYS = ("yaw_inertia", "frontal_area", "reference_length", "width")
RUN_KEYS = ("wind_speed", "spring_stiffness", "air_density", "release_angle")
OF_REPEATABILITY = "repeatability_"
"""Begins the keys of ``[repeatability]`` where they stand beside conditions of the same names."""

SPREAD_KEYS = tuple(key for key in Conditions.model_fields if key.startswith(OF_REPEATABILITY))
OF_CAMPAIGN = (*RIG_KEYS, *SPREAD_KEYS)
"""The keys that are the same in all runs."""


class Stretch(StrictModel):
    """``[[choices.stretches]]``: where a run lies in its record, and its reading at rest; None: as found."""

    file: OneLine = Field(description="the name of the file")
    run: OneLine = Field(description="the name of the run")
    start: NotNegative | None = optional("the time of the release in s from the record's first sample")
    end: Positive | None = optional("the time in s from the record's first sample at which the run ends")
    rest: float | None = optional("the reading at rest in rad, to be subtracted")


class ImportChoices(StrictModel):
    """How files are to be read; what is None is found from the files."""

    time: OneLine | None = optional("the name or number of the column of times")
    angle: tuple[OneLine, ...] = Field(
        default=(), strict=False, description="a list of names or numbers of columns"
    )
    unit: OneLine | None = optional("the unit of the angle, such as 'deg'")
    time_unit: OneLine | None = optional("the unit of the times, such as 'ms'")
    rate: SampleRate | None = optional("a positive number in Hz")
    counts_per_turn: Positive | None = optional("a positive number")
    calibration: OneLine | None = optional(
        "a formula such as '0.1 + 20*V', or the name of a table of two columns"
    )
    delimiter: Literal["tab", ";", ",", "|", "blank"] | None = optional("'tab', ';', ',', '|' or 'blank'")
    decimal: Literal[".", ","] | None = optional("'.' or ','")
    start: float | None = optional("a time of the file in s: earlier samples are left out")
    end: float | None = optional("a time of the file in s: later samples are left out")
    rest: float | None = optional("the reading at rest in rad, to be subtracted from every run")
    input: OneLine | None = optional("the name of the input's column of a driven run, or 'none'")
    input_as: InputColumn | None = optional("'moment_nm', 'drive' or 'base_rad'")
    cut: bool = Field(default=True, description="false to keep records whole")
    stretches: tuple[Stretch, ...] = Field(
        default=(),
        strict=False,
        description="[[choices.stretches]] tables with file, run, start, end and rest",
    )
    name: OneLine | None = optional("a pattern of file names such as 'S{spring}_V{wind_speed}_*'")
    conditions: Conditions = Field(default=Conditions(), description="a [choices.conditions] table")

    def stretch_of(self, file: str, run: str) -> Stretch:
        """What is stated about where a run lies in its file and rests."""
        found = (one for one in self.stretches if (one.file, one.run) == (file, run))
        # A file may have a name that no recipe can hold: nothing is stated about it.
        return next(found, Stretch.model_construct(file=file, run=run))


class OriginalTable(StrictModel):
    """``[[originals]]``."""

    file: OneLine = Field(description="the name of the file")
    sha256: OneLine = Field(description="the SHA-256 of its content")
    said: tuple[OneLine, ...] = Field(default=(), strict=False, description="a list of texts")


class Recipe(StrictModel):
    """The whole of ``import.toml``."""

    schema_version: Literal[1] = Field(description="1")
    choices: ImportChoices = Field(default=ImportChoices(), description="a [choices] table")
    originals: tuple[OriginalTable, ...] = Field(default=(), strict=False, description="[[originals]] tables")


def read_recipe(path: Path) -> ImportChoices:
    """The choices of an earlier import, from its ``import.toml`` or the campaign's folder that holds it."""
    path = path / IMPORT_RECIPE if path.is_dir() else path
    missing = f"an import writes {IMPORT_RECIPE} into its campaign; name that file"
    return read_document(Recipe, path, missing=missing).choices


def parse_setting(text: str, where: str) -> Conditions:
    """Conditions from ``key=value``, separated by commas, such as ``wind_speed=12.5, air_density=1.2``."""
    values: dict[str, float] = {}
    for part in text.split(","):
        key, _, value = part.partition("=")
        try:
            values[key.strip()] = float(value)
        except ValueError:
            what = f"'{part.strip()}' is not of the form key=number"
            remedy = f"give for example wind_speed=12.5; keys are {', '.join(Conditions.model_fields)}"
            raise TunnelError(what, where=where, remedy=remedy) from None
    return validate(Conditions, values, Path(where))


_ALIASES = {
    "spring": "spring_stiffness",
    "speed": "wind_speed",
    "density": "air_density",
    "angle": "release_angle",
}
_NUMBER = r"[+-]?\d+(?:[.,p]\d+)?"
_NAMES = {
    "wind_speed": r"(wind|air|flow|free ?stream|tunnel) ?(speed|velocity)|v ?wind|"
    r"(wind|luft|str[öo]mungs|anstr[öo]m)geschwindigkeit",
    "air_density": r"(air ?)?density|rho( ?air)?|ρ|(luft)?dichte",
    "spring_stiffness": r"((spring|torsional|rotational) ?)?stiffness|spring ?(constant|rate)|k ?r|"
    r"(torsions|dreh)?feder(konstante|steifigkeit|rate)|(dreh|torsions)?steifigkeit",
    "release_angle": r"(release|initial|start) ?angle|(anfangs|start|auslenk)winkel|(theta|psi|beta|[θψβ]) ?0",
}
_KEYS = {key: re.compile(f"(?i)({names})") for key, names in _NAMES.items()}
_SYMBOL = re.compile(r"(?i)[vu](_?(0|inf|∞))?|wind|speed")
_KINDS = {
    "wind_speed": "speed",
    "air_density": "density",
    "spring_stiffness": "stiffness",
    "release_angle": "angle",
}
_OFF = 0.5  # of the range: the median of a wind speed that starts late is further from zero
_EVEN = 1e-9  # of a value: a column that varies less is constant


def condition_of(name: str, unit: str, *, alone: bool = False) -> str | None:
    """The condition or size, a key of `Conditions`, that a column states, or a number ``alone``."""
    if name in OF_CAMPAIGN and unit == "":
        return name
    name = re.sub(r"\s*[(\[{<].*", "", name)  # a unit that is not known stays in the name
    plain = re.sub(r"[\s_.-]+", " ", name).strip()
    found = next((key for key, pattern in _KEYS.items() if pattern.fullmatch(plain)), None)
    # No unit of time measures what is named so.
    symbol = kind_of(unit) == "speed" or unit == "ms" or (alone and unit == "" and plain.lower() == "speed")
    return "wind_speed" if found is None and symbol and _SYMBOL.fullmatch(name) else found


def in_si(key: str, unit: str) -> float | None:
    """The factor to SI of a condition in a unit; None where the unit does not measure it."""
    unit = "m/s" if (key, unit) == ("wind_speed", "ms") else unit  # no wind speed is in milliseconds
    return 1.0 if unit == "" else UNITS[_KINDS[key]].get(unit)


def from_facts(facts: Mapping[str, float], said: list[str]) -> dict[str, float]:
    """Conditions and sizes, by key of `Conditions` and in its units, that numbers of a file state; each is said."""
    found = {}
    for heading, value in facts.items():
        name, unit = split_unit(heading)
        key = condition_of(name, unit, alone=True)
        if key is not None and (factor := in_si(key, unit)) is not None:
            found[key] = float(value) * factor
        elif key is not None:
            said.append(_no_unit(heading, key))
    said += [f"{key} = {value:g} from the file" for key, value in found.items()]
    return found


def from_column(key: str, column: Channel, rows: NDArray[np.bool_], said: list[str]) -> float | None:
    """The condition of a run that a column states, in the unit of `Conditions`; None where it says nothing."""
    values = column.values[rows]
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    factor = in_si(key, column.unit)
    if factor is None:
        said.append(_no_unit(column.name, key))
        return None
    low, middle, high = map(float, np.quantile(values, (0.05, 0.5, 0.95)))
    if high - low <= _EVEN * abs(middle):
        return middle * factor
    off = key == "wind_speed" and low <= 0.0 and middle < _OFF * (high - low)
    said.append(
        f"the column '{column.name}' varies from {low:.4g} to {high:.4g}: {key} is "
        + ("zero, about which it lies" if off else f"its median, {middle * factor:.6g}")
    )
    return 0.0 if off else middle * factor


def _no_unit(heading: str, key: str) -> str:
    kind = ", ".join(UNITS[_KINDS[key]])
    left = f"'{one_line(heading, 60)}' is left out"
    return f"{left}: its unit is not one of {kind}; --set {key}=NUMBER states it"


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
    """Conditions in the name of a file, which must match the pattern where there is one."""
    if pattern is None:
        return {}
    found = pattern.match(path.name)
    if found is None:
        remedy = "correct the pattern, or rename the file"
        raise TunnelError("the name does not match --name", where=shown(path), remedy=remedy)
    return {key: float(re.sub("[,p]", ".", text)) for key, text in found.groupdict().items()}


def _same(name: str) -> str:
    """A name for comparison: some systems take the accents of file names apart."""
    return unicodedata.normalize("NFC", name).lower()


class ConditionTable:
    """A table of conditions in a text file, one row for each file or run, with keys of ``campaign.toml``."""

    def __init__(self, path: Path) -> None:
        self.path = path
        names, rows = read_cells(path)
        keys = [name.strip().lower() for name in names]
        self._key = next((i for i, name in enumerate(keys) if name in ("file", "run", "id")), None)
        used = {name: i for i, name in enumerate(keys) if name in RUN_KEYS}
        if self._key is None or not used:
            wanted = "file or run" if self._key is None else "of conditions"
            what = f"no column {wanted} (columns found: {one_line(', '.join(names), 80)})"
            remedy = f"name the columns file (or run) and {', '.join(RUN_KEYS)}"
            raise TunnelError(what, where=shown(path), remedy=remedy)
        self.ignored = tuple(n for i, n in enumerate(names) if i != self._key and keys[i] not in used)
        self._rows: dict[str, dict[str, float]] = {}
        for row in rows:
            name = row[self._key].strip()
            if _same(name) in self._rows:
                remedy = "leave one out"
                raise TunnelError(f"'{one_line(name)}' occurs twice", where=shown(path), remedy=remedy)
            values = {}
            for key, text in ((key, row[i]) for key, i in used.items() if row[i].strip()):
                try:
                    values[key] = float(text.replace(",", "."))
                except ValueError:
                    raise TunnelError(
                        f"{key} = '{one_line(text, 30)}' is not a number",
                        where=f"{shown(path)}, '{one_line(name)}'",
                        remedy="give a number in SI units",
                    ) from None
            validate(Conditions, values, path)
            self._rows[_same(name)] = values

    def of(self, path: Path, run: str) -> dict[str, float]:
        """Conditions of a run, by its name or that of the file that holds it."""
        for name in (run, path.name, path.stem):
            if _same(name) in self._rows:
                return self._rows[_same(name)]
        what = f"no row for run '{one_line(run)}' of {one_line(path.name)}"
        raise TunnelError(what, where=shown(self.path), remedy="add a row with that run or file")
