"""Effects whose moment or reading is stated as an expression, in Python or in a TOML file."""

from __future__ import annotations

import keyword
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.capabilities import ReadingEffect
from tunnel_sim.effects.parameters import Circumstances, ParameterInfo, Trial, moment_scale, parameter
from tunnel_sim.effects.traits import Channel, Condition
from tunnel_sim.physics.expression import FUNCTIONS, Expression, parse
from tunnel_sim.physics.run_settings import RunSettings, SettingsTable
from tunnel_sim.vocabulary.dimensions import dimension, in_si
from tunnel_sim.vocabulary.errors import TunnelError, shown
from tunnel_sim.vocabulary.freedom import FREEDOMS, Motion
from tunnel_sim.vocabulary.record import Array

#: Variables of a run: unit, and operation of the moment law.
_INPUTS = {"b": ("rad", "angle"), "r": ("rad/s", "rate"), "t": ("s", "time"), "V": ("m/s", "speed")}
_OF_RUN = {"Kr": "N m/rad", "omega": "1/s"}
_MOMENT = frozenset({*_INPUTS, *_OF_RUN})
_READING = frozenset({"y", "t", "V", *_OF_RUN})
_UNITS = {name: unit for name, (unit, _) in _INPUTS.items()} | _OF_RUN | {"y": "rad"}
_WORDS = frozenset({*_UNITS, *FUNCTIONS, "pi"})

#: Test values for a stated expression: the range of rigs that the diagnosis supports.
_TRIED = {"b": 0.5, "y": 0.5, "r": 10.0, "t": 20.0, "V": 40.0, "Kr": 100.0, "omega": 60.0}


@dataclass(frozen=True)
class ExpressionParameter:
    """A parameter of an effect by expression.

    Args:
        unit: as `tunnel_sim.vocabulary.dimensions.dimension` reads it.
        scale, lower, upper, default: a typical value, its bounds, and the value if none is given, in the unit.
    """

    unit: str
    scale: float
    lower: float
    upper: float
    default: float
    meaning: str


@dataclass(frozen=True)
class ExpressionEffect(Effect):
    """Base of the effects by expression; `expression_effect` makes the classes."""

    formula: ClassVar[Expression]
    tries = 2

    @classmethod
    def similar(cls, change: Callable[[float, str], float]) -> type[Self]:
        """The effect with the sizes of the similar campaign, where those of the file are the campaign's own."""
        if not cls.motion:
            return cls
        sizes = {info.name: [change(size, info.unit) for size in _sizes(info)] for info in cls.parameters()}
        fields = [_field(info.name, info.unit, info.meaning, sizes[info.name]) for info in cls.parameters()]
        (first, *_), *others = sizes.values()
        seen = {"example": (first, *(default for *_, default in others))}
        return make_dataclass(cls.__name__, fields, bases=(cls,), namespace=seen, frozen=True)

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """The severity's typical size, with the other parameters at their defaults and on both sides of them."""
        severity, *others = cls.parameters()
        start = {severity.name: severity.scale * moment_scale(severity, campaign)}
        start |= {info.name: info.default for info in others}
        aside = [
            {info.name: math.copysign(math.sqrt(info.default * bound), info.default)}
            for info in others
            for bound in (info.lower, info.upper)
            if info.default * bound > 0.0
        ]
        return [Trial(start | moved, severity.name) for moved in ({}, *aside)]

    def _constants(self, stated: RunSettings) -> dict[str, float]:
        """The constants of a run, by name."""
        own = {info.name: float(getattr(self, info.name)) for info in self.parameters()}
        spring = stated.spring_stiffness
        return own | {"Kr": spring, "omega": math.sqrt(spring / stated.yaw_inertia)}

    def _acts(self, stated: RunSettings) -> bool:
        windy = stated.wind_speed > 0.0 or "wind_speed" in stated.series
        return not self.is_null and (self.condition == "always" or windy)


