"""The parameters of a fit: names, units, ranges, steps and places in its vectors, defined once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from tunnel_sim.vocabulary.record import Array

#: Step of one-sided differences, in a parameter's size. It gives the derivative to 3e-6 and better. With
#: longer steps the curvature of a phase over many cycles dominates (3e-4 at 1e-5), with shorter ones rounding
#: (1e-4 at 1e-9).
_RELATIVE_STEP = 1e-7
#: Name of the parameter that is the gain of an input.
GAIN = "drive_gain"

#: Whether a parameter is common to the runs, or differs from run to run.
Owner = Literal["common", "per_run"]


class Named(Protocol):
    """An object with a name."""

    @property
    def name(self) -> str:
        """The name."""


@dataclass(frozen=True)
class RunParameterPrior:
    """Prior of a run's own parameter: a normal distribution about zero.

    Args:
        std: standard deviation, in the parameter's unit.
    """

    std: float


@dataclass(frozen=True)
class Parameter:
    """One parameter of a fit.

    Args:
        name: name of the nominal model's parameter, or ``effect.parameter``.
        unit: SI, angles in rad; the readings' unit where a parameter has it.
        lower: least value allowed, in the unit.
        upper: greatest value allowed, in the unit.
        size: a typical value, below which steps of finite differences shrink no further, in the unit.
        of_swing: whether the parameter's steps are in proportion to the amplitude of the run; ``size`` is then
            a multiple of the amplitude.
        effect: name of the effect with this parameter; empty: the nominal model.
        prior: prior on a parameter of a run; None: flat, as for a release.
    """

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    size: float = 1.0
    owner: Owner = "common"
    of_swing: bool = False
    effect: str = ""
    prior: RunParameterPrior | None = None


@dataclass(frozen=True, eq=False)
class Point:
    """A value of every parameter.

    Args:
        common: parameters common to the runs, in the order of `ParameterSet.names`, shape (common,).
        per_run: own parameters of every run, in the order of `ParameterSet.own_names`, shape (runs, own).
    """

    common: Array
    per_run: Array


@dataclass(frozen=True, eq=False)
class ParameterSet:
    """The parameters of a fit, in the order of its vectors."""

    parameters: tuple[Parameter, ...]

    @cached_property
    def common(self) -> tuple[Parameter, ...]:
        """The parameters common to the runs."""
        return tuple(one for one in self.parameters if one.owner == "common")

    @cached_property
    def own(self) -> tuple[Parameter, ...]:
        """The own parameters of every run."""
        return tuple(one for one in self.parameters if one.owner == "per_run")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the common parameters."""
        return tuple(one.name for one in self.common)

    @cached_property
    def own_names(self) -> tuple[str, ...]:
        """Names of a run's own parameters."""
        return tuple(one.name for one in self.own)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest values of the common parameters, shape (common,) each."""
        found = np.array([(one.lower, one.upper) for one in self.common], np.float64).reshape(-1, 2)
        return found[:, 0], found[:, 1]

    @cached_property
    def own_places(self) -> Mapping[str, slice]:
        """Places of each effect's phase or instants among a run's own parameters, by the effects' names."""
        effects = [one.effect for one in self.own]
        first = {effect: effects.index(effect) for effect in dict.fromkeys(effects) if effect}
        return {effect: slice(at, at + effects.count(effect)) for effect, at in first.items()}

    @cached_property
    def of_effects(self) -> int:
        """Number of a run's own parameters that belong to effects; they come last."""
        return sum(bool(one.effect) for one in self.own)

    def places(self, scatter: Sequence[Named]) -> list[int]:
        """Places of a run's deviations among its own parameters.

        Args:
            scatter: the parameters that differ between runs.
        """
        return [self.own_names.index(one.name) for one in scatter]

    @cached_property
    def precision(self) -> Array:
        """One over the variance of every own parameter's prior, 0 without one, shape (own,)."""
        return np.array([0.0 if one.prior is None else one.prior.std**-2 for one in self.own])

    def pull(self, point: Point) -> Array:
        """Half the fall of `surprise` with each own parameter, shape (runs, own)."""
        return np.asarray(-self.precision * point.per_run, np.float64)

    def surprise(self, point: Point) -> float:
        """Distance of the own parameters from their priors, in variances, summed; a part of χ²."""
        return float(self.surprises(point).sum()) if self.precision.any() else 0.0

    def surprises(self, point: Point) -> Array:
        """Distance of each run's parameters from their priors, in variances, shape (runs,); 0 without any."""
        if not self.precision.any():
            return np.zeros(len(point.per_run))
        away = self.pull(point)
        return np.asarray(np.sum(away**2 / np.where(self.precision > 0.0, self.precision, 1.0), axis=1))

    def value(self, point: Point, name: str, run: int) -> float | None:
        """A parameter in one run, in its unit; None if no parameter has that name.

        Args:
            run: index of the run.
        """
        if name in self.names:
            return float(point.common[self.names.index(name)])
        return float(point.per_run[run, self.own_names.index(name)]) if name in self.own_names else None

    def point(self, common: Mapping[str, float], own: Sequence[Mapping[str, float]]) -> Point:
        """The point of some values; the others are 0.

        Args:
            common: values of common parameters, by name.
            own: values of own parameters, by run, by name.
        """
        return Point(
            np.array([common.get(name, 0.0) for name in self.names]),
            np.array([[run.get(name, 0.0) for name in self.own_names] for run in own]),
        )

    def steps(self, common: Array) -> Array:
        """Steps for one-sided finite differences of the common parameters, away from bounds, shape (common,).

        Args:
            common: values of the common parameters, shape (common,).
        """
        sizes = [max(abs(value), one.size) for one, value in zip(self.common, common, strict=True)]
        steps = _RELATIVE_STEP * np.array(sizes)
        _, upper = self.bounds
        steps[common + steps > upper] *= -1.0
        return steps

    def own_steps(self, amplitude: Array) -> list[Array]:
        """Steps for finite differences of a run's own parameters, by parameter, shape (runs,) each.

        Args:
            amplitude: amplitude of every run, rad, shape (runs,).
        """
        whole = np.ones_like(amplitude)
        return [_RELATIVE_STEP * one.size * (amplitude if one.of_swing else whole) for one in self.own]


def released(zero: Parameter | None = None) -> Iterable[Parameter]:
    """The own parameters of every run: its release, and its sensor's zero if zeros differ from run to run.

    The angle (rad) and the rate (rad/s) belong to the sensor's end, at the start of the fitted part.
    """
    yield Parameter("release_angle", "rad", owner="per_run", of_swing=True)
    yield Parameter("release_rate", "rad/s", size=10.0, owner="per_run", of_swing=True)
    if zero is not None:
        yield zero
