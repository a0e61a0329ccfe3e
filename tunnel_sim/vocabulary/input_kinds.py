"""The kinds of input of a driven run: their meaning, their effect on the body, and a run's statements on them.

A kind is one type; the columns of run files, imports, plans, fits and plots come from its fields. The moment
on the body is on the right-hand side of Izz β̈ + C β̇ + K β = M, with M and β positive in the same direction.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING, ClassVar, Literal, overload

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.record import Array  # commands answer before NumPy is loaded

InputColumn = Literal[
    "moment_nm", "drive", "base_rad", "command_rad", "base_acceleration_rad_s2", "base_acceleration_m_s2"
]
"""The columns of a run file that may hold its input, as described by `INPUTS`."""

_MOMENTS = ("nm", "n m", "n-m", "n*m", "n·m", "newton metre", "newton meter", "n_m")
_BASE = re.compile(r"(?<![a-z])(base|root)(?![a-z])", re.IGNORECASE)
_SHAKEN = re.compile(r"(?<![a-z])(base|root|table|floor|ground|shaker|platform)(?![a-z])", re.IGNORECASE)
_ACCELERATION = re.compile(r"(?<![a-z])(acc|accel|acceleration|beschleunigung)(?![a-z])", re.IGNORECASE)
_ANGLES: Mapping[str, float] = {
    "rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0, "gon": pi / 200.0, "turns": 2.0 * pi,
}  # fmt: skip
_TURNING: Mapping[str, float] = {"rad/s2": 1.0, "deg/s2": pi / 180.0}
_COMMAND = re.compile(
    r"(?i)(?<![a-z])(goal|target|set[ _]?point|soll(wert|winkel|position|lage)?|desired|des|ref|reference|"
    r"demand(ed)?|commanded|(command|cmd)(?=[ _]*[a-zθψφβ])|(?<=[a-zθψφβ][ _])(command|cmd|sp|set))(?![a-z])"
    r"|^(goal|target|desired|ref|cmd)(pos|position|angle|yaw|theta|q)(?![a-z])|(?<![a-z])q(des|ref|cmd)(?![a-z])"
)
_NOT_ANGLE = re.compile(
    r"(?i)vel|speed|rate|gyro|omega|dot|acc|torque|moment|effort|tau|current|force|volt|pwm|duty|power|wind|tunnel|"
    r"temp|press|flow|fan|load|kp|kd|ki|gain|time|mass"
)
_JOINED = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_G = 9.80665  # m/s², standard gravity, the unit of accelerometers
_ALONG: Mapping[str, float] = {"m/s2": 1.0, "mm/s2": 1e-3, "cm/s2": 1e-2, "g": _G, "mg": 1e-3 * _G}
_PLAIN = str.maketrans({"²": "2", "^": None, "_": "/", " ": None})


@dataclass(frozen=True)
class KnownGain:
    """The gain of an input over the inertia, if the motion alone determines it: per_stiffness · k + constant.

    Args:
        per_stiffness: rad/s² per unit of the input, for each 1/s² of stiffness over the inertia.
        constant: rad/s² per unit of the input.
    """

    per_stiffness: float = 0.0
    constant: float = 0.0

    @overload
    def at(self, stiffness: float) -> float: ...
    @overload
    def at(self, stiffness: Array) -> Array: ...
    def at(self, stiffness: float | Array) -> float | Array:
        """The gain, rad/s² per unit of the input, for a stiffness over the inertia in 1/s², of any shape."""
        return self.per_stiffness * stiffness + self.constant


class InputKind:
    """A kind of input.

    Traits, with defaults that a kind overrides:

    - ``column``: its column in a run file; ``unit``: unit of its values.
    - ``meaning``: its description, a clause of an import; ``noun``: a word for it on an axis.
    - ``of_spring``: whether it acts through the spring, and its gain is the spring's stiffness.
    - ``of_base``: whether the base is shaken: the reading is relative to it, and inertial forces act.
    - ``by_inertia``: whether its gain is the body's inertia, with the sign of ``scale``.
    - ``by_actuator``: whether it is the demand on an actuator with a lag and limits that change the moment.
    - ``takes_gain``: whether a run may state ``drive_gain``; if it does not, the gain is fitted.
    - ``keys``: which of ``drive_gain`` and ``servo_kv`` a run may state.
    - ``scale``: N m per unit; for an input that takes a gain, the factor on the gain.
    - ``amplitudes``: the key of a plan for its peaks; empty: no plan has it.
    - ``units``: its possible units in a file, with their factors.
    """

    column: ClassVar[InputColumn]
    unit: ClassVar[str]
    meaning: ClassVar[str]
    noun: ClassVar[str]
    of_spring: ClassVar[bool] = False
    of_base: ClassVar[bool] = False
    by_inertia: ClassVar[bool] = False
    by_actuator: ClassVar[bool] = False
    takes_gain: ClassVar[bool] = False
    keys: ClassVar[tuple[str, ...]] = ()
    scale: ClassVar[float] = 1.0
    amplitudes: ClassVar[str] = ""
    units: ClassVar[Mapping[str, float]] = {}

    def gain(self, stated: float | None, spring_stiffness: float | None) -> float | None:
        """The moment on the body per unit, N m; None if it is not known.

        Args:
            stated: ``drive_gain`` of the run, N m per unit; None if it states none.
            spring_stiffness: Kr, N m/rad; None if the run states none.
        """
        del stated, spring_stiffness
        return self.scale

    def true_scale(self, gain: float, spring_stiffness: float, inertia: float) -> float:
        """The moment on the body per unit in a simulated run, N m.

        Args:
            gain: gain of an input for which the run states none, N m per unit.
            spring_stiffness: Kr, N m/rad.
            inertia: Izz, kg m².
        """
        del gain, spring_stiffness, inertia
        return self.scale

    def known_gain(self, *, windy: bool) -> KnownGain | None:
        """The gain over the inertia, if it needs neither an inertia nor a stated gain; else None.

        Args:
            windy: whether the wind blows, which adds to the stiffness.
        """
        del windy
        return None

    def holds(self, name: str, unit: str) -> bool:
        """Whether a column with this name and unit is an input of this kind."""
        heading = f"{name.strip()}_{unit}" if unit else name.strip()
        return heading.lower().replace("/", "_") == self.column

    def factor(self, unit: str) -> float:
        """From a unit of a file to the column's unit; 1 for an unknown unit."""
        return self.units.get(unit, 1.0)


