"""An experiment: a table of tasks, a pure function of a task, and the folder of its results.

A kind of experiment is a function in its own file, such as `sweep_of`, `score_of` and `breakdown_of`. Folder,
versions, resumption, workers and progress are the same for all kinds, and are here and in `runner`.

A folder has a manifest, such as ``sweep.json``, with the description of the experiment and the versions of the
code. Every finished task has a Parquet file in each dataset, named for the task. Files are written under a
temporary name and renamed. ``checksums`` has a file for each task in the format of ``sha256sum --check``; a
task is repeated if its files do not match it.
"""

from __future__ import annotations

import hashlib
import io
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Generic, Protocol, TypeVar

import polars as pl

from identification.estimators import Own, own_estimators
from tunnel_lab.experiments.estimate_rows import Failed, counted_failures
from tunnel_lab.experiments.runner import Progress, Workers
from tunnel_sim.files.reading import as_described, read_json, read_regular
from tunnel_sim.files.writing import clear_leftovers, output_folder, write_json, write_whole
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, shown

TaskT = TypeVar("TaskT")
SCHEMA_VERSION = 2
ELSEWHERE = "name another --out"
RESULTS, CHECKSUMS = "results", "checksums"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""The last bit of sums in a linear algebra library depends on its number of threads; a task uses one."""
_PACKAGES = ("virtual-wind-tunnel", "mujoco", "numpy", "scipy", "polars")
_OWN = "estimator "  # prefix of the name of a user's estimator, in the versions


@dataclass(frozen=True)
class Done:
    """A finished task: files that depend only on the task, and the failed estimates.

    Args:
        files: bytes by dataset.
        made_with: versions and number of threads of the process.
    """

    files: Mapping[str, bytes]
    failed: tuple[Failed, ...] = ()
    made_with: Mapping[str, str | None] = field(default_factory=dict)


Work = Callable[[TaskT], Done]


def _one(_: Any) -> int:
    return 1


@dataclass(frozen=True, eq=False)
class Experiment(Generic[TaskT]):
    """One experiment of any kind.

    Args:
        kind: name of the kind, also the manifest's.
        tasks: tasks in the order of the results.
        work: function of a task: a pure function of a module with its data, sent to the workers with every
            task.
        name: function from a task to the name of its files, without suffix.
        description: everything that determines the results, apart from the code, in JSON's types.
        estimators: names of the estimators that the work uses.
        datasets: names of the tables; the results come first.
        weight: weight of a task in the progress.
        about: further entries of the manifest, for people.
        elsewhere: the remedy if a folder holds something else.
        code_matters: whether results of changed code are refused, because the code itself is examined.
        described: function that converts a manifest's description to this version; raises for any other
            content.
    """

    kind: str
    tasks: Sequence[TaskT]
    work: Work[TaskT]
    name: Callable[[TaskT], str]
    description: Mapping[str, Any]
    estimators: Sequence[str] = ()
    datasets: tuple[str, ...] = (RESULTS,)
    weight: Callable[[TaskT], int] = _one
    about: Mapping[str, Any] = field(default_factory=dict)
    elsewhere: str = ELSEWHERE
    code_matters: bool = False
    described: Callable[[Any], Mapping[str, Any]] = dict


@cache
def versions() -> dict[str, str]:
    """Versions and processor that determine a result to the bit."""
    return {**{name: version(name) for name in _PACKAGES}, "machine": platform.machine()}


@cache
def _code() -> str:
    """A digest of all files of identification and tunnel_sim, including weights and libraries."""
    import identification
    import tunnel_sim

    digest = hashlib.sha256()
    for package in (identification, tunnel_sim):
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.relative_to(root).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


def made_with(estimators: Sequence[str], code_matters: bool) -> dict[str, str]:
    """Versions and processor, with the code of the user's estimators, and of this project if it matters."""
    own = {f"{_OWN}{one.name}": one.code for one in own_estimators(estimators)}
    return {**versions(), **own, **({"code": _code()} if code_matters else {})}


def parquet(
    rows: pl.DataFrame | Sequence[tuple[Any, ...]], columns: Mapping[str, Any] | None = None
) -> bytes:
    """A table as the bytes of a Parquet file."""
    frame = (
        rows
        if isinstance(rows, pl.DataFrame)
        else pl.DataFrame(rows, schema=dict(columns or {}), orient="row")
    )
    buffer = io.BytesIO()
    frame.write_parquet(buffer, compression="zstd")
    return buffer.getvalue()


class Store(Protocol):
    """A store of results: `Parts`, or the sealed answers of a blind set."""

    def finished(self) -> set[str]:
        """Names of the tasks with complete results."""

    def keep(self, name: str, done: Done) -> None:
        """Store the results of a task."""


