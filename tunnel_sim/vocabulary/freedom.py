"""The freedom of the body, an angle or a displacement: its columns and keys in files, its units and its words.

The equation of motion of both is the same: a displacement is to a mass, N/m and N s/m what an angle is to an
inertia, N m/rad and N m s/rad. So numbers are computed once, under the names of an angle, and only this file knows
the names of a displacement. It is asked in three places: files name columns and keys by it; a document that is made
takes its units from it (`Freedom.document`); and texts that are shown, refusals too, take their words from it
(`Freedom.words`, `Freedom.texts`, `Freedom.errors`).
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from math import pi
from typing import Any, Literal, TypeVar, cast

from tunnel_sim.vocabulary.dimensions import dimension, unit_text
from tunnel_sim.vocabulary.errors import TunnelError, one_of
from tunnel_sim.vocabulary.input_kinds import INPUTS, InputColumn, InputKind

Motion = Literal["angle", "displacement"]
"""What a sensor measures, or the derivatives of what: the angle or the displacement of the body."""

_T = TypeVar("_T")
_G = 9.80665  # m/s², standard gravity
_SWING = (0.03, 3.0)  # the greatest motions, m, that are computed as angles of the same number of radians
_USUAL_SWING = 0.3  # others are computed as an angle of about this size, rad


@dataclass(frozen=True)
class Freedom:
    """An angle, as it stands; or a displacement, in other words.

    Args:
        columns: of a run file that may hold the reading, with factors to SI, by quantity; the first is written.
        inputs: columns of a run file that may hold an input, with the column of that kind of input for an angle.
        input_units: of inputs in files of instruments, with their factors to SI, by the column for an angle; those
            of an angle are among the traits of each kind.
        keys: keys of ``campaign.toml`` that have another name, with the name for an angle.
        refused: keys of ``campaign.toml`` that the freedom does not have.
        condition_units: of these keys in files of instruments, with the unit for an angle and the factor to it.
        units: of readings in files of instruments, with their factors to SI, by quantity; those of an angle are
            among the units of all columns.
        shown: by SI unit of a reading, the mark of the unit in which it is shown, and the factor.
        turns: whether a whole turn leads back to the same place: the reading may wrap, and the body has an angle in
            the room.
        windy: whether the air adds stiffness and damping.
        slip: how many of the smaller usual unit are one of the SI unit.
    """

    motion: Motion
    columns: Mapping[str, Mapping[str, float]]
    inputs: Mapping[str, InputColumn]
    input_units: Mapping[InputColumn, Mapping[str, float]] = field(default_factory=dict)
    keys: Mapping[str, str] = field(default_factory=dict)
    refused: tuple[str, ...] = ()
    condition_units: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    units: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    shown: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    turns: bool = True
    windy: bool = True
    slip: float = 180.0 / pi
    _units: tuple[tuple[str, str], ...] = ()
    _words: tuple[tuple[str, str], ...] = ()

    # ---- units

    def unit(self, unit: str) -> str:
        """The unit of a quantity that has some unit for an angle, such as ``N/m`` for ``N m/rad``."""
        for old, new in self._units:
            unit = re.sub(old, new, unit)
        return unit

    def angle_unit(self, unit: str) -> str:
        """The unit for an angle of a quantity that has some unit here, such as ``N m/rad`` for ``N/m``."""
        if not self._units:
            return unit
        kg, metres, seconds = dimension(unit)
        return unit_text({"N": kg, "m": kg, "s": seconds + 2.0 * kg, "rad": metres - kg})

    @property
    def scales(self) -> bool:
        """Whether the motion may be computed at another size, so that every power of its unit counts."""
        return not self.turns

    @property
    def stated(self) -> dict[str, str]:
        """Its statement in a document or a file; an angle goes unsaid."""
        return {"motion": self.motion} if self._units else {}

    def scale(self, size: float) -> float:
        """The factor with which a motion is computed; a power of two, so that it changes no digit.

        Ranges and starting values of effects are meant for angles of a rig. A displacement may have any size.

        Args:
            size: the greatest motion, in SI.
        """
        low, high = _SWING
        if not self.scales or not size > 0.0 or low <= size <= high:
            return 1.0
        power = 0
        while size * 2.0**power < _USUAL_SWING / 2.0**0.5:
            power += 1
        while size * 2.0**power > _USUAL_SWING * 2.0**0.5:
            power -= 1
        return 2.0**power

    # ---- documents

    def document(self, value: _T, names: Collection[str] = ()) -> _T:
        """A value of typed fields whose units and sentences are the freedom's own; its numbers are unchanged.

        Args:
            names: of runs and campaigns, which are kept in sentences.
        """
        return cast(_T, self._own(value, "", "", frozenset(names))) if self._units else value

    def _own(self, value: Any, name: str, owner: str, names: frozenset[str]) -> Any:
        if name in _KEPT:
            told = name == "figures" and "words" in value
            return {**value, "words": self.words(value["words"], names)} if told else value
        if isinstance(value, str):
            if "unit" in (name, owner):
                return self.unit(unit_of_frequency(owner, value))
            return self.words(value, names) if name in _SENTENCES else value
        if isinstance(value, Mapping):
            return {key: self._own(one, name, str(key), names) for key, one in value.items()}
        if isinstance(value, tuple):
            found = tuple(self._own(one, name, owner, names) for one in value)
            return value if all(a is b for a, b in zip(found, value, strict=True)) else found
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            own = {}
            for part in dataclasses.fields(value):
                given = getattr(value, part.name)
                found = self._own(given, part.name, owner if part.name == "unit" else part.name, names)
                if found is not given:
                    own[part.name] = found
            return dataclasses.replace(value, **own) if own else value
        return value

    # ---- words

    def words(self, text: str, names: Collection[str] = (), scale: float = 1.0) -> str:
        """A text about an angle in the freedom's own words and units.

        Args:
            names: of runs and campaigns, which are kept.
            scale: of the motion as it was computed, by which constants of effects, such as 0.2 rad, are divided.
        """
        if not self._words:
            return text
        kept = [re.escape(one) for one in sorted(names, key=len, reverse=True) if one]
        parts = re.split(rf"(?<![\w])({'|'.join(kept)})(?![\w])", text) if kept else [text]
        return "".join(part if place % 2 else self._said(part, scale) for place, part in enumerate(parts))

    def _said(self, text: str, scale: float) -> str:
        return "".join(
            f"{part} in {_variables(part)}" if place % 2 else self._plain(part, scale)
            for place, part in enumerate(_FORMULA.split(text))
        )

    def _plain(self, text: str, scale: float) -> str:
        text = _CONSTANT.sub(lambda found: f"{float(found[1]) / scale:.3g} rad", text)
        for old, new in self._words:
            text = _compiled(old).sub(lambda found, new=new: _as_capital(found[0], found.expand(new)), text)  # type: ignore[misc]
        return self.unit(text)

    def texts(self, blocks: _T, names: Collection[str] = (), scale: float = 1.0) -> _T:
        """Blocks, or a collection of them, in the freedom's own words; arguments as in `words`."""

        def own(value: Any, name: str) -> Any:
            if isinstance(value, str):
                return value if name in _NOT_SHOWN else self.words(value, names, scale)
            if isinstance(value, tuple | list):
                return type(value)(own(one, name) for one in value)
            if isinstance(value, Mapping):
                return {key: own(one, str(key)) for key, one in value.items()}
            if dataclasses.is_dataclass(value) and not isinstance(value, type):
                parts = (part.name for part in dataclasses.fields(value))
                return dataclasses.replace(value, **{part: own(getattr(value, part), part) for part in parts})
            return value

        return cast(_T, own(blocks, "")) if self._words else blocks

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Refusals within it are in the freedom's own words."""
        try:
            yield
        except TunnelError as error:
            if not self._words:
                raise
            raise self.refusal(error) from error

    def refusal(self, error: TunnelError, names: Collection[str] = ()) -> TunnelError:
        """A refusal in the freedom's own words; names as in `words`."""
        return TunnelError(
            self.words(error.what, names),
            where=error.where,
            remedy=self.words(error.remedy, names),
            options=error.options,
            parts=[self.refusal(part, names) for part in error.parts],
        )

    # ---- files

    def as_angle(self, table: Mapping[str, Any], where: str, *, imported: bool = False) -> dict[str, Any]:
        """A table of ``campaign.toml`` under the keys of an angle.

        Args:
            imported: whether it is about the files of an import, whose units state the motion.

        Raises:
            TunnelError: for a key that the freedom does not have.
        """
        for key in self.refused:
            if table.get(key):
                what = f"'{key}' is stated of a {self.motion}, which has no aerodynamic coefficients"
                remedy = f"leave {key} out; a body in the wind has motion = 'angle' under [sensor]"
                raise TunnelError(what, where=where, remedy=remedy)
        for other in FREEDOMS.values():
            for own, key in other.keys.items():
                wrong, right, motion = (key, own, ANGLE) if other is self else (own, key, other)
                if table.get(wrong) is not None:
                    what = f"'{wrong}' is stated, but not motion = '{motion.motion}'"
                    unit = "rad" if motion.turns else "m"
                    stated = f"--unit {unit}" if imported else f"motion = '{motion.motion}' under [sensor]"
                    remedy = f"give {right}, or state {stated}"
                    raise TunnelError(what, where=where, remedy=remedy)
        return {self.keys.get(key, key): value for key, value in table.items()}

    def as_own(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """The inverse of `as_angle`."""
        own = {key: name for name, key in self.keys.items()}
        return {own.get(key, key): value for key, value in table.items()}

    def own_keys(self, keys: Collection[str]) -> tuple[str, ...]:
        """Keys of ``campaign.toml`` under the freedom's names, without those that it does not have."""
        return tuple(self.as_own(dict.fromkeys(key for key in keys if key not in self.refused)))

    def condition(self, name: str, unit: str) -> tuple[str, str, float]:
        """Name and unit of a condition in a file of an instrument, as for an angle, and the factor to that unit."""
        plain = re.split(r"\s*[(\[{<]", name.strip())[0]
        return self.keys.get(plain, name), *self.condition_units.get(unit, (unit, 1.0))

    def own_input(self, column: str) -> str:
        """The column of an input in a run file, for the column of its kind."""
        return next(name for name, kind in self.inputs.items() if kind == column)

    def stated_input(self, column: str, where: str) -> InputColumn:
        """The column for an angle of a kind of input that is stated under the freedom's own name.

        Raises:
            TunnelError: for the name of an input of another freedom.
        """
        if column not in self.inputs:
            what = f"'{column}' is not an input of a motion = '{self.motion}'"
            raise TunnelError(what, where=where, remedy=f"give {one_of(tuple(self.inputs))}")
        return self.inputs[column]

    def input_kind(self, name: str, unit: str) -> InputKind | None:
        """The kind of input shown by name and unit of a column in an instrument's file; None: neither shows it."""
        name = self.inputs.get(name.strip().lower(), name) if self.input_units else name
        if self.input_units and unit not in ("", "counts"):
            held = (INPUTS[column].unit for column, units in self.input_units.items() if unit in units)
            unit = next(held, "unknown")
        return next(
            (kind for kind in map(INPUTS.__getitem__, self.inputs.values()) if kind.holds(name, unit)), None
        )

    def input_factor(self, kind: InputKind, unit: str) -> float:
        """From a unit of a file to the unit of a kind of input; 1 for an unknown unit."""
        if not self.input_units:
            return kind.factor(unit)
        return self.input_units.get(kind.column, {}).get(unit, 1.0)

    def input_unit(self, name: str, unit: str) -> str:
        """The unit of an input's column as `input_units` spells it: the stated one, or the one in its name."""
        if not self.input_units:
            return unit
        found = _OWN_UNIT.search(name)
        plain = (unit or (found[1].replace("_", "/") if found else "")).translate(_PLAIN)
        return "kN" if plain == "kn" else plain  # a knot measures wind only


_FORMULA = re.compile(r"(?<=[Tt]he formula )(\S+)(?= explains)")
_VARIABLES = {"b": "displacement b", "r": "rate r", "y": "reading y", "t": "time t", "Kr": "spring's Kr"}
"""The names in a formula are the same for every motion, as in an effects file."""


def _variables(formula: str) -> str:
    """The meaning of the names in a formula, in words."""
    held = [f"the {words}" for name, words in _VARIABLES.items() if re.search(rf"\b{name}\b", formula)]
    return " and ".join(filter(None, [", ".join(held[:-1]), *held[-1:]])) or "its parameters"


_CONSTANT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?) rad\b")


