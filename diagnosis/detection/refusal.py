"""Campaigns that cannot be diagnosed are refused in one line, before the runs are fitted together."""

from __future__ import annotations

import numpy as np

from diagnosis.fitting.least_squares import Fit
from identification.estimate import Status
from identification.signal.run_fit import NO_WINDOWS, identify_run
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

_HOPELESS = (Status.NO_OSCILLATION, Status.NOT_DETERMINED)


def refuse_hopeless(campaign: Campaign) -> None:
    """Refuse a campaign with a run that shows no decaying motion; the estimators leave out the same runs.

    Raises:
        TunnelError: for the first such run.
    """
    for run in campaign.runs:
        if run.drive is not None:
            continue
        status = identify_run(run, campaign.sensor, cycles_per_window=NO_WINDOWS).estimate.status
        if status in _HOPELESS:
            what, _, remedy = status.value.partition(": ")
            raise TunnelError(what, where=f"run {run.id}", remedy=f"{remedy}; or leave the run out")


def refuse_indefinite(fit: Fit) -> None:
    """Refuse a nominal fit that the runs do not determine.

    Args:
        fit: of the nominal model.

    Raises:
        TunnelError: when a parameter or its standard deviation is not finite, or the inertia is not positive.
    """
    values = dict(zip(fit.problem.names, fit.point.common.tolist(), strict=True))
    numbers = np.concatenate(
        (fit.point.common, fit.point.release.ravel(), fit.covariance.ravel(), [fit.total])
    )
    if not np.isfinite(numbers).all():
        raise TunnelError(
            "the runs do not determine the nominal model",
            remedy="check that they are free decays of springs and wind speeds that differ",
        )
    if values.get("yaw_inertia", 1.0) <= 0.0:
        what, _, remedy = Status.INERTIA_NOT_POSITIVE.value.partition(": ")
        raise TunnelError(what, remedy=remedy)
