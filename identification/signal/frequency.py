"""Properties of a record before any fit: its frequency, its peaks, its poles, and the decay that starts a fit.

A record is refused here for numerical reasons only; the methods judge everything else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import sqrt

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import chdtri

from identification.policy import LEAST_NOISE, LEAST_PEAK_SHARE, LEAST_SAMPLES, MISFIT_RATE
from identification.signal.decay_fit import Reading, mean_of_blocks, projected_cost
from identification.signal.free_decay import Decay
from identification.signal.noise import PEAK_HALF_TURN, PeakNoise
from identification.statistics import inner
from tunnel_sim.vocabulary.caching import cached_while_in_use
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced, read_only, running_integral

Complex = NDArray[np.complex128]
# Fourth powers of readings and of times are summed over a record: beyond these limits they overflow or underflow.
_LEAST, _GREATEST = 1e-60, 1e60
_ROUNDING = 1e-12  # share of the largest reading: a few thousand rounding errors, without detectable motion


def holds_motion(record: Record) -> bool:
    """Whether a record has enough samples, and a reading that changes by more than rounding.

    Numbers so large or small that their squares cannot be summed are not a motion.
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


# zero padding to eight times the record, which places the interpolated peak within 1/16 of a bin
_PADDING = 8

_FEWEST_CYCLES = 2.0  # minimum number of cycles in a record with motion until its end


@dataclass(frozen=True)
class SpectralPeak:
    """The highest peak of a power spectral density.

    Args:
        frequency: frequency of the peak, Hz; 0 if the record contains no motion (`holds_motion`).
        prominence: power of the peak over the median's; white noise alone reaches 40 less than once in 1e6
            records.
    """

    frequency: float
    prominence: float


def psd_peak(record: Record) -> SpectralPeak:
    """The damped frequency, as the peak of the power spectral density of the record without its mean.

    A Hann window keeps the offset and the negative frequencies from leaking into the peak.
    """
    frequency, power = _spectral_peak(record, _PADDING, falling=False)
    highest = float(power[:-1].max(initial=0.0))
    return SpectralPeak(frequency, highest / max(float(np.median(power)), 1e-300) if frequency else 0.0)


def psd_peak_std(record: Record, frequency: float, noise_std: float) -> float:
    """Standard deviation of the frequency of `psd_peak` by noise, without its bias, Hz.

    The slope of the power is zero at the peak. To first order the noise moves the peak by the noise's part of
    the slope over the curvature.

    Args:
        frequency: frequency of the peak, Hz, above 0.
        noise_std: noise of one sample, rad; for coloured noise, the root of its power at the frequency.
    """
    record = evenly_spaced(record, bridged=False)
    centred = record.yaw_rad - record.yaw_rad.mean()
    time = record.time_s - record.time_s.mean()
    window = _window(centred.size, falling=False)
    lines = window * np.exp(-2j * np.pi * frequency * time)
    rows = lines * np.stack((np.ones_like(time), -1j * time, -(time**2)))
    value, slope, bend = np.sum(rows * centred, axis=-1)  # not BLAS: see `statistics.inner`
    curvature = 2.0 * (abs(slope) ** 2 + (bend * np.conj(value)).real)
    moved = 2.0 * np.real(rows[1] * np.conj(value) + rows[0] * np.conj(slope))
    return noise_std * sqrt(float(inner(moved, moved))) / abs(float(curvature)) / (2.0 * np.pi)


def _spectral_peak(record: Record, padding: int, *, falling: bool) -> tuple[float, Array]:
    """The frequency of `psd_peak`, Hz, and the power from one cycle per record on, shape (n,)."""
    if not holds_motion(record):
        return 0.0, np.zeros(1)
    record = evenly_spaced(record, bridged=False)
    centred = record.yaw_rad - record.yaw_rad.mean()
    size = 1 << int(np.ceil(np.log2(padding * centred.size)))
    # Below one cycle per record the spectrum contains the remaining offset, not the oscillation.
    lowest = max(1, int(size / centred.size))
    place, power = highest_peak(centred * _window(centred.size, falling), size, lowest)
    seen = power[lowest:]
    return (place * record.sample_rate / size if seen[:-1].max() > 0.0 else 0.0), seen


