"""How much of what is left each kind of law could close, on readings held out of the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from diagnosis.answer.held_out import folds
from diagnosis.closure import Ceiling
from diagnosis.likelihood.least_squares import Fit
from diagnosis.remainder import bases
from diagnosis.remainder.paths import Path, paths
from diagnosis.remainder.ridge import (
    Normal,
    Ridge,
    Rows,
    best_ridge,
    common_precision,
    held_out,
    normal,
    ratio,
    total,
)
from tunnel_sim.vocabulary.record import Array

RUNS = "runs"
STRETCHES = "stretches of time"
GAPS = "short gaps"
_STRETCHES = 6  # in a run, where no run can be left out
_GAP = 3  # rows: an eighth of a cycle
_TURNS = 3


@dataclass(frozen=True, eq=False)
class Unit:
    """What has a release of its own: a run, or a stretch of it.

    Args:
        path: of the run.
        rows: which of its rows.
    """

    path: Path
    rows: slice

    @cached_property
    def _release(self) -> Array:
        return np.asarray(np.linalg.qr(self.path.release[self.rows])[0])

    def left(self, columns: Array) -> Array:
        """Rows of the unit without what its release absorbs.

        Args:
            columns: of the whole run, shape (rows, k) or (rows,).
        """
        own = columns[self.rows]
        return np.asarray(own - self._release @ (self._release.T @ own))


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the runs say of a kind.

    Args:
        ceiling: how much it closes.
        drop: of χ² on what was held out, dimensionless.
        precision: one over the variance of a coefficient in its prior, in the basis' units.
        solution: the coefficients, where one set holds in all runs.
    """

    ceiling: Ceiling
    drop: float
    precision: float
    solution: Ridge | None = None


