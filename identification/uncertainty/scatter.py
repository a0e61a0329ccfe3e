"""The scatter of runs about the coefficients they share, beyond their known uncertainties.

Every run's decay rate a and stiffness k are linear in shared parameters (see `derivatives`); their residuals
about the generalised least-squares fit are squared, weighted by the runs' variances and summed, separately for
wind-off and wind-on runs and for a and k. If a sum exceeds its expectation from noise and the stated individual
errors of the inputs by more than chance, every run in it gets the variance of its own residual: a linearised
jackknife (J. G. MacKinnon & H. White, J. Econometrics 29 (1985) 305–325, doi 10.1016/0304-4076(85)90158-7).
Repeats count as separate runs; no pairing is needed. The distribution of a weighted sum of squares is approximated
as by Satterthwaite, Biometrics Bull. 2 (1946) 110–114, doi 10.2307/3002019.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.campaign.derivatives import Design, build_design, combine, derivatives
from identification.estimate import RunEstimate
from identification.policy import DIFFERENCE_RATE, LEAST_FREE_SHARE, LEAST_SCATTER_FREEDOM
from identification.statistics import inverse
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run
from tunnel_sim.vocabulary.record import Array

_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class SideScatter:
    """The scatter of the wind-off or of the wind-on runs.

    Args:
        known: whether the runs leave a degree of freedom to determine it.
        names: parameters of the covariance.
        covariance: what the excess adds to that of the parameters, shape (p, p); zero within chance.
    """

    known: bool
    names: tuple[str, ...]
    covariance: Array


@dataclass(frozen=True, eq=False)
class _SideFit:
    """The runs' (a, k), stacked as one vector of length 2n."""

    residual: Array
    weight: Array
    hat: Array
    noise: Array
    influence: Array
    names: tuple[str, ...]


def side_scatter(
    campaign: Campaign, estimates: Sequence[RunEstimate], individual: Mapping[str, float]
) -> tuple[SideScatter, SideScatter]:
    """Scatter of wind-off and of wind-on runs.

    Args:
        estimates: one per run, with ωn and ζ where they were identified.
        individual: relative standard uncertainties of inputs with separate errors by run or by spring.

    Returns:
        Wind-off, wind-on.
    """
    pairs = [
        (run, found)
        for run, found in zip(campaign.runs, estimates, strict=True)
        if run.spring_stiffness is not None and found.omega_n is not None and found.zeta is not None
    ]
    runs = [run for run, _ in pairs]
    nothing = SideScatter(False, (), np.zeros((0, 0)))
    if not pairs:
        return nothing, nothing
    design = build_design(runs, campaign.rig)
    fitted = _fit(design, [estimate for _, estimate in pairs])
    if fitted is None or not fitted[0].names:
        return nothing, nothing
    fit, shared = fitted
    covariance = fit.noise + _input_covariance(runs, campaign.rig, design, shared, individual)
    windy = np.repeat([run.wind_on for run in runs], 2)
    return _side(fit, covariance, ~windy), _side(fit, covariance, windy)


def _fit(design: Design, estimates: Sequence[RunEstimate]) -> tuple[_SideFit, Array] | None:
    decays, blocks = [], []
    for found in estimates:
        assert found.omega_n is not None
        assert found.zeta is not None
        omega, zeta = found.omega_n, found.zeta
        decays.append([zeta.value * omega.value, omega.value**2])
        # ωn and ζ of a decay are uncorrelated to first order in the damping.
        jacobian = np.array([[zeta.value, omega.value], [2.0 * omega.value, 0.0]])
        blocks.append(jacobian @ np.diag([omega.std**2, zeta.std**2]) @ jacobian.T)
    informations = [inverse(block) for block in blocks]
    combined = combine(design, np.array(decays), informations)
    if combined is None:
        return None
    shared, inverse_normal = combined
    links = np.concatenate(design.links)
    weight = _diagonal(informations)
    gain = inverse_normal @ links.T @ weight
    found_values = derivatives(design, shared)
    fit = _SideFit(
        residual=np.concatenate(decays) - links @ shared,
        weight=weight,
        hat=links @ gain,
        noise=_diagonal(blocks),
        influence=found_values.jacobian @ gain,
        names=found_values.names,
    )
    return fit, shared


def _diagonal(blocks: Sequence[Array]) -> Array:
    size = 2 * len(blocks)
    matrix = np.zeros((size, size))
    for i, block in enumerate(blocks):
        matrix[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
    return matrix


def _input_covariance(
    runs: Sequence[Run], rig: RigProperties, design: Design, shared: Array, individual: Mapping[str, float]
) -> Array:
    """Covariance of the runs' (a, k) due to the errors of their stated inputs."""
    total = np.zeros((2 * len(runs),) * 2)
    before = np.concatenate(design.links) @ shared
    for name, size in individual.items():
        for group in error_groups(runs, name):
            moved = [
                with_scaled_input(run, name, 1.0 + _STEP) if i in group else run for i, run in enumerate(runs)
            ]
            links = build_design(moved, rig).links
            if links[0].shape != design.links[0].shape:
                continue
            move = (np.concatenate(links) @ shared - before) * (size / _STEP)
            total += np.outer(move, move)
    return total


def error_groups(runs: Sequence[Run], name: str) -> list[list[int]]:
    """Which runs share one individual error: those of a spring, or a single wind-on run."""
    if name != "spring_stiffness":
        return [[i] for i, run in enumerate(runs) if run.wind_on]
    springs: dict[float, list[int]] = {}
    for i, run in enumerate(runs):
        if run.spring_stiffness is not None:
            springs.setdefault(run.spring_stiffness, []).append(i)
    return list(springs.values())


def with_scaled_input(run: Run, name: str, factor: float) -> Run:
    """A run with one stated input changed.

    Args:
        name: ``spring_stiffness``, ``wind_speed`` or ``air_density``.
        factor: what the input is multiplied by (1).
    """
    if name == "wind_speed":
        return replace(run, wind_speed=run.wind_speed * factor)
    if name == "air_density":
        return replace(run, air_density=None if run.air_density is None else run.air_density * factor)
    spring = run.spring_stiffness
    return replace(run, spring_stiffness=None if spring is None else spring * factor)


def _side(fit: _SideFit, covariance: Array, mine: Array) -> SideScatter:
    from scipy.special import chdtri

    size = fit.residual.size
    added = np.zeros((len(fit.names),) * 2)
    seen = False
    for row in (0, 1):  # decay rates, then stiffnesses
        chosen = (mine & (np.arange(size) % 2 == row)).astype(np.float64)
        root = np.sqrt(chosen * np.diag(fit.weight))
        # The weighted residuals of these rows are a linear map of errors with this covariance.
        residual_map = root[:, None] * (np.eye(size) - fit.hat)
        spread = residual_map @ covariance @ residual_map.T
        if float(np.trace(residual_map @ fit.noise @ residual_map.T)) < LEAST_SCATTER_FREEDOM:
            continue
        seen = True
        expected = float(np.trace(spread))
        degrees = expected**2 / float(np.sum(spread**2))
        ratio = float(np.sum((root * fit.residual) ** 2)) / expected
        if ratio > float(chdtri(degrees, DIFFERENCE_RATE)) / degrees:
            # As in the jackknife, every run gets the variance of its own residual, corrected for its leverage.
            freed = fit.residual / np.maximum(1.0 - np.diag(fit.hat), LEAST_FREE_SHARE)
            excess = np.maximum(freed**2 - np.diag(covariance), 0.0)
            added += (fit.influence * (chosen * excess)) @ fit.influence.T
    return SideScatter(seen, fit.names, added)
