"""Estimates that the runs do not determine: a standard deviation larger than any meaning of the quantity."""

from __future__ import annotations

import math
from dataclasses import replace

from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.spectra import linear_coefficients
from diagnosis.policy import UNDETERMINED_FACTOR
from diagnosis.result import ParameterEstimate
from tunnel_sim.effects.parameters import ParameterInfo


def meant_parameter(found: ParameterEstimate, info: ParameterInfo, swing: float) -> ParameterEstimate:
    """A fitted parameter, without its standard deviation where that says nothing.

    Args:
        found: the estimate.
        info: the parameter's usual size and range.
        swing: largest angle of the motion, rad.

    Returns:
        The estimate; not determined where its standard deviation exceeds that of a uniform distribution over the
        range allowed, or ten times the parameter's value and usual size.
    """
    lower, upper = info.fit_range(swing)
    uniform = (upper - lower) / math.sqrt(12.0)
    size = UNDETERMINED_FACTOR * max(abs(found.value), info.scale)
    return _limited(found, min(uniform, size))


def meant_coefficient(found: ParameterEstimate, fit: Fit, name: str) -> ParameterEstimate:
    """A coefficient, without its standard deviation where that says nothing.

    Args:
        found: the estimate.
        fit: that it comes from.
        name: ``cn_beta``, ``cn_r``, ``omega_n``, ``zeta`` or a parameter of a joint's law.

    Returns:
        The estimate; not determined where its standard deviation exceeds ωn itself, a damping ratio of 1, or the
        coefficient whose moment is that of the stiffness or of the critical damping in the fastest wind.
    """
    if name == "omega_n":
        return _limited(found, abs(found.value))
    if name == "zeta":
        return _limited(found, 1.0)
    if not name.startswith("cn_"):
        return found
    return _limited(found, min((_own_moment(fit, i, name) for i in _windy(fit)), default=math.inf))


def _limited(found: ParameterEstimate, greatest: float) -> ParameterEstimate:
    if found.std is None or 0.0 < found.std <= greatest:  # 0: the readings do not depend on it
        return found
    return replace(found, std=None, determined=False)


def _windy(fit: Fit) -> list[int]:
    return [i for i, run in enumerate(fit.problem.data.runs) if run.wind_on]


def _own_moment(fit: Fit, index: int, name: str) -> float:
    """The coefficient whose moment would be that of a run's stiffness, or of its critical damping."""
    data = fit.problem.data
    run = data.runs[index]
    inertia, _, stiffness = linear_coefficients(fit, index)
    pressure = data.air_moment(run)
    if name == "cn_beta":
        return abs(stiffness) / pressure
    return 2.0 * math.sqrt(inertia * abs(stiffness)) * run.wind_speed / (pressure * data.reference_length)