def highest_peak(values: Array, size: int, lowest: int = 1) -> tuple[float, Array]:
    """The highest point of the spectrum of a series, in bins, and the power, shape (size // 2 + 1,).

    The highest point is the vertex of a parabola through the logarithms of the three highest bins.

    Args:
        values: the series, windowed, without its mean, shape (n,).
        size: number of samples after zero padding, at least n.
        lowest: first bin to consider; the last bin is never considered.
    """
    power = np.abs(np.fft.rfft(values, size)) ** 2
    peak = lowest + int(np.argmax(power[lowest:-1]))
    low, middle, high = np.log(np.maximum(power[peak - 1 : peak + 2], 1e-300))
    curvature = low - 2.0 * middle + high
    offset = 0.0 if curvature >= 0.0 else float(np.clip(0.5 * (low - high) / curvature, -0.5, 0.5))
    return peak + offset, power


def peak_of_swing(swing: Array, size: int) -> float:
    """The highest point of the spectrum of a decay, in bins, with a Hann window.

    A peak below two cycles of the series does not come from the motion: a heavily damped motion is over before
    the middle of the series. The peak is then sought with a window that falls from the start.

    Args:
        swing: the series without its mean, shape (n,), any unit.
        size: number of samples after zero padding, at least n.
    """
    place, _ = highest_peak(swing * _window(swing.size, falling=False), size)
    per_cycle = size / swing.size
    if place < _FEWEST_CYCLES * per_cycle:
        place, _ = highest_peak(swing * _window(swing.size, falling=True), size, max(1, int(per_cycle)))
    return place


@lru_cache(maxsize=4)  # most runs of a campaign have the same length
def _window(size: int, falling: bool) -> Array:
    return read_only(np.hanning(2 * size)[size:] if falling else np.hanning(size))


_SAMPLES = 1024  # candidates are compared on a thinned record; the fit itself uses every sample
_LONG = 4096  # maximum number of samples for the spectrum; a longer record is thinned and not padded
_DAMPING_RATIOS = (0.0, 0.002, 0.006, 0.02, 0.06, 0.2, 0.5)


def starting_decay(record: Record) -> Decay | None:
    """A decay close enough for the least-squares fit to converge; None if none fits or nothing moves.

    For records of many cycles the candidates are the peak of the power spectral density with several damping
    ratios; for heavily damped ones, the fit of the twice integrated equation of motion. The candidate of least sum
    of squares is chosen.
    """
    frequency = starting_frequency(record)
    if frequency is None:
        return None
    thin = thinned_reading(record, frequency)
    omega = 2.0 * np.pi * frequency
    candidates = [Decay.from_modal(omega / np.sqrt(1.0 - zeta**2), zeta) for zeta in _DAMPING_RATIOS]
    # y + 2a∫y + k∬y = c₀ + c₁t + c₂t²: linear in a and k, and integration reduces the noise.
    time, yaw = thin.time, thin.yaw
    once = running_integral(yaw, time)
    twice = running_integral(once, time)
    columns = np.column_stack((once, twice, np.ones_like(time), time, time**2))
    scale = np.linalg.norm(columns, axis=0)
    solution = np.linalg.lstsq(columns / scale, -yaw, rcond=None)[0] / scale
    integrated = Decay(float(solution[0]) / 2.0, float(solution[1]))
    if integrated.stiffness > 0.0:
        candidates.append(integrated)
    costs = [projected_cost(thin, candidate) for candidate in candidates]
    best = int(np.argmin(costs))
    return candidates[best] if np.isfinite(costs[best]) else None


