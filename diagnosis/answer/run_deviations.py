"""Repeatability of the runs under the answer: widths with intervals, and every run against the common model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import fdtrc, ndtri

from diagnosis.likelihood.least_squares import Fit, scaled_residuals
from diagnosis.likelihood.residuals import linear_coefficients
from diagnosis.likelihood.scatter_widths import ScatterColumns, width_prior
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.model.chance import Scatter
from diagnosis.search.scatter import (
    may_scatter,
    may_show,
    usual,
    with_deviations,
    without_deviations,
)
from identification.campaign.random_effects import (
    RunProducts,
    WidthPrior,
    likeliest_widths,
    marginal,
    width_quantiles,
)
from tunnel_sim.effects import ALL_EFFECTS, effect_class
from tunnel_sim.vocabulary.record import Array

LIMIT_TOLD: Final = 0.5
"""Maximum ratio of the upper limit of undetected scatter to its limit before any run, for the runs to count as
evidence. Judgement. Above it the limit is the prior's."""


@dataclass(frozen=True)
class Spread:
    """Chance difference of a quantity between the runs.

    Args:
        effect: name of the scatter.
        width: most likely standard deviation of the runs' relative deviations, dimensionless.
        interval: central interval of 0.90 of the width, dimensionless.
        stated: value stated by the campaign, dimensionless; None: not stated.
        shown: whether the runs show more than the stated value; the scatter is then among the causes.
        deviations: relative deviation of every run on which it acts, by id, dimensionless.
    """

    effect: str
    width: float
    interval: tuple[float, float]
    stated: float | None
    shown: bool
    deviations: dict[str, float]

    @property
    def over_expected(self) -> float:
        """Lower end of the interval over the stated width, or over the usual one where none is stated, a ratio."""
        return self.interval[0] / (self.stated or effect_class(self.effect).parameters()[0].scale)


@dataclass(frozen=True)
class RunRepeat:
    """A run against the model of all runs.

    Args:
        id: id of the run.
        windy: whether the wind is on.
        frequency_hz: frequency of small swings, predicted without a deviation of the run, Hz.
        damping_ratio: damping ratio of small swings, predicted without a deviation of the run, dimensionless.
        frequency: the run's own frequency over the predicted one minus one, a fraction.
        frequency_std: standard deviation of ``frequency`` due to the noise, a fraction.
        damping: the run's own damping ratio over the predicted one minus one, a fraction.
        damping_std: standard deviation of ``damping`` due to the noise, a fraction.
        frequency_band: standard deviation of the frequency between runs, a fraction; 0 where they repeat.
        damping_band: standard deviation of the damping ratio between runs, a fraction.
        p_value: probability of such a deviation by chance, given the other runs, times the number of runs.
    """

    id: str
    windy: bool
    frequency_hz: float
    damping_ratio: float
    frequency: float
    frequency_std: float
    damping: float
    damping_std: float
    frequency_band: float
    damping_band: float
    p_value: float

    def deviation(self, name: str) -> tuple[float, float, float]:
        """The deviation of ``frequency`` or ``damping``, its deviation by noise, and the scatter between runs."""
        if name == "frequency":
            return self.frequency, self.frequency_std, self.frequency_band
        return self.damping, self.damping_std, self.damping_band


@dataclass(frozen=True)
class ScatterLimits:
    """Upper limits of undetected scatter, under a model that explains the runs down to their noise.

    Args:
        frequency: greatest standard deviation of the frequency between runs, with probability 0.95, a fraction;
            None if the runs could hide usual scatter.
        damping: the same limit for the damping ratio.
    """

    frequency: float | None
    damping: float | None


_CENTRAL = (0.05, 0.5, 0.95)  # levels of the quantiles
_AT_MOST = 0.95  # level of a limit
_COMPARED = ("spring_stiffness", "mechanical_damping")  # a run's own deviations
_NUMBERS = len(_COMPARED)  # number of a run's deviations
_FEWEST = 5  # minimum number of runs for an outlier


