"""Regularised least squares in a basis, the noise known: evidence, curve and prediction of runs left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tunnel_sim.vocabulary.record import Array

_WIDTHS = np.geomspace(1e-5, 1e3, 33)  # prior standard deviations tried, in that of a column of unit response
_TINY = 1e-10


@dataclass(frozen=True, eq=False)
class Rows:
    """Residuals of one unit (a run) and what may explain them, its own release taken out.

    Args:
        free: columns without a prior, shape (rows, c).
        basis: columns with a prior, shape (rows, k).
        residual: shape (rows,).
    """

    free: Array
    basis: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of some rows.

    Args:
        matrix: free columns first, shape (c + k, c + k).
        gradient: shape (c + k,).
        power: sum of the squared residuals, dimensionless.
        free: number of columns without a prior.
    """

    matrix: Array
    gradient: Array
    power: float
    free: int

    def __sub__(self, other: Normal) -> Normal:
        """Without the other rows."""
        return Normal(
            self.matrix - other.matrix, self.gradient - other.gradient, self.power - other.power, self.free
        )

    def cost(self, solution: Array) -> float:
        """χ² with given coefficients, shape (c + k,)."""
        return float(self.power - 2.0 * solution @ self.gradient + solution @ self.matrix @ solution)


def normal(rows: Rows) -> Normal:
    """The normal equations of one unit.

    Args:
        rows: of the unit.
    """
    columns = np.column_stack([rows.free, rows.basis])
    return Normal(
        columns.T @ columns,
        columns.T @ rows.residual,
        float(rows.residual @ rows.residual),
        rows.free.shape[1],
    )


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
    """The solution for a prior of one width, coefficients independent and normal.

    Args:
        whole: the normal equations.
        precision: of the prior, one over the variance of a coefficient, in the basis' units.
    """

    whole: Normal
    precision: float

    @cached_property
    def _scaled(self) -> tuple[Array, Array]:
        """Scale of the columns, and the penalised matrix in it."""
        matrix = self.whole.matrix
        penalty = np.full(len(matrix), self.precision)
        penalty[: self.whole.free] = 0.0
        size = np.sqrt(np.maximum(np.diag(matrix) + penalty, 1e-300))
        scaled = (matrix + np.diag(penalty)) / np.outer(size, size)
        scaled += _TINY * np.eye(len(matrix))
        return size, scaled

    @cached_property
    def solution(self) -> Array:
        """Coefficients, shape (c + k,)."""
        size, scaled = self._scaled
        return np.asarray(np.linalg.solve(scaled, self.whole.gradient / size) / size)

    @cached_property
    def covariance(self) -> Array:
        """Of the coefficients, shape (c + k, c + k)."""
        size, scaled = self._scaled
        return np.asarray(np.linalg.inv(scaled) / np.outer(size, size))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """The basis with the free columns taken out, in its own axes."""

    values: Array
    along: Array

    def evidence(self, precision: float) -> float:
        """Twice the logarithm of the evidence over that without the basis."""
        shrunk = self.values / precision
        return float(np.sum(self.along**2 / (self.values + precision)) - np.sum(np.log1p(shrunk)))


def _spectrum(whole: Normal) -> _Spectrum:
    c = whole.free
    a, b, d = whole.matrix[:c, :c], whole.matrix[:c, c:], whole.matrix[c:, c:]
    size = np.sqrt(np.maximum(np.diag(a), 1e-300))
    inverse = np.linalg.pinv(a / np.outer(size, size), rcond=1e-11, hermitian=True) / np.outer(size, size)
    left = d - b.T @ inverse @ b
    along = whole.gradient[c:] - b.T @ inverse @ whole.gradient[:c]
    values, axes = np.linalg.eigh(0.5 * (left + left.T))
    keep = values > 1e-9 * max(float(values[-1]), 1e-300)
    return _Spectrum(values[keep], axes[:, keep].T @ along)


def best_ridge(whole: Normal) -> Ridge:
    """The width of the prior that the readings make most probable.

    Args:
        whole: all units.
    """
    spectrum = _spectrum(whole)
    if not spectrum.values.size:
        return Ridge(whole, 1e300)
    scale = 1.0 / float(spectrum.values[-1])
    tried = [(spectrum.evidence(1.0 / (scale * width)), 1.0 / (scale * width)) for width in _WIDTHS**2]
    return Ridge(whole, max(tried)[1])


def common_precision(parts: Sequence[Normal]) -> float:
    """One width of the prior for units with coefficients of their own.

    Args:
        parts: by unit.
    """
    spectra = [_spectrum(part) for part in parts]
    greatest = max(max(s.values, default=0.0) for s in spectra)
    if greatest <= 0.0:
        return 1e300
    tried = [greatest / float(width) for width in _WIDTHS**2]
    return max(tried, key=lambda precision: sum(s.evidence(precision) for s in spectra))


def held_out(parts: Sequence[Normal], groups: Sequence[Sequence[int]], precision: float | None) -> Array:
    """χ² of every unit predicted without its group; of the fit to all units where it is in no group.

    Args:
        parts: by unit.
        groups: indices of the units left out together.
        precision: of the prior, as in `Ridge`, in the basis' units; None: the free columns alone.

    Returns:
        Shape (units,).
    """
    whole = total(parts)
    costs = np.array([part.cost(_solve(whole, precision)) for part in parts])
    for group in groups:
        solution = _solve(whole - total([parts[i] for i in group]), precision)
        for i in group:
            costs[i] = parts[i].cost(solution)
    return costs


def _solve(whole: Normal, precision: float | None) -> Array:
    if precision is not None:
        return Ridge(whole, precision).solution
    c = whole.free
    alone = Normal(whole.matrix[:c, :c], whole.gradient[:c], whole.power, c)
    found = np.zeros(whole.gradient.size)
    found[:c] = Ridge(alone, 0.0).solution
    return found


def ratio(drop: Array, left: Array) -> tuple[float, float]:
    """Share of what was left that is closed.

    Args:
        drop: of χ², by unit, shape (units,).
        left: excess before, by unit, shape (units,).

    Returns:
        Sum over sum, and its standard deviation from the scatter of the units.
    """
    whole = max(float(left.sum()), 1e-9)
    closed = float(drop.sum()) / whole
    scatter = float(np.sum((drop - closed * left) ** 2))
    return closed, float(np.sqrt(scatter * drop.size / max(drop.size - 1, 1)) / whole)
