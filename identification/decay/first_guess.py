"""Starting values of a fit, from the record alone, at any damping."""

from __future__ import annotations

import numpy as np

from identification.decay.damped_oscillation import Decay
from identification.decay.decay_fit import Reading, projected_cost
from identification.decay.readable import holds_motion
from identification.decay.spectrum import psd_peak
from identification.decay.thinning import mean_of_blocks
from tunnel_sim.vocabulary.record import Array, Record

_SAMPLES = 1024  # candidates are compared on a thinned record; the fit itself uses every sample
_LONG = 4096  # samples for the spectrum; a longer record is thinned to them and not padded
_DAMPING_RATIOS = (0.0, 0.002, 0.006, 0.02, 0.06, 0.2, 0.5)


def starting_decay(record: Record) -> Decay | None:
    """A decay close enough for the least-squares fit to converge.

    For records of many cycles the candidates are the peak of the power spectral density with several damping
    ratios; for heavily damped ones, the fit of the twice integrated equation of motion. The candidate with the
    smallest sum of squares is taken.

    Returns:
        The decay; None where the record holds no motion, or no decay fits it at all.
    """
    frequency = starting_frequency(record)
    if frequency is None:
        return None
    thin = thinned_reading(record, frequency)
    omega = 2.0 * np.pi * frequency
    candidates = [Decay.from_modal(omega / np.sqrt(1.0 - zeta**2), zeta) for zeta in _DAMPING_RATIOS]
    integrated = _integrated_equation(thin)
    if integrated.stiffness > 0.0:
        candidates.append(integrated)
    costs = [projected_cost(thin, candidate) for candidate in candidates]
    best = int(np.argmin(costs))
    return candidates[best] if np.isfinite(costs[best]) else None


def starting_frequency(record: Record) -> float | None:
    """The approximate frequency of the strongest oscillation.

    Returns:
        Hz; None where the record holds no motion.
    """
    if not holds_motion(record):
        return None
    # A block mean hides an oscillation of two samples per cycle or fewer: a record of some two thousand cycles.
    factor = max(1, record.time_s.size // _LONG)
    if factor > 1:
        record = Record(mean_of_blocks(record.time_s, factor), mean_of_blocks(record.yaw_rad, factor))
    frequency = psd_peak(record, padding=8 if factor == 1 else 1, falling=True).frequency
    return None if frequency == 0.0 else frequency


def thinned_reading(record: Record, frequency: float) -> Reading:
    """Block means of a record, at least twenty per cycle; they decay at the same rate.

    Args:
        frequency: of its oscillation, Hz.

    Returns:
        The thinned reading, about a thousand samples of a long record; its clock starts at the first sample.
    """
    factor = max(1, min(record.time_s.size // _SAMPLES, int(record.sample_rate / (20.0 * frequency))))
    return Reading(
        mean_of_blocks(record.time_s - record.time_s[0], factor), mean_of_blocks(record.yaw_rad, factor)
    )


def _integrated_equation(reading: Reading) -> Decay:
    # y + 2a∫y + k∬y = c₀ + c₁t + c₂t²: linear in a and k, and integration reduces the noise.
    time, yaw = reading.time, reading.yaw
    once = _integral(time, yaw)
    twice = _integral(time, once)
    columns = np.column_stack((once, twice, np.ones_like(time), time, time**2))
    scale = np.linalg.norm(columns, axis=0)
    solution = np.linalg.lstsq(columns / scale, -yaw, rcond=None)[0] / scale
    return Decay(float(solution[0]) / 2.0, float(solution[1]))


def _integral(time: Array, values: Array) -> Array:
    steps = np.diff(time) * 0.5 * (values[1:] + values[:-1])
    return np.concatenate(([0.0], np.cumsum(steps)))
