"""Share of the residual that each kind of law could explain, on held-out readings.

A law is a sum of the columns of a basis, fitted by regularised least squares with the noise known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.paths import COMMON, OF_READING, SINGLE, Path, paths, ranges
from diagnosis.model.data import folds
from tunnel_sim.vocabulary.record import Array

KNOWN_TO: Final = 0.5
"""Maximum standard deviation of a law's explained share for the share to be determined. Judgement."""
CLOSES_AT_MOST: Final = 1.5
"""Maximum explained share of a law that counts as determined. Judgement. Laws may explain more than all of a
small excess."""

KINDS = (
    "angle", "rate", "state", "wind", "time", "reading", "line", "between", "event", "wander", "noise",
)  # fmt: skip
"""Kinds of missing law; ``noise`` where no other kind explains much."""

INCLUDED_IN = {"angle": "state", "rate": "state"}
"""Kinds that are special cases of another, by that kind."""


@dataclass(frozen=True)
class Ceiling:
    """The greatest share that one kind of law could explain.

    Args:
        kind: one of `KINDS`.
        closed: share of the residual, on held-out readings; negative where the prediction is worse.
        std: standard deviation of the share, from the scatter of the runs.
    """

    kind: str
    closed: float
    std: float
    held_out: str

    def determined(self) -> bool:
        """Whether the share is known well enough; laws may explain more than the whole of a small excess."""
        return self.std < KNOWN_TO and self.closed < CLOSES_AT_MOST


_WIDTHS = np.geomspace(1e-5, 1e3, 33)  # tried prior standard deviations, over a unit response's column
_TINY = 1e-10


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of some rows.

    Args:
        matrix: free columns first, shape (c + k, c + k).
        gradient: gradient, shape (c + k,).
        power: sum of the squared residuals, dimensionless.
        free: number of columns without a prior.
    """

    matrix: Array
    gradient: Array
    power: float
    free: int

    def __sub__(self, other: Normal) -> Normal:
        """The normal equations without the given rows."""
        return Normal(
            self.matrix - other.matrix, self.gradient - other.gradient, self.power - other.power, self.free
        )

    def cost(self, solution: Array) -> float:
        """χ² with given coefficients, shape (c + k,)."""
        return float(self.power - 2.0 * solution @ self.gradient + solution @ self.matrix @ solution)


def normal(residual: Array, basis: Array, free: Array | None = None) -> Normal:
    """The normal equations of one unit, its release projected out.

    Args:
        residual: shape (rows,).
        basis: columns with a prior, shape (rows, k).
        free: columns without a prior, shape (rows, c); None where there are none.
    """
    free = np.zeros((residual.size, 0)) if free is None else free
    columns = np.column_stack([free, basis])
    return Normal(columns.T @ columns, columns.T @ residual, float(residual @ residual), free.shape[1])


def total(parts: Sequence[Normal]) -> Normal:
    """The normal equations of several units."""
    return Normal(
        np.sum([p.matrix for p in parts], axis=0),
        np.sum([p.gradient for p in parts], axis=0),
        sum(p.power for p in parts),
        parts[0].free,
    )


@dataclass(frozen=True, eq=False)
class Ridge:
    """The solution for a prior of one width; coefficients are independent and normal.

    Args:
        precision: precision of the prior, one over the variance of a coefficient, in the basis' units.
    """

    normal: Normal
    precision: float

    @cached_property
    def _scaled(self) -> tuple[Array, Array]:
        """Scale of the columns, and the penalised matrix in it."""
        matrix = self.normal.matrix
        penalty = np.full(len(matrix), self.precision)
        penalty[: self.normal.free] = 0.0
        size = np.sqrt(np.maximum(np.diag(matrix) + penalty, 1e-300))
        scaled = (matrix + np.diag(penalty)) / np.outer(size, size)
        scaled += _TINY * np.eye(len(matrix))
        return size, scaled

    @cached_property
    def solution(self) -> Array:
        """Coefficients, shape (c + k,)."""
        size, scaled = self._scaled
        return np.asarray(np.linalg.solve(scaled, self.normal.gradient / size) / size)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the coefficients, shape (c + k, c + k)."""
        size, scaled = self._scaled
        return np.asarray(np.linalg.inv(scaled) / np.outer(size, size))


