"""Runs prepared for fitting: block means of the reading and the stated physics they belong to."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from diagnosis.fitting.similarity import AS_MEASURED, Similarity
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.aero import aerodynamic_stiffness
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array, Record

#: Interval of the block means, s: the motion stays below 10 Hz and the mains at 50 Hz.
BLOCK_INTERVAL = 4e-3


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
        """The samples of some blocks.

        Args:
            first: the first block.
            last: the block after the last one.
            interval: length of a block, s.
        """
        inside = slice(*np.searchsorted(self.block, (first, last)))
        return Samples(
            self.time[inside] - first * interval, self.block[inside] - first, self.count[first:last]
        )


@dataclass(frozen=True, eq=False)
class RunData:
    """One run as the fits see it.

    Args:
        id: of the run.
        reading: block means, rad, shape (n,); interpolated where a block has no sample.
        block: samples per block, on average where they are not evenly spaced.
        interval: between blocks, s.
        noise_variance: of one block mean of ``block`` samples, rad².
        spring_stiffness: stated, N m/rad; None in normalised form.
        wind_speed: stated, m/s.
        air_density: stated, kg/m³; 0 where the wind is off.
        duration: of the record, s.
        start: time left out at the start of the record, s.
        derivative: which derivative of the angle the reading is: 0, 1 or 2. The units of the reading and its noise
            follow from it.
        samples: where they are, if they are not evenly spaced.
    """

    id: str
    reading: Array
    block: int
    interval: float
    noise_variance: float
    spring_stiffness: float | None
    wind_speed: float
    air_density: float
    duration: float
    start: float = 0.0
    derivative: int = 0
    samples: Samples | None = None

    @property
    def wind_on(self) -> bool:
        """Whether the wind blows."""
        return self.wind_speed > 0.0

    @cached_property
    def weights(self) -> Array:
        """Weights that turn a block's ends into its mean, as `hermite_means` gives them.

        Shape (4,), or (4, n) where the samples are not evenly spaced.
        """
        if self.samples is None:
            return hermite_means(self.block, self.derivative, self.interval)
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

    @property
    def sample_times(self) -> Array:
        """Time of every sample in the blocks since the first block's start, shape (m,), s."""
        if self.samples is not None:
            return self.samples.time
        return np.asarray(
            np.arange(self.reading.size * self.block) * (self.interval / self.block), np.float64
        )

    def scaled(self, difference: Array) -> Array:
        """Differences of block means as residuals, whose variance is 1 under white noise.

        Args:
            difference: of the blocks, in the unit of the reading, shape (n,).

        Returns:
            Shape (n,); blocks of fewer samples weigh less, and empty ones are 0.
        """
        scaled: Array = difference / np.sqrt(self.noise_variance)
        if self.samples is None:
            return scaled
        seen = self.samples.count > 0
        return np.where(seen, scaled, 0.0) * np.sqrt(self.samples.count / self.block)

    @property
    def filled(self) -> int:
        """Number of blocks with samples."""
        return self.reading.size if self.samples is None else int(np.count_nonzero(self.samples.count))

    def means(self, values: Array) -> Array:
        """Block means of one value per sample.

        Args:
            values: shape (m,).

        Returns:
            Shape (n,).
        """
        if self.samples is not None:
            return self.samples.means(values)
        return np.asarray(values.reshape(self.reading.size, self.block).mean(axis=1), np.float64)

    def part(self, first: int = 0, last: int | None = None) -> RunData:
        """The run from one block up to another.

        Args:
            first: its first block.
            last: the block after its last one; None: to the end.

        Returns:
            The shorter run. Its duration is that of the record less what is left out at the start.
        """
        last = self.reading.size if last is None else last
        return dataclasses.replace(
            self,
            reading=self.reading[first:last],
            duration=self.duration - first * self.interval,
            start=self.start + first * self.interval,
            samples=None if self.samples is None else self.samples.part(first, last, self.interval),
        )


