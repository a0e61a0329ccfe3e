"""The figures of estimates against their truth: every column declared once, for tables, pages and files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import polars as pl

from identification.policy import DIFFERENCE_RATE
from identification.printing import SYMBOLS
from identification.scoring import (
    NOMINAL_COVERAGE,
    Score,
    Trials,
    holm,
    mean_figure,
    overall,
    root_mean_square,
    score,
)
from identification.show.blocks import Paragraph, TextTable
from identification.show.numbers import concise, significant
from identification.show.quantity import Quantity
from identification.statistics import Proportion
from tunnel_sim.vocabulary.record import read_only

NAMES: Mapping[str, str] = {**SYMBOLS, "zeta": "ζ", "omega_n": "ωn", "sensor_zero": "zero"}
"""How quantities are written."""
_BRACKETS = "In brackets after other figures: the standard error in the last digits."


def trials_of(rows: pl.DataFrame, *, percent: bool = False) -> Trials:
    """The trials of one estimator and one quantity.

    Args:
        rows: rows with ``truth``, ``value``, ``std``, ``bound`` and ``unit``.
        percent: whether values are in % of the truths, which must then not be zero.
    """
    given = rows.filter(pl.col("value").is_not_null())
    truth, value, std = (given[name].to_numpy() for name in ("truth", "value", "std"))
    bounded = len(given) > 0 and not given["bound"].null_count()
    scale = 100.0 / np.abs(truth) if percent else np.ones(truth.size)
    return Trials(
        error=read_only((value - truth) * scale),
        std=read_only(std * scale),
        truth=read_only(truth * scale),
        bound=read_only(given["bound"].to_numpy() * scale) if bounded else None,
        failures=len(rows) - len(given),
        unit="%" if percent else rows["unit"][0],
    )


@dataclass(frozen=True, eq=False)
class ScoredRow:
    """The trials of one estimator and one quantity, of one cell or of several pooled cells.

    Args:
        cells: the trials of each cell, at least one.
    """

    estimator: str
    quantity: str
    cells: tuple[Trials, ...]

    @cached_property
    def scores(self) -> tuple[Score, ...]:
        """The score of each cell."""
        return tuple(map(score, self.cells))

    @property
    def score(self) -> Score:
        """The score of the only cell."""
        (only,) = self.scores
        return only

    @property
    def relative_rmse(self) -> Quantity | None:
        """Root mean square over all trials of error over the size of the truth, %; None where a truth is zero."""
        if any(not trials.truth.all() for trials in self.cells):
            return None
        errors = [100.0 * trials.error / np.abs(trials.truth) for trials in self.cells]
        values = np.concatenate(errors)
        return root_mean_square(values, "%") if values.size > 1 else None

    @property
    def rmse_over_bound(self) -> Quantity | None:
        """Root mean square over the cells; None without a bound."""
        return overall(self.scores) if len(self.cells) > 1 else self.score.rmse_over_bound

    @property
    def worst_over_bound(self) -> float | None:
        """The largest RMSE over the bound of a cell; None without a bound."""
        return max(
            (s.rmse_over_bound.value for s in self.scores if s.rmse_over_bound is not None), default=None
        )

    @property
    def bias_over_bound(self) -> Quantity | None:
        """Mean of error over the bound; None for fewer than two trials with a bound."""
        scaled = [trials.scaled for trials in self.cells if trials.bound is not None]
        values = np.concatenate(scaled) if scaled else np.zeros(0)
        return mean_figure(values, "1") if values.size > 1 else None

    @property
    def coverage(self) -> Proportion | None:
        """Coverage of the 95 % intervals among the trials with an estimate; None without any."""
        identified = sum(trials.error.size for trials in self.cells)
        return Proportion(sum(trials.covered for trials in self.cells), identified) if identified else None

    @property
    def failures(self) -> Proportion:
        """The trials without an estimate, among all."""
        return Proportion(sum(t.failures for t in self.cells), sum(t.count for t in self.cells))


@dataclass(frozen=True)
class ScoreColumn:
    """A figure of scored trials as a column.

    Args:
        head: heading, with the unit.
        texts: function that gives the cells from the figures of all rows of a table.
        find: function that gives the figure of a row.
        what: its meaning in a sentence below the tables; empty: the heading suffices.
        detail: whether the column is shown only on a page.
    """

    head: str
    texts: Callable[[Sequence[Any]], Sequence[str]]
    find: Callable[[ScoredRow], Any]
    what: str = ""
    detail: bool = False


def _values(found: Sequence[Quantity | None]) -> list[str]:
    return ["–" if one is None else concise(one.value, one.std) for one in found]


def _with_units(found: Sequence[Quantity | None]) -> list[str]:
    texts = zip(_values(found), found, strict=True)
    return [text if one is None or one.unit == "1" else f"{text} {one.unit}" for text, one in texts]


def _plain(found: Sequence[float | None]) -> list[str]:
    return ["–" if one is None else significant(one, 3) for one in found]


def _coverages(found: Sequence[Proportion | None]) -> list[str]:
    """Shares with their intervals; ``low`` or ``high`` if one differs from 95 %, by Holm's test of all rows."""
    from scipy.stats import binomtest

    tests = [binomtest(one.count, one.total, NOMINAL_COVERAGE).pvalue if one else 1.0 for one in found]
    texts = []
    for one, wrong in zip(found, holm(tests, DIFFERENCE_RATE), strict=True):
        if one is None:
            texts.append("–")
        else:
            low, high = (100 * end for end in one.interval)
            mark = "" if not wrong else " low" if one.value < NOMINAL_COVERAGE else " high"
            texts.append(f"{100 * one.value:.0f} ({low:.0f}–{high:.0f}){mark}")
    return texts


