"""Errors of a model as a basis of changes of the readings, and the log evidence of a fit under these errors.

r = J δ + B a + e: residuals of a fit, its sensitivities, and a basis with coefficients a of standard deviation
η. B has moments of the angle and the rate, the same in the wind, moments that change in time, errors of the
reading, and slow modulations of every run's own harmonics. Each of these five kinds has an equal part of the
prior power. η² is the power of the model's error over the power of the gap. Rows are averages of the residuals,
24 in a cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import block_diag, solve_triangular

from diagnosis.likelihood.paths import Path, Ranges, paths, ranges

Array = NDArray[np.float64]

ETA: Array = np.geomspace(1e-3, 3.0, 36)
"""Grid of η, the rms of the model's error over the rms of the gap."""
# number of retained directions of the basis, of the greatest power beside the nominal model
_DIRECTIONS = 260
_WIDE, _SETTLED = 33.0, 0.02
_NUISANCE = 100.0  # prior power of a nominal parameter, in gaps


@dataclass(frozen=True, eq=False)
class Linear:
    """A fit near its optimum.

    Args:
        residual: residual in standard deviations of the noise, shape (rows,).
        slopes: derivatives of the prediction to its parameters, shape (rows, p).
        nominal: whether each parameter belongs to the nominal model, shape (p,).
        own: number of runs that share the power of each parameter, shape (p,); 1 for common parameters.
    """

    residual: Array
    slopes: Array
    nominal: NDArray[np.bool_]
    own: Array


def linear(fit: Any, along: Sequence[Path]) -> Linear:
    """Rows of a fit: its common parameters first, then the parameters of every run.

    Args:
        fit: fit of the diagnosis, to the runs of ``along``.
        along: paths of the nominal fit, which define the averaging of residuals.
    """
    residuals, slopes, problem = fit.residuals, fit.jacobian, fit.problem
    common = np.concatenate([p.rows(c) for p, (c, _) in zip(along, slopes, strict=True)])
    own = block_diag(*[p.rows(o) for p, (_, o) in zip(along, slopes, strict=True)])
    runs, width = len(along), slopes[0][1].shape[1]
    first = np.arange(common.shape[1]) < len(problem.names) - len(problem.effect_names)
    return Linear(
        np.concatenate([p.rows(r) for p, r in zip(along, residuals, strict=True)]),
        np.column_stack([common, own]),
        np.concatenate([first, np.tile(np.arange(width) < width - problem.parameters.of_effects, runs)]),
        np.concatenate([np.ones(common.shape[1]), np.full(width * runs, float(runs))]),
    )


@dataclass(frozen=True, eq=False)
class ErrorEvidence:
    """The evidence of a fit for each size of the model's error.

    Args:
        log: log evidence for every ``ETA``, shape (36,).
        error_share: expected share of the gap that the model's error has beside the parameters, shape (36,).
        alone: residual χ² of the parameters without any error of the model.
        occam: log of the posterior's volume over the prior's.
    """

    log: Array
    error_share: Array
    alone: float
    occam: float


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """The error of the nominal model in one campaign.

    Args:
        along: paths of the nominal fit, which define the averaging of residuals.
        gap: χ² of the nominal fit in excess of noise.
        nominal_std: prior standard deviations of the nominal parameters, as in `Linear`.
        basis: B, with the power of the gap beside the nominal parameters, shape (rows, k).
    """

    along: Sequence[Path]
    gap: float
    nominal_std: Array
    basis: Array

    @classmethod
    def of(cls, nominal: Any) -> Discrepancy:
        """The error of a nominal model, from its fit in the diagnosis."""
        along = paths(nominal)
        base = linear(nominal, along)
        gap = max(nominal.total - nominal.count, 1e-3 * nominal.count)
        power = np.sum(base.slopes**2, axis=0)
        known = np.linalg.qr(base.slopes / np.maximum(np.sqrt(power), 1e-150))[0]
        kinds = []
        for columns in _kinds(along):
            left = float(np.sum((columns - known @ (known.T @ columns)) ** 2))
            if left > 0.0:
                kinds.append(columns / np.sqrt(left))
        basis = np.column_stack(kinds) * np.sqrt(gap / len(kinds))
        beside = basis - known @ (known.T @ basis)
        values, axes = np.linalg.eigh(beside.T @ beside)
        kept = np.flatnonzero(values > 1e-6 * values[-1])[-_DIRECTIONS:]
        return cls(along, gap, np.sqrt(_NUISANCE * gap / np.maximum(power, 1e-300)), basis @ axes[:, kept])

    @cached_property
    def _own(self) -> Array:
        return np.asarray(self.basis.T @ self.basis)

    def evidence(self, given: Linear) -> ErrorEvidence:
        """Log evidence of a fit; the prior power of further parameters equals the gap's.

        Args:
            given: rows from `linear`, with the nominal parameters in the order of the nominal fit.
        """
        scaled, r, basis = given.slopes * self._prior(given), given.residual, self.basis
        root = np.linalg.cholesky(scaled.T @ scaled + np.eye(scaled.shape[1]))
        seen = solve_triangular(root, scaled.T @ r, lower=True)
        cross = solve_triangular(root, scaled.T @ basis, lower=True)
        left = self._own - cross.T @ cross
        w, axes = np.linalg.eigh(0.5 * (left + left.T))
        w, z = np.maximum(w, 0.0), axes.T @ (basis.T @ r - cross.T @ seen)
        e2 = ETA[:, None] ** 2
        alone, occam = float(r @ r - seen @ seen), -float(np.sum(np.log(np.diag(root))))
        gain = np.sum(e2 * z**2 / (1.0 + e2 * w) - np.log1p(e2 * w), axis=1)
        power = np.sum((e2 * z / (1.0 + e2 * w)) ** 2 * w + e2 * w / (1.0 + e2 * w), axis=1)
        return ErrorEvidence(-0.5 * alone + occam + 0.5 * gain, power / self.gap, alone, occam)

    def _prior(self, given: Linear) -> Array:
        """Prior standard deviations of the parameters, shape (p,)."""
        found = np.empty(given.nominal.size)
        found[given.nominal] = self.nominal_std
        own = given.slopes[:, given.nominal]
        own = own / np.maximum(np.linalg.norm(own, axis=0), 1e-300)
        causes = given.slopes[:, ~given.nominal]
        cross = own.T @ causes
        whole = np.sum(causes**2, axis=0)
        beside = whole - np.sum(
            cross * np.linalg.solve(own.T @ own + 1e-10 * np.eye(own.shape[1]), cross), axis=0
        )
        power = np.maximum(beside, 1e-8 * whole + 1e-300) * given.own[~given.nominal]
        found[~given.nominal] = np.sqrt(self.gap / power)
        return found