def _spectrum(whole: Normal) -> tuple[Array, Array]:
    """Eigenvalues of the basis with the free columns projected out, and the gradient along their axes."""
    c = whole.free
    a, b, d = whole.matrix[:c, :c], whole.matrix[:c, c:], whole.matrix[c:, c:]
    size = np.sqrt(np.maximum(np.diag(a), 1e-300))
    inverse = np.linalg.pinv(a / np.outer(size, size), rcond=1e-11, hermitian=True) / np.outer(size, size)
    left = d - b.T @ inverse @ b
    along = whole.gradient[c:] - b.T @ inverse @ whole.gradient[:c]
    values, axes = np.linalg.eigh(0.5 * (left + left.T))
    keep = values > 1e-9 * max(float(values[-1]), 1e-300)
    return values[keep], axes[:, keep].T @ along


def _log_evidence(values: Array, along: Array, precision: float) -> float:
    """Twice the logarithm of the ratio of evidences with and without the basis."""
    return float(np.sum(along**2 / (values + precision)) - np.sum(np.log1p(values / precision)))


def best_ridge(whole: Normal) -> Ridge:
    """The prior width of greatest evidence."""
    values, along = _spectrum(whole)
    if not values.size:
        return Ridge(whole, 1e300)
    scale = 1.0 / float(values[-1])
    tried = [1.0 / (scale * float(width)) for width in _WIDTHS**2]
    return Ridge(whole, max((_log_evidence(values, along, precision), precision) for precision in tried)[1])


def held_out(parts: Sequence[Normal], groups: Sequence[Sequence[int]], precision: float | None) -> Array:
    """χ² of every unit, predicted without the unit's group; units in no group are fitted. Shape (units,).

    Args:
        groups: indices of the units left out together.
        precision: of the prior, as in `Ridge`, in the basis' units; None: the free columns alone.
    """

    def solved(whole: Normal) -> Array:
        if precision is not None:
            return Ridge(whole, precision).solution
        c = whole.free
        alone = Normal(whole.matrix[:c, :c], whole.gradient[:c], whole.power, c)
        return np.pad(Ridge(alone, 0.0).solution, (0, whole.gradient.size - c))

    whole = total(parts)
    solution = solved(whole)
    costs = np.array([part.cost(solution) for part in parts])
    for group in groups:
        solution = solved(whole - total([parts[i] for i in group]))
        for i in group:
            costs[i] = parts[i].cost(solution)
    return costs


def ratio(drop: Array, left: Array) -> tuple[float, float]:
    """Explained share of the residual, and its standard deviation from the scatter of the units.

    Args:
        drop: drop of χ², by unit, shape (units,).
        left: excess before the drop, by unit, shape (units,).
    """
    whole = max(float(left.sum()), 1e-9)
    closed = float(drop.sum()) / whole
    scatter = float(np.sum((drop - closed * left) ** 2))
    return closed, float(np.sqrt(scatter * drop.size / max(drop.size - 1, 1)) / whole)


GAPS = "short gaps"
_STRETCHES = 6  # number of stretches in a run, where no run can be held out
_GAP = 3  # rows: an eighth of a cycle
_TURNS = 3