@cache
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern)


def _as_capital(old: str, new: str) -> str:
    """The new word with a capital where the old word has one, at the beginning of a sentence."""
    capital = old[:1].isupper() and old[1:2].islower() and len(new) > 1  # a symbol keeps its case
    return new[:1].upper() + new[1:] if capital else new


_FREQUENCIES = ("omega_n", "frequency", "resonance")
"""Quantities in rad/s that are no rate of the body."""


def unit_of_frequency(name: str, unit: str) -> str:
    """The unit with which a quantity scales: the radian of an angular frequency is no motion of the body.

    Args:
        name: of the quantity; for effects ``effect.parameter``.
        unit: its unit.

    Returns:
        ``1/s`` for an angular frequency, else the unit.
    """
    return "1/s" if unit == "rad/s" and name.rpartition(".")[2] in _FREQUENCIES else unit


"""Quantities in rad/s that are no rate of the body."""
_SENTENCES = (
    "what", "remedy", "verdict", "cautions", "note", "words", "reason", "notes", "blind_spots", "further", "label",
    "motion_words", "gain",
)  # fmt: skip
"""Fields of documents that hold sentences."""
_KEPT = ("figures", "provenance", "seconds", "data", "engine")
"""Fields of documents that hold values without units, or for computing."""
_NOT_SHOWN = ("kind", "key", "name")
"""Fields of blocks that no one reads."""

