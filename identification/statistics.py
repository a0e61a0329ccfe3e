"""Linear algebra and statistics that every estimator shares.

Where the model explains the data, the covariance is the inverse of Fisher's information. Where it does not, the
residual is not white: the variances are widened by its power in the band of the oscillation, or to the scatter of
the runs, whichever is larger. The diagnosis uses the same scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from math import hypot, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtri, stdtrit

from identification.estimate import PARAMETERS, Estimate
from identification.policy import LEAST_WIDTH_FREEDOM, MISFIT_RATE
from identification.show.quantity import Quantity
from identification.status import Remark, Status, by_severity
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.quantities import PerParameter, PerUnknown, Square, Vector
from tunnel_sim.vocabulary.record import Array

_WORST_CONDITION = 1e13
# Greatest variance or information whose square root and inverse still have full precision.
_SMALLEST = 1e-290


def inner(left: Array, right: Array) -> Array:
    """The sum of products over the last axis, of samples.

    BLAS splits such a sum among its threads, so that its last bit would depend on their number.

    Args:
        left: shape (..., n).
        right: shape (..., n).
    """
    return np.asarray(np.sum(left * right, axis=-1))


def eliminate(information: Square, score: PerUnknown, keep: int) -> tuple[Array, Array]:
    """The information and score of the first unknowns, with the others eliminated (Schur complement)."""
    cross = information[keep:, :keep]
    solved = scaled_solve(information[keep:, keep:], np.column_stack((cross, score[keep:])))
    return information[:keep, :keep] - cross.T @ solved[:, :keep], score[:keep] - cross.T @ solved[:, keep]


def scaled_solve(matrix: Square, right: Array) -> Array:
    """Solve a symmetric positive system after scaling its diagonal to one (units differ by decades).

    Args:
        right: shape (m,) or (m, n).

    Raises:
        numpy.linalg.LinAlgError: when the matrix is singular.
    """
    diagonal = matrix.diagonal()
    if not diagonal.min(initial=1.0) > 0.0:
        raise np.linalg.LinAlgError("an unknown does not influence the reading")
    scale = np.sqrt(diagonal)
    unit = scale if right.ndim == 1 else scale[:, None]
    if scale.size != 2:
        return np.asarray(np.linalg.solve(matrix / (scale[:, None] * scale), right / unit) / unit)
    # Systems of two are by far the most common, and calling LAPACK costs ten times their solution.
    correlation, right = float(matrix[0, 1] / (scale[0] * scale[1])), right / unit
    pivot = 1.0 - correlation**2
    if not pivot > 0.0:
        raise np.linalg.LinAlgError("two unknowns have the same influence")
    second = (right[1] - correlation * right[0]) / pivot
    return np.array((right[0] - correlation * second, second)) / unit


def inverse(information: Square) -> Array:
    """The inverse of an information matrix that passed `determined`, symmetric to the last bit.

    Raises:
        numpy.linalg.LinAlgError: when the matrix is singular.
    """
    result = scaled_solve(information, np.eye(information.shape[0]))
    return np.asarray(0.5 * (result + result.T))


def determined(matrix: Square) -> bool:
    """Whether a symmetric matrix is positive definite to working precision, whatever its units.

    An information matrix is checked before it is inverted, and a covariance before it is used. With a condition
    number above 1e13, after scaling to a unit diagonal, the inverse has fewer than three correct digits.
    """
    diagonal = matrix.diagonal()
    if not (np.isfinite(matrix).all() and diagonal.min() > _SMALLEST and diagonal.max() < 1.0 / _SMALLEST):
        return False
    scale = np.sqrt(diagonal)
    sizes = np.linalg.eigvalsh(matrix / scale[:, None] / scale)
    return bool(sizes[0] * _WORST_CONDITION > sizes[-1])


def embed(link: Array, *, with_zero: bool) -> Array:
    """A run's link with the common zero as last parameter, shape (3, p + 1); the link itself without a zero.

    Args:
        link: from the shared parameters to (a, k), shape (2, p).
    """
    if not with_zero:
        return link
    # Not SciPy's block_diag, whose checks would take half the time of a belief.
    extended = np.zeros((link.shape[0] + 1, link.shape[1] + 1))
    extended[:-1, :-1] = link
    extended[-1, -1] = 1.0
    return extended


def weighted_fit(columns: Array, target: Vector, variance: Array) -> tuple[Array, Array]:
    """Linear least squares with known variances, which are raised if the scatter exceeds them beyond chance.

    Args:
        columns: one column per unknown, shape (n, p) with n above p.
        variance: variance of the target's points, shape (n,).

    Returns:
        The unknowns, shape (p,), and their covariance, shape (p, p).
    """
    weights = 1.0 / variance
    normal = columns.T @ (columns * weights[:, None])
    values = scaled_solve(normal, columns.T @ (weights * target))
    residual = target - columns @ values
    freedom = target.size - values.size
    scatter = float(residual @ (weights * residual))
    beyond = scatter > float(chdtri(freedom, MISFIT_RATE))
    return values, inverse(normal) * (scatter / freedom if beyond else 1.0)


def decay_covariance(rate: float, omega_d: float, rate_variance: float, omega_variance: float) -> Array:
    """Covariance of (a, k), shape (2, 2), from independent decay rate and damped frequency: k = ωd² + a².

    Args:
        rate: decay rate a, 1/s.
        omega_d: damped angular frequency, rad/s.
        rate_variance: variance of a, in (1/s)².
        omega_variance: variance of ωd, in (rad/s)².
    """
    slope = np.array([[1.0, 0.0], [2.0 * rate, 2.0 * omega_d]])
    return np.asarray(slope @ np.diag([rate_variance, omega_variance]) @ slope.T)


def deviations(rate: float, omega_d: float, covariance: Array) -> tuple[float, float]:
    """Standard deviations of decay rate, 1/s, and damped frequency, rad/s: the inverse of `decay_covariance`.

    Args:
        rate: decay rate a, 1/s.
        omega_d: damped angular frequency, rad/s, above 0.
        covariance: covariance of (a, k), shape (2, 2), in 1/s and 1/s².
    """
    slope = np.array([-rate, 0.5]) / omega_d
    return float(np.sqrt(covariance[0, 0])), float(np.sqrt(slope @ covariance @ slope))


@dataclass(frozen=True)
class Proportion:
    """A count out of a total, such as the number of failed trials.

    Args:
        total: the total count; the share is defined above 0 only.
    """

    count: int
    total: int

    @classmethod
    def of(cls, flags: Sequence[bool]) -> Proportion:
        """The proportion of true flags."""
        return cls(sum(map(bool, flags)), len(flags))

    @property
    def value(self) -> float:
        """The share."""
        return self.count / self.total

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval of 95 % (J. Am. Stat. Assoc. 22 (1927) 209–212), as shares; 0 to 1 for a total of 0."""
        from scipy.stats import binomtest

        if not self.total:
            return 0.0, 1.0
        found = binomtest(self.count, self.total).proportion_ci(method="wilson")
        return float(found.low), float(found.high)

    def to_json_dict(self) -> dict[str, Any]:
        """Count, total, share (None for a total of 0) and interval."""
        share = self.value if self.total else None
        return {"count": self.count, "total": self.total, "share": share, "wilson_95": list(self.interval)}