class Moment(InputKind):
    """A known moment on the body."""

    column = "moment_nm"
    unit = "N m"
    meaning = "a known moment in N m"
    noun = "moment"
    by_actuator = True
    amplitudes = "amplitudes_nm"

    def holds(self, name: str, unit: str) -> bool:
        """Whether the column's name is of this kind, or its unit is a unit of moment."""
        return super().holds(name, unit) or unit.strip().lower() in _MOMENTS


class _OfGain(InputKind):
    """An input with a gain that a run may state."""

    takes_gain = True
    keys = ("drive_gain",)

    def gain(self, stated: float | None, spring_stiffness: float | None) -> float | None:
        """The gain stated by the run."""
        del spring_stiffness
        return None if stated is None else self.scale * stated

    def true_scale(self, gain: float, spring_stiffness: float, inertia: float) -> float:
        """The gain that the run does not state."""
        del spring_stiffness, inertia
        return self.scale * gain


class Unscaled(_OfGain):
    """An input in any unit; moment = gain · input."""

    column = "drive"
    unit = "units"
    meaning = "an input of unknown gain"
    noun = "input"
    by_actuator = True


class _OfSpring(InputKind):
    """An angle of the spring's other end; moment = Kr · input, in addition to −Kr β."""

    unit = "rad"
    of_spring = True
    units = _ANGLES

    def gain(self, stated: float | None, spring_stiffness: float | None) -> float | None:
        """The spring's stiffness."""
        del stated
        return spring_stiffness

    def true_scale(self, gain: float, spring_stiffness: float, inertia: float) -> float:
        """The spring's stiffness."""
        del gain, inertia
        return spring_stiffness

    def known_gain(self, *, windy: bool) -> KnownGain | None:
        """The stiffness of the motion, which equals the spring's if the air adds none."""
        return None if windy else KnownGain(per_stiffness=1.0)


class Root(_OfSpring):
    """The angle of the spring's root, which moves while the sensor is fixed."""

    column = "base_rad"
    meaning = "the angle of the spring's root"
    noun = "root"
    amplitudes = "amplitudes_rad"

    def holds(self, name: str, unit: str) -> bool:
        """An angle of a base or a root."""
        return unit in _ANGLES and (super().holds(name, unit) or _BASE.search(name) is not None)


