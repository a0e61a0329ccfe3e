"""The cases of a sweep: the tables of its file, checked before anything is simulated, and their product.

The tables are those of a campaign description, with lists of the values to sweep. Every case is a campaign
description with a seed computed from its contents.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field

from identification.estimators import free_decay_estimators
from tunnel_lab.terminal.inputs import NO_EFFECT
from tunnel_sim.effects import effect_class
from tunnel_sim.files.plan_file import (
    STEPS_PER_SECOND,
    EffectTable,
    PlanDocument,
    ReleaseAngles,
    Repeats,
    Springs,
    Stiffnesses,
    WindSpeeds,
    check_conditions,
    check_size,
    first_twice,
    plan_from,
    run_count,
)
from tunnel_sim.files.reading import as_described, check_count, parse_json
from tunnel_sim.files.rig_file import parse_rig, rig_document
from tunnel_sim.files.scatter_tables import Drift, Width, ZeroWidth
from tunnel_sim.files.toml_input import (
    NotNegative,
    OneLine,
    Positive,
    SampleRate,
    StrictModel,
    load_toml,
    validate,
)
from tunnel_sim.physics.run_settings import sampling
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, shown
from tunnel_sim.vocabulary.plan import DEFAULT_SAMPLE_RATE, CampaignPlan
from tunnel_sim.vocabulary.rig import Rig

STEPS_PER_SHARD = 500_000
"""Integration steps of one shard: about two seconds on one core, the most that a killed sweep loses per worker."""


def _listed(value: object) -> object:
    """A single value or table as a list of one item."""
    return value if isinstance(value, list) else [value]


T = TypeVar("T")
Many = Annotated[list[T], BeforeValidator(_listed), Field(min_length=1)]


class RigTable(StrictModel):
    """``[[rig]]``: a rig description with changes; the packaged description where no file is named."""

    name: OneLine = Field(default="packaged", description="a short name in quotes")
    file: OneLine | None = Field(default=None, description="the path of a rig description in quotes")
    changes: dict[str, dict[str, Any]] = Field(
        default={}, description="tables of the rig description, such as { dynamics = { yaw_inertia = 0.12 } }"
    )


class TruthAxis(StrictModel):
    """``[truth]`` or ``[[truth]]``: coefficients to inject, each a number or a list."""

    cn_beta: Many[float] = Field(description="a number or a list of them, 1/rad")
    cn_r: Many[float] = Field(description="a number or a list of them, 1/rad")
    yaw_inertia: Many[Positive] | None = Field(
        default=None, description="a positive number or a list of them, kg m2"
    )
    mechanical_damping: Many[NotNegative] | None = Field(
        default=None, description="a number or a list of them, N m s/rad, zero or more"
    )


class SensorAxis(StrictModel):
    """``[sensor]`` or ``[[sensor]]``: the potentiometer, each key a number or a list."""

    sample_rate: Many[SampleRate] | None = Field(
        default=None, description="a positive number or a list of them, Hz"
    )
    noise_std: Many[NotNegative] | None = Field(
        default=None, description="a number or a list of them, rad, zero or more"
    )
    resolution: Many[NotNegative] | None = Field(
        default=None, description="a number or a list of them, rad, zero for none"
    )
    zero: Many[float] | None = Field(default=None, description="a number or a list of them, rad")


_WIDTHS = "a relative standard deviation or a list of them, from 0 to 0.2"
_DRIFTS = "a relative change from the first to the last run or a list of them, from -0.5 to 0.5"


class ScatterAxis(StrictModel):
    """``[scatter]`` or ``[[scatter]]``: differences between the runs, each key a number or a list."""

    wind_speed: Many[Width] | None = Field(default=None, description=_WIDTHS)
    spring_stiffness: Many[Width] | None = Field(default=None, description=_WIDTHS)
    mechanical_damping: Many[Width] | None = Field(default=None, description=_WIDTHS)
    zero: Many[ZeroWidth] | None = Field(
        default=None, description="a standard deviation from 0 to 1 rad or a list of them"
    )
    spring_stiffness_drift: Many[Drift] | None = Field(default=None, description=_DRIFTS)
    wind_speed_drift_between_runs: Many[Drift] | None = Field(default=None, description=_DRIFTS)


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

    name: OneLine | None = Field(default=None, description="a short name in quotes")
    springs: Springs = Field(default=[])
    spring_stiffness: Stiffnesses = Field(default=[])
    wind_speeds: WindSpeeds
    release_angles_deg: ReleaseAngles
    repeats: Repeats = 1
    duration: Many[Positive] = Field(description="a positive number or a list of them, s")
    air_density: Positive | None = Field(default=None, description="a positive number in kg/m3")


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
    rig: Many[RigTable] = Field(default=[RigTable()], description="[[rig]] tables")
    conditions: Many[ConditionsTable] = Field(
        description="a [conditions] table with springs, wind_speeds, release_angles_deg and duration"
    )
    sensor: Many[SensorAxis] = Field(default=[SensorAxis()], description="a [sensor] table")
    truth: Many[TruthAxis] = Field(description="a [truth] table with cn_beta and cn_r")
    scatter: Many[ScatterAxis] = Field(default=[ScatterAxis()], description="a [scatter] table")
    effects: Many[EffectAxis] = Field(default=[EffectAxis(name="none")], description="[[effects]] tables")


@dataclass(frozen=True)
class SweepCase:
    """One campaign of a sweep.

    Args:
        index: in the order of the product, from 0.
        replicate: number of the repetition with other noise, from 0.
        duration: of every run, s.
        plan: the campaign with its seed.
        document: the same as a campaign description, ready to be written as TOML.
    """

    index: int
    replicate: int
    rig_name: str
    rig: Rig
    conditions: str
    duration: float
    plan: CampaignPlan
    document: Mapping[str, Any]


@dataclass(frozen=True)
class Sweep:
    """A sweep file with the sections of each rig's description, which together determine the results."""

    document: SweepDocument
    rigs: tuple[Mapping[str, Any], ...]

    def to_json(self) -> str:
        """The sweep as one line of JSON, from which any worker can rebuild it."""
        return json.dumps(
            {"document": self.document.model_dump(), "rigs": list(self.rigs)}, sort_keys=True, allow_nan=False
        )

    @classmethod
    def from_json(cls, text: str) -> Sweep:
        """The inverse of `to_json`; a `TunnelError` when the text is not a sweep, or is too large."""
        where, remedy = "the sweep as JSON", "start the sweep again"
        document = parse_json(text, where, remedy)
        with as_described("is not a sweep", where, remedy):
            sweep = cls(SweepDocument.model_validate(document["document"]), tuple(document["rigs"]))
            check_sweep_size(sweep.document, where)
            if len(sweep._parsed) != len(sweep.document.rig):
                raise ValueError("rigs")
        return sweep

    @cached_property
    def axes(self) -> tuple[Sequence[Any], ...]:
        """Values of rig, conditions, sensor, truth, scatter and effects; the last varies fastest."""
        file = self.document
        conditions: list[dict[str, Any]] = []
        for table in file.conditions:
            kept = table.model_dump(exclude_none=True)
            named = {"name": kept.pop("name", "conditions"), **kept}
            conditions += [{**named, "duration": duration} for duration in table.duration]
        effects: list[list[dict[str, Any]]] = []
        for entry in file.effects:
            if entry.name == NO_EFFECT:
                effects.append([])
                continue
            others = [other.model_dump() for other in entry.together_with]
            for parameters in _spread(entry.parameters):
                effects.append([{"name": entry.name, "parameters": parameters}, *others])
        return (
            range(len(self.rigs)),
            conditions,
            [value for table in file.sensor for value in _spread(table.model_dump(exclude_none=True))],
            [value for table in file.truth for value in _spread(table.model_dump(exclude_none=True))],
            [
                {name: number for name, number in value.items() if number}  # zero is not stated
                for table in file.scatter
                for value in _spread(table.model_dump(exclude_none=True))
            ],
            effects,
        )

    @property
    def size(self) -> int:
        """Number of cases."""
        return prod(axis_lengths(self.document).values()) * self.document.replicates

    @property
    def runs(self) -> int:
        """Number of runs."""
        tables = self.document.conditions
        runs = sum(run_count(table) * len(table.duration) for table in tables)
        return runs * (self.size // axis_lengths(self.document)["conditions"])

    @property
    def cases_per_shard(self) -> int:
        """Number of cases in a shard; it depends only on the file, not on the workers."""
        return _cases_per_shard(self.document)

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.size // self.cases_per_shard)

    def shard(self, index: int) -> Iterator[SweepCase]:
        """The cases of a shard; shards are counted from 0."""
        start = index * self.cases_per_shard
        return map(self.case, range(start, min(start + self.cases_per_shard, self.size)))

    def case(self, index: int) -> SweepCase:
        """A case by its place in the product, from 0; equal cases of sweeps with the same seed are identical."""
        point, replicate = divmod(index, self.document.replicates)
        places = np.unravel_index(point, tuple(map(len, self.axes)))
        rig, conditions, sensor, truth, scatter, effects = (
            axis[int(place)] for axis, place in zip(self.axes, places, strict=True)
        )
        physics = {
            **{key: value for key, value in conditions.items() if key != "name"},
            "sensor": sensor,
            "truth": truth,
            "effects": effects,
        }
        if scatter:  # without scatter, contents and seed must equal those of a file without the table
            physics["scatter"] = scatter
        # The seed, from 0 to 2⁶³ − 1, depends on the contents of the case, not on its place in the product.
        contents = json.dumps({"rig": self.rigs[rig], **physics}, sort_keys=True, allow_nan=False)
        words = np.frombuffer(hashlib.sha256(contents.encode()).digest(), dtype="<u4").tolist()
        sequence = np.random.SeedSequence(self.document.seed, spawn_key=(*words, replicate))
        seed = int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))
        document = {"name": f"{self.document.name}-{index}", "seed": seed, **physics}
        plan = plan_from(PlanDocument.model_validate(document), self._parsed[rig], self.document.name)
        return SweepCase(
            index, replicate, self.document.rig[rig].name, self._parsed[rig], conditions["name"],
            conditions["duration"], plan, document,
        )  # fmt: skip

    @cached_property
    def _parsed(self) -> tuple[Rig, ...]:
        named = zip(self.document.rig, self.rigs, strict=True)
        return tuple(parse_rig(sections, f"rig '{table.name}'") for table, sections in named)


