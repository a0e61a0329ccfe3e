"""The physics of runs as numbers: a table with a row for every run, and a single run, which is one row.

Effects change tables; MuJoCo and the forward integrator take runs. At the release the body is held at its
angle, at rest, and its rod is in balance with the spring. With a rod of compliance c and a spring Kr, the
body's angle is 1 + Kr c times the angle of the spring's end.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import inf, isfinite, sqrt
from typing import Any, Generic, TypeVar, cast

import numpy as np

from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.moment_law import operation_names, parameter_names
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import AeroDerivatives, aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.quantities import (
    Angles,
    Laws,
    PerRun,
    Rates,
    SpeedPerRun,
    StiffnessPerRun,
    Times,
)
from tunnel_sim.vocabulary.record import Array, read_only
from tunnel_sim.vocabulary.rig import Rig

REFERENCE_SPEED = 20.0
"""Wind speed at which a speed-dependent form equals the textbook form, m/s."""

_USUAL_STEP = 1e-3  # s
_BESIDE = ("wind_speed", "mean_speed", "release_angle", "release_rate", "duration", "timestep")
_DERIVATIVES = ("cn_beta", "cn_r")
_OF_RIG = ("frontal_area", "reference_length", "width")
_Value = TypeVar("_Value")


def _check(name: str, value: float, *, above: float = -inf, least: float = -inf) -> None:
    if not (isfinite(value) and value > above and value >= least):
        bound = f" above {above:g}" if above > -inf else f" of {least:g} or more" if least > -inf else ""
        remedy = "correct the run's settings"
        raise TunnelError(f"{name} = {value!r} must be a finite number{bound}", remedy=remedy)


@dataclass(frozen=True)
class Series:
    """A sampled input: linear between samples, constant before the first and after the last.

    Args:
        values: samples, the first at the run's start.
        interval: time between samples, s, positive.
    """

    values: tuple[float, ...]
    interval: float

    def __post_init__(self) -> None:
        """Check the samples."""
        if not self.values or not all(map(isfinite, self.values)):
            what = "a series needs at least one sample, and all samples must be finite"
            raise TunnelError(what, remedy="correct the sampled input")
        _check("interval of a series", self.interval, above=0.0)


@dataclass(frozen=True)
class RodTwist:
    """A rod that twists between its upper end, with spring and sensor, and the body.

    Args:
        compliance: 1/Krod, rad/(N m), positive.
        inertia_share: share of Izz at the rod's upper end, 0 < share < 1.
        damping_ratio: damping of the twist, as a fraction of critical.
    """

    compliance: float
    inertia_share: float
    damping_ratio: float = 0.01

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check("compliance of the rod", self.compliance, above=0.0)
        _check("inertia_share of the rod", self.inertia_share, above=0.0)
        _check("inertia share of the body", 1.0 - self.inertia_share, above=0.0)
        _check("damping_ratio of the rod", self.damping_ratio, least=0.0)

    def damping(self, yaw_inertia: float) -> float:
        """Damping of the rod's twist, N m s/rad, given the total Izz in kg m²."""
        share = self.inertia_share
        return 2.0 * self.damping_ratio * sqrt(yaw_inertia * share * (1.0 - share) / self.compliance)

    def free_frequency(self, yaw_inertia: float) -> float:
        """Angular frequency of the twist with both ends free, rad/s; the total Izz is in kg m²."""
        share = self.inertia_share
        return sqrt(1.0 / (self.compliance * yaw_inertia * share * (1.0 - share)))

    def frequency(self, yaw_inertia: float, spring_stiffness: float) -> float:
        """An upper bound on the natural frequency of the rod's twist, rad/s.

        Args:
            yaw_inertia: the total Izz, kg m².
            spring_stiffness: Kr, N m/rad.
        """
        share = self.inertia_share
        return sqrt((1.0 / (self.compliance * (1.0 - share)) + spring_stiffness) / (yaw_inertia * share))


@cache
def column_places() -> Mapping[str, int]:
    """The place of every column by name: the law's parameters first, in the law's order."""
    return {name: place for place, name in enumerate((*parameter_names(), *_BESIDE))}


@cache
def _further() -> Mapping[str, int]:
    """Places of the law's parameters that have no field in `RunSettings`."""
    own = {"air_density", "spring_stiffness", "mechanical_damping", "yaw_inertia", *_DERIVATIVES, *_OF_RIG}
    return {name: column_places()[name] for name in parameter_names() if name not in own}


