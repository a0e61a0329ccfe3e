"""The end of a record in which the body rests beside its centre, held by dry friction.

A model without friction takes the place of rest for the sensor's zero if the rest is longer than the motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.decay.first_guess import starting_frequency
from identification.decay.residual_noise import reading_noise
from identification.examination.zeros import centre_of
from identification.policy import LEAST_SAMPLES, MISFIT_DEVIATIONS
from identification.remark import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

_SQUARABLE = 1e100  # of the reading's unit: squares of larger readings overflow
_RESTING = 0.01  # of the largest excursion: the body rests while the reading stays as near its last place
_KEPT = 3.0  # cycles of rest: they show that the motion ended, and where
_SETTLED = 0.25  # of the distance from the centre: a reading that moves more at rest drifts


def without_rest(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Shorten records that end with a long rest beside the centre.

    Args:
        campaign: the runs, from their releases on.

    Returns:
        The campaign, itself if no record is shortened, and a remark for each run that was. A rest is left where it
        is unless it is longer than the motion and off the centre beyond chance.
    """
    found = [_without_rest(run, campaign.sensor) for run in campaign.runs]
    remarks = tuple(remark for _, remark in found if remark is not None)
    return (replace(campaign, runs=tuple(run for run, _ in found)) if remarks else campaign), remarks


def _without_rest(run: Run, sensor: SensorProperties) -> tuple[Run, Remark | None]:
    record, resolution = run.record, sensor.resolution or 0.0
    time, yaw = record.time_s, record.yaw_rad
    if not float(np.abs(yaw).max()) < _SQUARABLE:
        return run, None  # refused later, for what it is
    last = float(np.median(yaw[-max(yaw.size // 20, 1) :]))
    near = max(_RESTING * float(np.abs(yaw - last).max()), resolution, 5.0 * reading_noise(record, sensor))
    moving = np.flatnonzero(np.abs(yaw - last) > near)
    if moving.size < LEAST_SAMPLES or 2 * int(moving[-1]) >= yaw.size:
        return run, None
    end = int(moving[-1]) + 1
    centre = centre_of(replace(run, record=Record(time[:end], yaw[:end])), resolution)
    frequency = starting_frequency(Record(time[:end], yaw[:end]))
    if centre is None or frequency is None:
        return run, None
    early, late = (float(half.mean()) for half in np.array_split(yaw[end:], 2))
    off = abs(0.5 * (early + late) - centre.zero)
    if off < MISFIT_DEVIATIONS * centre.std or abs(late - early) > _SETTLED * off:
        return run, None
    kept = int(np.searchsorted(time, time[end] + _KEPT / frequency))
    if kept >= yaw.size:
        return run, None
    remark = Remark(
        Outcome.CUT,
        (run.id,),
        f"at rest from {time[end]:.3f} s on, {off:.2g} {sensor.unit} beside the centre of the motion; the record "
        f"is used up to {time[kept]:.3f} s",
        "cut the record by hand if that is wrong",
    )
    return replace(run, record=Record(time[:kept], yaw[:kept])), remark
