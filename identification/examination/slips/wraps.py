"""An angle that jumps by a whole turn, as an encoder's does where its count restarts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.examination.slips.base import RecordSlip
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array, Record

_TURN = 2.0 * np.pi
#: Of a turn: step between samples, less whole turns. With ten samples per cycle a swing of a tenth of a turn has no
#: larger steps.
_SMOOTH = 0.1


@dataclass(frozen=True)
class WrappedAngle(RecordSlip):
    """The reading jumps by whole turns; unwrapped it is smooth. It is unwrapped."""

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Unwrap records in which all large steps are whole turns, and shift them to the turn of the other runs.

        Rates and accelerations do not wrap.
        """
        if campaign.sensor.derivative:
            return campaign, ()
        turns = {run.id: found for run in campaign.runs if (found := _turns(run.record)) is not None}
        if not turns:
            return campaign, ()
        whole = {
            run.id: run.record.yaw_rad - _TURN * turns[run.id] if run.id in turns else run.record.yaw_rad
            for run in campaign.runs
        }
        rest = [float(np.median(whole[run.id])) for run in campaign.runs if run.id not in turns]
        place = float(np.median(rest)) if rest else float(np.median(whole[next(iter(turns))]))
        runs = []
        for run in campaign.runs:
            yaw = whole[run.id]
            off = _TURN * round((float(np.median(yaw)) - place) / _TURN) if run.id in turns else 0.0
            runs.append(replace(run, record=Record(run.record.time_s, yaw - off)) if run.id in turns else run)
        jumps = sum(int(np.count_nonzero(np.diff(found))) for found in turns.values())
        what = f"the angle jumps by whole turns, {jumps} times, as an encoder's that wraps; it is unwrapped"
        remedy = "write the angle without wraps, or shift its zero"
        return replace(campaign, runs=tuple(runs)), (Remark(Outcome.NOTED, tuple(turns), what, remedy),)


def _turns(record: Record) -> Array | None:
    """The whole turns between each sample and the first; None where the record does not wrap."""
    steps = np.diff(record.yaw_rad)
    turns = np.round(steps / _TURN)
    if not turns.any() or not bool(np.all(np.abs(steps - _TURN * turns) < _SMOOTH * _TURN)):
        return None
    return np.concatenate(([0.0], np.cumsum(turns)))
