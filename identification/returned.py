"""A check of an estimator's result: an estimate of the given runs, with finite values in the stated units.

`identify`, and through it every command, and `check_estimator` check the answer of an estimator here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isfinite

import numpy as np

from identification.estimate import PARAMETERS, UNITS, Estimate, RunEstimate, Status
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError, one_line, raised_line
from tunnel_sim.vocabulary.quantities import PerParameter, Square
from tunnel_sim.vocabulary.record import Array

RUN_UNITS: Mapping[str, str] = {
    "omega_n": "rad/s",
    "zeta": "1",
    "initial_angle": "rad",
    "initial_rate": "rad/s",
    "sensor_zero": "rad",
    "aerodynamic_stiffness": "N m/rad",
    "aerodynamic_damping": "N m s/rad",
    "process_noise": "rad2/s3",
}
"""Quantities of a run, each with its unit."""
CAMPAIGN_UNITS: Mapping[str, str] = {
    **UNITS,
    "sensor_zero": "rad",
    "wind_off_inertia": "kg m2",
    "wind_off_intercept": "N m/rad",
}
"""Quantities of a campaign, each with its unit."""


class WrongReturn(TunnelError):
    """An estimator did not return an estimate of the given campaign."""


Fault = tuple[str, str]
"""The fault, and the remedy."""
_SAME_STD = 1e-3  # relative: a standard deviation may be rounded to three digits or more
_ROUNDING = 1e-6  # tolerance of a correlation: a covariance is a product of matrices


def checked_return(found: object, name: str, campaign: Campaign, of: str = "") -> Estimate:
    """The value that an estimator returned for a campaign, checked.

    Args:
        name: of the estimator.
        of: words for the campaign in messages; empty: its name.

    Raises:
        WrongReturn: when it is not an estimate; its runs are not the campaign's in their order; a value is not
            a finite number, has another unit, or lacks its standard deviation; the covariance does not fit the
            coefficients; or it cannot be written as JSON.
    """
    more = "" if of else "; identification.check_estimator checks a class"
    of = of or f"campaign '{campaign.name}'"
    if isinstance(found, Estimate):
        fault = _fault(found, campaign, of)
        if fault is None:
            return found
    else:
        fault = f"returns {type(found).__name__} with {of}", "return an identification.Estimate"
    what, remedy = fault
    raise WrongReturn(what, where=f"estimator {name}", remedy=f"{remedy}{more}")


def _fault(estimate: Estimate, campaign: Campaign, of: str) -> Fault | None:
    """The first fault of an answer; None if there is none."""
    if not isinstance(estimate.runs, tuple):
        return f"the runs with {of} are {_described(estimate.runs)}", "give a tuple of RunEstimate"
    given, wanted = [getattr(run, "id", None) for run in estimate.runs], [run.id for run in campaign.runs]
    if given != wanted or not all(isinstance(run, RunEstimate) for run in estimate.runs):
        what = f"returns the runs {given} with {of}, and not {wanted}"
        return what, "give a RunEstimate for each run, in the campaign's order"
    owners: list[tuple[Estimate | RunEstimate, Mapping[str, str], str, str]] = [
        (estimate, CAMPAIGN_UNITS, f"with {of}", f"the campaign with {of}"),
        *((run, RUN_UNITS, f"of run {run.id} with {of}", f"run {run.id} with {of}") for run in estimate.runs),
    ]
    for owner, units, at, whose in owners:
        for quantity, unit in units.items():
            fault = _fault_of_quantity(quantity, getattr(owner, quantity), unit, at)
            if fault is not None:
                return fault
        statuses = owner.statuses
        known = isinstance(statuses, tuple) and all(isinstance(one, Status) for one in statuses)
        if not (known and statuses):
            return f"the statuses of {whose} are {statuses!r}", "give a tuple of identification.Status"
    return _fault_of_covariance(estimate, of) or _fault_as_json(estimate, of)


def _fault_of_quantity(name: str, quantity: object, unit: str, of: str) -> Fault | None:
    """The first fault of a quantity; None without a fault, and for a quantity that is None."""
    if quantity is None:
        return None
    if not isinstance(quantity, Quantity):
        return f"{name} {of} is {quantity!r}", f'give Quantity(value, std, "{unit}")'
    if quantity.unit != unit:
        return f"the unit of {name} {of} is {quantity.unit!r}", f"give it in {unit}"
    std = quantity.std
    for part, number in (("value", quantity.value), ("standard deviation", std)):
        if not _is_number(number):
            what = f"the {part} of {name} {of} is {_described(number)}"
            return what, "give one number, such as float(values.mean())"
    if std is None or not (isfinite(quantity.value) and isfinite(std)):
        what = f"{name} {of} is {quantity.value} ± {quantity.std}"
        return what, "give None and a status where there is no value"
    if std < 0.0:
        return f"the standard deviation of {name} {of} is {quantity.std}", "give its uncertainty, 0 or more"
    ends = quantity.interval
    if ends is None:
        return None
    if not (isinstance(ends, tuple) and len(ends) == 2 and all(map(_is_number, ends))):
        return f"the interval of {name} {of} is {_described(ends)}", "give a tuple of two numbers, or None"
    if not ends[0] <= quantity.value <= ends[1]:
        what = f"the interval {ends} of {name} {of} does not hold its value {quantity.value}"
        return what, "give the lower end first, or None"
    return None


def _is_number(value: object) -> bool:
    """Whether a value is one number that JSON can express; NumPy's float64 is a float."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _described(value: object) -> str:
    """A wrong value in words, with its type unless the text shows it."""
    return "None" if value is None else f"{type(value).__name__} {one_line(repr(value), 60)}"