def _spread(table: Mapping[str, Sequence[float]]) -> list[dict[str, float]]:
    """Every combination of lists, the last key fastest."""
    return [dict(zip(table, values, strict=True)) for values in product(*table.values())]


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
    together = min(cases, _cases_per_shard(document))
    shards = -(-cases // together)
    check_count(shards, limits.SWEEP_SHARDS, "shards", where, "raise cases_per_shard, or make several sweeps")
    samples = together * max(_samples(table, max(rates)) for table in document.conditions)
    check_count(samples, limits.CAMPAIGN_SAMPLES, "samples in a shard", where, "lower cases_per_shard")


def _cases_per_shard(document: SweepDocument) -> int:
    longest = max(_samples(table, STEPS_PER_SECOND) for table in document.conditions)
    return document.cases_per_shard or max(1, int(STEPS_PER_SHARD // longest))


def _samples(table: ConditionsTable, rate: float) -> float:
    """Number of samples of the longest case of some conditions, at a rate in Hz."""
    return run_count(table) * max(table.duration) * rate


def read_sweep(path: Path, estimators: Sequence[str] = ()) -> Sweep:
    """Read and check a sweep file.

    Args:
        path: a TOML file; paths of rig files are relative to its folder.
        estimators: names of further estimators.
    """
    content = load_toml(path, missing="name a sweep file, see docs/how-to/sweep.md")
    where = shown(path)
    document = validate(SweepDocument, content, path)
    many = len(document.conditions) > 1
    conditions = [
        table.model_copy(update={"name": table.name or (f"conditions-{place}" if many else "conditions")})
        for place, table in enumerate(document.conditions, 1)
    ]
    every = [*document.estimators, *(name for name in estimators if name not in document.estimators)]
    document = document.model_copy(update={"conditions": conditions, "estimators": every})
    _check_names(document, where)
    for table in conditions:
        check_conditions(table, f"{where}, conditions '{table.name}'")
    check_sweep_size(document, where)
    rigs = []
    for rig in document.rig:
        sections = rig_document(None if rig.file is None else path.parent / rig.file)
        for name, changes in rig.changes.items():
            old = sections.get(name, {})
            # Values other than tables are refused by the check of the rig.
            sections[name] = {**old, **changes} if isinstance(old, dict) else old
        parse_rig(sections, f"{where}, rig '{rig.name}'")
        rigs.append(sections)
    # Files and changes of the rigs are left out: the resulting descriptions are stored.
    names = [table.model_copy(update={"file": None, "changes": {}}) for table in document.rig]
    sweep = Sweep(document.model_copy(update={"rig": names}), tuple(rigs))
    _check_cases(sweep, where)
    return sweep


def _check_names(document: SweepDocument, where: str) -> None:
    for name in document.estimators:
        known = free_decay_estimators()
        if name not in known:
            remedy = did_you_mean(name, known)
            raise TunnelError(f"unknown estimator '{name}'", where=where, remedy=remedy)
    if not document.estimators and not document.records:
        what = "neither estimators nor records: there would be no result"
        raise TunnelError(what, where=where, remedy="name an estimator, or set records = true")
    for key, names in (
        ("estimators", document.estimators),
        ("rig", [table.name for table in document.rig]),
        ("conditions", [str(table.name) for table in document.conditions]),
    ):
        twice = first_twice(names)
        if twice is not None:
            raise TunnelError(f"{key} has '{twice}' twice", where=where, remedy="give each its own name")
    for entry in document.effects:
        if entry.name == NO_EFFECT and (entry.parameters or entry.together_with):
            remedy = "name an effect, or give the name only"
            raise TunnelError(f"'{NO_EFFECT}' takes no other key", where=f"{where}, effects", remedy=remedy)
        for name in (entry.name, *(other.name for other in entry.together_with)):
            if name != NO_EFFECT or entry.together_with:
                with _in(where):
                    effect_class(name)


def _check_cases(sweep: Sweep, where: str) -> None:
    """Refuse duplicate values in an axis, and cases that the simulator would refuse."""
    from tunnel_sim.engine.virtual_campaign import plan_effects, run_settings

    lengths = axis_lengths(sweep.document)
    axes: Iterator[tuple[str, Sequence[Any]]] = zip(lengths, (sweep.rigs, *sweep.axes[1:]), strict=True)
    for name, values in axes:
        seen: set[str] = set()
        for value in values:
            physics = {k: v for k, v in value.items() if k != "name"} if name == "conditions" else value
            text = json.dumps(physics, sort_keys=True)
            if text in seen:
                remedy = "remove one, and use replicates for more runs"
                raise TunnelError(f"{name} contains a value twice", where=where, remedy=remedy)
            seen.add(text)
    # each value of the sensor, and each pair of scatter and effects, with every rig and conditions
    for beside in (("sensor",), ("scatter", "effects")):
        axes_compared = ("rig", "conditions", *beside)
        for place in np.ndindex(*(lengths[name] for name in axes_compared)):
            places = dict(zip(axes_compared, place, strict=True))
            point = np.ravel_multi_index(
                tuple(places.get(name, 0) for name in lengths), tuple(lengths.values())
            )
            with _in(where):
                plan = sweep.case(int(point) * sweep.document.replicates).plan
                if beside == ("sensor",):
                    sampling(run_settings(plan.truth, plan.conditions[0]), plan.sensor.sample_rate)
                else:
                    plan_effects(plan)


@contextmanager
def _in(where: str) -> Iterator[None]:
    """Add the file to errors."""
    try:
        yield
    except TunnelError as error:
        place = error.where if where in error.where else ", ".join(filter(None, (where, error.where)))
        raise TunnelError(error.what, where=place, remedy=error.remedy) from None
