"""A user's statements about files, and the conditions of runs: from tables, names of files, or the files."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path
from typing import Literal

from pydantic import Field

from tunnel_sim.files.campaign_folder import IMPORT_RECIPE
from tunnel_sim.files.importing.condition_names import (
    RUN_KEYS,
    Conditions,
    condition_of,
    in_si,
    resembles,
    units_of,
)
from tunnel_sim.files.importing.tables import names_runs
from tunnel_sim.files.importing.text import read_cells
from tunnel_sim.files.importing.units import split_unit
from tunnel_sim.files.toml_input import (
    OneLine,
    Positive,
    SampleRate,
    StrictModel,
    optional,
    read_document,
    validate,
)
from tunnel_sim.vocabulary.drive import Hold
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, one_of, shown
from tunnel_sim.vocabulary.inputs import INPUT_COLUMNS, InputColumn


class Unstated(TunnelError):
    """A condition of a run that only the user can state, even beside other sources."""


class StatedBy(StrictModel):
    """``[choices.stated_by]``: the names of columns or numbers of the files that state a condition."""

    wind_speed: OneLine | None = optional("the name of a column or number")
    spring_stiffness: OneLine | None = optional("the name of a column or number")
    air_density: OneLine | None = optional("the name of a column or number")
    release_angle: OneLine | None = optional("the name of a column or number")


class Stretch(StrictModel):
    """``[[choices.stretches]]``: start and end of a run in its record, and its reading at rest; None: as found."""

    file: OneLine = Field(description="the name of the file")
    run: OneLine = Field(description="the name of the run")
    start: float | None = optional("the time of the release by the file's clock, in s")
    end: float | None = optional("the time at which the run ends by the file's clock, in s")
    rest: float | None = optional("the reading at rest in rad, to be subtracted")


class ImportChoices(StrictModel):
    """How files are read; None: found from the files."""

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
    input_as: InputColumn | None = optional(one_of([f"'{name}'" for name in INPUT_COLUMNS]))
    input_hold: Hold | None = optional("'zero' or 'linear'")
    leave_out: tuple[OneLine, ...] = Field(
        default=(), strict=False, description="a list of names of runs or files"
    )
    cut: bool = Field(default=True, description="false to keep records whole")
    stretches: tuple[Stretch, ...] = Field(
        default=(),
        strict=False,
        description="[[choices.stretches]] tables with file, run, start, end and rest",
    )
    name: OneLine | None = optional("a pattern of file names such as 'S{spring}_V{wind_speed}_*'")
    conditions: Conditions = Field(default=Conditions(), description="a [choices.conditions] table")
    stated_by: StatedBy = Field(default=StatedBy(), description="a [choices.stated_by] table")

    def stretch_of(self, file: str, run: str) -> Stretch:
        """The statement on start, end and rest of a run in its file."""
        found = (one for one in self.stretches if (one.file, one.run) == (file, run))
        # A file may have a name that a recipe cannot express: there is then no statement about it.
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
    """The choices of an earlier import, from its ``import.toml`` or the campaign's folder with it."""
    path = path / IMPORT_RECIPE if path.is_dir() else path
    missing = f"an import writes {IMPORT_RECIPE} into its campaign; name that file"
    return read_document(Recipe, path, missing=missing).choices


def parse_setting(text: str, where: str) -> tuple[Conditions, StatedBy]:
    """Conditions from ``key=value``, separated by commas; a value is a number, or a name in the files."""
    numbers: dict[str, float] = {}
    names: dict[str, str] = {}
    for part in text.split(","):
        key, _, value = (piece.strip() for piece in part.partition("="))
        try:
            numbers[key] = float(value)
        except ValueError:
            if not value:
                what = f"'{part.strip()}' is not of the form key=number"
                remedy = f"give for example wind_speed=12.5; keys are {', '.join(Conditions.model_fields)}"
                raise TunnelError(what, where=where, remedy=remedy) from None
            names[key] = value
    return validate(Conditions, numbers, Path(where)), validate(StatedBy, names, Path(where))


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
    """Conditions in the name of a file, which must match the pattern where there is one."""
    if pattern is None:
        return {}
    found = pattern.match(path.name)
    if found is None:
        remedy = "correct the pattern, or rename the file"
        raise TunnelError("the name does not match --name", where=shown(path), remedy=remedy)
    return {key: float(re.sub("[,p]", ".", text)) for key, text in found.groupdict().items()}


def _same(name: str) -> str:
    """A name for comparison: some systems decompose the accents of file names."""
    return unicodedata.normalize("NFC", name).lower()


_OF_FILES = re.compile(r"(?i)(file|datei)(_? ?name)?|sheet|blatt|tabelle|id")


class ConditionTable:
    """A table of conditions in a text file, one row for each file or run, with the names that files use too."""

    def __init__(self, path: Path) -> None:
        self.path = path
        names, rows = read_cells(path)
        split = [split_unit(name) for name in names]
        keys = [condition_of(*heading, alone=True) or resembles(*heading) for heading in split]
        self._key = next((i for i, name in enumerate(names) if _names_a_run(name)), None)
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
        self.ignored = tuple(n for i, n in enumerate(names) if i != self._key and i not in used.values())
        self.said = [
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
        """Conditions of a run, by its name or the name of its file."""
        for name in (run, path.name, path.stem):
            if _same(name) in self._rows:
                return self._rows[_same(name)]
        what = f"no row for run '{one_line(run)}' of {one_line(path.name)}"
        raise TunnelError(what, where=shown(self.path), remedy="add a row with that run or file")


def _names_a_run(heading: str) -> bool:
    return names_runs(heading) or _OF_FILES.fullmatch(heading.strip()) is not None