def _fault_of_covariance(estimate: Estimate, of: str) -> Fault | None:
    """The first fault of the covariance of the coefficients; None if there is none."""
    given = tuple(name for name in PARAMETERS if getattr(estimate, name) is not None)
    names, rows = estimate.parameters, estimate.covariance
    if not isinstance(names, tuple) or sorted(map(str, names)) != sorted(given):
        what = f"gives {', '.join(given) or 'no coefficient'} with {of}, and parameters is {names!r}"
        return what, "name the coefficients in a tuple as parameters, in the order of the covariance"
    if not (isinstance(rows, tuple) and all(isinstance(row, tuple) for row in rows)):
        what = f"the covariance with {of} is {_described(rows)}"
        return what, "give a tuple of rows, each a tuple of numbers: tuple(map(tuple, matrix.tolist()))"
    if [len(row) for row in rows] != [len(names)] * len(names):
        what = (
            f"the covariance with {of} has rows of {[len(row) for row in rows]} for {len(names)} parameters"
        )
        return what, "give one row and column for each parameter"
    strange = next((one for row in rows for one in row if not _is_number(one)), 0.0)
    if not _is_number(strange):
        return f"the covariance with {of} holds {_described(strange)}", "give numbers"
    matrix = estimate.covariance_matrix
    if not np.isfinite(matrix).all():
        return f"the covariance with {of} contains NaN or an infinity", "give finite numbers"
    stds = np.array([getattr(estimate, name).std for name in names])
    return _fault_of_variances(matrix, stds, names, of) or _fault_of_correlations(matrix, stds, of)


def _fault_of_variances(matrix: Array, stds: Array, names: tuple[str, ...], of: str) -> Fault | None:
    """The first variance that is negative, or that is not the square of the stated standard deviation.

    Args:
        matrix: the covariance, shape (p, p).
        stds: standard deviations of the named values, shape (p,).
    """
    for name, variance, std in zip(names, matrix.diagonal().tolist(), stds.tolist(), strict=True):
        if variance < 0.0:
            what = f"the variance of {name} in the covariance with {of} is negative ({variance:.3g})"
            return what, "give the square of its standard deviation"
        if not np.isclose(variance**0.5, std, rtol=_SAME_STD, atol=0.0):
            what = (
                f"the covariance with {of} does not have the standard deviations of the values: "
                f"{variance**0.5:.3g} for {name}, whose std is {std:.3g}"
            )
            return what, "give std as the root of the diagonal"
    return None


def _fault_of_correlations(matrix: Square, stds: PerParameter, of: str) -> Fault | None:
    """Whether a covariance with right variances is invalid: not symmetric, or not positive semidefinite."""
    scale = np.where(stds > 0.0, stds, 1.0)  # an exact value has no correlation
    correlations = matrix / scale[:, None] / scale
    if not np.allclose(correlations, correlations.T, rtol=0.0, atol=_ROUNDING):
        return f"the covariance with {of} is not symmetric", "give the covariance of a pair twice"
    if stds.size and np.linalg.eigvalsh(correlations)[0] < -_ROUNDING:
        what = f"the covariance with {of} is not positive semidefinite"
        return what, "give correlations between -1 and 1"
    return None


def _fault_as_json(found: Estimate, of: str) -> Fault | None:
    """Whether an estimate cannot be written as JSON and read again, as with an array in a window."""
    try:
        again = Estimate.from_json_dict(json.loads(json.dumps(found.to_json_dict(), allow_nan=False)))
    except (TypeError, ValueError, AttributeError, TunnelError) as error:
        what = f"the estimate with {of} cannot be written as JSON ({raised_line(error)})"
        return what, "use plain floats and tuples, and None for what is not known"
    if again != found:
        what = f"the estimate with {of} is not the same after it was written as JSON"
        return what, "use plain floats and tuples"
    return None
