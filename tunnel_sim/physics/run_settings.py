"""The physics of one run as numbers, its release and its motion; MuJoCo and the forward integrator use them.

At the release the body is held at its angle, at rest, and its rod is in balance with the spring. With a rod
of compliance c and a spring Kr, the body's angle is 1 + Kr c times that of the spring's end.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from math import inf, isfinite, sqrt
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.actuator import DIRECT, Actuator, Samples, recurrence
from tunnel_sim.physics.moment_law import operation_names, parameter_names
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.quantities import (
    Angles,
    Moments,
    Number,
    PerSample,
    RadPerS,
    Rates,
    Seconds,
    Times,
)
from tunnel_sim.vocabulary.record import Array, read_only
from tunnel_sim.vocabulary.rig import Rig

_OWNED = frozenset(
    {
        "air_density", "frontal_area", "reference_length", "width", "cn_beta", "cn_r",
        "spring_stiffness", "mechanical_damping", "yaw_inertia",
    }
)  # fmt: skip
_EVEN = 1e-6  # of an interval: a smaller departure from even samples is rounding


def _check(name: str, value: float, *, above: float = -inf, least: float = -inf) -> None:
    if not (isfinite(value) and value > above and value >= least):
        bound = f" above {above:g}" if above > -inf else f" of {least:g} or more" if least > -inf else ""
        remedy = "correct the run's settings"
        raise TunnelError(f"{name} = {value!r} must be a finite number{bound}", remedy=remedy)


@cache
def _further() -> frozenset[str]:
    """Names of the law's parameters without a field of their own."""
    return frozenset(parameter_names()) - _OWNED


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
        damping_ratio: of the twist, as a fraction of critical.
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


@dataclass(frozen=True, eq=False)
class Lines:
    """An input as a line from each of its samples to the next, as the integrator takes it side by side.

    Args:
        time_s: of the samples, even, each at the start of a step.
        values: there, in the unit of the input.
        slopes: from there on, per s.
        interval: between the samples, s.
        delay: time by which it acts later, s.
    """

    time_s: Times
    values: PerSample
    slopes: PerSample
    interval: float
    delay: float = 0.0


