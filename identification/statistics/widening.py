"""Standard deviations that remain valid when the model does not explain the data.

If it does, the covariance is the inverse of Fisher's information. If it does not, the residual is not white: the
variances are widened by its power in the band of the oscillation, or to the scatter of the runs, whichever is
larger. The diagnosis uses the same scatter.

Where the statements of a campaign contradict its frequencies, no estimator can know which of them is wrong: the
largest change that a correction makes is the half-width of a rectangular distribution (GUM 4.3.7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from identification.estimate import Estimate, NoiseLevel, Quantity
from identification.remark import Remark
from identification.statistics.information import inverse
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array


def widened_covariance(covariance: Array, least_std: Array) -> Array:
    """Raise standard deviations to a lower limit, keeping the correlations.

    Args:
        covariance: shape (p, p).
        least_std: shape (p,).

    Returns:
        Shape (p, p).
    """
    factor = np.maximum(1.0, least_std / np.sqrt(np.diag(covariance)))
    return np.asarray(covariance * np.outer(factor, factor))


def fisher_covariance(normal: Array, noise: NoiseLevel) -> Array:
    """Inverse information times the noise variance, widened by the slow ratio.

    Args:
        normal: JᵀJ, shape (p, p).
        noise: the level and its slow ratio.

    Returns:
        Shape (p, p).
    """
    return inverse(normal) * (noise.std**2 * noise.slow_ratio)


def scatter_of_runs(influences: Array, speaking: NDArray[np.int64]) -> Array:
    """Standard deviations of parameters from the scatter of the runs, whatever the spectrum of the residuals.

    The sandwich estimator with a run as the cluster (Liang & Zeger, Biometrika 73 (1986) 13,
    doi 10.1093/biomet/73.1.13), widened by Student's t for the small number of runs that determine a parameter.

    Args:
        influences: contribution of every run's residual to the parameters, shape (runs, q).
        speaking: number of runs that determine each parameter, shape (q,).

    Returns:
        Standard deviations, shape (q,): 1.96 of them on either side are a 95 % interval.
    """
    free = np.maximum(speaking - 2, 1)
    spread = np.sqrt(np.sum(influences**2, axis=0) * speaking / free)
    return np.asarray(spread * stdtrit(free, 0.975) / ndtri(0.975))


def widened_by_contradictions(estimate: Estimate, campaign: Campaign, remarks: Sequence[Remark]) -> Estimate:
    """Widen the coefficients to what corrections of contradictory statements would make of them.

    Args:
        estimate: by any method.
        campaign: gives the conditions of the runs and the sizes.
        remarks: of the examination; those on a contradiction hold what Izz and Ka over ½ρV² may be.

    Returns:
        The same values. Damping is not compared by the examination, so Cr and Cnr are as doubtful, relatively, as
        the more doubtful of Izz and Cnβ.
    """
    inertias = [value for remark in remarks for value in remark.figures.get("inertias_kg_m2", ())]
    moments = [value for remark in remarks for value in remark.figures.get("air_stiffnesses_m3", ()) if value]
    if not inertias or estimate.yaw_inertia is None:
        return estimate
    scales = [inertia / estimate.yaw_inertia.value for inertia in inertias]
    pressures = {run.id: 0.5 * (run.air_density or 0.0) * run.wind_speed**2 for run in campaign.runs}
    seen = [
        run.aerodynamic_stiffness.value / pressures[run.id]
        for run in estimate.runs
        if run.aerodynamic_stiffness is not None
    ]
    damping = [*scales, *(1.0 + abs(a - b) / max(abs(a), abs(b)) for a in moments for b in seen)]
    size = (campaign.rig.frontal_area or 0.0) * (campaign.rig.reference_length or 0.0)
    runs = tuple(
        replace(
            run,
            aerodynamic_stiffness=_reaching(
                run.aerodynamic_stiffness, scales, [moment * pressures[run.id] for moment in moments]
            ),
            aerodynamic_damping=_reaching(run.aerodynamic_damping, damping),
        )
        for run in estimate.runs
    )
    wider: dict[str, Any] = {
        "cn_beta": _reaching(estimate.cn_beta, scales, [moment / size for moment in moments if size]),
        "cn_r": _reaching(estimate.cn_r, damping),
        "yaw_inertia": _reaching(estimate.yaw_inertia, (), inertias),
        "mechanical_damping": _reaching(estimate.mechanical_damping, damping),
        "wind_off_inertia": _reaching(estimate.wind_off_inertia, (), inertias),
        "wind_off_intercept": _reaching(estimate.wind_off_intercept, (0.0,)),
    }
    least = np.array([one.std for name in estimate.parameters if (one := wider[name]) is not None])
    covariance = widened_covariance(estimate.covariance_matrix, least)
    return replace(estimate, runs=runs, covariance=tuple(map(tuple, covariance.tolist())), **wider)


def _reaching(
    found: Quantity | None, factors: Sequence[float], others: Sequence[float] = ()
) -> Quantity | None:
    """A quantity whose distribution reaches other values, and its own times factors."""
    if found is None:
        return None
    away = [abs(factor - 1.0) * abs(found.value) for factor in factors]
    away += [abs(other - found.value) for other in others]
    std = max(found.std, max(away) / sqrt(3.0))
    interval = found.interval
    if interval is not None and std > found.std:
        half = float(ndtri(0.975)) * std
        interval = min(interval[0], found.value - half), max(interval[1], found.value + half)
    return replace(found, std=std, interval=interval)