@dataclass(frozen=True, eq=False)
class Data:
    """A campaign as the fits see it.

    Args:
        runs: prepared runs.
        frontal_area: A, m²; 1 in the measured campaign's units where it does not state it.
        reference_length: l, m; likewise.
        width: m; likewise.
        normalised: whether the runs are fitted per unit inertia with a common stiffness.
        yaw_inertia: nominal Izz, kg m²; None where the campaign does not state it.
        own_zeros: whether every run has a zero of its own.
        windy: whether the runs are part of a campaign with the wind on, though none of these may be: the model
            then keeps its aerodynamic parameters.
        similarity: how the campaign was made from the measured one.
    """

    runs: tuple[RunData, ...]
    frontal_area: float
    reference_length: float
    width: float
    normalised: bool
    yaw_inertia: float | None
    own_zeros: bool = False
    windy: bool = False
    similarity: Similarity = AS_MEASURED

    @property
    def springs(self) -> tuple[float, ...]:
        """Stated stiffnesses, ascending, N m/rad."""
        return tuple(sorted({run.spring_stiffness for run in self.runs if run.spring_stiffness is not None}))

    @property
    def wind_on(self) -> bool:
        """Whether any run of the campaign has the wind on."""
        return self.windy or any(run.wind_on for run in self.runs)

    def air_moment(self, run: RunData | RunSettings) -> float:
        """The air's yaw moment on the model for a moment coefficient of 1.

        Args:
            run: gives the air's density and speed.

        Returns:
            ½ρV²·A·l, N m.
        """
        return aerodynamic_stiffness(
            1.0,
            air_density=run.air_density,
            wind_speed=run.wind_speed,
            frontal_area=self.frontal_area,
            reference_length=self.reference_length,
        )

    def with_runs(self, runs: tuple[RunData, ...]) -> Data:
        """Other runs of the same campaign, whose model has the same parameters.

        Args:
            runs: some of the runs, or further ones.

        Returns:
            The data of these runs.
        """
        return dataclasses.replace(self, runs=runs, windy=self.wind_on)

    def subset(self, keep: tuple[str, ...]) -> Data:
        """The runs of the given ids.

        Args:
            keep: ids.

        Returns:
            The smaller data.
        """
        return self.with_runs(tuple(run for run in self.runs if run.id in keep))


def prepare(
    campaign: Campaign, noise_variance: dict[str, float], similarity: Similarity = AS_MEASURED
) -> Data:
    """Average a campaign's records in blocks.

    Args:
        campaign: the runs.
        noise_variance: of one sample, rad², by run id.
        similarity: how the campaign was made from the measured one.

    Returns:
        The prepared data. Where any run states no stiffness, all are taken in normalised form.
    """
    rig = campaign.rig
    return Data(
        runs=tuple(
            _prepare_run(run, noise_variance[run.id], campaign.sensor.derivative) for run in campaign.runs
        ),
        frontal_area=rig.frontal_area or similarity.area,
        reference_length=rig.reference_length or similarity.time,
        width=rig.width or 0.0,
        normalised=any(run.spring_stiffness is None for run in campaign.runs),
        yaw_inertia=rig.yaw_inertia,
        own_zeros=campaign.sensor.zero == "per_run",
        similarity=similarity,
    )


def _prepare_run(run: Run, noise_variance: float, derivative: int) -> RunData:
    record = run.record
    block = max(1, round(BLOCK_INTERVAL * record.sample_rate))
    count = record.yaw_rad.size // block
    samples = None if record.uniform else Samples.of(record, block)
    if samples is None:
        reading = record.yaw_rad[: count * block].reshape(count, block).mean(axis=1)
    else:
        since = record.time_s - record.time_s[0] + 0.5 * record.sample_interval
        reading = samples.means(np.interp(samples.time, since, record.yaw_rad))
    return RunData(
        id=run.id,
        reading=reading,
        block=block,
        interval=block * record.sample_interval,
        noise_variance=noise_variance / block,
        spring_stiffness=run.spring_stiffness,
        wind_speed=run.wind_speed,
        air_density=run.air_density or 0.0,
        duration=record.duration + record.sample_interval,
        derivative=derivative,
        samples=samples,
    )


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


def without_start(data: Data) -> Data:
    """The runs from their second passage through the middle on.

    Where a hand lets go late, the start of the record is driven, which no free decay explains.

    Args:
        data: the runs.

    Returns:
        The data with every run cut at the first passage through its mean after its first turning point; a run
        that would lose more than a quarter stays as it is.
    """
    return dataclasses.replace(data, runs=tuple(_without_start(run) for run in data.runs))


def _without_start(run: RunData) -> RunData:
    values = run.reading - np.mean(run.reading)
    passages = np.flatnonzero(np.diff(np.signbit(values)))
    turn = int(np.argmax(np.abs(values[: passages[0] + 1]))) if passages.size else 0
    later = passages[passages > turn]
    if later.size == 0 or later[0] > values.size // 4:
        return run
    return run.part(int(later[0]) + 1)