@dataclass(frozen=True, eq=False)
class DriveMoment:
    """The moment of a drive: linear or constant between its samples, constant before the first and after the last.

    Args:
        time_s: of the samples, since the run's start, increasing.
        values: at these times, in any unit.
        scale: N m per unit.
        delay: time by which it acts later than its samples, s.
        on_body: whether it acts on the body; else on the rod's upper end, as the spring does.
        actuator: limits and lag between the samples and the body.
        offset: an added constant moment, which does not pass through the actuator, N m.
        by_actuator: whether it is the demand on an actuator, where it acts on the body.
    """

    time_s: Times
    values: PerSample
    scale: float = 1.0
    delay: float = 0.0
    held: bool = False
    on_body: bool = True
    actuator: Actuator = DIRECT
    offset: float = 0.0
    by_actuator: bool = True

    def __post_init__(self) -> None:
        """Copy and check the samples."""
        for name in ("time_s", "values"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        finite = all(map(isfinite, (self.scale, self.delay, self.offset)))
        finite = finite and bool(np.isfinite(self.time_s).all() and np.isfinite(self.values).all())
        if self.time_s.shape != self.values.shape or not self.time_s.size or not finite:
            remedy = "correct the sampled input"
            raise TunnelError("a drive needs as many finite values as times, and at least one", remedy=remedy)

    @cached_property
    def exerted(self) -> DriveMoment:
        """The moment behind the actuator, as samples and an offset; none where the scale is 0."""
        offset = self.offset if self.scale else 0.0
        if self.actuator == DIRECT and offset == self.offset:
            return self
        given = self.actuator.exerted(Samples(self.time_s, self.values, self.held), self.scale)
        return DriveMoment(
            given.time_s, given.values, self.scale, self.delay, given.held, self.on_body, offset=offset
        )

    @cached_property
    def acting(self) -> DriveMoment:
        """The acting moment, as samples without an actuator or an offset."""
        exerted = self.exerted
        if not exerted.offset:
            return exerted
        return replace(exerted, values=exerted.values + exerted.offset / exerted.scale, offset=0.0)

    @cached_property
    def interval(self) -> Seconds:
        """Time between its samples; 0 where they are not even."""
        interval = float(self.time_s[-1] - self.time_s[0]) / max(1, self.time_s.size - 1)
        even = self.time_s[0] + interval * np.arange(self.time_s.size)
        return interval if np.max(np.abs(self.time_s - even)) <= _EVEN * interval else 0.0

    @property
    def through_actuator(self) -> bool:
        """Whether it is a moment exerted by an actuator, which the effects of an actuator change."""
        return self.on_body and self.by_actuator

    @property
    def as_sampled(self) -> bool:
        """Whether it acts at the times and with the values of its samples; a constant moment may be added."""
        return self.delay == 0.0 and self.actuator == DIRECT

    @property
    def greatest(self) -> tuple[float, float]:
        """Greatest magnitudes of the moment (N m) and of its rate of change from sample to sample (N m/s)."""
        size = abs(self.scale)
        rates = np.abs(np.diff(self.values)) / np.diff(self.time_s)
        return size * float(np.max(np.abs(self.values))), size * float(np.max(rates, initial=0.0))

    def on_steps(self, step: Seconds) -> bool:
        """Whether it acts from sample to sample at even times, each a whole number of steps from 0."""
        apart, first = self.interval / step, (self.time_s[0] + self.delay) / step
        within = _EVEN * apart
        return (
            round(apart) >= 1 and abs(apart - round(apart)) <= within and abs(first - round(first)) <= within
        )

    def at_steps(self, step: Seconds) -> bool:
        """Whether its samples are at even times from 0 on, a whole number of steps apart, and it has no delay."""
        return self.delay == 0.0 and abs(self.time_s[0]) <= _EVEN * self.interval and self.on_steps(step)

    def means(self, ends: Times) -> PerSample:
        """Means of the delayed input between successive times since the run's start, which keep its impulse."""
        means: Array = _impulses(self.acting, ends)[0] / np.diff(ends)
        return means

    def lines(self, step: Seconds, steps: int, *, sampled: bool) -> Lines:
        """The samples without an actuator as lines; those of the same samples are one object.

        Args:
            step: of the integration.
            steps: number of steps.
            sampled: whether a line runs from sample to sample, which are at the starts of steps; else there is
                one for each step, with the impulse of the input and its product with the time. The motion of
                a body then differs by less than the order of step².
        """
        of = _Same(self.time_s), _Same(self.values), self.held, self.delay
        return _lines_of_samples(*of) if sampled else _lines_of_steps(*of, step, steps)

    def oscillation(
        self, frequency: RadPerS, damping_ratio: Number, time_s: Times, derivative: int = 0
    ) -> Moments:
        """The response of an oscillator at rest to the moment u: q̈ + 2ζω q̇ + ω² q = ω² u, exact for both holds.

        Args:
            frequency: undamped, ω.
            damping_ratio: ζ below 1.
            time_s: since the run's start, at which it begins at rest.
            derivative: which derivative of q is returned, per s or s²: 0, 1 or 2.
        """
        acting = self.acting
        of = _Same(acting.time_s), _Same(acting.values), acting.held, acting.delay
        moment: Moments = self.scale * _oscillation(*of, frequency, damping_ratio, _Same(time_s), derivative)
        return moment


def _pieces(drive: DriveMoment, starts: Times) -> tuple[PerSample, PerSample]:
    """Level and slope, per s, of an input's delayed samples from given times since the run's start on."""
    kinks = drive.time_s + drive.delay
    piece = np.searchsorted(kinks, starts, side="right") - 1  # -1 before the first sample
    at = np.clip(piece, 0, kinks.size - 1)
    slope = np.append(np.diff(drive.values) / np.diff(drive.time_s), 0.0)[at]
    slope = np.where((piece < 0) | drive.held, 0.0, slope)
    return drive.values[at] + slope * (starts - kinks[at]), slope


def _impulses(drive: DriveMoment, ends: Times) -> tuple[Array, Array]:
    """Integrals of an input's delayed samples between times, and of their products with the time since the last."""
    kinks = drive.time_s + drive.delay
    inside = kinks[(kinks > ends[0]) & (kinks < ends[-1])]
    starts = np.sort(np.concatenate([ends[:-1], inside]), kind="stable")  # of two sorted parts: fast
    level, slope = _pieces(drive, starts)
    last, length = ends.size - 1, np.diff(np.append(starts, ends[-1]))
    within = np.searchsorted(ends, starts, side="right") - 1
    impulse = length * (level + slope * length / 2.0)
    product = (starts - ends[within]) * impulse + length**2 * (level / 2.0 + slope * length / 3.0)
    return np.bincount(within, impulse, last), np.bincount(within, product, last)


class _Same:
    """An array as a key of a cache: equal to itself only."""

    def __init__(self, array: Array) -> None:
        self.array = array

    def __hash__(self) -> int:
        return id(self.array)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.array is self.array


@lru_cache(maxsize=64)
def _lines_of_samples(time_s: _Same, values: _Same, held: bool, delay: float) -> Lines:
    drive = DriveMoment(time_s.array, values.array, delay=delay, held=held)
    rise = 0.0 if held else np.diff(drive.values) / drive.interval
    slopes = np.append(np.broadcast_to(rise, drive.values.size - 1), 0.0)
    return Lines(drive.time_s, drive.values, read_only(slopes), drive.interval, delay)


@lru_cache(maxsize=64)
def _lines_of_steps(
    time_s: _Same, values: _Same, held: bool, delay: float, step: Seconds, steps: int
) -> Lines:
    ends = step * np.arange(steps + 1)
    impulse, product = _impulses(DriveMoment(time_s.array, values.array, delay=delay, held=held), ends)
    slopes = 12.0 * (product - impulse * step / 2.0) / step**3
    return Lines(
        read_only(ends[:-1]), read_only(impulse / step - slopes * step / 2.0), read_only(slopes), step
    )


@lru_cache(maxsize=64)
def _oscillation(
    times: _Same,
    values: _Same,
    held: bool,
    delay: float,
    frequency: RadPerS,
    damping_ratio: Number,
    at: _Same,
    derivative: int,
) -> PerSample:
    """As `DriveMoment.oscillation`, in the unit of the samples."""
    drive, time_s = DriveMoment(times.array, values.array, delay=delay, held=held), at.array
    ringing = np.sqrt(1.0 - damping_ratio**2)
    pole = frequency * complex(-damping_ratio, ringing)
    kinks = drive.time_s + drive.delay
    starts = np.concatenate([[0.0], kinks[kinks > 0.0]])
    level, slope = _pieces(drive, starts)

    def forced(j: NDArray[np.intp], since: Array) -> np.ndarray:  # z' = p z + u, from z = 0
        turn = pole * since
        grown = np.expm1(turn)
        found: np.ndarray = level[j] * grown / pole + slope[j] * (grown - turn) / pole**2
        return found

    factor = np.exp(pole * np.diff(starts))
    state = np.concatenate([[0j], forced(np.arange(factor.size), np.diff(starts))])
    state = recurrence(np.concatenate([[0j], factor]), state)  # z at the starts
    j = np.maximum(np.searchsorted(starts, time_s, side="right") - 1, 0)
    since = np.maximum(time_s - starts[j], 0.0)
    state = np.exp(pole * since) * state[j] + forced(j, since)
    response = (pole**derivative * state).imag
    if derivative == 2:
        response = response + pole.imag * (level[j] + slope[j] * since)
    return read_only(frequency / ringing * response)


@dataclass(frozen=True)
class RunSettings:
    """The physics of one run.

    Args:
        spring_stiffness: Kr, N m/rad.
        derivatives: Cnβ and Cnr, 1/rad.
        yaw_inertia: Izz, kg m².
        mechanical_damping: Cr, N m s/rad.
        wind_speed: V, m/s; ignored where ``series`` gives it.
        air_density: ρ, kg/m³.
        release_angle: rad, of the body.
        release_rate: rad/s; the rig itself releases from rest.
        duration, timestep: of the run, and of an integration step, s.
        parameters: further parameters of the moment law by name (see ``mjcf/plugin/README.md``); the others are
            zero.
        series: sampled inputs by name: ``wind_speed`` in m/s, ``forcing`` as a moment coefficient, and
            ``ambient``, a moment on the body that needs no wind, in N m.
        program: of a further moment on the rod's upper end (see ``mjcf/plugin/expression.h``); empty: none.
    """

    spring_stiffness: float
    derivatives: AeroDerivatives
    yaw_inertia: float
    mechanical_damping: float
    wind_speed: float = 0.0
    air_density: float = 0.0
    release_angle: float = 0.0
    release_rate: float = 0.0
    duration: float = 10.0
    timestep: float = 1e-3
    parameters: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    series: Mapping[str, Series] = field(default_factory=lambda: MappingProxyType({}))
    rod_twist: RodTwist | None = None
    program: tuple[float, ...] = ()
    drive: DriveMoment | None = None

    def __post_init__(self) -> None:
        """Check names and numbers. The plugin checks the bounds of the law's parameters."""
        for name in ("yaw_inertia", "duration", "timestep"):
            _check(name, getattr(self, name), above=0.0)
        for name in ("spring_stiffness", "wind_speed", "air_density"):
            _check(name, getattr(self, name), least=0.0)
        for name in ("mechanical_damping", "release_angle", "release_rate"):
            _check(name, getattr(self, name))
        wind = self.series.get("wind_speed")
        if wind is not None:
            _check("least wind_speed of the series", min(wind.values), least=0.0)
        if not self.parameters.keys() <= _further():
            name = next(name for name in self.parameters if name not in _further())
            remedy = did_you_mean(name, sorted(_further()))
            raise TunnelError(f"unknown parameter {name!r} of the moment law", remedy=remedy)

    def with_moment(self, program: tuple[float, ...]) -> RunSettings:
        """A copy with a moment on the rod's upper end added.

        Args:
            program: of the moment, as for ``program``.
        """
        add = (float(operation_names().index("add")),) if self.program else ()
        return replace(self, program=(*self.program, *program, *add))

    def with_parameters(self, values: Mapping[str, float]) -> RunSettings:
        """A copy with parameters of the moment law added or replaced.

        Args:
            values: by name.

        Raises:
            TunnelError: when a name is unknown or belongs to a field.
        """
        parameters = {**self.parameters, **values}
        if not values.keys() <= _further():
            return replace(self, parameters=parameters)  # its checks raise the error
        copy = object.__new__(RunSettings)  # its other fields were checked
        copy.__dict__.update(self.__dict__, parameters=parameters)
        return copy

    def with_deviations(self, deviations: Mapping[str, float]) -> RunSettings:
        """A copy whose wind speed, spring or mechanical damping deviate from their statements; never below zero.

        Args:
            deviations: relative, by name, dimensionless.
        """
        factors = {name: max(0.0, 1.0 + value) for name, value in deviations.items()}
        series = {
            name: replace(given, values=tuple(factors.get(name, 1.0) * value for value in given.values))
            for name, given in self.series.items()
        }
        changed: dict[str, Any] = {name: factor * getattr(self, name) for name, factor in factors.items()}
        return replace(self, series=series, **changed)

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
        given = {
            "air_density": self.air_density,
            "frontal_area": rig.body.frontal_area,
            "reference_length": rig.body.length,
            "width": rig.body.width,
            "cn_beta": self.derivatives.cn_beta,
            "cn_r": self.derivatives.cn_r,
            "spring_stiffness": self.spring_stiffness,
            "mechanical_damping": self.mechanical_damping,
            "yaw_inertia": self.yaw_inertia,
            **self.parameters,
        }
        return {name: float(given.get(name, 0.0)) for name in parameter_names()}


def spring_end_angle(run: RunSettings) -> float:
    """Angle of the spring's and sensor's end at the release, rad: the body's own where the rod is rigid."""
    return run.release_angle / _body_per_end(run)


def released_by_spring_end(run: RunSettings) -> RunSettings:
    """The run with the body's release angle, given the angle of the spring's end, which a record shows."""
    if run.rod_twist is None:
        return run
    return dataclasses.replace(run, release_angle=run.release_angle * _body_per_end(run))


def _body_per_end(run: RunSettings) -> float:
    """The ratio of the body's angle to the spring end's, in balance; 1 for a rigid rod."""
    twist = run.rod_twist
    return 1.0 if twist is None else 1.0 + run.spring_stiffness * twist.compliance


@dataclass(frozen=True, eq=False)
class Motion:
    """The true motion of one run at the sensor's sample times.

    Args:
        time_s: from the release.
        angle, rate: of the rod's upper end, which carries spring and sensor.
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
        sample_rate: Hz.
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
