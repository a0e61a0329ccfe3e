"""Patterns in the differences between runs: their order, a condition of the plan, or two groups of runs.

A difference that follows a pattern has a cause, so it is not scatter
(docs/decisions/0036-the-model-of-a-campaign.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri, stdtr

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.scatter_widths import Between
from diagnosis.search.scatter import shown_by
from identification.campaign.random_effects import Marginal, marginal
from tunnel_sim.vocabulary.quantities import PerRun
from tunnel_sim.vocabulary.record import Array

IN_ORDER: Final = 5
"""Minimum number of runs that show a drift in their order. Judgement."""
OF_CONDITION: Final = 4
"""Minimum number of runs that show a difference with a condition of the plan. Judgement."""
OF_GROUPS: Final = 6
"""Minimum number of runs that show two groups. Judgement. The partitions of fewer runs leave no small p-value."""
CONDITION_RANGE: Final = 0.05
"""Minimum relative range of a condition for the runs to be compared along it. Convention."""
APART: Final = 1e-4
"""Minimum share of the power of a pattern that no other common parameter explains, for the pattern to be tested.
Convention. A spring that is off is the pattern of its runs, and what remains of it is an error of differences."""
ORDER_CLEARER: Final = 10.0
"""Minimum ratio of the p-values of a condition and of the order of the runs for a difference to be a drift.
Convention. Strong evidence. Springs are often changed in order, and a cause that follows them is then no drift."""

SCREENED: Final = 10.0
"""Factor on the squared distance of a pattern from zero below which chance explains the pattern without a fit.
Estimated. The distance is bounded by the widths without the pattern. Of 71 patterns beyond chance, in five
campaigns, none needs more than 3."""

_ORDER, _GROUPS = "order", "groups"
_LEAST_OUTSIDE = 1e-3  # variances outside a pattern that may be all of the difference
_OF_LINE = 2  # number of parameters of a straight line


@dataclass(frozen=True, eq=False)
class Pattern:
    """A pattern that the deviations of one quantity may follow.

    Args:
        along: as in `Trend`.
        values: of every run, from -1/2 to 1/2; 0 where the quantity does not act; shape (runs,), dimensionless.
        tried: number of patterns from which this one is chosen, at least 1.
        runs: ids of the runs of the named group; empty for a line along a condition or the order.
    """

    along: str
    values: PerRun
    tried: float = 1.0
    runs: tuple[str, ...] = ()

    def is_like(self, other: Pattern) -> bool:
        """Whether another pattern has the same values, or their negative."""
        return any(np.allclose(self.values, sign * other.values) for sign in (1.0, -1.0))


@dataclass(frozen=True)
class Trend:
    """A quantity that differs between the runs by a pattern.

    Args:
        effect: name of the quantity's scatter.
        change: relative change of the quantity from the first run to the last, from the least value of the
            condition to the greatest, or from the other runs to the named group, dimensionless.
        std: standard deviation of the change, dimensionless.
        p_value: probability of such a pattern by chance, times the number of patterns tested.
        left: standard deviation of the runs' deviations from the trend, relative, dimensionless.
        only: whether the runs show no scatter of the quantity beside the trend.
        along: ``order``, ``spring_stiffness``, ``wind_speed``, ``air_density``, ``amplitude``, ``wind`` (on
            against off) or ``groups``.
        runs: ids of the runs of the named group; empty for a line along a condition or the order.
    """

    effect: str
    change: float
    std: float
    p_value: float
    left: float
    only: bool = False
    along: str = _ORDER
    runs: tuple[str, ...] = ()

    @property
    def of_condition(self) -> bool:
        """Whether the quantity follows a condition that the model knows: the model then lacks a cause."""
        return self.along not in (_ORDER, _GROUPS)


def trends(fitted: Fit) -> tuple[Trend, ...]:
    """The patterns that the differences between the runs of a fit follow, beyond chance.

    Returns:
        For every difference that the runs show at most one: the clearest.
    """
    shown, clearest = shown_by(fitted), []
    for place, one in enumerate(fitted.problem.scatter):
        if one.name not in shown:
            continue
        compared = _patterns(fitted, place)
        tried = [_trend(fitted, place, pattern, len(shown) * len(compared)) for pattern in compared]
        known = [trend for trend in tried if trend is not None]
        clearest += [min(known, key=_unlikely)] if known else []
    return tuple(clearest)


def _unlikely(trend: Trend) -> float:
    """The p-value of a trend, larger for a drift, which must be clearer than a condition."""
    return trend.p_value * (ORDER_CLEARER if trend.along == _ORDER else 1.0)


def with_drifts(fitted: Fit) -> Between | None:
    """The differences between the runs of a fit beside drifts in their order; None where the runs show no drift."""
    columns, scatter = fitted.columns, fitted.problem.scatter
    shown, order = shown_by(fitted), Pattern(_ORDER, _order(len(fitted.problem.data.runs)))
    drifting = [
        place
        for place, one in enumerate(scatter)
        if one.name in shown and _trend(fitted, place, order, len(shown)) is not None
    ]
    for place in drifting:
        columns, _ = columns.with_pattern(place, order.values)
    return columns.likeliest() if drifting else None


def has_a_cause(fitted: Fit) -> bool:
    """Whether the differences between the runs of a fit are not scatter.

    Each of them is a pattern alone, or one of them follows a condition that the model knows.
    """
    found = {trend.effect: trend for trend in trends(fitted)}
    alone = [name in found and found[name].only for name in shown_by(fitted)]
    return any(trend.of_condition for trend in found.values()) or (bool(alone) and all(alone))


def _order(count: int) -> PerRun:
    return np.linspace(-0.5, 0.5, count)


def _patterns(fitted: Fit, place: int) -> list[Pattern]:
    """The patterns that the deviations of one quantity may follow, each once."""
    data = fitted.problem.data
    runs, acts = data.runs, data.acts(fitted.problem.scatter[place].kind)
    settings = {
        "spring_stiffness": np.array([run.spring_stiffness or 0.0 for run in runs]),
        "wind_speed": np.array([run.wind_speed for run in runs]),
    }
    conditions = settings | {
        "air_density": np.array([run.air_density for run in runs]),
        "amplitude": np.array([0.5 * float(np.ptp(run.reading)) for run in runs]),
        "wind": np.array([float(run.wind_on) for run in runs]),
    }
    found = [Pattern(_ORDER, _order(len(runs)))]
    for along, given in conditions.items():
        # without wind no air density is stated
        has = acts & (given > 0.0) if along == "air_density" else acts
        low, high = float(given[has].min(initial=np.inf)), float(given[has].max(initial=0.0))
        if high - low > CONDITION_RANGE * high:
            found.append(Pattern(along, np.where(has, (given - low) / (high - low) - 0.5, 0.0)))
    for along, labels in (settings | {_GROUPS: np.arange(float(len(runs)))}).items():
        found += _two_groups(fitted, place, along, labels)
    return [one for index, one in enumerate(found) if not any(map(one.is_like, found[:index]))]


def _two_groups(fitted: Fit, place: int, along: str, labels: Array) -> list[Pattern]:
    """The runs parted in the two groups whose mean deviations differ most; empty for too few runs or labels.

    A single run that stands apart is an outlier and no group. Every partition counts as a pattern tried.

    Args:
        labels: of every run; runs of one label are in one group; shape (runs,).
    """
    where = np.flatnonzero(fitted.problem.data.acts(fitted.problem.scatter[place].kind))
    _, label = np.unique(labels[where], return_inverse=True)
    count = np.bincount(label)
    if where.size < OF_GROUPS or count.size < 2:
        return []
    prior = fitted.columns.prior
    # free in one quantity only: the runs divide a difference poorly between the wind speed and the spring
    widths = np.where(np.arange(prior.most.size) == place, prior.most, prior.least)
    own = marginal(fitted.columns.products, widths).deviations[where, place]
    sums = np.bincount(label, own)
    ranked = np.argsort(sums / count)
    lower, below = np.cumsum(count[ranked])[:-1], np.cumsum(sums[ranked])[:-1]
    upper, above = where.size - lower, own.sum() - below
    apart = np.where(np.minimum(lower, upper) > 1, (above / upper - below / lower) ** 2 * lower * upper, 0.0)
    if not apart.any():
        return []
    in_lower = np.isin(label, ranked[: int(np.argmax(apart)) + 1])
    named = in_lower if in_lower.sum() < (~in_lower).sum() else ~in_lower
    values = np.zeros(labels.size)
    values[where] = np.where(named, 0.5, -0.5)
    ids = tuple(fitted.problem.data.runs[index].id for index in where[named].tolist())
    return [Pattern(along, values, 2.0 ** (count.size - 1) - 1.0, ids)]


def _trend(fitted: Fit, place: int, pattern: Pattern, tried: int) -> Trend | None:
    """The trend of one quantity along a pattern; None where chance explains it, or too few runs have it.

    The trend is a further common parameter. Widths are fitted together with it.

    Args:
        tried: number of tests, beside the patterns from which this one is chosen.
    """
    scatter, chosen = fitted.problem.scatter, fitted.settings.scatter
    count = int(fitted.problem.data.acts(scatter[place].kind).sum())
    if count < (IN_ORDER if pattern.along == _ORDER else OF_CONDITION):
        return None
    columns, size = fitted.columns.with_pattern(place, pattern.values)
    freedom, patterns = count - _OF_LINE, tried * pattern.tried
    # most patterns are chance; the widths without the pattern bound its distance at a tenth of the cost of a fit
    distance = _distance(marginal(columns.products, fitted.columns.likeliest().widths))
    bound = freedom * distance / max(freedom + 1.0 - distance, _LEAST_OUTSIDE)
    if _by_chance(SCREENED * bound, freedom, patterns) >= chosen.trend_rate:
        return None
    if columns.share_apart() < APART:
        return None
    between = columns.likeliest()
    beside = between.likeliest
    slope, std = beside.common[-1] / size, float(np.sqrt(beside.covariance[-1, -1])) / size
    p_value = _by_chance(_distance(beside), freedom, patterns)
    if p_value >= chosen.trend_rate:
        return None
    every = np.ones(len(scatter), bool)
    remaining = columns.gain(every, np.arange(every.size) == place)
    only = remaining < chdtri(1.0, chosen.which_scatters_rate)
    name, left = scatter[place].name, float(between.widths[place])
    return Trend(name, float(slope), std, p_value, left, bool(only), pattern.along, pattern.runs)


def _distance(found: Marginal) -> float:
    """Squared distance of the last common parameter from zero, in variances; 0 where it is not determined."""
    variance = float(found.covariance[-1, -1])
    return float(found.common[-1]) ** 2 / variance if variance > 0.0 else 0.0


def _by_chance(distance: float, freedom: int, tried: float) -> float:
    """P-value of a squared distance, times the number of patterns tried; only the runs determine the widths."""
    return min(1.0, tried * 2.0 * float(stdtr(freedom, -np.sqrt(distance))))
