"""The user's statements about files before an import, as options or in ``import.toml``: one for each decision."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from tunnel_sim.files.campaign_folder import IMPORT_RECIPE
from tunnel_sim.files.importing.choice_options import CHOICES
from tunnel_sim.files.importing.condition_names import SETTABLE, Conditions, in_si, units_of
from tunnel_sim.files.importing.units import known_unit, squeezed
from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.toml_input import (
    OneLine,
    Positive,
    SampleRate,
    StrictModel,
    optional,
    read_document,
    validate,
)
from tunnel_sim.vocabulary.errors import TunnelError, one_line
from tunnel_sim.vocabulary.freedom import DISPLACEMENT, Motion, OwnInputColumn
from tunnel_sim.vocabulary.inputs import Hold


class StatedBy(StrictModel):
    """``[choices.stated_by]``: the names of columns or numbers of the files that state a condition."""

    wind_speed: OneLine | None = optional("the name of a column or number")
    spring_stiffness: OneLine | None = optional("the name of a column or number")
    air_density: OneLine | None = optional("the name of a column or number")
    release_angle: OneLine | None = optional("the name of a column or number")


class Stretch(StrictModel):
    """``[[choices.stretches]]``: start and end of a run in its record, and its reading at rest; None: as found."""

    file: OneLine | None = optional("the name of the file; without it, any file")
    run: OneLine = Field(description="the name of the run")
    start: float | None = optional("the time of the release by the file's clock, in s")
    end: float | None = optional("the time at which the run ends by the file's clock, in s")
    rest: float | None = optional("the reading at rest in rad, to be subtracted")
    record: OneLine | None = optional("the name of the record, where its run is added to the others")


def _choice(key: str, **default: Any) -> Any:
    """A field with the words of `CHOICES`; None by default."""
    words = CHOICES[key]
    return Field(**{"default": None} | default, title=words.title, description=words.wanted)


class ImportChoices(StrictModel):
    """How files are read; None: found from the files."""

    time: OneLine | None = _choice("time")
    angle: tuple[OneLine, ...] = _choice("angle", default=(), strict=False)
    unit: OneLine | None = _choice("unit")
    time_unit: OneLine | None = _choice("time_unit")
    rate: SampleRate | None = _choice("rate")
    counts_per_turn: Positive | None = _choice("counts_per_turn")
    calibration: OneLine | None = _choice("calibration")
    delimiter: Literal["tab", ";", ",", "|", "blank"] | None = _choice("delimiter")
    decimal: Literal[".", ","] | None = _choice("decimal")
    start: float | None = optional(
        "a time of the file in s: earlier samples are left out", "Leave out samples before [s]"
    )
    end: float | None = optional(
        "a time of the file in s: later samples are left out", "Leave out samples after [s]"
    )
    rest: float | None = _choice("rest")
    input: OneLine | None = _choice("input")
    input_as: OwnInputColumn | None = _choice("input_as")
    input_hold: Hold | None = _choice("input_hold")
    leave_out: tuple[OneLine, ...] = Field(
        default=(), strict=False, title="Leave out", description="a list of names of runs or files"
    )
    cut: bool = _choice("cut", default=True)
    stretches: tuple[Stretch, ...] = Field(
        default=(),
        strict=False,
        description="[[choices.stretches]] tables with file, run, start, end and rest",
    )
    name: OneLine | None = _choice("name")
    conditions: Conditions = Field(
        default=Conditions(), title="Conditions of all runs", description="a [choices.conditions] table"
    )
    stated_by: StatedBy = Field(default=StatedBy(), description="a [choices.stated_by] table")

    def stretch_of(self, file: str, run: str) -> Stretch:
        """The statement on start, end and rest of a run in its file."""
        found = (one for one in self.stretches if one.file in (file, None) and one.run == run)
        # A file may have a name that a recipe cannot express: then there is no statement about it.
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
    """The choices of an earlier import, from its ``import.toml`` or the folder of its campaign."""
    path = path / IMPORT_RECIPE if path.is_dir() else path
    missing = f"an import writes {IMPORT_RECIPE} into its campaign; name that file"
    return read_document(Recipe, path, missing=missing).choices


_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_OF_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_WITH_UNIT = re.compile(r"([+-]?(?:\d+[.,]?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S.*)")


def option_number(text: str, where: str, fits: Callable[[float], bool] = lambda _: True) -> float:
    """A number with a decimal point, or with a decimal comma.

    Args:
        fits: whether a value is possible, for a comma that may also separate thousands.

    Raises:
        ValueError: for a text that is not a number.
        TunnelError: for a comma with two meanings.
    """
    if not _DECIMAL_COMMA.fullmatch(text):
        return float(text)
    readings = [text.replace(",", "."), *([text.replace(",", "")] if _OF_THOUSANDS.fullmatch(text) else ())]
    meant = [reading for reading in readings if fits(float(reading))] or readings
    if len(meant) > 1:
        what = f"'{text}' may be {meant[0]} or {meant[1]}"
        raise TunnelError(what, where=where, remedy="give one of these")
    return float(meant[0])


def _settings_in(text: str) -> list[str]:
    """The settings between commas; a comma between two whole numbers is a decimal one."""
    parts: list[str] = []
    for part in text.split(","):
        if parts and re.fullmatch(r"\d+(\s*[^\s\d=][^=]*)?", part) and re.search(r"=\s*[+-]?\d+$", parts[-1]):
            parts[-1] += f",{part}"
        else:
            parts.append(part)
    return parts


def _possible(key: str, factor: float, value: float) -> bool:
    """Whether a condition may have a value, after its factor to SI."""
    try:
        plausible_values({key: factor * value}, "")
    except TunnelError:
        return False
    return True


def _factor(key: str, unit: str, where: str) -> tuple[float, Motion | None]:
    """The factor to SI of a condition in a unit as a user writes it, and the motion if only one has the unit."""
    named = known_unit(unit) or unit
    factor = in_si(key, named)
    if factor is not None:
        return factor, "angle" if DISPLACEMENT.unit(named) != named else None
    twins = {
        own: size * of_angle
        for own, (twin, size) in DISPLACEMENT.condition_units.items()
        if (of_angle := in_si(key, twin)) is not None
    }
    for own, factor in twins.items():
        if squeezed(own) == squeezed(unit):
            return factor, "displacement"
    allowed = units_of(key) + (f"; of a displacement {', '.join(twins)}" if twins else "")
    what = f"'{one_line(unit, 20)}' is not a unit of {key}"
    remedy = f"use one of {allowed}" if allowed != "1" else f"give {key} as a number without a unit"
    raise TunnelError(what, where=where, remedy=remedy)


def parse_times(words: Sequence[str], option: str) -> dict[str, float]:
    """Times in s by run, under the empty name for all files, from words ``SECONDS`` or ``RUN=SECONDS``.

    Raises:
        TunnelError: for a word of any other form.
    """
    times = {}
    for word in words:
        run, _, seconds = word.rpartition("=")
        try:
            times[run.strip()] = option_number(seconds, option)
        except ValueError:
            what = f"'{one_line(word, 40)}' is not a time"
            raise TunnelError(what, where=option, remedy="give SECONDS or RUN=SECONDS") from None
    return times


def parse_setting(text: str, where: str) -> tuple[Conditions, StatedBy]:
    """Conditions from ``key=value``, separated by commas; a value is a number, a number and its unit, or a name.

    Numbers may have a decimal comma.

    Raises:
        TunnelError: for a text of any other form, or a unit that does not measure the condition.
    """
    numbers: dict[str, Any] = {}
    names: dict[str, str] = {}
    for part in _settings_in(text):
        key, _, value = (piece.strip() for piece in part.partition("="))
        try:
            numbers[key] = option_number(value, where, partial(_possible, key, 1.0))
        except ValueError:
            if not value:
                what = f"'{part.strip()}' is not of the form key=number"
                remedy = f"give for example wind_speed=12.5; keys are {', '.join(SETTABLE)}"
                raise TunnelError(what, where=where, remedy=remedy) from None
            number = _WITH_UNIT.fullmatch(value)
            if number is None or key not in SETTABLE:
                names[key] = value
            else:
                factor, motion = _factor(key, number[2], where)
                numbers[key] = factor * option_number(number[1], where, partial(_possible, key, factor))
                if motion is not None:
                    numbers["motion"] = motion
    return validate(Conditions, numbers, Path(where)), validate(StatedBy, names, Path(where))


def stated_settings(words: Iterable[str], where: str) -> dict[str, dict[str, Any]]:
    """The choices ``conditions`` and ``stated_by`` from words for `parse_setting`; the last of a key counts."""
    found: dict[str, dict[str, Any]] = {"conditions": {}, "stated_by": {}}
    for word in words:
        for table, stated in zip(found.values(), parse_setting(word, where), strict=True):
            table |= stated.model_dump(exclude_none=True)
    return found
