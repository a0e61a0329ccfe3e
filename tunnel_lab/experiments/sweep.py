"""A sweep: its shards, pure functions of the sweep and their numbers, and the folder of the results.

``sweep.json`` in the folder describes the sweep. Every shard has a file in ``results``, and one in ``records`` if
records are stored. Files are written under a temporary name and renamed, results last: the shard is then finished.
``checksums`` has a file for each shard in the format of ``sha256sum --check``; a part that does not match its
checksum is repeated.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cache, lru_cache, partial
from importlib.metadata import version
from math import hypot
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from identification.estimate import PARAMETERS, UNITS
from identification.estimators import make_estimator, own_estimators
from tunnel_lab.experiments.asked import Failed, Failure, asked, counted_failures
from tunnel_lab.experiments.bounds import PlanBounds, nominal_oscillation, plan_bounds
from tunnel_lab.experiments.runner import Progress, Workers, knowing, run_tasks
from tunnel_lab.experiments.sweep_cases import Sweep, SweepCase
from tunnel_lab.terminal.inputs import NO_EFFECT
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.files.reading import as_described, read_json, read_regular
from tunnel_sim.files.writing import clear_leftovers, output_folder, write_json, write_whole
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.between_runs import SCATTERED, Scatter
from tunnel_sim.vocabulary.errors import TunnelError, one_line, shown
from tunnel_sim.vocabulary.plan import CampaignPlan

if TYPE_CHECKING:
    from identification.estimate import Estimate, RunEstimate
    from tunnel_sim.vocabulary.campaign import Campaign


SCHEMA_VERSION = 2
MANIFEST = "sweep.json"
RESULTS, RECORDS, CHECKSUMS = "results", "records", "checksums"
_OWN = "estimator "  # before the name of a user's estimator, in the versions of a sweep
_ELSEWHERE = "name another --out"
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""The last bit of sums in a linear algebra library depends on its number of threads; a shard uses one."""
_PACKAGES = ("virtual-wind-tunnel", "mujoco", "numpy", "scipy", "polars")
NOT_SIMULATED, SIMULATED = "not_simulated", "simulated"
RUN_QUANTITIES: Mapping[str, str] = {"omega_n": "rad/s", "zeta": "1"}
CAMPAIGN_QUANTITIES: Mapping[str, str] = {**{name: UNITS[name] for name in PARAMETERS}, "sensor_zero": "rad"}
SCATTER_COLUMNS: Mapping[str, str] = {f"scatter_{one.name}": one.name for one in fields(Scatter)}
"""The column of each number of a scatter."""
CASE_COLUMNS: Mapping[str, Any] = {
    **dict.fromkeys(("case", "replicate"), pl.UInt32),
    "seed": pl.Int64,
    **dict.fromkeys(("rig", "conditions"), pl.String),
    **dict.fromkeys(("duration", "sample_rate", "noise_std", "resolution"), pl.Float64),
    "effect": pl.String,
    "severity": pl.Float64,
    "effect_parameters": pl.String,
    **dict.fromkeys(("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping", "sensor_zero"), pl.Float64),
    **dict.fromkeys(SCATTER_COLUMNS, pl.Float64),
}
"""The simulated case; coefficients, zero and scatter are the injected ones."""
RESULT_COLUMNS: Mapping[str, Any] = {
    **CASE_COLUMNS,
    **dict.fromkeys(("estimator", "run"), pl.String),
    **dict.fromkeys(("spring_stiffness", "wind_speed", "release_angle"), pl.Float64),
    **dict.fromkeys(("quantity", "unit"), pl.String),
    **dict.fromkeys(("truth", "value", "std", "bound"), pl.Float64),
    **dict.fromkeys(("status", "message"), pl.String),
}
RECORD_COLUMNS: Mapping[str, Any] = {
    "case": pl.UInt32,
    "run": pl.String,
    **dict.fromkeys(("wind_speed", "spring_stiffness", "sample_rate"), pl.Float64),
    "yaw_rad": pl.List(pl.Float64),
}


@dataclass(frozen=True)
class Finished:
    """A finished shard, ready to be written: Parquet files, versions, and the estimates that failed.

    Results and records (None where they are not stored) do not depend on where or when the shard is done.
    """

    index: int
    results: bytes
    records: bytes | None
    made_with: Mapping[str, str]
    failed: tuple[Failed, ...] = ()


@cache
def made_with() -> dict[str, str]:
    """Versions and processor that determine a result to the bit."""
    return {**{name: version(name) for name in _PACKAGES}, "machine": platform.machine()}


