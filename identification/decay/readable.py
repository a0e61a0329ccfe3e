"""What numerics need of a record before any method looks at it; everything else is for the method to judge."""

from __future__ import annotations

import numpy as np

from identification.policy import LEAST_SAMPLES
from tunnel_sim.vocabulary.record import Record

# The fourth power of a reading or of a time is summed over a record: beyond these it leaves the double precision.
_LEAST, _GREATEST = 1e-60, 1e60
_ROUNDING = 1e-12  # of the largest reading: some thousand roundings, in which no motion can be told


def holds_motion(record: Record) -> bool:
    """Whether a record has enough samples, and a reading that moves by more than its own rounding.

    Args:
        record: the reading of one run.

    Returns:
        False for a record of fewer than eight samples, for a constant one, and for one whose numbers are so large
        or small that their squares cannot be summed.
    """
    if record.time_s.size < LEAST_SAMPLES:
        return False
    low, high = float(record.yaw_rad.min()), float(record.yaw_rad.max())
    largest = max(abs(low), abs(high))
    if not largest < _GREATEST:
        return False
    span = high - low
    return (
        span > max(_LEAST, _ROUNDING * largest)
        and record.sample_interval > _LEAST
        and record.duration < _GREATEST
        and bool(np.abs(record.time_s).max() < _GREATEST)
    )
