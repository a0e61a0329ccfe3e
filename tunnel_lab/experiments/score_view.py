"""A score in tables, and its comparison with a baseline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import polars as pl

from identification.policy import DIFFERENCE_RATE
from identification.scoring import (
    Change,
    changes,
    holm,
    reach_of_rmse,
)
from identification.show.blocks import Block, Paragraph, TextTable
from identification.show.numbers import significant
from tunnel_lab.experiments.experiment import parquet
from tunnel_lab.experiments.score import Results, groups_of
from tunnel_lab.experiments.score_columns import (
    BIAS,
    BIAS_IN_STDS,
    BIAS_PERCENT,
    CELL,
    COVERAGE,
    FAILED,
    NAMES,
    POOLED,
    RMSE,
    RMSE_OVER_BOUND,
    WORST,
    ScoreColumn,
    ScoredRow,
    file_columns,
    meanings,
    not_given_notes,
    score_table,
)
from tunnel_lab.experiments.view import ExperimentView
from tunnel_sim.vocabulary.errors import TunnelError, counted

_TIME = "Time: of identify for a record, its examination included."
_SHOWN_WORSE = 12
_FEW = 20
"""Trials below which the χ² interval of an RMSE ends more than a tenth above 1 + 1.96 standard errors."""


@dataclass(frozen=True)
class AspectComparison:
    """One aspect of one estimator in the baseline and now, and whether it is significantly worse."""

    estimator: str
    where: str
    quantity: str
    change: Change
    worse: bool


@dataclass(frozen=True)
class ScoreVerdict:
    """The result of a check.

    Args:
        false_alarm_rate: probability that any finding on unchanged estimators is called worse.
        identical: whether all estimates are bit-identical to the baseline's.
        added: unchecked estimators, which are not in the baseline.
    """

    findings: tuple[AspectComparison, ...]
    false_alarm_rate: float
    identical: bool
    added: tuple[str, ...] = ()

    @property
    def worse(self) -> tuple[AspectComparison, ...]:
        """The worse findings, the most significant first."""
        worse = [finding for finding in self.findings if finding.worse]
        return tuple(sorted(worse, key=lambda finding: finding.change.p_value))

    @property
    def passed(self) -> bool:
        """Whether no estimator got worse."""
        return not self.worse


def check(baseline: Results, now: Results, *, rate: float = DIFFERENCE_RATE) -> ScoreVerdict:
    """Compare a score with its baseline, cell by cell and over all cells of a kind together.

    Args:
        now: trials of the same cells, with the same seed or another.
        rate: false-alarm probability of all tests together.

    Raises:
        TunnelError: when the baseline has cells not scored now, or has none of the estimators.
    """
    estimators = [name for name in baseline.estimators if name in now.estimators]
    for known in baseline.grid.cells:
        if known not in now.grid.cells:
            what = f"the baseline's cell {known.label!r} is not in the grid"
            remedy = "leave the grid out: the baseline's own grid is then used"
            raise TunnelError(what, where="--check", remedy=remedy)
    if not estimators:
        remedy = f"score one of {', '.join(baseline.estimators)}"
        raise TunnelError("the baseline does not include these estimators", where="--check", remedy=remedy)
    places = [now.grid.cells.index(cell) for cell in baseline.grid.cells]
    before, after = baseline.trials, now.trials
    tested: list[tuple[str, str, str, Change]] = []
    for name in estimators:
        for group, cells in groups_of(baseline.grid).items():
            for quantity in baseline.grid.cells[cells[0]].quantities:
                old = [before[name, cell, quantity] for cell in cells]
                new = [after[name, places[cell], quantity] for cell in cells]
                for cell, *pair in zip(cells, old, new, strict=True):
                    label = baseline.grid.cells[cell].label
                    tested += [(name, label, quantity, c) for c in changes(pair[:1], pair[1:])]
                if len(cells) > 1:
                    every = f"all {len(cells)} {group}"
                    tested += [(name, every, quantity, change) for change in changes(old, new)]
    verdicts = holm([change.p_value for *_, change in tested], rate)
    return ScoreVerdict(
        findings=tuple(AspectComparison(*test, worse) for test, worse in zip(tested, verdicts, strict=True)),
        false_alarm_rate=rate,
        identical=_estimates(baseline, estimators).equals(_estimates(now, estimators)),
        added=tuple(name for name in now.estimators if name not in baseline.estimators),
    )


def _estimates(results: Results, estimators: Sequence[str]) -> pl.DataFrame:
    """The estimates of some estimators, in the order given."""
    keys = ["estimator", "cell", "quantity", "trial"]
    mine = results.table.filter(pl.col("estimator").is_in(list(estimators)))
    return mine.select(*keys, "value", "std").sort(keys)


def scores_frame(results: Results) -> pl.DataFrame:
    """A row for every estimator, cell and given quantity.

    It has the conditions, the figures, and their standard errors and intervals.
    """
    columns = {
        "bias": BIAS, "relative_bias_percent": BIAS_PERCENT, "bias_in_stds": BIAS_IN_STDS, "rmse": RMSE,
        "rmse_over_bound": RMSE_OVER_BOUND, "coverage": COVERAGE, "failure_share": FAILED,
    }  # fmt: skip
    rows = []
    for (estimator, index, quantity), trials in results.trials.items():
        if not results.gives(estimator, quantity):
            continue
        cell, row = results.grid.cells[index], ScoredRow(estimator, quantity, (trials,))
        rows.append(
            {
                "estimator": estimator,
                "cell": cell.label,
                "kind": cell.kind,
                "zeta": cell.zeta or None,
                "frequency_hz": cell.frequency or None,
                "wind_speed_m_per_s": cell.wind_speed or None,
                "effect": cell.effect,
                "noise_over_amplitude": cell.noise,
                "duration_s": cell.duration,
                "runs": cell.runs,
                "quantity": quantity,
                "unit": trials.unit,
                "trials": row.failures.total,
                "failures": row.failures.count,
                **file_columns(row, columns, "_std_error"),
                "milliseconds_per_record": results.milliseconds(estimator, [index]),
            }
        )
    return pl.DataFrame(rows, infer_schema_length=None)


def summary_tables(results: Results) -> list[TextTable]:
    """One table for each kind of cell, pooled: a section for each estimator, a row for each quantity."""
    return [
        _table(
            results,
            f"{group[0].upper()}{group[1:]} ({counted(len(cells), 'cell')})",
            [column for column in POOLED if column is not WORST or len(cells) > 1],
            cells,
        )
        for group, cells in groups_of(results.grid).items()
    ]


def _table(results: Results, title: str, columns: Sequence[ScoreColumn], cells: Sequence[int]) -> TextTable:
    rows = []
    for name in results.estimators:
        time = significant(results.milliseconds(name, cells), 2)
        for quantity in results.grid.cells[cells[0]].quantities:
            if results.gives(name, quantity):
                trials = tuple(results.trials[name, cell, quantity] for cell in cells)
                rows.append(
                    ({"estimator": name, "time [ms/record]": time}, ScoredRow(name, quantity, trials))
                )
    return score_table(title, columns, rows)


def score_view(results: Results, *, cells: bool = False) -> ExperimentView:
    """The view of a score.

    Args:
        cells: whether the view has a table for each cell.
    """
    from tunnel_lab.experiments.score_drawing import score_figure

    every = (_table(results, cell.label, CELL, [index]) for index, cell in enumerate(results.grid.cells))
    return ExperimentView(
        f"Score on the grid {results.grid.name}",
        [*summary_tables(results), *(every if cells else ()), *notes_below(results)],
        {"score": partial(score_figure, results)},
        {"scores.parquet": parquet(scores_frame(results))},
    )


def notes_below(results: Results) -> list[Paragraph]:
    """Below the tables: the meaning of the figures, missing quantities, and the accuracy of few trials."""
    about = Paragraph(f"{meanings(POOLED, CELL).text} {_TIME}")
    return [about, *not_given_notes(results.not_given), *_few_trials(results)]


def _few_trials(results: Results) -> list[Paragraph]:
    """Uncertainty of the RMSE with the smallest number of trials."""
    fewest = min(results.grid.trials_for(name) for name in results.estimators)
    if fewest >= _FEW:
        return []
    low, high = reach_of_rmse(fewest)
    return [
        Paragraph(
            f"Few trials: with {fewest} in a cell, the RMSE of many would be {low:.2g} to {high:.2g} times the one "
            "shown (95 % interval for normal errors), which its standard error does not tell. --trials gives more."
        )
    ]


def _worse_table(verdict: ScoreVerdict) -> TextTable:
    """The findings that are worse, the most significant first."""
    rows = []
    for finding in verdict.worse[:_SHOWN_WORSE]:
        change = finding.change
        if change.aspect in ("bias", "spread"):
            before, now = significant(change.before, 3), significant(change.now, 3)
        else:
            before, now = f"{100 * change.before:.1f} %", f"{100 * change.now:.1f} %"
        cells = (finding.estimator, NAMES[finding.quantity], change.aspect, before, now)
        rows.append((*cells, f"{change.p_value:.1g}", finding.where))
    right = ("before", "now", "p")
    return TextTable(
        "Worse than the baseline", ("estimator", "", "aspect", *right, "where"), tuple(rows), right
    )


def verdict_blocks(verdict: ScoreVerdict) -> list[Block]:
    """The result of a check: the worse findings, and the verdict in words."""
    rate = f"{100 * verdict.false_alarm_rate:g} %"
    tests = f"{counted(len(verdict.findings), 'test')}, false-alarm rate {rate} of all together"
    worse = verdict.worse
    if worse:
        names = ", ".join(sorted({finding.estimator for finding in worse}))
        lines = [f"Worse than the baseline: {names} ({len(worse)} of {tests})"]
        if len(worse) > _SHOWN_WORSE:
            lines.append(f"The {_SHOWN_WORSE} most significant are shown.")
        lines.append(
            "bias (size of the mean error) and spread (root mean square error) are in units of the bound"
        )
    elif verdict.identical:
        lines = ["No estimator is worse: all estimates equal the baseline to the last bit."]
    else:
        lines = [f"No estimator is worse beyond sampling error ({tests})."]
    if verdict.added:
        lines.append(f"Not in the baseline, so not checked: {', '.join(verdict.added)}")
    return [_worse_table(verdict), *map(Paragraph, lines)]
