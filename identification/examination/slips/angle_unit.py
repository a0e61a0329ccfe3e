"""Readings of some runs in degrees, or taken for degrees, where the others are in radians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification import policy
from identification.examination.slips.base import SlipEvidence, StatementSlip
from identification.signal.noise import measured_noise
from identification.status import Outcome, Remark

_DEGREES = 180.0 / np.pi
_SUSPICIOUS = 10.0  # ratio to the amplitudes of other runs, from which the noise is compared


@dataclass(frozen=True)
class AngleInDegrees(StatementSlip):
    """Amplitude and noise of some runs are 57.3 times those of the others, or 1/57.3 of them. Refused.

    The fewer runs are the wrong ones. Of as many large as small ones either may be wrong.
    """

    def find(self, seen: SlipEvidence) -> tuple[Remark, ...]:
        """Compare amplitudes and, where they differ much, the noise."""
        if len(seen.swings) < 2 or seen.campaign.sensor.plausible is False:
            return ()
        amplitudes = np.array([swing.amplitude for swing in seen.swings])
        large = amplitudes > _SUSPICIOUS * float(amplitudes.min())
        if not large.any():
            return ()
        noise = np.array([measured_noise(swing.run.record)[0] for swing in seen.swings])
        ratio = float(np.median(noise[large]) / np.median(noise[~large]))
        alike = [
            np.abs(noise[some] / np.median(noise[some]) - 1.0) < policy.NOISE_RATIO
            for some in (large, ~large)
        ]
        if abs(ratio / _DEGREES - 1.0) > policy.NOISE_RATIO or not all(np.all(one) for one in alike):
            return ()
        ids = [
            tuple(s.run.id for s, one in zip(seen.swings, some, strict=True) if one)
            for some in (large, ~large)
        ]
        exceed = f"amplitude and noise exceed those of the other runs, by {ratio:.3g} times: degrees"
        below = f"amplitude and noise are 1/{ratio:.3g} of those of the other runs: radians in a column of degrees"
        if len(ids[0]) < len(ids[1]):
            remedy = "name the column yaw_deg, or convert it to radians"
            return (Remark(Outcome.REFUSED, ids[0], exceed, remedy),)
        if len(ids[0]) > len(ids[1]):
            return (
                Remark(Outcome.REFUSED, ids[1], below, "name the column yaw_rad, or convert it to degrees"),
            )
        what = f"{exceed}; or, of runs {', '.join(ids[1])}, {below}"
        remedy = "name the columns yaw_deg or yaw_rad by their units"
        return (Remark(Outcome.REFUSED, ids[0] + ids[1], what, remedy),)
