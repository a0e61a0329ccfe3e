"""The parameters of effects, and the information on the runs for a fit.

Drifts of several effects share one form: linear, or exponential towards a final value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from math import inf
from typing import Any, ParamSpec

import numpy as np

from tunnel_sim.vocabulary.dimensions import angle_power
from tunnel_sim.vocabulary.record import Array

SWING = 0.3
"""Least swing for the ranges of the parameters, rad: a release at 20 degrees stays above it."""

LEAST_EXPONENT = 0.25
"""Smallest exponent: with a smaller one a term is nearly a jump, which the integration steps do not resolve."""

DESCRIPTION = "parameter"
"""Key of a field's metadata with its `ParameterInfo`."""
InfoT = ParamSpec("InfoT")


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter of an effect.

    Args:
        unit: SI, angles in rad.
        scale: a typical value for this rig, for steps and starting values.
        lower, upper: least and greatest value allowed, in the unit.
        default: value if none is given, in the unit; zero for the severity.
        fit_lower, fit_upper: least and greatest value that a fit of swings from `SWING` on may take, in the
            unit.
        rate_exponent: name of the parameter that is the exponent of the rate in this parameter's term; empty:
            none.
        beside_spring: whether it can be fitted only beside a spring of stated stiffness; else it is fixed.
        chosen_spring: whether it is the stiffness of one of the campaign's springs: chosen, not fitted.
        per_pressure: whether it multiplies ½ρV²Al, so that its unit depends on which sizes are stated.
        inside: whether a fit at one of its bounds suggests another law, as for a free exponent.
        of_input: whether it relates the effect to the input of a driven run; values are tried, not fitted. Free
            decays do not depend on it.
        along_run: whether it shapes a change along the run.
        of_load: whether it relates the effect to the moment that the joint carries; it can be fitted only where
            gravity or an actuator makes this moment vary.
        relative: whether it is a relative change, shown in per cent; its unit is ``1``.
        name: name of the field in the effect's class, from which it is taken.
    """

    symbol: str
    unit: str
    meaning: str
    _: KW_ONLY
    scale: float
    lower: float = -inf
    upper: float = inf
    default: float = 0.0
    form: bool = False
    fit_lower: float = -inf
    fit_upper: float = inf
    rate_exponent: str = ""
    beside_spring: bool = False
    chosen_spring: bool = False
    per_pressure: bool = False
    inside: bool = False
    of_input: bool = False
    along_run: bool = False
    of_load: bool = False
    relative: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        """A fit stays within the values allowed."""
        object.__setattr__(self, "fit_lower", max(self.lower, self.fit_lower))
        object.__setattr__(self, "fit_upper", min(self.upper, self.fit_upper))

    @property
    def form_start(self) -> float:
        """Where a fit frees a form: its default, or half a step inside a bound, where its slope may vanish."""
        return self.default + 0.5 * self.scale if self.default == self.lower else self.default

    def fit_range(self, swing: float) -> tuple[float, float]:
        """Least and greatest value that a fit may take.

        Args:
            swing: largest angle of the motion, rad. Below `SWING` a coefficient per angle may be proportionally
                greater, and a least angle smaller: the ratios of the moments are unchanged.

        Returns:
            Both values, in the unit.
        """
        if "rad" not in self.unit or not 0.0 < swing < SWING:
            return self.fit_lower, self.fit_upper
        wider = (SWING / swing) ** -angle_power(self.unit)
        if wider > 1.0:
            return max(self.lower, self.fit_lower * wider), min(self.upper, self.fit_upper * wider)
        least = self.fit_lower * wider if self.unit == "rad" and self.fit_lower > 0.0 else self.fit_lower
        return max(self.lower, least), self.fit_upper


def _as_field(described: Callable[InfoT, ParameterInfo]) -> Callable[InfoT, Any]:
    def declared(*args: InfoT.args, **named: InfoT.kwargs) -> Any:
        info = described(*args, **named)
        return field(default=info.default, metadata={DESCRIPTION: info})

    return declared


parameter = _as_field(ParameterInfo)
"""A dataclass field that is an effect's parameter; arguments as in `ParameterInfo`."""


