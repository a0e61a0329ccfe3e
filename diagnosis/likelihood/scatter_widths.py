"""Chance differences between runs in a fit: their widths, their cost and their gain in likelihood.

A run's other parameters, such as its release, are projected out run by run, and the deviations of the runs
are integrated out (`identification.campaign.random_effects`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from identification.campaign.random_effects import (
    Marginal,
    RunProducts,
    UsualWidths,
    WidthPrior,
    likeliest_widths,
    marginal,
    restricted_costs,
)
from tunnel_sim.vocabulary.quantities import PerKind, PerRun
from tunnel_sim.vocabulary.record import Array

STATED_DECADES: Final = 0.25
"""Standard deviation of the decimal logarithm of a width about the stated one. Judgement. An experimenter knows the
scatter to a factor of about two; a width far beyond is more likely a cause."""

#: Minimum share of a column's power that deviations of the runs fail to explain. Smaller differences are
#: finite-difference errors (1e-11 at most), which would fix an undetermined parameter. True differences may be
#: as small as 1e-8: an inertia and a stiffness differ so little where a moment is cubic.
_APART = 1e-9
_NARROWER = 0.3  # factor on widths at which the search for their maxima starts
_USUAL = UsualWidths()
_NULL = 1e-10  # maximum singular value of a run's own columns, relative to the largest, that counts as zero

Kept = NDArray[np.bool_]


def width_prior(problem: Problem) -> WidthPrior:
    """The prior of the widths: about a stated width and not below it; about the usual one where none is stated."""
    known = problem.data.repeatability
    usual = np.array([getattr(_USUAL, one.kind.scatters) for one in problem.scatter])
    given = np.array([known.get(one.kind.scatters, 0.0) for one in problem.scatter])
    stated = given > 0.0
    least, most = np.maximum(_USUAL.least * usual, given), np.maximum(_USUAL.most * usual, given)
    decades = np.where(stated, STATED_DECADES, _USUAL.decades)
    return WidthPrior(np.where(stated, least, usual), decades, least, most)


@dataclass(frozen=True, eq=False)
class ScatterColumns:
    """The columns of a fit with chance differences between runs, each run's other parameters projected out.

    Args:
        bases: orthonormal columns of a run's other parameters, by run, shape (n, m).
        deviations: columns of the deviations, by run, shape (n, kinds).
        common: columns of the common parameters, by run, shape (n, common).
        residuals: scaled, without the fitted deviations, by run, shape (n,).
        prior: of the widths of the deviations.
    """

    bases: list[Array]
    deviations: list[Array]
    common: list[Array]
    residuals: list[Array]
    prior: WidthPrior
    # the tests of one fit compare the same widths again and again; every comparison is a search
    _compared: dict[bytes, Between] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls, problem: Problem, point: Point, residuals: list[Array], jacobian: list[tuple[Array, Array]]
    ) -> ScatterColumns:
        """The columns at a point.

        Args:
            residuals: scaled residuals, by run.
            jacobian: as in `Fit`.
        """
        places = problem.parameters.places(problem.scatter)
        bases, deviations, common, seen = [], [], [], []
        for residual, (of_common, own), values in zip(residuals, jacobian, point.per_run, strict=True):
            basis = _orthonormal(np.delete(own, places, axis=1))
            chance = own[:, places]
            bases.append(basis)
            deviations.append(_without(basis, chance))
            common.append(_without(basis, of_common))
            seen.append(_without(basis, residual + chance @ values[places]))
        inside = [_inside(deviations, column) for column in _columns(common)]
        common = [np.stack(parts, axis=1) for parts in zip(*inside, strict=True)] if inside else common
        return cls(bases, deviations, common, seen, width_prior(problem))

    @cached_property
    def products(self) -> RunProducts:
        """Products of the columns."""
        return RunProducts.of(self.deviations, self.common, self.residuals)

    @cached_property
    def within_runs(self) -> Marginal:
        """The runs with the greatest widths, so that only the evidence within runs counts."""
        return marginal(self.products, self.prior.most)

    def with_column(self, change: Sequence[Array]) -> tuple[ScatterColumns, float]:
        """Add a common column; also returns the norm by which it is scaled.

        Args:
            change: of the scaled prediction, by run, shape (n,).
        """
        column = [_without(basis, one) for basis, one in zip(self.bases, change, strict=True)]
        column = _inside(self.deviations, column)
        size = float(np.sqrt(sum(float(one @ one) for one in column))) or 1.0
        common = [np.column_stack([c, one / size]) for c, one in zip(self.common, column, strict=True)]
        return ScatterColumns(self.bases, self.deviations, common, self.residuals, self.prior), size

    def remaining_residuals(self, found: Marginal) -> list[Array]:
        """Residuals at the most likely parameters and deviations by linear theory, by run, shape (n,)."""
        rows = zip(self.residuals, self.common, self.deviations, found.deviations, strict=True)
        return [z - j @ found.common - d @ e for z, j, d, e in rows]

    def with_pattern(self, place: int, values: PerRun) -> tuple[ScatterColumns, float]:
        """Add a pattern: a deviation of one parameter in proportion to given values.

        Args:
            place: of the parameter among the deviations.
            values: of every run, from -1/2 to 1/2, shape (runs,), dimensionless.

        Returns:
            The columns, and the norm of the column for a deviation of 1 from -1/2 to 1/2.
        """
        return self.with_column([t * own[:, place] for t, own in zip(values, self.deviations, strict=True)])

    def share_apart(self) -> float:
        """Share of the power of the last common column that the other common columns do not explain."""
        stacked = np.concatenate(self.common)
        others, last = stacked[:, :-1], stacked[:, -1]
        size = np.sqrt(np.maximum(np.sum(others**2, axis=0), 1e-300))
        left = last - others / size @ np.linalg.lstsq(others / size, last, rcond=1e-12)[0]
        return float(left @ left) / max(float(last @ last), 1e-300)

    def likeliest(self, start: PerKind | None = None, *, only: Kept | None = None) -> Between:
        """The most likely widths, and the runs with them.

        Args:
            start: start of the search, shape (kinds,); None: the usual widths.
            only: the differences whose widths are free, shape (kinds,); the others keep their least widths.
                None: all are free.
        """
        prior = self.prior if only is None else _at_least(self.prior, ~only)
        first = prior.usual if start is None else np.clip(start, prior.least, prior.most)
        key = np.concatenate([prior.decades, first]).tobytes()
        if key not in self._compared:
            # a further parameter may act like a width: then there are several maxima
            narrower = (first, np.maximum(_NARROWER * first, prior.least), prior.least)
            tries = np.array(list(product(*zip(*narrower, strict=True))))
            starts = {0, int(np.argmin(restricted_costs(self.products, prior, tries)))}
            ends = [likeliest_widths(self.products, prior, tries[one]) for one in sorted(starts)]
            self._compared[key] = min(map(self.at, ends), key=lambda one: one.restricted)
        return self._compared[key]

    def gain(self, kept: Kept, lost: Kept) -> float:
        """Drop of −2 ln L by some of the differences beside the remaining ones, dimensionless.

        Args:
            kept: all differences compared, shape (kinds,); the others keep their least widths.
            lost: differences among them that the likelihood is compared without, shape (kinds,).
        """
        without = self.likeliest(only=kept & ~lost)
        return without.likeliest.restricted - self.likeliest(only=kept).likeliest.restricted

    def wider(self, widths: PerKind) -> float:
        """P-value of the observed differences if the given widths are true, by the likelihood ratio."""
        gain = self.at(widths).likeliest.restricted - self.likeliest(widths).likeliest.restricted
        return float(chdtrc(float(widths.size), max(gain, 0.0)))

    def at(self, widths: PerKind) -> Between:
        """The runs with given widths."""
        return Between(widths, marginal(self.products, widths), self.prior.cost(widths), self.within_runs)


@dataclass(frozen=True, eq=False)
class Between:
    """The runs with given widths of chance differences.

    Args:
        likeliest: the deviations integrated out with the given widths.
        most: the deviations integrated out with the greatest widths, so that only the evidence within runs
            counts.
    """

    widths: PerKind
    likeliest: Marginal
    prior_cost: float
    most: Marginal

    @property
    def likelihood(self) -> float:
        """−2 ln of the likelihood times the prior of the widths, up to a constant."""
        return self.likeliest.likelihood + self.prior_cost

    @property
    def restricted(self) -> float:
        """−2 ln of the likelihood with the common parameters integrated out; compares widths."""
        return self.likeliest.restricted + self.prior_cost

    def shown(self, values: Array, stds: float) -> Kept:
        """Whether each common parameter differs from zero by the evidence within runs alone.

        Args:
            values: of the common parameters, in their units, shape (common,).
            stds: least distance from zero, in standard deviations at the greatest widths, dimensionless.

        Returns:
            True where the parameter differs from zero, shape (common,).
        """
        return np.asarray(values**2 >= stds**2 * np.diag(self.most.covariance), np.bool_)

    def cost(self, deviation_precision: Array, given: Kept | None = None) -> float:
        """−2 ln of the evidence without the residuals' χ²: the cost of letting the runs differ so much.

        It is 0 for runs that repeat exactly. All sets use the accuracy of the deviations under one common
        model. Otherwise an effect such as vortices would gain or lose weight by that accuracy: their phase
        shows the speed of a run. Common parameters that only the comparison of runs determines are integrated
        out with the greatest widths; otherwise an effect that aligns a few runs by chance would reduce their
        width to zero.

        Args:
            deviation_precision: Dᵀ D of every run under that model, shape (runs, kinds, kinds).
            given: common parameters that are not integrated out, shape (common,). They are the parameters of
                effects that single runs show, which cannot align runs by chance. None: there are none.
        """
        identity = np.eye(self.widths.size)
        scaled = identity + self.widths[None, :, None] * deviation_precision * self.widths
        away = self.likeliest.deviations / self.widths
        seen = np.einsum("rk,rkl,rl->", away, identity - np.linalg.inv(scaled), away)
        width = float(np.linalg.slogdet(scaled)[1].sum() + seen)
        if given is None:
            given = np.zeros(self.likeliest.common.size, bool)
        for one in (self.likeliest, self.most):  # a parameter that the runs do not determine has no variance
            given = given & (np.diag(one.covariance) > 0.0)
        information = self.likeliest.log_information_given(given) - self.most.log_information_given(given)
        return width + self.prior_cost + information


def _at_least(prior: WidthPrior, which: Kept) -> WidthPrior:
    """The prior with some widths fixed at their least."""
    usual, decades = np.where(which, prior.least, prior.usual), np.where(which, 0.0, prior.decades)
    return replace(prior, usual=usual, decades=decades)


def _orthonormal(columns: Array) -> Array:
    size = np.sqrt(np.maximum(np.sum(columns**2, axis=0), 1e-300))
    vectors, values, _ = np.linalg.svd(columns / size, full_matrices=False)
    return np.asarray(vectors[:, values > _NULL * values[0]], np.float64)


def _without(basis: Array, values: Array) -> Array:
    return np.asarray(values - basis @ (basis.T @ values), np.float64)


def _columns(by_run: Sequence[Array]) -> list[list[Array]]:
    return [[one[:, k] for one in by_run] for k in range(by_run[0].shape[1])]


def _inside(deviations: Sequence[Array], column: list[Array]) -> list[Array]:
    """A column of all runs, or its projection on the deviations if the rest is a finite-difference error."""
    inside = []
    for chance, one in zip(deviations, column, strict=True):
        size = np.sqrt(np.sum(chance**2, axis=0)) + 1e-300
        part = chance @ (np.linalg.lstsq(chance / size, one, rcond=1e-9)[0] / size)
        inside.append(part)
    whole = sum(float(one @ one) for one in column)
    apart = sum(float((one - part) @ (one - part)) for one, part in zip(column, inside, strict=True))
    return inside if apart < _APART * whole else column
