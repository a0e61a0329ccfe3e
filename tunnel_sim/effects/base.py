"""What an effect is: parameters with units, hooks where it acts, and traits that say how it is found."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, TypeAlias, cast

import numpy as np

from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import SensorModel
from tunnel_sim.vocabulary.record import Array

REFERENCE_SPEED = 20.0
"""m/s: where forms that depend on the speed agree with the textbook's."""

LEAST_EXPONENT = 0.25
"""Below it a term is nearly a jump, which the integration's steps do not resolve."""

SPRING_TOLERANCE = 1e-6
"""Two stiffnesses closer than this, relative to them, are of one spring."""

Channel = Literal["stiffness", "damping", "forcing", "sensor", "calibration"]
Condition = Literal["always", "wind_on"]

#: What a run draws at random for an effect: nothing, a phase in rad, or random numbers, shape (n,).
Drawn: TypeAlias = float | Array | None


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
        form: whether it changes the effect's textbook form, which its default is.
        fit_lower: least value a fit may take, in the unit.
        fit_upper: greatest value a fit may take, in the unit.
        chosen_spring: whether it names one of the campaign's springs, so that it is chosen and not fitted.
        per_pressure: whether it multiplies ½ρV²Al, so that its unit depends on which sizes are stated.
        per_stiffness: whether it multiplies the spring's stiffness.
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
    chosen_spring: bool
    per_pressure: bool
    per_stiffness: bool


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
    chosen_spring: bool = False,
    per_pressure: bool = False,
    per_stiffness: bool = False,
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
        "chosen_spring": chosen_spring,
        "per_pressure": per_pressure,
        "per_stiffness": per_stiffness,
    }
    return field(default=default, metadata=metadata)


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
class Circumstances:
    """What of a campaign decides where the fit of an effect starts.

    Args:
        springs: stated stiffnesses, ascending, N m/rad.
        greatest_reading: greatest absolute reading of any run, rad.
        normalised: whether runs are fitted per unit inertia.
    """

    springs: tuple[float, ...]
    greatest_reading: float
    normalised: bool


@dataclass(frozen=True)
class Trial:
    """Parameter values from which an effect may be fitted.

    Args:
        values: by name; the others start at their defaults.
        scaled: name of the one whose size linear theory sets; None where the values are taken as they are.
    """

    values: Mapping[str, float]
    scaled: str | None


@dataclass(frozen=True)
class WindOnRun:
    """A wind-on run in the fitted model.

    Args:
        spring_stiffness: Kr, N m/rad.
        omega: natural frequency with the wind on, rad/s.
        still_omega: natural frequency of the same rig in still air, rad/s.
        per_cn_beta: ½ρV²Al, which multiplies Cnβ, N m.
        per_cn_r: ½ρVAl², which multiplies Cnr, N m s.
    """

    spring_stiffness: float
    omega: float
    still_omega: float
    per_cn_beta: float
    per_cn_r: float


