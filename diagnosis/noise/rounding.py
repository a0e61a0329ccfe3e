"""The error of rounded readings, which is not white where the noise before it is small."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.run_data import RunData
from tunnel_sim.vocabulary.record import Array

#: Noise of this many steps makes the rounding error independent of the motion to within a ten-thousandth: the first
#: harmonic of the error falls with exp(−4π²σ²/q²) (B. Widrow and I. Kollár, Quantization Noise, 2008, ch. 11).
_BLURS = 0.5
_MOST, _FEWEST = 16, 4  # repetitions of the campaign
_SAMPLES = 2.5e6  # read again in all


def samples(fit: Fit) -> int:
    """Number of samples in all runs of a fit."""
    return sum(run.reading.size * run.block for run in fit.problem.data.runs)


def repetitions(fit: Fit, fewest: int, most: int) -> int:
    """How often to read the runs of a fit again: less often where they are long."""
    return int(np.clip(_SAMPLES / samples(fit), fewest, most))


def repeated(
    fit: Fit, white: Mapping[str, float], step: float, count: int, levels: Array | None = None
) -> Iterator[tuple[RunData, Array, Array]]:
    """Read the fitted motion again, with white noise and a lattice of unknown origin.

    Args:
        white: standard deviation of a sample's noise before rounding, rad, by run id.
        step: of the lattice, rad; 0 where there is none.
        count: of the repetitions.
        levels: readings that occur where steps are of unequal width, increasing, shape (levels,), rad; None: the
            step is the same everywhere.

    Yields:
        Every run with the samples of its motion, shape (n,), and of the readings, shape (count, n), rad.
    """
    # seeded by the readings, so that one campaign is always compared with the same repetitions
    rng = np.random.default_rng([zlib.crc32(run.reading.tobytes()) for run in fit.problem.data.runs])
    for run, residual in zip(fit.problem.data.runs, fit.residuals, strict=True):
        motion = run.reading - run.unscaled(residual)
        if run.block > 1 or run.samples is not None:  # samples from block means
            seen = run.counts > 0
            motion = np.asarray(CubicSpline(run.times[seen], motion[seen])(run.sample_times), np.float64)
        reading = motion + white[run.stretch_of or run.id] * rng.standard_normal((count, motion.size))
        if step > 0.0 and levels is None:
            shift = step * rng.uniform(size=(count, 1))
            # back to the angle: the origin belongs to the lattice, not to the motion
            reading = step * np.round((reading + shift) / step) - shift
        elif step > 0.0 and levels is not None:
            reading = levels[np.searchsorted(0.5 * (levels[1:] + levels[:-1]), reading)]
        yield run, motion, reading


def rounding_errors(
    fit: Fit, white: Mapping[str, float], step: float, levels: Array | None = None
) -> list[Array] | None:
    """What noise and rounding alone leave in the block means, arguments as in `repeated`.

    Returns:
        By run, repetitions of it, shape (repetitions, blocks), rad; None where the noise is large enough to make
        the rounding error white.
    """
    if min(white.values()) > _BLURS * step:
        return None
    count = repetitions(fit, _FEWEST, _MOST)
    return [run.means(reading - motion) for run, motion, reading in repeated(fit, white, step, count, levels)]