@dataclass(frozen=True, eq=False)
class SettingsTable:
    """The physics of many runs, which effects change in place; the fields of `RunSettings`, by run.

    Args:
        numbers: numbers by column (`column_places`), in their units, shape (runs, columns); the rig's columns
            are 0.
    """

    numbers: Array
    series: list[Mapping[str, Series]]
    rod_twist: list[RodTwist | None]
    program: list[tuple[float, ...]]
    drive: list[InputMoment | None]

    @classmethod
    def empty(cls, count: int) -> SettingsTable:
        """A table of this many runs with all numbers at 0, to be set later, and the usual steps."""
        numbers = np.zeros((count, len(column_places())))
        numbers[:, column_places()["timestep"]] = _USUAL_STEP
        return cls(numbers, [{}] * count, [None] * count, [()] * count, [None] * count)

    @classmethod
    def of(cls, runs: Sequence[RunSettings]) -> SettingsTable:
        """A table from some runs."""
        table = cls.empty(len(runs))
        for place, run in enumerate(runs):
            table.put(place, run)
        return table

    def __len__(self) -> int:
        """Number of runs."""
        return len(self.numbers)

    def __getitem__(self, name: str) -> PerRun:
        """A column by its name, in its unit; a view, so that its values can be set."""
        column: Array = self.numbers[:, column_places()[name]]
        return column

    @property
    def spring_stiffness(self) -> StiffnessPerRun:
        """The stiffness Kr."""
        return self["spring_stiffness"]

    @property
    def wind_speed(self) -> SpeedPerRun:
        """The speed V."""
        return self["wind_speed"]

    @property
    def air_density(self) -> PerRun:
        """The density ρ, kg/m³."""
        return self["air_density"]

    @property
    def law(self) -> Laws:
        """The parameters of the moment law; a view."""
        return self.numbers[:, : len(parameter_names())]

    def air(self, rig: Rig, speed: SpeedPerRun | None = None) -> tuple[PerRun, PerRun]:
        """Ka (N m/rad) and Ca (N m s/rad) of the air, by run; at the runs' own wind speeds if none are given."""
        at = self.wind_speed if speed is None else speed
        area, length, density = rig.body.frontal_area, rig.body.length, self.air_density
        stiffness = aerodynamic_stiffness(
            self["cn_beta"], air_density=density, wind_speed=at, frontal_area=area, reference_length=length
        )
        damping = aerodynamic_damping(
            self["cn_r"], air_density=density, wind_speed=at, frontal_area=area, reference_length=length
        )
        return stiffness, damping

    def copy(self, rows: slice = slice(None)) -> SettingsTable:
        """An independent copy of the table, or of some of its runs."""
        numbers, series, rods = self.numbers[rows].copy(), self.series[rows], self.rod_twist[rows]
        return SettingsTable(numbers, series, rods, self.program[rows], self.drive[rows])

    def row(self, place: int) -> RunSettings:
        """One run as it is now, without the checks of `RunSettings`: a fit may try any number."""
        run = RunSettings.__new__(RunSettings)
        object.__setattr__(run, "table", self.copy(slice(place, place + 1)))
        return run

    def put(self, place: int, run: RunSettings) -> None:
        """Replace one run."""
        self.numbers[place] = run.table.numbers[0]
        self.series[place], self.rod_twist[place] = run.series, run.rod_twist
        self.program[place], self.drive[place] = run.program, run.drive

    def set(self, values: Mapping[str, float], rows: slice = slice(None)) -> None:
        """Set parameters of the moment law in some runs.

        Args:
            values: values by name, in their units (see ``mjcf/plugin/README.md``).

        Raises:
            TunnelError: when a name is unknown or belongs to a field of `RunSettings`.
        """
        places = _further()
        for name, value in values.items():
            if name not in places:
                remedy = did_you_mean(name, sorted(places))
                raise TunnelError(f"unknown parameter {name!r} of the moment law", remedy=remedy)
            self.numbers[rows, places[name]] = value

    def add_moment(self, place: int, program: tuple[float, ...]) -> None:
        """Add a moment on the rod's upper end to one run.

        Args:
            program: program of the moment, as for ``program`` of `RunSettings`.
        """
        before = self.program[place]
        add = (float(operation_names().index("add")),) if before else ()
        self.program[place] = (*before, *program, *add)

    def deviate(self, name: str, deviations: PerRun) -> None:
        """Change wind speed, spring or mechanical damping from their stated values by a share; never below zero.

        Args:
            name: name of the column.
            deviations: relative, dimensionless.
        """
        factors = np.maximum(0.0, 1.0 + deviations)
        self[name][:] *= factors
        for place, (given, factor) in enumerate(zip(self.series, factors.tolist(), strict=True)):
            if (one := given.get(name)) is not None:
                values = tuple(factor * value for value in one.values)
                self.series[place] = {**given, name: Series(values, one.interval)}

    @property
    def inputs(self) -> dict[int, InputMoment]:
        """The inputs of the driven runs by their places."""
        return {place: drive for place, drive in enumerate(self.drive) if drive is not None}

    def change_inputs(
        self, by: Sequence[Hashable], changed: Callable[[Any, InputMoment], InputMoment]
    ) -> None:
        """Change the inputs of the driven runs; equal changes of one input give one object.

        Args:
            by: the change of the input of every run.
            changed: the input after a change.
        """
        known: dict[tuple[Hashable, InputMoment], InputMoment] = {}
        for place, drive in self.inputs.items():
            change = by[place]
            if (change, drive) not in known:
                known[change, drive] = changed(change, drive)
            self.drive[place] = known[change, drive]


