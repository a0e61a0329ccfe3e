"""One run's reading of the yaw angle against time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Deviation of the times from a uniform clock, in steps, up to which they are uniform. At ten samples per cycle it
#: moves a reading by 0.6 % of the swing.
CLOCK_TOLERANCE = 0.01
_GAP = 4.0  # mean intervals: a longer step is a gap


def read_only(values: ArrayLike) -> Array:
    """A read-only float64 copy."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Record:
    """A sampled reading of the yaw angle, from the release or later.

    Args:
        time_s: sample times, shape (n,), s, increasing.
        yaw_rad: sensor reading, shape (n,), rad, nose-right positive; the sensor's zero is unknown. Where the
            campaign's sensor measures a rate or an acceleration, rad/s or rad/s².

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

    def __repr__(self) -> str:
        """The samples, the range of the readings, and where to go from here, in three lines."""
        kind = "evenly spaced" if self.uniform else "not evenly spaced"
        low, high = float(self.yaw_rad.min()), float(self.yaw_rad.max())
        return (
            f"Record of {self.time_s.size} samples in {self.duration:.4g} s, {self.sample_rate:.4g} Hz, {kind}\n"
            f"  readings from {low:.4g} to {high:.4g} rad (rad/s or rad/s² where the sensor measures those)\n"
            "  .time_s, .yaw_rad"
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

    @cached_property
    def uniform(self) -> bool:
        """Whether all samples lie within `CLOCK_TOLERANCE` of a uniform clock from the first to the last."""
        away = self.time_s - np.linspace(self.time_s[0], self.time_s[-1], self.time_s.size)
        # Times far from zero have larger rounding errors, which are not a fault of the sampling.
        allowed = CLOCK_TOLERANCE * self.sample_interval + 4.0 * float(np.spacing(np.abs(self.time_s).max()))
        return bool(np.abs(away).max() <= allowed)


def gaps(time: Array) -> NDArray[np.bool_]:
    """Whether samples are missing between one time and the next.

    Args:
        time: of the samples, shape (n,), s, increasing.

    Returns:
        Shape (n - 1,): whether the step is longer than four mean intervals.
    """
    steps = np.diff(time)
    return steps > _GAP * steps.mean() if steps.size else np.zeros(0, dtype=np.bool_)


def evenly_spaced(record: Record, *, bridged: bool = True) -> Record:
    """A record on a uniform raster, for methods that need one.

    Args:
        bridged: whether gaps are bridged by a curve; False: by the record's mean, which adds nothing to a spectrum.

    Returns:
        The record itself where it is uniform; else a smooth curve through it at as many times, evenly spaced from
        the first to the last. Interpolation reduces the noise, and readings within a gap are not measurements.
    """
    if record.uniform:
        return record
    given, reading = record.time_s, record.yaw_rad
    # Cubic pieces whose slopes are those of parabolas through three neighbours.
    slope = np.gradient(reading, given)
    time = np.linspace(given[0], given[-1], given.size)
    at = np.clip(np.searchsorted(given, time, side="right") - 1, 0, given.size - 2)
    step = np.diff(given)[at]
    u = (time - given[at]) / step
    first, last = slope[at], slope[at + 1]
    # Across a gap slopes may lead far off: up to three times the mean slope, a cubic stays between its ends.
    steepest = 3.0 * np.abs(np.diff(reading)[at]) / step
    gap = gaps(given)[at]
    first, last = (np.where(gap, np.clip(end, -steepest, steepest), end) for end in (first, last))
    values = (
        (1.0 + 2.0 * u) * (1.0 - u) ** 2 * reading[at]
        + u**2 * (3.0 - 2.0 * u) * reading[at + 1]
        + step * u * (1.0 - u) * ((1.0 - u) * first - u * last)
    )
    return Record(time, values if bridged else np.where(gap, reading.mean(), values))