@dataclass(frozen=True)
class Parts(Generic[TaskT]):
    """The folder of one experiment."""

    folder: Path
    experiment: Experiment[TaskT]

    def finished(self) -> set[str]:
        """Names of the tasks whose files exist and match their checksums."""
        return {name for name in map(self.experiment.name, self.experiment.tasks) if self._whole(name)}

    def _whole(self, name: str) -> bool:
        checksum = self._file(CHECKSUMS, name)
        if checksum.exists():
            with suppress(TunnelError):
                known = read_regular(checksum, limits.DOCUMENT_BYTES)
                files = {
                    dataset: read_regular(self._file(dataset, name), limits.DATA_BYTES)
                    for dataset in self.experiment.datasets
                }
                return known == self._lines(name, files)
        return False

    def _file(self, dataset: str, name: str) -> Path:
        return self.folder / dataset / f"{name}.{'sha256' if dataset == CHECKSUMS else 'parquet'}"

    def _lines(self, name: str, files: Mapping[str, bytes]) -> bytes:
        """The lines of ``sha256sum`` for the files of a task."""
        places = {dataset: self._file(dataset, name).relative_to(self.folder).as_posix() for dataset in files}
        sums = {dataset: hashlib.sha256(content).hexdigest() for dataset, content in files.items()}
        return "".join(f"{sums[dataset]}  {places[dataset]}\n" for dataset in files).encode()

    def keep(self, name: str, done: Done) -> None:
        """Write the files of a task, the results last."""
        files = {dataset: done.files[dataset] for dataset in self.experiment.datasets}
        write_whole(self._file(CHECKSUMS, name), self._lines(name, files))
        for dataset, content in reversed(files.items()):
            write_whole(self._file(dataset, name), content)

    def scan(self, dataset: str = RESULTS) -> pl.LazyFrame:
        """The table of the finished tasks, in the order of the tasks.

        Raises:
            TunnelError: when there is none yet, or the dataset is not stored.
        """
        finished = self.finished()
        names = [name for name in map(self.experiment.name, self.experiment.tasks) if name in finished]
        paths = [self._file(dataset, name) for name in names]
        if not paths or not all(path.exists() for path in paths):
            remedy = f"set {dataset} = true in the {self.experiment.kind} file"
            remedy = remedy if paths else f"run the {self.experiment.kind} first"
            raise TunnelError(f"there are no {dataset}", where=shown(self.folder), remedy=remedy)
        return pl.scan_parquet(paths)


def begin(experiment: Experiment[TaskT], folder: Path) -> Parts[TaskT]:
    """The folder of an experiment, created if missing.

    Raises:
        TunnelError: when the folder holds another experiment or other content, or cannot be written.
    """
    kind, where, elsewhere = experiment.kind, shown(folder), experiment.elsewhere
    manifest, description = folder / f"{kind}.json", experiment.description
    now = made_with(experiment.estimators, experiment.code_matters)
    if manifest.is_file():
        document = read_manifest(kind, folder, elsewhere, experiment.described)
        kept, before = document[kind], document["made_with"]
        if key := _first_difference(kept, description):
            what = f"the folder holds another {kind}, whose {key} differs"
            raise TunnelError(what, where=where, remedy=f"{elsewhere}, or undo the change")
        key = _first_difference(before, now)
        if key == "code" or (key.startswith(_OWN) and key in before and key in now):
            what = "the code" if key == "code" else f"the file of {key}"
            what = f"{what} has changed since the {kind} was begun"
            raise TunnelError(what, where=where, remedy=f"{elsewhere}, or undo the change")
        if key:
            what = f"the {kind} was begun with {key} {before.get(key)}, and this is {now.get(key)}"
            raise TunnelError(what, where=where, remedy=f"{elsewhere}, or go back to that version")
    else:
        refuse_other_content(experiment, folder)
        output_folder(folder)
        head = {"schema_version": SCHEMA_VERSION, **experiment.about}
        write_json(
            manifest, {**head, "made_with": now, kind: description}
        )  # first, to be continued from then on
    for dataset in (*experiment.datasets, CHECKSUMS):
        output_folder(folder / dataset)
    return Parts(folder, experiment)


def refuse_other_content(experiment: Experiment[Any], folder: Path) -> None:
    """Refuse a folder without a manifest that is not empty."""
    clear_leftovers(folder)
    # a command stopped before it wrote the manifest may have left empty folders
    for path in folder.iterdir() if folder.is_dir() else ():
        dataset = path.name in (*experiment.datasets, CHECKSUMS) and path.is_dir()
        if not (dataset and not any(path.iterdir())) and not path.name.startswith(
            f".{experiment.kind}.json."
        ):
            raise TunnelError(
                "the folder holds something else", where=shown(folder), remedy=experiment.elsewhere
            )


