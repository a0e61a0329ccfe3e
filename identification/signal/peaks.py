"""The peaks of a decaying oscillation and their rate of decay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.policy import LEAST_NOISE, LEAST_PEAK_SHARE
from tunnel_sim.vocabulary.record import Array, Record

PEAK_HALF_WIDTH = 1.0 / 12.0  # of a period, either side of a peak, that its parabola is fitted to
_LEAST_SAMPLES = 1.5001  # either side of a peak, whose parabola needs three
_LEAST_PEAKS = 4
_MOVES = 8  # of half a window each


@dataclass(frozen=True)
class PeakDecay:
    """Damping and scatter of the peaks.

    Args:
        rate: decay rate σ, 1/s; the time to half amplitude is ln 2/σ.
        rate_std: its standard deviation from the scatter of the peaks about their line, 1/s.
        frequency_std: standard deviation of the frequency from the scatter of the peaks' instants, Hz.
        zero: the sensor's zero, rad.
        zero_std: its standard deviation from the scatter of the peaks, rad.
    """

    rate: float
    rate_std: float
    frequency_std: float
    zero: float
    zero_std: float


def peak_decay(record: Record, frequency: float) -> PeakDecay | None:
    """The decay rate from a line through the logarithm of the peaks, of both signs, against time.

    A peak is the vertex of a parabola through the samples within a twelfth of a period. The zero is the mean of
    (p₁ + 2p₂ + p₃)/4 over neighbouring peaks, which lie evenly on both sides of it. Peaks are followed until they
    fall below a tenth of the first.

    Args:
        record: the reading, rad against s.
        frequency: of the oscillation, Hz.

    Returns:
        The decay; None where there are fewer than four peaks.
    """
    times, heights = follow_peaks(record, frequency)
    if times.size < _LEAST_PEAKS:
        return None
    centres = 0.25 * (heights[:-2] + 2.0 * heights[1:-1] + heights[2:])
    zero = float(centres.mean())
    sizes = np.abs(heights - zero)
    below = np.flatnonzero(sizes < LEAST_PEAK_SHARE * sizes[0])
    count = int(below[0]) if below.size else sizes.size
    if count < _LEAST_PEAKS:
        return None
    slope, slope_std = _line(times[:count], np.log(sizes[:count]))
    period_half, period_std = _line(np.arange(count, dtype=np.float64), times[:count])
    return PeakDecay(
        rate=-slope,
        rate_std=max(slope_std, LEAST_NOISE * frequency),
        frequency_std=max(0.5 * period_std / period_half**2, LEAST_NOISE * frequency),
        zero=zero,
        zero_std=max(float(centres.std(ddof=1) / np.sqrt(centres.size)), LEAST_NOISE * float(sizes[0])),
    )


def follow_peaks(record: Record, frequency: float, *, sparse: bool = False) -> tuple[Array, Array]:
    """Peaks of both signs, each looked for half a period after the one before.

    A peak is the vertex of a parabola through the samples within a twelfth of a period of it. The first is
    looked for past the release itself.

    Args:
        record: the reading, rad against s.
        frequency: of the oscillation, Hz.
        sparse: whether three samples make a peak where a twelfth of a period holds fewer, as noise does too.

    Returns:
        Instants since the first sample in s and heights in rad, shape (n,) each; they end where peaks no
        longer alternate.
    """
    time = record.time_s - record.time_s[0]
    half = 0.5 / frequency
    width = PEAK_HALF_WIDTH / frequency
    if sparse:
        width = max(width, _LEAST_SAMPLES * float(np.median(np.diff(time))))
    middle = 0.5 * (float(record.yaw_rad.max()) + float(record.yaw_rad.min()))
    search = np.flatnonzero((time >= 0.25 * half) & (time <= 1.25 * half))
    times: list[float] = []
    heights: list[float] = []
    expected = (
        float(time[search[np.argmax(np.abs(record.yaw_rad[search] - middle))]]) if search.size else np.inf
    )
    while expected + width <= time[-1]:
        vertex = _vertex(time, record.yaw_rad, expected, width)
        if vertex is None:
            break
        if len(heights) >= 2 and (vertex[1] > heights[-1]) != (heights[-2] > heights[-1]):
            break  # peaks no longer alternate: the oscillation is lost in the noise
        times.append(vertex[0])
        heights.append(vertex[1])
        expected = vertex[0] + half
    return np.array(times), np.array(heights)


def _vertex(time: Array, yaw: Array, expected: float, width: float) -> tuple[float, float] | None:
    # Where the period drifts, a peak is not at the expected instant: the window follows it.
    for _ in range(_MOVES):
        low, high = np.searchsorted(time, (expected - width, expected + width))
        if high - low < 3:
            return None
        x = (time[low:high] - expected) / width
        bend, slope, height = np.polyfit(x, yaw[low:high], 2)
        place = -0.5 * slope / bend if bend != 0.0 else np.inf
        if abs(place) <= 0.5:
            return expected + float(place) * width, float(height + 0.5 * slope * place)
        # Move up the slope: with curvature of the wrong sign the vertex would lie on the other side.
        rising = slope * np.sign(yaw[low:high].mean() - yaw.mean()) > 0.0
        expected += (0.5 if rising else -0.5) * width
    return None


def _line(x: Array, y: Array) -> tuple[float, float]:
    # Gradient and its standard deviation.
    centred = x - x.mean()
    spread = float(centred @ centred)
    gradient = float(centred @ y) / spread
    residual = y - y.mean() - gradient * centred
    return gradient, float(np.sqrt(residual @ residual / (x.size - 2) / spread))
