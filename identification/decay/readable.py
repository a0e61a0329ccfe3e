"""What a record must fulfil for numerical reasons; the methods judge everything else."""

from __future__ import annotations

import numpy as np

from identification.policy import LEAST_SAMPLES
from tunnel_sim.vocabulary.record import Record

# Fourth powers of readings and of times are summed over a record: beyond these limits they overflow or underflow.
_LEAST, _GREATEST = 1e-60, 1e60
_ROUNDING = 1e-12  # of the largest reading: a few thousand rounding errors, in which no motion can be seen


def holds_motion(record: Record) -> bool:
    """Whether a record has enough samples, and a reading that changes by more than rounding.

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