class _Moment(ExpressionEffect):
    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Add the moment to the programs of the runs."""
        del drawn
        inputs = {name: operation for name, (_, operation) in _INPUTS.items()}
        for place, effect in enumerate(effects):
            run = stated.row(place)
            if cls._acts(effect, run):
                runs.add_moment(place, cls.formula.program(cls._constants(effect, run), inputs))

    def moment_oracle(self, stated: RunSettings) -> Callable[[float, float, float], float]:
        """The moment by NumPy, without the compiled law."""
        constants = self._constants(stated) | {"V": stated.wind_speed}

        def moment(t: float, angle: float, rate: float) -> float:
            return float(self.formula.value(constants | {"t": t, "b": angle, "r": rate}))

        return moment if self._acts(stated) else lambda *_: 0.0


class _Reading(ExpressionEffect, ReadingEffect):
    def on_angle(self, angle: Array, time_s: Array, stated: RunSettings, drawn: Drawn) -> Array:
        """Apply the characteristic of the reading."""
        del drawn
        if not self._acts(stated):
            return angle
        moving: dict[str, float | Array] = {"y": angle, "t": time_s, "V": stated.wind_speed}
        return np.broadcast_to(self.formula.value(moving | self._constants(stated)), angle.shape)


def expression_effect(
    name: str,
    *,
    channel: Channel,
    parameters: Mapping[str, ExpressionParameter],
    condition: Condition = "always",
    moment: str | None = None,
    reading: str | None = None,
    summary: str = "",
    motion: Motion | None = None,
) -> type[Effect]:
    """An effect whose moment or reading is an expression; the class is not registered.

    Its first parameter is the severity. The effect is refused if it acts at its null, does nothing beyond it or
    has no value somewhere.

    Args:
        moment: on the right-hand side of the equation of motion, N m; a function of the angle ``b`` (rad) and rate
            ``r`` (rad/s) of the rod's upper end, the time ``t`` (s) since the run's start, the wind speed ``V``
            (m/s), the stated stiffness ``Kr`` (N m/rad), ``omega`` = √(Kr/Izz) (rad/s) and the parameters.
        reading: rad; a function of ``y`` (rad), the reading without the effect, of ``t``, ``V``, ``Kr`` and
            ``omega`` as above and of the parameters.
        motion: which the effect is of; of a displacement, ``b``, ``r``, ``y`` and ``Kr`` are in m, m/s, m and N/m,
            a moment in N, and the parameters in units of these. With it the sizes of parameters are those of the
            campaign that is diagnosed, and without it those of a rig of 2 Hz and 16 N m/rad. None: an angle.
    """
    freedom = FREEDOMS[motion or "angle"]
    text = moment if reading is None else reading
    if text is None or (moment is not None and reading is not None):
        raise TunnelError("does not state exactly one of moment and reading", remedy="state one of them")
    if (channel == "sensor") != (reading is not None):
        raise TunnelError(f"channel {channel!r} is not for a {'moment' if reading is None else 'reading'}",
                          remedy="use sensor for a reading, and another channel for a moment")  # fmt: skip
    _check_names(parameters)
    formula = parse(text, frozenset(parameters) | (_MOMENT if reading is None else _READING))
    expected = freedom.unit("N m" if reading is None else "rad")
    units = {symbol: freedom.unit(unit) for symbol, unit in _UNITS.items()} | {
        symbol: quantity.unit for symbol, quantity in parameters.items()
    }
    found = formula.dimension({symbol: dimension(unit) for symbol, unit in units.items()})
    if found != dimension(expected):
        what = f"{text!r} is in {in_si(found)}, not in {expected} ({in_si(dimension(expected))})"
        raise TunnelError(what, remedy="correct the expression or the units of its parameters")
    unused = [symbol for symbol in parameters if symbol not in formula.names]
    if unused:
        raise TunnelError(f"parameter {unused[0]} is not in {text!r}", remedy="use it or leave it out")
    # refused if it acts at its null, does nothing beyond it or has no value somewhere
    null = "0" if reading is None else "y"
    rng = np.random.default_rng(0)
    tried = {key: top * rng.uniform(-1.0, 1.0, 200) for key, top in _TRIED.items()}
    tried |= {key: np.abs(tried[key]) for key in ("t", "V", "Kr", "omega")}
    for key in ("b", "r", "y", "t", "V"):
        tried[key][:: 7 + len(key) + ord(key[0]) % 5] = 0.0
    at = {key: quantity.default for key, quantity in parameters.items()}
    severity, size = next((key, quantity.scale) for key, quantity in parameters.items())
    without = tried["y"] if null == "y" else 0.0
    at_null, beyond = (formula.value({**tried, **at, **more}) for more in ({}, {severity: size}))
    if not np.all(np.isfinite(at_null) & np.isfinite(beyond)):
        remedy = "avoid division by zero, and roots and logarithms of negative numbers"
        fault = f"{formula.text!r} has no finite value somewhere in the motion of a rig"
        raise TunnelError(fault, remedy=remedy)
    if np.any(np.abs(at_null - without) > 1e-12):
        remedy = "write it so that the first parameter, the severity, removes the effect"
        raise TunnelError(f"{formula.text!r} is not {null} at {severity} = 0", remedy=remedy)
    if np.all(np.abs(beyond - without) <= 1e-300):
        raise TunnelError(f"{formula.text!r} does nothing", remedy="correct the expression or the scale")
    fields = [
        _field(symbol, freedom.angle_unit(q.unit), q.meaning, _sizes(q)) for symbol, q in parameters.items()
    ]
    first, *others = parameters.values()
    namespace: dict[str, Any] = {
        "name": name,
        "channel": channel,
        "condition": condition,
        "equation": f"{'moment' if reading is None else 'reading'} {text}",
        "signature": "That of its expression.",
        "references": (),
        "example": (first.scale, *(q.default for q in others)),
        "autonomous": "t" not in formula.names,
        "formula": formula,
        "motion": "" if motion is None else motion,
        "__doc__": summary or "An effect by expression.",
    }
    base = _Moment if reading is None else _Reading
    return make_dataclass(name, fields, bases=(base,), namespace=namespace, frozen=True)


def _sizes(of: ExpressionParameter | ParameterInfo) -> tuple[float, float, float, float]:
    """Typical value, bounds and default of a parameter, in its unit."""
    return of.scale, of.lower, of.upper, of.default


def _field(symbol: str, unit: str, meaning: str, sizes: Iterable[float]) -> tuple[str, type, Any]:
    """A field of an effect's class, with the sizes of `_sizes`."""
    scale, lower, upper, default = sizes
    described = parameter(symbol, unit, meaning, scale=scale, lower=lower, upper=upper, default=default)
    return symbol, float, described