class Command(_OfSpring):
    """The angle command of a position servo: a spring from there to the body, and a damper."""

    column = "command_rad"
    meaning = "the command of a position servo"
    noun = "command"
    keys = ("servo_kv",)

    def holds(self, name: str, unit: str) -> bool:
        """An angle that a name calls a goal, a target, a reference or the like; also in the unit of the reading."""
        if super().holds(name, unit):
            return True
        words = _JOINED.sub("_", name)
        angle = unit in ("", "counts", *_ANGLES) and _NOT_ANGLE.search(words) is None
        return angle and _COMMAND.search(words) is not None


class BaseRotation(InputKind):
    """The angular acceleration α of a base that turns about the yaw axis; moment = −Izz α.

    The reading is the angle between body and base, and spring and damper act between them.
    """

    column = "base_acceleration_rad_s2"
    unit = "rad/s2"
    meaning = "the angular acceleration of the base"
    noun = "base"
    of_base = True
    by_inertia = True
    scale = -1.0
    amplitudes = "amplitudes_rad_s2"
    units = _TURNING

    def gain(self, stated: float | None, spring_stiffness: float | None) -> float | None:
        """None: the gain is the unknown inertia."""
        del stated, spring_stiffness
        return None

    def true_scale(self, gain: float, spring_stiffness: float, inertia: float) -> float:
        """The inertia, with its sign."""
        del gain, spring_stiffness
        return self.scale * inertia

    def known_gain(self, *, windy: bool) -> KnownGain | None:
        """The gain over the inertia, −1."""
        del windy
        return KnownGain(constant=self.scale)

    def holds(self, name: str, unit: str) -> bool:
        """An angular acceleration of a base."""
        return super().holds(name, unit) or (unit in _TURNING and _SHAKEN.search(name) is not None)


class BaseTranslation(_OfGain):
    """The acceleration a of a base that moves across the body's arm; moment = −gain · a, with gain = mass · arm.

    The arm, from the axis to the centre of mass, is assumed to be the arm at rest.
    """

    column = "base_acceleration_m_s2"
    unit = "m/s2"
    meaning = "the acceleration of the base, of unknown mass times arm"
    of_base = True
    noun = "base"
    scale = -1.0
    amplitudes = "amplitudes_m_s2"

    def holds(self, name: str, unit: str) -> bool:
        """An acceleration of a base, with or without a unit, since the gain is fitted."""
        if super().holds(name, unit):
            return True
        accelerates = _plain(unit) in _ALONG or (not unit and _ACCELERATION.search(name) is not None)
        return accelerates and _SHAKEN.search(name) is not None

    def factor(self, unit: str) -> float:
        """The factor from a unit of length over time squared, or from g."""
        return _ALONG.get(_plain(unit), 1.0)


def without_command(name: str) -> str:
    """The name of a command without the word that calls it one, in lower case: ``q`` of ``q_ref``."""
    words = _JOINED.sub("_", name)
    joined = re.sub(
        r"(?i)^(goal|target|desired|ref|cmd)(?=pos|angle|yaw|theta|q)|(?<=^q)(des|ref|cmd)$", "", words
    )
    rest = joined if joined != words else _COMMAND.sub("", words)
    return re.sub(r"^[\s_]+|[\s_]+$", "", rest).lower()


def _plain(unit: str) -> str:
    """A unit unknown to imports, in the spelling of `_ALONG`."""
    return unit.lower().translate(_PLAIN)


KINDS: tuple[InputKind, ...] = (Moment(), Unscaled(), Root(), Command(), BaseRotation(), BaseTranslation())
"""In the order in which they may claim a column; an unclaimed column is an input of any unit."""

INPUTS: Mapping[InputColumn, InputKind] = {kind.column: kind for kind in KINDS}
"""The kinds of input by their columns."""

INPUT_COLUMNS: tuple[InputColumn, ...] = tuple(INPUTS)
"""The columns of a run file that may hold its input."""

WITHOUT_UNIT: Mapping[str, tuple[InputColumn, ...]] = {
    "base_acceleration": (BaseRotation.column, BaseTranslation.column)
}
"""Names without the unit that would determine the kind of input, with the columns that they may mean."""
