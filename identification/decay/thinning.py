"""Block means of a reading. They keep the rate and frequency of a decay and reduce its amplitude a little."""

from __future__ import annotations

import numpy as np

from identification.decay.decay_fit import Reading
from identification.policy import LEAST_SAMPLES
from tunnel_sim.vocabulary.record import Array, Record, evenly_spaced


def even_reading(reading: Reading) -> Reading:
    """A reading on a uniform raster, for methods that work by the place of a sample and not by its time.

    Returns:
        As `tunnel_sim.vocabulary.record.evenly_spaced`; the reading itself where its times are uniform.
    """
    record = Record(reading.time, reading.yaw)
    return reading if record.uniform else Reading.from_record(evenly_spaced(record))


def block_means(reading: Reading, frequency: float, per_cycle: float) -> tuple[Reading, int]:
    """Thin a reading to means of equal blocks.

    Args:
        frequency: of its oscillation, Hz.
        per_cycle: least number of blocks per period; the record itself gives at least eight.

    Returns:
        The thinned reading, with the times of the middles of the blocks, and the number of samples per block.
    """
    rate = (reading.time.size - 1) / float(reading.time[-1])
    factor = max(1, int(min(rate / (per_cycle * frequency), reading.time.size / LEAST_SAMPLES)))
    return Reading(mean_of_blocks(reading.time, factor), mean_of_blocks(reading.yaw, factor)), factor


def mean_of_blocks(values: Array, factor: int) -> Array:
    """Means of consecutive values; those left over at the end are dropped.

    Args:
        values: shape (n,).
        factor: number of values in a block.

    Returns:
        Shape (n // factor,).
    """
    if factor == 1:
        return values
    usable = values.size // factor * factor
    # Along the first axis NumPy adds whole rows at once: for short blocks, ten times as fast as along the last.
    return np.asarray(np.ascontiguousarray(values[:usable].reshape(-1, factor).T).mean(axis=0))