@dataclass(frozen=True)
class Effect:
    """An effect the nominal model leaves out. Its first parameter is the severity, whose null is zero.

    The hooks are identities unless an effect overrides them, and at the null every one of them is. ``stated``
    is the run as the campaign states it, before any effect; ``drawn`` is what `draw` gave for the run.

    Every effect states ``place``, its number in the vocabulary (random draws depend on the order, so a new effect
    takes the next), and ``example``, values of its parameters, in their order, at which it is seen.

    An effect overrides the traits that do not fit it:

    - ``random``: what a random moment's spectrum is like; empty where the effect is deterministic. A vortex
      street is both: its phase may be steady or wander.
    - ``line``: what sets the frequency of a periodic effect, which has a phase of its own in every run.
    - ``skips``: whether samples are missing, at an instant of its own in every run (a share of the run's length):
      the motion is read at other times than stated.
    - ``fitted``: whether a fit of the deterministic motion can find it. What is not fitted is read off the
      records (``line``, ``lattice``) or found by its spectrum (``random``).
    - ``lattice``: whether it is the step of the readings.
    - ``remembers``: whether a reading depends on the samples before it.
    - ``ahead_of_sensor``: whether it sits between the rod and the sensor, ahead of what the sensor does.
    - ``exact``: whether it is a factor on a stated number, so that its form cannot differ from the textbook's.
    - ``tries``: how many starting points of a fit are worth trying.
    - ``regressed_at``: parameters that a regression of moments must hold, with their values.
    - ``caveat``: what to bear in mind on reading the coefficients beside it.
    """

    name: ClassVar[str]
    place: ClassVar[int]
    channel: ClassVar[Channel]
    condition: ClassVar[Condition]
    equation: ClassVar[str]
    signature: ClassVar[str]
    references: ClassVar[tuple[str, ...]]
    example: ClassVar[tuple[float, ...]]

    random: ClassVar[Literal["", "broad_band", "narrow_band"]] = ""
    line: ClassVar[Literal["", "mains", "shedding", "ringing"]] = ""
    skips: ClassVar[bool] = False
    fitted: ClassVar[bool] = True
    lattice: ClassVar[bool] = False
    remembers: ClassVar[bool] = False
    ahead_of_sensor: ClassVar[bool] = False
    exact: ClassVar[bool] = False
    tries: ClassVar[int] = 1
    regressed_at: ClassVar[Mapping[str, float]] = {}
    caveat: ClassVar[str] = ""

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
            ParameterInfo(name=own.name, default=cast(float, own.default), **own.metadata)
            for own in dataclasses.fields(cls)
        )

    @property
    def severity(self) -> float:
        """Value of the first parameter, in its unit."""
        return float(getattr(self, self.parameters()[0].name))

    @property
    def is_null(self) -> bool:
        """Whether the effect does nothing."""
        return self.severity == 0.0

    @classmethod
    def chosen_spring(cls) -> str | None:
        """Name of the parameter that is one of the campaign's springs; None where there is none."""
        return next((info.name for info in cls.parameters() if info.chosen_spring), None)

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Values from which a fit may start.

        Args:
            campaign: what the values depend on.

        Returns:
            Trials; none where such a campaign cannot show the effect.
        """
        severity = cls.parameters()[0]
        return (Trial({severity.name: severity.scale * moment_scale(severity, campaign)}, severity.name),)

    @classmethod
    def regressor(cls, angle: Array, rate: Array, spring: float) -> Array | None:
        """The moment per unit of the first parameter, for a regression of the balance of moments.

        Args:
            angle: rad, shape (n,).
            rate: rad/s, shape (n,).
            spring: stiffness that the moment is proportional to where it is ``per_stiffness``, N m/rad.

        Returns:
            N m per unit, shape (n,); None where the moment is not linear in the first parameter.
        """
        del angle, rate, spring
        return None

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """What of the effect's form no free decay shows, and Cnβ and Cnr take up.

        Args:
            cn_beta: Cnβ as fitted, 1/rad.
            runs: the campaign's wind-on runs.

        Returns:
            Standard deviations of Cnβ and Cnr from it, 1/rad.
        """
        del cn_beta, runs
        return 0.0, 0.0

    def draw(self, stated: RunSettings, rng: np.random.Generator) -> Drawn:
        """Draw what is random in one run.

        Args:
            stated: the run as the campaign states it.
            rng: of this effect in this run.

        Returns:
            What the hooks take as ``drawn``.
        """
        del stated
        return float(rng.uniform(0.0, 2.0 * np.pi)) if self.line else None

    def law(self) -> Mapping[str, float]:
        """Parameters of the moment law by name: an effect that is a term of the law has no other hook."""
        return {}

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Change the physics of a run: by default, set the effect's terms of the moment law.

        Args:
            run: as left by the effects before.
            stated: the run as the campaign states it.
            drawn: what the run drew.

        Returns:
            The changed physics.
        """
        del stated, drawn
        law = self.law()
        return with_law(run, **law) if law else run

    def on_time(self, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Change when the motion is read.

        Args:
            time_s: by the time stamps, s, shape (n,).
            stated: the run as the campaign states it.
            drawn: what the run drew.

        Returns:
            The true times, s, shape (n,).
        """
        del stated, drawn
        return time_s

    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Change what the sensor sees before its zero and noise.

        Args:
            angle: of the rod's upper end, rad, shape (n,).
            time_s: true times, s, shape (n,).
            stated: the run as the campaign states it.
            drawn: what the run drew.

        Returns:
            The changed angle, rad, shape (n,).
        """
        del time_s, stated, drawn
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


def moment_scale(info: ParameterInfo, campaign: Circumstances) -> float:
    """Factor on a typical size where moments are per unit inertia, which is of the order of 0.1 kg m².

    Args:
        info: the parameter.
        campaign: whether runs are normalised.

    Returns:
        10 for a moment in normalised form, else 1.
    """
    return 10.0 if campaign.normalised and info.unit.startswith("N m") else 1.0


def with_law(run: RunSettings, **values: float) -> RunSettings:
    """A run with parameters of the moment law added.

    Args:
        run: the run's physics.
        **values: parameters of the law by name.

    Returns:
        The changed run.
    """
    return dataclasses.replace(run, parameters={**run.parameters, **values})
