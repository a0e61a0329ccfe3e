"""Trials as a table, stored as Parquet, and their scores.

A baseline is such a table of trials. It contains its grid, so that it can be repeated.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identification.estimate import Quantity
from identification.scoring.accuracy import Outcome, Score, Trials, collect, score
from tunnel_lab.scoring.grid import NO_EFFECT, Cell, Grid
from tunnel_lab.scoring.work import Row, describe, outcome, unit_of
from tunnel_sim.files.json_text import json_line
from tunnel_sim.files.reading import as_described, frame_schema, parse_json, read_frame, read_regular
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import shown

if TYPE_CHECKING:
    import polars as pl

_COLUMNS = (
    "cell", "trial", "estimator", "quantity", "unit", "truth", "value", "std", "bound", "status", "milliseconds"
)  # fmt: skip

Key = tuple[str, int, str]
"""Estimator, index of the cell, quantity."""


@dataclass(frozen=True, eq=False)
class Results:
    """A finished score.

    Args:
        estimators: names, in the order given.
        rows: one per trial, estimator and quantity; see `tunnel_lab.scoring.work`.
    """

    grid: Grid
    estimators: tuple[str, ...]
    rows: tuple[Row, ...]

    def trials(self) -> dict[Key, Trials]:
        """The trials of every estimator, cell and quantity."""
        outcomes: dict[Key, list[Outcome]] = {}
        for row in self.rows:
            key = (row["estimator"], row["cell"], row["quantity"])
            outcomes.setdefault(key, []).append(outcome(row))
        return {key: collect(every) for key, every in outcomes.items()}

    def milliseconds(self, estimator: str, cells: Sequence[int]) -> float:
        """Median time an estimator took for one record, ms.

        Args:
            cells: indices of the cells to include.
        """
        from statistics import median

        wanted = set(cells)
        return median(
            float(row["milliseconds"])
            for row in self.rows
            if row["estimator"] == estimator and row["cell"] in wanted
        )

    def raised(self) -> dict[str, list[str]]:
        """Exceptions by estimator; empty where there were none."""
        found: dict[str, set[str]] = {}
        for row in self.rows:
            if row["status"].startswith("raised "):
                found.setdefault(row["estimator"], set()).add(row["status"].removeprefix("raised "))
        return {name: sorted(kinds) for name, kinds in found.items()}


def groups_of(grid: Grid) -> dict[str, list[int]]:
    """Cells that are pooled: decays, campaigns, and campaigns with each effect."""
    found: dict[str, list[int]] = {}
    for index, cell in enumerate(grid.cells):
        found.setdefault(_group(cell), []).append(index)
    return found


def _group(cell: Cell) -> str:
    if cell.kind == "decay":
        return "single decays"
    return "campaigns" if cell.effect == NO_EFFECT else f"campaigns with {cell.effect}"


def write_trials(path: Path, results: Results) -> Path:
    """Write the trials with their grid as Parquet, completely or not at all.

    Args:
        path: the file; replaced when it exists.
    """
    import polars as pl

    frame = trials_frame(results)
    described = json_line(results.grid.to_json_dict(), sort_keys=True)
    return write_whole(path, parquet(frame.with_columns(pl.lit(described).alias("grid"))))


def trials_frame(results: Results) -> pl.DataFrame:
    """A row for every trial, estimator and quantity.

    Returns:
        Columns as in the rows; ``cell`` is the index of the grid's cell.
    """
    import polars as pl

    columns = {name: [row[name] for row in results.rows] for name in _COLUMNS}
    return pl.DataFrame(columns, schema_overrides=_types())


def read_trials(path: Path) -> Results:
    """Read what `write_trials` wrote.

    Returns:
        The results, estimators in the order of their first rows.

    Raises:
        TunnelError: when there is no such file, or it is not a table of trials.
    """
    where, remedy = shown(path), "write one with tunnel score --write-baseline"
    content = read_regular(path, limits.DATA_BYTES, missing=remedy, readable=remedy)
    with as_described("is not a table of trials", where, remedy):
        schema = frame_schema(content, where, remedy, rows=limits.SCORE_ROWS)
        wrong = [name for name, kind in _types().items() if schema.get(name) != kind]
        if wrong or "grid" not in schema:
            raise ValueError(", ".join(wrong) or "grid")
        frame = read_frame(content, where, remedy, _COLUMNS)
        # Every row carries the same grid; one is enough.
        text = read_frame(content, where, remedy, ("grid",))["grid"][0]
        grid = Grid.from_json_dict(parse_json(text, where, remedy))
        rows = tuple(frame.to_dicts())
        _check_rows(rows, grid)
    return Results(grid, tuple(dict.fromkeys(row["estimator"] for row in rows)), rows)


def packaged_baseline() -> Results:
    """The trials of all estimators on the packaged grid, which ``tunnel score --check packaged`` compares with."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-baseline.parquet") as path:
        return read_trials(path)


