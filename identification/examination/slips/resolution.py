"""A stated resolution that the readings contradict."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification import policy
from identification.examination.slips.base import RecordSlip
from identification.signal.noise import measured_noise
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array

_LOOKED_AT = 4  # records: the resolution is common to all
_OFF_LATTICE = 0.1  # of a step: a reading farther from every multiple of the resolution is not on its lattice
_ROUNDING = 1e-4  # of a step: no change
_MOST = 0.2  # share of the changes off the lattice: a filter or a few outliers may move some


@dataclass(frozen=True)
class ResolutionTooCoarse(RecordSlip):
    """The readings are far finer than their stated resolution. It is not used: as noise it would hide gaps."""

    def mend(self, campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
        """Drop the resolution where the first records are off its lattice, and smooth or small beside it."""
        step = campaign.sensor.resolution
        if not step:
            return campaign, ()
        records = [run.record for run in campaign.runs[:_LOOKED_AT]]
        if not all(_off_lattice(record.yaw_rad, step) for record in records):
            return campaign, ()
        swing = float(np.median([0.5 * np.ptp(record.yaw_rad) for record in records]))
        noise = float(np.median([measured_noise(record)[0] for record in records]))
        if swing > policy.LEAST_STEPS * step and noise > policy.FINER_THAN_STATED * step:
            return campaign, ()
        what = (
            f"resolution = {step:.3g} {campaign.sensor.unit} contradicts the readings, which swing by ±{swing:.3g} "
            f"{campaign.sensor.unit} in far finer steps; it is not used"
        )
        remark = Remark(
            Outcome.NOTED, tuple(run.id for run in campaign.runs), what, "correct resolution, or leave it out"
        )
        return replace(campaign, sensor=replace(campaign.sensor, resolution=None)), (remark,)


def _off_lattice(yaw: Array, step: float) -> bool:
    changes = np.abs(np.diff(yaw)) / step
    changes = changes[changes > _ROUNDING]
    whole = np.round(changes)
    return (
        changes.size > 0 and float(np.mean((whole == 0.0) | (np.abs(changes - whole) > _OFF_LATTICE))) > _MOST
    )
