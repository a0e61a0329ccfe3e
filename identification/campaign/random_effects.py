"""Chance differences between runs as random effects: the likelihood of widths, and the resulting uncertainty.

Run i is measured as z_i = J_i δ + D_i e_i + noise of unit variance, with common parameters δ and the run's own
deviations e_i ~ N(0, S²), S = diag(widths). The run's other unknowns, such as its release, are first projected out
of every column. The deviations are integrated out exactly, since the model is linear (Pinheiro and Bates,
Mixed-Effects Models in S and S-PLUS, Springer 2000, chapter 2; Harville, J. Am. Stat. Assoc. 72 (1977) 320, doi
10.1080/01621459.1977.10480998).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.policy import REPEATING
from tunnel_sim.vocabulary.between_runs import USUAL_SCATTER
from tunnel_sim.vocabulary.record import Array

_ABSORBED = 1e-13  # share of a column's power below which deviations of the runs absorb all of it
_RIDGE = 1e-11  # ridge on the scaled normal matrix: undetermined parameters do not influence the widths
_NULL = 1e-11  # eigenvalue of the scaled normal matrix, relative to the largest, that counts as zero


@dataclass(frozen=True, eq=False)
class RunProducts:
    """Products of the columns of every run, its other unknowns projected out.

    Args:
        own: Dᵀ D, shape (runs, k, k).
        mixed: Dᵀ J, shape (runs, k, common).
        common: Jᵀ J, shape (runs, common, common).
        own_seen: Dᵀ z, shape (runs, k).
        common_seen: Jᵀ z, shape (runs, common).
        power: zᵀ z, shape (runs,).
    """

    own: Array
    mixed: Array
    common: Array
    own_seen: Array
    common_seen: Array
    power: Array

    @classmethod
    def of(cls, own: Sequence[Array], common: Sequence[Array], seen: Sequence[Array]) -> RunProducts:
        """The products of columns.

        Args:
            own: D of every run, shape (n, k).
            common: J of every run, shape (n, common).
            seen: z of every run, shape (n,).
        """
        rows = list(zip(own, common, seen, strict=True))
        return cls(
            np.stack([d.T @ d for d, _, _ in rows]),
            np.stack([d.T @ j for d, j, _ in rows]),
            np.stack([j.T @ j for _, j, _ in rows]),
            np.stack([d.T @ z for d, _, z in rows]),
            np.stack([j.T @ z for _, j, z in rows]),
            np.array([float(z @ z) for *_, z in rows]),
        )


@dataclass(frozen=True, eq=False)
class Marginal:
    """The runs with given widths, their deviations integrated out.

    Args:
        log_determinant: Σ ln|I + S Dᵀ D S|, dimensionless: the cost of free deviations.
        quadratic: χ² with the most likely deviations, plus their squares over their variances; dimensionless.
        common: the most likely δ, shape (common,).
        covariance: its covariance, shape (common, common).
        deviations: the most likely deviations of every run, shape (runs, k).
        log_information: ln|H| of the normal matrix H of the common parameters, for the restricted likelihood;
            dimensionless.
        slope: derivative of `restricted` with respect to ln(widths), shape (k,).
    """

    log_determinant: float
    quadratic: float
    common: Array
    covariance: Array
    deviations: Array
    log_information: float
    slope: Array

    @property
    def likelihood(self) -> float:
        """−2 ln L at the most likely common parameters, up to a constant: compares sets of common parameters."""
        return self.log_determinant + self.quadratic

    def log_information_given(self, given: NDArray[np.bool_]) -> float:
        """ln|H| of the remaining common parameters when some are given.

        If the given parameters are not determined separately, a floor keeps the value finite; it is the same
        for all widths.

        Args:
            given: the given parameters, shape (common,); each must have a variance above 0.
        """
        covariance = self.covariance[np.ix_(given, given)]
        size = np.sqrt(np.diag(covariance))
        correlation = np.linalg.eigvalsh(covariance / np.outer(size, size))
        return self.log_information + float(
            2.0 * np.log(size).sum() + np.log(np.maximum(correlation, _NULL)).sum()
        )

    @property
    def restricted(self) -> float:
        """−2 ln L with the common parameters integrated out, up to a constant: compares widths."""
        return self.likelihood + self.log_information


def marginal(runs: RunProducts, widths: Array) -> Marginal:
    """Integrate out the runs' deviations.

    Args:
        widths: standard deviations of the deviations, shape (k,), all above 0.
    """
    scaled = widths[None, :, None] * runs.own * widths
    inverse = np.linalg.inv(np.eye(widths.size) + scaled)
    weight = widths[None, :, None] * inverse * widths  # W = (S⁻² + DᵀD)⁻¹
    weighted = weight @ runs.mixed
    normal = (runs.common - np.swapaxes(runs.mixed, 1, 2) @ weighted).sum(axis=0)
    seen = (runs.common_seen - np.einsum("rkp,rk->rp", weighted, runs.own_seen)).sum(axis=0)
    seen_at_all = np.diag(normal) > _ABSORBED * np.diagonal(runs.common, axis1=1, axis2=2).sum(axis=0)
    size = np.sqrt(np.where(seen_at_all, np.diag(normal), 1.0))
    scaled_normal = np.where(np.outer(seen_at_all, seen_at_all), normal / np.outer(size, size), 0.0)
    values, vectors = np.linalg.eigh(scaled_normal)
    kept = values > _NULL * values[-1] if values.size else np.zeros(0, bool)
    root = vectors[:, kept] / np.sqrt(values[kept]) / size[:, None]
    covariance = root @ root.T
    common = covariance @ seen
    own = np.einsum("rkl,rl->rk", weight, runs.own_seen) - weighted @ common
    alone = np.einsum("rk,rkl,rl->", runs.own_seen, weight, runs.own_seen)
    spread = np.einsum("rkp,pq,rkq->k", weighted, covariance, weighted)
    gained = 2.0 * len(runs.own) - 2.0 * np.einsum("rkk->k", inverse)
    return Marginal(
        float(-np.linalg.slogdet(inverse)[1].sum()),
        float(runs.power.sum() - alone - common @ seen),
        common,
        covariance,
        own,
        float(np.log(values[kept]).sum() + 2.0 * np.log(size).sum()),
        np.asarray(gained - 2.0 * ((own**2).sum(axis=0) + spread) / widths**2, np.float64),
    )


@dataclass(frozen=True, eq=False)
class WidthPrior:
    """Prior of the widths: ln(width) is normal within bounds, and a width may be far below the usual one.

    Some rigs, simulated ones among them, repeat exactly. From `REPEATING` standard deviations below the median down
    to the least width, the density is constant.

    Args:
        usual: medians, shape (k,).
        decades: standard deviation of log10(width), shape (k,); 0: the width is as stated.
        least: least widths, shape (k,); far below what the runs show.
        most: greatest widths, shape (k,).
    """

    usual: Array
    decades: Array
    least: Array
    most: Array

    def cost(self, widths: Array) -> float:
        """−2 ln of the density of ln(widths), up to a constant."""
        return float(np.sum(self._away(widths) ** 2))

    def slope(self, widths: Array) -> Array:
        """Derivative of `cost` with respect to ln(widths), shape (k,)."""
        away = self._away(widths)
        falls = np.where(away > -REPEATING, away, 0.0)
        return np.asarray(2.0 * falls / np.maximum(self._spread, 1e-9), np.float64)

    @property
    def free(self) -> np.ndarray:
        """Which widths are not stated, shape (k,)."""
        return self.decades > 0.0

    @property
    def _spread(self) -> Array:
        return np.asarray(self.decades * np.log(10.0), np.float64)

    def _away(self, widths: Array) -> Array:
        away = np.log(widths / self.usual) / np.where(self.free, self._spread, 1.0)
        return np.where(self.free, np.maximum(away, -REPEATING), 0.0)


def likeliest_widths(runs: RunProducts, prior: WidthPrior, start: Array | None = None) -> Array:
    """The widths of greatest restricted likelihood times prior, shape (k,); stated widths are unchanged.

    Args:
        start: start of the search, shape (k,); None: the usual widths.
    """
    from scipy.optimize import minimize  # imported here because it is slow to load

    free = np.flatnonzero(prior.free)
    widths = np.clip(prior.usual if start is None else start, prior.least, prior.most)
    widths = np.where(prior.free, widths, prior.usual)
    if not free.size:
        return widths

    def at(logs: Array) -> tuple[float, Array]:
        tried = widths.copy()
        tried[free] = np.exp(logs)
        found = marginal(runs, tried)
        return found.restricted + prior.cost(tried), (found.slope + prior.slope(tried))[free]

    bounds = list(zip(np.log(prior.least[free]), np.log(prior.most[free]), strict=True))
    found = minimize(at, np.log(widths[free]), jac=True, method="L-BFGS-B", bounds=bounds)
    widths[free] = np.exp(found.x)
    return widths


@dataclass(frozen=True)
class UsualWidths:
    """Prior of widths that are not stated: judgements on rigs in general.

    Args:
        wind_speed: one standard deviation, a fraction.
        spring_stiffness: one standard deviation, a fraction.
        mechanical_damping: one standard deviation, a fraction.
        decades: standard deviation of log10(width), dimensionless: one rig in twenty is ten times as good or bad.
        least: least width considered, over the usual one; a ratio.
        most: greatest width considered, over the usual one; a ratio.
    """

    wind_speed: float = USUAL_SCATTER["wind_speed"]
    spring_stiffness: float = USUAL_SCATTER["spring_stiffness"]
    mechanical_damping: float = USUAL_SCATTER["mechanical_damping"]
    decades: float = 0.5
    least: float = 1e-3
    most: float = 20.0

    def prior(self, names: Sequence[str], stated: Mapping[str, float]) -> WidthPrior:
        """Prior of the widths of some deviations.

        Args:
            names: of `SCATTERED`.
            stated: relative standard deviations that the campaign states, by name; used unchanged.
        """
        usual = np.array([getattr(self, name) for name in names], np.float64)
        least = self.least * usual
        known = np.array([stated.get(name, 0.0) for name in names])
        free = np.array([name not in stated for name in names], bool)
        middle = np.where(free, usual, np.maximum(known, 1e-6 * usual))  # a width of zero has no derivative
        return WidthPrior(middle, np.where(free, self.decades, 0.0), least, self.most * usual)


_GRID = 15  # number of widths in each direction
_REACH = (40.0, 8.0)  # reach of the grid below and above the most likely width, as ratios
_AT_ONCE = 1500  # points of the grid
_NEGLIGIBLE = 1e-4  # density relative to the greatest; the second grid covers only larger densities


def width_quantiles(runs: RunProducts, prior: WidthPrior, levels: Sequence[float]) -> Array:
    """Quantiles of every width given the runs, with the other widths integrated out.

    Args:
        levels: levels of the quantiles, fractions.

    Returns:
        Widths, shape (levels, k); a stated width is the same at every level.
    """
    best = likeliest_widths(runs, prior)
    limits = [
        (max(least, width / _REACH[0]), min(most, width * _REACH[1])) if free else (width, width)
        for width, free, least, most in zip(best, prior.free, prior.least, prior.most, strict=True)
    ]
    axes = _axes(limits)
    density = _density(runs, prior, axes)
    for k, axis in enumerate(axes):  # a second grid over the region of density of the first
        inside = np.flatnonzero(_along(density, k) > _NEGLIGIBLE * _along(density, k).max())
        limits[k] = float(axis[max(inside[0] - 1, 0)]), float(axis[min(inside[-1] + 1, axis.size - 1)])
    axes = _axes(limits)
    density = _density(runs, prior, axes)
    found = np.empty((len(levels), best.size))
    for k, axis in enumerate(axes):
        share = _along(density, k)
        total = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]))])
        level = total / total[-1] if axis.size > 1 else np.ones(1)
        found[:, k] = np.exp(np.interp(levels, level, np.log(axis)))
    return found


def _axes(limits: Sequence[tuple[float, float]]) -> list[Array]:
    """Widths of each number between its limits, evenly spaced in the logarithm; one where the limits are equal."""
    return [np.geomspace(low, high, _GRID) if high > low else np.array([low]) for low, high in limits]


def _density(runs: RunProducts, prior: WidthPrior, axes: Sequence[Array]) -> Array:
    """Density of the logarithms of the widths over a grid, scaled to a maximum of 1, of the axes' shape."""
    points = np.stack([one.ravel() for one in np.meshgrid(*axes, indexing="ij")], axis=1)
    parts = [points[i : i + _AT_ONCE] for i in range(0, len(points), _AT_ONCE)]
    cost = np.concatenate([restricted_costs(runs, prior, part) for part in parts])
    return np.asarray(np.exp(-0.5 * (cost - cost.min())).reshape([axis.size for axis in axes]), np.float64)