def read_manifest(
    kind: str, folder: Path, elsewhere: str = ELSEWHERE, described: Callable[[Any], Mapping[str, Any]] = dict
) -> dict[str, Any]:
    """The manifest in the folder of a kind of experiment; a `TunnelError` if it is not of this version."""
    path = folder / f"{kind}.json"
    document = read_json(path, remedy=f"name the folder of a {kind}")
    if document.get("schema_version") != SCHEMA_VERSION:
        what = f"this program reads version {SCHEMA_VERSION} only"
        raise TunnelError(what, where=shown(path), remedy=elsewhere)
    with as_described(f"is not a {kind}", shown(path), elsewhere):
        versions_of = {str(name): str(value) for name, value in document["made_with"].items()}
        return {"made_with": versions_of, kind: described(document[kind])}


def _first_difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """The first key with different values, by its own name if tables contain tables; empty if there is none."""
    for key in {**old, **new}:
        one, other = old.get(key), new.get(key)
        if one != other:
            if isinstance(one, Mapping) and isinstance(other, Mapping):
                return _first_difference(one, other)
            return key
    return ""


@dataclass(frozen=True)
class CommandOutcome:
    """The outcome of a command: the number of tasks finished before it, and the estimates that failed during it."""

    finished_before: int
    failed: tuple[Failed, ...] = ()


def _done(
    work: Work[TaskT], own: Sequence[Own], estimators: Sequence[str], code_matters: bool, task: TaskT
) -> Done:
    """Do a task, in any process: the user's estimators are made known there."""
    for one in own:
        one.register()
    threads = {"threads": os.environ.get(ONE_THREAD[0], "several")}
    return replace(work(task), made_with={**made_with(estimators, code_matters), **threads})


def run(
    experiment: Experiment[TaskT], store: Store, workers: Workers, progress: Progress | None = None
) -> CommandOutcome:
    """Do the unfinished tasks of an experiment. Only this process stores results: a repeated task is stored once.

    Args:
        progress: function called with the finished and the total weight, at the start and after each task.

    Raises:
        TunnelError: when a worker has other versions, or a result cannot be stored.
    """
    names, show = tuple(experiment.estimators), progress or (lambda _done, _total: None)
    wanted: dict[str, str | None] = {**made_with(names, experiment.code_matters), "threads": "1"}
    finished, failed = store.finished(), {}
    waiting = [task for task in experiment.tasks if experiment.name(task) not in finished]
    total = sum(map(experiment.weight, experiment.tasks))
    reached = total - sum(map(experiment.weight, waiting))
    show(reached, total)
    work = partial(_done, experiment.work, own_estimators(names), names, experiment.code_matters)
    with closing(workers(work, waiting)) as finishing:  # the workers end with the first error
        for task, done in finishing:
            odd = _first_difference(wanted, {name: done.made_with.get(name) for name in wanted})
            if odd:
                has = f"a worker has {odd} {done.made_with.get(odd)}"
                remedy = "give every worker the same environment (threads: OMP_NUM_THREADS=1)"
                raise TunnelError(f"{has}, but this {experiment.kind} uses {wanted[odd]}", remedy=remedy)
            store.keep(experiment.name(task), done)
            failed[experiment.name(task)] = done.failed
            reached += experiment.weight(task)
            show(reached, total)
    every = (one for name in sorted(failed) for one in failed[name])
    return CommandOutcome(len(experiment.tasks) - len(waiting), counted_failures(every))


def run_in(
    experiment: Experiment[TaskT], folder: Path, workers: Workers, progress: Progress | None = None
) -> tuple[Parts[TaskT], CommandOutcome]:
    """Begin or continue an experiment in a folder until its results are complete; errors as in `begin`."""
    store = begin(experiment, folder)
    outcome = run(experiment, store, workers, progress)
    for dataset in (*experiment.datasets, CHECKSUMS):  # partial files of a killed command
        clear_leftovers(folder / dataset)
    return store, outcome


def results_of(
    experiment: Experiment[TaskT], folder: Path | None, workers: Workers, progress: Progress | None = None
) -> tuple[pl.DataFrame, CommandOutcome]:
    """The complete results of an experiment of some minutes.

    Args:
        folder: folder for unfinished work; None: it is not kept.
    """
    with nullcontext(folder) if folder else TemporaryDirectory() as name:
        store, outcome = run_in(experiment, Path(name), workers, progress)
        return store.scan().collect(), outcome
