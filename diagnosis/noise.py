"""The noise of a record, from the part of its spectrum far above the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tunnel_sim.campaign import Campaign
from tunnel_sim.record import Array, Record

_FLOOR_FROM = 60.0  # Hz: above the motion, the rod's ringing and the mains
_LN2 = float(np.log(2.0))  # median of a unit exponential: the periodogram of white noise
_APART = 4.065  # standard deviations from the mean at which a run's noise is its own


@dataclass(frozen=True)
class Noise:
    """A campaign's noise.

    Args:
        variance: of one sample, quantisation included, rad², by run id: what the diagnosis uses.
        stated_variance: noise_std² + resolution²/12 as the campaign states it, rad²; None where it does not.
        source: ``stated`` or ``estimated``.
        reason: why, in words.
    """

    variance: dict[str, float]
    stated_variance: float | None
    source: str
    reason: str


def estimate_variance(record: Record) -> tuple[float, float]:
    """White-noise variance from the median periodogram above the motion.

    Args:
        record: a run's reading.

    Returns:
        Variance of one sample, rad², and its relative standard deviation. Lines such as the mains' harmonics
        do not move a median.
    """
    rate = record.sample_rate
    low = min(_FLOOR_FROM, 0.25 * rate)
    frequency, power = floor_periodogram(record.yaw_rad, rate)
    floor = power[(frequency > low) & (frequency < 0.49 * rate)]
    # a median of n exponentials scatters by 1/√n of its mean ln 2; the Hann window correlates neighbouring
    # bins: 1.57 of them carry what one would without it
    return float(np.median(floor) / _LN2 * rate / 2.0), float(np.sqrt(1.57 / floor.size) / _LN2)


def floor_periodogram(values: Array, rate: float) -> tuple[Array, Array]:
    """One-sided periodogram with a window whose leakage stays below the floor.

    Args:
        values: samples.
        rate: Hz.

    Returns:
        Frequencies, Hz, and power, unit²/Hz.
    """
    window = np.hanning(values.size)
    spectrum = np.fft.rfft((values - np.mean(values)) * window)
    power = 2.0 * np.abs(spectrum) ** 2 / (rate * float(window @ window))
    return np.asarray(np.fft.rfftfreq(values.size, 1.0 / rate), np.float64), power


def campaign_noise(campaign: Campaign) -> Noise:
    """The noise of every run, estimated from the records and held against what is stated.

    Args:
        campaign: the runs.

    Returns:
        The estimate, pooled over runs where they agree with one another.
    """
    estimates = {run.id: estimate_variance(run.record) for run in campaign.runs}
    variances = np.array([value for value, _ in estimates.values()])
    relative = np.array([std for _, std in estimates.values()])
    pooled = float(np.mean(variances))
    sensor = campaign.sensor
    stated = None
    if sensor.noise_std is not None:
        stated = sensor.noise_std**2 + (sensor.resolution or 0.0) ** 2 / 12.0
        stated = stated if stated > 0.0 else None  # a noise of zero states nothing a record could have
    uniform = bool(np.all(np.abs(variances / pooled - 1.0) < _APART * relative))
    use = {run.id: pooled if uniform else estimates[run.id][0] for run in campaign.runs}
    if stated is None:
        return Noise(use, None, "estimated", "the campaign states no noise")
    return Noise(
        use, stated, "estimated", f"from the records; stated is {np.sqrt(stated / pooled):.2f} times as large"
    )


def reading_step(campaign: Campaign) -> float:
    """The step of the lattice on which the readings lie.

    Args:
        campaign: the runs.

    Returns:
        The smallest difference between distinct readings, rad: the true resolution where the record visits
        neighbouring steps, as every decay does; far below any step where readings are continuous.
    """
    steps = []
    for run in campaign.runs:
        distinct = np.unique(run.record.yaw_rad)
        gaps = np.diff(distinct)
        gaps = gaps[gaps > 1e-9]  # the same step printed twice with different rounding
        if gaps.size:
            steps.append(float(np.quantile(gaps, 0.02)))
    return min(steps, default=0.0)


@dataclass(frozen=True)
class NoiseTrend:
    """How the noise's level depends on the motion.

    Args:
        amplitude_z: slope of the local noise variance against the squared amplitude, in its standard deviations.
        rate_z: likewise against the squared rate.
        spread_z: excess of the local variances' standard deviation over what their quartiles give, times the root
            of their number: heavy tails.
    """

    amplitude_z: float
    rate_z: float
    spread_z: float


_WINDOW = 0.02  # s: a small part of a swing, so that rate and angle differ
_FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # leaves (ω dt)⁴ of the motion: far below any noise


def noise_trend(campaign: Campaign) -> NoiseTrend:
    """Test whether the noise is as strong in motion as at rest.

    Args:
        campaign: the runs.

    Returns:
        Trends of the variance of fourth differences of the reading in windows of 20 ms, pooled over runs. Under
        steady white noise the slopes are about standard normal; the scatter lies above zero, for mean squares of
        few samples are skewed, and the more so the more windows there are.
    """
    levels, squares, rates = [], [], []
    for run in campaign.runs:
        local = _local_levels(run.record)
        if local is not None:
            level, angle, rate = local
            levels.append(level / np.mean(level) - 1.0)
            squares.append(_standardised(angle**2))
            rates.append(_standardised(rate**2))
    if not levels:
        return NoiseTrend(0.0, 0.0, 0.0)
    level, square, rate = (np.concatenate(v) for v in (levels, squares, rates))
    spread = float(np.std(level))
    count = level.size
    # a robust look at the tails: share of windows beyond what the bulk's own scatter allows
    bulk = float(np.subtract(*np.quantile(level, [0.75, 0.25]))) / 1.349
    return NoiseTrend(
        float(level @ square) / (spread * np.sqrt(count)),
        float(level @ rate) / (spread * np.sqrt(count)),
        (spread / bulk - 1.0) * float(np.sqrt(count)),
    )


def _standardised(values: Array) -> Array:
    result: Array = (values - values.mean()) / max(float(values.std()), 1e-300)
    return result


def _local_levels(record: Record) -> tuple[Array, Array, Array] | None:
    """Mean squared fourth difference, mean angle and rate in windows; None where sampling is too slow."""
    width = round(_WINDOW * record.sample_rate)
    if width < 10:
        return None
    reading = record.yaw_rad - np.mean(record.yaw_rad)
    fourth = np.convolve(reading, _FOURTH, mode="same")
    count = reading.size // width

    def windows(values: Array) -> Array:
        return values[: count * width].reshape(count, width)

    angle = windows(reading).mean(axis=1)
    return np.mean(windows(fourth) ** 2, axis=1)[1:-1], angle[1:-1], np.gradient(angle)[1:-1]
