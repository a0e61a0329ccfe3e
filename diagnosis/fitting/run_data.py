"""Runs prepared for fitting: block means of the reading and the stated physics they belong to."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from diagnosis.fitting.whitening import WHITE, colour, colouring, response, whiten
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.aero import aerodynamic_stiffness
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array

#: Interval of the block means, s: the motion stays below 10 Hz and the mains at 50 Hz.
BLOCK_INTERVAL = 4e-3


@dataclass(frozen=True, eq=False)
class RunData:
    """One run as the fits see it.

    Args:
        id: of the run.
        reading: block means, rad, shape (n,).
        block: samples per block.
        interval: between blocks, s.
        noise_variance: of one block mean, rad²; where the noise is coloured, of its innovations.
        spring_stiffness: stated, N m/rad; None in normalised form.
        wind_speed: stated, m/s.
        air_density: stated, kg/m³; 0 where the wind is off.
        duration: of the record, s.
        whitening: filter that makes the noise of the block means white, its first tap 1, shape (order + 1,).
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
    whitening: Array = field(default_factory=lambda: WHITE)

    @property
    def wind_on(self) -> bool:
        """Whether the wind blows."""
        return self.wind_speed > 0.0

    def scaled(self, difference: Array) -> Array:
        """A difference of readings as white residuals.

        Args:
            difference: of block means, rad, shape (n,).

        Returns:
            In noise standard deviations, shape (n,).
        """
        return np.asarray(whiten(difference, self.whitening) / np.sqrt(self.noise_variance), np.float64)

    def unscaled(self, residual: Array) -> Array:
        """The inverse of `scaled`.

        Args:
            residual: white, in noise standard deviations, shape (n,).

        Returns:
            Difference of block means, rad, shape (n,).
        """
        return np.asarray(colour(residual * np.sqrt(self.noise_variance), self.whitening), np.float64)

    @property
    def noise_std(self) -> float:
        """Standard deviation of the noise of one block mean, rad."""
        return float(np.sqrt(self.noise_variance)) * colouring(self.whitening)

    def noise_at(self, frequency: float | Array) -> Array:
        """The noise at a frequency.

        Args:
            frequency: Hz, any shape.

        Returns:
            Standard deviation of white noise of the same density, rad, of the frequency's shape.
        """
        return np.asarray(np.sqrt(self.noise_variance) / np.abs(self.response(frequency)))

    def response(self, frequency: float | Array) -> np.ndarray:
        """What the whitening filter makes of a sinusoid.

        Args:
            frequency: Hz, any shape.

        Returns:
            Complex factor, dimensionless, of the frequency's shape; 1 where the noise is white.
        """
        return response(self.whitening, np.asarray(frequency) * self.interval)


@dataclass(frozen=True, eq=False)
class Data:
    """A campaign as the fits see it.

    Args:
        runs: prepared runs.
        frontal_area: A, m²; 1 where the campaign does not state it.
        reference_length: l, m; likewise.
        width: m; likewise.
        normalised: whether the runs are fitted per unit inertia with a common stiffness.
        yaw_inertia: nominal Izz, kg m²; None where the campaign does not state it.
        windy: whether the runs are part of a campaign with the wind on, though none of these may be: the model
            then keeps its aerodynamic parameters.
    """

    runs: tuple[RunData, ...]
    frontal_area: float
    reference_length: float
    width: float
    normalised: bool
    yaw_inertia: float | None
    windy: bool = False

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


def prepare(campaign: Campaign, noise_variance: dict[str, float]) -> Data:
    """Average a campaign's records in blocks.

    Args:
        campaign: the runs.
        noise_variance: of one sample, rad², by run id.

    Returns:
        The prepared data. Where any run states no stiffness, all are taken in normalised form.
    """
    rig = campaign.rig
    return Data(
        runs=tuple(_prepare_run(run, noise_variance[run.id]) for run in campaign.runs),
        frontal_area=rig.frontal_area or 1.0,
        reference_length=rig.reference_length or 1.0,
        width=rig.width or 0.0,
        normalised=any(run.spring_stiffness is None for run in campaign.runs),
        yaw_inertia=rig.yaw_inertia,
    )


def _prepare_run(run: Run, noise_variance: float) -> RunData:
    record = run.record
    block = max(1, round(BLOCK_INTERVAL * record.sample_rate))
    count = record.yaw_rad.size // block
    reading = record.yaw_rad[: count * block].reshape(count, block).mean(axis=1)
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
    )


def hermite_means(block: int) -> Array:
    """Weights that turn a step's ends into the mean over its samples.

    Args:
        block: samples in the step, the first at its start.

    Returns:
        Weights of (start angle, end angle, interval × start rate, interval × end rate), shape (4,), from the
        cubic through both ends: exact to the integrator's order.
    """
    u = np.arange(block) / block
    basis = np.array([2 * u**3 - 3 * u**2 + 1, -2 * u**3 + 3 * u**2, u**3 - 2 * u**2 + u, u**3 - u**2])
    means: Array = basis.mean(axis=1)
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
    cut = int(later[0]) + 1
    reading = run.reading[cut:]
    return dataclasses.replace(run, reading=reading, duration=run.duration - cut * run.interval)
