"""Tables of a score for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from identification.printing.numbers import SYMBOLS, concise, significant
from identification.scoring.accuracy import Score, mean_figure, overall, score
from identification.statistics.proportion import Proportion
from tunnel_lab.scoring.check import Finding, Verdict
from tunnel_lab.scoring.results import Results, groups_of
from tunnel_lab.terminal.tables import table

if TYPE_CHECKING:
    from rich.table import Table

    from identification.estimate import Quantity
    from identification.scoring.accuracy import Trials

NAMES = {**SYMBOLS, "zeta": "ζ", "omega_n": "ωn"}
"""How the quantities of a score are written."""

ABOUT = (
    "Bound: Cramér–Rao's, of the nominal model. Worst: of the cells. In brackets: the standard error in the last "
    "digits; after shares: their 95 % interval."
)
_SHOWN_WORSE = 12


def summary_tables(results: Results, *, times: bool = True) -> list[Table]:
    """One table for each kind of cell, with all cells of that kind pooled.

    Returns:
        Tables with a section for each estimator and a row for each quantity.
    """
    found = []
    trials = results.trials()
    for group, cells in groups_of(results.grid).items():
        many = f"{len(cells)} cells" if len(cells) > 1 else "1 cell"
        one = table(
            f"{group[0].upper()}{group[1:]} ({many})",
            *("", "RMSE/bound", "worst", "bias/bound", "95 % covers [%]", "failed [%]"),
            right=("worst",),
        )
        for name in results.estimators:
            _section(one, results, name, cells, times=times)
            for quantity in results.grid.cells[cells[0]].quantities:
                one.add_row(
                    f"  {NAMES[quantity]}", *_summary([trials[name, cell, quantity] for cell in cells])
                )
        found.append(one)
    return found


def _section(one: Table, results: Results, name: str, cells: Sequence[int], *, times: bool = True) -> None:
    """The estimator's name and time."""
    if one.row_count:
        one.add_section()
    one.columns[0].no_wrap = True
    one.add_row(Text(name, style="bold"))
    if times:
        one.add_row("  ms/record", significant(results.milliseconds(name, cells), 2))


def _summary(every: Sequence[Trials]) -> tuple[str, str, str, str, str]:
    scores = [score(trials) for trials in every]
    worst = [s.rmse_over_bound.value for s in scores if s.rmse_over_bound is not None]
    scaled = [float(value) for trials in every if trials.bound is not None for value in trials.scaled]

    bias = mean_figure(np.array(scaled), "1") if len(scaled) > 1 else None
    identified = sum(trials.error.size for trials in every)
    covered = Proportion(sum(trials.covered for trials in every), identified) if identified else None
    failed = Proportion(sum(t.failures for t in every), sum(t.count for t in every))
    return (
        _figure(overall(scores)),
        significant(max(worst), 3) if worst else "–",
        _figure(bias),
        _share(covered),
        _share(failed) if failed.count else "0",
    )


def cell_tables(results: Results) -> list[Table]:
    """One table for each cell.

    Returns:
        Tables with a section for each estimator and a row for each quantity.
    """
    trials = results.trials()
    found = []
    for index, cell in enumerate(results.grid.cells):
        one = table(cell.label, "", "RMSE/bound", "bias [%]", "bias/std", "95 % covers [%]", "failed [%]")
        for name in results.estimators:
            _section(one, results, name, [index])
            for quantity in cell.quantities:
                one.add_row(f"  {NAMES[quantity]}", *_cell(score(trials[name, index, quantity])))
        found.append(one)
    return found


def _cell(judged: Score) -> tuple[str, ...]:
    return (
        _figure(judged.rmse_over_bound),
        _figure(judged.relative_bias),
        _figure(judged.bias_in_stds),
        _share(judged.coverage),
        _share(judged.failures) if judged.failures.count else "0",
    )


def _figure(quantity: Quantity | None) -> str:
    return "–" if quantity is None else concise(quantity.value, quantity.std)


def _share(share: Proportion | None) -> str:
    if share is None:
        return "–"
    low, high = share.interval
    return f"{100 * share.value:.3g} ({100 * low:.0f}–{100 * high:.0f})"


def worse_table(verdict: Verdict) -> Table:
    """The findings that are worse, the most significant first.

    Returns:
        A table; without rows where none is worse.
    """
    result = table(
        "Worse than the baseline",
        *("estimator", "", "aspect", "before", "now", "p", "where"),
        right=("before", "now", "p"),
    )
    for finding in verdict.worse[:_SHOWN_WORSE]:
        before, now = _before_and_now(finding)
        result.add_row(
            Text(finding.estimator),
            NAMES[finding.quantity],
            finding.change.aspect,
            before,
            now,
            f"{finding.change.p_value:.1g}",
            Text(finding.where),
        )
    return result


def _before_and_now(finding: Finding) -> tuple[str, str]:
    change = finding.change
    if change.aspect in ("bias", "spread"):
        return significant(change.before, 3), significant(change.now, 3)
    return f"{100 * change.before:.1f} %", f"{100 * change.now:.1f} %"


def verdict_lines(verdict: Verdict) -> list[str]:
    """The result of a check in words."""
    tests = f"{len(verdict.findings)} tests, false-alarm rate {100 * verdict.false_alarm_rate:g} % of all together"
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
    return lines
