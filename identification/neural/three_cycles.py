"""Windows of three cycles in a record, from its zero crossings alone, each as 100 numbers that depend only on ζ.

Every step is linear in the reading once the crossings are known. Each result is therefore a weighted sum of the
samples, and white noise is propagated through all steps by the delta method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from identification.signal.decay_fit import Reading, block_means
from identification.signal.frequency import starting_decay
from tunnel_sim.vocabulary.record import Array, Record

POINTS = 100
CYCLES = 3
_FIRST_HALF = 17  # points of the first half cycle: 100/6, rounded up
_QUARTIC = np.vander(np.linspace(-1.0, 1.0, _FIRST_HALF), 5)
_SMOOTHER = np.linalg.pinv(_QUARTIC)
_FINE = np.vander(np.linspace(-1.0, 1.0, 2001), 5) @ _SMOOTHER


@dataclass(frozen=True, eq=False)
class Shape:
    """A normalised response.

    Args:
        inputs: inputs of the network, shape (100,).
        scale: divisor of the points, the amplitude, in the unit of the points.
        peak_weights: weights of the points in the scale, shape (100,).
    """

    inputs: Array
    scale: float
    peak_weights: Array


def normalise(points: Array) -> Shape:
    """Remove the mean, and scale the largest value of the first half cycle to 1.

    The largest value comes from a quartic through the points of the half cycle, which is less sensitive to
    noise. The scale is 0 or less if the half cycle does not rise above the mean.

    Args:
        points: means over the hundredths of three cycles from a zero crossing on, the first half cycle positive,
            shape (100,).
    """
    centred = points - points.mean()
    place = int(np.argmax(_FINE @ centred[:_FIRST_HALF]))
    weights = np.zeros(POINTS)
    weights[:_FIRST_HALF] = _FINE[place]
    scale = float(weights @ centred)
    return Shape(centred / scale if scale > 0.0 else centred, scale, weights)


def response_points(zeta: Array) -> Array:
    """The 100 points of e^{−6πκτ} sin 6πτ (paper, eq. 12) with κ = ζ/√(1 − ζ²), shape (n, 100), for n ratios."""
    ratio = np.asarray(zeta, dtype=np.float64)[:, None]
    pole = 2.0 * np.pi * CYCLES * (1j - ratio / np.sqrt(1.0 - ratio**2))
    integral = (np.exp(pole * np.linspace(0.0, 1.0, POINTS + 1)) / pole).imag
    return np.asarray(np.diff(integral, axis=1) * POINTS)


def network_inputs(zeta: Array) -> Array:
    """The first network's inputs for impulse responses, shape (n, 100), of damping ratios below 1, shape (n,)."""
    return np.array([normalise(points).inputs for points in response_points(zeta)])


def cycles_time(zeta: Array, omega_n: Array) -> Array:
    """t3, the time of three damped cycles, shape (n,), s.

    Args:
        zeta: damping ratios, below 1, shape (n,).
        omega_n: natural frequencies, rad/s, shape (n,).
    """
    return np.asarray(2.0 * np.pi * CYCLES / (omega_n * np.sqrt(1.0 - zeta**2)))


HALVES = 2 * CYCLES
_SAMPLES_PER_CYCLE = 134  # a denser record is thinned to these; about four per point of the 100
_LEAST_PER_CYCLE = 8.0
# Of a half cycle, either side of a crossing, for the fit of its quintic; a cubic biases ζ by 0.1 %.
_REACH = 0.25
_TERMS = 6
_EXPONENTS = np.arange(_TERMS)[:, None]
_ROUNDS = 8
_SETTLED = 1e-10  # of a half cycle
_CLEAR = 20.0  # minimum amplitude over the noise of a crossing's level for linear propagation to be valid
_BAND = 4.0  # a crossing counts when the smoothed reading goes this many standard deviations beyond the level
_SHARE = 0.004  # or this share of the largest swing


@dataclass(frozen=True, eq=False)
class ThreeCycles:
    """One window.

    Args:
        start_s: time of the first crossing since the record's first sample, s.
        t3: time of three damped cycles, s.
    """

    start_s: float
    t3: float
    shape: Shape
    noise: Propagation


