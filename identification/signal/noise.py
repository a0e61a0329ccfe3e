"""The noise of the sensor, and whether the residual of a fit is this noise alone.

The fast part of a residual (its sixth differences) contains only noise, whatever the model. The slow part
(means over an eighth of a cycle) also contains the misfit of the model, in the band of the oscillation, which
determines the parameters. White noise has the same power in both: their ratio is tested by F. Where they
differ, the noise may be coloured: its spectrum is taken between the harmonics of the motion
(`identification.signal.colour`), and the same test judges the whitened residual. If the residual passes, all
standard deviations use the power of this spectrum at the frequency of the motion; if not, the residual is a
misfit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.special import fdtri

from identification.estimate import NoiseLevel
from identification.policy import LEAST_NOISE, MISFIT_DEVIATIONS, MISFIT_RATE, NOISE_TOLERANCE
from identification.signal.colour import Autoregression, Periodogram, slow_part, steady
from identification.statistics import inner
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.quantities import Angles, Seconds
from tunnel_sim.vocabulary.record import Array, Record

_ORDER = 6
# Variance of one sixth difference of unit white noise, and the number of samples per degree of freedom:
# Σ (C(12, 6+j)/C(12, 6))² = C(24, 12)/C(12, 6)².
_DIFFERENCE_GAIN = 924.0
_SAMPLES_PER_DEGREE = 2704156.0 / 924.0**2
_LONGEST_CYCLE = 8e9  # number of samples: longer than any record
_BLOCKS = 8  # number of blocks in a cycle, for the slow part
_PARTS = 16  # number of parts of a residual in which noise has the same power


@dataclass(frozen=True, eq=False)
class Residual:
    """The residual of a fit to one run or window.

    Args:
        values: reading less model, shape (n,), rad.
        cycle: number of samples in a cycle of the motion.
        unknowns: number of parameters fitted to the run's own data.
        peak: greatest deviation of the reading from the sensor's zero, rad.
    """

    values: Array
    cycle: float
    unknowns: int
    peak: float

    @property
    def block(self) -> int:
        """Samples in an eighth of a cycle, at least one."""
        return max(1, round(self.cycle / _BLOCKS))


def samples_in_cycle(omega_n: float, sample_interval: Seconds) -> float:
    """Samples in a natural period.

    Args:
        omega_n: natural angular frequency, rad/s.
    """
    return float(min(2.0 * np.pi / (omega_n * sample_interval), _LONGEST_CYCLE))


@dataclass(frozen=True, eq=False)
class ReadingNoise:
    """The noise of fitted runs.

    Args:
        colours: colour of each run's noise; none where it is white.
        powers: power of each run's coloured noise at the frequency of its motion, rad²; none where it is white.
    """

    level: NoiseLevel
    colours: tuple[Autoregression, ...] = ()
    powers: tuple[float, ...] = ()

    @property
    def variance(self) -> float:
        """The variance of white noise with the same power at the frequency of the motion, rad²."""
        return self.level.std**2 * self.level.slow_ratio


def stated_noise(sensor: SensorProperties) -> float | None:
    """√(noise_std² + resolution²/12), rad; None where noise_std is not stated."""
    if sensor.noise_std is None:
        return None
    return float(np.hypot(sensor.noise_std, (sensor.resolution or 0.0) / np.sqrt(12.0)))


def noise_of(residuals: Sequence[Residual], sensor: SensorProperties) -> ReadingNoise:
    """The noise behind the standard deviations: the stated level if the residuals agree, else the measured."""
    floor = LEAST_NOISE * max(residual.peak for residual in residuals)
    unknowns = sum(residual.unknowns for residual in residuals)
    count = sum(residual.values.size for residual in residuals)
    squares = sum(float(inner(residual.values, residual.values)) for residual in residuals)
    total = max(float(np.sqrt(squares / max(count - unknowns, 1))), floor)
    fast, degrees = _fast_part(residuals, total)
    fast = max(fast, floor, (sensor.resolution or 0.0) / sqrt(12.0))
    stated = stated_noise(sensor)
    stated = None if stated is None else max(stated, floor)
    bears_out = stated is not None and _agree(fast, stated, degrees)
    reference = stated if stated is not None and bears_out else fast
    # Power of the block means relative to white noise of the reference level, and the verdict by F.
    slow = _squares([slow_power(one.values, one.block) for one in residuals])
    departs, ratio = _exceeds(slow[0] / reference**2, slow[1] - unknowns, np.inf if bears_out else degrees)
    if departs:
        coloured = _coloured(residuals, total, stated)
        if coloured is not None:
            return coloured
    if not departs and bears_out and stated is not None:
        bears_out = _agree(total, stated, count - unknowns)
    used = reference if departs or (bears_out and stated is not None) else total
    return ReadingNoise(
        NoiseLevel(
            std=used,
            source="stated" if bears_out else "residual",
            residual_std=total,
            slow_ratio=max(ratio, 1.0) if departs else 1.0,
            departs=departs,
            disagrees=stated is not None and not bears_out,
        )
    )


def noise_level(residuals: Sequence[Residual], sensor: SensorProperties) -> NoiseLevel:
    """`noise_of` without the colours of the runs."""
    return noise_of(residuals, sensor).level


def _squares(parts: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Sums of squares, and numbers of squares, of all runs together."""
    return sum(power for power, _ in parts), sum(count for _, count in parts)


