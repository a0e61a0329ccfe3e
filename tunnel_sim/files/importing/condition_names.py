"""Conditions of runs and sizes of a rig: their keys, names and units in files, and names that resemble them."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tunnel_sim.files.importing.units import UNITS, kind_of, squeezed
from tunnel_sim.files.scatter_tables import SPREAD, Spread
from tunnel_sim.files.toml_input import NotNegative, Positive, StrictModel, optional
from tunnel_sim.vocabulary.freedom import Motion


class Conditions(StrictModel):
    """Conditions of runs, sizes of the rig and the scatter between runs, as in ``campaign.toml``."""

    wind_speed: NotNegative | None = optional("a number in m/s, 0 for wind-off", "wind speed V [m/s]")
    spring_stiffness: NotNegative | None = optional(
        "a number in N m/rad, 0 for a driven body without a spring", "stiffness Kr [N m/rad]"
    )
    air_density: Positive | None = optional("a positive number in kg/m3", "air density ρ [kg/m³]")
    release_angle: float | None = optional("a number in rad", "release angle [rad]")
    yaw_inertia: Positive | None = optional("a positive number in kg m2", "nominal inertia Izz [kg m²]")
    mass: Positive | None = optional("a positive number in kg, of a displacement", "mass [kg]")
    release_displacement: float | None = optional(
        "a number in m, of a displacement", "release displacement [m]"
    )
    frontal_area: Positive | None = optional("a positive number in m2", "frontal area A [m²]")
    reference_length: Positive | None = optional("a positive number in m", "reference length l [m]")
    width: Positive | None = optional("a positive number in m", "width [m]")
    repeatability_wind_speed: Spread | None = optional(SPREAD)
    repeatability_spring_stiffness: Spread | None = optional(SPREAD)
    repeatability_mechanical_damping: Spread | None = optional(SPREAD)
    motion: Motion | None = optional("'angle' or 'displacement', of which a condition has its unit")


RIG_KEYS = ("yaw_inertia", "frontal_area", "reference_length", "width")
RUN_KEYS = ("wind_speed", "spring_stiffness", "air_density", "release_angle")
OF_REPEATABILITY = "repeatability_"
"""Prefix of the keys of ``[repeatability]`` beside conditions of the same names."""

SPREAD_KEYS = tuple(key for key in Conditions.model_fields if key.startswith(OF_REPEATABILITY))
SETTABLE = tuple(key for key in Conditions.model_fields if key != "motion")
"""The keys of numbers."""

OF_CAMPAIGN = (*RIG_KEYS, *SPREAD_KEYS)
"""The keys that are the same in all runs."""


_NAMES = {
    "wind_speed": r"(wind|air|flow|free ?stream|tunnel) ?(speed|velocity)|v ?wind|"
    r"(wind|luft|str[öo]mungs|anstr[öo]m)geschwindigkeit",
    "air_density": r"(air ?)?density|rho( ?air)?|ρ|(luft)?dichte",
    "spring_stiffness": r"((spring|torsional|rotational) ?)?stiffness|spring ?(constant|rate)|k ?r|"
    r"(torsions|dreh)?feder(konstante|steifigkeit|rate)|(dreh|torsions)?steifigkeit",
    "release_angle": r"(release|initial|start) ?angle|(anfangs|start|auslenk)winkel|(theta|psi|beta|[θψβ]) ?0",
    "frontal_area": r"frontal ?area|stirnfl[äa]che",
    "reference_length": r"reference ?length|bezugsl[äa]nge",
    "yaw_inertia": r"yaw ?inertia|i ?zz",
}
_KEYS = {key: re.compile(f"(?i)({names})") for key, names in _NAMES.items()}
_SYMBOL = re.compile(r"(?i)[vu](_?(0|inf|∞))?|wind|speed")
_LIKE = {
    "wind_speed": re.compile(rf"{_SYMBOL.pattern}|velocity|geschwindigkeit|wind\W.*"),
    "spring_stiffness": re.compile(
        r"(?i)k|spring|feder|k[ _]?(spring|theta|[θrst])|"
        r"(.*[ _])?(spring|feder|stiffness|steifigkeit)[ _]?(k|const\w*|rate)?"
    ),
}
"""Names without a unit that may mean a condition, or another quantity."""
_UNKNOWN = {
    "wind_speed": re.compile(r"(km|dm|cm|m|ft|in|inch|mi)(/|p)(s|sec|min|h|hr)"),
    "spring_stiffness": re.compile(r".*[nfb].*/(rad|mrad|deg|°|grad|rev|turn|u)"),
}
"""Units of conditions that are not among `UNITS`."""
_WINDY = re.compile(
    r"(?i)(?<![a-z])(wind|air|flow|free_?stream|tunnel|pitot|anemometer|prandtl|fan|blower|gebl[äa]se|str[öo]mung|"
    r"luft|windkanal)(?![a-z])|(?<![a-z])(air|wind|flow|fan)_?(speed|spd|vel)|"
    r"vitesse du vent|viento|vento|風速|风速|(?<![a-z])[uv]_?(inf|∞|mean|air|wind|"
    r"tunnel|ref|fs)(?![a-z])|(?<![a-z])(speed|velocity|geschwindigkeit)(?![a-z])"
)
"""Words in a name that suggest a wind speed."""
_NOT_WINDY = re.compile(
    r"(?i)(?<![a-z])t_(?=air|luft|flow|tunnel|wind)|ang|winkel|dreh|omega|motor|shaft|servo|joint|wheel|yaw|gyro|temp|press(ure)?$|druck$|humid|feucht|density|"
    r"dichte|date|time|name|number|nummer|version|serial|fps|sample|cpu|baud|sound|light|step|index|count|code"
)
_FAN = re.compile(r"(?i)(?<![a-z])(fan|blower|gebl[äa]se|tunnel|wind|windkanal)(?![a-z])")
JOINED = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
"""Word boundaries in a name that joins words, such as ``xGyro`` or ``ZGyro``."""
_DYNAMIC = re.compile(
    r"(?i)dynamic[ _]?press|staudruck|pitot|prandtl|(?<![a-z])(q[ _]?inf|dp|delta[ _]?p)(?![a-z])"
)
_PRESSURES = ("pa", "hpa", "kpa", "mbar", "mmh2o", "inh2o", "")
_KINDS = {
    "wind_speed": "speed",
    "air_density": "density",
    "spring_stiffness": "stiffness",
    "release_angle": "angle",
}
_SIZES = {
    "mass": {"kg": 1.0, "g": 1e-3},
    "release_displacement": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "yaw_inertia": {"kgm2": 1.0, "kgm^2": 1.0, "gcm2": 1e-7, "gcm^2": 1e-7},
    "frontal_area": {"m2": 1.0, "m^2": 1.0, "cm2": 1e-4, "cm^2": 1e-4, "mm2": 1e-6, "mm^2": 1e-6},
    "reference_length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "width": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
}
"""Factors to SI of the units of sizes: no column has them, and they are not among `UNITS`."""


SPEED_IN_TEXT = re.compile(
    r"(?i)(?<![\w.])(\d+(?:[.,]\d+)?)\s*(m/s|m/sec|ms-1|km/h|kmh|kph|mph|ft/s|fps|knots?|kts?)(?![\w/])"
)
WIND_ON = re.compile(r"wind[\s_-]*on(?![a-z])", re.IGNORECASE)
"""A speed in a text, and the words for wind on."""


def mentions_wind(text: str) -> bool:
    """Whether a text mentions a speed, or that the wind is on."""
    return SPEED_IN_TEXT.search(text) is not None or WIND_ON.search(text) is not None


def condition_of(name: str, unit: str, *, alone: bool = False) -> str | None:
    """The condition or size, a key of `Conditions`, stated by a column, or by a number ``alone``."""
    if name in OF_CAMPAIGN and (unit == "" or name != "width"):
        return name
    name = re.sub(r"\s*[(\[{<].*", "", name)  # an unknown unit remains in the name
    plain = re.sub(r"[\s_.-]+", " ", name).strip()
    found = next((key for key, pattern in _KEYS.items() if pattern.fullmatch(plain)), None)
    if found is None and kind_of(unit) == "stiffness" and _LIKE["spring_stiffness"].fullmatch(plain):
        return "spring_stiffness"
    # a unit of time does not fit such a name
    symbol = kind_of(unit) == "speed" or unit == "ms" or (alone and unit == "" and plain.lower() == "speed")
    return "wind_speed" if found is None and symbol and _SYMBOL.fullmatch(name) else found


def resembles(name: str, unit: str) -> str | None:
    """The condition that a name without a unit, or a unit alone, suggests without stating it; None: none."""
    words = JOINED.sub("_", name.strip())
    pressed = _DYNAMIC.search(words) or (unit and re.fullmatch(r"(?i)q(\s*\W.*)?", words))
    if pressed and unit.lower() in _PRESSURES:
        return "wind_speed"
    if unit:
        found = next((key for key, kind in _KINDS.items() if kind == kind_of(unit) and kind != "angle"), None)
        fan = unit in ("rpm", "Hz", "%") and _FAN.search(words) is not None
        if found is None and kind_of(unit) == "":  # an unknown unit of the same kind, such as cm/s
            found = next((key for key in _UNKNOWN if in_unknown_unit(key, unit)), None)
            plain = re.sub(r"\s*[(\[{<].*", "", words)
            found = found if found and _LIKE[found].fullmatch(plain) else None
        return "wind_speed" if found is None and fan else found
    found = next((key for key, pattern in _LIKE.items() if pattern.fullmatch(words)), None)
    windy = found is None and _WINDY.search(words) is not None and _NOT_WINDY.search(words) is None
    return "wind_speed" if windy else found


def in_unknown_unit(key: str, unit: str) -> bool:
    """Whether a unit that is not among `UNITS` seems to measure a condition."""
    return key in _UNKNOWN and kind_of(unit) == "" and _UNKNOWN[key].fullmatch(squeezed(unit)) is not None


def in_si(key: str, unit: str) -> float | None:
    """The factor to SI of a condition or size in a unit; None if the unit does not measure it."""
    if unit == "":
        return 1.0
    if key in _KINDS:
        unit = "m/s" if (key, unit) == ("wind_speed", "ms") else unit  # no wind speed is in milliseconds
        return UNITS[_KINDS[key]].get(unit)
    return _SIZES.get(key, {}).get(squeezed(unit))


def units_of(key: str) -> str:
    """The units in which a condition or size may be stated, for a message."""
    return ", ".join(UNITS[_KINDS[key]] if key in _KINDS else _SIZES.get(key, {"1": 1.0}))


@dataclass(frozen=True)
class Hint:
    """Content that resembles a condition but is not used as one.

    Args:
        key: key of `Conditions`.
        value: value in SI units if it is this condition; NaN if its unit is not known.
        what: description or name in the file, for a message.
        why: the reason for not using it.
        use: the option that uses or states it.
        option: this option with its value; empty if the user must add the value or a file.
        brief: the hint without its number, the same for every run; empty: the words without it.
        symbol: whether only a column's letter suggests it; in a robot's log this letter is a command or a
            velocity.
    """

    key: str
    value: float
    what: str
    why: str
    use: str
    symbol: bool = False
    brief: str = ""
    option: str = ""

    @property
    def words(self) -> str:
        """The whole hint in a line."""
        return f"{self.what} is left out: {self.why}; {self.use}"

    @property
    def short(self) -> str:
        """The hint without its number, the same for every run."""
        return self.brief or re.sub(r"(?<=') = [-+\w.]+", "", self.words, count=1)
