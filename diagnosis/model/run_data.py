"""Runs as the fits see them: samples in blocks, the means of the reading and the stated physics."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagnosis.model.run_noise import RunNoise
from diagnosis.model.similarity import REFERENCE_FREQUENCY
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable
from tunnel_sim.vocabulary.campaign import speed_groups
from tunnel_sim.vocabulary.plan import aerodynamic_stiffness
from tunnel_sim.vocabulary.record import Array, Record, read_only
from tunnel_sim.vocabulary.run_groups import RunGroups


@dataclass(frozen=True, eq=False)
class UnevenSamples:
    """Samples that are not evenly spaced, on the uniform raster of the blocks.

    A block without samples has one place in its middle, so that every block has a mean; it does not count.

    Args:
        time: since the start of the first block, increasing, shape (m,), s.
        block: the block of each sample, shape (m,).
        count: number of samples in each block, shape (n,).
    """

    time: Array
    block: NDArray[np.int64]
    count: NDArray[np.int64]

    @classmethod
    def of(cls, record: Record, block: int) -> UnevenSamples:
        """The samples of a record, in blocks with ``block`` samples each on average.

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

    def part(self, first: int, last: int, interval: float) -> UnevenSamples:
        """The samples from one block up to another.

        Args:
            interval: interval of a block, s.
        """
        inside = slice(*np.searchsorted(self.block, (first, last)))
        return UnevenSamples(
            self.time[inside] - first * interval, self.block[inside] - first, self.count[first:last]
        )


def hermite_basis(u: Array, derivative: int = 0, interval: float = 1.0) -> Array:
    """The cubic through both ends of a step, or a derivative of it.

    Args:
        u: places in the step, from 0 to 1, shape (n,).
        derivative: 0, 1 or 2.
        interval: length of the step, s.

    Returns:
        Weights of (start angle, end angle, interval × start rate, interval × end rate), shape (4, n), in units
        of s to the power of −``derivative``. For the angle they are exact to the integrator's order, for its
        first and second derivative to one and two orders less.
    """
    basis = (
        [2 * u**3 - 3 * u**2 + 1, -2 * u**3 + 3 * u**2, u**3 - 2 * u**2 + u, u**3 - u**2],
        [6 * u**2 - 6 * u, -6 * u**2 + 6 * u, 3 * u**2 - 4 * u + 1, 3 * u**2 - 2 * u],
        [12 * u - 6, -12 * u + 6, 6 * u - 4, 6 * u - 2],
    )[derivative]
    return np.array(basis) / interval**derivative


def means_of(values: Array, count: int) -> Array:
    """Means of ``count`` consecutive values each, along the last axis.

    A product with equal weights takes a fifth of the time of NumPy's mean along a short axis.
    """
    return np.asarray(values.reshape(*values.shape[:-1], -1, count) @ np.full(count, 1.0 / count), np.float64)