@dataclass(frozen=True, eq=False)
class Propagation:
    """Propagation of the samples' white noise to the points, the start of the window and t3.

    Args:
        std: noise of one sample, rad.
        points: weights of the samples in the 100 points, shape (100, n).
        timing: weights of the samples in t0 and t3, s/rad, shape (2, n).
        by_timing: derivatives of the points by t0 and t3, rad/s, shape (100, 2).
        first: index of the first sample with a nonzero weight.
    """

    std: float
    points: Array
    timing: Array
    by_timing: Array
    first: int

    def weights(self, shape: Shape, gradient: Array) -> Array:
        """Errors of ζ and t3 per standard deviation of each sample's noise, shape (2, n), in 1 and s.

        Args:
            gradient: derivatives of ζ by the network's inputs, shape (100,).
        """
        pulled = (gradient - shape.peak_weights * float(gradient @ shape.inputs)) / shape.scale
        pulled = pulled - pulled.mean()
        zeta = pulled @ self.points + (pulled @ self.by_timing) @ self.timing
        return np.stack((zeta, self.timing[1])) * self.std


@dataclass(frozen=True, eq=False)
class _Trace:
    """A record thinned by block means, with its spline and noise."""

    time: Array
    yaw: Array
    spline: CubicSpline
    integral: CubicSpline
    noise: float

    @property
    def step(self) -> float:
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)


@dataclass(frozen=True)
class _Place:
    """The place of a window, and its decay."""

    start: float
    half: float
    decay: float = 1.0
    slope: float = 0.0


def find_windows(record: Record, noise_std: float) -> tuple[tuple[ThreeCycles, ...], float]:
    """The windows of a record in sequence, until it ends or the oscillation is below the noise.

    Args:
        noise_std: standard deviation of one sample, rad, above 0.

    Returns:
        The windows, and the number of cycles of clear oscillation from the first crossing on; 0 without an
        oscillation.
    """
    rough = starting_decay(record)
    if rough is None or rough.omega_d == 0.0:
        return (), 0.0
    period = 2.0 * np.pi / rough.omega_d
    reading, block = block_means(Reading.from_record(record), 1.0 / period, _SAMPLES_PER_CYCLE)
    time, yaw = reading.time, reading.yaw
    spline = CubicSpline(time, yaw)
    trace = _Trace(time, yaw, spline, spline.antiderivative(), noise_std / np.sqrt(block))
    # First crossings of the smoothed reading through the mean level of its later half, with hysteresis.
    width = max(1, round(period / trace.step / 10.0))
    if yaw.size < 2 * width or period / trace.step < _LEAST_PER_CYCLE:
        return (), 0.0
    smooth = np.convolve(yaw, np.full(width, 1.0 / width), mode="valid")
    middles = time[: smooth.size] + 0.5 * (width - 1) * trace.step
    # The mean over the last whole cycles: the zero to within a small share of the remaining amplitude.
    cycles = max(1, int(0.5 * yaw.size * trace.step / period))
    count = min(yaw.size, round(cycles * period / trace.step))
    away = smooth - float(yaw[-count:].mean())
    largest = float(np.abs(away).max())
    band = max(_BAND * trace.noise / np.sqrt(width), _SHARE * largest)
    outside = np.flatnonzero(np.abs(away) > band)
    change = np.flatnonzero(np.diff(np.sign(away[outside])) != 0.0)
    if change.size < 2:
        return (), 0.0
    before, after = outside[change], outside[change + 1]
    # Linear interpolation from the last clear sample on one side to the first on the other.
    share = away[before] / (away[before] - away[after])
    crossings = np.asarray(middles[before] + share * (middles[after] - middles[before]))
    first = _Place(float(crossings[0]), float(np.diff(crossings[:3]).mean()))
    windows: list[ThreeCycles] = []
    place = first
    end = float(trace.time[-1])
    while place.start + HALVES * place.half <= end + 0.5 * place.half:
        found = _refined(trace, place)
        if found is None or found.start + HALVES * found.half > end:
            break
        window = _window(trace, found)
        if window is None:
            break
        windows.append(window)
        place = _Place(found.start + HALVES * found.half, found.half)
    return tuple(windows), (end - first.start) / (2.0 * first.half)


def _refined(trace: _Trace, place: _Place) -> _Place | None:
    # Seven crossings t0 + k t3/6, zero and decay in turn; None where the decay is below the noise.
    number = np.arange(HALVES + 1)
    for _ in range(_ROUNDS):
        instants = np.asarray(place.start + place.half * number, dtype=np.float64)
        # The half cycles' means are z + m (−r)^k for any linear decay: their regression on one another.
        means = np.diff(trace.integral(np.clip(instants, trace.time[0], trace.time[-1]))) / np.diff(instants)
        columns = np.column_stack((means[:-1], np.ones(means.size - 1)))
        ratio, offset = np.linalg.lstsq(columns, means[1:], rcond=None)[0]
        decay = -float(ratio)
        zero = float(offset) / (1.0 + decay) if decay > -1.0 else 0.0
        if not 0.0 < decay < 1.5:
            return None
        # Level and slope at each instant.
        found = [
            rows @ trace.yaw[part]
            for part, rows in (_fit_rows(trace, float(t), place.half) for t in instants)
        ]
        levels, slopes = (np.array(found)[:, 0], np.array(found)[:, 1])
        model = (-decay) ** number
        slope = float(slopes @ model) / float(model @ model)
        if slope == 0.0:
            return None
        moves = np.clip((zero - levels) / (slope * model), -0.25 * place.half, 0.25 * place.half)
        line = _line_weights(decay) @ (instants + moves)
        moved = abs(float(line[0]) - place.start)
        place = _Place(float(line[0]), float(line[1]), decay, slope)
        if not place.half > 0.0 or place.start < 0.0:
            return None
        if moved < _SETTLED * place.half:
            break
    return place