_DEGREE = pi / 180.0
ANGLE = Freedom(
    "angle",
    columns={
        "angle": {"yaw_rad": 1.0, "yaw_deg": _DEGREE},
        "rate": {"yaw_rate_rad_s": 1.0, "yaw_rate_deg_s": _DEGREE},
        "acceleration": {"yaw_acceleration_rad_s2": 1.0},
    },
    inputs={column: column for column in INPUTS},
    shown={"rad": ("°", 180.0 / pi), "rad/s": ("°/s", 180.0 / pi), "rad/s2": ("°/s²", 180.0 / pi)},
)  # fmt: skip
"""The yaw angle of a body in a tunnel, or the angle of a joint."""

_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
_ACCELERATIONS = {"m/s2": 1.0, "cm/s2": 1e-2, "mm/s2": 1e-3, "g": _G, "mg": 1e-3 * _G}
_NOUN = r"\b(the|a|its|of|by|small|large|smaller|larger|free|wide|whole|first|each|every|per|own|\d+)( )"
DISPLACEMENT = Freedom(
    "displacement",
    columns={
        "angle": {"x_m": 1.0, "x_mm": 1e-3},
        "rate": {"x_m_s": 1.0, "x_mm_s": 1e-3},
        "acceleration": {"x_m_s2": 1.0, "x_mm_s2": 1e-3, "x_g": _G},
    },
    inputs={
        "force_n": "moment_nm", "drive": "drive", "base_m": "base_rad", "command_m": "command_rad",
        "base_acceleration_m_s2": "base_acceleration_rad_s2",
    },
    input_units={
        "moment_nm": {"N": 1.0, "mN": 1e-3, "cN": 1e-2, "kN": 1e3},
        "base_rad": _LENGTHS, "command_rad": _LENGTHS, "base_acceleration_rad_s2": _ACCELERATIONS,
    },
    keys={"mass": "yaw_inertia", "release_displacement": "release_angle"},
    condition_units={
        "N/m": ("N m/rad", 1.0), "N/mm": ("N m/rad", 1e3), "kN/m": ("N m/rad", 1e3),
        "kg": ("kg m2", 1.0), "g": ("kg m2", 1e-3), **{unit: ("rad", size) for unit, size in _LENGTHS.items()},
    },
    refused=("wind_speed", "air_density", "frontal_area", "reference_length", "width"),
    units={
        "angle": _LENGTHS,
        "rate": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
        "acceleration": _ACCELERATIONS,
    },
    shown={"m": ("mm", 1e3), "m/s": ("mm/s", 1e3), "m/s2": ("m/s²", 1.0)},
    turns=False,
    windy=False,
    slip=1e3,
    _units=(
        (r"rad/\(N m\)", "m/N"),
        (r"\bN m/deg\b", "N/mm"),
        (r"\bN m(?![²³\w])", "N"),
        (r"\bkg m(2|²)(?!\w)", "kg"),
        (r"\bmrad\b", "mm"),
        (r"\brad(?=[²³⁴\d]|\b)", "m"),
    ),
    _words=(
        # whole phrases
        (r"angles of the readings in degrees, coefficients and parameters in radians",
         "readings in millimetres, coefficients and parameters in metres"),
        (r"yaw angle of the body about the rod; nose-right is positive", "displacement of the body"),
        (r"yaw rate, r \[", "its rate ["),
        (r"moment of inertia of body and support about the rod", "mass of the moving body"),
        (r"torsion spring", "spring"),
        (r"^swing(?=\n\[)", "motion"),
        (r"nominal Izz of model and support", "of the moving body"),
        (r"optional: wind_speed, spring_stiffness", "optional: spring_stiffness"),
        (r"bearing and the sensor", "guide and the sensor"),
        (r"(natural frequency of small )swings( \[)rad/s", r"\1motions\g<2>1/s"),
        (r"(ωn\s*\[)rad/s", r"\g<1>1/s"),
        (r"(ωn²\s*\[)rad²/s²", r"\g<1>1/s²"),
        (r"with other springs, wind speeds and release angles", "with other springs and release displacements"),
        (r"needed for Izz, Cr, Cnβ and Cnr", "needed for the mass and the damping"),
        # clauses about the air
        (r"^with the wind off,? ", ""),
        (r",? (also )?with the wind (on and off|off and on|off)\b,?", ""),
        (r"\b(a|the|every) wind-off run\b", r"\1 run"),
        (r"\bwind-off runs", "runs"),
        (r", state the wind speed,", ","),
        (r" at one wind speed\b", ""),
        (r"\b(springs?),? (and|or) wind(s|( speeds?))?\b", r"\1"),
        (r"\bwind(s|( speeds?))? (and|or) (springs?)\b", r"\4"),
        (r"\bwind, spring\b", "spring"),
        (r"^wind off$", "runs"),
        (r" · wind off\b", ""),
        # slips of units
        (r"looks like spring_stiffness in N mm/rad", "looks like mass in tonnes"),
        (r"looks like yaw_inertia in g m2", "looks like mass in g, or spring_stiffness in N/mm"),
        (r"in N m/rad, the others in N (m|c)m/rad", r"in N/\1m"),
        (r"in N (m|c)m/rad", r"in N/m, the others in N/\1m"),
        (r"state quantity = 'angle' under \[sensor\]", "leave quantity out of [sensor]"),
        # names in files
        (r"\byaw_acceleration_rad_s2\b", "x_m_s2"),
        (r"\byaw_rate_rad_s\b", "x_m_s"),
        (r"\byaw_rate_deg_s\b", "x_mm_s"),
        (r"\byaw_rad\b", "x_m"),
        (r"\byaw_deg\b", "x_mm"),
        (r"\byaw_inertia\b", "mass"),
        (r"\brelease_angle\b", "release_displacement"),
        (r"\bmoment_nm\b", "force_n"),
        (r"\bfriction_moment\b", "friction_force"),
        (r"\bmoment_offset\b", "force_offset"),
        (r"\b(base|command)_rad\b", r"\1_m"),
        (r"\bbase_acceleration_rad_s2\b", "base_acceleration_m_s2"),
        (r"--unit deg\b", "--unit mm"),
        (r"\bdeg/s(2|²)?", r"mm/s\1"),
        # nouns
        (r"\b([Yy]aw )?[Mm]oments? of inertia\b", "mass"),
        (r"\b[Yy]aw angle(s?)\b", r"displacement\1"),
        (r"\b[Yy]aw (rate|acceleration)", r"\1"),
        (r"\b[Yy]aw moment", "force"),
        (r"\b([Aa])n angular\b", r"\1n"),
        (r"\b[Aa]ngular (acceleration|rate|velocity)", r"\1"),
        (r"\b([Aa])n angle\b", r"\1 displacement"),
        (r"(?<!')(?<!--)\b[Aa]ngle(s?)\b", r"displacement\1"),
        (r"\b([Aa])n inertia\b", r"\1 mass"),
        (r"\b[Ii]nertias\b", "masses"),
        (r"\b[Ii]nertia\b", "mass"),
        (r"\b([Mm]oment|[Tt]orque)(s?)\b", r"force\2"),
        (r"\b[Rr]adians\b", "metres"),
        (r"\b[Dd]egrees\b(?! of freedom)", "millimetres"),
        (rf"{_NOUN}swing(s?)\b", r"\1\2motion\3"),
        (r"\b[Ss]wing(s?)\b", r"move\1"),
        # symbols
        (r"\bIzz\b", "m"),
        (r"(?<!\*)(?<!spring's )\bKr\b(?!\*)", "k"),  # a formula has names of its own
        (r"\bCr\b", "c"),
        ("β\u0308", "x\u0308"),
        ("β\u0307", "x\u0307"),
        (r"β", "x"),
        (r"\bTc\b", "Fc"),
    ),
)  # fmt: skip
"""The displacement of a mass on a spring along a line."""

