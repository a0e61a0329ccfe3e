"""The noise of the sensor, and whether the residual of a fit is that noise and nothing else.

The fast part of a residual (its sixth differences) contains only noise, whatever the model. The slow part (means
over an eighth of a cycle) also contains the misfit of the model, in the band of the oscillation, which
determines the parameters. White noise has the same power in both: their ratio is tested by F.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.special import fdtri

from identification.estimate import NoiseLevel
from identification.policy import LEAST_NOISE, MISFIT_DEVIATIONS, MISFIT_RATE, NOISE_TOLERANCE
from identification.statistics import inner
from tunnel_sim.vocabulary.campaign import SensorProperties
from tunnel_sim.vocabulary.record import Array, Record
from tunnel_sim.vocabulary.shapes import Angles, Seconds

_ORDER = 6
# Variance of one sixth difference of unit white noise, and the number of samples per degree of freedom:
# Σ (C(12, 6+j)/C(12, 6))² = C(24, 12)/C(12, 6)².
_DIFFERENCE_GAIN = 924.0
_SAMPLES_PER_DEGREE = 2704156.0 / 924.0**2
_LONGEST_BLOCK = 1e9  # samples: longer than any record


@dataclass(frozen=True, eq=False)
class Residual:
    """The residual of a fit to one run or window.

    Args:
        values: reading less model, shape (n,), rad.
        unknowns: number of parameters fitted to the run's own data.
        peak: greatest deviation of the reading from the sensor's zero, rad.
    """

    values: Array
    block: int
    unknowns: int
    peak: float


def eighth_of_a_cycle(omega_n: float, sample_interval: Seconds) -> int:
    """Samples in an eighth of the natural period, at least one.

    Args:
        omega_n: natural angular frequency, rad/s.
    """
    return max(1, round(min(2.0 * np.pi / (8.0 * omega_n * sample_interval), _LONGEST_BLOCK)))


def stated_noise(sensor: SensorProperties) -> float | None:
    """√(noise_std² + resolution²/12), rad; None where noise_std is not stated."""
    if sensor.noise_std is None:
        return None
    return float(np.hypot(sensor.noise_std, (sensor.resolution or 0.0) / np.sqrt(12.0)))


def noise_level(residuals: Sequence[Residual], sensor: SensorProperties) -> NoiseLevel:
    """The noise level behind the standard deviations: the stated one where the residuals agree, else measured."""
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
    power, freedom, ratio, departs = 0.0, 0, 1.0, False
    for residual in residuals:
        own, blocks = slow_power(residual.values, residual.block)
        power += own
        freedom += blocks - residual.unknowns
    if freedom >= 3:
        ratio = power / freedom / reference**2
        chance = float(fdtri(freedom, min(np.inf if bears_out else degrees, 1e9), 1.0 - MISFIT_RATE))
        departs = bool(ratio > chance * (1.0 + NOISE_TOLERANCE) ** 2)
    if not departs and bears_out and stated is not None:
        bears_out = _agree(total, stated, count - unknowns)
    used = reference if departs or (bears_out and stated is not None) else total
    return NoiseLevel(
        std=used,
        source="stated" if bears_out else "residual",
        residual_std=total,
        slow_ratio=max(ratio, 1.0) if departs else 1.0,
        departs=departs,
        disagrees=stated is not None and not bears_out,
    )


def white_noise(reading: Array, sensor: SensorProperties) -> float:
    """The white part of a reading's noise, from its sixth differences: standard deviation of one sample, rad.

    Args:
        reading: of many samples per cycle, evenly spaced, shape (n,), rad.
        sensor: its stated noise is used where the reading agrees with it; quantisation is included.
    """
    peak = 0.5 * float(np.ptp(reading))
    floor = max(LEAST_NOISE * peak, 1e-300)
    return _as_stated(*_fast_part([Residual(reading, 1, 0, peak)], floor), floor, sensor)


def reading_noise(record: Record, sensor: SensorProperties) -> float:
    """`white_noise` of a record of many samples per cycle, with any spacing of its times."""
    if record.uniform or record.time_s.size <= 4 * _ORDER:
        return white_noise(record.yaw_rad, sensor)
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
    floor = max(0.5 * LEAST_NOISE * float(np.ptp(values)), 1e-300)
    return _as_stated(fast, count / _SAMPLES_PER_DEGREE, floor, sensor)


def slow_power(values: Angles, block: int) -> tuple[float, int]:
    """Power of the slow part of a residual, by its means over blocks, rad², and the number of blocks.

    The power of white noise is its variance times that number.

    Args:
        block: number of samples in a block, such as `eighth_of_a_cycle`.
    """
    blocks = values.size // block
    means = values[: blocks * block].reshape(blocks, block).mean(axis=1)
    return float(inner(means, means)) * block, blocks


def _as_stated(fast: float, degrees: float, floor: float, sensor: SensorProperties) -> float:
    """The stated noise where the measured one agrees with it, else the measured one."""
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