def _counts(found: Sequence[Proportion]) -> list[str]:
    return [f"{one.count}/{one.total}" for one in found]


RMSE = ScoreColumn("RMSE", _with_units, lambda row: row.score.rmse)
RMSE_OVER_BOUND = ScoreColumn(
    "RMSE/\nbound",
    _values,
    lambda row: row.rmse_over_bound,
    "Bound: Cramér–Rao's, of the nominal model, with the scatter where runs scatter.",
)
RMSE_PERCENT = ScoreColumn(
    "RMSE\n[%]", _values, lambda row: row.relative_rmse, "RMSE: of the error over the truth."
)
WORST = ScoreColumn("worst", _plain, lambda row: row.worst_over_bound, "Worst: RMSE/bound of the worst cell.")
BIAS = ScoreColumn("bias", _with_units, lambda row: row.score.bias, detail=True)
BIAS_OVER_BOUND = ScoreColumn("bias/\nbound", _values, lambda row: row.bias_over_bound, detail=True)
BIAS_PERCENT = ScoreColumn("bias [%]", _values, lambda row: row.score.relative_bias, detail=True)
BIAS_IN_STDS = ScoreColumn(
    "bias/\nstd", _values, lambda row: row.score.bias_in_stds, "Bias/std: in reported standard deviations."
)
COVERAGE = ScoreColumn(
    "95 % covers\n[%]",
    _coverages,
    lambda row: row.coverage,
    "Covers: share of the 95 % intervals that contain the truth, with its own 95 % interval; low or high where it "
    "differs from 95 % beyond chance (exact binomial tests, Holm; a table of right intervals has a mark in "
    f"{100 * DIFFERENCE_RATE:.0f} % of cases).",
)
FAILED = ScoreColumn("failed", _counts, lambda row: row.failures)

POOLED = (RMSE_PERCENT, RMSE_OVER_BOUND, WORST, BIAS_OVER_BOUND, COVERAGE, FAILED)
"""The columns for a score's cells together."""
CELL = (RMSE_PERCENT, RMSE_OVER_BOUND, BIAS_PERCENT, BIAS_IN_STDS, COVERAGE, FAILED)
"""The columns for one cell of a score."""
LINE = (RMSE, RMSE_OVER_BOUND, BIAS, COVERAGE, FAILED)
"""The columns for a sweep."""


def score_table(
    title: str, columns: Sequence[ScoreColumn], rows: Iterable[tuple[Mapping[str, str], ScoredRow]]
) -> TextTable:
    """A table of scored trials, in sections by place.

    Args:
        rows: rows, each with the place of the score, by heading: the same headings in all rows.
    """
    every = list(rows)
    places = tuple(every[0][0]) if every else ()
    scored = [row for _, row in every]
    cells = zip(*(column.texts([column.find(row) for row in scored]) for column in columns), strict=True)
    return TextTable(
        title,
        (*places, "quantity", *(column.head for column in columns)),
        tuple(
            (*place.values(), NAMES[row.quantity], *texts)
            for (place, row), texts in zip(every, cells, strict=True)
        ),
        right=tuple(one.head for one in columns if one in (WORST, FAILED)),
        names=("estimator",),
        detail=tuple(column.head for column in columns if column.detail),
        sections=len(places),
    )


def meanings(*tables: Sequence[ScoreColumn]) -> Paragraph:
    """The meaning of the columns of some tables, each once."""
    said = dict.fromkeys(column.what for columns in tables for column in columns if column.what)
    return Paragraph(" ".join((*said, _BRACKETS)))


def file_columns(row: ScoredRow, columns: Mapping[str, ScoreColumn], error: str) -> dict[str, float | None]:
    """Figures of a row as columns of a file.

    Args:
        columns: columns by their names in the file. The ends of the 95 % interval stand beside a share, the
            standard error beside any other figure.
        error: suffix of the names of standard errors.
    """
    found: dict[str, float | None] = {}
    for name, column in columns.items():
        figure = column.find(row)
        found[name] = None if figure is None else figure.value
        if column.texts in (_coverages, _counts):
            ends = (None, None) if figure is None else figure.interval
            found |= dict(zip((f"{name}_low", f"{name}_high"), ends, strict=True))
        else:
            found[f"{name}{error}"] = None if figure is None else figure.std
    return found


def not_given_notes(absent: Mapping[str, tuple[str, ...]]) -> list[Paragraph]:
    """Quantities that estimators do not give, a paragraph for each estimator.

    Args:
        absent: names of quantities by estimator.
    """
    return [
        Paragraph(f"Not given by {name}: {', '.join(NAMES[one] for one in some)}.")
        for name, some in absent.items()
    ]