def made_with_all(sweep: Sweep) -> dict[str, str]:
    """Versions and processor, with the code of the user's estimators in the sweep."""
    own = own_estimators(sweep.document.estimators)
    return {**made_with(), **{f"{_OWN}{one.name}": one.code for one in own}}


_sweep = lru_cache(maxsize=2)(Sweep.from_json)
_estimator = lru_cache(maxsize=16)(make_estimator)


def run_shard(sweep: str, index: int, nthread: int = 1) -> Finished:
    """Simulate the cases of a shard together, and estimate them one by one.

    Args:
        sweep: from `Sweep.to_json`.
        nthread: number of simulating threads; results are bit-identical for any number.
    """
    plan = _sweep(sweep)
    cases = list(plan.shard(index))
    groups: dict[tuple[str, float], list[SweepCase]] = {}
    for case in cases:
        groups.setdefault((case.rig_name, case.plan.sensor.sample_rate), []).append(case)
    done: dict[int, Campaign | Failure] = {}
    for group in groups.values():
        done.update(zip((case.index for case in group), _simulate(group, nthread), strict=True))
    campaigns = [(case, done[case.index]) for case in cases]
    answers: list[tuple[SweepCase, str | None, Estimate | Failure | None]] = []
    for name in plan.document.estimators:
        for case, campaign in campaigns:
            found = campaign if isinstance(campaign, Failure) else asked(campaign, _estimator(name))
            answers.append((case, name, found))
    if not plan.document.estimators:
        answers = [
            (case, None, campaign if isinstance(campaign, Failure) else None) for case, campaign in campaigns
        ]
    answers.sort(key=lambda answer: answer[0].index)  # the estimators of one case keep their order
    bounds = bounds_of(cases)
    rows = [row for answer in answers for row in estimate_rows(*answer, bounds[answer[0].index])]
    results = _parquet(rows, RESULT_COLUMNS)
    records = None
    if plan.document.records:
        kept = [
            (case.index, run.id, run.wind_speed, run.spring_stiffness, case.plan.sensor.sample_rate,
             pl.Series(run.record.yaw_rad))
            for case, campaign in campaigns
            if not isinstance(campaign, Failure)
            for run in campaign.runs
        ]  # fmt: skip
        records = _parquet(kept, RECORD_COLUMNS)
    return Finished(
        index=index,
        results=results,
        records=records,
        made_with={**made_with_all(plan), "threads": os.environ.get(ONE_THREAD[0], "several")},
        failed=counted_failures(found for _, _, found in answers if isinstance(found, Failure)),
    )


def bounds_of(cases: Sequence[SweepCase]) -> dict[int, PlanBounds]:
    """The bounds of cases by index; cases that differ only in seed and effects share one computation."""
    known: dict[object, PlanBounds] = {}
    found = {}
    for case in cases:
        widths = _widths(case.plan)
        key = (case.rig_name, case.plan.conditions, case.plan.truth, case.plan.sensor, *widths.items())
        if key not in known:
            known[key] = plan_bounds(case.plan, case.rig, widths)
        found[case.index] = known[key]
    return found


def _widths(plan: CampaignPlan) -> dict[str, float]:
    """Relative standard deviations between the runs of a case, of its scatter and of its effects, by name."""
    widths = {name: getattr(plan.scatter, name) for name in SCATTERED}
    for setting in plan.effects:
        effect = effect_from(setting.name, setting.parameters)
        if effect.scatters:
            widths[effect.scatters] = hypot(widths[effect.scatters], effect.severity)
    return widths


def _simulate(cases: Sequence[SweepCase], nthread: int) -> Sequence[Campaign | Failure]:
    """Simulate cases of one rig and sample rate; one bad case must not stop the others."""
    from tunnel_sim.engine.virtual_campaign import simulate_campaigns

    try:
        return simulate_campaigns([case.plan for case in cases], cases[0].rig, nthread=nthread)
    except TunnelError as error:
        if len(cases) == 1:
            return [Failure(NOT_SIMULATED, one_line(error))]
    half = len(cases) // 2
    return [*_simulate(cases[:half], nthread), *_simulate(cases[half:], nthread)]


def _parquet(rows: Sequence[tuple[Any, ...]], columns: Mapping[str, Any]) -> bytes:
    buffer = io.BytesIO()
    pl.DataFrame(rows, schema=dict(columns), orient="row").write_parquet(buffer, compression="zstd")
    return buffer.getvalue()