class Unexplained:
    """What a fit leaves, and how much of it could be closed.

    Args:
        fit: of the answer.
    """

    def __init__(self, fit: Fit) -> None:
        self.fit = fit
        self.paths = paths(fit)
        self.ranges = bases.ranges(self.paths)
        ids = [run.id for run in fit.problem.data.runs]
        self.groups: list[tuple[int, ...]] = [
            tuple(ids.index(run) for run in group) for group in folds(fit.problem.data, len(ids))
        ]
        self.units = [Unit(path, slice(None)) for path in self.paths]
        self.held_out = RUNS
        if not self.groups:
            self.units = [unit for path in self.paths for unit in _stretches(path)]
            self.groups = [(i,) for i in range(len(self.units))]
            self.held_out = STRETCHES
        self.excess = fit.total - fit.count
        self.seen = np.zeros(len(self.units), bool)
        self.seen[[i for group in self.groups for i in group]] = True

    @cached_property
    def size(self) -> Array:
        """Scale of the model's own columns, shape (common,)."""
        sizes = [np.max(np.abs(path.nominal), axis=0) for path in self.paths]
        return np.asarray(np.maximum(np.max(sizes, axis=0), 1e-300))

    @cached_property
    def _free(self) -> list[Array]:
        return [unit.left(unit.path.nominal / self.size) for unit in self.units]

    def normals(self, columns: Sequence[Array]) -> list[Normal]:
        """Normal equations by unit.

        Args:
            columns: by run, shape (rows, k).
        """
        of = {id(path): matrix for path, matrix in zip(self.paths, columns, strict=True)}
        return [
            normal(Rows(free, unit.left(of[id(unit.path)]), unit.left(unit.path.residual)))
            for unit, free in zip(self.units, self._free, strict=True)
        ]

    def columns(self, kind: str) -> list[Array]:
        """Responses to a kind's basis, by run, shape (rows, k)."""
        basis = bases.COMMON[kind] if kind in bases.COMMON else bases.SINGLE[kind]
        if kind in bases.OF_READING:
            return [path.seen(basis(path, self.ranges) * self.ranges.angle) for path in self.paths]
        return [path.response(basis(path, self.ranges)) for path in self.paths]

    def share(self, after: Array) -> tuple[float, float]:
        """Share closed on what was held out, with its standard deviation from the scatter of the units.

        Args:
            after: χ² of every unit with the law, shape (units,).
        """
        drop = (self.before - after)[self.seen]
        # averaged rows have less noise than the residuals but all of the misfit; a stretch's own release takes some
        left = self._left_over + (self.before - self._power)
        return ratio(drop, left[self.seen])

    @cached_property
    def _power(self) -> Array:
        """χ² of every unit's rows in the fit, shape (units,)."""
        rows = [unit.path.residual[unit.rows] for unit in self.units]
        return np.array([float(own @ own) for own in rows])

    @cached_property
    def _alone(self) -> list[Normal]:
        return self.normals([np.zeros((path.residual.size, 0)) for path in self.paths])

    @cached_property
    def before(self) -> Array:
        """χ² of every unit predicted without it by the model alone, shape (units,)."""
        return held_out(self._alone, self.groups, None)

    @cached_property
    def _left_over(self) -> Array:
        """Excess of every unit's residuals in the fit."""
        whole = [self.fit.residuals[unit.path.index] for unit in self.units]
        return np.array([_excess_in(r, unit) for r, unit in zip(whole, self.units, strict=True)])

    def common(self, kind: str) -> Evidence:
        """A kind whose law holds in every run."""
        parts = self.normals(self.columns(kind))
        ridge = best_ridge(total(parts))
        after = held_out(parts, self.groups, ridge.precision)
        drop = float((self.before - after)[self.seen].sum())
        return Evidence(Ceiling(kind, *self.share(after), self.held_out), drop, ridge.precision, ridge)

    def single(self, kind: str) -> Evidence:
        """A kind that is different in every run: short gaps are predicted from what is around them."""
        runs = [Unit(path, slice(None)) for path in self.paths]
        columns = [unit.left(matrix) for unit, matrix in zip(runs, self.columns(kind), strict=True)]
        residuals = [unit.left(unit.path.residual) for unit in runs]
        parts = [_basis_only(c, r) for c, r in zip(columns, residuals, strict=True)]
        precision = common_precision(parts)
        drops = []
        for matrix, residual in zip(columns, residuals, strict=True):
            turn = gaps(residual.size)
            after = sum(_gap_cost(matrix, residual, turn == t, precision) for t in range(_TURNS))
            drops.append(float(residual @ residual) - after)
        left = [float(r @ r) - r.size for r in self.fit.residuals]
        closed, std = ratio(np.array(drops), np.array(left))
        return Evidence(Ceiling(kind, closed, std, GAPS), sum(drops), precision)


def gaps(size: int, group: int = 1) -> NDArray[np.int_]:
    """Which of the sets of short gaps left out in turn a sample belongs to.

    Args:
        size: number of samples.
        group: samples for each row of a `Path`.

    Returns:
        Numbers of the sets, shape (size,).
    """
    return np.arange(size) // (_GAP * group) % _TURNS


def _excess_in(residual: Array, unit: Unit) -> float:
    """Excess of the residuals of a unit: χ² less its number."""
    group = unit.path.group
    first, last, _ = unit.rows.indices(unit.path.residual.size)
    own = residual[first * group : None if unit.rows == slice(None) else last * group]
    return float(own @ own) - own.size


def _basis_only(columns: Array, residual: Array) -> Normal:
    return normal(Rows(np.zeros((residual.size, 0)), columns, residual))


def _gap_cost(matrix: Array, residual: Array, out: NDArray[np.bool_], precision: float) -> float:
    """χ² of the rows left out, predicted from the others."""
    solution = Ridge(_basis_only(matrix[~out], residual[~out]), precision).solution
    return float(np.sum((residual[out] - matrix[out] @ solution) ** 2))


def _stretches(path: Path) -> list[Unit]:
    """A run in stretches of some cycles."""
    cycles = path.residual.size * path.group * path.run.interval * path.omega / (2.0 * np.pi)
    edges = np.linspace(0, path.residual.size, max(2, min(_STRETCHES, int(cycles / 3.0))) + 1).astype(int)
    return [Unit(path, slice(int(a), int(b))) for a, b in pairwise(edges)]
