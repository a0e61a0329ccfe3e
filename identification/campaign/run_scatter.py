"""Repeatability: the scatter between runs, and its effect on the campaign's coefficients.

Run i has its own deviations e of wind speed V, spring stiffness Kr and mechanical damping Cr, relative and normal.
With Ka ~ V² and Ca ~ V they change its decay rate a and its stiffness k, per unit inertia, by

    δk = Kr g e_K − 2 Ka g e_V,    2 δa = Cr g e_C + Ca g e_V.

The deviations are integrated out (`identification.campaign.random_effects`). Stated widths are used unchanged.
Otherwise the widths maximise restricted likelihood times prior, and they count only if a likelihood ratio shows
scatter beyond the runs' noise. Zero is at the end of their range, so the ratio is at most a mixture of two χ²
(Self and Liang, J. Am. Stat. Assoc. 82 (1987) 605, doi 10.1080/01621459.1987.10478472).

Variances with estimated widths have the degrees of freedom of Satterthwaite, Biometrics Bull. 2 (1946) 110–114, doi
10.2307/3002019; Student's t widens them accordingly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, chdtri, ndtri

from identification import policy
from identification.campaign.derivatives import Design
from identification.campaign.random_effects import (
    Marginal,
    RunProducts,
    UsualWidths,
    WidthPrior,
    likeliest_widths,
    marginal,
)
from identification.estimate import RunScatter
from identification.show.quantity import Quantity
from identification.statistics import inverse, student_factor
from tunnel_sim.vocabulary.between_runs import SCATTERED
from tunnel_sim.vocabulary.campaign import Repeatability, Run
from tunnel_sim.vocabulary.quantities import PerParameter
from tunnel_sim.vocabulary.record import Array

_STEP = 0.02  # step of ln(width), for the finite differences of the curvature
_ZERO = 1e-9  # width, relative to the usual one, that counts as zero


def moves_of(runs: Sequence[Run], design: Design, parameters: PerParameter) -> list[Array]:
    """Derivative of every run's values to the relative size of each of `SCATTERED`, shape (m, 3).

    Args:
        design: design of the runs, with the gains of inputs.
    """
    columns = {name: float(parameters[place]) for name, place in design.columns.items()}
    stiff, aero = columns.get("g", 0.0), columns.get("n", 0.0)
    still, air = columns.get("d", 0.0), columns.get("m", 0.0)
    moves = []
    for run, link, load, damping in zip(
        runs, design.links, design.stiffness_loads, design.damping_loads, strict=True
    ):
        spring = (run.spring_stiffness or 0.0) * stiff
        move = np.zeros((len(link), len(SCATTERED)))
        move[:2, 0] = -0.5 * damping * air, -2.0 * load * aero
        move[1, 1] = spring
        move[0, 2] = 0.5 * still
        if run.known_gain is not None:
            move[2, 1] = run.known_gain.per_stiffness * spring
        moves.append(move)
    return moves


@dataclass(frozen=True, eq=False)
class MeasuredRuns:
    """Decay rates and stiffnesses of runs from a method, and how they change with deviations of the runs.

    Args:
        links: by run, shape (m, p), from the common parameters φ to (a, k, g).
        values: (a, k, g) by run, shape (m,).
        weights: inverse covariance of the noise of the values by run, shape (m, m).
        moves: by run, derivative to the relative size of each of `SCATTERED`, shape (m, 3).
    """

    links: Sequence[Array]
    values: Sequence[Array]
    weights: Sequence[Array]
    moves: Sequence[Array]

    def misfit(self, parameters: Array) -> float:
        """χ² of common parameters, shape (p,), without scatter."""
        away = [seen - link @ parameters for seen, link in zip(self.values, self.links, strict=True)]
        return sum(float(one @ weight @ one) for one, weight in zip(away, self.weights, strict=True))

    def floored(self, least: Array) -> MeasuredRuns:
        """The runs with at least the noise of the least widths, so that rounding does not hide the noise.

        Args:
            least: relative, of each of `SCATTERED`, shape (3,).
        """
        weights = []
        for weight, move in zip(self.weights, self.moves, strict=True):
            known = np.flatnonzero(weight.diagonal() > 0.0)
            inside = np.ix_(known, known)
            moved = move[known] * least
            floored = np.zeros_like(weight)
            floored[inside] = inverse(inverse(weight[inside]) + moved @ moved.T)
            weights.append(floored)
        return replace(self, weights=weights)

    def about(self, start: PerParameter, used: Array) -> RunProducts:
        """The products of the runs' columns, for corrections of φ and deviations.

        Args:
            used: places of the deviations in `SCATTERED`, shape (k,).
        """
        rows = zip(self.links, self.values, self.weights, self.moves, strict=True)
        of_runs = [(j, z - j @ start, w, d[:, used]) for j, z, w, d in rows]
        return RunProducts(
            np.stack([d.T @ w @ d for _, _, w, d in of_runs]),
            np.stack([d.T @ w @ j for j, _, w, d in of_runs]),
            np.stack([j.T @ w @ j for j, _, w, _ in of_runs]),
            np.stack([d.T @ w @ z for _, z, w, d in of_runs]),
            np.stack([j.T @ w @ z for j, z, w, _ in of_runs]),
            np.array([float(z @ w @ z) for _, z, w, _ in of_runs]),
        )


@dataclass(frozen=True, eq=False)
class ScatterFit:
    """Scatter between runs, and the common parameters of greatest likelihood under it.

    Args:
        names: the members of `SCATTERED` that the runs show.
        widths: relative standard deviations, shape (k,).
        uncertain: covariance of ln(widths), shape (k, k); zero for a stated width.
        stated: names of the widths that the campaign states.
        noise: covariance of φ due to the noise of the runs alone, shape (p, p).
        quadratic: χ² with the most likely deviations, dimensionless.
        gains: derivative of φ by a run's values, by run, shape (p, m).
        moves: change by one standard deviation of each kind of scatter, by run, shape (m, k).
        values: by run, shape (m,).
    """

    names: tuple[str, ...]
    widths: Array
    uncertain: Array
    stated: tuple[str, ...]
    parameters: PerParameter
    noise: Array
    quadratic: float
    gains: Sequence[Array]
    moves: Sequence[Array]
    values: Sequence[Array]

    @property
    def covariance(self) -> Array:
        """Covariance of φ from noise and scatter, not yet widened for estimated widths, shape (p, p)."""
        moved = self.moved(np.eye(self.parameters.size))
        return np.asarray(self.noise + sum((one @ one.T for one in moved), np.zeros_like(self.noise)))

    def moved(self, jacobian: Array) -> list[Array]:
        """Change of functions of φ by one standard deviation of each kind of scatter, run by run.

        Args:
            jacobian: of the functions with respect to φ, shape (q, p).

        Returns:
            By kind, shape (q, runs).
        """
        every = [jacobian @ gain @ move for gain, move in zip(self.gains, self.moves, strict=True)]
        return [np.stack([one[:, kind] for one in every], axis=1) for kind in range(len(self.names))]

    def counted(self, noise: Array, moved: Sequence[Array]) -> tuple[Array, list[Array]]:
        """The covariance of noise and scatter together, widened by Student's t where widths are estimated.

        An interval of ±1.96 standard deviations has 95 % coverage.

        Args:
            noise: covariance without scatter, shape (q, q).
            moved: as `moved` returns it.

        Returns:
            The covariance, shape (q, q), and the contribution of each kind of scatter to it.
        """
        total = noise + sum((one @ one.T for one in moved), np.zeros_like(noise))
        variance = np.diag(total)
        slopes = np.stack([2.0 * np.sum(one**2, axis=1) for one in moved], axis=1) / variance[:, None]
        factor = student_factor(np.einsum("qk,kl,ql->q", slopes, self.uncertain, slopes))
        wider = np.outer(factor, factor)
        return np.asarray(total * wider), [one @ one.T * wider for one in moved]

    def of(self, jacobian: Array) -> tuple[Array, RunScatter]:
        """The covariance of functions of φ, and the repeatability of the runs.

        Args:
            jacobian: of the functions with respect to the first elements of φ, shape (q, n).
        """
        size = jacobian.shape[1]
        whole = np.zeros((len(jacobian), self.parameters.size))
        whole[:, :size] = jacobian
        noise = whole @ self.noise @ whole.T
        covariance, added = self.counted(noise, self.moved(whole))
        return covariance, self.described(added)

    def described(self, added: Sequence[Array] = ()) -> RunScatter:
        """The repeatability of the runs, for an estimate.

        Args:
            added: contribution of each kind of scatter to the covariance of its parameters, shape (q, q).
        """
        reach = float(ndtri(0.975))
        widths: dict[str, Quantity] = {}
        for name, width, variance in zip(
            self.names, self.widths.tolist(), np.diag(self.uncertain), strict=True
        ):
            deviation = float(np.sqrt(variance))
            ends = width * float(np.exp(-reach * deviation)), width * float(np.exp(reach * deviation))
            std = 0.0 if name in self.stated else width * deviation
            widths[name] = Quantity(width, std, "1", None if name in self.stated else ends)
        spread = np.array([np.sum(move[:2] ** 2, axis=1) for move in self.moves])  # places of (a, k)
        sizes = np.array([seen[:2] for seen in self.values]) ** 2
        shares = np.divide(spread, sizes, out=np.zeros_like(spread), where=sizes > 0.0)
        relative = np.sqrt(shares.sum(axis=0) / np.maximum((sizes > 0.0).sum(axis=0), 1))
        return RunScatter(
            frequency=0.5 * float(relative[1]),
            damping=float(relative[0]),
            stated=self.stated,
            covariances=tuple(tuple(map(tuple, one.tolist())) for one in added),
            **widths,
        )


def scatter_between(
    measured: MeasuredRuns,
    start: Array,
    repeatability: Repeatability | None,
) -> ScatterFit | None:
    """The scatter between runs; None if none is stated and the runs show none beyond their noise.

    Args:
        start: φ of generalised least squares without scatter, shape (p,).
        repeatability: as stated by the campaign; used unchanged.
    """
    stated = {} if repeatability is None else repeatability.stated
    usual = UsualWidths()
    measured = measured.floored(usual.prior(SCATTERED, {}).least)
    pairs = list(zip(measured.moves, measured.weights, strict=True))
    power = np.sum([np.einsum("mk,mn,nk->k", move, weight, move) for move, weight in pairs], axis=0)
    shown = [place for place, name in enumerate(SCATTERED) if power[place] > 0.0]
    if not shown:
        return None
    names = [SCATTERED[place] for place in shown]
    prior = usual.prior(names, stated)
    runs = measured.about(start, np.array(shown))
    scattering = np.arange(len(names))
    widths = prior.usual
    if prior.free.any():
        widths = likeliest_widths(runs, prior)
        none = np.where(prior.free, _ZERO * prior.usual, prior.usual)
        gained = marginal(runs, none).restricted - marginal(runs, widths).restricted
        if gained < ratio_limit(int(prior.free.sum())):
            scattering = np.flatnonzero(~prior.free)
    if not scattering.size:
        return None
    used = np.array(shown)[scattering]
    runs, widths = measured.about(start, used), widths[scattering]
    prior = WidthPrior(
        prior.usual[scattering], prior.decades[scattering], prior.least[scattering], prior.most[scattering]
    )
    fitted = marginal(runs, widths)
    moves = [move[:, used] * widths for move in measured.moves]
    gains, noise = _gains(measured, moves, fitted)
    return ScatterFit(
        tuple(names[place] for place in scattering),
        widths,
        _uncertainty(runs, widths, prior),
        tuple(names[place] for place in scattering if names[place] in stated),
        start + fitted.common,
        noise,
        fitted.quadratic,
        gains,
        moves,
        measured.values,
    )


def ratio_limit(free: int) -> float:
    """The likelihood ratio, −2 ln, which runs without scatter exceed at the rate `policy.DIFFERENCE_RATE`.

    Args:
        free: number of estimated widths, 1 or more.
    """
    low, high = 0.0, float(chdtri(free, policy.DIFFERENCE_RATE))
    while high - low > 1e-6:  # the mixture lies between χ² of free − 1 and of free degrees of freedom
        middle = 0.5 * (low + high)
        fewer = float(chdtrc(free - 1, middle)) if free > 1 else 0.0
        beyond = 0.5 * (fewer + float(chdtrc(free, middle)))
        low, high = (middle, high) if beyond > policy.DIFFERENCE_RATE else (low, middle)
    return high


def _gains(measured: MeasuredRuns, moves: Sequence[Array], found: Marginal) -> tuple[list[Array], Array]:
    """The derivative of φ by every run's values, and the covariance of φ from their noise.

    The first is H⁻¹ Jᵀ V⁻¹ with V = W⁻¹ + D S² Dᵀ.
    """
    gains, noise = [], np.zeros_like(found.covariance)
    for link, weight, move in zip(measured.links, measured.weights, moves, strict=True):
        inner = np.linalg.inv(np.eye(move.shape[1]) + move.T @ weight @ move)
        unweighted = found.covariance @ (link.T - link.T @ weight @ move @ inner @ move.T)
        gains.append(unweighted @ weight)
        noise += unweighted @ weight @ unweighted.T
    return gains, noise


def _uncertainty(runs: RunProducts, widths: Array, prior: WidthPrior) -> Array:
    """Covariance of ln(widths), from the curvature of the restricted likelihood and the prior, shape (k, k)."""
    free = np.flatnonzero(prior.free)
    covariance = np.zeros((widths.size,) * 2)
    if not free.size:
        return covariance
    rows = []
    for place in free:
        slopes = []
        for sign in (1.0, -1.0):
            moved = widths.copy()
            moved[place] *= np.exp(sign * _STEP)
            slopes.append((marginal(runs, moved).slope + prior.slope(moved))[free])
        rows.append((slopes[0] - slopes[1]) / (2.0 * _STEP))
    curvature = np.array(rows)
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    # In no direction is the variance above the prior's.
    least = 2.0 / (float(np.max(prior.decades[free])) * np.log(10.0)) ** 2
    inverse = vectors @ np.diag(2.0 / np.maximum(values, least)) @ vectors.T
    covariance[np.ix_(free, free)] = inverse
    return covariance