def estimate_rows(
    case: SweepCase, estimator: str | None, outcome: Estimate | Failure | None, bounds: PlanBounds
) -> Iterator[tuple[Any, ...]]:
    """The rows of one estimator's answer to one case.

    Args:
        bounds: of the case, see `bounds_of`.
        estimator: its name; None where the case was only simulated.
        outcome: its estimate, or the failure; None where the case was only simulated.

    Yields:
        Values of `RESULT_COLUMNS`, in their order: of the runs, then of the campaign.
    """
    plan, sensor, truth, conditions = case.plan, case.plan.sensor, case.plan.truth, case.plan.conditions
    severity = 0.0
    if plan.effects:
        first = plan.effects[0]
        severity = float(first.parameters[effect_class(first.name).parameters()[0].name])
    parameters = " ".join(  # in the format of ``--effect``
        f"{effect.name}:" + ",".join(f"{name}={value!r}" for name, value in effect.parameters.items())
        for effect in plan.effects
    )
    head = (
        case.index, case.replicate, plan.seed, case.rig_name, case.conditions, case.duration, sensor.sample_rate,
        sensor.noise_std, sensor.resolution, " + ".join(effect.name for effect in plan.effects) or NO_EFFECT,
        severity, parameters, truth.cn_beta, truth.cn_r, truth.yaw_inertia, truth.mechanical_damping, sensor.zero,
        *(float(getattr(plan.scatter, name)) for name in SCATTER_COLUMNS.values()), estimator,
    )  # fmt: skip
    answer = None if isinstance(outcome, Failure) else outcome
    status, message = (outcome.status, outcome.message) if isinstance(outcome, Failure) else (SIMULATED, None)
    for place, condition in enumerate(conditions):
        run = answer.runs[place] if answer else None
        nominal = nominal_oscillation(condition, truth, case.rig) or {}
        given = (condition.id, condition.spring_stiffness, condition.wind_speed, condition.release_angle)
        found = run.status.name.lower() if run else status
        for name, unit in RUN_QUANTITIES.items():
            figures = (nominal.get(name), *_figures(run, name), bounds.runs[place].get(name))
            yield (*head, *given, name, unit, *figures, found, message)
    # Spring, wind-on speed and release angle of the campaign, each only if unique.
    kinds = (
        {condition.spring_stiffness for condition in conditions},
        {condition.wind_speed for condition in conditions if condition.wind_speed > 0.0} or {0.0},
        {condition.release_angle for condition in conditions},
    )
    common = (None, *(next(iter(kind)) if len(kind) == 1 else None for kind in kinds))
    injected = {**vars(truth), "sensor_zero": sensor.zero}
    found = answer.status.name.lower() if answer else status
    for name, unit in CAMPAIGN_QUANTITIES.items():
        figures = (injected[name], *_figures(answer, name), bounds.campaign.get(name))
        yield (*head, *common, name, unit, *figures, found, message)


def _figures(owner: Estimate | RunEstimate | None, name: str) -> tuple[float | None, float | None]:
    quantity = getattr(owner, name, None)
    return (None, None) if quantity is None else (quantity.value, quantity.std)


@dataclass(frozen=True)
class Store:
    """The folder of one sweep with its ``sweep.json``, and the versions for its results."""

    folder: Path
    sweep: Sweep
    made_with: Mapping[str, str]

    def finished(self) -> list[int]:
        """Shards whose parts exist and match their checksums, in ascending order."""
        kept = (RESULTS, RECORDS) if self.sweep.document.records else (RESULTS,)
        found = []
        for index in range(self.sweep.shards):
            checksum = self._file(CHECKSUMS, index)
            if checksum.exists():
                with suppress(TunnelError):
                    known = read_regular(checksum, limits.DOCUMENT_BYTES)
                    parts = {name: read_regular(self._file(name, index), limits.DATA_BYTES) for name in kept}
                    lines = (self._line(name, index, part) for name, part in parts.items())
                    found += [index] if known == "".join(lines).encode() else []
        return found

    def _file(self, dataset: str, index: int) -> Path:
        width = max(5, len(str(self.sweep.shards - 1)))
        suffix = "sha256" if dataset == CHECKSUMS else "parquet"
        return self.folder / dataset / f"part-{index:0{width}d}.{suffix}"

    def _line(self, dataset: str, index: int, content: bytes) -> str:
        """The line of ``sha256sum`` for a part."""
        name = self._file(dataset, index).relative_to(self.folder).as_posix()
        return f"{hashlib.sha256(content).hexdigest()}  {name}\n"

    def keep(self, shard: Finished) -> None:
        """Write a finished shard; a `TunnelError` when its versions differ, or it cannot be written."""
        wanted = {**self.made_with, "threads": "1"}
        odd = _first_difference(wanted, {name: shard.made_with.get(name) for name in wanted})
        if odd:
            what = f"a worker has {odd} {shard.made_with.get(odd)}, but this sweep uses {wanted[odd]}"
            remedy = "give every worker the same environment (threads: OMP_NUM_THREADS=1)"
            raise TunnelError(what, where=shown(self.folder), remedy=remedy)
        lines = self._line(RESULTS, shard.index, shard.results)
        if shard.records is not None:
            write_whole(self._file(RECORDS, shard.index), shard.records)
            lines += self._line(RECORDS, shard.index, shard.records)
        write_whole(self._file(CHECKSUMS, shard.index), lines.encode())
        write_whole(self._file(RESULTS, shard.index), shard.results)

    def scan(self, dataset: str = RESULTS) -> pl.LazyFrame:
        """The results or records of the finished shards, in the order of the cases.

        Raises:
            TunnelError: when there are none yet.
        """
        parts = [self._file(dataset, index) for index in self.finished()]
        if not parts or not all(path.exists() for path in parts):
            remedy = "run the sweep first" if not parts else "set records = true in the sweep file"
            raise TunnelError(f"there are no {dataset}", where=shown(self.folder), remedy=remedy)
        return pl.scan_parquet(parts)


