"""What a user may state about files, and the recipe that keeps it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from tunnel_sim.files.campaign_io import IMPORT_RECIPE
from tunnel_sim.files.toml_input import OneLine, SampleRate, StrictModel, read_document, validate
from tunnel_sim.vocabulary.errors import TunnelError

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class Conditions(StrictModel):
    """Conditions of runs, and sizes of the rig, as in ``campaign.toml``."""

    wind_speed: NotNegative | None = Field(default=None, description="a number in m/s, 0 for wind-off")
    spring_stiffness: Positive | None = Field(default=None, description="a positive number in N m/rad")
    air_density: Positive | None = Field(default=None, description="a positive number in kg/m3")
    release_angle: float | None = Field(default=None, description="a number in rad")
    yaw_inertia: Positive | None = Field(default=None, description="a positive number in kg m2")
    frontal_area: Positive | None = Field(default=None, description="a positive number in m2")
    reference_length: Positive | None = Field(default=None, description="a positive number in m")
    width: Positive | None = Field(default=None, description="a positive number in m")


RIG_KEYS = ("yaw_inertia", "frontal_area", "reference_length", "width")
RUN_KEYS = ("wind_speed", "spring_stiffness", "air_density", "release_angle")


class Stretch(StrictModel):
    """``[[choices.stretches]]``: where a run lies in its record, and its reading at rest; None: as found."""

    file: OneLine = Field(description="the name of the file")
    run: OneLine = Field(description="the name of the run")
    start: NotNegative | None = Field(
        default=None, description="the time of the release in s from the record's first sample"
    )
    end: Positive | None = Field(
        default=None, description="the time in s from the record's first sample at which the run ends"
    )
    rest: float | None = Field(default=None, description="the reading at rest in rad, to be subtracted")


class ImportChoices(StrictModel):
    """How files are to be read; what is None is found from the files."""

    time: OneLine | None = Field(default=None, description="the name or number of the column of times")
    angle: tuple[OneLine, ...] = Field(
        default=(), strict=False, description="a list of names or numbers of columns"
    )
    unit: OneLine | None = Field(default=None, description="the unit of the angle, such as 'deg'")
    time_unit: OneLine | None = Field(default=None, description="the unit of the times, such as 'ms'")
    rate: SampleRate | None = Field(default=None, description="a positive number in Hz")
    counts_per_turn: Positive | None = Field(default=None, description="a positive number")
    calibration: OneLine | None = Field(
        default=None, description="a formula such as '0.1 + 20*V', or the name of a table of two columns"
    )
    delimiter: Literal["tab", ";", ",", "|", "blank"] | None = Field(
        default=None, description="'tab', ';', ',', '|' or 'blank'"
    )
    decimal: Literal[".", ","] | None = Field(default=None, description="'.' or ','")
    start: float | None = Field(
        default=None, description="a time of the file in s: earlier samples are left out"
    )
    end: float | None = Field(default=None, description="a time of the file in s: later samples are left out")
    rest: float | None = Field(
        default=None, description="the reading at rest in rad, to be subtracted from every run"
    )
    cut: bool = Field(default=True, description="false to keep records whole")
    stretches: tuple[Stretch, ...] = Field(
        default=(),
        strict=False,
        description="[[choices.stretches]] tables with file, run, start, end and rest",
    )
    name: OneLine | None = Field(
        default=None, description="a pattern of file names such as 'S{spring}_V{wind_speed}_*'"
    )
    conditions: Conditions = Field(default=Conditions(), description="a [choices.conditions] table")

    def stretch_of(self, file: str, run: str) -> Stretch:
        """What is stated about where a run lies and rests.

        Args:
            file: the name of the file.
            run: the name of the run.
        """
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
    """The choices of an earlier import.

    Args:
        path: its ``import.toml``, or the campaign's folder that holds it.

    Raises:
        TunnelError: no such file, or not a recipe.
    """
    path = path / IMPORT_RECIPE if path.is_dir() else path
    missing = f"an import writes {IMPORT_RECIPE} into its campaign; name that file"
    return read_document(Recipe, path, missing=missing).choices


def parse_setting(text: str, where: str) -> Conditions:
    """Conditions from ``key=value``, separated by commas.

    Args:
        text: such as ``wind_speed=12.5, air_density=1.2``.

    Raises:
        TunnelError: not of that form, an unknown key, or a value out of range.
    """
    values: dict[str, float] = {}
    for part in text.split(","):
        key, _, value = part.partition("=")
        try:
            values[key.strip()] = float(value)
        except ValueError:
            raise TunnelError(
                f"'{part.strip()}' is not of the form key=number",
                where=where,
                remedy=f"give for example wind_speed=12.5; keys are {', '.join(Conditions.model_fields)}",
            ) from None
    return validate(Conditions, values, Path(where))
