"""Estimates against the truth: accuracy, and whether a method has become worse than a baseline.

Standard errors of bias and RMSE are the standard errors of means (delta method for the root); see
`root_mean_square` for few trials. The tests against a baseline use only ranks and counts, so they are exact, or
nearly so, for any distribution of the errors. If the method has not changed, old and new trials are
exchangeable, and so is any choice made from both together (a direction, a threshold).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import hypot, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.policy import DIFFERENCE_RATE, LEAST_CHANGE, OUTLIER_MEDIANS
from identification.show.quantity import INTERVAL, Quantity
from identification.statistics import Proportion
from tunnel_sim.vocabulary.record import Array, read_only

NOMINAL_COVERAGE = 0.95
_LEAST = 2  # minimum number of trials for a sampling error


@dataclass(frozen=True)
class ScoredEstimate:
    """One estimate with its truth.

    Args:
        truth: true value, in the quantity's unit.
        bound: smallest standard deviation of any unbiased estimator, in the same unit; None if not known.
            known.
    """

    truth: float
    found: Quantity | None
    bound: float | None = None


@dataclass(frozen=True, eq=False)
class Trials:
    """The outcomes of one method on many records, one quantity of one unit.

    Args:
        error: estimate − truth of the identified trials, shape (k,).
        std: standard deviations reported by the method, shape (k,).
        truth: shape (k,).
        bound: see `ScoredEstimate`, shape (k,); None if not known for all trials.
        failures: number of further trials that gave no estimate.
        unit: of error, std, truth and bound.
    """

    error: Array
    std: Array
    truth: Array
    bound: Array | None
    failures: int
    unit: str = "1"

    @property
    def count(self) -> int:
        """Number of trials, failures included."""
        return self.error.size + self.failures

    @property
    def covered(self) -> int:
        """Number of 95 % intervals, ± 1.96 reported standard deviations, that contain the truth."""
        return int(np.sum(np.abs(self.error) <= INTERVAL * self.std))

    @property
    def scaled(self) -> Array:
        """Errors over the bound, or over the size of the truth where there is no bound, shape (k,)."""
        return self.error / (np.abs(self.truth) if self.bound is None else self.bound)


def collect(outcomes: Iterable[ScoredEstimate]) -> Trials:
    """Outcomes of one method and one quantity as arrays.

    Raises:
        ValueError: when units are mixed or an estimate is not finite.
    """
    every = list(outcomes)
    kept = [(one, one.found) for one in every if one.found is not None]
    units = {found.unit for _, found in kept}
    if len(units) > 1:
        raise ValueError(f"units are mixed: {', '.join(sorted(units))}")
    error = read_only([found.value - one.truth for one, found in kept])
    std = read_only([found.known_std for _, found in kept])
    if not (np.isfinite(error).all() and np.isfinite(std).all()):
        raise ValueError("an estimate is not finite")
    bounds = [one.bound for one, _ in kept if one.bound is not None]
    return Trials(
        error=error,
        std=std,
        truth=read_only([one.truth for one, _ in kept]),
        bound=read_only(bounds) if kept and len(bounds) == len(kept) else None,
        failures=len(every) - len(kept),
        unit=units.pop() if units else "1",
    )


@dataclass(frozen=True)
class Score:
    """The figures of a method, each with its standard error; None where fewer than two trials gave an estimate.

    Args:
        bias: mean error, in the quantity's unit.
        relative_bias: mean of error over the size of the truth, %; None where a truth is zero.
        bias_in_stds: mean of error over the reported standard deviation; None if one of these is zero.
        rmse: root of the mean squared error, in the quantity's unit.
        rmse_over_bound: root of the mean squared ratio of error to bound; None where the bound is not known.
        coverage: coverage of the 95 % intervals, among the trials with an estimate; None without any.
    """

    count: int
    failures: Proportion
    bias: Quantity | None = None
    relative_bias: Quantity | None = None
    bias_in_stds: Quantity | None = None
    rmse: Quantity | None = None
    rmse_over_bound: Quantity | None = None
    coverage: Proportion | None = None


def score(trials: Trials) -> Score:
    """Score the trials of one method and one quantity, at least one.

    Raises:
        ValueError: when there is no trial.
    """
    if trials.count == 0:
        raise ValueError("no trial to score")
    failures = Proportion(trials.failures, trials.count)
    found = trials.error.size
    coverage = Proportion(trials.covered, found) if found else None
    if found < _LEAST:
        return Score(trials.count, failures, coverage=coverage)
    size = np.abs(trials.truth)
    return Score(
        count=trials.count,
        failures=failures,
        bias=mean_figure(trials.error, trials.unit),
        relative_bias=mean_figure(100.0 * trials.error / size, "%") if np.all(size > 0.0) else None,
        bias_in_stds=mean_figure(trials.error / trials.std, "1") if np.all(trials.std > 0.0) else None,
        rmse=root_mean_square(trials.error, trials.unit),
        rmse_over_bound=None if trials.bound is None else root_mean_square(trials.error / trials.bound, "1"),
        coverage=coverage,
    )


def mean_figure(values: Array, unit: str) -> Quantity:
    """A mean with its standard error.

    Args:
        values: shape (n,), n ≥ 2, in the unit.
    """
    return Quantity(float(values.mean()), float(values.std(ddof=1)) / sqrt(values.size), unit)


def root_mean_square(values: Array, unit: str) -> Quantity:
    """√mean(x²) with its standard error, propagated from mean(x²).

    A few squares may be similar by chance, and their scatter is then too small. The standard error is therefore
    at least its value for normal errors of this mean m and variance s²: the variance of x² is then 2 s⁴ + 4 m²
    s². For zero mean this is 1/√(2n) of the root.

    Args:
        values: shape (n,), n ≥ 2, in the unit.
    """
    scale = float(np.abs(values).max()) or 1.0  # squares of tiny numbers must not underflow
    scaled = values / scale
    squares, mean, variance = mean_figure(scaled**2, "1"), float(scaled.mean()), float(scaled.var(ddof=1))
    normal = sqrt((2.0 * variance**2 + 4.0 * mean**2 * variance) / values.size)
    root = sqrt(squares.value)
    std = max(squares.known_std, normal)
    return Quantity(scale * root, scale * std / (2.0 * root) if root > 0.0 else 0.0, unit)


def reach_of_rmse(trials: int) -> tuple[float, float]:
    """The ends of the 95 % interval of an RMSE over its estimate, for normal errors without bias (χ²).

    Args:
        trials: number of errors, at least 1.
    """
    from scipy.special import chdtri

    low, high = (float(np.sqrt(trials / chdtri(trials, p))) for p in (0.025, 0.975))
    return low, high


def overall(scores: Iterable[Score]) -> Quantity | None:
    """The root mean square over cells of RMSE over bound, with its standard error.

    None where no cell has a bound.
    """
    figures = [one.rmse_over_bound for one in scores if one.rmse_over_bound is not None]
    if not figures:
        return None
    root = sqrt(sum(one.value**2 for one in figures) / len(figures))
    spread = hypot(*(one.value * one.known_std for one in figures)) / len(figures)
    return Quantity(root, spread / root if root > 0.0 else 0.0, "1")


Aspect = Literal["bias", "spread", "outliers", "coverage", "failures"]


@dataclass(frozen=True)
class Change:
    """One aspect of one method, in the baseline and now.

    Args:
        aspect: ``bias`` and ``spread`` (sizes of errors) in units of the bound, or of the truth without a
            bound; ``outliers``, ``coverage`` and ``failures`` as shares.
        before: the baseline's figure, in these units.
        now: the figure now, in these units.
        p_value: probability of at least this change for the worse if the method has not changed; 1 if the
            figure is no worse.
    """

    aspect: Aspect
    before: float
    now: float
    p_value: float


def changes(before: Sequence[Trials], now: Sequence[Trials]) -> tuple[Change, ...]:
    """Every aspect of a method over one cell, or over several together; the baseline's trials come first.

    ``bias`` is the mean error, worse when it moves away from zero; ``spread`` the root mean square error;
    ``outliers`` the share of errors beyond six medians of their size; ``coverage`` the coverage of 95 % intervals,
    worse further from 95 %.

    Raises:
        ValueError: when the cells differ in number, or a bound is known on one side only.
    """
    pairs = list(zip(before, now, strict=True))
    for old, new in pairs:
        if old.error.size and new.error.size and (old.bound is None) != (new.bound is None):
            raise ValueError("a bound is known on one side only")
    # The truths are drawn, so equal truths mean equal records.
    same = all(np.array_equal(old.truth, new.truth) for old, new in pairs)
    scaled = [(old.scaled, new.scaled) for old, new in pairs]
    failures, covered, beyond = np.zeros((3, 2, 2), dtype=int)  # number and total, before and now
    for pair, errors in zip(pairs, scaled, strict=True):
        both = np.abs(np.concatenate(errors))
        limit = OUTLIER_MEDIANS * float(np.median(both)) if both.size else 0.0
        for side, trials in enumerate(pair):
            failures[side] += trials.failures, trials.count
            covered[side] += trials.covered, trials.error.size
            beyond[side] += int(np.sum(np.abs(errors[side]) > limit)), trials.error.size
    turned, sizes, means = [], [], []
    for old_errors, new_errors in scaled:
        both = np.concatenate((old_errors, new_errors))
        # The direction of a cell comes from all its errors, old and new: a change in this direction is worse.
        direction = 1.0 if both.size == 0 or both.mean() >= 0.0 else -1.0
        turned.append((direction * old_errors, direction * new_errors))
        sizes.append((np.abs(old_errors), np.abs(new_errors)))
    for side in (0, 1):
        cells = [abs(float(pair[side].mean())) for pair in scaled if pair[side].size]
        means.append(float(np.mean(cells)) if cells else 0.0)
    every = [np.concatenate([pair[side] for pair in scaled]) if scaled else np.zeros(0) for side in (0, 1)]
    rms = [float(np.sqrt(np.mean(errors**2))) if errors.size else 0.0 for errors in every]
    least_bias = means[0] + (LEAST_CHANGE * rms[0] if same else 0.0)
    least_rms = rms[0] * (1.0 + LEAST_CHANGE if same else 1.0)
    return (
        Change("bias", means[0], means[1], _larger(turned, same) if means[1] > least_bias else 1.0),
        Change("spread", rms[0], rms[1], _larger(sizes, same) if rms[1] > least_rms else 1.0),
        _share("outliers", beyond, larger_is_worse=True),
        _share("coverage", covered, larger_is_worse=False),
        _share("failures", failures, larger_is_worse=True),
    )


def holm(p_values: Sequence[float], rate: float = DIFFERENCE_RATE) -> tuple[bool, ...]:
    """Which of several tests are significant, by S. Holm, Scand. J. Stat. 6 (1979) 65–70.

    Args:
        rate: probability of at least one false alarm among them.
    """
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    verdicts = [False] * len(p_values)
    for rank, place in enumerate(order):
        if p_values[place] > rate / (len(p_values) - rank):
            break
        verdicts[place] = True
    return tuple(verdicts)


def _share(aspect: Aspect, counts: NDArray[np.int64], *, larger_is_worse: bool) -> Change:
    """The change of a share by Fisher's exact test; a coverage further from 95 % is worse."""
    from scipy.stats import fisher_exact

    if 0 in counts[:, 1]:
        nothing = 0.0 if larger_is_worse else 1.0
        return Change(aspect, nothing, nothing, 1.0)
    before, now = (count / total for count, total in counts.tolist())
    worse = now > before if larger_is_worse else abs(now - NOMINAL_COVERAGE) > abs(before - NOMINAL_COVERAGE)
    if not worse:
        return Change(aspect, before, now, 1.0)
    table = np.column_stack((counts[:, 0], counts[:, 1] - counts[:, 0]))
    test = fisher_exact(table[::-1], alternative="greater") if larger_is_worse else fisher_exact(table)
    return Change(aspect, before, now, float(test.pvalue))


def _larger(cells: Sequence[tuple[Array, Array]], same: bool) -> float:
    """One-sided p-value for larger new values, from pairs of the same records or from independent values."""
    from scipy.special import ndtr
    from scipy.stats import rankdata

    excess = variance = 0.0
    for old, new in cells:
        n, m = old.size, new.size
        if same:  # signed ranks within each cell; pairs without a difference do not count
            difference = (new - old)[new != old]
            if difference.size:
                ranks = rankdata(np.abs(difference)) / difference.size
                excess += float(np.sign(difference) @ ranks)
                variance += float(ranks @ ranks)
        elif n and m:
            ranks = rankdata(np.concatenate((old, new)))
            # Weighted by 1/(n + m + 1) after P. van Elteren, Bull. Int. Stat. Inst. 37 (1960) 351–361; the variance
            # is the variance of the actual ranks, with ties.
            weight = 1.0 / (n + m + 1)
            excess += weight * (float(ranks[n:].sum()) - m * (n + m + 1) / 2.0)
            variance += weight**2 * n * m / (n + m) * float(ranks.var(ddof=1))
    return float(ndtr(-excess / np.sqrt(variance))) if variance > 0.0 else 1.0
