"""The trials of a score: every estimator on every trial of a grid, the Parquet table, and the scores.

A baseline is a table of trials. It contains its grid, to be repeatable.
"""

from __future__ import annotations

import hashlib
import io
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from importlib import resources
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import polars as pl

from identification.estimate import UNITS, Quantity
from identification.scoring import ScoredEstimate, Trials, collect
from tunnel_lab.experiments.asked import NOT_ASKED, RAISED, VERBS, Failure, asked, counted_failures
from tunnel_lab.experiments.runner import Progress, knowing, processes, run_tasks
from tunnel_lab.experiments.score_grid import Grid
from tunnel_lab.terminal.inputs import NO_EFFECT
from tunnel_sim.files.reading import (
    as_described,
    check_count,
    frame_schema,
    parse_json,
    read_frame,
    read_json,
    read_regular,
)
from tunnel_sim.files.writing import json_line, output_folder, write_json, write_whole
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, shown

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.campaign import Campaign


Row = dict[str, Any]
UNIT_TRIALS = 5
"""Trials done together; an interruption loses at most these in each process."""
_COLUMNS = (
    "cell", "trial", "estimator", "quantity", "unit", "truth", "value", "std", "bound", "status", "milliseconds"
)  # fmt: skip
_TYPES: Mapping[str, Any] = {
    **dict.fromkeys(("estimator", "quantity", "unit", "status"), pl.Utf8),
    **dict.fromkeys(("truth", "value", "std", "bound", "milliseconds"), pl.Float64),
    **dict.fromkeys(("cell", "trial"), pl.Int64),
}
_UNITS = {**UNITS, "zeta": "1", "omega_n": "rad/s"}
Key = tuple[str, int, str]
"""Estimator, index of the cell, quantity."""


class Named(Protocol):
    """A task of a score."""

    @property
    def name(self) -> str:
        """Name of its file."""


NamedT = TypeVar("NamedT", bound=Named)


@dataclass(frozen=True)
class Unit:
    """Trials of one cell, from the first up to but excluding the last; trials and cells are numbered from 0."""

    cell: int
    first: int
    stop: int

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"c{self.cell:04d}-t{self.first:05d}"


def score_unit(grid: Grid, estimators: Sequence[str], unit: Unit) -> list[Row]:
    """Every estimator on the unit's trials."""
    from tunnel_lab.experiments.score_grid import draw_trial

    cell = grid.cells[unit.cell]
    rows: list[Row] = []
    for number in range(unit.first, unit.stop):
        wanted = [name for name in estimators if number < grid.trials_for(name)]
        if not wanted:
            continue
        trial = draw_trial(cell, grid.seed, number)
        for name in wanted:
            rows += estimate_rows(
                name, trial.campaign, trial.truth, trial.bound, {"cell": unit.cell, "trial": number}
            )
    return rows


def estimate_rows(
    estimator: str,
    campaign: Campaign,
    truth: Mapping[str, float],
    bound: Mapping[str, float],
    about: Mapping[str, Any],
) -> list[Row]:
    """One estimator on one campaign of known truth, a row for each quantity of the truth.

    Where the estimator raises an exception or returns an invalid result, value and std are None, the status gives
    the kind of failure, and the first row has the `Failure` as ``failure``.

    Args:
        truth: by quantity, SI; ζ and ωn are those of the first run.
        bound: the Cramér–Rao bound by quantity, SI; quantities without one are left out.
        about: first columns of every row.
    """
    begun = time.perf_counter()
    answer = asked(campaign, estimator)
    milliseconds = 1000.0 * (time.perf_counter() - begun) / len(campaign.runs)
    if isinstance(answer, Failure):
        estimate, failed = None, {"failure": vars(answer)}
        status = f"{RAISED} {answer.error}" if answer.status == RAISED else answer.status
    else:
        estimate, failed, status = answer, {}, answer.status.name.lower()
    rows = []
    for quantity, value in truth.items():
        source = (
            None if estimate is None else estimate.runs[0] if quantity in ("zeta", "omega_n") else estimate
        )
        found = getattr(source, quantity, None)
        rows.append(
            {
                **about,
                "estimator": estimator,
                "quantity": quantity,
                "unit": _UNITS[quantity],
                "truth": value,
                "value": None if found is None else found.value,
                "std": None if found is None else found.std,
                "bound": bound.get(quantity),
                "status": status,
                "milliseconds": milliseconds,
            }
        )
    rows[0] |= failed
    return rows


def outcome(row: Row) -> ScoredEstimate:
    """A row in the form for scoring."""
    quantity = None if row["value"] is None else Quantity(row["value"], row["std"], row["unit"])
    return ScoredEstimate(row["truth"], quantity, row["bound"])


