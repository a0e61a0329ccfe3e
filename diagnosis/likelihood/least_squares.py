"""Weighted least squares of a campaign: Gauss–Newton, with the releases eliminated run by run."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np

from diagnosis.likelihood.normal_equations import Products, damped_step, normal_equations
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.scatter_widths import Between, Kept, ScatterColumns
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.model.parameters import Point
from diagnosis.settings import Settings
from tunnel_sim.vocabulary.record import Array

SHOWN_STDS: Final = 4.0
"""Minimum size of an effect, in standard deviations, for single runs to show it without a comparison of runs.
Convention. One effect in 16,000 reaches this size by chance."""

_MAX_ITERATIONS = 25
_HOPELESS = 5  # steps after which a fit must be better than the fit without the added effect
_AT_BOUND = 1e-9  # relative: a step beyond the range is cut to its end exactly
_CORRECTIONS = 2  # maximum number of further steps of the runs' own parameters
_CORRECTED = 1e-3  # drop of χ² below which such a step is not worth its simulation
# share of the greatest eigenvalue: a smaller eigenvalue belongs to an undetermined direction
_SINGULAR = 1e-12
_TAKES_PART = 1e-6  # share of a unit vector: smaller parts are rounding
_FORESEEN = 0.5  # minimum drop of χ² as a share of the foreseen drop, for sensitivities to be used again
_LINEAR = 0.1  # drop of χ² below which the last step near another fit is taken by linear theory
_DAMPING = 1e-6  # at the start
_TRIES = 9  # number of tried dampings in a step, each ten times the previous one
_TRIES_NEAR = 4  # the same near another fit, where new sensitivities are better than more damping


class FitError(ArithmeticError):
    """A fit is outside the range in which the model can be integrated."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted problem.

    Args:
        residuals: reading minus prediction in noise standard deviations, by run.
        chi2: sum of squared residuals, by run, shape (runs,).
        covariance: covariance of the common parameters for the assumed noise, releases eliminated, shape
            (common, common).
        jacobian: derivatives of the scaled prediction to the common parameters, by run, shape (n, common), and
            to the run's release, shape (n, 2).
        converged: whether the last step reduced χ² negligibly.
        spread: covariance to be added for other minima of χ², shape (common, common); None: there are none.
            Linear theory from the fit's own minimum uses ``covariance`` alone.
    """

    problem: Problem
    point: Point
    residuals: list[Array]
    chi2: Array
    covariance: Array
    jacobian: list[tuple[Array, Array]] = field(repr=False)
    converged: bool
    spread: Array | None = field(default=None, repr=False)

    @property
    def settings(self) -> Settings:
        """The settings of the diagnosis."""
        return self.problem.data.settings

    @cached_property
    def products(self) -> Products:
        """Products of the sensitivities."""
        return Products.of(self.jacobian, self.problem.parameters.precision)

    @cached_property
    def linear(self) -> Array:
        """Inertia, damping and stiffness of every run, air and gravity included, shape (runs, 3).

        In kg m², N m s/rad and N m/rad; per unit inertia in normalised form.
        """
        return self.problem.linear(self.point)

    @cached_property
    def columns(self) -> ScatterColumns:
        """The columns of a fit with chance differences between the runs."""
        return ScatterColumns.of(self.problem, self.point, self.residuals, self.jacobian)

    @property
    def widths(self) -> Array:
        """Relative widths of the chance differences between the runs, shape (kinds,)."""
        return np.array([one.width for one in self.problem.scatter])

    @cached_property
    def between(self) -> Between | None:
        """The likeliest widths of chance differences between the runs; None in a fit without any."""
        if not self.problem.scatter:
            return None
        return self.columns.likeliest(self.widths)

    def scatter_cost(self, deviation_precision: Array) -> float:
        """−2 ln of the evidence of the chance differences between the runs, without χ²; 0 if the runs repeat.

        Args:
            deviation_precision: precision of these differences in the runs, as in `Between.cost`, shape (runs,
                kinds, kinds).
        """
        return 0.0 if self.between is None else self.between.cost(deviation_precision, self.shown)

    @property
    def shown_between_runs(self) -> int:
        """Number of effects that chance differences between runs could imitate: no single run shows them."""
        return 0 if self.between is None else sum(not seen for seen in self._shown_by_runs.values())

    @property
    def shown(self) -> Kept:
        """The common parameters of effects that single runs show beside chance differences, shape (common,)."""
        by_runs = self._shown_by_runs
        return np.array([by_runs.get(name.split(".")[0], False) for name in self.problem.names], np.bool_)

    @cached_property
    def _shown_by_runs(self) -> dict[str, bool]:
        """Whether single runs show an effect: without comparing runs, its size differs from zero."""
        if self.between is None:
            return {}
        shown = self.between.shown(self.point.common, SHOWN_STDS)
        by_itself = dict(zip(self.problem.names, shown.tolist(), strict=True))
        sizes = {kind.name: f"{kind.name}.{kind.parameters()[0].name}" for kind in self.problem.effects}
        return {name: by_itself.get(size, True) for name, size in sizes.items()}

    @property
    def unlikelihood(self) -> float:
        """−2 ln L up to a constant: χ² if the runs repeat, else with their deviations integrated out.

        It uses the fit's own point and widths, because linear theory is unreliable far from a minimum.
        """
        if not self.problem.scatter:
            return self.total
        here = self.columns.at(self.widths)
        return self.total + here.likeliest.log_determinant + here.prior_cost

    @property
    def total(self) -> float:
        """χ² of the campaign, with the priors of the runs' own parameters."""
        return float(self.chi2.sum()) + self.problem.parameters.surprise(self.point)

    @property
    def count(self) -> int:
        """Number of residuals."""
        return sum(run.filled for run in self.problem.data.runs)

    @property
    def excess(self) -> float:
        """Mean squared scaled residual minus one."""
        return self.total / self.count - 1.0

    @property
    def gap(self) -> float:
        """The unit for shares: the excess, at least 0.001."""
        return max(self.excess, 1e-3)

    @property
    def chance(self) -> float:
        """Standard deviation, by chance, of a share of the gap."""
        return float(np.sqrt(2.0 / self.count)) / self.gap

    def value(self, name: str) -> float:
        """A common parameter by name."""
        return float(self.point.common[self.problem.names.index(name)])

    @property
    def fitted_spring(self) -> float | None:
        """Stiffness of a spring that is fitted, N m/rad; None where it is stated or there is none."""
        named = dict(zip(self.problem.names, self.point.common.tolist(), strict=True))
        return self.problem.data.model.fitted_spring(named)

    def zero(self, index: int) -> float:
        """The sensor's zero in the run with an index."""
        return self.problem.zero(self.point.common, self.point.per_run[index])

    def std(self, name: str) -> float:
        """Standard deviation of a common parameter, if the model is right."""
        i = self.problem.names.index(name)
        return float(np.sqrt(max(self.stated_covariance[i, i], 0.0)))

    @property
    def stated_covariance(self) -> Array:
        """Covariance of the common parameters, other minima and open directions included, (common, common)."""
        parts = (one for one in (self.spread, self.left_open) if one is not None)
        return sum(parts, self.covariance)

    @cached_property
    def left_open(self) -> Array | None:
        """Covariance along the directions that the runs leave open, shape (common, common); None without any.

        ``covariance`` is a pseudo-inverse, with a variance of zero along these directions. Along each of them
        the distribution is uniform as far as the parameters' bounds allow; an example is the split of the
        damping of a single spring between viscous and structural loss. A parameter without any effect on the
        readings is not counted.
        """
        none = [np.zeros(common.shape[0]) for common, _ in self.jacobian]
        matrix, _, _ = normal_equations(self.jacobian, none, products=self.products)
        shown = np.flatnonzero(np.diag(matrix) > 0.0)
        if not shown.size:
            return None
        scale = np.sqrt(np.diag(matrix)[shown])
        values, vectors = np.linalg.eigh(matrix[np.ix_(shown, shown)] / np.outer(scale, scale))
        least = _SINGULAR * values[-1]
        found = np.zeros_like(matrix)
        for vector in vectors.T[np.abs(values) <= least]:
            along = np.zeros(len(matrix))
            along[shown] = np.where(np.abs(vector) > _TAKES_PART, vector, 0.0) / scale
            low, high = self._range(along)
            far = 1.0 / math.sqrt(least)
            low, high = max(low, -far), min(high, far)
            square = (high * high + high * low + low * low) / 3.0  # mean relative to the fit
            found += square * np.outer(along, along)
        return found if found.any() else None

    def _range(self, along: Array) -> tuple[float, float]:
        """The least and the greatest multiple of a direction that keep the parameters within bounds."""
        moves = along != 0.0
        ends = [(limits - self.point.common)[moves] / along[moves] for limits in self.problem.bounds]
        return float(np.minimum(*ends).max()), float(np.maximum(*ends).min())

    def bound(self, name: str) -> str | None:
        """``lower`` or ``upper`` where a common parameter is at that bound; None inside its range."""
        i = self.problem.names.index(name)
        value = self.point.common[i]
        for end, limits in zip(("lower", "upper"), self.problem.bounds, strict=True):
            near = _AT_BOUND * max(abs(limits[i]), abs(value))
            if np.isfinite(limits[i]) and abs(value - limits[i]) <= near:
                return end
        return None


