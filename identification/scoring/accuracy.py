"""The accuracy of estimates: bias, RMSE, RMSE over the bound, coverage and failures.

Every figure has the sampling error that follows from the number of trials. These are pure functions of numbers; the
caller knows the estimators and the records. `identification.scoring.comparison` tests whether a method got worse.
Standard errors of bias and RMSE are those of means (delta method for the root); shares have Wilson's intervals
(E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209–212, doi 10.1080/01621459.1927.10502953).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

from identification.estimate import Quantity
from identification.statistics.proportion import Proportion
from tunnel_sim.vocabulary.record import Array, read_only

NOMINAL_COVERAGE = 0.95
INTERVAL = 1.959963984540054
"""Half the width of a 95 % interval in standard deviations."""
_LEAST = 2  # trials needed for a sampling error


@dataclass(frozen=True)
class Outcome:
    """One estimate with its truth.

    Args:
        truth: true value, in the quantity's unit.
        found: the estimate; None where the method failed.
        bound: smallest standard deviation any unbiased estimator can have, in the same unit; None where it is
            not known.
    """

    truth: float
    found: Quantity | None
    bound: float | None = None


@dataclass(frozen=True, eq=False)
class Trials:
    """The outcomes of one method on many records, one quantity of one unit.

    Args:
        error: estimate − truth of those identified, shape (k,).
        std: as the method reports it, shape (k,).
        truth: shape (k,).
        bound: see `Outcome`, shape (k,); None where it is not known for all.
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


def collect(outcomes: Iterable[Outcome]) -> Trials:
    """Outcomes as arrays.

    Args:
        outcomes: of one method and one quantity.

    Raises:
        ValueError: when units are mixed or an estimate is not finite.
    """
    every = list(outcomes)
    kept = [(one, one.found) for one in every if one.found is not None]
    units = {found.unit for _, found in kept}
    if len(units) > 1:
        raise ValueError(f"units are mixed: {', '.join(sorted(units))}")
    error = read_only([found.value - one.truth for one, found in kept])
    std = read_only([found.std for _, found in kept])
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
    """The figures of a method. A figure is None where fewer than two trials gave an estimate.

    Each `Quantity` is a figure with its standard error.

    Args:
        failures: those without an estimate.
        bias: mean error, in the quantity's unit.
        relative_bias: mean of error over the size of the truth, %; None where a truth is zero.
        bias_in_stds: mean of error over the reported standard deviation; None where one of these is zero.
        rmse: root of the mean squared error, in the quantity's unit.
        rmse_over_bound: root of the mean squared (error over bound); None where the bound is not known.
        coverage: of the 95 % intervals, among the trials with an estimate; None where there is none.
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
    """Score the trials of one method and one quantity.

    Args:
        trials: at least one.

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
    """√mean(x²) with its standard error, that of mean(x²) through the root.

    Args:
        values: shape (n,), n ≥ 2, in the unit.
    """
    scale = float(np.abs(values).max()) or 1.0  # squares of tiny numbers must not underflow
    squares = mean_figure((values / scale) ** 2, "1")
    root = sqrt(squares.value)
    return Quantity(scale * root, scale * squares.std / (2.0 * root) if root > 0.0 else 0.0, unit)


def overall(scores: Iterable[Score]) -> Quantity | None:
    """One figure for many cells: the root mean square of their RMSE over the bound, with its standard error.

    Args:
        scores: of one method and one quantity, one per cell; those without the figure are left out.

    Returns:
        The figure, of unit 1; None where no cell has one.
    """
    figures = [one.rmse_over_bound for one in scores if one.rmse_over_bound is not None]
    if not figures:
        return None
    root = sqrt(sum(one.value**2 for one in figures) / len(figures))
    spread = hypot(*(one.value * one.std for one in figures)) / len(figures)
    return Quantity(root, spread / root if root > 0.0 else 0.0, "1")
