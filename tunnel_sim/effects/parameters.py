"""The parameters of effects: dataclass fields with their units, sizes and ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from tunnel_sim.vocabulary.units import angle_power

SWING = 0.3
"""Least swing that the ranges of the parameters are meant for, rad: a release at 20 degrees stays above it."""

LEAST_EXPONENT = 0.25
"""Smallest exponent: below it a term is nearly a jump, which the integration steps do not resolve."""


@dataclass(frozen=True)
class ParameterInfo:
    """One parameter of an effect.

    Args:
        name: field name, also in TOML and JSON.
        symbol: as in the effect's equation.
        unit: SI, angles in rad.
        scale: a typical value for this rig, for steps and starting values.
        lower: least value allowed, in the unit.
        upper: greatest value allowed, in the unit.
        default: value where none is given, in the unit; zero for the severity.
        form: whether it generalises the effect's form; its default gives the textbook form.
        fit_lower: least value a fit of swings from `SWING` on may take, in the unit.
        fit_upper: greatest value a fit of such swings may take, in the unit.
        rate_exponent: name of the parameter that is the power of the rate which it multiplies; empty: none.
        beside_spring: whether only a spring of stated stiffness beside the effect makes it known; else it is held.
        chosen_spring: whether it is the stiffness of one of the campaign's springs: chosen, not fitted.
        per_pressure: whether it multiplies ½ρV²Al, so that its unit depends on which sizes are stated.
    """

    name: str
    symbol: str
    unit: str
    meaning: str
    scale: float
    lower: float
    upper: float
    default: float
    form: bool
    fit_lower: float
    fit_upper: float
    rate_exponent: str
    beside_spring: bool
    chosen_spring: bool
    per_pressure: bool

    def fit_range(self, swing: float) -> tuple[float, float]:
        """Least and greatest value that a fit may take.

        Args:
            swing: largest angle of the motion, rad. Below `SWING` a coefficient per angle may be as much greater,
                and a least angle is as much smaller: the shares of the moments stay as they are.

        Returns:
            Both, in the unit.
        """
        if "rad" not in self.unit or not 0.0 < swing < SWING:
            return self.fit_lower, self.fit_upper
        wider = (SWING / swing) ** -angle_power(self.unit)
        if wider > 1.0:
            return max(self.lower, self.fit_lower * wider), min(self.upper, self.fit_upper * wider)
        least = self.fit_lower * wider if self.unit == "rad" and self.fit_lower > 0.0 else self.fit_lower
        return max(self.lower, least), self.fit_upper


def parameter(
    symbol: str,
    unit: str,
    meaning: str,
    *,
    scale: float,
    lower: float = -math.inf,
    upper: float = math.inf,
    default: float = 0.0,
    form: bool = False,
    fit_lower: float | None = None,
    fit_upper: float | None = None,
    rate_exponent: str = "",
    beside_spring: bool = False,
    chosen_spring: bool = False,
    per_pressure: bool = False,
) -> Any:
    """A dataclass field that is an effect's parameter; arguments as in `ParameterInfo`."""
    metadata = {
        "symbol": symbol,
        "unit": unit,
        "meaning": meaning,
        "scale": scale,
        "lower": lower,
        "upper": upper,
        "form": form,
        "fit_lower": lower if fit_lower is None else fit_lower,
        "fit_upper": upper if fit_upper is None else fit_upper,
        "rate_exponent": rate_exponent,
        "beside_spring": beside_spring,
        "chosen_spring": chosen_spring,
        "per_pressure": per_pressure,
    }
    return field(default=default, metadata=metadata)


def exponent(symbol: str, meaning: str, textbook: float) -> Any:
    """A form parameter that is the exponent of a term; its default is the textbook's.

    Args:
        symbol: as in the effect's equation.
        textbook: exponent of the textbook form, dimensionless.
    """
    return parameter(
        symbol, "1", meaning, scale=1.0, lower=LEAST_EXPONENT, upper=9.0, default=textbook, form=True
    )
