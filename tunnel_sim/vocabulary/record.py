"""One run's reading of the yaw angle against time, and its number of cycles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.columns import Array as Array
from tunnel_sim.vocabulary.columns import read_only as read_only
from tunnel_sim.vocabulary.columns import read_only_column
from tunnel_sim.vocabulary.errors import TunnelError

#: Maximum deviation of the times from a uniform clock, in steps, for them to count as uniform. At ten samples
#: per cycle it moves a reading by 0.6 % of the swing.
CLOCK_TOLERANCE = 0.01
_GAP = 4.0  # mean intervals: a longer step is a gap


@dataclass(frozen=True, eq=False)
class Record:
    """A sampled reading of the yaw angle, from the release or later.

    Args:
        time_s: sample times, shape (n,), s, increasing.
        yaw_rad: sensor reading, shape (n,), rad, nose-right positive; the sensor's zero is unknown. If the
            campaign's sensor measures a rate or an acceleration, rad/s or rad/s².

    Lists and columns of pandas and Polars are accepted, too; dates and durations become seconds from the first
    sample. The arrays are copied and made read-only.

    Raises:
        TunnelError: for columns of other values, missing values, times that do not increase, and other sizes.
    """

    time_s: Array
    yaw_rad: Array

    def __post_init__(self) -> None:
        """Copy, freeze and check the arrays."""
        where = "Record"
        object.__setattr__(self, "time_s", read_only_column(self.time_s, "time_s", where, times=True))
        object.__setattr__(self, "yaw_rad", read_only_column(self.yaw_rad, "yaw_rad", where))
        if self.time_s.shape != self.yaw_rad.shape or self.time_s.size < 2:
            what = f"{self.time_s.size} times and {self.yaw_rad.size} readings"
            raise TunnelError(what, where=where, remedy="give as many readings as times, two or more")
        later = self.time_s[1:] > self.time_s[:-1]
        if not later.all():
            what = f"time_s does not increase at index {int(np.argmin(later)) + 1}"
            raise TunnelError(what, where=where, remedy="sort the samples, and give each time once")

    def __repr__(self) -> str:
        """The samples, the range of the readings, and what to call next, in three lines."""
        kind = "evenly spaced" if self.uniform else "not evenly spaced"
        low, high = float(self.yaw_rad.min()), float(self.yaw_rad.max())
        return (
            f"Record of {self.time_s.size} samples in {self.duration:.4g} s, {self.sample_rate:.4g} Hz, {kind}\n"
            f"  readings from {low:.4g} to {high:.4g} in the unit of the sensor\n"
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
        """Whether all samples are within `CLOCK_TOLERANCE` of a uniform clock from the first to the last."""
        away = self.time_s - np.linspace(self.time_s[0], self.time_s[-1], self.time_s.size)
        # Times far from zero have larger rounding errors, which are not a fault of the sampling.
        allowed = CLOCK_TOLERANCE * self.sample_interval + 4.0 * float(np.spacing(np.abs(self.time_s).max()))
        return bool(np.abs(away).max() <= allowed)


def gaps(time: Array) -> NDArray[np.bool_]:
    """Places of missing samples: steps of over four mean intervals between times, shape (n,); shape (n - 1,)."""
    steps = np.diff(time)
    return steps > _GAP * steps.mean() if steps.size else np.zeros(0, dtype=np.bool_)


def evenly_spaced(record: Record, *, bridged: bool = True) -> Record:
    """A record on a uniform raster, for methods that need one: itself if it is uniform.

    Otherwise a smooth curve through it, which bridges gaps or keeps them at the mean; neither is a measurement.
    """
    if record.uniform:
        return record
    given, reading = record.time_s, record.yaw_rad
    # cubic pieces with slopes from parabolas through three neighbours
    slope = np.gradient(reading, given)
    time = np.linspace(given[0], given[-1], given.size)
    at = np.clip(np.searchsorted(given, time, side="right") - 1, 0, given.size - 2)
    step = np.diff(given)[at]
    u = (time - given[at]) / step
    first, last = slope[at], slope[at + 1]
    # Across a gap slopes may extrapolate far: up to three times the mean slope, a cubic stays between its ends.
    steepest = 3.0 * np.abs(np.diff(reading)[at]) / step
    gap = gaps(given)[at]
    first, last = (np.where(gap, np.clip(end, -steepest, steepest), end) for end in (first, last))
    values = (
        (1.0 + 2.0 * u) * (1.0 - u) ** 2 * reading[at]
        + u**2 * (3.0 - 2.0 * u) * reading[at + 1]
        + step * u * (1.0 - u) * ((1.0 - u) * first - u * last)
    )
    return Record(time, values if bridged else np.where(gap, reading.mean(), values))


MAINS_HZ = (50.0, 60.0)
# A spectral line counts when it exceeds the median of the spectrum by this factor. In white noise, where the bins
# are exponentially distributed, about one record of 10 000 samples in thirty thousand has such a line. A record
# shorter than SHORT_RECORD samples has too few bins to estimate a background: its strongest line counts.
LINE_OVER_MEDIAN = 27.0
SHORT_RECORD = 100
# A crossing counts when the reading then moves beyond the centre by this share of the largest swing.
HYSTERESIS = 0.03
NOISE_MARGIN = 4.0  # or by this many standard deviations of the smoothed noise, whichever is larger


def running_integral(values: Array, places: Array) -> Array:
    """The integral of values from the first place to each place, by trapezoids, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(places))])