@dataclass(frozen=True, eq=False)
class Unit:
    """A part with its own release: a run, or a stretch of its rows."""

    path: Path
    rows: slice

    @cached_property
    def _release(self) -> Array:
        return np.asarray(np.linalg.qr(self.path.release[self.rows])[0])

    def without_release(self, columns: Array) -> Array:
        """Rows of the unit, its release projected out.

        Args:
            columns: columns of the whole run, shape (rows, k) or (rows,).
        """
        own = columns[self.rows]
        return np.asarray(own - self._release @ (self._release.T @ own))


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence of the runs for a kind of law.

    Args:
        drop: of χ² on held-out readings, dimensionless.
        precision: one over the variance of a coefficient in its prior, in the basis' units.
        solution: the coefficients, where one set applies to all runs.
    """

    ceiling: Ceiling
    drop: float
    precision: float
    solution: Ridge | None = None


class Unexplained:
    """The residual of an answer's fit, and the share of it that laws could explain."""

    def __init__(self, fit: Fit) -> None:
        self.fit = fit
        self.paths = paths(fit)
        self.ranges = ranges(self.paths)
        ids = [run.id for run in fit.problem.data.runs]
        self.groups: list[tuple[int, ...]] = [
            tuple(ids.index(run) for run in group) for group in folds(fit.problem.data, len(ids))
        ]
        self.runs = [Unit(path, slice(None)) for path in self.paths]
        self.units, self.held_out = self.runs, "runs"
        if not self.groups:
            self.units, self.held_out = [], "stretches of time"
            for path in self.paths:
                size = path.residual.size
                cycles = size * path.group * path.run.interval * path.omega / (2.0 * np.pi)
                edges = np.linspace(0, size, max(2, min(_STRETCHES, int(cycles / 3.0))) + 1).astype(int)
                self.units += [Unit(path, slice(int(a), int(b))) for a, b in pairwise(edges)]
            self.groups = [(i,) for i in range(len(self.units))]
        self.seen = np.zeros(len(self.units), bool)
        self.seen[[i for group in self.groups for i in group]] = True
        sizes = [np.max(np.abs(path.nominal), axis=0) for path in self.paths]
        #: scale of the model's own columns, shape (common,)
        self.size = np.maximum(np.max(sizes, axis=0), 1e-300)
        self._free = [unit.without_release(unit.path.nominal / self.size) for unit in self.units]

    def normals(self, columns: Sequence[Array]) -> list[Normal]:
        """Normal equations by unit; the columns are by run, shape (rows, k)."""
        return [
            normal(
                unit.without_release(unit.path.residual), unit.without_release(columns[unit.path.index]), free
            )
            for unit, free in zip(self.units, self._free, strict=True)
        ]

    def columns(self, kind: str) -> list[Array]:
        """Responses to a kind's basis, by run, shape (rows, k)."""
        basis = {**COMMON, **SINGLE}[kind]
        if kind in OF_READING:
            reach = self.ranges.angle
            return [path.reading_rows(basis(path.fitted, self.ranges) * reach) for path in self.paths]
        return [path.response(basis(path, self.ranges)) for path in self.paths]

    @cached_property
    def before(self) -> Array:
        """χ² of every unit, predicted without it by the model alone, shape (units,)."""
        alone = self.normals([np.zeros((path.residual.size, 0)) for path in self.paths])
        return held_out(alone, self.groups, None)

    @cached_property
    def _left(self) -> Array:
        """Excess that laws could explain in every unit, shape (units,).

        Averaged rows have less noise than the residuals but the whole misfit; the release of a stretch absorbs
        a part of it.
        """
        over, power = [], []
        for unit in self.units:
            rows, group = unit.path.residual[unit.rows], unit.path.group
            first, last, _ = unit.rows.indices(unit.path.residual.size)
            whole = unit.rows == slice(None)
            own = self.fit.residuals[unit.path.index][first * group : None if whole else last * group]
            over.append(float(own @ own) - own.size)
            power.append(float(rows @ rows))
        return np.asarray(np.array(over) + (self.before - np.array(power)), np.float64)

    def common(self, kind: str) -> Evidence:
        """A kind with one law for all runs; the scatter of the units gives the standard deviation."""
        parts = self.normals(self.columns(kind))
        ridge = best_ridge(total(parts))
        drop = (self.before - held_out(parts, self.groups, ridge.precision))[self.seen]
        ceiling = Ceiling(kind, *ratio(drop, self._left[self.seen]), self.held_out)
        return Evidence(ceiling, float(drop.sum()), ridge.precision, ridge)

    def single(self, kind: str) -> Evidence:
        """A kind that differs from run to run; short gaps in a run are predicted from their surroundings."""
        columns = [
            unit.without_release(matrix) for unit, matrix in zip(self.runs, self.columns(kind), strict=True)
        ]
        residuals = [unit.without_release(unit.path.residual) for unit in self.runs]
        # one precision of the prior, as in `Ridge`, for units with their own coefficients
        spectra = [_spectrum(normal(r, c)) for r, c in zip(residuals, columns, strict=True)]
        greatest = max(max(values, default=0.0) for values, _ in spectra)
        tried = [greatest / float(width) for width in _WIDTHS**2] if greatest > 0.0 else [1e300]
        precision = max(tried, key=lambda p: sum(_log_evidence(*each, p) for each in spectra))
        drops = []
        for matrix, residual in zip(columns, residuals, strict=True):
            turn, after = gaps(residual.size), 0.0
            for out in (turn == number for number in range(_TURNS)):
                solution = Ridge(normal(residual[~out], matrix[~out]), precision).solution
                after += float(np.sum((residual[out] - matrix[out] @ solution) ** 2))
            drops.append(float(residual @ residual) - after)
        left = [float(r @ r) - r.size for r in self.fit.residuals]
        closed, std = ratio(np.array(drops), np.array(left))
        return Evidence(Ceiling(kind, closed, std, GAPS), sum(drops), precision)


def gaps(size: int, group: int = 1) -> NDArray[np.int_]:
    """Sets of short gaps to be left out in turn; each gap has ``size`` samples, and ``group`` gaps are in a row."""
    return np.arange(size) // (_GAP * group) % _TURNS
