"""The damping of a passive rig within its physical bounds: at least zero, at most the decay rate of the motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from scipy.special import ndtr, ndtri

from diagnosis.findings.cause_sizes import decay_of_swing
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients
from diagnosis.search.study import Study
from identification.show.quantity import Quantity

_WIDE = 30.0  # standard deviations over the allowed range from which the distribution counts as uniform
_FAR = 6.0  # standard deviations that contain the whole distribution


@dataclass(frozen=True)
class Truncated:
    """A normal distribution within bounds.

    Args:
        mean, std: mean and standard deviation within the bounds, in the quantity's unit.
        interval: central interval of 0.95, in the unit.
    """

    mean: float
    std: float
    interval: tuple[float, float]


def truncated(value: float, std: float, upper: float, probability: float) -> Truncated:
    """A normal distribution between 0 and a bound, in the unit of the first three.

    Args:
        value: mean of the unbounded distribution, clipped to the bounds.
        std: standard deviation of the unbounded distribution, above 0.
        upper: upper bound, above 0.
        probability: probability of the interval.
    """
    tail = 0.5 * (1.0 - probability)
    if std > _WIDE * upper:
        return Truncated(0.5 * upper, upper / math.sqrt(12.0), (tail * upper, (1.0 - tail) * upper))
    a, b = -value / std, (upper - value) / std
    inside = float(ndtr(b) - ndtr(a))
    at_a, at_b = (math.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi) for x in (a, b))
    moved = (at_a - at_b) / inside
    spread = math.sqrt(1.0 + (a * at_a - b * at_b) / inside - moved**2)
    low, high = (value + std * float(ndtri(ndtr(a) + t * inside)) for t in (tail, 1.0 - tail))
    return Truncated(value + std * moved, std * spread, (max(low, 0.0), min(high, upper)))


def within_bounds(given: Mapping[str, Quantity], study: Study) -> dict[str, Quantity]:
    """Coefficients with the damping of a passive rig within its bounds.

    Args:
        given: the coefficients of the answer, by name.

    Returns:
        The same coefficients. Where the deviation of ``zeta`` or ``mechanical_damping`` exceeds the bounds, the
        distribution is truncated to them: the interval is the truncated distribution's, and the standard
        deviation its root mean square distance from the value. The damping is not negative. Beside named causes
        in free decays without wind it is at most the decay rate of the fitted motion, since no such cause feeds
        the motion. Where the runs determine only the sum of the damping and another loss, the distribution
        within the bounds is uniform, even if the fit ends at a bound.
    """
    found, chosen = dict(given), study.settings.answer
    if not study.named:
        return found
    for name in ("zeta", "mechanical_damping"):
        estimate = given.get(name)
        shared = _shared(study.chosen)
        if estimate is None or estimate.std == 0.0 or (estimate.bound is not None and not shared):
            continue
        std = math.inf if estimate.std is None or shared else estimate.std
        upper = _greatest(study, name)
        if upper is None:
            if estimate.std is None or estimate.value - _FAR * estimate.std >= 0.0:
                continue
            std = estimate.std
            upper = max(estimate.value, 0.0) + _FAR * std
        if not (estimate.value - 2.0 * std < 0.0 or estimate.value + 2.0 * std > upper) or upper <= 0.0:
            continue
        value = min(max(estimate.value, 0.0), upper)
        own = truncated(value, min(std, 1e6 * upper), upper, chosen.coefficient_interval)
        apart = math.hypot(own.std, own.mean - value)
        found[name] = replace(
            estimate, value=value, std=min(std, apart), interval=own.interval, bound=None, determined=True
        )
    return found


def _shared(fit: Fit) -> bool:
    """Whether the runs cannot separate the mechanical damping from another loss."""
    if fit.left_open is None or "mechanical_damping" not in fit.problem.names:
        return False
    place = fit.problem.names.index("mechanical_damping")
    return bool(fit.left_open[place, place] > fit.covariance[place, place])


def _greatest(study: Study, name: str) -> float | None:
    """The decay rate of the fitted motion as a damping ratio or damping, with its uncertainty; None: not known."""
    fit, data = study.chosen, study.chosen.problem.data
    if data.driven or data.wind_on or study.chosen is study.nominal:
        return None
    motion = decay_of_swing(fit)
    if motion is None:
        return None
    frequency, ratio = motion
    inertia, _, stiffness = linear_coefficients(fit, 0)
    critical = data.model.critical_damping(inertia, stiffness)
    if critical is None:
        return None
    if any(kind.channel == "stiffness" for kind in fit.problem.effects):
        # the rate is ratio times frequency, and a stiffening spring raises the frequency of the swing
        ratio *= max(2.0 * inertia * frequency / critical, 1.0)
    # the decay rate is as accurate as the nominal model's damping, in noise as large as the misfit
    reach = 2.0 * _std(study.nominal) * math.sqrt(1.0 + max(fit.excess, 0.0)) / critical
    whole = ratio + reach
    return whole if name == "zeta" else whole * critical


def _std(nominal: Fit) -> float:
    name = "mechanical_damping"
    return nominal.std(name) if name in nominal.problem.names and nominal.bound(name) is None else 0.0
