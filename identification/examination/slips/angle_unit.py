"""Readings of single runs in degrees, where the others are in radians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification import policy
from identification.examination.slips.base import Seen, StatementSlip
from identification.signal.noise import reading_noise
from identification.status import Outcome, Remark

_DEGREES = 180.0 / np.pi
_SUSPICIOUS = 10.0  # ratio to the amplitudes of other runs, from which the noise is compared


@dataclass(frozen=True)
class AngleInDegrees(StatementSlip):
    """Amplitude and noise of some runs are 57.3 times those of the others: degrees. Refused."""

    def find(self, seen: Seen) -> tuple[Remark, ...]:
        """Compare amplitudes and, where they differ much, the noise."""
        if len(seen.swings) < 2 or seen.campaign.sensor.plausible is False:
            return ()
        amplitudes = np.array([swing.amplitude for swing in seen.swings])
        least = float(amplitudes.min())
        large = amplitudes > _SUSPICIOUS * least
        if not large.any():
            return ()
        sensor = seen.campaign.sensor
        noise = np.array([reading_noise(swing.run.record, sensor) for swing in seen.swings])
        ratio = noise[large] / float(np.median(noise[~large]))
        if not np.all(np.abs(ratio / _DEGREES - 1.0) < policy.NOISE_RATIO):
            return ()
        ids = tuple(s.run.id for s, one in zip(seen.swings, large, strict=True) if one)
        what = f"amplitude and noise exceed those of the other runs, by {np.median(ratio):.3g} times: degrees"
        return (Remark(Outcome.REFUSED, ids, what, "name the column yaw_deg, or convert it to radians"),)
