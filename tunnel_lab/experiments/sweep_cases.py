"""The cases of a sweep: the product of the values in its file, each a campaign description, and their shards.

The seed of a case is computed from its contents.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from math import prod
from typing import Any

import numpy as np

from tunnel_lab.experiments.sweep_tables import SweepDocument, axis_lengths, cases_per_shard, check_sweep_size
from tunnel_lab.terminal.arguments import NO_EFFECT
from tunnel_sim.files.plan_file import PlanDocument, plan_from, run_count
from tunnel_sim.files.reading import as_described, parse_json
from tunnel_sim.files.rig_file import parse_rig
from tunnel_sim.vocabulary.plan import CampaignPlan
from tunnel_sim.vocabulary.rig import Rig


@dataclass(frozen=True)
class SweepCase:
    """One campaign of a sweep.

    Args:
        index: index in the order of the product, from 0.
        replicate: number of the repetition with other noise, from 0.
        duration: duration of every run, s.
        plan: the campaign with its seed.
        document: the case as a campaign description, ready to be written as TOML.
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
        return cases_per_shard(self.document)

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
        if scatter:  # without scatter, contents and seed must be the same as for a file without the table
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

    def __reduce__(self) -> tuple[Any, ...]:
        """A worker process rebuilds the sweep once from its text, and its axes once."""
        return _received, (self.to_json(),)

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
    def _parsed(self) -> tuple[Rig, ...]:
        named = zip(self.document.rig, self.rigs, strict=True)
        return tuple(parse_rig(sections, f"rig '{table.name}'") for table, sections in named)


@lru_cache(maxsize=2)
def _received(text: str) -> Sweep:
    return Sweep.from_json(text)


def _spread(table: Mapping[str, Sequence[float]]) -> list[dict[str, float]]:
    """Every combination of lists, the last key fastest."""
    return [dict(zip(table, values, strict=True)) for values in product(*table.values())]