def packaged_breakdown() -> pl.DataFrame:
    """Results of ``tunnel score --breakdown``; columns as in its Parquet file."""
    import polars as pl

    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-breakdown.parquet") as path:
        return pl.read_parquet(path)


def _check_rows(rows: Sequence[Row], grid: Grid) -> None:
    """Refuse incomplete rows: each estimator must have all cells, and each estimate all values."""
    wanted = {(at, quantity) for at, cell in enumerate(grid.cells) for quantity in cell.quantities}
    found: dict[str, set[tuple[int, str]]] = {}
    for row in rows:
        found.setdefault(row["estimator"], set()).add((row["cell"], row["quantity"]))
        if None in [row[name] for name in ("trial", "estimator", "unit", "truth", "status")]:
            raise ValueError("a row without its truth or status")
        if row["unit"] != unit_of(row["quantity"]):
            raise ValueError("a unit that is not the quantity's")
        if (row["value"] is None) != (row["std"] is None):
            raise ValueError("a value without its standard deviation")
        if not _can_be_scored(row):
            raise ValueError("a number out of all range")
    if not found or any(cells != wanted for cells in found.values()):
        raise ValueError("cells that are not those of the grid")


def _can_be_scored(row: Row) -> bool:
    """Whether the row's error is a number over its bound, its truth and its standard deviation."""
    truth, value, std, bound = (row[name] for name in ("truth", "value", "std", "bound"))
    given = [abs(number) for number in (truth, value, std, bound) if number is not None]
    if not all(number <= limits.LARGEST_NUMBER for number in given):  # false for NaN as well
        return False
    if (bound is not None and bound <= 0.0) or (bound is None and truth == 0.0):
        return False
    if value is None:
        return True
    scales = [abs(scale) for scale in (truth, std, bound) if scale]
    return bool(std >= 0.0) and all(abs(value - truth) / scale <= limits.LARGEST_NUMBER for scale in scales)


def scores_frame(results: Results) -> pl.DataFrame:
    """A row for every estimator, cell and quantity: conditions, figures, standard errors and intervals.

    Args:
        results: at least one trial.

    Returns:
        Columns with the unit in their name, or in the column ``unit``.
    """
    import polars as pl

    rows = []
    for (estimator, index, quantity), trials in results.trials().items():
        judged = score(trials)
        rows.append(
            {
                "estimator": estimator,
                **describe(results.grid.cells[index]),
                "quantity": quantity,
                "unit": trials.unit,
                **_figures(judged),
                "milliseconds_per_record": results.milliseconds(estimator, [index]),
            }
        )
    return pl.DataFrame(rows, infer_schema_length=None)


def _figures(judged: Score) -> dict[str, Any]:
    figures: dict[str, Any] = {"trials": judged.count, "failures": judged.failures.count}
    for name in ("bias", "relative_bias", "bias_in_stds", "rmse", "rmse_over_bound"):
        quantity: Quantity | None = getattr(judged, name)
        label = "relative_bias_percent" if name == "relative_bias" else name
        figures[label] = None if quantity is None else quantity.value
        figures[f"{label}_std_error"] = None if quantity is None else quantity.std
    shares = {"coverage": judged.coverage, "failure_share": judged.failures}
    for name, share in shares.items():
        figures[name] = None if share is None else share.value
        figures[f"{name}_low"], figures[f"{name}_high"] = (None, None) if share is None else share.interval
    return figures


def parquet(frame: pl.DataFrame) -> bytes:
    """A table as the bytes of a Parquet file."""
    buffer = io.BytesIO()
    frame.write_parquet(buffer, compression="zstd")
    return buffer.getvalue()


def _types() -> dict[str, Any]:
    import polars as pl

    text = dict.fromkeys(("estimator", "quantity", "unit", "status"), pl.Utf8)
    numbers = dict.fromkeys(("truth", "value", "std", "bound", "milliseconds"), pl.Float64)
    return {**text, **numbers, "cell": pl.Int64, "trial": pl.Int64}
