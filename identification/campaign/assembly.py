"""From runs and shared parameters to an `Estimate`: the steps that all estimators share.

A method that identifies run by run calls `combined_estimate`; a joint method uses its parts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtri

from identification.campaign.derivatives import (
    Derivatives,
    Design,
    build_design,
    combine,
    derivatives,
    positive_inertia,
)
from identification.campaign.springs import wind_off_line
from identification.decay.damped_oscillation import Decay
from identification.estimate import (
    UNITS,
    Estimate,
    NoiseLevel,
    Quantity,
    RunEstimate,
    Status,
    by_gravity,
)
from identification.policy import MISFIT_RATE
from identification.statistics.information import determined, inverse
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array

Combination = Callable[[Design, list[int], Array, Array], tuple[Array, Array]]
"""The design, the places of its runs, φ and its covariance to φ and its covariance."""


@dataclass(frozen=True, eq=False)
class RunDecay:
    """The result of a method for one run alone.

    Args:
        estimate: the run's result, or the status of its failure.
        decay: decay rate and stiffness; None where the run could not be identified.
        covariance: of (a, k), shape (2, 2), in 1/s and 1/s²; None where decay is.
    """

    estimate: RunEstimate
    decay: Decay | None = None
    covariance: Array | None = None

    @classmethod
    def failed(cls, run: Run, status: Status) -> RunDecay:
        """A run without a result, and the reason."""
        return cls(RunEstimate(run.id, (status,)))


def combined_estimate(
    campaign: Campaign, name: str, found: Sequence[RunDecay], *, together: Combination | None = None
) -> Estimate:
    """The campaign's coefficients from runs identified one by one: generalised least squares on their (a, k).

    Where the runs contradict each other beyond chance, the covariance is widened by their scatter, the ratio
    of Birge, Phys. Rev. 40 (1932) 207–227, doi 10.1103/PhysRev.40.207.

    Args:
        found: one per run, in the campaign's order.
        together: a method's own combination of the runs, which starts from that of least squares.

    Returns:
        The estimate. A run that could not be identified is left out; one without spring stiffness is identified
        by itself only.

    Raises:
        TunnelError: when a wind-on run states no air density.
    """
    estimate = Estimate(campaign.name, name, tuple(item.estimate for item in found))
    statuses = statuses_of_runs(campaign, estimate.runs)
    pairs = [
        (place, run, item.decay, item.covariance)
        for place, (run, item) in enumerate(zip(campaign.runs, found, strict=True))
        if item.decay is not None
        and item.covariance is not None
        and item.estimate.omega_n is not None
        and run.spring_stiffness is not None
    ]
    statuses |= departures([run.noise for run in estimate.runs])
    if not pairs:
        return replace(estimate, statuses=by_gravity(statuses))
    runs = [run for _, run, _, _ in pairs]
    design = build_design(runs, campaign.rig)
    decays = np.array([[decay.rate, decay.stiffness] for _, _, decay, _ in pairs])
    informations = [inverse(covariance) for _, _, _, covariance in pairs]
    combined = combine(design, decays, informations)
    if combined is None:
        return replace(estimate, statuses=by_gravity(statuses | {Status.NOT_DETERMINED}))
    parameters, covariance = combined
    ratio = _birge_ratio(design, parameters, decays, informations)
    if together is not None:
        parameters, covariance = together(design, [place for place, *_ in pairs], parameters, covariance)
    values = derivatives(design, parameters)
    own = values.jacobian @ (covariance * ratio) @ values.jacobian.T
    if values.names and not determined(own):
        return replace(estimate, statuses=by_gravity(statuses | {Status.NOT_DETERMINED}))
    return filled(campaign, estimate, runs, design, values, own, statuses | limits(design, parameters))


def filled(
    campaign: Campaign,
    estimate: Estimate,
    runs: Sequence[Run],
    design: Design,
    found: Derivatives,
    covariance: Array,
    statuses: set[Status],
) -> Estimate:
    """The estimate with coefficients, the air of its runs and the wind-off line.

    Args:
        runs: those that the design links.
        covariance: of the values found, shape (p, p).
    """
    air = air_of_runs(design, found, covariance, runs)
    return replace(
        estimate,
        statuses=by_gravity(statuses),
        runs=tuple(replace(run, **air.get(run.id, {})) for run in estimate.runs),
        **wind_off(estimate.runs, campaign.runs),
        **quantities(found, covariance, has_size=design.has_size),
    )


def _birge_ratio(design: Design, parameters: Array, decays: Array, informations: Sequence[Array]) -> float:
    freedom = decays.size - design.size
    if freedom < 1:
        return 1.0
    away = [decay - link @ parameters for decay, link in zip(decays, design.links, strict=True)]
    scatter = sum(float(d @ weight @ d) for d, weight in zip(away, informations, strict=True))
    return scatter / freedom if scatter > float(chdtri(freedom, MISFIT_RATE)) else 1.0


def statuses_of_runs(campaign: Campaign, estimates: Sequence[RunEstimate]) -> set[Status]:
    """The statuses of a campaign that follow from its runs.

    Args:
        estimates: one per run, in the campaign's order.

    Returns:
        The statuses; only NO_RUN_IDENTIFIED where no run was identified.
    """
    identified = [estimate.omega_n is not None for estimate in estimates]
    if not any(identified):
        return {Status.NO_RUN_IDENTIFIED}
    statuses = set()
    if not all(identified):
        statuses.add(Status.RUN_LEFT_OUT)
    if any(run.spring_stiffness is None for run in campaign.runs):
        statuses.add(Status.NO_STIFFNESS)
    if any(Status.FEW_CYCLES in estimate.statuses for estimate in estimates):
        statuses.add(Status.FEW_CYCLES)
    return statuses


def departures(levels: Sequence[NoiseLevel | None]) -> set[Status]:
    """The statuses that follow from noise levels.

    Args:
        levels: of runs or of a joint fit; None where there is none.

    Returns:
        MODEL_DEPARTS and NOISE_DISAGREES as they apply.
    """
    known = [level for level in levels if level is not None]
    statuses = set()
    if any(level.departs for level in known):
        statuses.add(Status.MODEL_DEPARTS)
    if any(level.disagrees for level in known):
        statuses.add(Status.NOISE_DISAGREES)
    return statuses


def limits(design: Design, parameters: Array) -> set[Status]:
    """The statuses of a campaign whose conditions do not separate parameters, or contradict them.

    Args:
        parameters: φ as found, shape (p,).
    """
    statuses = set()
    if not np.any(design.stiffness_loads > 0.0):
        statuses.add(Status.NO_WIND_ON)
    elif not design.has_size:
        statuses.add(Status.NO_REFERENCE_SIZE)
    if "g" not in design.columns:
        statuses.add(Status.STIFFNESS_NOT_SEPARABLE)
    elif not positive_inertia(design, parameters):
        statuses.add(Status.INERTIA_NOT_POSITIVE)
    if "d" not in design.columns:
        statuses.add(Status.DAMPING_NOT_SEPARABLE)
    return statuses


def quantities(found: Derivatives, covariance: Array, *, has_size: bool) -> dict[str, Any]:
    """The coefficients as fields of an `Estimate`, with their covariance.

    Args:
        covariance: of the values, shape (p, p).
        has_size: whether the rig states A and l. Without them the coefficients still multiply A·l and A·l²,
            and only Ka and Ca per run are given.

    Returns:
        Keyword arguments of `Estimate`.
    """
    kept = [i for i, name in enumerate(found.names) if has_size or name not in ("cn_beta", "cn_r")]
    fields: dict[str, Any] = {
        found.names[i]: Quantity(
            float(found.values[i]), float(np.sqrt(covariance[i, i])), UNITS[found.names[i]]
        )
        for i in kept
    }
    fields["parameters"] = tuple(found.names[i] for i in kept)
    fields["covariance"] = tuple(tuple(float(covariance[i, j]) for j in kept) for i in kept)
    return fields


def air_of_runs(
    design: Design, found: Derivatives, covariance: Array, runs: Sequence[Run]
) -> dict[str, dict[str, Any]]:
    """The air's stiffness and damping in every wind-on run.

    Args:
        covariance: of the values, shape (p, p).

    Returns:
        By run: keyword arguments of `RunEstimate`.
    """
    air: dict[str, dict[str, Any]] = {}
    for name, target, load, unit in (
        ("cn_beta", "aerodynamic_stiffness", design.stiffness_loads, "N m/rad"),
        ("cn_r", "aerodynamic_damping", design.damping_loads, "N m s/rad"),
    ):
        value = found.get(name)
        if value is None:
            continue
        place = found.names.index(name)
        std = float(np.sqrt(covariance[place, place]))
        for run, factor in zip(runs, load, strict=True):
            if run.wind_on:
                quantity = Quantity(float(factor) * value, float(factor) * std, unit)
                air.setdefault(run.id, {})[target] = quantity
    return air


def wind_off(estimates: Sequence[RunEstimate], runs: Sequence[Run]) -> dict[str, Any]:
    """Izz and intercept of the line of Kr against ωn² of the wind-off runs (paper, eq. 1).

    Returns:
        Keyword arguments of `Estimate`; none without wind-off runs.
    """
    rows = [
        (run.spring_stiffness, found.omega_n)
        for run, found in zip(runs, estimates, strict=True)
        if not run.wind_on and run.spring_stiffness is not None and found.omega_n is not None
    ]
    if not rows:
        return {}
    stiffness = np.array([spring for spring, _ in rows])
    inertia, intercept = wind_off_line(
        stiffness, np.array([omega.value for _, omega in rows]), np.array([omega.std for _, omega in rows])
    )
    return {"wind_off_inertia": inertia, "wind_off_intercept": intercept}