def widened_covariance(covariance: Square, least_std: PerParameter) -> Array:
    """Raise standard deviations to a lower limit, keeping the correlations."""
    factor = np.maximum(1.0, least_std / np.sqrt(np.diag(covariance)))
    return np.asarray(covariance * np.outer(factor, factor))


def fisher_covariance(normal: Square, variance: float) -> Array:
    """Inverse information times the noise variance, shape (p, p)."""
    return inverse(normal) * variance


def sandwich_covariance(informations: Array, powers: Sequence[float]) -> Array:
    """Covariance of a least-squares fit to runs with different noise, shape (p, p).

    Args:
        informations: information of each run, for noise of variance 1, shape (r, p, p).
        powers: power of the noise of each run at the frequency of its motion.
    """
    outer = inverse(np.sum(informations, axis=0))
    middle = sum((one * power for one, power in zip(informations, powers, strict=True)), np.zeros_like(outer))
    return np.asarray(outer @ middle @ outer)


def scatter_of_runs(influences: Array, informative_runs: NDArray[np.int64]) -> Array:
    """Standard deviations of parameters, shape (q,), from the scatter of the runs, whatever the spectrum.

    The sandwich estimator with a run as the cluster (Liang & Zeger, Biometrika 73 (1986) 13, doi
    10.1093/biomet/73.1.13), widened by Student's t for the small number of runs that determine a parameter: ±1.96
    standard deviations are a 95 % interval.

    Args:
        influences: contribution of every run's residual to the parameters, shape (runs, q).
        informative_runs: number of runs that determine each parameter, shape (q,).
    """
    free = np.maximum(informative_runs - 2, 1)
    spread = np.sqrt(np.sum(influences**2, axis=0) * informative_runs / free)
    return np.asarray(spread * stdtrit(free, 0.975) / ndtri(0.975))


def student_factor(relative: Array) -> Array:
    """Factor on standard deviations with estimated variances, for which ±1.96 of them are a 95 % interval.

    Args:
        relative: variance of each variance over its square, shape (q,); the degrees of freedom are 2 over it.
    """
    freedom = np.maximum(2.0 / np.maximum(relative, 1e-9), LEAST_WIDTH_FREEDOM)
    return np.asarray(stdtrit(freedom, 0.975) / ndtri(0.975))


