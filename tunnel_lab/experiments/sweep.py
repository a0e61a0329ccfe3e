"""A sweep: its file, which is checked before anything is simulated, and its folder, where finished shards are kept.

``sweep.json`` in the folder describes the sweep. Every shard is a file in ``results``, and one in ``records`` where
these are stored. Files are written under a temporary name and renamed, results last: the shard is then finished.
``checksums`` holds a file for each shard in the format of ``sha256sum --check``; a part that does not match its
checksum is repeated. ``timings`` are separate, because they differ every time.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.estimators import ALL_ESTIMATORS
from tunnel_lab.experiments.runner import Progress, Workers, run_tasks
from tunnel_lab.experiments.sweep_cases import Sweep, SweepCase, SweepDocument, check_sweep_size
from tunnel_lab.terminal.inputs import NO_EFFECT
from tunnel_sim.effects import effect_class
from tunnel_sim.files.plan_file import check_conditions, first_twice
from tunnel_sim.files.reading import as_described, frame_schema, read_frame, read_json, read_regular
from tunnel_sim.files.rig_file import parse_rig, rig_document
from tunnel_sim.files.toml_input import load_toml, shown, validate
from tunnel_sim.files.writing import clear_leftovers, output_folder, write_json, write_whole
from tunnel_sim.physics.run_settings import sampling
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

if TYPE_CHECKING:
    import polars as pl

    from tunnel_lab.experiments.sweep_shards import Finished


_AXES = ("rig", "conditions", "sensor", "truth", "effects")
SCHEMA_VERSION = 1
MANIFEST = "sweep.json"
RESULTS, RECORDS, TIMINGS, CHECKSUMS = "results", "records", "timings", "checksums"
_ELSEWHERE = "name another --out"
_TIMING_COLUMNS = ("step", "runs", "seconds")


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
    for conditions in document.conditions:
        check_conditions(conditions, f"{where}, conditions '{conditions.name}'")
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
        table.model_copy(update={"name": table.name or (f"conditions-{place}" if many else "conditions")})
        for place, table in enumerate(document.conditions, 1)
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
        ("rig", [table.name for table in document.rig]),
        ("conditions", [str(table.name) for table in document.conditions]),
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


def _cases(sweep: Sweep, axis: str, where: str) -> Iterable[SweepCase]:
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


@dataclass(frozen=True)
class Store:
    """The folder of one sweep.

    Args:
        folder: an existing folder with the ``sweep.json`` of the sweep.
        made_with: versions that its results are made with.
    """

    folder: Path
    sweep: Sweep
    made_with: Mapping[str, str]

    def finished(self) -> list[int]:
        """Shards whose parts exist and match their checksums, in ascending order."""
        return [index for index in range(self.sweep.shards) if self._is_whole(index)]

    def keep(self, shard: Finished) -> None:
        """Write a finished shard.

        Raises:
            TunnelError: when it was made with other versions, or cannot be written.
        """
        wanted = {**self.made_with, "threads": "1"}
        odd = next((name for name, value in wanted.items() if shard.made_with.get(name) != value), None)
        if odd is not None:
            raise TunnelError(
                f"a worker has {odd} {shard.made_with.get(odd)}, but this sweep uses {wanted[odd]}",
                where=shown(self.folder),
                remedy="give every worker the same environment (threads: OMP_NUM_THREADS=1)",
            )
        lines = self._line(RESULTS, shard.index, shard.results)
        if shard.records is not None:
            write_whole(self._part(RECORDS, shard.index), shard.records)
            lines += self._line(RECORDS, shard.index, shard.records)
        write_whole(self._part(TIMINGS, shard.index), shard.timings)
        write_whole(self._checksum(shard.index), lines.encode())
        write_whole(self._part(RESULTS, shard.index), shard.results)

    def tidy(self) -> None:
        """Remove partial files that a killed run left."""
        for name in (RESULTS, RECORDS, TIMINGS, CHECKSUMS):
            clear_leftovers(self.folder / name)

    def timings(self) -> pl.DataFrame:
        """The times of the finished shards; a shard whose times were removed is left out.

        Returns:
            Columns ``step``, ``runs`` and ``seconds``, with a row for each step of each shard.

        Raises:
            TunnelError: when one is damaged.
        """
        import polars as pl

        from tunnel_lab.experiments.sweep_shards import TIMING_COLUMNS

        paths = [self._part(TIMINGS, index) for index in self.finished()]
        used = {name: TIMING_COLUMNS[name] for name in _TIMING_COLUMNS}
        return pl.concat(
            [pl.DataFrame(schema=used), *(_read_timing(path) for path in paths if path.exists())]
        )

    def scan(self, dataset: str = RESULTS) -> pl.LazyFrame:
        """The rows of the finished shards, in the order of the cases.

        Args:
            dataset: ``results`` or ``records``.

        Raises:
            TunnelError: when there is none yet.
        """
        import polars as pl

        parts = [self._part(dataset, index) for index in self.finished()]
        if not parts or not all(path.exists() for path in parts):
            raise TunnelError(
                f"there are no {dataset}",
                where=shown(self.folder),
                remedy="run the sweep first" if not parts else "set records = true in the sweep file",
            )
        return pl.scan_parquet(parts)

    def _part(self, dataset: str, index: int) -> Path:
        return self.folder / dataset / f"{self._name(index)}.parquet"

    def _checksum(self, index: int) -> Path:
        return self.folder / CHECKSUMS / f"{self._name(index)}.sha256"

    def _name(self, index: int) -> str:
        width = max(5, len(str(self.sweep.shards - 1)))
        return f"part-{index:0{width}d}"

    def _line(self, dataset: str, index: int, content: bytes) -> str:
        """The line of ``sha256sum`` for a part."""
        name = self._part(dataset, index).relative_to(self.folder).as_posix()
        return f"{hashlib.sha256(content).hexdigest()}  {name}\n"

    def _is_whole(self, index: int) -> bool:
        """Whether the parts of a shard exist and match their checksums."""
        if not self._checksum(index).exists():
            return False
        kept = (RESULTS, RECORDS) if self.sweep.document.records else (RESULTS,)
        try:
            known = read_regular(self._checksum(index), limits.DOCUMENT_BYTES)
            parts = {name: read_regular(self._part(name, index), limits.DATA_BYTES) for name in kept}
        except TunnelError:
            return False
        return known == "".join(self._line(name, index, part) for name, part in parts.items()).encode()


def begin(sweep: Sweep, folder: Path) -> Store:
    """The folder of a sweep, which may be new.

    Args:
        folder: created where it is missing.

    Raises:
        TunnelError: when the folder holds another sweep or something else, or cannot be written.
    """
    from tunnel_lab.experiments.sweep_shards import made_with

    if (folder / MANIFEST).is_file():
        store = open_store(folder)
        _check_same(store, sweep, made_with())
    else:
        clear_leftovers(folder)
        if folder.is_dir() and not all(map(_is_begun, folder.iterdir())):
            raise TunnelError("the folder holds something else", where=shown(folder), remedy=_ELSEWHERE)
        output_folder(folder)
        document = {
            "schema_version": SCHEMA_VERSION,
            "name": sweep.document.name,
            "cases": sweep.size,
            "runs": sweep.runs,
            "shards": sweep.shards,
            "made_with": made_with(),
            "sweep": json.loads(sweep.to_json()),
        }
        write_json(folder / MANIFEST, document)  # first: what is stopped afterwards is continued
        store = Store(folder, sweep, made_with())
    for name in (RESULTS, TIMINGS, CHECKSUMS, *([RECORDS] if sweep.document.records else [])):
        output_folder(folder / name)
    return store


def _is_begun(path: Path) -> bool:
    """Whether a sweep that was stopped before its ``sweep.json`` was written may have left this."""
    empty_dataset = (
        path.name in (RESULTS, RECORDS, TIMINGS, CHECKSUMS) and path.is_dir() and not any(path.iterdir())
    )
    return empty_dataset or path.name.startswith(f".{MANIFEST}.")


def open_store(folder: Path) -> Store:
    """Open the folder of a sweep, finished or not.

    Args:
        folder: as given to `begin`.

    Raises:
        TunnelError: when it holds no sweep, or one that is malformed or of another version of the format.
    """
    path = folder / MANIFEST
    document = read_json(path, remedy="name the folder of a sweep")
    if document.get("schema_version") != SCHEMA_VERSION:
        raise TunnelError(
            f"this program reads version {SCHEMA_VERSION} only", where=shown(path), remedy=_ELSEWHERE
        )
    with as_described("is not a sweep", shown(path), _ELSEWHERE):
        made_with = {str(name): str(value) for name, value in document["made_with"].items()}
        return Store(folder, Sweep.from_json(json.dumps(document["sweep"])), made_with)


def _read_timing(path: Path) -> pl.DataFrame:
    """The times of one shard. They have no checksum, so the file may be anything: a FIFO would block Polars."""
    where, remedy = shown(path), "remove it: no result depends on it"
    content = read_regular(path, limits.DATA_BYTES, readable=remedy)
    with as_described("is not a table of times", where, remedy):
        schema = frame_schema(content, where, remedy, rows=limits.SCORE_ROWS)
        if missing := [name for name in _TIMING_COLUMNS if name not in schema]:
            raise ValueError(f"no column {missing[0]}")
        return read_frame(content, where, remedy, _TIMING_COLUMNS)


def _check_same(store: Store, sweep: Sweep, versions: Mapping[str, str]) -> None:
    where = shown(store.folder)
    old, new = (json.loads(each.to_json()) for each in (store.sweep, sweep))
    if old != new:
        key = _first_difference(
            {**old["document"], "rig": old["rigs"]}, {**new["document"], "rig": new["rigs"]}
        )
        raise TunnelError(
            f"the folder holds sweep '{store.sweep.document.name}', whose {key} differs from the file's",
            where=where,
            remedy=f"{_ELSEWHERE}, or undo the change",
        )
    key = _first_difference(dict(store.made_with), dict(versions))
    if key:
        raise TunnelError(
            f"the sweep was begun with {key} {store.made_with.get(key)}, and this is {versions.get(key)}",
            where=where,
            remedy=f"{_ELSEWHERE}, or go back to that version",
        )


def _first_difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    return next((key for key in {**old, **new} if old.get(key) != new.get(key)), "")


@dataclass(frozen=True)
class Outcome:
    """The outcome of a sweep.

    Args:
        found: number of shards that were finished already.
        crashes: number of estimates that raised an exception, in the shards done now.
    """

    store: Store
    found: int
    crashes: int


def run_sweep(sweep: Sweep, folder: Path, workers: Workers, progress: Progress | None = None) -> Outcome:
    """Do the rest of a sweep.

    Args:
        progress: called with the number of finished cases and of all cases, at the start and after each shard.

    Returns:
        The outcome; all results are then complete.

    Raises:
        TunnelError: when the folder belongs to another sweep, or the work cannot be done.
    """
    from tunnel_lab.experiments.sweep_shards import run_shard

    store = begin(sweep, folder)
    finished = set(store.finished())
    crashes = []

    def keep(_: int, shard: Finished) -> None:
        store.keep(shard)
        crashes.append(shard.crashes)

    kept = run_tasks(
        partial(run_shard, sweep.to_json()),
        range(sweep.shards),
        workers,
        finished=finished.__contains__,
        keep=keep,
        size=lambda index: min(sweep.cases_per_shard, sweep.size - index * sweep.cases_per_shard),
        progress=progress,
    )
    store.tidy()
    return Outcome(store, kept, sum(crashes))
