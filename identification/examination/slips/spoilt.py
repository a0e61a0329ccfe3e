"""Samples that are not measured: times after a jump of the clock, and values that stand for missing readings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification import policy
from identification.examination.slips.base import RecordSlip
from identification.signal.decay_fit import Reading, fit_run, projected_cost
from identification.signal.frequency import starting_decay
from identification.status import Outcome, Remark
from tunnel_sim.files.plausible import clock_jump, jump_words, standing_for_missing, without_jump
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.record import Record

_WORSE = 4.0  # times the sum of squares without the jump


@dataclass(frozen=True)
class ClockJumps(RecordSlip):
    """The times jump once while the reading continues. Refused: the frequency would be wrong."""

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Seek a jump in every free decay."""
        remedy = "correct the clock of the samples after it, or make two runs of the file"
        remarks = [
            Remark(Outcome.REFUSED, (run.id,), jump_words(run.record, at), remedy)
            for run in campaign.runs
            if run.drive is None and (at := clock_jump(run.record)) is not None and _jumps(run.record, at)
        ]
        return campaign, tuple(remarks)


def _jumps(record: Record, at: int) -> bool:
    """Whether the decay of the longer part goes on in the other part without the jump, and not by the times."""
    longer = slice(None, at + 1) if 2 * at > record.time_s.size else slice(at + 1, None)
    part = Record(record.time_s[longer], record.yaw_rad[longer])
    start = starting_decay(part)
    fit = None if start is None else fit_run(Reading.from_record(part), start)
    if fit is None or not fit.runs:
        return True
    decay, power = fit.runs[0].decay, float(np.sum((record.yaw_rad - record.yaw_rad.mean()) ** 2))
    stated, mended = (
        projected_cost(Reading.from_record(one), decay) for one in (record, without_jump(record, at))
    )
    return stated > max(policy.GROSS_MISFIT * power, _WORSE * mended)


@dataclass(frozen=True)
class StandingForMissing(RecordSlip):
    """A value far from all others, such as -9.99, stands for missing readings. Those samples are left out."""

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Leave out these samples of the free decays."""
        runs, remarks = [], []
        for run in campaign.runs:
            record = run.record
            standing = None if run.drive is not None else standing_for_missing(record.yaw_rad)
            if standing is not None:
                value, count = float(record.yaw_rad[standing][0]), int(standing.sum())
                what = (
                    f"{counted(count, 'reading')} of {value:.6g} {campaign.sensor.unit}, far from all others, as a "
                    "value that stands for a missing one; left out"
                )
                remarks.append(
                    Remark(Outcome.CUT, (run.id,), what, "check the logger and the sensor's cable")
                )
                run = replace(run, record=Record(record.time_s[~standing], record.yaw_rad[~standing]))
            runs.append(run)
        return (replace(campaign, runs=tuple(runs)) if remarks else campaign), tuple(remarks)