def fit(
    problem: Problem,
    start: Point,
    *,
    base: Fit | None = None,
    tolerance: float = 1e-4,
    max_iterations: int = _MAX_ITERATIONS,
) -> Fit:
    """Minimise χ² from a starting point.

    Args:
        base: a fit of the same runs with fewer effects. While the fit converges quickly, the base supplies the
            sensitivities of the shared parameters, which saves most of the simulations.
        tolerance: the fit continues while a step lowers χ² by this share, or by 0.1.

    Raises:
        FitError: when the model cannot be integrated at the start.
    """
    state = _State(problem, clip(problem, start))
    borrowed = base is not None
    iterations = 0
    converged = False
    while iterations < max_iterations and not converged:
        iterations += 1
        state.linearise(base if borrowed else None)
        gain = state.improve()
        poor = (
            gain < max(0.1, 0.1 * state.here.cost)
            if borrowed
            else gain < max(0.1, tolerance * state.here.cost)
        )
        if poor and borrowed:
            borrowed = False  # repeat with new sensitivities
        elif poor:
            converged = True
        if base is not None and iterations >= _HOPELESS and state.here.cost > base.total:
            break  # worse than without the further parameters
    return state.result(converged)


def try_fit(problem: Problem, start: Point, **options: Any) -> Fit | None:
    """The fit, with arguments as in `fit`; None where it fails."""
    with suppress(FitError, np.linalg.LinAlgError):
        return fit(problem, start, **options)
    return None


