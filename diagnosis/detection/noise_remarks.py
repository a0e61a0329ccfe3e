"""Remarks on the noise of a campaign."""

from __future__ import annotations

import numpy as np

from diagnosis.detection.sensor_noise import Noise, NoiseTrend
from identification.status import Outcome, Remark


def noise_remarks(noise: Noise, trend: NoiseTrend) -> tuple[Remark, ...]:
    """What the user should know of the noise.

    Args:
        trend: of the noise with the motion.

    Returns:
        Remarks where the noise is coloured, and where the sampling is too slow to compare it with the motion.
    """
    found = []
    runs = tuple(noise.variance)
    if noise.colour is not None:
        span = noise.colour.frequency[-1] / noise.colour.frequency[0]
        ratio = np.exp(np.ptp(noise.colour.level))
        what = (
            f"the sensor's noise is coloured: {noise.std:.3g} rad in all, and its power per hertz varies by a "
            f"factor of {ratio:.3g} over a factor of {span:.3g} in frequency, in the same way throughout the runs"
        )
        found.append(Remark(Outcome.NOTED, runs, what, "the diagnosis allows for it, and it is not a cause"))
    if not trend.judged:
        what = "sampled too slowly to test whether the noise follows the motion or comes in bursts"
        found.append(Remark(Outcome.NOTED, runs, what, "sample faster to test it"))
    return tuple(found)