def score_grid(
    grid: Grid,
    estimators: Sequence[str],
    *,
    jobs: int = 2,
    parts: Path | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Every estimator on every trial of a grid, in the order of cells, trials and estimators.

    Args:
        jobs: processes; 0 works in this one. Except for the times, the rows do not depend on it.
        parts: folder for finished work, from which an interrupted score continues if grid, estimators and code
            are unchanged; None: finished work is not kept.

    Raises:
        TunnelError: when there are more trials than a table can hold.
    """
    quantities = sum(len(cell.quantities) for cell in grid.cells)
    count = quantities * sum(grid.trials_for(name) for name in estimators)
    what = "rows (trials × estimators × quantities)"
    check_count(count, limits.SCORE_ROWS, what, "score", "give fewer trials, cells or estimators")
    # Ordered across cells, to estimate the remaining time early.
    units = [
        Unit(cell, first, min(first + UNIT_TRIALS, grid.trials))
        for first in range(0, grid.trials, UNIT_TRIALS)
        for cell in range(len(grid.cells))
    ]
    rows = rows_of(
        knowing(partial(score_unit, grid, tuple(estimators)), estimators),
        units,
        fingerprint(grid.to_json_dict(), estimators),
        jobs=jobs,
        parts=parts,
        size=lambda unit: unit.stop - unit.first,
        progress=progress,
    )
    order = sorted(units, key=lambda unit: (unit.cell, unit.first))
    return [row for unit in order for row in rows[unit.name]]


def rows_of(
    work: Callable[[NamedT], list[Row]],
    tasks: Sequence[NamedT],
    mark: str,
    *,
    jobs: int,
    parts: Path | None,
    size: Callable[[NamedT], int] = lambda _: 1,
    progress: Progress | None = None,
) -> dict[str, list[Row]]:
    """The rows of every task, by its name; rows of finished tasks are kept in JSON files.

    Args:
        mark: rows kept under another mark are recomputed, see `fingerprint`.
        jobs: number of processes; 0 works in this one.
        parts: folder of the files; None: rows are not kept.
    """
    rows: dict[str, list[Row]] = {}
    if parts is not None:
        for task in tasks:
            try:
                document = read_json(parts / f"{task.name}.json", remedy="score it again")
            except TunnelError:  # missing or damaged
                continue
            kept = document.get("rows")
            if document.get("fingerprint") != mark or not isinstance(kept, list):
                continue
            if all(isinstance(row, dict) for row in kept):
                rows[task.name] = kept

    def keep(task: NamedT, found: list[Row]) -> None:
        if parts is not None:
            write_json(output_folder(parts) / f"{task.name}.json", {"fingerprint": mark, "rows": found})
        rows[task.name] = found

    run_tasks(
        work,
        tasks,
        processes(jobs),
        finished=lambda task: task.name in rows,
        keep=keep,
        size=size,
        progress=progress,
    )
    return rows


def fingerprint(document: Mapping[str, Any], estimators: Sequence[str]) -> str:
    """SHA-256 of everything that determines the results: conditions, estimators, and code of project and user."""
    from identification.estimators import own_estimators

    own = [one.code for one in own_estimators(estimators)]
    text = json.dumps([document, list(estimators), own, _code()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


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


@dataclass(frozen=True, eq=False)
class Results:
    """A finished score: a row for each trial, estimator and quantity, see `estimate_rows`."""

    grid: Grid
    estimators: tuple[str, ...]
    rows: tuple[Row, ...]

    def trials(self) -> dict[Key, Trials]:
        """The trials of every estimator, cell and quantity."""
        outcomes: dict[Key, list[ScoredEstimate]] = {}
        for row in self.rows:
            key = (row["estimator"], row["cell"], row["quantity"])
            outcomes.setdefault(key, []).append(outcome(row))
        return {key: collect(every) for key, every in outcomes.items()}

    @cached_property
    def not_given(self) -> dict[str, tuple[str, ...]]:
        """Quantities of the grid by estimator; see `not_given`."""
        return not_given(self.rows)

    def gives(self, estimator: str, quantity: str) -> bool:
        """Whether an estimator gives a quantity, or fails in trying; see `not_given`."""
        return quantity not in self.not_given.get(estimator, ())

    def milliseconds(self, estimator: str, cells: Sequence[int]) -> float:
        """Median time of `identify` for one record of some cells, examination included, ms."""
        wanted = set(cells)
        return median(
            float(row["milliseconds"])
            for row in self.rows
            if row["estimator"] == estimator and row["cell"] in wanted
        )


def not_given(rows: Iterable[Row]) -> dict[str, tuple[str, ...]]:
    """Quantities by estimator that it gives in no trial, unless its status is a failure in all trials.

    Failures are exceptions, and campaigns none of whose runs could be identified.

    Args:
        rows: with ``estimator``, ``quantity``, ``value`` and ``status``.
    """
    known: dict[tuple[str, str], list[bool]] = {}  # whether it is given, and whether it is not required
    for row in rows:
        seen = known.setdefault((row["estimator"], row["quantity"]), [False, False])
        seen[0] |= row["value"] is not None
        seen[1] |= row["status"] in NOT_ASKED
    found: dict[str, tuple[str, ...]] = {}
    for (name, quantity), (given, not_asked) in known.items():
        if not_asked and not given:
            found[name] = (*found.get(name, ()), quantity)
    return found


def failure_lines(rows: Sequence[Row]) -> list[str]:
    """Lines on estimators that raised exceptions or returned invalid results: the number, and the first case."""
    by_estimator: dict[str, list[Failure]] = {}
    for row in rows:
        if "failure" in row:
            by_estimator.setdefault(row["estimator"], []).append(Failure(**row["failure"]))
    lines = []
    for name, failures in by_estimator.items():
        for one in counted_failures(failures):
            times = "once" if one.count == 1 else f"{one.count} times"
            lines += [f"{name} {VERBS[one.status]} {times}; counted as failures. The first:", one.first]
    return lines


def groups_of(grid: Grid) -> dict[str, list[int]]:
    """Groups of pooled cells: decays, campaigns, and campaigns with each effect."""
    groups: dict[str, list[int]] = {}
    for index, cell in enumerate(grid.cells):
        name = "single decays" if cell.kind == "decay" else "campaigns"
        if cell.effect != NO_EFFECT:
            name = f"campaigns with {cell.effect}"
        groups.setdefault(name, []).append(index)
    return groups


def write_trials(path: Path, results: Results) -> Path:
    """Write the trials with their grid as Parquet, completely or not at all."""
    frame = trials_frame(results)
    described = json_line(results.grid.to_json_dict(), sort_keys=True)
    return write_whole(path, parquet(frame.with_columns(pl.lit(described).alias("grid"))))


def trials_frame(results: Results) -> pl.DataFrame:
    """A row for every trial, estimator and quantity; ``cell`` is the index of the grid's cell."""
    columns = {name: [row[name] for row in results.rows] for name in _COLUMNS}
    return pl.DataFrame(columns, schema_overrides=_TYPES)


def read_trials(path: Path) -> Results:
    """Read a file written by `write_trials`; estimators are in the order of their first rows."""
    where, remedy = shown(path), "write one with tunnel score --write-baseline"
    content = read_regular(path, limits.DATA_BYTES, missing=remedy, readable=remedy)
    with as_described("is not a table of trials", where, remedy):
        schema = frame_schema(content, where, remedy, rows=limits.SCORE_ROWS)
        wrong = [name for name, kind in _TYPES.items() if schema.get(name) != kind]
        if wrong or "grid" not in schema:
            raise ValueError(", ".join(wrong) or "grid")
        frame = read_frame(content, where, remedy, _COLUMNS)
        # Every row has the same grid; one is enough.
        text = read_frame(content, where, remedy, ("grid",))["grid"][0]
        grid = Grid.from_json_dict(parse_json(text, where, remedy))
        rows = tuple(frame.to_dicts())
        wanted = {(at, quantity) for at, cell in enumerate(grid.cells) for quantity in cell.quantities}
        scored: dict[str, set[tuple[int, str]]] = {}
        for row in rows:  # each estimator must have all cells, and each estimate all values
            scored.setdefault(row["estimator"], set()).add((row["cell"], row["quantity"]))
            if None in [row[name] for name in ("trial", "estimator", "unit", "truth", "status")]:
                raise ValueError("a row without its truth or status")
            if row["unit"] != _UNITS[row["quantity"]]:
                raise ValueError("a unit that is not the quantity's")
            if (row["value"] is None) != (row["std"] is None):
                raise ValueError("a value without its standard deviation")
            truth, value, std, bound = (row[name] for name in ("truth", "value", "std", "bound"))
            sizes = [abs(number) for number in (truth, value, std, bound) if number is not None]
            possible = all(size <= limits.LARGEST_NUMBER for size in sizes)  # also false for NaN
            possible &= truth != 0.0 if bound is None else not bound <= 0.0
            if (
                possible and value is not None
            ):  # its error is finite relative to bound, truth and standard deviation
                scales = [abs(scale) for scale in (truth, std, bound) if scale]
                errors = (abs(value - truth) / scale for scale in scales)
                possible = std >= 0.0 and all(error <= limits.LARGEST_NUMBER for error in errors)
            if not possible:
                raise ValueError("a number out of all range")
        if not scored or any(cells != wanted for cells in scored.values()):
            raise ValueError("cells that are not those of the grid")
    return Results(grid, tuple(dict.fromkeys(row["estimator"] for row in rows)), rows)


def packaged_baseline() -> Results:
    """The trials of all estimators on the packaged grid, the baseline of ``tunnel score --check packaged``."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-baseline.parquet") as path:
        return read_trials(path)


def parquet(frame: pl.DataFrame) -> bytes:
    """A table as the bytes of a Parquet file."""
    buffer = io.BytesIO()
    frame.write_parquet(buffer, compression="zstd")
    return buffer.getvalue()