def _exceeds(power: float, freedom: float, degrees: float) -> tuple[bool, float]:
    """Whether residuals have more power than the noise beyond chance, and the ratio of the powers.

    Args:
        power: sum of squares over the variance of the noise.
        freedom: degrees of freedom of the power.
        degrees: degrees of freedom of the variance of the noise.
    """
    if freedom < 3:
        return False, 1.0
    chance = float(fdtri(freedom, min(degrees, 1e9), 1.0 - MISFIT_RATE))
    return bool(power / freedom > chance * (1.0 + NOISE_TOLERANCE) ** 2), power / freedom


def _coloured(residuals: Sequence[Residual], total: float, stated: float | None) -> ReadingNoise | None:
    """Coloured noise that explains the residuals; None if there is none.

    It explains them if the whitened residuals pass the test of white noise, also near the motion alone, and
    have one power in all parts of a run. The misfit of a model lies near the motion or changes along the run,
    and a random moment excites the resonance. The noise must not exceed its stated level.

    Args:
        total: standard deviation of the residuals, rad.
        stated: stated noise, rad; None where it is not stated.
    """
    colours, innovations = [], []
    for residual in residuals:
        colour = Autoregression.of(residual.values, residual.cycle)
        if colour is None or not colour.innovations > 0.0:
            return None
        colours.append(colour)
        innovations.append(colour.whitened(residual.values))
    unknowns, degrees = sum(one.unknowns for one in residuals), sum(colour.freedom for colour in colours)
    slow = _squares(
        [slow_power(w, max(1, round(c.cycle / _BLOCKS))) for w, c in zip(innovations, colours, strict=True)]
    )
    near = _squares([c.near_motion(one.values) for c, one in zip(colours, residuals, strict=True)])
    if _exceeds(slow[0], slow[1] - unknowns, degrees)[0] or _exceeds(*near, degrees)[0]:
        return None
    if not _steady_along(innovations):
        return None
    freedom = sum(_independent_squares(residual) for residual in residuals)
    bears_out = stated is not None and _agree(total, stated, freedom)
    if stated is not None and not bears_out and total > stated:
        return None
    std = stated if bears_out and stated is not None else total
    powers = [float(colour.power(1.0)) * (std / total) ** 2 for colour in colours]
    level = NoiseLevel(
        std=std,
        source="stated" if bears_out else "residual",
        residual_std=total,
        slow_ratio=float(np.mean(powers)) / std**2,
        departs=False,
        disagrees=stated is not None and not bears_out,
    )
    return ReadingNoise(level, tuple(colours), tuple(powers))


def _independent_squares(residual: Residual) -> float:
    """The number of independent squares in the variance of coloured noise: (Σ S)² over Σ S²."""
    own = 1.0 / residual.cycle
    power = Periodogram.of(residual.values, 1.0, own).bridged(own)
    return 2.0 * residual.values.size * float(np.mean(power)) ** 2 / float(np.mean(power**2))


_ODD = np.arange(
    1.0, 16.0, 2.0
)  # odd harmonics of the motion, which alternate from peak to peak like its own line
PEAK_HALF_TURN = np.pi / 6.0
"""Angle of the motion within the half width of a peak, a twelfth of a period, rad."""


@dataclass(frozen=True)
class PeakNoise:
    """Noise of the vertex of a parabola through the samples within a twelfth of a period of a peak.

    Its height is the samples' mean with weights (9 − 15x²)/8, and its slope their mean with weights 3x/2, with
    the place x within ±1. A line through peaks of alternating sign averages out all noise except near the odd
    harmonics of the motion.

    Args:
        height: standard deviation of the height, rad.
        slope: standard deviation of the slope per half width, rad; of the instant, over ω² h w for a height h
            and a half width w.
    """

    height: float
    slope: float

    @classmethod
    def of(cls, std: float, samples: float, colour: Autoregression | None = None) -> PeakNoise:
        """White noise of a standard deviation (rad), or coloured noise, in windows of a number of samples."""
        turn = PEAK_HALF_TURN * _ODD
        heights = (15.0 * (np.sin(turn) / turn - np.cos(turn)) / turn - 3.0 * np.sin(turn)) / (2.0 * turn)
        slopes = 3.0 * (np.sin(turn) / turn - np.cos(turn)) / turn
        power = np.full(turn.size, std**2) if colour is None else colour.power(_ODD)
        height, slope = (
            sqrt(float(np.average(power, weights=one**2)) / samples) for one in (heights, slopes)
        )
        return cls(1.5 * height, sqrt(3.0) * slope)


