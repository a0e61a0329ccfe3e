"""The tables of an effects file: effects stated as expressions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from tunnel_sim.files.toml_input import OneLine, StrictModel, load_toml, validate
from tunnel_sim.vocabulary import limits

Formula = Annotated[OneLine, Field(max_length=limits.EXPRESSION_CHARACTERS)]


class ParameterTable(StrictModel):
    """``[effects.parameters.NAME]``."""

    unit: OneLine = Field(description='a unit in quotes, such as "N m/rad", or "1" for a number')
    scale: float = Field(description="a typical value, a number in its unit")
    lower: float = Field(description="the least value, a number in its unit")
    upper: float = Field(description="the greatest value, a number in its unit")
    default: float | None = Field(default=None, description="a number in its unit")
    meaning: OneLine | None = Field(default=None, description="a clause in quotes")


class OwnEffectTable(StrictModel):
    """``[[effects]]``."""

    name: Annotated[OneLine, Field(pattern="^[a-z][a-z0-9_]{0,63}$")] = Field(
        description="a name of lower-case letters, digits and _"
    )
    channel: Literal["stiffness", "damping", "forcing", "sensor", "calibration"] = Field(
        description="stiffness, damping, forcing, sensor or calibration"
    )
    condition: Literal["always", "wind_on"] = Field(default="always", description="always or wind_on")
    moment: Formula | None = Field(default=None, description="an expression in quotes, N m")
    reading: Formula | None = Field(default=None, description="an expression in quotes, rad")
    summary: OneLine = Field(default="An effect by expression.", description="a sentence in quotes")
    parameters: Annotated[
        dict[str, ParameterTable], Field(min_length=1, max_length=limits.OWN_PARAMETERS)
    ] = Field(description="tables [effects.parameters.NAME], the severity first")


class EffectsDocument(StrictModel):
    """The whole of an effects file."""

    effects: Annotated[list[OwnEffectTable], Field(min_length=1, max_length=limits.OWN_EFFECTS)] = Field(
        description="tables [[effects]]"
    )


def read_effect_tables(path: Path) -> list[OwnEffectTable]:
    """The tables of an effects file (TOML), their expressions not yet parsed.

    Args:
        path: a TOML file.
    """
    document = load_toml(path, missing="name an effects file; docs/how-to/add-an-effect.md has an example")
    return validate(EffectsDocument, document, path).effects
