"""Whether a method got worse than a baseline, at a stated false-alarm rate.

The tests use only ranks and counts, so they are exact, or nearly so, for any distribution of the errors. If nothing
changed, old and new trials are exchangeable, and so is any choice made from both together (a direction, a
threshold). Many tests share one false-alarm rate by Holm's method.

Sources: rank sum over strata, P. van Elteren, Bull. Int. Stat. Inst. 37 (1960) 351–361; Fisher's exact test;
S. Holm, Scand. J. Stat. 6 (1979) 65–70.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.policy import DIFFERENCE_RATE, LEAST_CHANGE, OUTLIER_MEDIANS
from identification.scoring.accuracy import NOMINAL_COVERAGE, Trials
from tunnel_sim.vocabulary.record import Array

Aspect = Literal["bias", "spread", "outliers", "coverage", "failures"]


@dataclass(frozen=True)
class Change:
    """One aspect of one method, in the baseline and now.

    Args:
        aspect: ``bias`` and ``spread`` (sizes of errors) in units of the bound, or of the truth where there is no
            bound; ``outliers``, ``coverage`` and ``failures`` as shares.
        before: the baseline's figure, in these units.
        now: the figure now, in these units.
        p_value: probability of a change for the worse at least this large if nothing changed; 1 where the
            figure is no worse.
    """

    aspect: Aspect
    before: float
    now: float
    p_value: float


def changes(before: Sequence[Trials], now: Sequence[Trials]) -> tuple[Change, ...]:
    """Every aspect of a method over one cell, or over several together.

    ``bias`` is the mean error, worse when it moves away from zero; ``spread`` the root mean square error;
    ``outliers`` the share of errors beyond six medians of their size; ``coverage`` that of 95 % intervals, worse
    further from 95 %.

    Args:
        before: the baseline's trials, one entry per cell.
        now: the same cells.

    Raises:
        ValueError: when the cells differ in number, or a bound is known on one side only.
    """
    pairs = list(zip(before, now, strict=True))
    scaled = [_scaled(old, new) for old, new in pairs]
    same = all(
        np.array_equal(old.truth, new.truth) for old, new in pairs
    )  # the truths are drawn, so equal truths mean equal records
    return (
        _bias(scaled, same),
        _spread(scaled, same),
        _outliers(scaled),
        _coverage(pairs),
        _shares(
            "failures",
            (sum(old.failures for old, _ in pairs), sum(old.count for old, _ in pairs)),
            (sum(new.failures for _, new in pairs), sum(new.count for _, new in pairs)),
        ),
    )


def holm(p_values: Sequence[float], rate: float = DIFFERENCE_RATE) -> tuple[bool, ...]:
    """Which of several tests are significant, with a probability of ``rate`` for any false alarm among them.

    Args:
        p_values: one per test.
        rate: probability of at least one false alarm.
    """
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    verdicts = [False] * len(p_values)
    for rank, place in enumerate(order):
        if p_values[place] > rate / (len(p_values) - rank):
            break
        verdicts[place] = True
    return tuple(verdicts)


def _scaled(old: Trials, new: Trials) -> tuple[Array, Array]:
    if old.error.size and new.error.size and (old.bound is None) != (new.bound is None):
        raise ValueError("a bound is known on one side only")
    return old.scaled, new.scaled


def _bias(scaled: Sequence[tuple[Array, Array]], same: bool) -> Change:
    # The direction of a cell is that of all its errors, old and new: a move in this direction is worse.
    turned = []
    for old, new in scaled:
        both = np.concatenate((old, new))
        direction = 1.0 if both.size == 0 or both.mean() >= 0.0 else -1.0
        turned.append((direction * old, direction * new))
    before, now = (_mean_size(scaled, side) for side in (0, 1))
    least = before + (LEAST_CHANGE * _root_mean_square(scaled, 0) if same else 0.0)
    return Change("bias", before, now, _larger(turned, same) if now > least else 1.0)


def _spread(scaled: Sequence[tuple[Array, Array]], same: bool) -> Change:
    sizes = [(np.abs(old), np.abs(new)) for old, new in scaled]
    before, now = (_root_mean_square(scaled, side) for side in (0, 1))
    least = before * (1.0 + LEAST_CHANGE if same else 1.0)
    return Change("spread", before, now, _larger(sizes, same) if now > least else 1.0)


def _outliers(scaled: Sequence[tuple[Array, Array]]) -> Change:
    counts = np.zeros((2, 2), dtype=int)
    for pair in scaled:
        both = np.abs(np.concatenate(pair))
        limit = OUTLIER_MEDIANS * float(np.median(both)) if both.size else 0.0
        for side, values in enumerate(pair):
            counts[side] += int(np.sum(np.abs(values) > limit)), values.size
    (old, old_total), (new, new_total) = counts.tolist()
    return _shares("outliers", (old, old_total), (new, new_total))


def _coverage(pairs: Sequence[tuple[Trials, Trials]]) -> Change:
    from scipy.stats import fisher_exact

    totals = [sum(pair[side].error.size for pair in pairs) for side in (0, 1)]
    covered = [sum(pair[side].covered for pair in pairs) for side in (0, 1)]
    if 0 in totals:
        return Change("coverage", 1.0, 1.0, 1.0)
    before, now = (count / total for count, total in zip(covered, totals, strict=True))
    worse = abs(now - NOMINAL_COVERAGE) > abs(before - NOMINAL_COVERAGE)
    table = np.array([[count, total - count] for count, total in zip(covered, totals, strict=True)])
    return Change("coverage", before, now, float(fisher_exact(table).pvalue) if worse else 1.0)


def _shares(aspect: Aspect, old: tuple[int, int], new: tuple[int, int]) -> Change:
    """A share for which larger is worse."""
    from scipy.stats import fisher_exact

    if 0 in (old[1], new[1]):
        return Change(aspect, 0.0, 0.0, 1.0)
    before, now = old[0] / old[1], new[0] / new[1]
    if now <= before:
        return Change(aspect, before, now, 1.0)
    table = np.array([[new[0], new[1] - new[0]], [old[0], old[1] - old[0]]])
    return Change(aspect, before, now, float(fisher_exact(table, alternative="greater").pvalue))


def _larger(cells: Sequence[tuple[Array, Array]], same: bool) -> float:
    """One-sided p-value for larger new values."""
    return _signed_rank(cells) if same else _rank_sum(cells)


def _signed_rank(cells: Sequence[tuple[Array, Array]]) -> float:
    """Of pairs, ranked within each cell; pairs without a difference do not count."""
    from scipy.special import ndtr
    from scipy.stats import rankdata

    excess = variance = 0.0
    for old, new in cells:
        difference = (new - old)[new != old]
        if difference.size:
            ranks = rankdata(np.abs(difference)) / difference.size
            excess += float(np.sign(difference) @ ranks)
            variance += float(ranks @ ranks)
    return float(ndtr(-excess / np.sqrt(variance))) if variance > 0.0 else 1.0


def _rank_sum(cells: Sequence[tuple[Array, Array]]) -> float:
    """Of independent values, ranked within each cell."""
    from scipy.special import ndtr
    from scipy.stats import rankdata

    excess = variance = 0.0
    for old, new in cells:
        n, m = old.size, new.size
        if n == 0 or m == 0:
            continue
        ranks = rankdata(np.concatenate((old, new)))
        # Weighted by 1/(n + m + 1) after van Elteren; the variance is that of the actual ranks, with ties.
        weight = 1.0 / (n + m + 1)
        excess += weight * (float(ranks[n:].sum()) - m * (n + m + 1) / 2.0)
        variance += weight**2 * n * m / (n + m) * float(ranks.var(ddof=1))
    return float(ndtr(-excess / np.sqrt(variance))) if variance > 0.0 else 1.0


def _mean_size(scaled: Sequence[tuple[Array, Array]], side: int) -> float:
    """Mean over cells of the size of the mean error."""
    means = [abs(float(pair[side].mean())) for pair in scaled if pair[side].size]
    return float(np.mean(means)) if means else 0.0


def _root_mean_square(scaled: Sequence[tuple[Array, Array]], side: int) -> float:
    """Of all errors of a side."""
    every = np.concatenate([pair[side] for pair in scaled]) if scaled else np.zeros(0)
    return float(np.sqrt(np.mean(every**2))) if every.size else 0.0
