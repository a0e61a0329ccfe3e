"""What an effect is: parameters with units, and hooks where it acts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, cast

import numpy as np

from tunnel_sim.errors import TunnelError, did_you_mean
from tunnel_sim.plan import SensorModel
from tunnel_sim.record import Array
from tunnel_sim.run_settings import RunSettings

REFERENCE_SPEED = 20.0
"""m/s: where forms that depend on the speed agree with the textbook's."""

LEAST_EXPONENT = 0.25
"""Below it a term is nearly a jump, which the integration's steps do not resolve."""

Channel = Literal["stiffness", "damping", "forcing", "sensor", "calibration"]
Condition = Literal["always", "wind_on"]


@dataclass(frozen=True)
class ParameterInfo:
    """What is known of one parameter of an effect.

    Args:
        name: field name, also in TOML and JSON.
        symbol: as in the effect's equation.
        unit: SI, rad.
        meaning: one clause.
        scale: a size typical of this rig, for steps and starting values.
        lower: least value allowed, in the unit.
        upper: greatest value allowed, in the unit.
        default: value where none is given, in the unit; for the severity this is the null.
        form: whether it bends the effect's textbook form, which its default is.
    """

    name: str
    symbol: str
    unit: str
    meaning: str
    scale: float
    lower: float
    upper: float
    default: float
    form: bool = False


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
    }
    return dataclasses.field(default=default, metadata=metadata)


def exponent(symbol: str, meaning: str, textbook: float) -> Any:
    """A field that is the power of a term, whose textbook value it has by default.

    Args:
        symbol: as in the effect's equation.
        meaning: one clause.
        textbook: the power of the textbook's form.

    Returns:
        A form parameter.
    """
    return parameter(
        symbol, "1", meaning, scale=1.0, lower=LEAST_EXPONENT, upper=9.0, default=textbook, form=True
    )


@dataclass(frozen=True)
class Effect:
    """An effect the nominal model leaves out. Its first parameter is the severity, whose null is zero.

    The hooks are identities unless an effect overrides them, and at the null every one of them is. ``stated``
    is the run as the campaign states it, before any effect.
    """

    name: ClassVar[str]
    channel: ClassVar[Channel]
    condition: ClassVar[Condition]
    equation: ClassVar[str]
    signature: ClassVar[str]
    references: ClassVar[tuple[str, ...]]
    stochastic: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check every parameter.

        Raises:
            TunnelError: when one is not a finite number within its bounds.
        """
        for info in self.parameters():
            value = getattr(self, info.name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and info.lower <= value <= info.upper and abs(value) < math.inf):
                raise TunnelError(
                    f"{info.name} = {value!r} is out of range",
                    where=f"effect {self.name}",
                    remedy=f"give a number from {info.lower:g} to {info.upper:g} in {info.unit}",
                )

    @classmethod
    def parameters(cls) -> tuple[ParameterInfo, ...]:
        """The effect's parameters, the severity first."""
        return tuple(
            ParameterInfo(name=field.name, default=cast(float, field.default), **field.metadata)
            for field in dataclasses.fields(cls)
        )

    @property
    def severity(self) -> float:
        """Value of the first parameter, in its unit."""
        return float(getattr(self, self.parameters()[0].name))

    @property
    def is_null(self) -> bool:
        """Whether the effect does nothing."""
        return self.severity == 0.0

    def on_run(self, run: RunSettings, stated: RunSettings, rng: np.random.Generator) -> RunSettings:
        """Change the physics of a run.

        Args:
            run: as left by the effects before.
            stated: the run as the campaign states it.
            rng: for what the run draws at random.

        Returns:
            The changed physics.
        """
        del stated, rng
        return run

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, rng: np.random.Generator) -> Array:
        """Change what the sensor sees before its zero and noise.

        Args:
            angle: of the rod's upper end, rad, shape (n,).
            time_s: s, shape (n,).
            stated: the run as the campaign states it.
            rng: for what the run draws at random.

        Returns:
            The changed angle, rad, shape (n,).
        """
        del time_s, stated, rng
        return angle

    def on_sensor(self, sensor: SensorModel) -> SensorModel:
        """Change the sensor itself.

        Args:
            sensor: as stated.

        Returns:
            The true one.
        """
        return sensor

    def on_reading(self, reading: Array) -> Array:
        """Change the reading after noise and before conversion.

        Args:
            reading: rad, shape (n,).

        Returns:
            The changed reading, rad, shape (n,).
        """
        return reading

    def to_json_dict(self) -> dict[str, Any]:
        """Name and parameters as JSON's types."""
        return {
            "name": self.name,
            "parameters": {info.name: getattr(self, info.name) for info in self.parameters()},
        }


def make_effect(kind: type[Effect], parameters: Mapping[str, float]) -> Effect:
    """An effect from named parameters.

    Args:
        kind: the effect's class.
        parameters: by name, in their units.

    Returns:
        The effect.

    Raises:
        TunnelError: when a name is unknown or a value out of range.
    """
    known = [info.name for info in kind.parameters()]
    for name in parameters:
        if name not in known:
            raise TunnelError(
                f"unknown parameter {name!r}", where=f"effect {kind.name}", remedy=did_you_mean(name, known)
            )
    return kind(**parameters)


def with_law(run: RunSettings, **values: float) -> RunSettings:
    """A run with parameters of the moment law added.

    Args:
        run: the run's physics.
        **values: parameters of the law by name.

    Returns:
        The changed run.
    """
    return dataclasses.replace(run, parameters={**run.parameters, **values})
