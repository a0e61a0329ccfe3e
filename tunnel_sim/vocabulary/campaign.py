"""A campaign: the runs of one rig with one sensor, measured or simulated."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from statistics import fmean
from typing import TYPE_CHECKING, Literal

from tunnel_sim.vocabulary.between_runs import Repeatability as Repeatability
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, installing
from tunnel_sim.vocabulary.freedom import FREEDOMS, Freedom, Motion
from tunnel_sim.vocabulary.input_kinds import InputColumn, KnownGain
from tunnel_sim.vocabulary.inputs import Input, checked_input, refuse_several_gains, refuse_untreated
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Record
from tunnel_sim.vocabulary.rig import JointLaw, Rig
from tunnel_sim.vocabulary.run_groups import RunGroups

if TYPE_CHECKING:
    from xarray import Dataset

Quantity = Literal["angle", "rate", "acceleration"]
"""What a sensor measures: the angle or displacement of the body, or its first or second derivative."""

Zero = Literal["common", "per_run", "auto"]
"""Whether the runs have one zero, one each, or whether the records decide."""


@dataclass(frozen=True)
class RigProperties:
    """A campaign's statements about its rig; None: not stated.

    Args:
        yaw_inertia: nominal Izz of model and support, kg m².
        frontal_area: A, m²; needed for non-dimensional coefficients.
        reference_length: l, m; needed for non-dimensional coefficients.
        width: body width, m (Strouhal numbers).
    """

    yaw_inertia: float | None = None
    frontal_area: float | None = None
    reference_length: float | None = None
    width: float | None = None

    @classmethod
    def of(cls, rig: Rig) -> RigProperties:
        """The statements of a campaign on a rig; the inertia is the nominal one."""
        body = rig.body
        return cls(rig.dynamics.yaw_inertia, body.frontal_area, body.length, body.width)


@dataclass(frozen=True)
class SensorProperties:
    """A campaign's statements about its sensor; None: not stated.

    Args:
        sample_rate: sample rate, Hz.
        resolution: step of the reading, rad (rad/s or rad/s² if it measures a rate or an acceleration).
        noise_std: standard deviation of the reading's noise, in the same unit.
        plausible: False accepts values that look like a wrong unit, and a low sample rate.
        motion: ``displacement`` of a linear freedom, with m, N, kg in place of rad, N m, kg m²; None: an angle.
    """

    sample_rate: float | None = None
    resolution: float | None = None
    noise_std: float | None = None
    plausible: bool | None = None
    quantity: Quantity | None = None
    zero: Zero | None = None
    motion: Motion | None = None

    @classmethod
    def of(cls, sensor: SensorModel) -> SensorProperties:
        """The statements of a campaign with a sensor; the zero is not known."""
        return cls(sensor.sample_rate, sensor.resolution or None, sensor.noise_std or None)

    @property
    def unit(self) -> str:
        """Unit of the readings."""
        return self.freedom.unit(("rad", "rad/s", "rad/s²")[self.derivative])

    @property
    def freedom(self) -> Freedom:
        """The freedom of the body, which names columns, units and words."""
        return FREEDOMS[self.motion or "angle"]

    @property
    def derivative(self) -> int:
        """Order of the derivative of the angle that the sensor reads: 0, 1 or 2."""
        return 0 if self.quantity is None else ("angle", "rate", "acceleration").index(self.quantity)


@dataclass(frozen=True)
class Run:
    """One run: its record and its conditions.

    Args:
        wind_speed: V, m/s; 0 is wind-off. The speed at the release, or the mean of a steady speed over the run.
        spring_stiffness: Kr, N m/rad; for a run with a ``command_rad`` the servo's kp; None: the run is identified
            in normalised form.
        air_density: ρ, kg/m³; required if `needs_density`.
        release_angle: nominal, rad.
        clock_s: time of the file's clock at time 0 of the record, s; 0 if the record has the times of its file.
    """

    id: str
    record: Record
    wind_speed: float
    spring_stiffness: float | None = None
    air_density: float | None = None
    release_angle: float | None = None
    drive: Input | None = None
    clock_s: float = field(default=0.0, compare=False)

    @property
    def wind_on(self) -> bool:
        """Whether the wind is on."""
        return self.wind_speed > 0.0

    @property
    def unrestrained(self) -> bool:
        """Whether neither a spring nor the air restrains the body, so that its stiffness is known to be 0."""
        return self.spring_stiffness == 0.0 and not self.wind_on

    @property
    def input_gain(self) -> float | None:
        """The moment on the body per unit of the input, N m; None if it is not known, and for a free decay."""
        if self.drive is None:
            return None
        return self.drive.kind.gain(self.drive.gain, self.spring_stiffness)

    @property
    def known_gain(self) -> KnownGain | None:
        """The gain of the input over the inertia, if the run's motion gives it; None for a free decay, too."""
        return None if self.drive is None else self.drive.kind.known_gain(windy=self.wind_on)

    def to_xarray(self) -> Dataset:
        """The record as a dataset: ``yaw_rad`` over the coordinate ``time_s``, the conditions as attributes.

        A run does not know its sensor, so the names are an angle's.

        Raises:
            TunnelError: when xarray, of the extra ``frames``, is not installed.
        """
        try:
            from xarray import Dataset  # imported here because it is an extra
        except ModuleNotFoundError as error:
            raise TunnelError("xarray is not installed", remedy=f"run {installing('frames')}") from error
        names = ("wind_speed", "spring_stiffness", "air_density", "release_angle")
        stated = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        columns = {"yaw_rad": ("time_s", self.record.yaw_rad, {"long_name": "reading of the yaw angle"})}
        if self.drive is not None:
            columns[self.drive.column] = ("time_s", self.drive.values, {"long_name": "input of the run"})
        return Dataset(columns, coords={"time_s": self.record.time_s}, attrs={"id": self.id, **stated})