def _along(density: Array, place: int) -> Array:
    """The density along one axis, with the other widths integrated out."""
    return np.asarray(density.sum(axis=tuple(j for j in range(density.ndim) if j != place)), np.float64)


def restricted_costs(runs: RunProducts, prior: WidthPrior, widths: Array) -> Array:
    """−2 ln of the restricted likelihood (`Marginal.restricted`) times the prior at many widths, up to a constant.

    Args:
        widths: shape (points, k).

    Returns:
        Dimensionless, shape (points,).
    """
    scale = widths[:, None, :, None] * widths[:, None, None, :]
    inverse = np.linalg.inv(np.eye(widths.shape[1]) + scale * runs.own)
    weight = scale * inverse
    weighted = weight @ runs.mixed
    normal = (runs.common - np.swapaxes(runs.mixed, 1, 2) @ weighted).sum(axis=1)
    seen = (runs.common_seen - np.einsum("grkp,rk->grp", weighted, runs.own_seen)).sum(axis=1)
    size = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-300))
    scaled = normal / (size[:, :, None] * size[:, None, :]) + _RIDGE * np.eye(size.shape[1])
    explained = np.einsum("gp,gp->g", seen / size, np.linalg.solve(scaled, (seen / size)[..., None])[..., 0])
    alone = np.einsum("rk,grkl,rl->g", runs.own_seen, weight, runs.own_seen)
    information = np.linalg.slogdet(scaled)[1] + 2.0 * np.log(size).sum(axis=1)
    cost = -np.linalg.slogdet(inverse)[1].sum(axis=1) - alone - explained + information
    cost += runs.power.sum() + np.array([prior.cost(point) for point in widths])
    return np.asarray(cost, np.float64)
