"""One run's reading of the yaw angle against time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def read_only(values: ArrayLike) -> Array:
    """A read-only float64 copy."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Record:
    """A uniformly sampled reading of the yaw angle, from the release or later.

    Args:
        time_s: sample times, shape (n,), s, with a constant step.
        yaw_rad: sensor reading, shape (n,), rad, nose-right positive; the sensor's zero is unknown.

    The arrays are copied and made read-only.
    """

    time_s: Array
    yaw_rad: Array

    def __post_init__(self) -> None:
        """Copy, freeze and check the arrays.

        Raises:
            ValueError: when shapes differ or there are fewer than two samples.
        """
        object.__setattr__(self, "time_s", read_only(self.time_s))
        object.__setattr__(self, "yaw_rad", read_only(self.yaw_rad))
        if self.time_s.ndim != 1 or self.time_s.shape != self.yaw_rad.shape or self.time_s.size < 2:
            raise ValueError(
                "time_s and yaw_rad must be one-dimensional, equally long and of two samples or more"
            )

    @property
    def sample_interval(self) -> float:
        """Mean sample interval, s."""
        return float((self.time_s[-1] - self.time_s[0]) / (self.time_s.size - 1))

    @property
    def sample_rate(self) -> float:
        """Mean sample rate, Hz."""
        return 1.0 / self.sample_interval

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return float(self.time_s[-1] - self.time_s[0])