_SAME_SPEED = (
    0.01  # relative: an anemometer reads to about a per cent, and settings of a fan are farther apart
)


def speed_groups(speeds: Iterable[float]) -> dict[float, float]:
    """The setting of the wind to which every stated speed belongs.

    Readings of one setting, such as 24.9972 and 25 m/s, differ by less than the error of a reading.

    Args:
        speeds: stated speeds, m/s.

    Returns:
        By stated speed, the member of its group with the shortest text, m/s; 0 is a group of its own.
    """
    groups: list[list[float]] = []
    for speed in sorted(set(speeds)):
        if groups and speed <= (1.0 + _SAME_SPEED) * groups[-1][0]:
            groups[-1].append(speed)
        else:
            groups.append([speed])
    named = [(min(group, key=lambda one: (len(f"{one:g}"), len(repr(one)))), group) for group in groups]
    return {speed: name for name, group in named for speed in group}


def mean_wind_speed(speeds: Iterable[float], otherwise: float) -> float:
    """The mean wind speed of the runs with the wind on.

    Args:
        speeds: stated speeds of all runs, m/s; 0: wind off.
        otherwise: the value if no run has the wind on, m/s.
    """
    windy = [speed for speed in speeds if speed > 0.0]
    return fmean(windy) if windy else otherwise


def needs_density(wind_speed: float, *scales: float | None) -> bool:
    """Whether a run must state its air density: without a stiffness and sizes only ωn and ζ can be identified.

    Args:
        wind_speed: V, m/s.
        scales: the run's spring stiffness (N m/rad), and the rig's frontal area (m²) and reference length (m).
    """
    return wind_speed > 0.0 and any(scale is not None for scale in scales)