FREEDOMS: Mapping[str, Freedom] = {one.motion: one for one in (ANGLE, DISPLACEMENT)}
"""By their motion."""

OwnInputColumn = Literal[InputColumn, "force_n", "base_m", "command_m"]
"""The columns of a run file that may hold its input, of any freedom."""

OWN_INPUT_COLUMNS = tuple(dict.fromkeys(name for one in FREEDOMS.values() for name in one.inputs))
"""All of them."""


def column_unit(name: str) -> str:
    """The unit in the name of a displacement's column, of the format or such as ``pos_mm``; empty: none."""
    known = (column for columns in DISPLACEMENT.columns.values() for column in columns)
    found = (_OWN_UNIT if name in known else _PLAIN_UNIT).search(name)
    return found[1].replace("_", "/") if found else ""


def freedom_of_column(name: str, unit: str) -> Freedom:
    """The freedom of a reading, by the name of its column and its unit there, which may be empty."""
    return ANGLE if linear_unit(unit or column_unit(name)) is None else DISPLACEMENT


def linear_unit(text: str) -> tuple[str, str, float] | None:
    """The quantity, unit and factor to SI of a displacement's unit as a file writes it; None of other texts."""
    plain = text.strip().translate(_PLAIN)
    for quantity, units in DISPLACEMENT.units.items():
        if plain in units:
            return quantity, plain, units[plain]
    return None


_PLAIN = str.maketrans({"²": "2", "^": None, "µ": "u", "μ": "u", "*": None})
_PLAIN_UNIT = re.compile(r"(?<=[_\s])((?:mm|[cuµ]m)(?:[_/]s[2²]?)?|m[_/]s[2²])$")
_OWN_UNIT = re.compile(r"(?<=[_\s])((?:[mcuµ]?m)(?:[_/]s[2²]?)?|g|mg|[mck]?N)$")


def freedom_of_unit(unit: str) -> Freedom:
    """The freedom whose readings have an SI unit."""
    return next(one for one in FREEDOMS.values() if unit in one.shown)