def begin(sweep: Sweep, folder: Path) -> Store:
    """The folder of a sweep, created where missing.

    Raises:
        TunnelError: when the folder holds another sweep or something else, or cannot be written.
    """
    where, versions = shown(folder), made_with_all(sweep)
    if (folder / MANIFEST).is_file():
        store = open_store(folder)
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
        if key := _first_difference(store.made_with, versions):
            if key.startswith(_OWN) and {key} <= store.made_with.keys() & versions.keys():
                raise TunnelError(
                    f"the file of {key} has changed since the sweep was begun",
                    where=where,
                    remedy=f"{_ELSEWHERE}, or undo the change of that file",
                )
            raise TunnelError(
                f"the sweep was begun with {key} {store.made_with.get(key)}, and this is {versions.get(key)}",
                where=where,
                remedy=f"{_ELSEWHERE}, or go back to that version",
            )
    else:
        clear_leftovers(folder)
        # A sweep stopped before its ``sweep.json`` was written may have left empty folders.
        for path in folder.iterdir() if folder.is_dir() else ():
            dataset = path.name in (RESULTS, RECORDS, CHECKSUMS) and path.is_dir()
            if not (dataset and not any(path.iterdir())) and not path.name.startswith(f".{MANIFEST}."):
                raise TunnelError("the folder holds something else", where=where, remedy=_ELSEWHERE)
        output_folder(folder)
        document = {
            "schema_version": SCHEMA_VERSION,
            "name": sweep.document.name,
            "cases": sweep.size,
            "runs": sweep.runs,
            "shards": sweep.shards,
            "made_with": versions,
            "sweep": json.loads(sweep.to_json()),
        }
        write_json(folder / MANIFEST, document)  # first: a sweep stopped afterwards can be continued
        store = Store(folder, sweep, versions)
    for name in (RESULTS, CHECKSUMS, *([RECORDS] if sweep.document.records else [])):
        output_folder(folder / name)
    return store


def _first_difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    return next((key for key in {**old, **new} if old.get(key) != new.get(key)), "")


def open_store(folder: Path) -> Store:
    """Open the folder of a sweep, finished or not.

    Raises:
        TunnelError: when it does not hold a sweep, or the sweep is malformed or of another format version.
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


@dataclass(frozen=True)
class Outcome:
    """The outcome of a sweep: the number of shards finished before, and the failed estimates of this run."""

    store: Store
    found: int
    failed: tuple[Failed, ...] = ()


def run_sweep(sweep: Sweep, folder: Path, workers: Workers, progress: Progress | None = None) -> Outcome:
    """Do the unfinished shards of a sweep, after which all results are complete.

    Args:
        progress: called with the number of finished cases and of all cases, at the start and after each shard.

    Raises:
        TunnelError: when the folder belongs to another sweep, or the work cannot be done.
    """
    store = begin(sweep, folder)
    failed: dict[int, tuple[Failed, ...]] = {}

    def keep(_: int, shard: Finished) -> None:
        store.keep(shard)
        failed[shard.index] = shard.failed

    found = run_tasks(
        knowing(partial(run_shard, sweep.to_json()), sweep.document.estimators),
        range(sweep.shards),
        workers,
        finished=set(store.finished()).__contains__,
        keep=keep,
        size=lambda index: min(sweep.cases_per_shard, sweep.size - index * sweep.cases_per_shard),
        progress=progress,
    )
    for name in (RESULTS, RECORDS, CHECKSUMS):  # partial files that a killed run left
        clear_leftovers(store.folder / name)
    return Outcome(store, found, counted_failures(one for index in sorted(failed) for one in failed[index]))