def white_noise(reading: Array, sensor: SensorProperties) -> float:
    """The white part of a reading's noise, from its sixth differences: standard deviation of one sample, rad.

    Args:
        reading: reading of many samples per cycle, evenly spaced, shape (n,), rad.
        sensor: the sensor; its stated noise is used if the reading agrees with it. Quantisation is included.
    """
    return _as_stated(*_white_part(reading), _floor(reading), sensor)


def reading_noise(record: Record, sensor: SensorProperties) -> float:
    """`white_noise` of a record of many samples per cycle, with any spacing of its times."""
    return _as_stated(*measured_noise(record), _floor(record.yaw_rad), sensor)


def measured_noise(record: Record) -> tuple[float, float]:
    """The white part of a record's noise from its readings alone, ignoring the sensor's statements.

    Args:
        record: record of many samples per cycle, with any spacing of its times.

    Returns:
        Standard deviation of one sample, rad, and the degrees of freedom of its variance.
    """
    if record.uniform or record.time_s.size <= 4 * _ORDER:
        return _white_part(record.yaw_rad)
    # A sixth divided difference is zero for the quintic that a swing resembles over seven samples.
    time, values = record.time_s, record.yaw_rad
    count = time.size - _ORDER
    nodes = np.stack([time[i : i + count] for i in range(_ORDER + 1)])
    difference, power = np.zeros(count), np.zeros(count)
    for i, node in enumerate(nodes):
        away = (node - nodes) / (nodes[-1] - nodes[0])
        away[i] = 1.0
        weight = 1.0 / np.prod(away, axis=0)
        difference += weight * values[i : i + count]
        power += weight**2
    fast = sqrt(float(np.mean(difference**2 / power)))
    return max(fast, _floor(values)), count / _SAMPLES_PER_DEGREE


def _white_part(reading: Array) -> tuple[float, float]:
    """`measured_noise` of evenly spaced readings."""
    floor = _floor(reading)
    fast, degrees = _fast_part([Residual(reading, 1.0, 0, 0.5 * float(np.ptp(reading)))], floor)
    return max(fast, floor), degrees


def _floor(reading: Array) -> float:
    """The least noise of a reading, rad."""
    return max(0.5 * LEAST_NOISE * float(np.ptp(reading)), 1e-300)


def slow_power(values: Angles, block: int) -> tuple[float, int]:
    """Power of the slow part of a residual, rad², and the number of blocks.

    The power of white noise is its variance times the number of blocks.

    Args:
        block: number of samples in a block, such as `Residual.block`.
    """
    slow = slow_part(values, block)
    return float(inner(slow, slow)), slow.size


def _steady_along(runs: Sequence[Array]) -> bool:
    """Whether white values have one power in all parts of every run.

    Args:
        runs: values of the runs, shape (n,) each.
    """
    split = [np.array_split(values, _PARTS) for values in runs]
    power = np.array([[float(np.mean(one**2)) for one in run] for run in split]).T
    count = np.array([[0.5 * one.size for one in run] for run in split]).T
    return bool(steady(power, count, MISFIT_RATE / len(runs)).all())


def _as_stated(fast: float, degrees: float, floor: float, sensor: SensorProperties) -> float:
    """The stated noise if the measured noise agrees with it, else the measured noise."""
    fast = max(fast, floor, (sensor.resolution or 0.0) / sqrt(12.0))
    stated = stated_noise(sensor)
    return max(stated, floor) if stated is not None and _agree(fast, max(stated, floor), degrees) else fast


def _fast_part(residuals: Sequence[Residual], fallback: float) -> tuple[float, float]:
    # Standard deviation of the white part, and its degrees of freedom.
    differences = [np.diff(r.values, _ORDER) for r in residuals if r.values.size > 4 * _ORDER]
    count = sum(difference.size for difference in differences)
    if count == 0:
        return fallback, 1.0
    power = sum(float(inner(difference, difference)) for difference in differences) / count
    return float(np.sqrt(power / _DIFFERENCE_GAIN)), count / _SAMPLES_PER_DEGREE


def _agree(measured: float, stated: float, degrees: float) -> bool:
    tolerance = NOISE_TOLERANCE + MISFIT_DEVIATIONS / np.sqrt(2.0 * max(degrees, 1.0))
    return bool(abs(measured / stated - 1.0) <= tolerance)