def fit_near(problem: Problem, start: Point, base: Fit, *, max_iterations: int) -> Fit | None:
    """Minimise χ² where its minimum is near another fit, for the point and its χ².

    The sensitivities of the other fit are used while they foresee the drop of χ², and linear theory takes the last
    step without an integration. This takes a small part of the time of `fit`; the covariance is approximate.

    Args:
        base: a fit of the same runs; its common parameters are the first of the problem.

    Returns:
        None where the model cannot be integrated.
    """
    with suppress(FitError, np.linalg.LinAlgError):
        state = _State(problem, clip(problem, start))
        known: Fit | None = base
        state.linearise(known)
        fresh = True  # whether the sensitivities, apart from the known ones, are those at the current point
        for _ in range(max_iterations):
            end = state.foreseen()
            drop = state.here.cost - end.cost
            if drop >= _LINEAR:
                gain = state.improve(_TRIES_NEAR)
                if gain >= _FORESEEN * drop:
                    fresh = False
                    continue
                if fresh and known is None and gain < _LINEAR:  # χ² is rough, and no step lowers it
                    break
                known = None if fresh else known
            elif fresh:
                state.here = end
                return state.result(converged=True)
            state.linearise(known)
            fresh = True
        return state.result(converged=False)
    return None


def fit_at(problem: Problem, point: Point) -> Fit:
    """The fit at a point found by other means.

    Raises:
        FitError: when the model cannot be integrated there.
    """
    state = _State(problem, clip(problem, point))
    state.linearise(None)
    return state.result(converged=True)


@dataclass(frozen=True, eq=False)
class _Place:
    """A point with its prediction, scaled residuals by run, and χ² including the priors."""

    point: Point
    prediction: list[Array]
    residuals: list[Array]
    cost: float

    @classmethod
    def of(cls, problem: Problem, point: Point) -> _Place:
        """Evaluate a problem at a point."""
        prediction = problem.predict([point])[0]
        residuals = _scaled(problem, prediction)
        return cls(point, prediction, residuals, _cost(problem, point, residuals))


