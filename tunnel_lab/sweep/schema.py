"""The tables of a sweep file: those of a campaign description, with lists of the values to sweep."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from tunnel_sim.files.plan_schema import (
    EffectTable,
    NotNegative,
    Positive,
    ReleaseAngles,
    Repeats,
    Springs,
    Stiffnesses,
    WindSpeeds,
)
from tunnel_sim.files.toml_input import OneLine, SampleRate, StrictModel


def _listed(value: object) -> object:
    """One value, or one table, is a list of one."""
    return value if isinstance(value, list) else [value]


Many = Annotated[list[float], BeforeValidator(_listed), Field(min_length=1)]
ManyPositive = Annotated[list[Positive], BeforeValidator(_listed), Field(min_length=1)]
ManyRates = Annotated[list[SampleRate], BeforeValidator(_listed), Field(min_length=1)]
ManyNotNegative = Annotated[list[NotNegative], BeforeValidator(_listed), Field(min_length=1)]


class RigTable(StrictModel):
    """``[[rig]]``: a rig description with changes; the packaged one where no file is named."""

    name: OneLine = Field(default="packaged", description="a short name in quotes")
    file: OneLine | None = Field(default=None, description="the path of a rig description in quotes")
    changes: dict[str, dict[str, Any]] = Field(
        default={}, description="tables of the rig description, such as { dynamics = { yaw_inertia = 0.12 } }"
    )


class TruthAxis(StrictModel):
    """``[truth]`` or ``[[truth]]``: coefficients to inject, each a number or a list."""

    cn_beta: Many = Field(description="a number or a list of them, 1/rad")
    cn_r: Many = Field(description="a number or a list of them, 1/rad")
    yaw_inertia: ManyPositive | None = Field(
        default=None, description="a positive number or a list of them, kg m2"
    )
    mechanical_damping: ManyNotNegative | None = Field(
        default=None, description="a number or a list of them, N m s/rad, zero or more"
    )


class SensorAxis(StrictModel):
    """``[sensor]`` or ``[[sensor]]``: the potentiometer, each key a number or a list."""

    sample_rate: ManyRates | None = Field(default=None, description="a positive number or a list of them, Hz")
    noise_std: ManyNotNegative | None = Field(
        default=None, description="a number or a list of them, rad, zero or more"
    )
    resolution: ManyNotNegative | None = Field(
        default=None, description="a number or a list of them, rad, zero for none"
    )
    zero: Many | None = Field(default=None, description="a number or a list of them, rad")


class EffectAxis(StrictModel):
    """``[[effects]]``: one alternative, an effect with its severities; ``none`` is the nominal model."""

    name: OneLine = Field(description='the name of an effect in quotes, or "none"')
    parameters: dict[str, Many] = Field(
        default={}, description="a table of numbers or lists of them, such as { x = [0.1, 0.2] }"
    )
    together_with: list[EffectTable] = Field(
        default=[], description='a list of tables such as { name = "…", parameters = { x = 0.1 } }'
    )


class ConditionsTable(StrictModel):
    """``[conditions]`` or ``[[conditions]]``: the runs of a campaign; each table, and each duration, is one."""

    name: OneLine | None = Field(default=None, description="a short name in quotes")
    springs: Springs = Field(default=[])
    spring_stiffness: Stiffnesses = Field(default=[])
    wind_speeds: WindSpeeds
    release_angles_deg: ReleaseAngles
    repeats: Repeats = 1
    duration: ManyPositive = Field(description="a positive number or a list of them, s")
    air_density: Positive | None = Field(default=None, description="a positive number in kg/m3")


class SweepDocument(StrictModel):
    """The whole of a sweep file: rig × conditions × sensor × truth × effects × replicates, then estimators."""

    name: OneLine = Field(description="a short name in quotes")
    description: str = Field(default="", description="text in quotes, or leave it out")
    seed: int = Field(ge=0, lt=2**63, description="a whole number, zero or more")
    replicates: int = Field(default=1, ge=1, le=1_000_000, description="a whole number from 1 to 1000000")
    estimators: list[OneLine] = Field(
        description='a list of names such as ["output_error", "conventional"], or [] to simulate only'
    )
    records: bool = Field(default=False, description="true or false")
    cases_per_shard: int | None = Field(default=None, ge=1, description="a whole number, one or more")
    rig: Annotated[list[RigTable], BeforeValidator(_listed), Field(min_length=1)] = Field(
        default=[RigTable()], description="[[rig]] tables"
    )
    conditions: Annotated[list[ConditionsTable], BeforeValidator(_listed), Field(min_length=1)] = Field(
        description="a [conditions] table with springs, wind_speeds, release_angles_deg and duration"
    )
    sensor: Annotated[list[SensorAxis], BeforeValidator(_listed), Field(min_length=1)] = Field(
        default=[SensorAxis()], description="a [sensor] table"
    )
    truth: Annotated[list[TruthAxis], BeforeValidator(_listed), Field(min_length=1)] = Field(
        description="a [truth] table with cn_beta and cn_r"
    )
    effects: Annotated[list[EffectAxis], BeforeValidator(_listed), Field(min_length=1)] = Field(
        default=[EffectAxis(name="none")], description="[[effects]] tables"
    )
