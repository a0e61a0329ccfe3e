"""Samples in blocks: where uneven samples lie, and how a block's mean follows from the motion at its ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.vocabulary.record import Array, Record


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples that are not evenly spaced, on the uniform raster of the blocks.

    A block without any has a place for one in its middle, so that every block has a mean; it does not count.

    Args:
        time: since the start of the first block, increasing, shape (m,), s.
        block: the block that each sample lies in, shape (m,).
        count: samples in each block, shape (n,).
    """

    time: Array
    block: NDArray[np.int64]
    count: NDArray[np.int64]

    @classmethod
    def of(cls, record: Record, block: int) -> Samples:
        """The samples of a record, in blocks that hold ``block`` of them on average.

        The raster starts half a mean interval before the first sample, so that jitter moves few samples into the
        next block.
        """
        blocks, interval = record.time_s.size // block, block * record.sample_interval
        time = record.time_s - record.time_s[0] + 0.5 * record.sample_interval
        place = np.floor(time / interval).astype(np.int64)
        count = np.bincount(place, minlength=blocks)[:blocks]
        empty = np.flatnonzero(count == 0)
        order = np.argsort(np.concatenate([time[place < blocks], (empty + 0.5) * interval]))
        time = np.concatenate([time[place < blocks], (empty + 0.5) * interval])[order]
        return cls(time, np.concatenate([place[place < blocks], empty])[order], count)

    def means(self, values: Array) -> Array:
        """Mean over each block of one value per sample, shape (m,) or (k, m)."""
        rows = np.atleast_2d(values)
        sums = np.stack([np.bincount(self.block, row, self.count.size) for row in rows])
        return np.asarray((sums / np.maximum(self.count, 1)).reshape(*values.shape[:-1], -1), np.float64)

    def part(self, first: int, last: int, interval: float) -> Samples:
        """The samples of some of the blocks.

        Args:
            first: number of the first block.
            last: number of the block after the last one.
            interval: of a block, s.
        """
        inside = slice(*np.searchsorted(self.block, (first, last)))
        return Samples(
            self.time[inside] - first * interval, self.block[inside] - first, self.count[first:last]
        )


def hermite_means(block: int, derivative: int = 0, interval: float = 1.0) -> Array:
    """Weights that turn a step's ends into the mean over its evenly spaced samples.

    Args:
        block: samples in the step, the first at its start.
        derivative: as in `hermite_basis`.
        interval: of the step, s.

    Returns:
        As `hermite_basis`, shape (4,).
    """
    means: Array = hermite_basis(np.arange(block) / block, derivative, interval).mean(axis=1)
    return means


def hermite_basis(u: Array, derivative: int = 0, interval: float = 1.0) -> Array:
    """The cubic through both ends of a step, or a derivative of it.

    Args:
        u: places in the step, from 0 to 1, shape (n,).
        derivative: 0, 1 or 2.
        interval: of the step, s.

    Returns:
        Weights of (start angle, end angle, interval × start rate, interval × end rate), shape (4, n), in units of
        s to the power of −``derivative``: exact to the integrator's order for the angle, and to one and two orders
        less for its derivatives.
    """
    basis = (
        [2 * u**3 - 3 * u**2 + 1, -2 * u**3 + 3 * u**2, u**3 - 2 * u**2 + u, u**3 - u**2],
        [6 * u**2 - 6 * u, -6 * u**2 + 6 * u, 3 * u**2 - 4 * u + 1, 3 * u**2 - 2 * u],
        [12 * u - 6, -12 * u + 6, 6 * u - 4, 6 * u - 2],
    )[derivative]
    return np.array(basis) / interval**derivative