@dataclass(frozen=True, eq=False)
class RunData:
    """One run as the fits see it.

    Args:
        id: id of the run.
        reading: block means, rad, shape (n,); interpolated where a block has no sample.
        block: samples per block, on average if they are not evenly spaced.
        interval: interval between blocks, s.
        noise: noise of the mean of ``block`` samples.
        spring_stiffness: stated stiffness, N m/rad; None in normalised form.
        wind_speed: stated wind speed, m/s.
        air_density: stated air density, kg/m³; 0 where the wind is off.
        duration: duration of the record, s.
        start: time left out at the start of the record, s.
        derivative: order of the derivative of the angle that the sensor reads: 0, 1 or 2. It determines the
            units of the reading and its noise.
        samples: times of the samples, if they are not evenly spaced.
        drive: the moment of a driven run, its times since the start of the record; None for a free decay.
        multiplied_by: name of the parameter that multiplies this moment; empty: none.
        stretch_of: id of the run to which this stretch belongs; None for a whole run.
        merges: number of shorter blocks in each block.
        shorter: the means of the shorter blocks, rad, shape (merges · n,); None where ``merges`` is 1.
    """

    id: str
    reading: Array
    block: int
    interval: float
    noise: RunNoise
    spring_stiffness: float | None
    wind_speed: float
    air_density: float
    duration: float
    start: float = 0.0
    derivative: int = 0
    samples: UnevenSamples | None = None
    drive: InputMoment | None = None
    multiplied_by: str = ""
    stretch_of: str | None = None
    merges: int = 1
    shorter: Array | None = field(default=None, repr=False)

    @property
    def mergeable(self) -> bool:
        """Whether longer blocks show the run's motion: angles of a free decay, evenly spaced, in white noise."""
        return self.drive is None and self.derivative == 0 and self.plain

    def merged(self, count: int) -> RunData:
        """A `mergeable` run in longer blocks, each of several of its own; a remainder at the end is dropped."""
        size = self.reading.size // count
        shorter = self.reading[: size * count]
        return dataclasses.replace(
            self,
            reading=means_of(shorter, count),
            block=count * self.block,
            interval=count * self.interval,
            noise=dataclasses.replace(self.noise, variance=self.noise.variance / count),
            merges=count,
            shorter=shorter,
        )

    @cached_property
    def fine(self) -> RunData:
        """The run in the shorter blocks from which its own were made; unchanged if there are none."""
        if self.shorter is None:
            return self
        return dataclasses.replace(
            self,
            reading=self.shorter,
            block=self.block // self.merges,
            interval=self.interval / self.merges,
            noise=dataclasses.replace(self.noise, variance=self.noise.variance * self.merges),
            merges=1,
            shorter=None,
        )

    @property
    def conditions(self) -> tuple[object, ...]:
        """The conditions that determine the moment law and its integration: spring, wind, sampling and input."""
        free = self.spring_stiffness, self.wind_speed, self.air_density, self.interval, self.derivative
        return free if self.drive is None else (*free, id(self.drive), self.start)

    def moment(self, gain: float, offset: float = 0.0) -> InputMoment | None:
        """The moment of the input from the first block on; None for a free decay.

        Args:
            gain: the parameter that multiplies the moment, N m per unit of the input or kg m²; ignored without
                such a parameter.
            offset: a constant moment beside the input, N m; 0 where the moment of the input is 0 throughout.
        """
        if self._seen_drive is None:
            return None
        scale = self._seen_drive.scale * (gain if self.multiplied_by else 1.0)
        return dataclasses.replace(self._seen_drive, scale=scale, offset=offset)

    @cached_property
    def _seen_drive(self) -> InputMoment | None:
        """The samples of the input that the blocks see, with the delay from the first block on."""
        if self.drive is None:
            return None
        end = self.start + (self.reading.size + 1) * self.interval
        first, last = np.searchsorted(self.drive.time_s, (self.start, end))
        seen = slice(max(int(first) - 1, 0), int(last) + 2)
        return dataclasses.replace(
            self.drive,
            time_s=self.drive.time_s[seen],
            values=self.drive.values[seen],
            delay=self.drive.delay - self.start,
        )

    def with_input(self, **change: Any) -> RunData:
        """The run with changed fields of its input; a free decay is unchanged."""
        if self.drive is None:
            return self
        return dataclasses.replace(self, drive=dataclasses.replace(self.drive, **change))

    def undriven(self) -> RunData:
        """The run as a free decay."""
        return dataclasses.replace(self, drive=None, multiplied_by="")

    @property
    def input_means(self) -> Array:
        """Block means of the input of a driven run, shape (n,), in its own unit."""
        assert self.drive is not None
        if self.samples is not None:
            at = self.samples.time + self.start
            return self.samples.means(np.interp(at, self.drive.time_s, self.drive.values))
        first = round(self.start / self.interval) * self.block
        values = self.drive.values[first : first + self.reading.size * self.block]
        return means_of(values, self.block)

    @property
    def wind_on(self) -> bool:
        """Whether the wind blows."""
        return self.wind_speed > 0.0

    @cached_property
    def weights(self) -> Array:
        """Weights that turn a block's ends, as in `hermite_basis`, into its mean.

        Shape (4,), or (4, n) where the samples are not evenly spaced.
        """
        if self.samples is None:
            places = np.arange(self.block) / self.block
            return np.asarray(hermite_basis(places, self.derivative, self.interval).mean(axis=1), np.float64)
        u = self.samples.time / self.interval - self.samples.block
        return self.samples.means(hermite_basis(u, self.derivative, self.interval))

    @cached_property
    def times(self) -> Array:
        """Mean time of the samples of every block since the first block's start, shape (n,), s."""
        if self.samples is None:
            return np.asarray(
                (np.arange(self.reading.size) + 0.5 * (self.block - 1) / self.block) * self.interval
            )
        return self.samples.means(self.samples.time)

    @cached_property
    def sample_times(self) -> Array:
        """Time of every sample in the blocks since the first block's start, shape (m,), s: one object."""
        if self.samples is not None:
            return self.samples.time
        return read_only(np.arange(self.reading.size * self.block) * (self.interval / self.block))

    @property
    def plain(self) -> bool:
        """Whether differences are white residuals once divided by one standard deviation."""
        return self.samples is None and self.noise.plain

    def scaled(self, difference: Array) -> Array:
        """Differences of readings as white residuals, in noise standard deviations.

        Blocks with fewer samples have less weight, and empty ones are 0.

        Args:
            difference: differences of block means, in the unit of the reading, shape (n,), or in columns, shape
                (n, k).
        """
        if self.samples is None:
            return np.asarray(self.noise.white(difference) / self.noise.scale, np.float64)
        count = self.samples.count.reshape(-1, *[1] * (difference.ndim - 1))
        white = self.noise.white(np.where(count > 0, difference, 0.0))
        return white * np.sqrt(count / (self.block * self.noise.variance))

    def unscaled(self, residual: Array) -> Array:
        """The inverse of `scaled`: differences of block means in the unit of the reading, 0 in empty blocks.

        Args:
            residual: white residuals, in noise standard deviations, shape (n,).
        """
        if self.samples is not None:
            residual = residual / np.sqrt(np.maximum(self.samples.count, 1) / self.block)
        return np.asarray(self.noise.coloured(residual * self.noise.scale), np.float64)

    @property
    def counts(self) -> NDArray[np.int64]:
        """Samples in each block, shape (n,)."""
        return np.full(self.reading.size, self.block) if self.samples is None else self.samples.count

    @property
    def filled(self) -> int:
        """Number of blocks with samples."""
        return int(np.count_nonzero(self.counts))

    def means(self, values: Array) -> Array:
        """Block means of one value per sample, shape (n,) or (k, n).

        Args:
            values: shape (m,) or (k, m).
        """
        if self.samples is not None:
            return self.samples.means(values)
        return means_of(values, self.block)

    def in_blocks(self, means: Array) -> Array:
        """Block means of the run from values in its own blocks, or in shorter blocks, shape (..., n)."""
        return means if means.shape[-1] == self.reading.size else means_of(means, self.merges)

    def part(self, first: int = 0, last: int | None = None) -> RunData:
        """The run from one block up to another; None: to the end.

        The duration is the record's, less the part left out at the start.
        """
        last = self.reading.size if last is None else last
        return dataclasses.replace(
            self,
            reading=self.reading[first:last],
            duration=self.duration - first * self.interval,
            start=self.start + first * self.interval,
            samples=None if self.samples is None else self.samples.part(first, last, self.interval),
            noise=self.noise.part(first, last),
            shorter=None if self.shorter is None else self.shorter[first * self.merges : last * self.merges],
        )

    def beginning(self, blocks: int) -> RunData:
        """The first blocks of a driven run; a free decay, or a shorter run, is unchanged."""
        return self if self.drive is None or self.reading.size <= blocks else self.part(last=blocks)

    @property
    def noise_std(self) -> float:
        """Standard deviation of the noise of one block mean, rad."""
        return self.noise.scale * self.noise.over_white

    def noise_at(self, frequency: float | Array) -> Array:
        """Standard deviation of white noise with the density of this noise at a frequency, rad.

        Args:
            frequency: Hz, any shape.
        """
        return np.asarray(self.noise.scale / np.abs(self.response(frequency)))

    def response(self, frequency: float | Array) -> np.ndarray:
        """The complex factor by which whitening changes a sinusoid; 1 where the noise is white.

        Args:
            frequency: Hz, any shape.
        """
        return self.noise.response(np.asarray(frequency) * self.interval)