class _Field:
    """A field of `RunSettings` that the run's table stores under the same name."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name


class _Number(_Field):
    """A number; without a default it must be given."""

    def __init__(self, usual: float | None = None) -> None:
        self.usual = usual

    def __get__(self, run: RunSettings | None, owner: type) -> float:
        if run is not None:
            return run.table.numbers.item(0, column_places()[self.name])
        if self.usual is None:
            raise AttributeError(self.name)  # for a dataclass: no default
        return self.usual

    def __set__(self, run: RunSettings, value: float) -> None:
        run.table.numbers[0, column_places()[self.name]] = value


class _Object(_Field, Generic[_Value]):
    """A field that is not a number; None: as in an empty table."""

    def __get__(self, run: RunSettings | None, owner: type) -> _Value:
        value: _Value = cast(Any, None) if run is None else getattr(run.table, self.name)[0]
        return value

    def __set__(self, run: RunSettings, value: _Value | None) -> None:
        if value is not None:
            getattr(run.table, self.name)[0] = value


class _Derivatives(_Field):
    """Cnβ and Cnr, each in its column."""

    def __get__(self, run: RunSettings | None, owner: type) -> AeroDerivatives:
        if run is None:
            raise AttributeError(self.name)
        return AeroDerivatives(*(float(run.table[name][0]) for name in _DERIVATIVES))

    def __set__(self, run: RunSettings, value: AeroDerivatives) -> None:
        for name in _DERIVATIVES:
            run.table[name][0] = getattr(value, name)


class _Parameters(_Field):
    """Parameters of the law without a field of their own, each in its column; without those that are 0."""

    def __get__(self, run: RunSettings | None, owner: type) -> Mapping[str, float]:
        if run is None:
            return cast(Any, None)  # type: ignore[no-any-return]
        numbers = run.table.numbers[0].tolist()
        return {name: numbers[place] for name, place in _further().items() if numbers[place]}

    def __set__(self, run: RunSettings, value: Mapping[str, float] | None) -> None:
        run.table.set(value or {})


@dataclass(frozen=True)
class RunSettings:
    """The physics of one run: a row of a `SettingsTable`.

    Args:
        table: table of this run alone, which holds all other fields.
        spring_stiffness: Kr, N m/rad.
        derivatives: Cnβ and Cnr, 1/rad.
        yaw_inertia: Izz, kg m².
        mechanical_damping: Cr, N m s/rad.
        wind_speed: V, m/s; ignored where ``series`` gives it.
        air_density: ρ, kg/m³.
        release_angle: release angle of the body, rad.
        release_rate: release rate, rad/s; the rig itself releases from rest.
        duration, timestep: duration of the run, and of an integration step, s.
        parameters: further parameters of the moment law by name (see ``mjcf/plugin/README.md``); the others are
            zero.
        series: sampled inputs by name: ``wind_speed`` in m/s, ``forcing`` as a moment coefficient, and
            ``ambient``, a moment on the body that needs no wind, in N m.
        program: program of a further moment on the rod's upper end (see ``mjcf/plugin/expression.h``); empty:
            none.
        mean_speed: mean stated speed of the campaign's runs with the wind on, m/s.
    """

    table: SettingsTable = field(
        init=False, repr=False, compare=False, default_factory=lambda: SettingsTable.empty(1)
    )
    spring_stiffness: _Number = _Number()
    derivatives: _Derivatives = _Derivatives()
    yaw_inertia: _Number = _Number()
    mechanical_damping: _Number = _Number()
    wind_speed: _Number = _Number(0.0)
    air_density: _Number = _Number(0.0)
    release_angle: _Number = _Number(0.0)
    release_rate: _Number = _Number(0.0)
    duration: _Number = _Number(10.0)
    timestep: _Number = _Number(_USUAL_STEP)
    parameters: _Parameters = _Parameters()
    series: _Object[Mapping[str, Series]] = _Object()
    rod_twist: _Object[RodTwist | None] = _Object()
    program: _Object[tuple[float, ...]] = _Object()
    drive: _Object[InputMoment | None] = _Object()
    mean_speed: _Number = _Number(REFERENCE_SPEED)

    def __post_init__(self) -> None:
        """Check the numbers. The plugin checks the bounds of the law's parameters."""
        for name in ("yaw_inertia", "mean_speed", "duration", "timestep"):
            _check(name, getattr(self, name), above=0.0)
        for name in ("spring_stiffness", "wind_speed", "air_density"):
            _check(name, getattr(self, name), least=0.0)
        for name in ("mechanical_damping", "release_angle", "release_rate"):
            _check(name, getattr(self, name))
        wind = self.series.get("wind_speed")
        if wind is not None:
            _check("least wind_speed of the series", min(wind.values), least=0.0)

    def input_moment(self, time: Array) -> Array:
        """The moment of the input at some times since the run's start, N m, shape (n,); 0 in a free decay."""
        return np.zeros_like(time) if self.drive is None else self.drive.at(time)

    def layout(self) -> tuple[object, ...]:
        """Properties that runs must share to use one compiled model.

        Returns:
            Timestep, names and lengths of the series, lengths of program and drive, the drive's delay, and whether
            the rod is rigid.
        """
        series = tuple((name, len(series.values)) for name, series in self.series.items())
        # given by its samples, or by its means over the steps
        drive = None if self.drive is None else self.drive.acting
        driven = drive and (drive.values.size, drive.delay, drive.time_s[-1], drive.at_steps(self.timestep))
        return (self.timestep, series, len(self.program), driven, self.rod_twist is None)

    def law(self, rig: Rig) -> dict[str, float]:
        """Every parameter of the moment law.

        Args:
            rig: gives frontal area, reference length and width.

        Returns:
            Value by name, in the law's order and units.
        """
        sizes = (rig.body.frontal_area, rig.body.length, rig.body.width)
        law = dict(zip(parameter_names(), self.table.law[0].tolist(), strict=True))
        return law | dict(zip(_OF_RIG, sizes, strict=True))