def _check_names(parameters: Mapping[str, ExpressionParameter]) -> None:
    for name, quantity in parameters.items():
        if not (name.isidentifier() and name.isascii()) or keyword.iskeyword(name):
            raise TunnelError(f"{name!r} is not a parameter's name", remedy="use letters, digits and _")
        if name in _WORDS or hasattr(_Moment, name) or hasattr(_Reading, name):
            remedy = "choose a name that has no other meaning"
            raise TunnelError(f"a parameter cannot be named {name!r}", remedy=remedy)
        if not all(quantity.lower <= value <= quantity.upper for value in (quantity.default, quantity.scale)):
            raise TunnelError(
                f"parameter {name}: the default {quantity.default:g} or the scale {quantity.scale:g} is not from "
                f"{quantity.lower:g} to {quantity.upper:g}",
                remedy="correct lower, upper, scale or default",
            )
        if quantity.scale == 0.0:
            remedy = "state a typical value as the scale"
            raise TunnelError(f"parameter {name}: the scale is 0", remedy=remedy)
    severity = next(iter(parameters.values()), None)
    if severity is None or severity.default != 0.0:
        remedy = "give it the default 0, which removes the effect"
        raise TunnelError("the first parameter is not a severity", remedy=remedy)


def read_effects(path: Path) -> tuple[type[Effect], ...]:
    """The effects of an effects file (docs/how-to/add-an-effect.md) in its order; they are not registered."""
    from tunnel_sim.files.plan_file import EffectsDocument  # imported here because it is slow to load
    from tunnel_sim.files.toml_input import load_toml, validate

    missing = "name an effects file; docs/how-to/add-an-effect.md has an example"
    document = validate(EffectsDocument, load_toml(path, missing=missing), path)
    tables = document.effects
    names = [table.name for table in tables]
    effects = []
    for table in tables:
        where = f"{shown(path)}, effect '{table.name}'"
        if names.count(table.name) > 1:
            raise TunnelError("is given twice", where=where, remedy="give every effect its own name")
        try:
            quantities: dict[str, ExpressionParameter] = {}
            for name, given in table.parameters.items():
                usual = given.scale if quantities else 0.0  # the first parameter is the severity
                default = usual if given.default is None else given.default
                meaning = given.meaning or f"parameter {name}"
                sizes = (given.scale, given.lower, given.upper, default)
                quantities[name] = ExpressionParameter(given.unit, *sizes, meaning)
            stated = {
                key: getattr(table, key) for key in ("channel", "condition", "moment", "reading", "summary")
            }
            stated["motion"] = document.motion
            effects.append(expression_effect(table.name, parameters=quantities, **stated))
        except TunnelError as error:
            raise TunnelError(error.what, where=where, remedy=error.remedy) from error
    return tuple(effects)
