"""The tables of a sweep file: a campaign description's with lists of values; their sizes and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import prod
from typing import Annotated, Any, TypeVar

from pydantic import BeforeValidator, Field

from tunnel_lab.terminal.arguments import NO_EFFECT
from tunnel_sim.files.plan_file import (
    STEPS_PER_SECOND,
    EffectTable,
    ReleaseAngles,
    Repeats,
    Springs,
    Stiffnesses,
    WindSpeeds,
    check_size,
    run_count,
)
from tunnel_sim.files.reading import check_count
from tunnel_sim.files.scatter_tables import Drift, Width, ZeroWidth
from tunnel_sim.files.toml_input import (
    NotNegative,
    OneLine,
    Positive,
    SampleRate,
    StrictModel,
    optional,
)
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.plan import DEFAULT_SAMPLE_RATE

STEPS_PER_SHARD = 500_000
"""Integration steps of one shard: about two seconds on one core, the greatest loss per worker of a killed
sweep."""


def _listed(value: object) -> object:
    """A single value or table as a list of one item."""
    return value if isinstance(value, list) else [value]


T = TypeVar("T")
Many = Annotated[list[T], BeforeValidator(_listed), Field(min_length=1)]


class SweepRigTable(StrictModel):
    """``[[rig]]``: a rig description with changes; the packaged description if no file is named."""

    name: OneLine = Field(default="packaged", description="a short name in quotes")
    file: OneLine | None = optional("the path of a rig description in quotes")
    changes: dict[str, dict[str, Any]] = Field(
        default={}, description="tables of the rig description, such as { dynamics = { yaw_inertia = 0.12 } }"
    )


class TruthAxis(StrictModel):
    """``[truth]`` or ``[[truth]]``: coefficients to inject, each a number or a list."""

    cn_beta: Many[float] = Field(description="a number or a list of them, 1/rad")
    cn_r: Many[float] = Field(description="a number or a list of them, 1/rad")
    yaw_inertia: Many[Positive] | None = optional("a positive number or a list of them, kg m2")
    mechanical_damping: Many[NotNegative] | None = optional(
        "a number or a list of them, N m s/rad, zero or more"
    )


class SensorAxis(StrictModel):
    """``[sensor]`` or ``[[sensor]]``: the potentiometer, each key a number or a list."""

    sample_rate: Many[SampleRate] | None = optional("a positive number or a list of them, Hz")
    noise_std: Many[NotNegative] | None = optional("a number or a list of them, rad, zero or more")
    resolution: Many[NotNegative] | None = optional("a number or a list of them, rad, zero for none")
    zero: Many[float] | None = optional("a number or a list of them, rad")


_WIDTHS = "a relative standard deviation or a list of them, from 0 to 0.2"
_DRIFTS = "a relative change from the first to the last run or a list of them, from -0.5 to 0.5"


class ScatterAxis(StrictModel):
    """``[scatter]`` or ``[[scatter]]``: differences between the runs, each key a number or a list."""

    wind_speed: Many[Width] | None = optional(_WIDTHS)
    spring_stiffness: Many[Width] | None = optional(_WIDTHS)
    mechanical_damping: Many[Width] | None = optional(_WIDTHS)
    zero: Many[ZeroWidth] | None = optional("a standard deviation from 0 to 1 rad or a list of them")
    spring_stiffness_drift: Many[Drift] | None = optional(_DRIFTS)
    wind_speed_drift_between_runs: Many[Drift] | None = optional(_DRIFTS)


class EffectAxis(StrictModel):
    """``[[effects]]``: one alternative, an effect with its severities; ``none`` is the nominal model."""

    name: OneLine = Field(description='the name of an effect in quotes, or "none"')
    parameters: dict[str, Many[float]] = Field(
        default={}, description="a table of numbers or lists of them, such as { x = [0.1, 0.2] }"
    )
    together_with: list[EffectTable] = Field(
        default=[], description='a list of tables such as { name = "…", parameters = { x = 0.1 } }'
    )


class ConditionsTable(StrictModel):
    """``[conditions]`` or ``[[conditions]]``: the runs of a campaign; each table, and each duration, is one."""

    name: OneLine | None = optional("a short name in quotes")
    springs: Springs = Field(default=[])
    spring_stiffness: Stiffnesses = Field(default=[])
    wind_speeds: WindSpeeds
    release_angles_deg: ReleaseAngles
    repeats: Repeats = 1
    duration: Many[Positive] = Field(description="a positive number or a list of them, s")
    air_density: Positive | None = optional("a positive number in kg/m3")


class SweepDocument(StrictModel):
    """The whole of a sweep file: rig × conditions × sensor × truth × scatter × effects × replicates; estimators."""

    name: OneLine = Field(description="a short name in quotes")
    description: str = Field(default="", description="text in quotes, or leave it out")
    seed: int = Field(ge=0, lt=2**63, description="a whole number, zero or more")
    replicates: int = Field(default=1, ge=1, le=1_000_000, description="a whole number from 1 to 1000000")
    estimators: list[OneLine] = Field(
        description='a list of names such as ["output_error", "conventional"], or [] to simulate only'
    )
    records: bool = Field(default=False, description="true or false")
    cases_per_shard: int | None = Field(default=None, ge=1, description="a whole number, one or more")
    rig: Many[SweepRigTable] = Field(default=[SweepRigTable()], description="[[rig]] tables")
    conditions: Many[ConditionsTable] = Field(
        description="a [conditions] table with springs, wind_speeds, release_angles_deg and duration"
    )
    sensor: Many[SensorAxis] = Field(default=[SensorAxis()], description="a [sensor] table")
    truth: Many[TruthAxis] = Field(description="a [truth] table with cn_beta and cn_r")
    scatter: Many[ScatterAxis] = Field(default=[ScatterAxis()], description="a [scatter] table")
    effects: Many[EffectAxis] = Field(default=[EffectAxis(name="none")], description="[[effects]] tables")


def axis_lengths(document: SweepDocument) -> dict[str, int]:
    """Number of values of every axis by its name, counted from the lengths of the lists."""

    def points(lists: Mapping[str, Sequence[float]]) -> int:
        return prod(map(len, lists.values()))

    return {
        "rig": len(document.rig),
        "conditions": sum(len(table.duration) for table in document.conditions),
        "sensor": sum(points(table.model_dump(exclude_none=True)) for table in document.sensor),
        "truth": sum(points(table.model_dump(exclude_none=True)) for table in document.truth),
        "scatter": sum(points(table.model_dump(exclude_none=True)) for table in document.scatter),
        "effects": sum(1 if one.name == NO_EFFECT else points(one.parameters) for one in document.effects),
    }


def check_sweep_size(document: SweepDocument, where: str) -> None:
    """Refuse a sweep that is too large before expanding it, naming the excessive number and its limit."""
    lengths = axis_lengths(document)
    for name, length in lengths.items():
        check_count(length, limits.SWEEP_AXIS, "values", f"{where}, {name}", "shorten a list")
    cases = prod(lengths.values()) * document.replicates
    check_count(cases, limits.SWEEP_CASES, "cases", where, "shorten a list, or make several sweeps")
    beside = lengths["sensor"] + lengths["scatter"] * lengths["effects"]
    checks = lengths["rig"] * lengths["conditions"] * beside
    combinations = "combinations of rig and conditions with a sensor, or with an effect and a scatter"
    check_count(checks, limits.SWEEP_CHECKS, combinations, where, "shorten a list, or make several sweeps")
    rates = [rate for table in document.sensor for rate in table.sample_rate or [DEFAULT_SAMPLE_RATE]]
    for table in document.conditions:
        place = f"{where}, conditions '{table.name}'"
        for rate in (min(rates), max(rates)):
            check_size(run_count(table), max(table.duration), rate, place)
    together = min(cases, cases_per_shard(document))
    shards = -(-cases // together)
    check_count(shards, limits.SWEEP_SHARDS, "shards", where, "raise cases_per_shard, or make several sweeps")
    samples = together * max(_samples(table, max(rates)) for table in document.conditions)
    check_count(samples, limits.CAMPAIGN_SAMPLES, "samples in a shard", where, "lower cases_per_shard")


def cases_per_shard(document: SweepDocument) -> int:
    """Number of cases in a shard, stated or from the steps of the longest case."""
    longest = max(_samples(table, STEPS_PER_SECOND) for table in document.conditions)
    return document.cases_per_shard or max(1, int(STEPS_PER_SHARD // longest))


def _samples(table: ConditionsTable, rate: float) -> float:
    """Number of samples of the longest case of some conditions, at a rate in Hz."""
    return run_count(table) * max(table.duration) * rate