def _kinds(along: Sequence[Path]) -> list[Array]:
    """Rows of the five kinds of error, each of shape (rows, k)."""
    r = ranges(along)
    moments = [_moment(p, r) for p in along]
    windy = [m * (p.speed / r.speed) ** 2 for p, m in zip(along, moments, strict=True)]
    common = [
        [p.response(m) for p, m in zip(along, moments, strict=True)],
        [p.response(m) for p, m in zip(along, windy, strict=True)],
        [p.response(_in_time(p, r)) for p in along],
        [p.reading_rows(_reading(p, r)) for p in along],
    ]
    found = [*(np.concatenate(kind) for kind in common), block_diag(*[_modulation(p) for p in along])]
    return [columns[:, np.any(columns != 0.0, axis=0)] for columns in found]


def _moment(at: Path, r: Ranges) -> Array:
    spring, share = at.stiffness / r.stiffness - 1.0, at.rate / r.rate
    wide = [
        _splines(v, -reach, reach, n) * (_WIDE / n)
        for v, reach in ((at.angle, r.angle), (at.rate, r.rate))
        for n in (15, 7)
    ]
    angle, rate = _splines(at.angle, -r.angle, r.angle, 7), _splines(at.rate, -r.rate, r.rate, 7)
    shapes = np.column_stack([share, np.tanh(share / _SETTLED), np.abs(share)])
    return np.column_stack([*wide, spring * angle, shapes, _products(angle, rate)])


def _in_time(at: Path, r: Ranges) -> Array:
    angle, spring = at.angle / r.angle, at.stiffness / r.stiffness - 1.0
    shapes = [np.ones(angle.size), angle, at.rate / r.rate, spring * angle, (at.speed / r.speed) ** 2 * angle]
    return _products(_splines(at.time, 0.0, r.time, 8), np.column_stack(shapes))


def _reading(at: Path, r: Ranges) -> Array:
    angle, rate = (at.angle, -r.angle, r.angle), (at.rate, -r.rate, r.rate)
    both = _products(_splines(*angle, 7), _splines(*rate, 5))
    return np.column_stack([_splines(*angle, 15), _splines(*rate, 7), both]) * r.angle


def _modulation(at: Path) -> Array:
    """Slow modulations of a run's mean and first three harmonics, in proportion to the amplitude."""
    z = at.angle - np.mean(at.angle) + 1j * at.rate / at.omega
    size = np.abs(z) + 1e-9
    shapes = [size, z.real, z.imag, (z**2 / size).real, (z**2 / size).imag]
    shapes += [(z**3 / size**2).real, (z**3 / size**2).imag]
    slow = _splines(at.time, float(at.time[0]), float(at.time[-1]), 5)
    return at.reading_rows(_products(np.column_stack(shapes), slow))


def _splines(values: Array, low: float, high: float, count: int) -> Array:
    """Cubic B-splines on even knots, shape (n, count); values outside the range are clipped."""
    knots = np.concatenate([[low] * 3, np.linspace(low, high, count - 2), [high] * 3])
    return np.asarray(BSpline.design_matrix(np.clip(values, low, high), knots, 3).toarray())


def _products(one: Array, other: Array) -> Array:
    return np.asarray((one[:, :, None] * other[:, None, :]).reshape(one.shape[0], -1))
