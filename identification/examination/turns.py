"""Angles beyond half a turn, which may be degrees."""

from __future__ import annotations

import numpy as np

from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign


def wide_swings(campaign: Campaign) -> tuple[Remark, ...]:
    """Note runs that swing by more than half a turn to either side.

    Returns:
        One remark on these runs; none where there are none, where the sensor does not measure an angle, or where
        the campaign states ``plausible = false``.
    """
    if campaign.sensor.derivative > 0 or campaign.sensor.plausible is False:
        return ()
    swings = {run.id: 0.5 * float(np.ptp(run.record.yaw_rad)) for run in campaign.runs}
    wide = tuple(name for name, swing in swings.items() if swing > np.pi)
    if not wide:
        return ()
    largest = max(swings.values())
    return (
        Remark(
            Outcome.NOTED,
            wide,
            f"the angle swings by up to ±{largest:.3g} rad, more than half a turn",
            "if these are degrees, name the column yaw_deg",
        ),
    )
