"""The score of estimators on the trials of a grid of conditions: the experiment, and its table of trials.

A baseline is a table of trials. It contains its grid, to be repeatable.
"""

from __future__ import annotations

import io
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib import resources
from pathlib import Path
from typing import Any

import polars as pl

from identification.scoring import Trials
from tunnel_lab.experiments.estimate_rows import (
    QUANTITY_COLUMNS,
    QUANTITY_UNITS,
    RAISED,
    Failed,
    Failure,
    asked,
    counted_failures,
    failures_in,
    not_given,
    quantity_rows,
)
from tunnel_lab.experiments.experiment import RESULTS, Done, Experiment, parquet, results_of
from tunnel_lab.experiments.runner import Progress, Workers
from tunnel_lab.experiments.score_columns import trials_of
from tunnel_lab.experiments.score_grid import Grid, ScoreTrial, draw_trial
from tunnel_lab.terminal.arguments import NO_EFFECT
from tunnel_sim.files.kept_process import read_apart
from tunnel_sim.files.reading import (
    as_described,
    check_count,
    frame_schema,
    parse_json,
    read_frame,
    read_regular,
)
from tunnel_sim.files.writing import json_line, write_whole
from tunnel_sim.sandbox import Message
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import shown

UNIT_TRIALS = 5
"""Number of trials done together; an interruption loses at most these in each process."""
ANSWER_COLUMNS: Mapping[str, Any] = {"estimator": pl.String, **QUANTITY_COLUMNS, "milliseconds": pl.Float64}
TRIAL_COLUMNS: Mapping[str, Any] = {**dict.fromkeys(("cell", "trial"), pl.Int64), **ANSWER_COLUMNS}
"""The columns of a table of trials; ``cell`` is the index of the grid's cell."""
Key = tuple[str, int, str]
"""Estimator, index of the cell, quantity."""


@dataclass(frozen=True)
class TrialBatch:
    """Trials of one cell, from the first up to but excluding the last; trials and cells are numbered from 0."""

    cell: int
    first: int
    stop: int


def score_of(grid: Grid, estimators: tuple[str, ...]) -> Experiment[TrialBatch]:
    """Run estimators on every trial of a grid, in an order across cells that shows the remaining time early."""
    return Experiment(
        "score",
        [
            TrialBatch(cell, first, min(first + UNIT_TRIALS, grid.trials))
            for first in range(0, grid.trials, UNIT_TRIALS)
            for cell in range(len(grid.cells))
        ],
        partial(score_unit, grid, estimators),
        lambda unit: f"c{unit.cell:04d}-t{unit.first:05d}",
        {**grid.to_json_dict(), "estimators": list(estimators)},
        estimators,
        weight=lambda unit: unit.stop - unit.first,
        elsewhere="name another --out, or add --overwrite",
        code_matters=True,
    )


def score_unit(grid: Grid, estimators: Sequence[str], unit: TrialBatch) -> Done:
    """Every estimator on the unit's trials."""
    cell, rows, failed = grid.cells[unit.cell], [], []
    for number in range(unit.first, unit.stop):
        wanted = [name for name in estimators if number < grid.trials_for(name)]
        if wanted:
            trial = draw_trial(cell, grid.seed, number)
            for name in wanted:
                answer, failure = answer_rows(name, trial)
                rows += [(unit.cell, number, *row) for row in answer]
                failed += failure
    return Done({RESULTS: parquet(rows, {**TRIAL_COLUMNS, "message": pl.String})}, counted_failures(failed))


def answer_rows(estimator: str, trial: ScoreTrial) -> tuple[list[tuple[Any, ...]], list[Failed]]:
    """One estimator on one campaign of known truth.

    Returns:
        A row of `ANSWER_COLUMNS` and a message for each quantity of the truth, and the failure, if any: if the
            estimator raises an exception or returns an invalid result, value and std are None.
    """
    campaign, truth = trial.campaign, trial.truth
    begun = time.perf_counter()
    answer = asked(campaign, estimator)
    milliseconds = 1000.0 * (time.perf_counter() - begun) / len(campaign.runs)
    if isinstance(answer, Failure):
        estimate, message, failed = None, answer.message, [answer.of(estimator)]
        status = f"{RAISED} {answer.error}" if answer.status == RAISED else answer.status
    else:
        estimate, message, failed = answer.runs[0] if "zeta" in truth else answer, None, []
        status = answer.status.name.lower()
    rows = quantity_rows(estimate, truth, truth, trial.bound, status)
    return [(estimator, *row, milliseconds, message) for row in rows], failed


def score_grid(
    grid: Grid,
    estimators: Sequence[str],
    workers: Workers,
    *,
    parts: Path | None = None,
    progress: Progress | None = None,
) -> tuple[Results, tuple[Failed, ...]]:
    """Every estimator on every trial of a grid, in the order of cells, trials and estimators, and the failures.

    Args:
        workers: workers; except for the times, the table does not depend on them.
        parts: folder of unfinished work; None: it is not kept.

    Raises:
        TunnelError: when there are more trials than a table can hold, or the folder has other work.
    """
    quantities = sum(len(cell.quantities) for cell in grid.cells)
    count = quantities * sum(grid.trials_for(name) for name in estimators)
    what = "rows (trials × estimators × quantities)"
    check_count(count, limits.SCORE_ROWS, what, "score", "give fewer trials, cells or estimators")
    table, outcome = results_of(score_of(grid, tuple(estimators)), parts, workers, progress)
    table = table.sort("cell", "trial", maintain_order=True)
    failed = failures_in(table, ("cell", "trial"), outcome.failed)
    return Results(grid, tuple(estimators), table.select(list(TRIAL_COLUMNS))), failed


