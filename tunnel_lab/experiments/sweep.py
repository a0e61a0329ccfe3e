"""A sweep: its file, checked before any simulation, and its experiment."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from identification.estimators import free_decay_estimators
from tunnel_lab.experiments.experiment import RESULTS, Experiment, read_manifest
from tunnel_lab.experiments.sweep_cases import Sweep
from tunnel_lab.experiments.sweep_tables import (
    SweepDocument,
    axis_lengths,
    check_sweep_size,
)
from tunnel_lab.experiments.sweep_work import RECORDS, run_shard
from tunnel_lab.terminal.arguments import NO_EFFECT
from tunnel_sim.effects import effect_class
from tunnel_sim.files.plan_file import check_conditions, first_twice
from tunnel_sim.files.rig_file import parse_rig, rig_document
from tunnel_sim.files.toml_input import load_toml, validate
from tunnel_sim.physics.run_settings import sampling
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, shown


def sweep_of(sweep: Sweep) -> Experiment[int]:
    """Simulate and estimate the cases of a sweep: a task is a shard, consecutive cases simulated together."""
    last, each = len(str(sweep.shards - 1)), sweep.cases_per_shard
    return Experiment(
        "sweep",
        range(sweep.shards),
        partial(run_shard, sweep),
        lambda shard: f"part-{shard:0{max(5, last)}d}",
        json.loads(sweep.to_json()),
        estimators=sweep.document.estimators,
        datasets=(RESULTS, RECORDS) if sweep.document.records else (RESULTS,),
        weight=lambda shard: min(each, sweep.size - shard * each),
        about={"name": sweep.document.name, "cases": sweep.size, "runs": sweep.runs, "shards": sweep.shards},
        described=_described,
    )


def _described(manifest: Any) -> Mapping[str, Any]:
    """The description in a manifest, with the keys of this version."""
    return dict(json.loads(Sweep.from_json(json.dumps(manifest)).to_json()))


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
    # files and changes of the rigs are left out, because the resulting descriptions are stored
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


def stored_sweep(folder: Path) -> Sweep:
    """The sweep of a folder, finished or not.

    Raises:
        TunnelError: when it does not hold a sweep, or the sweep is malformed or of another format version.
    """
    return Sweep.from_json(json.dumps(read_manifest("sweep", folder)["sweep"]))
