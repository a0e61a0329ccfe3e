"""What an estimator returned: an estimate of the runs that it was given, with finite values in the stated units.

Every command asks an estimator through `identify`, which looks at the answer here; so does `check_estimator`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identification.estimate import UNITS, Estimate, Quantity, RunEstimate, Status
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

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
    """An estimator returned something else than an estimate of the campaign that it was given."""


def checked_return(found: object, name: str, campaign: Campaign, of: str = "") -> Estimate:
    """What an estimator returned for a campaign.

    Args:
        name: of the estimator.
        of: words for the campaign in messages; empty: its name.

    Raises:
        WrongReturn: when it is not an estimate, its runs are not those of the campaign in their order, or a value
            is not finite, has another unit, or lacks its standard deviation.
    """
    more = "" if of else "; identification.check_estimator checks a class"
    of = of or f"campaign '{campaign.name}'"

    def wrong(what: str, remedy: str) -> WrongReturn:
        return WrongReturn(what, where=f"estimator {name}", remedy=f"{remedy}{more}")

    if not isinstance(found, Estimate):
        raise wrong(f"returns {type(found).__name__} with {of}", "return an identification.Estimate")
    given, wanted = [getattr(run, "id", None) for run in found.runs], [run.id for run in campaign.runs]
    if given != wanted or not all(isinstance(run, RunEstimate) for run in found.runs):
        what = f"returns the runs {given} with {of}, and not {wanted}"
        raise wrong(what, "give a RunEstimate for each run, in the campaign's order")
    owners: list[tuple[Estimate | RunEstimate, Mapping[str, str], str, str]] = [
        (found, CAMPAIGN_UNITS, f"with {of}", f"the campaign with {of}"),
        *((run, RUN_UNITS, f"of run {run.id} with {of}", f"run {run.id} with {of}") for run in found.runs),
    ]
    for owner, units, at, whose in owners:
        for quantity, unit in units.items():
            fault = _fault(quantity, getattr(owner, quantity), unit, at)
            if fault is not None:
                raise wrong(*fault)
        if not owner.statuses or not all(isinstance(one, Status) for one in owner.statuses):
            what = f"the statuses of {whose} are {owner.statuses!r}"
            raise wrong(what, "give a tuple of identification.Status")
    shape, count = [len(row) for row in found.covariance], len(found.parameters)
    if shape != [count] * count:
        what = f"the covariance with {of} has rows of {shape} for {count} parameters"
        raise wrong(what, "give one row and column for each parameter")
    if not np.isfinite(found.covariance_matrix).all():
        raise wrong(f"the covariance with {of} holds NaN or an infinity", "give finite numbers")
    return found


def _fault(name: str, quantity: object, unit: str, of: str) -> tuple[str, str] | None:
    """What is wrong with a quantity, and the remedy; None where nothing is, and where it is None."""
    if quantity is None:
        return None
    if not isinstance(quantity, Quantity):
        return f"{name} {of} is {quantity!r}", f'give Quantity(value, std, "{unit}")'
    if quantity.unit != unit:
        return f"the unit of {name} {of} is {quantity.unit!r}", f"give it in {unit}"
    if not np.isfinite([quantity.value, quantity.std]).all():
        what = f"{name} {of} is {quantity.value} ± {quantity.std}"
        return what, "give None and a status where there is no value"
    if quantity.std < 0.0:
        return f"the standard deviation of {name} {of} is {quantity.std}", "give its uncertainty, 0 or more"
    ends = quantity.interval
    if ends is not None and not ends[0] <= quantity.value <= ends[1]:
        what = f"the interval {ends} of {name} {of} does not hold its value {quantity.value}"
        return what, "give the lower end first, or None"
    return None
