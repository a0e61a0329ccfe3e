"""Reading a sweep file: all errors are reported before anything is simulated."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from identification.estimators import ALL_ESTIMATORS
from tunnel_lab.experiments.sweep_cases import NO_EFFECT, Case, Sweep, SweepDocument, check_sweep_size
from tunnel_sim.effects import effect_class
from tunnel_sim.files.plan_schema import check_conditions, first_twice
from tunnel_sim.files.rig_file import parse_rig, rig_document
from tunnel_sim.files.toml_input import load_toml, shown, validate
from tunnel_sim.physics.motion import sampling
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

_AXES = ("rig", "conditions", "sensor", "truth", "effects")


def read_sweep(path: Path) -> Sweep:
    """Read and check a sweep file.

    Args:
        path: a TOML file; paths of rig files are relative to its folder.

    Raises:
        TunnelError: for the first error, in one line that names file, key and remedy.
    """
    content = load_toml(path, missing="name a sweep file, see docs/how-to/sweep.md")
    where = shown(path)
    document = _named(validate(SweepDocument, content, path))
    _check_names(document, where)
    for one in document.conditions:
        check_conditions(one, f"{where}, conditions '{one.name}'")
    check_sweep_size(document, where)
    rigs = tuple(_rig(table.file, table.changes, path.parent) for table in document.rig)
    for table, sections in zip(document.rig, rigs, strict=True):
        parse_rig(sections, f"{where}, rig '{table.name}'")
    sweep = Sweep(_without_sources(document), rigs)
    _check_axes(sweep, where)
    _check_cases(sweep, where)
    return sweep


def _named(document: SweepDocument) -> SweepDocument:
    """The same, with a name for every table of conditions."""
    many = len(document.conditions) > 1
    conditions = [
        one.model_copy(update={"name": one.name or (f"conditions-{place}" if many else "conditions")})
        for place, one in enumerate(document.conditions, 1)
    ]
    return document.model_copy(update={"conditions": conditions})


def _without_sources(document: SweepDocument) -> SweepDocument:
    """The same without the files and changes of the rigs, which are stored separately."""
    names = [table.model_copy(update={"file": None, "changes": {}}) for table in document.rig]
    return document.model_copy(update={"rig": names})


def _check_names(document: SweepDocument, where: str) -> None:
    for name in document.estimators:
        if name not in ALL_ESTIMATORS:
            raise TunnelError(
                f"unknown estimator '{name}'", where=where, remedy=did_you_mean(name, ALL_ESTIMATORS)
            )
    if not document.estimators and not document.records:
        raise TunnelError(
            "neither estimators nor records: there would be no result",
            where=where,
            remedy="name an estimator, or set records = true",
        )
    for key, names in (
        ("estimators", document.estimators),
        ("rig", [one.name for one in document.rig]),
        ("conditions", [str(one.name) for one in document.conditions]),
    ):
        twice = first_twice(names)
        if twice is not None:
            raise TunnelError(f"{key} has '{twice}' twice", where=where, remedy="give each its own name")
    for entry in document.effects:
        if entry.name == NO_EFFECT and (entry.parameters or entry.together_with):
            raise TunnelError(
                f"'{NO_EFFECT}' takes no other key",
                where=f"{where}, effects",
                remedy="name an effect, or give the name only",
            )
        for name in (entry.name, *(other.name for other in entry.together_with)):
            if name != NO_EFFECT or entry.together_with:
                with _in(where):
                    effect_class(name)


def _rig(file: str | None, changes: Mapping[str, Mapping[str, Any]], folder: Path) -> dict[str, Any]:
    """Sections of a rig with the changes, key by key."""
    sections = rig_document(None if file is None else folder / file)
    for name, table in changes.items():
        old = sections.get(name, {})
        # Anything but a table is left for the rig's own check to refuse.
        sections[name] = {**old, **table} if isinstance(old, dict) else old
    return sections


def _check_axes(sweep: Sweep, where: str) -> None:
    """Refuse a value that occurs twice in an axis: it would repeat the same records."""
    axes: Iterable[tuple[str, Sequence[Any]]] = zip(_AXES, (sweep.rigs, *sweep.axes[1:]), strict=True)
    for name, values in axes:
        seen: set[str] = set()
        for value in values:
            physics = {k: v for k, v in value.items() if k != "name"} if name == "conditions" else value
            text = json.dumps(physics, sort_keys=True)
            if text in seen:
                raise TunnelError(
                    f"{name} holds a value twice",
                    where=where,
                    remedy="remove one, and use replicates for more runs",
                )
            seen.add(text)


def _check_cases(sweep: Sweep, where: str) -> None:
    """Refuse what the simulator would refuse: check every sensor and effect with each rig and conditions."""
    from tunnel_sim.engine.virtual_campaign import plan_effects, run_settings

    for case in _cases(sweep, "sensor", where):
        with _in(where):
            sampling(run_settings(case.plan.truth, case.plan.conditions[0]), case.plan.sensor.sample_rate)
    for case in _cases(sweep, "effects", where):
        with _in(where):
            plan_effects(case.plan)


def _cases(sweep: Sweep, axis: str, where: str) -> Iterable[Case]:
    """Cases that combine every value of an axis with every rig and conditions."""
    lengths = tuple(map(len, sweep.axes))
    wanted = (*_AXES[:2], axis)
    for places in np.ndindex(tuple(lengths[_AXES.index(name)] for name in wanted)):
        place = [0] * len(lengths)
        for name, value in zip(wanted, places, strict=True):
            place[_AXES.index(name)] = value
        point = int(np.ravel_multi_index(tuple(place), lengths))
        with _in(where):
            case = sweep.case(point * sweep.document.replicates)
        yield case


@contextmanager
def _in(where: str) -> Iterator[None]:
    """Add the file to errors."""
    try:
        yield
    except TunnelError as error:
        place = error.where if where in error.where else ", ".join(filter(None, (where, error.where)))
        raise TunnelError(error.what, where=place, remedy=error.remedy) from None
