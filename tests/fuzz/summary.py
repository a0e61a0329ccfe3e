"""Findings grouped by what they are and where they come from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from tests.fuzz.trials import Outcome

Cause = tuple[str, str]
"""Kind of an error, and file and line of the project."""


def causes(outcomes: Sequence[Outcome]) -> dict[Cause, list[Outcome]]:
    """The findings by cause, the most frequent first.

    Args:
        outcomes: of trials.
    """
    groups: dict[Cause, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.verdict == "finding":
            groups[outcome.error, outcome.place].append(outcome)
    return dict(sorted(groups.items(), key=lambda group: -len(group[1])))


def counts_table(outcomes: Sequence[Outcome]) -> str:
    """Trials by target: how many were accepted, refused or are findings, and their processor time.

    Args:
        outcomes: of trials.
    """
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        groups[outcome.target].append(outcome)
    lines = [
        f"{'target':<18}{'trials':>8}{'accepted':>10}{'refused':>9}{'findings':>10}{'mean ms':>9}{'longest s':>11}"
    ]
    for name, some in [*sorted(groups.items()), ("all", list(outcomes))]:
        numbers = [sum(o.verdict == verdict for o in some) for verdict in ("accepted", "refused", "finding")]
        seconds = [o.seconds for o in some] or [0.0]
        mean = 1e3 * sum(seconds) / len(seconds)
        cells = (f"{len(some)}", *map(str, numbers), f"{mean:.1f}", f"{max(seconds):.2f}")
        lines.append(f"{name:<18}" + "".join(f"{cell:>11}" for cell in cells))
    return "\n".join(lines)


def causes_table(outcomes: Sequence[Outcome], seed: int, only: str | None = None) -> str:
    """Every cause with its number of trials, its targets and a trial that shows it.

    Args:
        outcomes: of trials.
        seed: of all trials.
        only: the one group of targets that was run; None for all.
    """
    option = "" if only is None else f" --only {only}"
    lines = []
    for (error, place), some in causes(outcomes).items():
        first = min(some, key=lambda outcome: outcome.index)
        where = "" if first.deepest == place else f" (in {first.deepest})"
        lines += [
            f"{len(some):>6}  {error} at {place}{where}",
            f"        {first.target}: {first.message}",
            f"        python -m tests.fuzz --seed {seed} --trial {first.index}{option}",
        ]
    return "\n".join(lines)