def exponent(symbol: str, meaning: str, textbook: float, fit_lower: float = -inf) -> Any:
    """A form parameter that is the exponent of a term; its default is the textbook's.

    Args:
        textbook: exponent of the textbook form, dimensionless.
        fit_lower: least value a fit may take, dimensionless.
    """
    return parameter(
        symbol, "1", meaning, scale=1.0, lower=LEAST_EXPONENT, upper=9.0, default=textbook, form=True,
        inside=True, fit_lower=fit_lower,
    )  # fmt: skip


EQUATION = "(1 − e^(−k t/T))/(1 − e^(−k))"


def settling() -> Any:
    """The form parameter of a drift: run length over the time constant; 0: linear, the textbook form."""
    meaning = "length of the run over the drift's time constant"
    return parameter("k", "1", meaning, scale=1.0, lower=-30.0, upper=30.0, form=True, along_run=True)


_LINEAR = 1e-3  # rate below which the first two terms of the mean's series are exact to 1e-12


def ramp(part: Array, rate: float) -> Array:
    """The share of a drift that has developed, from 0 to 1 over the run, shape (n,).

    Args:
        part: elapsed share of the run, t/T, shape (n,).
        rate: run length over the drift's time constant, dimensionless ratio; below 0 the drift accelerates, at 0
            it is linear.
    """
    if rate == 0.0:
        return part
    return np.asarray(np.expm1(-rate * part) / np.expm1(-rate), dtype=np.float64)


def mean_of_ramp(rate: float) -> float:
    """The mean of `ramp` over the run."""
    if abs(rate) < _LINEAR:
        return 0.5 + rate / 12.0
    return -1.0 / float(np.expm1(-rate)) - 1.0 / rate


@dataclass(frozen=True)
class Circumstances:
    """Circumstances that determine the starting values for the fit of an effect.

    Args:
        greatest_reading: greatest absolute reading of any run, rad.
        wind_speeds: settings of the wind, m/s, the slowest first; empty without wind.
        greatest_moment: greatest demand of an input, N m, from the fit without the effect; 0 if no input moves
            the body.
        fastest_moment: greatest demanded rate of change of an input, N m/s, from sample to sample.
    """

    springs: tuple[float, ...]
    greatest_reading: float
    normalised: bool
    wind_speeds: tuple[float, ...]
    greatest_moment: float = 0.0
    fastest_moment: float = 0.0


@dataclass(frozen=True)
class Trial:
    """Starting values for the fit of an effect.

    Args:
        at_most: greatest absolute value that linear theory may give the parameter, in its unit.
        second_order: whether the nominal coefficients absorb its first order, so that only its square shows.
        passive: whether a passive part can have this sign; an upper limit is stated for such a sign only.
    """

    values: Mapping[str, float]
    scaled: str | None
    at_most: float = inf
    replaces: str | None = None
    second_order: bool = False
    passive: bool = True


@dataclass(frozen=True)
class WindOnRun:
    """A wind-on run in the fitted model.

    Args:
        spring_stiffness: Kr, N m/rad.
        omega, still_omega: natural frequency with the wind on, and of the same rig in still air, rad/s.
        per_cn_beta, per_cn_r: ½ρV²Al and ½ρVAl², which multiply Cnβ and Cnr, N m and N m s.
    """

    spring_stiffness: float
    omega: float
    still_omega: float
    per_cn_beta: float
    per_cn_r: float


def moment_scale(info: ParameterInfo, campaign: Circumstances) -> float:
    """Factor on a typical value: 10 for a moment in normalised form (per inertia of about 0.1 kg m²), else 1."""
    return 10.0 if campaign.normalised and info.unit.startswith("N m") else 1.0