def count_cycles(record: Record) -> float:
    """Number of cycles of the dominant oscillation within the record; 0 when nothing oscillates.

    The dominant spectral line gives the time scale; the period follows from the crossings of the centre, with
    hysteresis. The part of a heavily damped run in which the swing is below the noise also counts.
    """
    record = evenly_spaced(record, bridged=False)
    # Less a sinusoid at each mains frequency, fitted second by second, because that frequency varies by a few
    # hundredths of a hertz.
    reading: Array = record.yaw_rad - record.yaw_rad.mean()
    block = round(record.sample_rate)
    for mains in MAINS_HZ:
        # In a record that is too short or sampled too slowly, hum cannot be separated from the motion.
        if reading.size < block or mains > 0.45 * record.sample_rate:
            continue
        phase = 2.0 * np.pi * mains * np.arange(block) / record.sample_rate
        # A level and a slope are fitted with the hum, so that slow motion is not mistaken for hum.
        hum_basis = np.column_stack([np.cos(phase), np.sin(phase)])
        basis = np.column_stack([hum_basis, np.ones(block), np.linspace(-1.0, 1.0, block)])
        # The last block also has full length: it overlaps the previous one and corrects only the rest.
        starts = [*range(0, reading.size - block, block), reading.size - block]
        pieces = np.stack([reading[start : start + block] for start in starts])
        hum = pieces @ np.linalg.pinv(basis).T[:, :2] @ hum_basis.T
        overlap = len(starts) * block - reading.size
        reading = reading - np.concatenate([hum[:-1].ravel(), hum[-1, overlap:]])
    # The reading less a fitted straight line, because a sensor's drift is not an oscillation. BLAS is not
    # used: its sums depend on its number of threads.
    abscissa = np.linspace(-1.0, 1.0, reading.size)
    slope = float(np.sum(abscissa * reading) / np.sum(abscissa**2))
    level: Array = reading - float(reading.mean()) - slope * abscissa
    # Only rounding errors remain from a constant, a linear drift or pure hum.
    if reading.size < 6 or float(np.ptp(level)) <= 1e-9 * float(np.abs(record.yaw_rad).max()):
        return 0.0
    # The strongest spectral line, which must be clear of the noise.
    power = np.abs(np.fft.rfft(level))[1:] ** 2
    frequency = np.fft.rfftfreq(level.size, 1.0 / record.sample_rate)[1:]
    # Between power and power per octave, so that neither slow drift nor brief ringing hides the oscillation.
    background = float(np.median(power)) if level.size >= SHORT_RECORD else 0.0
    share = np.where(power > LINE_OVER_MEDIAN * background, power * np.sqrt(frequency), 0.0)
    best = int(np.argmax(share))
    if not share[best] > 0.0:
        return 0.0
    width = max(1, round(0.25 * record.sample_rate / float(frequency[best])))
    # The first swing of a heavily damped run tilts the fitted trend, so the reading with its trend is counted too.
    return max(_count(reading, width), _count(level, width))


def _count(reading: Array, width: int) -> float:
    """The record's length over the period of its crossings; 0 with fewer than two of them."""
    # Crossings of the smoothed reading through its centre, in samples, with hysteresis.
    total = np.concatenate([[0.0], np.cumsum(reading)])
    smooth = (total[width:] - total[:-width]) / width
    smooth = smooth - np.median(smooth)
    # Differences of neighbouring samples contain the noise and little of the motion.
    quartiles = np.percentile(np.diff(reading), [25.0, 75.0])
    noise = float(quartiles[1] - quartiles[0]) / (1.349 * np.sqrt(2.0 * width))
    largest = float(np.abs(smooth).max())
    # With few samples per cycle the differences contain the motion as well, hence the upper limit.
    band = min(max(HYSTERESIS * largest, NOISE_MARGIN * noise), 0.25 * largest)
    outside = np.flatnonzero(np.abs(smooth) > band)
    change = np.flatnonzero(np.diff(np.sign(smooth[outside])) != 0.0)
    # Between the last sample on one side of the band and the first on the other.
    crossings = 0.5 * (outside[change] + outside[change + 1]).astype(np.float64)
    if crossings.size < 2:
        return 0.0
    # Whole periods where there are any, because half periods are unequal about a shifted centre. Their median,
    # because the last crossing may be a late drift of the rest position.
    whole = crossings[2:] - crossings[:-2]
    period = float(np.median(whole)) if whole.size else 2.0 * float(crossings[1] - crossings[0])
    return reading.size / period