@dataclass(frozen=True, eq=False)
class PreparedRuns(RunGroups[RunData]):
    """Runs of a campaign as the fits see them, with the sizes of the rig.

    Args:
        runs: prepared runs.
        frontal_area: A, m². This and the two lengths are 1 in the measured campaign's units where not stated.
        reference_length: l, m.
        width: m.
        repeatability: stated relative standard deviations between runs, by scattering quantity; empty: none is
            stated.
    """

    runs: tuple[RunData, ...]
    frontal_area: float
    reference_length: float
    width: float
    repeatability: Mapping[str, float] = field(default_factory=dict, kw_only=True)

    @property
    def inputs(self) -> tuple[InputMoment, ...]:
        """The moments of the driven runs."""
        return tuple(run.drive for run in self.runs if run.drive is not None)

    @property
    def mean_block(self) -> float:
        """Samples per block on average: as many times larger is an excess in block means than in samples."""
        blocks = sum(run.reading.size for run in self.runs)
        return sum(run.reading.size * run.block for run in self.runs) / blocks

    @cached_property
    def swing(self) -> float:
        """The largest angle of the motion from its middle, rad, also if the readings are rates."""
        turn = 2.0 * np.pi * REFERENCE_FREQUENCY
        return max(0.5 * float(np.ptp(run.reading)) / turn**run.derivative for run in self.runs)

    @property
    def wind_speeds(self) -> tuple[float, ...]:
        """Settings of the wind speed, ascending, m/s; none in still air."""
        return tuple(sorted(set(speed_groups(run.wind_speed for run in self.in_wind).values())))

    @property
    def springs(self) -> tuple[float, ...]:
        """Stated stiffnesses, ascending, N m/rad; none without a restoring moment."""
        return tuple(sorted({run.spring_stiffness for run in self.runs if run.spring_stiffness}))

    @property
    def _sizes(self) -> dict[str, float]:
        return {"frontal_area": self.frontal_area, "reference_length": self.reference_length}

    def air_moment(self, run: RunData | RunSettings) -> float:
        """The air's yaw moment on the model for a moment coefficient of 1, ½ρV²·A·l, N m."""
        return aerodynamic_stiffness(
            1.0, air_density=run.air_density, wind_speed=run.wind_speed, **self._sizes
        )

    def air_damping(self, run: RunData) -> float:
        """Damping by the air for a rate coefficient of 1, ½ρVAl², N m s; 0 with the wind off."""
        return self.air_moment(run) * self.reference_length / run.wind_speed if run.wind_on else 0.0

    def air_moments(self, runs: SettingsTable) -> Array:
        """The air's yaw moment for a moment coefficient of 1 in several runs, N m, shape (runs,)."""
        return aerodynamic_stiffness(
            1.0, air_density=runs.air_density, wind_speed=runs.wind_speed, **self._sizes
        )