def widened_by_contradictions(estimate: Estimate, campaign: Campaign, remarks: Sequence[Remark]) -> Estimate:
    """Widen the coefficients so that they cover their values after contradictory statements are corrected.

    The largest change by a correction is the half-width of a rectangular distribution (GUM 4.3.7). The examination
    does not compare damping, so Cr and Cnr are as doubtful, relatively, as the more doubtful of Izz and Cnβ.

    Args:
        remarks: remarks of the examination; for a contradiction they contain the possible values of Izz and Ka
            over ½ρV².
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
    runs = []
    for run in estimate.runs:
        loads = [moment * pressures[run.id] for moment in moments]
        stiffness = _reaching(run.aerodynamic_stiffness, scales, loads)
        air_damping = _reaching(run.aerodynamic_damping, damping)
        runs.append(replace(run, aerodynamic_stiffness=stiffness, aerodynamic_damping=air_damping))
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
    return replace(estimate, runs=tuple(runs), covariance=tuple(map(tuple, covariance.tolist())), **wider)


_DENSITY_DECIMALS = 4  # decimals from which a density is a rounded result, not a nominal value


def density_rounding(runs: Sequence[Run]) -> float:
    """Relative standard deviation of the stated air densities due to rounding, the largest of the wind-on runs.

    Rounding is a rectangular distribution of half a unit of the last decimal (GUM 4.3.7). A density of fewer than
    four decimals is a nominal value, taken as stated: its uncertainty is the user's to state. A rounded density
    that ends in a zero looks like one.
    """
    found = 0.0
    for run in runs:
        if run.wind_on and run.air_density:
            exponent = Decimal(repr(float(run.air_density))).as_tuple().exponent
            decimals = -exponent if isinstance(exponent, int) else 0
            if decimals >= _DENSITY_DECIMALS:
                found = max(found, 0.5 * 10.0**-decimals / sqrt(3.0) / run.air_density)
    return found


def widened_by_rounding(estimate: Estimate, runs: Sequence[Run]) -> Estimate:
    """Add the rounding of the stated air densities, common to all runs, to Cnβ and Cnr, in quadrature."""
    share = density_rounding(runs)
    names = [name for name in ("cn_beta", "cn_r") if getattr(estimate, name) is not None]
    if share == 0.0 or not names:
        return estimate
    wider: dict[str, Any] = {name: _wider(getattr(estimate, name), share) for name in names}
    change = np.array(
        [share * wider[n].value if n in wider else 0.0 for n in estimate.parameters], np.float64
    )
    covariance = estimate.covariance_matrix + np.outer(change, change)
    return replace(estimate, covariance=tuple(map(tuple, covariance.tolist())), **wider)


def _wider(found: Quantity, share: float) -> Quantity:
    """A quantity with a further relative standard deviation."""
    own, interval = share * found.value, found.interval
    if interval is not None:
        low, high = (hypot(end - found.value, float(ndtri(0.975)) * own) for end in interval)
        interval = (found.value - low, found.value + high)
    return replace(found, std=hypot(found.known_std, own), interval=interval)


def withheld(estimate: Estimate, remarks: Sequence[Remark]) -> Estimate:
    """Leave out the coefficients if a remark says that a value in a wrong unit makes them wrong by decades.

    Frequencies and damping ratios of the runs do not depend on the stated values and remain.
    """
    if not any(remark.withholds for remark in remarks):
        return estimate
    runs = tuple(replace(run, aerodynamic_stiffness=None, aerodynamic_damping=None) for run in estimate.runs)
    none: dict[str, Any] = dict.fromkeys((*PARAMETERS, "wind_off_inertia", "wind_off_intercept"))
    statuses = by_severity({*estimate.statuses, Status.COEFFICIENTS_WITHHELD})
    return replace(
        estimate, runs=runs, parameters=(), covariance=(), repeatability=None, statuses=statuses, **none
    )


def _reaching(
    found: Quantity | None, factors: Sequence[float], others: Sequence[float] = ()
) -> Quantity | None:
    """A quantity widened to include other values, and its own value times factors."""
    if found is None:
        return None
    away = [abs(factor - 1.0) * abs(found.value) for factor in factors]
    away += [abs(other - found.value) for other in others]
    std = max(found.known_std, max(away) / sqrt(3.0))
    interval = found.interval
    if interval is not None and std > found.known_std:
        half = float(ndtri(0.975)) * std
        interval = min(interval[0], found.value - half), max(interval[1], found.value + half)
    return replace(found, std=std, interval=interval)