@cached_while_in_use
def starting_frequency(record: Record) -> float | None:
    """The approximate frequency of the strongest oscillation, Hz; None if the record contains no motion.

    It is found once for each record: the examination and the methods all begin with it.
    """
    if not holds_motion(record):
        return None
    # A block mean hides an oscillation of at most two samples per cycle: a record of some two thousand cycles.
    factor = max(1, record.time_s.size // _LONG)
    thin = record
    if factor > 1:
        thin = Record(mean_of_blocks(record.time_s, factor), mean_of_blocks(record.yaw_rad, factor))
    frequency, _ = _spectral_peak(thin, _PADDING if factor == 1 else 1, falling=True)
    return _strongest_decay(evenly_spaced(record, bridged=False), frequency) or None


_SHORTEST = 64  # minimum number of samples of the shortest compared decay
_FALLS = 4.0  # decay rate times duration: to 2 % of the first swing
_SHORTER = 4  # ratio of successive durations: the best one is at most twice as long or short as the decay
_CLEARLY = 2.0  # minimum ratio to the energy of the frequency found first: noise and leakage do not reach it
_LOWEST = 2.0  # minimum number of cycles of a decay: fewer are the drift of its centre
_BESIDE = 2  # points of the spectrum on either side that belong to the same peak


def _strongest_decay(record: Record, found: float) -> float:
    """The frequency of a decaying sinusoid that explains clearly more of a record than the given frequency, Hz.

    A decay that is over long before the record ends is weak in the spectrum of the whole record, in which the
    drift of the centre and slow leakage are strong. Each tried decay rate therefore has its own spectrum: of
    the record, without the parabola of its centre, times the decay. This is the matched filter, a least-squares
    fit of one decay at each frequency.

    Args:
        found: the given frequency, which is returned otherwise: the highest peak of the spectrum of block
            means; 0: none.
    """
    values, rate = record.yaw_rad - record.yaw_rad.mean(), record.sample_rate
    best, strongest, known = found, 0.0, 0.0
    size, falls = values.size, 0.0
    while size >= _SHORTEST or falls == 0.0:
        window = np.exp(-falls * np.arange(size) / size)
        series = _without_parabola(values[:size], window) * window
        padded = next_fast_len(size, real=True)
        lowest = max(1, int(np.ceil(_LOWEST * max(1.0, falls / 2.0) * padded / size)))
        if lowest + 2 < padded // 2:
            place, power = highest_peak(series, padded, lowest)
            power = power * 2.0 / float(window @ window)
            bins = round(found * padded / rate)
            near = power[max(lowest, bins - _BESIDE) : bins + _BESIDE + 1]
            known = max(known, float(near.max(initial=0.0)))
            if (energy := float(power[round(place)])) > strongest:
                best, strongest = place * rate / padded, energy
        size, falls = (size, _FALLS) if falls == 0.0 else (size // _SHORTER, _FALLS)
    return best if strongest > _CLEARLY * known else found


def _without_parabola(values: Array, weights: Array) -> Array:
    """Values less their weighted least-squares parabola."""
    place = np.linspace(-1.0, 1.0, values.size)
    columns = np.stack([np.ones_like(place), place, place**2])
    weighted = columns * weights**2
    return np.asarray(values - np.linalg.solve(weighted @ columns.T, weighted @ values) @ columns)


def thinned_reading(record: Record, frequency: float) -> Reading:
    """Block means of a record, at least twenty per cycle, about a thousand of a long one; the clock starts at 0.

    Args:
        frequency: frequency of the oscillation, Hz.
    """
    factor = max(1, min(record.time_s.size // _SAMPLES, int(record.sample_rate / (20.0 * frequency))))
    return Reading(
        mean_of_blocks(record.time_s - record.time_s[0], factor), mean_of_blocks(record.yaw_rad, factor)
    )


# share of a period on either side of a peak, for the fit of its parabola
PEAK_HALF_WIDTH = PEAK_HALF_TURN / (2.0 * np.pi)
_LEAST_SAMPLES = 1.5001  # minimum number of samples on either side of a peak: its parabola needs three
_LEAST_PEAKS = 4
_MOVES = 8  # maximum number of moves, of half a window each


@dataclass(frozen=True)
class PeakDecay:
    """Damping from the peaks.

    Args:
        rate: decay rate σ, 1/s; the time to half amplitude is ln 2/σ.
        rate_std: standard deviation of the rate, 1/s.
        zero: the sensor's zero, rad.
        zero_std: standard deviation of the zero from the scatter of the peaks, rad.
    """

    rate: float
    rate_std: float
    zero: float
    zero_std: float


def peak_decay(record: Record, frequency: float, noise: PeakNoise) -> PeakDecay | None:
    """The decay rate from a line through the logarithm of the peaks, of both signs, against time.

    The zero is the mean of (p₁ + 2p₂ + p₃)/4 over neighbouring peaks, which are evenly placed about it. Peaks
    are followed until they fall below a tenth of the first. If they scatter about the line more than the noise
    explains, the standard deviation comes from the scatter. None if there are fewer than four peaks.

    Args:
        frequency: frequency of the oscillation, Hz.
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
    times, sizes = times[:count], sizes[:count]
    centred = times - times.mean()
    gains = centred / float(centred @ centred)
    logarithms = np.log(sizes)
    slope = float(gains @ logarithms)
    residual = logarithms - logarithms.mean() - slope * centred
    stds = noise.height / sizes
    rate_std = float(np.linalg.norm(gains * stds))
    if float(np.sum((residual / stds) ** 2)) > chdtri(count - 2, MISFIT_RATE):
        scatter = float(np.sqrt(residual @ residual / (count - 2))) * float(np.linalg.norm(gains))
        rate_std = max(rate_std, scatter)
    return PeakDecay(
        rate=-slope,
        rate_std=max(rate_std, LEAST_NOISE * frequency),
        zero=zero,
        zero_std=max(float(centres.std(ddof=1) / np.sqrt(centres.size)), LEAST_NOISE * float(sizes[0])),
    )


def follow_peaks(record: Record, frequency: float, *, sparse: bool = False) -> tuple[Array, Array]:
    """Peaks of both signs, each sought half a period after the previous one; the first after the release itself.

    A peak is the vertex of a parabola through the samples within a twelfth of a period of it.

    Args:
        frequency: frequency of the oscillation, Hz.
        sparse: whether three samples make a peak if a twelfth of a period has fewer; noise does so, too.

    Returns:
        Instants since the first sample in s and heights in rad, shape (n,) each; they end where peaks no longer
        alternate.
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
    expected = np.inf
    if search.size:
        expected = float(time[search[np.argmax(np.abs(record.yaw_rad[search] - middle))]])
    while expected + width <= time[-1]:
        vertex, at = None, expected
        for _ in range(_MOVES):  # if the period drifts, the window follows the peak
            low, high = np.searchsorted(time, (at - width, at + width))
            if high - low < 3:
                break
            x = (time[low:high] - at) / width
            bend, slope, height = _parabola(x, record.yaw_rad[low:high])
            place = -0.5 * slope / bend if bend != 0.0 else np.inf
            if abs(place) <= 0.5:
                vertex = at + float(place) * width, float(height + 0.5 * slope * place)
                break
            # Move up the slope: with curvature of the wrong sign the vertex would be on the other side.
            rising = slope * np.sign(record.yaw_rad[low:high].mean() - record.yaw_rad.mean()) > 0.0
            at += (0.5 if rising else -0.5) * width
        if vertex is None:
            break
        if len(heights) >= 2 and (vertex[1] > heights[-1]) != (heights[-2] > heights[-1]):
            break  # peaks no longer alternate: the oscillation is below the noise
        times.append(vertex[0])
        heights.append(vertex[1])
        expected = vertex[0] + half
    return np.array(times), np.array(heights)


def _parabola(x: Array, y: Array) -> Array:
    """Coefficients of the least-squares parabola, highest power first, shape (3,).

    Args:
        x: places within ±1, shape (n,).
        y: values, shape (n,).
    """
    columns = np.ones((3, x.size))
    np.multiply(x, x, out=columns[0])
    columns[1] = x
    return np.asarray(np.linalg.lstsq(columns.T, y, rcond=None)[0])


# ratio of rows to blocks: a third is best at light damping, and more has little effect elsewhere
_LENGTH = 0.35
_LEAST_BLOCKS = 8
# number of values up to which a full decomposition is faster than the iteration, slow in pure noise
_DENSE = 64
_MAX_SWEEPS = 60
_SETTLED = 1e-10  # maximum change of the subspace in a sweep
_LEAST_POLE = 1e-9  # a decay that is over before the second value


@dataclass(frozen=True, eq=False)
class PencilDecay:
    """A decay and its sensitivity to the noise.

    Args:
        exponents: exponents of both poles, shape (2,), 1/s.
        duals: left vectors of the shift, by pole, shape (2, rows - 1).
        images: right vectors of the matrix, by pole, shape (columns, 2).
        interval: between the values, s.
    """

    decay: Decay
    exponents: Complex
    duals: Complex
    images: Complex
    interval: float

    @cached_property
    def weights(self) -> Array:
        """First-order change of (a, k) per rad of each value, shape (2, n)."""
        gradients = []
        for exponent, dual, image in zip(self.exponents, self.duals, self.images.T, strict=True):
            # To first order δλ = Σᵢⱼ q(i) e(i + j) v(j) with the noise e: q is the shift's residual on the dual
            # vector; the mean of v is removed, like the mean of the rows.
            pole = np.exp(exponent * self.interval)
            q = np.zeros(dual.size + 1, dtype=np.complex128)
            q[1:] += dual
            q[:-1] -= pole * dual
            gradients.append(np.convolve(q, image - image.mean()) / (pole * self.interval))
        first, second = self.exponents
        slope = [-0.5 * (gradients[0] + gradients[1]), second * gradients[0] + first * gradients[1]]
        return np.ascontiguousarray(np.real(slope))


def pencil_decay(values: Array, interval: float, omega: float) -> PencilDecay | None:
    """The decay of uniformly spaced values by the matrix pencil; None if they are too few, or contain no decay.

    The Hankel matrix of a decay, with the mean of each row removed, has rank two. A shift by one value maps its
    column space onto itself, and the eigenvalues of this 2×2 map are the exponentials of the poles. The two
    leading singular vectors of a long record are found by orthogonal iteration with products by FFT. Sources: Hua
    & Sarkar, IEEE Trans. Acoust. Speech Signal Process. 38 (1990) 814–824, doi 10.1109/29.56027 (perturbation,
    best length); Juang & Pappa, J. Guid. Control Dyn. 8 (1985) 620–627, doi 10.2514/3.20031 (rank reduction).

    Args:
        values: readings or block means of them, offset included, shape (n,), rad.
        interval: interval between the values, s; well below half a period.
        omega: an approximate angular frequency to start the iteration, rad/s.
    """
    if values.size < _LEAST_BLOCKS:
        return None
    rows = max(3, round(_LENGTH * values.size))
    left, sizes, right = _leading_pair(values - values.mean(), rows, omega * interval)
    if not sizes[1] > 1e-12 * sizes[0] > 0.0:
        return None
    upper, lower = left[:-1], left[1:]
    solver = np.linalg.pinv(upper)
    poles, vectors = np.linalg.eig(solver @ lower)
    # Two real poles are an overdamped decay; a negative pole, or one that rounding errors hide, is not a decay.
    if np.any((np.abs(poles.imag) == 0.0) & (poles.real <= _LEAST_POLE)) or np.linalg.cond(vectors) > 1e8:
        return None
    exponents = np.asarray(np.log(poles.astype(np.complex128)) / interval, np.complex128)
    vectors = vectors.astype(np.complex128)
    duals = np.linalg.inv(vectors) @ solver
    images = right.astype(np.complex128) @ (vectors / sizes[:, None])
    decay = Decay(float(-0.5 * (exponents[0] + exponents[1]).real), float((exponents[0] * exponents[1]).real))
    return PencilDecay(decay, exponents, duals, images, interval)


def _leading_pair(values: Array, rows: int, angle: float) -> tuple[Array, Array, Array]:
    """Left vectors (rows, 2), singular values (2,), right vectors (columns, 2) of the row-centred Hankel matrix."""
    columns = values.size - rows + 1
    if values.size <= _DENSE:
        hankel = sliding_window_view(values, columns)
        vectors, sizes, turn = np.linalg.svd(hankel - hankel.mean(axis=1, keepdims=True), full_matrices=False)
        return vectors[:, :2], sizes[:2], turn[:2].T
    size = next_fast_len(values.size, real=True)
    spectrum = rfft(values, size)

    def times(block: Array, count: int) -> Array:
        return np.asarray(irfft(spectrum * rfft(block, size).conj(), size)[:, :count])

    steps = angle * np.arange(columns)
    right = np.stack((np.cos(steps), np.sin(steps)))
    right = _orthonormal(right - right.mean(axis=1, keepdims=True))
    for _ in range(_MAX_SWEEPS):
        left = _orthonormal(times(right, rows))
        image = times(left, columns)
        image -= image.mean(axis=1, keepdims=True)
        before = right
        right = _orthonormal(image)
        if np.linalg.norm(right - (right @ before.T) @ before) < _SETTLED:
            break
    turn, sizes, vectors = np.linalg.svd(image, full_matrices=False)
    return left.T @ turn, sizes, vectors.T


def _orthonormal(pair: Array) -> Array:
    """Two rows of length 1, at right angles, that span the given ones, shape (2, n); 0 where there is none."""
    found = np.array(pair)
    first, second = found
    first /= sqrt(first @ first) or 1.0
    for _ in range(3):  # the rest of a nearly parallel row is at right angles only when it is projected again
        second -= (first @ second) * first
        second /= sqrt(second @ second) or 1.0
    return found
