"""An angle that jumps by a whole turn, as an encoder's does where its count begins again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.examination.slips.base import RecordSlip
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Record

_TURN = 2.0 * np.pi
#: Of a turn: step between samples, less whole turns. With ten samples per cycle, the fewest that are read, a swing of
#: a tenth of a turn steps by no more.
_SMOOTH = 0.1


@dataclass(frozen=True)
class WrappedAngle(RecordSlip):
    """The reading jumps by whole turns; unwrapped it is smooth. It is unwrapped."""

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Unwrap records in which all large steps are whole turns; rates and accelerations do not wrap."""
        if campaign.sensor.derivative:
            return campaign, ()
        runs, ids, count = [], [], 0
        for run in campaign.runs:
            steps = np.diff(run.record.yaw_rad)
            turns = np.round(steps / _TURN)
            jumps = int(np.count_nonzero(turns))
            if jumps and bool(np.all(np.abs(steps - _TURN * turns) < _SMOOTH * _TURN)):
                yaw = run.record.yaw_rad - _TURN * np.concatenate(([0.0], np.cumsum(turns)))
                run = replace(run, record=Record(run.record.time_s, yaw))
                ids.append(run.id)
                count += jumps
            runs.append(run)
        if not ids:
            return campaign, ()
        what = f"the angle jumps by whole turns, {count} times, as an encoder's that wraps; it is unwrapped"
        remark = Remark(Outcome.NOTED, tuple(ids), what, "write the angle without wraps, or shift its zero")
        return replace(campaign, runs=tuple(runs)), (remark,)