def _line_weights(decay: float) -> Array:
    # Start and half cycle from the crossings, weighted by their slopes: shape (2, 7).
    number = np.arange(HALVES + 1)
    weights = np.asarray(decay, dtype=np.float64) ** number
    columns = np.column_stack((np.ones(HALVES + 1), number)) * weights[:, None]
    return np.asarray(np.linalg.pinv(columns) * weights)


def _fit_rows(trace: _Trace, instant: float, half: float) -> tuple[slice, Array]:
    # The samples around an instant, and their weights in level and slope of a quintic there: shape (2, m).
    low, high = np.searchsorted(trace.time, (instant - _REACH * half, instant + _REACH * half))
    low, high = max(0, min(int(low), trace.time.size - _TERMS - 1)), max(int(high), int(low) + _TERMS + 1)
    part = slice(low, min(high, trace.time.size))
    # Powers of an abscissa from −1 to 1: the normal equations lose no more than four digits.
    powers = ((trace.time[part] - instant) / (_REACH * half)) ** _EXPONENTS
    rows = np.asarray(np.linalg.solve(powers @ powers.T, powers)[:2], dtype=np.float64)
    rows[1] /= _REACH * half
    return part, rows


def _window(trace: _Trace, place: _Place) -> ThreeCycles | None:
    instants = np.asarray(place.start + place.half * np.arange(HALVES + 1), dtype=np.float64)
    t3 = HALVES * place.half
    edges = place.start + t3 * np.linspace(0.0, 1.0, POINTS + 1)
    sign = 1.0 if place.slope > 0.0 else -1.0
    points = sign * np.diff(trace.integral(edges)) * POINTS / t3
    shape = normalise(points)
    first, last = np.searchsorted(trace.time, (instants[0] - place.half, instants[-1] + place.half))
    part = slice(int(first), int(last))
    # weights of the samples in the level at each instant
    level_weights = np.zeros((instants.size, trace.time.size))
    for number, instant in enumerate(instants):
        where, rows = _fit_rows(trace, float(instant), place.half)
        level_weights[number, where] = rows[0]
    level_weights = level_weights[:, part]
    level_noise = trace.noise * float(np.linalg.norm(level_weights[0]))
    if shape.scale < _CLEAR * level_noise:
        return None
    # A level dc above the zero moves its crossing by −dc/slope; the zero follows from the means of the half cycles.
    means = _shares(trace, instants, part)
    pairs = (means[1:] + place.decay * means[:-1]) / (1.0 + place.decay)
    slopes = place.slope * (-place.decay) ** np.arange(HALVES + 1)
    crossings = (pairs.mean(axis=0) - level_weights) / slopes[:, None]
    start, half = _line_weights(place.decay) @ crossings
    # Derivatives of the points by t0 and t3, from the curve at their edges; averaged to reduce noise.
    upright = sign * points
    ends = trace.spline(edges[[0, -1]])
    values = np.concatenate(([float(ends[0])], 0.5 * (upright[1:] + upright[:-1]), [float(ends[1])]))
    by_start = np.diff(values) * POINTS / t3
    by_length = np.diff(np.linspace(0.0, 1.0, POINTS + 1) * values) * POINTS / t3 - upright / t3
    noise = Propagation(
        trace.noise,
        sign * _shares(trace, edges, part),
        np.stack((start, HALVES * half)),
        sign * np.column_stack((by_start, by_length)),
        int(first),
    )
    return ThreeCycles(place.start, t3, shape, noise)


def _shares(trace: _Trace, edges: Array, part: slice) -> Array:
    # Contribution of each sample to the mean between two edges: shape (edges − 1, samples).
    left = trace.time[part] - 0.5 * trace.step
    covered = np.clip(edges[:, None] - left, 0.0, trace.step)
    return np.asarray(np.diff(covered, axis=0) / np.diff(edges)[:, None])
