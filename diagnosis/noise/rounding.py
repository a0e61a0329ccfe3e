"""The error of rounded readings, which is not white where the noise before it is small."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.data import Data
from diagnosis.model.run_data import RunData
from diagnosis.model.run_noise import WhiteNoise
from diagnosis.noise.bands import TESTS, powers
from tunnel_sim.vocabulary.record import Array

#: Noise of this many steps makes the rounding error independent of the motion to within 1e-4: the first
#: harmonic of the error falls with exp(−4π²σ²/q²) (B. Widrow and I. Kollár, Quantization Noise, 2008, ch. 11).
_BLURS = 0.5
_MOST, _FEWEST = 16, 4  # repetitions of the campaign
_SAMPLES = 2.5e6  # read again in all


def samples(fit: Fit) -> int:
    """Number of samples in all runs of a fit."""
    return sum(run.reading.size * run.block for run in fit.problem.data.runs)


def repetitions(fit: Fit, fewest: int, most: int) -> int:
    """Number of repetitions of the runs of a fit: fewer where they are long."""
    return int(np.clip(_SAMPLES / samples(fit), fewest, most))


def repeated(
    fit: Fit, white: Mapping[str, float], step: float, count: int, levels: Array | None = None
) -> Iterator[tuple[RunData, Array, Array]]:
    """Read the fitted motion again, with white noise and a lattice of unknown origin.

    Args:
        white: standard deviation of a sample's noise before rounding, rad, by run id.
        step: step of the lattice, rad; 0 where there is none.
        count: number of repetitions.
        levels: readings that occur where steps are of unequal width, increasing, shape (levels,), rad; None: all
            steps are equal.

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


class Rounding:
    """The rounding error of block means beside white noise: none where the noise blurs the lattice."""

    @classmethod
    def of(cls, fit: Fit, white: Mapping[str, float], step: float, levels: Array | None = None) -> Rounding:
        """The rounding error in the residuals of a fit, arguments as in `repeated`."""
        if min(white.values()) > _BLURS * step:
            return Rounding()
        again = repeated(fit, white, step, repetitions(fit, _FEWEST, _MOST), levels)
        return Rounded([run.means(reading - motion) for run, motion, reading in again])

    def residuals(self, data: Data) -> list[list[Array]]:
        """White residuals that noise and rounding alone cause, by repetition and by run."""
        del data
        return []

    def expected(self, fit: Fit) -> tuple[Array, Array]:
        """Mean power of the residuals of a fit by `TESTS`, and its scatter, shape (tests,) each.

        Both are shares of the power of white noise with the fit's variance; the scatter excludes white noise's own.
        """
        del fit
        return np.ones(len(TESTS)), np.zeros(len(TESTS))

    def allowed_in(self, data: Data) -> Data:
        """Data prepared for white noise, with noise of block means that is at least the rounding error."""
        return data


@dataclass(frozen=True, eq=False)
class Rounded(Rounding):
    """A rounding error that is not white.

    Args:
        errors: errors by noise and rounding, by run, shape (repetitions, blocks), rad.
    """

    errors: Sequence[Array]

    def residuals(self, data: Data) -> list[list[Array]]:
        """The errors, scaled."""
        each = range(len(self.errors[0]))
        return [[run.scaled(e[k]) for run, e in zip(data.runs, self.errors, strict=True)] for k in each]

    def expected(self, fit: Fit) -> tuple[Array, Array]:
        """From the repetitions; not less than white noise."""
        seen = [powers(fit, residuals)[:2] for residuals in self.residuals(fit.problem.data)]
        count = np.maximum(seen[0][1], 0.5)  # avoids a division by zero
        found = [power / count for power, _ in seen]
        level = np.mean(found, axis=0)
        beyond = np.var(found, axis=0, ddof=1) / np.maximum(level, 1e-100) ** 2 - 1.0 / count
        return np.maximum(level, 1.0), np.sqrt(np.maximum(beyond, 0.0))

    def allowed_in(self, data: Data) -> Data:
        """Raised where averaging reduces the errors less than white noise, at most to the error of one sample.

        The same data where none is raised.
        """
        raised = [
            float(np.clip(np.mean(error**2), run.noise.variance, run.noise.variance * run.block))
            for run, error in zip(data.runs, self.errors, strict=True)
        ]
        if all(run.noise.variance == value for run, value in zip(data.runs, raised, strict=True)):
            return data
        runs = [replace(run, noise=WhiteNoise(value)) for run, value in zip(data.runs, raised, strict=True)]
        return data.with_runs(tuple(runs))
