"""The truth of an episode: drawn from a stated distribution, or given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, isfinite, log
from typing import Any

import numpy as np

from identification.estimate import PARAMETERS, UNITS
from tunnel_sim.effects import Effect, effect_class, effect_from
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import Truth

MEAN = {"cn_beta": 0.45, "cn_r": -0.12, "yaw_inertia": 0.1014, "mechanical_damping": 0.016}
"""Means of the coefficients an episode draws, in their units."""
STD = {"cn_beta": 0.08, "cn_r": 0.03, "yaw_inertia": 0.004, "mechanical_damping": 0.004}
"""Their standard deviations: normal, independent, cut at `CUT` of them. Also the estimate's prior."""
CUT = 2.5
OPTIONS = ("truth", "effects")


@dataclass(frozen=True)
class RigTruth:
    """The truth of an episode, which no observation contains.

    Args:
        effects: those added to it.
        sensor_zero: rad.
    """

    coefficients: Truth
    effects: tuple[Effect, ...] = field(default=())
    sensor_zero: float = 0.0

    @property
    def values(self) -> dict[str, float]:
        """The coefficients by name, in the units of `identification.estimate.UNITS`."""
        return {name: float(getattr(self.coefficients, name)) for name in PARAMETERS}

    def to_json_dict(self) -> dict[str, Any]:
        """Coefficients by name, effects with their parameters, the sensor's zero; SI."""
        return {
            **self.values,
            "sensor_zero": self.sensor_zero,
            "effects": {effect.name: effect.to_json_dict()["parameters"] for effect in self.effects},
        }


def draw_truth(
    rng: np.random.Generator,
    severities: Mapping[str, tuple[float, float]],
    options: Mapping[str, Any] | None,
) -> RigTruth:
    """Draw an episode's truth; values from the options replace the drawn ones.

    Every number is always drawn, so that one option does not change the other numbers.

    Args:
        severities: the effects, of which one acts, each with the same probability and a severity log-uniform in
            its range (SI units); no effect acts where it is empty.
        options: ``truth``: coefficients by name, ``sensor_zero`` among them; ``effects``: parameters by effect
            name, empty for none.

    Raises:
        TunnelError: for an unknown option, coefficient or effect, or a number that is out of range.
    """
    options = {} if options is None else dict(options)
    for key in options:
        if key not in OPTIONS:
            raise TunnelError(f"unknown reset option {key!r}", remedy=did_you_mean(str(key), OPTIONS))
    values = {name: _normal(rng, MEAN[name], STD[name]) for name in PARAMETERS}
    zero = _normal(rng, 0.0, 0.004)
    effects = _draw_effect(rng, severities)
    given = _numbers(options.get("truth", {}))
    zero = given.pop("sensor_zero", zero)
    if options.get("effects") is not None:
        effects = _given_effects(options["effects"])
    return RigTruth(Truth(**(values | given)), effects, zero)


def _normal(rng: np.random.Generator, mean: float, std: float) -> float:
    while True:
        step = float(rng.standard_normal())
        if abs(step) <= CUT:
            return mean + std * step


def _draw_effect(
    rng: np.random.Generator, severities: Mapping[str, tuple[float, float]]
) -> tuple[Effect, ...]:
    if not severities:
        return ()
    name = list(severities)[int(rng.integers(len(severities)))]
    low, high = severities[name]
    severity = exp(rng.uniform(log(low), log(high)))
    return (effect_from(name, {effect_class(name).parameters()[0].name: severity}),)


def _numbers(given: Any) -> dict[str, float]:
    known = (*PARAMETERS, "sensor_zero")
    if not isinstance(given, Mapping):
        raise TunnelError("option truth is not a mapping", remedy=f"give some of {', '.join(known)} by name")
    for name, value in given.items():
        if name not in known:
            raise TunnelError(
                f"unknown coefficient {name!r}", where="truth", remedy=did_you_mean(name, known)
            )
        positive = name in ("yaw_inertia", "mechanical_damping")
        number = isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
        if not number or (positive and value <= 0.0):
            unit = UNITS.get(name, "rad")
            remedy = f"give a {'positive ' if positive else ''}number in {unit}"
            raise TunnelError(f"{name} = {value!r} is out of range", where="truth", remedy=remedy)
    return {name: float(value) for name, value in given.items()}


def _given_effects(given: Any) -> tuple[Effect, ...]:
    if not isinstance(given, Mapping):
        remedy = "give parameters by effect, as {'coulomb_friction': {'friction_moment': 0.004}}"
        raise TunnelError("option effects is not a mapping", remedy=remedy)
    return tuple(effect_from(name, dict(parameters)) for name, parameters in given.items())
