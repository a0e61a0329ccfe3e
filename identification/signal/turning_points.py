"""Natural frequency and damping from turning points, by the likelihood of the turning points.

The turning points of a linear decay are half a damped period apart, about any centre, and their angles are
c + (−1)ᵏ A exp(−δ k). A timing error changes the angle there only to second order. The likelihood is therefore a
product of two: a straight line of times, and a decaying alternation of angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from scipy.special import chdtrc

from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.turning_points import TurningPoints

_RATE = 0.01
"""False-alarm rate for scatter beyond the stated, and for a change of the period or the decrement."""


@dataclass(frozen=True)
class FittedNumber:
    """An estimated number.

    Args:
        value: in the unit of the quantity.
        std: standard deviation, in the same unit.
    """

    value: float
    std: float


@dataclass(frozen=True)
class TurningPointFit:
    """A linear decay from its turning points.

    Args:
        omega_n: natural angular frequency, rad/s.
        zeta: damping ratio.
        period: of the damped oscillation, s.
        decrement: logarithmic decrement of a whole period.
        zero: angle at rest, rad.
        first_swing: excursion from ``zero`` at the first turning point, rad.
        remarks: sentences on the uncertainties, and on departures from the model.
    """

    omega_n: FittedNumber
    zeta: FittedNumber
    period: FittedNumber
    decrement: FittedNumber
    zero: FittedNumber
    first_swing: FittedNumber
    remarks: tuple[str, ...]


def fit_turning_points(points: TurningPoints) -> TurningPointFit:
    """Fit a linear decay to its turning points."""
    k = points.half_periods
    remarks: list[str] = []
    line = np.column_stack([np.ones(k.size), k])
    times = _Linear.of(line, points.time_s, points.time_std, "times", "s", remarks)
    half = FittedNumber(float(times.solution[1]), sqrt(times.covariance[1, 1]))
    first, sides = _decay(k, points.angle_rad)
    columns = _slopes(k, first)
    weights = points.angle_std
    # One more Gauss–Newton step from the minimum gives the covariance and the scatter of the fit.
    residual = points.angle_rad - _angles(k, first)
    step = _Linear.of(columns, residual, weights, "angles", "rad", remarks)
    zero, swing, delta = (first + step.solution).tolist()
    stds = np.sqrt(np.diag(step.covariance)).tolist()
    _bends(line, k, times, step, columns, swing * sides, remarks, half.value)
    damped = pi / half.value
    zeta = delta / sqrt(pi**2 + delta**2)
    slope = pi**2 / (pi**2 + delta**2) ** 1.5
    zeta_std = slope * stds[2]
    omega = damped / sqrt(1.0 - zeta**2)
    # ωn = ωd √(π² + δ²)/π
    omega_std = omega * sqrt((half.std / half.value) ** 2 + (delta * stds[2] / (pi**2 + delta**2)) ** 2)
    return TurningPointFit(
        omega_n=FittedNumber(omega, omega_std),
        zeta=FittedNumber(zeta, zeta_std),
        period=FittedNumber(2.0 * half.value, 2.0 * half.std),
        decrement=FittedNumber(2.0 * delta, 2.0 * stds[2]),
        zero=FittedNumber(zero, stds[0]),
        first_swing=FittedNumber(swing, stds[1]),
        remarks=tuple(remarks),
    )


@dataclass(frozen=True, eq=False)
class _Linear:
    """A weighted linear fit, its covariance, and its residuals of shape (n,) with their standard deviations."""

    solution: Array
    covariance: Array
    std: Array
    residual: Array

    @classmethod
    def of(
        cls, columns: Array, values: Array, stated: Array | None, name: str, unit: str, said: list[str]
    ) -> _Linear:
        """Fit; the errors follow from the scatter if none are stated, or if it exceeds them beyond chance."""
        free = values.size - columns.shape[1]
        std = np.ones(values.size) if stated is None else stated
        solution = np.linalg.lstsq(columns / std[:, None], values / std, rcond=None)[0]
        residual = values - columns @ solution
        chi2 = float(np.sum((residual / std) ** 2))
        scale = sqrt(chi2 / free)
        scatter = float(np.sqrt(np.sum(residual**2) / free))
        if stated is None:
            said.append(
                f"the {name} scatter by {scatter:.2g} {unit} about the fit, from which the errors follow"
            )
        elif chdtrc(free, chi2) < _RATE:
            more = f"{scale:.3g} times as stated, which the errors allow for"
            said.append(f"the {name} scatter by {scatter:.2g} {unit}, {more}")
        else:
            scale = 1.0
            said.append(f"the {name} scatter as stated, so the errors follow from the stated ones")
        std = np.asarray(std * scale, np.float64)
        white = columns / std[:, None]
        covariance = np.asarray(np.linalg.inv(white.T @ white), np.float64)
        return cls(np.asarray(solution, np.float64), covariance, std, np.asarray(residual, np.float64))

    def drop(self, columns: Array, further: Array) -> tuple[float, float]:
        """The value of a further column's coefficient, and the fall of χ² with it."""
        wide = np.column_stack([columns, further]) / self.std[:, None]
        target = self.residual / self.std
        found = np.linalg.lstsq(wide, target, rcond=None)[0]
        return float(found[-1]), float(target @ target - np.sum((target - wide @ found) ** 2))


def _angles(k: Array, at: Array) -> Array:
    zero, swing, delta = at
    return np.asarray(zero + swing * (-1.0) ** k * np.exp(-delta * k))


def _slopes(k: Array, at: Array) -> Array:
    """Derivatives of the angles by zero, first swing and decrement of half a period, shape (n, 3)."""
    _, swing, delta = at
    wave = (-1.0) ** k * np.exp(-delta * k)
    return np.column_stack([np.ones(k.size), wave, -k * swing * wave])


def _decay(k: Array, angle: Array) -> tuple[Array, Array]:
    """Zero, first swing and decrement of half a period by least squares, and the fitted swings."""
    from scipy.optimize import least_squares  # imported here because it is slow to load

    middle = float(np.median(0.5 * (angle[1:] + angle[:-1])))
    size = np.abs(angle - middle)
    delta = -float(np.polyfit(k, np.log(np.maximum(size, 1e-12 + 1e-3 * size.max())), 1)[0])
    start = [middle, float(angle[0] - middle), delta]

    def left(at: Array) -> Array:
        return np.asarray(angle - _angles(k, at))

    def slopes(at: Array) -> Array:
        return -_slopes(k, at)

    found = least_squares(left, start, jac=slopes, x_scale="jac")
    at = np.asarray(found.x)
    return at, (-1.0) ** k * np.exp(-at[2] * k)


def _bends(
    line: Array,
    k: Array,
    times: _Linear,
    angles: _Linear,
    columns: Array,
    course: Array,
    said: list[str],
    half: float,
) -> None:
    """Report a change of period or decrement along the decay beyond chance."""
    bend, drop = times.drop(line, k**2)
    if chdtrc(1, drop) < _RATE:
        change = 200.0 * bend * (k[-1] - 1.0) / half
        said.append(
            f"the period changes by {change:+.2g} % from the first to the last: the restoring moment is not "
            "linear, and ωn is a mean"
        )
    bend, drop = angles.drop(columns, -(k**2) * course)
    if chdtrc(1, drop) < _RATE:
        change = 4.0 * bend * float(k[-1])
        said.append(
            f"the decrement changes by {change:+.2g} from the first period to the last: the damping is not "
            "viscous, and ζ is a mean"
        )