def spring_end_angle(run: RunSettings) -> float:
    """Angle of the spring's and sensor's end at the release, rad: the body's own if the rod is rigid."""
    return run.release_angle / _body_per_end(run)


def released_by_spring_end(run: RunSettings) -> RunSettings:
    """The run with the body's release angle, from the angle of the spring's end, which a record shows."""
    if run.rod_twist is None:
        return run
    released = run.table.copy()
    released["release_angle"][0] *= _body_per_end(run)
    return released.row(0)


def _body_per_end(run: RunSettings) -> float:
    """The ratio of the body's angle to the spring end's, in balance; 1 for a rigid rod."""
    twist = run.rod_twist
    return 1.0 if twist is None else 1.0 + run.spring_stiffness * twist.compliance


@dataclass(frozen=True, eq=False)
class Motion:
    """The true motion of one run at the sensor's sample times.

    Args:
        time_s: times from the release.
        angle, rate: angle and rate of the rod's upper end, which carries spring and sensor.
    """

    time_s: Times
    angle: Angles
    rate: Rates = field(repr=False)

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        for name in ("time_s", "angle", "rate"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def sampling(settings: RunSettings, sample_rate: float) -> tuple[int, int]:
    """The number of samples in a run, and of whole integration steps between two samples.

    Args:
        sample_rate: sample rate, Hz.
    """
    if not limits.SLOWEST_RATE <= sample_rate <= limits.FASTEST_RATE:
        raise TunnelError(
            f"the sample rate of {sample_rate:g} Hz is not between {limits.SLOWEST_RATE:g} and "
            f"{limits.FASTEST_RATE:g} Hz",
            remedy="give it in Hz",
        )
    steps = 1.0 / (sample_rate * settings.timestep)
    if abs(steps - round(steps)) > 1e-9 * steps or round(steps) < 1:
        raise TunnelError(
            f"the sample interval at {sample_rate:g} Hz is not a whole number of {settings.timestep:g} s steps",
            remedy="choose a timestep that divides the sample interval",
        )
    return max(2, round(settings.duration * sample_rate)), round(steps)
