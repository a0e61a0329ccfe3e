"""The traits of an effect: its parameters, its description, and how a fit finds it."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Self, TypeAlias

from tunnel_sim.effects.parameters import (
    DESCRIPTION,
    Circumstances,
    ParameterInfo,
    Trial,
    WindOnRun,
    moment_scale,
)
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import Freedom

Channel = Literal["stiffness", "damping", "forcing", "sensor", "calibration"]
Condition = Literal["always", "wind_on"]
Text: TypeAlias = Callable[[float, float | None, str], str]


@dataclass(frozen=True)
class Traits:
    """The properties that an effect states; the first parameter is the severity.

    Every effect states ``example``, parameter values in order with which the effect is visible. A built-in
    effect also states ``place``, its number in the vocabulary (random draws depend on the order, so a new
    effect takes the next number).

    Traits, with defaults that an effect overrides:

    - ``law_terms``: the parameters of the moment law that correspond to the effect's, in their order; empty:
      none.
    - ``autonomous``: whether its moment and its reading depend on angle and rate alone.
    - ``fitted``: whether a fit of the deterministic motion can find it; else records or spectra show it.
    - ``on_spring``: whether its moment is proportional to the spring's stiffness.
    - ``driven``: whether it acts on driven runs only.
    - ``by_angle_in_room``: whether its moment depends on the body's angle in the room, or on a second inertia:
      neither is included where a base turns with a known acceleration.
    - ``motion``: the only motion that it acts on, at the campaign's own scale and in its units; empty: any motion.
    - ``jumps``: whether its law jumps or has a kink, as dry friction has where the rate changes its sign: an
      integration step across it is less accurate, and the tests allow for this.
    - ``turns``: the parameter that flips sign when the angle origin shifts by π; empty: none.
    - ``tries``: number of starting points of a fit that are worth trying.
    - ``size``: its size in plain words, with the names of parameters in braces; empty: they are listed.
    - ``advice``: the remedy, a clause without its full stop; empty for a user's effect. The name of
      a parameter in braces stands for its value.
    - ``advice_for_joint``: the remedy for the joint of a machine, if it differs.
    - ``caveat``: how to read the coefficients that are reported with it.
    - ``undetected``: how to read the coefficients if it is not named, with ``{size}`` and ``{changes}`` at its
      upper limit; a clause without its full stop.
    """

    name: ClassVar[str]
    place: ClassVar[int]
    channel: ClassVar[Channel]
    condition: ClassVar[Condition]
    equation: ClassVar[str]
    signature: ClassVar[str]
    references: ClassVar[tuple[str, ...]]
    example: ClassVar[tuple[float, ...]]

    law_terms: ClassVar[tuple[str, ...]] = ()
    autonomous: ClassVar[bool] = True
    fitted: ClassVar[bool] = True
    on_spring: ClassVar[bool] = False
    driven: ClassVar[bool] = False
    by_angle_in_room: ClassVar[bool] = False
    motion: ClassVar[str] = ""
    jumps: ClassVar[bool] = False
    turns: ClassVar[str] = ""
    tries: ClassVar[int] = 1
    size: ClassVar[str] = ""
    advice: ClassVar[str] = ""
    advice_for_joint: ClassVar[str] = ""
    caveat: ClassVar[str] = ""
    undetected: ClassVar[str] = "{effect} of up to {size} cannot be excluded and would change {changes}"

    def __post_init__(self) -> None:
        """Refuse a parameter that is not a finite number within its bounds, or not whole where it selects cases."""
        for info in self.parameters():
            value = getattr(self, info.name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and info.lower <= value <= info.upper and abs(value) < math.inf):
                what = f"{info.name} = {value!r} is out of range"
                remedy = f"give a number from {info.lower:g} to {info.upper:g}{beside(info.unit, ' in ')}"
                raise TunnelError(what, where=f"effect {self.name}", remedy=remedy)
            if info.of_input and value != round(value):
                what = f"{info.name} = {value!r} is not a valid case"
                remedy = f"give a whole number from {info.lower:g} to {info.upper:g}"
                raise TunnelError(what, where=f"effect {self.name}", remedy=remedy)

    @classmethod
    @functools.cache
    def parameters(cls) -> tuple[ParameterInfo, ...]:
        """The effect's parameters, the severity first."""
        return tuple(
            dataclasses.replace(own.metadata[DESCRIPTION], name=own.name) for own in dataclasses.fields(cls)
        )

    @classmethod
    def forms(cls) -> tuple[tuple[str, ...], ...]:
        """The general forms, each by the names of its parameters; a fit frees one of them, the first by default."""
        names = tuple(info.name for info in cls.parameters() if info.form)
        return (names,) if names else ()

    @classmethod
    def shown_forms(cls, *, load_varies: bool) -> tuple[tuple[str, ...], ...]:
        """The general forms that the runs can show.

        Args:
            load_varies: whether the moment that the joint carries varies in the runs.
        """
        of_load = {info.name for info in cls.parameters() if info.of_load}
        return tuple(form for form in cls.forms() if load_varies or of_load.isdisjoint(form))

    @classmethod
    def acts(cls, *, wind_on: bool) -> bool:
        """Whether the effect acts in a run with the wind on or off."""
        return wind_on or cls.condition == "always"

    @classmethod
    def possible(cls, freedom: Freedom) -> bool:
        """Whether a body with that freedom can have it: by the air, or by the angle in the room, only some can."""
        return (freedom.windy or cls.condition == "always") and (freedom.turns or not cls.by_angle_in_room)

    @classmethod
    def similar(cls, change: Callable[[float, str], float]) -> type[Self]:
        """The effect of a similar campaign; the sizes of a typical effect are a rig's.

        Args:
            change: from a value and its unit to the value in the similar campaign.
        """
        del change
        return cls

    @property
    def severity(self) -> float:
        """Value of the first parameter, in its unit."""
        return float(getattr(self, self.parameters()[0].name))

    @classmethod
    def per_run_parameters(cls, instants: int) -> tuple[str, ...]:
        """Names of the effect's unknowns in every run, for an effect that has any.

        Args:
            instants: number of instants in a run.
        """
        del instants
        return ()

    @property
    def is_null(self) -> bool:
        """Whether the effect does nothing."""
        return self.severity == 0.0

    @classmethod
    def chosen_spring(cls) -> str | None:
        """Name of the parameter that is a spring's stiffness; None if there is none."""
        return next((info.name for info in cls.parameters() if info.chosen_spring), None)

    @classmethod
    def phrase(cls, values: Mapping[str, float], stds: Mapping[str, float | None], text: Text) -> str:
        """The effect's size in plain words, such as ``dry friction of 0.0040 N m``; empty without ``size``.

        Args:
            values: values of its parameters, in their units.
            stds: standard deviations of the values, in the same units; None where not known.
            text: function that writes a value with its standard deviation and its unit.
        """
        said = cls.size
        for info in cls.parameters():
            if info.name in values:
                shown = text(values[info.name], stds.get(info.name), info.unit)
                said = said.replace(f"{{{info.name}}}", shown)
        return said

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Starting values for a fit.

        Args:
            campaign: circumstances on which the values depend.

        Returns:
            Starting values, the most promising first; empty if such a campaign cannot show the effect.
        """
        severity = cls.parameters()[0]
        return (Trial({severity.name: severity.scale * moment_scale(severity, campaign)}, severity.name),)

    @classmethod
    def small_swings(
        cls, stiffness: float, damping: float, values: Mapping[str, float]
    ) -> tuple[float, float]:
        """Stiffness and damping of a rigid body with the same small swings as the body with the effect.

        Args:
            stiffness: stiffness without the effect, per unit inertia, 1/s².
            damping: damping without the effect, per unit inertia, 1/s.
            values: the effect's parameters by name, per unit inertia.
        """
        del values
        return stiffness, damping

    def plausible(self, omega: float, duration: float, readings: tuple[float, float]) -> bool:
        """Whether a fitted effect still deserves its name, and a record can show it.

        Args:
            omega: angular frequency of the motion, rad/s.
            duration: duration of the record, s.
            readings: least and greatest reading of the campaign, in the unit of the reading.

        Returns:
            False if its parameters make it part of the motion itself, or another effect.
        """
        del omega, duration, readings
        return True

    def alike(self) -> Sequence[Trial]:
        """Other values of its parameters with the same effect on the slow motion.

        Returns:
            Values, including the parameter that linear theory may scale; χ² may have another minimum near any
            of them. Empty if there is only one minimum.
        """
        return ()

    @property
    def stiffness_at_rest(self) -> float:
        """Stiffness that the effect adds to the rig at rest, N m/rad: 0 unless it acts as a spring."""
        return 0.0

    def unseen_form(self, cn_beta: float, runs: Sequence[WindOnRun]) -> tuple[float, float]:
        """Uncertainty of Cnβ and Cnr due to the part of the effect's form that free decays do not show.

        Args:
            cn_beta: Cnβ as fitted, 1/rad.
            runs: the campaign's wind-on runs.

        Returns:
            Standard deviations of Cnβ and Cnr, 1/rad.
        """
        del cn_beta, runs
        return 0.0, 0.0