class _State:
    """The state of a minimisation."""

    def __init__(self, problem: Problem, point: Point) -> None:
        self.problem = problem
        self.here = _Place.of(problem, point)
        if not np.isfinite(self.here.cost):
            raise FitError("the model's motion grows without bound")
        self.damping = _DAMPING
        self.jacobian: list[tuple[Array, Array]] = []
        self.products: Products | None = None

    def linearise(self, base: Fit | None) -> None:
        """Compute sensitivities, reusing a smaller fit's where given."""
        known = None if base is None else base.jacobian
        self.jacobian = sensitivities(self.problem, self.here.point, known, self.here.prediction)
        if not all(np.all(np.isfinite(c)) and np.all(np.isfinite(r)) for c, r in self.jacobian):
            raise FitError("the model's sensitivities are not finite")
        self.products = Products.of(self.jacobian, self.problem.parameters.precision)

    def foreseen(self) -> _Place:
        """The end of the next step by linear theory."""
        here = self.here
        around = self.problem, here.point, here.residuals, self.jacobian
        point = clip(self.problem, damped_step(*around, self.damping, self.products))
        step, own_steps = point.common - here.point.common, point.per_run - here.point.per_run
        residuals = [
            residual - common @ step - own @ own_step
            for residual, (common, own), own_step in zip(
                here.residuals, self.jacobian, own_steps, strict=True
            )
        ]
        return _Place(point, here.prediction, residuals, _cost(self.problem, point, residuals))

    def improve(self, tries: int = _TRIES) -> float:
        """Take one damped step; returns the drop of χ², 0 where no step lowers it."""
        here = self.problem, self.here.point, self.here.residuals, self.jacobian
        for _ in range(tries):
            point = clip(self.problem, damped_step(*here, self.damping, self.products))
            trial = _Place.of(self.problem, point)
            if self.problem.scatter:
                trial = self._corrected(trial)
            if trial.cost < self.here.cost:
                gain = self.here.cost - trial.cost
                self.here = trial
                self.damping = max(self.damping * 0.2, 1e-9)
                return gain
            self.damping = max(self.damping * 10.0, 1e-4)
        return 0.0

    def _corrected(self, trial: _Place) -> _Place:
        """A trial with the runs' own parameters fitted once more.

        Where runs differ by chance, deviations absorb a long step of the common parameters, so the step costs
        little. To first order they absorb all but some thousandths of it; but these are far above the noise.
        """
        for _ in range(_CORRECTIONS):
            pull = self.problem.parameters.pull(trial.point)
            with np.errstate(over="ignore", invalid="ignore"):  # a run diverged
                *_, solutions = normal_equations(
                    self.jacobian, trial.residuals, self.damping, self.products, pull
                )
                step = solutions[:, :, -1]
                gradient = pull + [
                    own.T @ r for (_, own), r in zip(self.jacobian, trial.residuals, strict=True)
                ]
                foreseen = float(np.sum(gradient * step))
            if foreseen < _CORRECTED:
                break
            nearer = _Place.of(self.problem, Point(trial.point.common, trial.point.per_run + step))
            if not nearer.cost < trial.cost:
                break
            trial = nearer
        return trial

    def result(self, converged: bool) -> Fit:
        """The fit at the current point."""
        none = [np.zeros(common.shape[0]) for common, _ in self.jacobian]
        matrix, _, _ = normal_equations(self.jacobian, none, products=self.products)
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        inverse = np.linalg.pinv(matrix / np.outer(scale, scale), rcond=_SINGULAR, hermitian=True)
        return Fit(
            self.problem,
            self.here.point,
            self.here.residuals,
            np.array([float(r @ r) for r in self.here.residuals]),
            np.asarray(inverse / np.outer(scale, scale), dtype=np.float64),
            self.jacobian,
            converged,
        )


def clip(problem: Problem, point: Point) -> Point:
    """The point with its common parameters inside their bounds."""
    lower, upper = problem.bounds
    return Point(np.clip(point.common, lower, upper), point.per_run)


def scaled_residuals(problem: Problem, point: Point) -> list[Array]:
    """Reading minus prediction in noise standard deviations, by run."""
    return _scaled(problem, problem.predict([point])[0])


def _scaled(problem: Problem, prediction: list[Array]) -> list[Array]:
    with np.errstate(invalid="ignore", over="ignore"):  # a run that diverged has an infinite cost
        return [
            run.scaled(run.reading - values)
            for run, values in zip(problem.data.runs, prediction, strict=True)
        ]


def _cost(problem: Problem, point: Point, residuals: list[Array]) -> float:
    with np.errstate(invalid="ignore", over="ignore"):  # as above
        total = sum(float(r @ r) for r in residuals) + problem.parameters.surprise(point)
    return total if np.isfinite(total) else np.inf
