"""A constant reading while the body must still move: a padded file, a stopped logger, a body held by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.examination.slips.base import RecordSlip
from identification.policy import LEAST_SAMPLES
from identification.signal.frequency import starting_frequency
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.record import Record

_STUCK = 0.6  # of a cycle
_MOVING = 0.1  # of the record's range: the swings on both sides of a stuck stretch
_STANDS = 0.01  # of the record's largest excursion: a constant reading stays as near its last value,
_NOISE = 5.0  # or within as many standard deviations of its last fiftieth
_LEAST_CYCLES = (
    0.75  # of standing: at a turning point a swing stays within a hundredth for a twentieth of a cycle
)
_LEAST_KEPT = 2.0  # cycles of motion before it, whose last swings are compared
#: Dry friction reduces every swing by the same step and stops the body from a swing of at most one such step;
#: viscous damping reduces it by a share. A swing of more than three steps does not stop by itself.
_STEPS = 3.0
_CLEAR = 5.0  # bands of the constant reading that the last swing must exceed


@dataclass(frozen=True)
class StuckReading(RecordSlip):
    """The reading keeps one value to the last bit for most of a cycle, between swings. Those samples are left out.

    A clipped or coarse reading keeps a value for less than half a cycle, at its turning points.
    """

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Leave out the stretches in which the reading of a free decay is stuck."""
        runs, remarks = [], []
        for run in campaign.runs:
            stuck = None if run.drive is not None else stuck_samples(run.record)
            if stuck is not None:
                time, yaw = run.record.time_s, run.record.yaw_rad
                where = np.flatnonzero(stuck)
                what = (
                    f"between {time[where[0]]:.3f} and {time[where[-1]]:.3f} s the reading is constant while the "
                    f"body moves; {counted(where.size, 'sample')} left out"
                )
                remarks.append(
                    Remark(Outcome.CUT, (run.id,), what, "check the logger and the sensor's cable")
                )
                run = replace(run, record=Record(time[~stuck], yaw[~stuck]))
            runs.append(run)
        return (replace(campaign, runs=tuple(runs)) if remarks else campaign), tuple(remarks)


def stuck_samples(record: Record) -> NDArray[np.bool_] | None:
    """The samples that repeat one value between swings for `_STUCK` cycles or longer; None where there are none."""
    yaw, time = record.yaw_rad, record.time_s
    starts = np.concatenate(([0], np.flatnonzero(np.diff(yaw)) + 1))  # of stretches of one value
    lengths = np.diff(np.concatenate((starts, [yaw.size])))
    longest = int(lengths.max())
    if longest < LEAST_SAMPLES or (frequency := starting_frequency(record)) is None:
        return None
    cycle = max(int(record.sample_rate / frequency), 1)
    long = np.flatnonzero(lengths >= _STUCK * cycle)
    stuck = np.zeros(yaw.size, dtype=np.bool_)
    for place in long.tolist():
        begin, end = int(starts[place]), int(starts[place] + lengths[place])
        before, after = yaw[max(begin - cycle, 0) : begin], yaw[end : end + cycle]
        if before.size < cycle // 2 or after.size < cycle // 2:
            continue  # at an end: before the release, or at rest
        swings = min(float(np.ptp(before)), float(np.ptp(after)))
        if swings > _MOVING * float(np.ptp(yaw)):
            stuck[begin:end] = True
    kept = float(np.sum(~stuck)) * (time[-1] - time[0]) / yaw.size
    return stuck if stuck.any() and kept * frequency > _LEAST_KEPT else None


@dataclass(frozen=True)
class ConstantTail(RecordSlip):
    """The reading is constant from one moment on, after swings that cannot have ended so soon. The tail is cut."""

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Cut every free decay to the part before its tail."""
        runs, remarks = [], []
        for run in campaign.runs:
            at = None if run.drive is not None else standing_from(run.record)
            if at is not None:
                time, yaw = run.record.time_s, run.record.yaw_rad
                what = (
                    f"from {time[at]:.3f} s the reading is constant at {float(np.median(yaw[at:])):.4g} "
                    f"{campaign.sensor.unit}, too soon for the motion to have decayed; this part is left out"
                )
                remedy = "check for a padded file, a stopped logger or a body held by hand"
                remarks.append(Remark(Outcome.CUT, (run.id,), what, remedy))
                run = replace(run, record=Record(time[:at], yaw[:at]))
            runs.append(run)
        return (replace(campaign, runs=tuple(runs)) if remarks else campaign), tuple(remarks)


def standing_from(record: Record) -> int | None:
    """The first sample of a constant tail after a large swing; None where there is none."""
    yaw, time = record.yaw_rad, record.time_s
    end = yaw[-max(yaw.size // 50, 1) :]
    away = np.abs(yaw - float(np.median(end)))
    band = max(_STANDS * float(away.max()), _NOISE * float(end.std()))
    moving: NDArray[np.intp] = np.flatnonzero(away > band)
    if moving.size < LEAST_SAMPLES or int(moving[-1]) >= yaw.size - LEAST_SAMPLES:
        return None
    at = int(moving[-1]) + 1
    # a body that comes to rest is still for long after small swings: only a sudden end needs a closer look
    frequency = starting_frequency(Record(time[:at], yaw[:at]))
    if frequency is None or (time[-1] - time[at]) * frequency < _LEAST_CYCLES:
        return None
    cycle = int(np.searchsorted(time, time[0] + 1.0 / frequency))
    if at < _LEAST_KEPT * cycle:
        return None
    parts = yaw[at - 2 * cycle : at - cycle], yaw[at - cycle : at]
    before, after = (0.5 * float(np.ptp(part)) for part in parts)
    falls = 0.5 * (before - after)  # in half a cycle
    return at if after > max(_STEPS * falls, _CLEAR * band) else None