@dataclass(frozen=True, eq=False)
class Results:
    """A finished score.

    Args:
        table: a row of `TRIAL_COLUMNS` for every trial, estimator and quantity.
    """

    grid: Grid
    estimators: tuple[str, ...]
    table: pl.DataFrame

    @cached_property
    def trials(self) -> dict[Key, Trials]:
        """The trials of every estimator, cell and quantity."""
        parts = self.table.partition_by("estimator", "cell", "quantity", as_dict=True, maintain_order=True)
        return {(str(name), int(cell), str(of)): trials_of(part) for (name, cell, of), part in parts.items()}

    @cached_property
    def not_given(self) -> dict[str, tuple[str, ...]]:
        """Quantities of the grid that each estimator does not give; see `not_given`."""
        return not_given(self.table)

    def gives(self, estimator: str, quantity: str) -> bool:
        """Whether an estimator gives a quantity, or fails in trying; see `not_given`."""
        return quantity not in self.not_given.get(estimator, ())

    def milliseconds(self, estimator: str, cells: Sequence[int]) -> float:
        """Median time of `identify` for one record of some cells, examination included, ms."""
        mine = (pl.col("estimator") == estimator) & pl.col("cell").is_in(list(cells))
        return float(self.table.filter(mine).select(pl.col("milliseconds").median()).item())


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
    described = json_line(results.grid.to_json_dict(), sort_keys=True)
    return write_whole(path, parquet(results.table.with_columns(pl.lit(described).alias("grid"))))


def read_trials(path: Path) -> Results:
    """Read a file written by `write_trials`; estimators are in the order of their first rows."""
    where, remedy = shown(path), "write one with tunnel score --write-baseline"
    content = read_regular(path, limits.DATA_BYTES, missing=remedy, readable=remedy)
    with as_described("is not a table of trials", where, remedy):
        found, (rows,) = read_apart(_trials, {"where": where, "remedy": remedy}, content, where)
        table, text = pl.read_ipc(rows), found["grid"]
        grid = Grid.from_json_dict(parse_json(text, where, remedy))
        odd = table.filter(~_possible()).height
        if odd or table.is_empty():
            raise ValueError("a number, a unit or a status out of all range")
        wanted = {(at, quantity) for at, cell in enumerate(grid.cells) for quantity in cell.quantities}
        names = table["estimator"].unique(maintain_order=True).to_list()
        for name in names:  # each estimator must have all cells, and each cell all quantities
            mine = table.filter(pl.col("estimator") == name).select("cell", "quantity").unique()
            if set(mine.iter_rows()) != wanted:
                raise ValueError("cells outside the grid")
    return Results(grid, tuple(names), table)


def _trials(given: dict[str, str], contents: list[bytes]) -> Message:
    """The grid of a file of trials, and its table in Arrow's format, decoded in a process with limits."""
    where, remedy, content = given["where"], given["remedy"], contents[0]
    with as_described("is not a table of trials", where, remedy):
        schema = frame_schema(content, where, remedy, rows=limits.SCORE_ROWS)
        wrong = [name for name, kind in TRIAL_COLUMNS.items() if schema.get(name) != kind]
        if wrong or "grid" not in schema:
            raise ValueError(", ".join(wrong) or "grid")
        rows = io.BytesIO()
        read_frame(content, where, remedy, tuple(TRIAL_COLUMNS)).write_ipc(rows)
        # Every row has the same grid; one is enough.
        return {"grid": read_frame(content, where, remedy, ("grid",))["grid"][0]}, [rows.getvalue()]


def _possible() -> pl.Expr:
    """Whether a row has its truth and status, its unit, a value with its deviation, and finite relative errors."""
    truth, value, std, bound = (pl.col(name) for name in ("truth", "value", "std", "bound"))
    complete = pl.all_horizontal(pl.col("trial", "estimator", "truth", "status").is_not_null())
    unit = pl.col("quantity").replace_strict(QUANTITY_UNITS, default=None, return_dtype=pl.String) == pl.col(
        "unit"
    )
    numbers = [complete, unit.fill_null(value=False), value.is_null() == std.is_null()]
    numbers += [
        (one.abs() <= limits.LARGEST_NUMBER).fill_null(value=True) for one in (truth, value, std, bound)
    ]
    numbers += [pl.when(bound.is_null()).then(truth != 0.0).otherwise(bound > 0.0).fill_null(value=False)]
    numbers += [(std >= 0.0).fill_null(value=True)]
    for scale in (truth, std, bound):
        error = (value - truth).abs() / scale.abs()
        numbers += [((scale == 0.0) | (error <= limits.LARGEST_NUMBER)).fill_null(value=True)]
    return pl.all_horizontal(numbers)


def packaged_baseline() -> Results:
    """The trials of all estimators on the packaged grid, the baseline of ``tunnel score --check packaged``."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-baseline.parquet") as path:
        return read_trials(path)
