"""The physics of one run as numbers, its release and its motion; MuJoCo and the forward integrator use them.

At the release the body is held at its angle, at rest, and its rod is in balance with the spring. With a rod
of compliance c and a spring Kr, the body's angle is 1 + Kr c times that of the spring's end.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from math import inf, isfinite, sqrt
from types import MappingProxyType
from typing import Any

import numpy as np

from tunnel_sim.physics.drive import DriveMoment
from tunnel_sim.physics.moment_law import operation_names, parameter_names
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import AeroDerivatives
from tunnel_sim.vocabulary.quantities import (
    Angles,
    Rates,
    Times,
)
from tunnel_sim.vocabulary.record import Array, read_only
from tunnel_sim.vocabulary.rig import Rig

REFERENCE_SPEED = 20.0
"""Wind speed at which a speed-dependent form equals the textbook form, m/s."""

_OWNED = frozenset(
    {
        "air_density", "frontal_area", "reference_length", "width", "cn_beta", "cn_r",
        "spring_stiffness", "mechanical_damping", "yaw_inertia",
    }
)  # fmt: skip


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
        mean_speed: mean stated speed of the campaign's runs with the wind on, m/s.
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
    mean_speed: float = REFERENCE_SPEED

    def __post_init__(self) -> None:
        """Check names and numbers. The plugin checks the bounds of the law's parameters."""
        for name in ("yaw_inertia", "mean_speed", "duration", "timestep"):
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
