"""Comparison of a score with its baseline: which estimators are worse beyond sampling error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from identification.policy import DIFFERENCE_RATE
from identification.scoring.accuracy import Trials
from identification.scoring.comparison import Change, changes, holm
from tunnel_lab.scoring.results import Key, Results, groups_of
from tunnel_sim.vocabulary.errors import TunnelError


@dataclass(frozen=True)
class Finding:
    """One aspect of one estimator in the baseline and now.

    Args:
        worse: whether it is worse beyond chance, corrected for the number of findings.
    """

    estimator: str
    where: str
    quantity: str
    change: Change
    worse: bool


@dataclass(frozen=True)
class Verdict:
    """What a check found.

    Args:
        false_alarm_rate: probability that any finding of unchanged estimators is called worse.
        identical: whether all estimates are the baseline's to the last bit.
        added: estimators that are not in the baseline; they were not checked.
    """

    findings: tuple[Finding, ...]
    false_alarm_rate: float
    identical: bool
    added: tuple[str, ...] = ()

    @property
    def worse(self) -> tuple[Finding, ...]:
        """The findings that are worse, the most significant first."""
        found = [finding for finding in self.findings if finding.worse]
        return tuple(sorted(found, key=lambda finding: finding.change.p_value))

    @property
    def passed(self) -> bool:
        """Whether no estimator got worse."""
        return not self.worse


def check(baseline: Results, now: Results, *, rate: float = DIFFERENCE_RATE) -> Verdict:
    """Compare a score with its baseline, cell by cell and over all cells of a kind together.

    Args:
        now: trials of the same cells, with the same seed or another.
        rate: false-alarm probability of all tests together.

    Raises:
        TunnelError: when the baseline has cells that were not scored now, or has none of the estimators.
    """
    estimators = [name for name in baseline.estimators if name in now.estimators]
    places = _places(baseline, now)
    if not estimators:
        raise TunnelError(
            "the baseline has none of the estimators",
            where="--check",
            remedy=f"score one of {', '.join(baseline.estimators)}",
        )
    before, after = baseline.trials(), now.trials()
    tested: list[tuple[str, str, str, Change]] = []
    for name in estimators:
        for group, cells in groups_of(baseline.grid).items():
            for quantity in baseline.grid.cells[cells[0]].quantities:
                old = [before[name, cell, quantity] for cell in cells]
                new = [after[name, places[cell], quantity] for cell in cells]
                tested += [(name, *rest) for rest in _tests(baseline, cells, group, quantity, old, new)]
    verdicts = holm([change.p_value for *_, change in tested], rate)
    return Verdict(
        findings=tuple(Finding(*one, worse) for one, worse in zip(tested, verdicts, strict=True)),
        false_alarm_rate=rate,
        identical=_estimates(baseline, estimators) == _estimates(now, estimators),
        added=tuple(name for name in now.estimators if name not in baseline.estimators),
    )


def _tests(
    baseline: Results,
    cells: Sequence[int],
    group: str,
    quantity: str,
    old: Sequence[Trials],
    new: Sequence[Trials],
) -> list[tuple[str, str, Change]]:
    found = []
    for cell, one, other in zip(cells, old, new, strict=True):
        found += [(baseline.grid.cells[cell].label, quantity, c) for c in changes([one], [other])]
    if len(cells) > 1:
        found += [(f"all {len(cells)} {group}", quantity, change) for change in changes(old, new)]
    return found


def _places(baseline: Results, now: Results) -> list[int]:
    """Index of each of the baseline's cells in the present grid."""
    places = []
    for cell in baseline.grid.cells:
        if cell not in now.grid.cells:
            raise TunnelError(
                f"the baseline's cell {cell.label!r} is not in the grid",
                where="--check",
                remedy="leave the grid out: the baseline's own grid is then used",
            )
        places.append(now.grid.cells.index(cell))
    return places


def _estimates(results: Results, estimators: Sequence[str]) -> dict[tuple[Key, int], object]:
    return {
        ((row["estimator"], row["cell"], row["quantity"]), row["trial"]): (row["value"], row["std"])
        for row in results.rows
        if row["estimator"] in estimators
    }
