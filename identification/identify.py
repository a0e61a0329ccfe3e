"""The one verb: a campaign in, an estimate out."""

from __future__ import annotations

from identification.estimate import Estimate
from identification.estimators import Estimator, make_estimator
from tunnel_sim.campaign import Campaign
from tunnel_sim.errors import TunnelError


def identify(
    campaign: Campaign, estimator: str | Estimator = "output_error", *, throw: bool = True
) -> Estimate:
    """Identify a campaign's coefficients and each of its runs.

    Args:
        campaign: the runs of one rig; angles in rad, stiffness in N m/rad, speed in m/s.
        estimator: a name of `identification.estimators.ALL_ESTIMATORS`, or an estimator with settings of its
            own, such as ``OutputError(cycles_per_window=5)``.
        throw: raise when there is no result at all; otherwise the estimate's status says so.

    Returns:
        The estimate. What could not be had is None, and its statuses say why and what would give it.

    Raises:
        TunnelError: for an unknown estimator, a campaign without runs, a wind-on run without air density,
            and, with ``throw``, when no run could be identified.
    """
    chosen = make_estimator(estimator) if isinstance(estimator, str) else estimator
    if not campaign.runs:
        raise TunnelError("campaign without runs", where=campaign.name, remedy="add at least one run")
    estimate = chosen.estimate(campaign)
    if throw and estimate.status.failed:
        what, _, remedy = estimate.status.value.partition(": ")
        raise TunnelError(what, where=campaign.name, remedy=remedy)
    return estimate