@dataclass(frozen=True, eq=False)
class RunDeviations:
    """The runs of a fit, each with its own deviations.

    Args:
        fitted: the fit of the answer.
        scatter: all differences that the runs could show; the fitted ones have the fit's widths.
        columns: columns of the fit with all of these differences.
        kept: indices of the fit's own differences among them.
    """

    fitted: Fit
    scatter: Scatter
    columns: ScatterColumns
    kept: Sequence[int]

    @classmethod
    def of(cls, fitted: Fit) -> RunDeviations | None:
        """The runs of a fit, if their quantities may scatter.

        Returns:
            None where none may, where a run has no damping or no stiffness to compare, or where a sensitivity is
            not finite.
        """
        own = {one.name: one for one in fitted.problem.scatter}
        able, data = may_scatter(ALL_EFFECTS, fitted.problem.data), fitted.problem.data
        compared = {kind.scatters for kind in may_show(ALL_EFFECTS, data)}
        if not compared.issuperset(_COMPARED) or not np.all(fitted.linear[:, 1:] != 0.0):
            return None
        scatter = tuple(own.get(kind.name, usual(fitted, kind)) for kind in able)
        problem, point = with_deviations(*without_deviations(fitted), scatter)
        names = fitted.problem.parameters.own_names
        for place, name in enumerate(problem.parameters.own_names):
            if name in own:
                point.per_run[:, place] = fitted.point.per_run[:, names.index(name)]
        jacobian = sensitivities(problem, point)
        if not all(np.all(np.isfinite(c)) and np.all(np.isfinite(r)) for c, r in jacobian):
            return None
        columns = ScatterColumns.of(problem, point, scaled_residuals(problem, point), jacobian)
        return cls(fitted, scatter, columns, [k for k, one in enumerate(scatter) if one.name in own])

    @property
    def products(self) -> RunProducts:
        """Products of the columns of the fit's own differences."""
        deviations = [one[:, self.kept] for one in self.columns.deviations]
        return RunProducts.of(deviations, self.columns.common, self.columns.residuals)

    @property
    def prior(self) -> WidthPrior:
        """Prior of the widths of the fit's own differences."""
        return width_prior(self.fitted.problem)

    @property
    def alone(self) -> tuple[int, int]:
        """Indices of the differences in a run's own stiffness and damping."""
        numbers = [one.kind.scatters for one in self.scatter]
        stiffness, damping = map(numbers.index, _COMPARED)
        return stiffness, damping

    def spreads(self) -> tuple[Spread, ...]:
        """The differences of the fit with the intervals of their widths."""
        scatter, data = self.fitted.problem.scatter, self.fitted.problem.data
        if not scatter:
            return ()
        if any(one.shown for one in scatter):
            low, middle, high = width_quantiles(self.products, self.prior, _CENTRAL)
        else:
            low = middle = high = np.array([one.width for one in scatter])
        found = marginal(self.products, middle).deviations
        spreads = []
        for k, one in enumerate(scatter):
            acts = data.acts(one.kind)
            own = {run.id: float(e) for run, e, a in zip(data.runs, found[:, k], acts, strict=True) if a}
            known, interval = data.repeatability.get(one.kind.scatters), (float(low[k]), float(high[k]))
            spreads.append(Spread(one.name, float(middle[k]), interval, known, one.shown, own))
        return tuple(spreads)

    def limits(self) -> ScatterLimits | None:
        """Limits of the scatter of frequency and damping; None where the fit has chance differences.

        A limit is the quantile of the width given the runs. If it is hardly below the quantile of the prior,
        the runs say nothing about the scatter.
        """
        if self.kept:
            return None
        pair = list(self.alone)
        problem = replace(self.fitted.problem, scatter=tuple(self.scatter[place] for place in pair))
        prior = width_prior(problem)
        products = RunProducts.of(
            [one[:, pair] for one in self.columns.deviations], self.columns.common, self.columns.residuals
        )
        widths = width_quantiles(products, prior, (_AT_MOST,))[0]
        unseen = prior.usual * 10.0 ** (prior.decades * float(ndtri(_AT_MOST)))
        per = np.array([self._per(index) for index in range(len(self.fitted.problem.data.runs))])
        sizes = widths * np.sqrt(np.mean(per**2, axis=0))
        told = widths <= LIMIT_TOLD * unseen
        frequency, damping = (float(size) if known else None for size, known in zip(sizes, told, strict=True))
        return ScatterLimits(frequency, damping)

    def _changes(self, index: int) -> Array:
        """Changes of a run's stiffness and damping by a unit of every difference, shape (differences, 2)."""
        problem = self.fitted.problem
        run = problem.data.runs[index]
        stated = problem.stated(self.fitted.point.common, self.fitted.point.per_run[index], run)
        changes = [one.change(stated.table, problem.data) for one in self.scatter]
        return np.concatenate(changes)[:, :2]

    def _per(self, index: int) -> Array:
        """Relative changes of a run's frequency and damping by a unit of its own spring and damper, shape (2,)."""
        changes, pair = self._changes(index), self.alone
        _, damping, stiffness = linear_coefficients(self.fitted, index)
        return np.array([changes[pair[0], 0] / (2.0 * stiffness), changes[pair[1], 1] / damping])

    def run(self, index: int) -> RunRepeat:
        """One run against the model."""
        problem = self.fitted.problem
        run, pair = problem.data.runs[index], self.alone
        inertia, damping, stiffness = linear_coefficients(self.fitted, index)
        changes, per = self._changes(index), self._per(index)
        deviation = self.columns.deviations[index][:, pair]
        covariance = np.linalg.pinv(deviation.T @ deviation)
        own = per * (covariance @ (deviation.T @ self.columns.residuals[index]))
        std = np.abs(per) * np.sqrt(np.diag(covariance))
        widths = np.array([one.width if k in self.kept else 0.0 for k, one in enumerate(self.scatter)])
        bands = (
            np.abs(per)
            * np.sqrt(np.sum((widths[:, None] * changes) ** 2, axis=0))
            / np.abs(np.array([changes[pair[0], 0], changes[pair[1], 1]]))
        )
        return RunRepeat(
            id=run.id,
            windy=run.wind_on,
            frequency_hz=problem.data.model.frequency(inertia, stiffness),
            damping_ratio=damping / (2.0 * float(np.sqrt(max(inertia * stiffness, 1e-300)))),
            frequency=float(own[0]),
            frequency_std=float(std[0]),
            damping=float(own[1]),
            damping_std=float(std[1]),
            frequency_band=float(bands[0]),
            damping_band=float(bands[1]),
            p_value=self._p_value(index),
        )

    def _p_value(self, index: int) -> float:
        """P-value of a run's deviation given the others, times the number of runs."""
        count = len(self.columns.residuals)
        if not self.kept or count < _FEWEST:
            return 1.0
        products, pair = self.products, self.alone
        others = RunProducts(*(np.delete(values, index, axis=0) for values in vars(products).values()))
        widths = likeliest_widths(others, self.prior)
        found = marginal(others, widths)
        # in the run's own stiffness and damping
        own = self.columns.deviations[index][:, pair]
        covariance = np.linalg.pinv(own.T @ own)
        kept = self.columns.deviations[index][:, self.kept]
        by_chance = covariance @ (own.T @ kept) * widths
        by_common = covariance @ (own.T @ self.columns.common[index])
        left = self.columns.residuals[index] - self.columns.common[index] @ found.common
        away = covariance @ (own.T @ left)
        whole = covariance + by_chance @ by_chance.T + by_common @ found.covariance @ by_common.T
        distance = float(away @ np.linalg.solve(whole, away)) / _NUMBERS
        # only the other runs determine the widths
        return min(1.0, count * float(fdtrc(_NUMBERS, max(count - 2, 1), distance)))