@dataclass(frozen=True)
class Campaign(RunGroups[Run]):
    """The runs of one rig with one sensor; the sensor's zero is unknown.

    Args:
        name: short name, also of the folder.
        runs: at least one run, with unique ids.
        law: law of the joint in the user's model; None: spring and damper.
        repeatability: stated scatter between runs; None: nothing is stated.
    """

    name: str
    rig: RigProperties
    sensor: SensorProperties
    runs: tuple[Run, ...]
    description: str = ""
    law: JointLaw | None = None
    repeatability: Repeatability | None = None

    @property
    def inputs(self) -> tuple[Input, ...]:
        """The inputs of the driven runs."""
        return tuple(run.drive for run in self.runs if run.drive is not None)

    @property
    def states_density(self) -> bool:
        """Whether every run with the wind on states its air density."""
        return all(run.air_density is not None for run in self.in_wind)

    @property
    def as_angle(self) -> Campaign:
        """The campaign with the same numbers, as for an angle."""
        return replace(self, sensor=replace(self.sensor, motion=None))

    def driven_by(self, *columns: InputColumn) -> tuple[Run, ...]:
        """The runs with an input in one of some columns."""
        pairs = zip(self.driven_runs, self.inputs, strict=True)
        return tuple(run for run, drive in pairs if drive.column in columns)

    def checked_inputs(self) -> Campaign:
        """The campaign itself, if its driven runs can be identified.

        Raises:
            TunnelError: for the first input that cannot belong to its record or with which no run can be
                identified, and for unknown gains of several inputs.
        """
        quantity, judged = self.sensor.quantity or "angle", self.sensor.plausible is not False
        for run in self.runs:
            if run.drive is not None:
                where = f"{self.name}, run '{run.id}'"
                checked_input(run.drive, run.record, where, judged=judged)
                refuse_untreated(run.drive, run.spring_stiffness, quantity, where, wind_on=run.wind_on)
        refuse_several_gains(self.inputs, self.name)
        return self

    @property
    def unrestrained(self) -> bool:
        """Whether the body is unrestrained in every run (`Run.unrestrained`)."""
        return all(run.unrestrained for run in self.runs)

    def without(self, ids: Collection[str]) -> Campaign:
        """The other runs; the campaign itself if no id is given.

        Args:
            ids: ids of the runs to leave out.

        Raises:
            TunnelError: for an id that no run has, and if no run would remain.
        """
        if not ids:
            return self
        known = [run.id for run in self.runs]
        for name in ids:
            if name not in known:
                remedy = did_you_mean(name, known)
                raise TunnelError(f"there is no run {name!r} to leave out", where=self.name, remedy=remedy)
        kept = tuple(run for run in self.runs if run.id not in ids)
        if not kept:
            raise TunnelError("every run is left out", where=self.name, remedy="leave out fewer runs")
        return replace(self, runs=kept)

    def __repr__(self) -> str:
        """The runs, their conditions, and what to call next, in three lines."""
        count = f"{len(self.runs)} run{'' if len(self.runs) == 1 else 's'}"
        on = len(self.in_wind)
        springs = [run.spring_stiffness for run in self.runs if run.spring_stiffness is not None]
        driven = len(self.inputs)
        stated = [
            *([f"{driven} driven"] if driven else []),
            f"springs {_between(springs)} N m/rad" if springs else "no spring stated",
            *([f"wind {_between([run.wind_speed for run in self.runs])} m/s"] if on else []),
            *(["wind off"] if self.sensor.freedom.windy and not on else []),
            f"{_between([run.record.duration for run in self.runs])} s",
        ]
        windy = f", {on} with the wind on" if self.sensor.freedom.windy else ""
        return (
            f"Campaign {self.name!r}: {count}{windy}\n"
            f"  {self.sensor.freedom.unit(', '.join(stated if self.runs else []))}\n"
            "  .runs[0].record; identify(campaign), diagnose(campaign)"
        )


def _between(values: list[float]) -> str:
    """Least and greatest, such as ``16.1 to 44.8``; one number if they are equal."""
    low, high = (f"{end:.3g}" for end in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"
