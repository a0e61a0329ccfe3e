"""Units of columns: their factors and spellings, and their place in a heading."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import pi

from tunnel_sim.vocabulary import limits

UNITS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0, "gon": pi / 200.0, "turns": 2.0 * pi},
    "counts": {"counts": 1.0},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "rate": {"rad/s": 1.0, "deg/s": pi / 180.0, "rpm": pi / 30.0},
    "acceleration": {"rad/s2": 1.0, "deg/s2": pi / 180.0},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "kn": 1852.0 / 3600.0, "ft/s": 0.3048},
    "stiffness": {"N m/rad": 1.0, "N cm/rad": 1e-2, "N mm/rad": 1e-3, "N m/deg": 180.0 / pi},
    "density": {"kg/m3": 1.0, "g/cm3": 1e3},
}
"""Factors to s, rad, counts, V, rad/s, rad/s², m/s, N m/rad and kg/m³, by kind of quantity and unit."""

_WORDS = {
    "s": "s sec secs second seconds sek sekunde sekunden 秒",
    "ms": "ms msec millisecond milliseconds millis millisekunde millisekunden",
    "us": "us usec microsecond microseconds micros mikrosekunde mikrosekunden",
    "ns": "ns nanoseconds nanosekunden",
    "min": "min minute minutes minuten",
    "h": "h hr hour hours std stunde stunden",
    "rad": "rad rads radian radians radiant bogenmaß bogenmass",
    "mrad": "mrad milliradian milliradians millirad",
    "deg": "deg degs degree degrees ° â° altgrad winkelgrad degré degrés degre degres grado grados gradi 度",
    "gon": "gon neugrad gradian gradians",
    "turns": "turn turns rev revs revolution revolutions umdr umdrehung umdrehungen",
    "counts": "count counts cts ticks pulse pulses lsb digit digits ink inkr inkrement inkremente incr increment "
    "increments imp impulse schritte",
    "V": "v volt volts",
    "mV": "mv millivolt",
    "rad/s": "rad/s rad/sec rad_s radians/s rads-1 rads^-1",
    "deg/s": "deg/s °/s deg/sec deg_s dps degrees/s °s-1 degs-1 altgrad/s",
    "rpm": "rpm u/min 1/min min-1 min^-1 rev/min r/min umdr/min",
    "rad/s2": "rad/s2 rad/s^2 rad/s/s rad_s2 rads-2 rads^-2",
    "deg/s2": "deg/s2 deg/s^2 °/s2 °/s^2 deg_s2 altgrad/s2 altgrad/s^2",
    "m/s": "m/s m/sec m_s ms-1 ms^-1",
    "km/h": "km/h kmh kmph kph km_h kmh-1 kmh^-1",
    "mph": "mph",
    "kn": "kn knot knots kts knoten",
    "ft/s": "ft/s ft_s fps",
    "N m/rad": "nm/rad n-m/rad nm_rad n_m_rad n_m/rad nmrad-1 nmrad^-1",
    "N cm/rad": "ncm/rad n-cm/rad",
    "N mm/rad": "nmm/rad n-mm/rad mnm/rad",
    "N m/deg": "nm/deg nm/° n-m/deg nm_deg nm/altgrad",
    "kg/m3": "kg/m3 kg/m^3 kgm-3 kgm^-3 kg_m3",
    "g/cm3": "g/cm3 g/cm^3",
}
_UNIT_OF = {word: unit for unit, words in _WORDS.items() for word in words.split()}
_ALIKE = str.maketrans(
    {"∕": "/", "µ": "u", "μ": "u", "²": "2", "³": "3", "¹": "1", "⁻": "-", "−": "-", "º": "°", "˚": "°"}
    | dict.fromkeys(" ·⋅*")
)
_GERMAN = re.compile(
    r"(?i)winkel|drehung|ausschlag|auslenkung|lage|gier|steifigkeit|feder|geschwindigkeit|rate"
)
"""Names with which ``grad`` is the German degree; alone it may be the gon (a turn has 400)."""
_BRACKETS = re.compile(r"\s*[(\[{<]\s*(?:in\s+)?([^()\[\]{}<>]*?)\s*[)\]}>]")
_IN = re.compile(r"(?i)(?<=\S)[\s_]+in[\s_]+(?=\S)")
_SEPARATOR = re.compile(r"(?<=\w)(?:\s+[-–—]\s+|[\s_,:]*[\s_,:/][\s_,:]*)")
_PER = re.compile(r"(?i)[\s_]per[\s_]")
_PER_TIME = ("s", "sec", "min", "h")
_AMBIGUOUS = ("min", "h")
"""After a blank or an underscore also a minimum or a height: only for times are they units there."""
_TIMES = re.compile(
    r"(?i)(?<![a-z])(t|time|timed|times|timestamp|zeit|temps|tiempo|tempo|tijd|tid|elapsed|uhrzeit|x_value)(?![a-z])"
)
_RUN = r"(?:run|trial|test|swing|rep|versuch|messung|lauf)"
_OF_RUN = re.compile(rf"(?i)[\s_]+{_RUN}[\s_#.-]*\d+\s*$")
_LIKE_A_UNIT = re.compile(rf"(?!(?i:{_RUN})$)(?:[^\W\d_]|[°%])+(?:[.^/·*-]*[^\W\d_])*\^?-?[23²³]?")
_TEMPERATURE = re.compile(r"(?i)temperat|(?<![a-z])temp(?![a-z])")
_UNIT_WORD = re.compile(r"(?i)(?:unit|einheit)(?:s|en)?\W+([^\s,;:=]+)\W*$")
_LONGEST = 10  # characters: a longer word is not a unit


HERTZ: Mapping[str, float] = {"hz": 1.0, "khz": 1e3, "mhz": 1e6}
"""Units of sample rates in small letters, in Hz."""


def known_unit(text: str) -> str | None:
    """The unit named by a text; None if it does not name a known unit."""
    word = text.strip().strip("()[]{}<>").strip()
    word = re.sub(r"\bGrad\b", "altgrad", word)  # a German degree; "grad" is the gon in English
    word = squeezed(word)
    return _UNIT_OF.get(word) or _UNIT_OF.get(word.removesuffix("."))


def squeezed(text: str) -> str:
    """A unit in lower case, without blanks and dots, and with plain digits for superscripts."""
    return text.lower().translate(_ALIKE)


def kind_of(unit: str) -> str:
    """The kind of quantity that a unit measures, a key of `UNITS`; empty if the unit is not known."""
    return next((kind for kind, factors in UNITS.items() if unit in factors), "")


def names_a_time(name: str) -> bool:
    """Whether a name names a time."""
    return _TIMES.search(name) is not None


def split_unit(heading: str) -> tuple[str, str]:
    """A heading such as ``Angle (deg) Run #1``, ``t / s`` or ``Zeit in ms`` as name and unit, which may be empty.

    An unknown unit is returned as written.
    """
    heading = " ".join(heading[: limits.NAME_CHARACTERS].split())
    run = _OF_RUN.search(heading)
    name, unit = _split(heading[: run.start()] if run else heading)
    if run:
        name = f"{name}{run[0]}"
    return name, "°C" if unit == "deg" and _TEMPERATURE.search(name) else unit


def claims(text: str, name: str, unit: str) -> bool:
    """Whether a text names a column or a number as a heading does: by its name alone, or with its unit."""
    wanted = text.strip().lower()
    if wanted in (one.lower() for one in (name, _bare(name), f"{name}_{unit}", f"{name} ({unit})")):
        return True
    first, written = split_unit(text)
    return (_bare(first).lower(), written) == (_bare(name).lower(), unit)


def _bare(name: str) -> str:
    """A name without the unknown unit that `split_unit` leaves in it; the number of a channel remains."""
    return re.sub(r"\s*[(\[{<](?!\d+[)\]}>]).*", "", name)


def unit_after_word(text: str) -> str | None:
    """The known unit in a text such as ``angle_unit: deg``; None if there is none."""
    found = _UNIT_WORD.search(text)
    return None if found is None else known_unit(found[1])


def unit_beside(name: str, text: str) -> str:
    """The unit stated by a cell below a name; as written if it is not known."""
    return known_unit(_in_german(name, text)) or text.strip("()[]{} -")


def written_unit(name: str, kinds: Sequence[str]) -> str:
    """A word of a name that may be a unit of certain kinds, keys of `UNITS`; empty if there is none."""
    words = re.split(r"[\s_/,;:.()\[\]{}<>-]+", name)
    return next(
        (
            w
            for w in words
            if kind_of(known_unit(w) or "") in kinds or (w.lower() == "grad" and "angle" in kinds)
        ),
        "",
    )


def _in_german(name: str, text: str) -> str:
    return re.sub(r"(?i)(?<![a-z])grad(?![a-z])", "Grad", text) if _GERMAN.search(name) else text


def _split(heading: str) -> tuple[str, str]:
    heading = _in_german(heading, heading)
    alone = known_unit(heading)
    if alone is not None and (kind_of(alone) in ("angle", "rate", "acceleration") or "/" in heading):
        return heading, alone  # a unit alone, such as "m/s"
    if alone is not None and kind_of(alone) == "time" and alone not in _AMBIGUOUS:
        return heading, alone
    for found in _BRACKETS.finditer(heading):
        name = heading[: found.start()].rstrip(" /,:") + heading[found.end() :]
        name = re.sub(r"(?i)\s+in$", "", name).strip()
        unit = known_unit(found[1])
        if unit is not None and name:
            return name, unit
    bracket = _BRACKETS.search(heading)
    if bracket is not None:  # a heading that ends in a bracket, such as "[kN/s]", does not end in a unit
        return heading, "" if bracket.start() == 0 or bracket[1].isdigit() else bracket[1]
    for split in (_after_in, _after_separator, _after_slash, _after_joined):
        parts = split(heading)
        if parts is not None:
            return parts
    return heading, ""


def _after_in(heading: str) -> tuple[str, str] | None:
    """``Zeit in ms``, also before further words; an unknown unit is one short word at the end."""
    found = _IN.search(heading)
    if found is None:
        return None
    name, rest = heading[: found.start()], heading[found.end() :]
    unit = known_unit(rest) or known_unit(re.split(r"[\s_,]", rest, maxsplit=1)[0])
    if unit is None and not (len(rest) <= _LONGEST and _LIKE_A_UNIT.fullmatch(rest)):
        return None
    return name, unit or rest


def _after_separator(heading: str) -> tuple[str, str] | None:
    """``t/s``, ``yaw_deg`` or ``time, min``: a known unit after a separator; the first counts."""
    text = _PER.sub("/", heading)
    for place, found in enumerate(_SEPARATOR.finditer(text)):
        name, word = text[: found.start()], text[found.end() :]
        unit = known_unit(word)
        if unit is None:
            continue
        blank = not re.search(r"[,:/]", found[0])
        if blank and unit in _AMBIGUOUS and not names_a_time(name):
            continue
        # "t/s" is a time in s, but "F N/s" and "flow_kg_s" are not times
        if place and "," not in found[0] and word.lower() in _PER_TIME and not (blank and names_a_time(name)):
            continue
        return name, unit
    if heading.endswith("°") and heading[:-1].strip():
        return heading[:-1].strip(), "deg"
    return None


def _after_joined(heading: str) -> tuple[str, str] | None:
    """``timeMs`` or ``angleDeg``: a known unit as the last of words that are joined."""
    word = re.split(r"(?<=[a-z])(?=[A-Z])", heading)[-1]
    unit = known_unit(word)
    if word == heading or kind_of(unit or "") not in ("time", "angle", "rate") or unit in _AMBIGUOUS:
        return None
    return heading[: -len(word)], unit or ""


def _after_slash(heading: str) -> tuple[str, str] | None:
    """``Winkel/Foo`` or ``Weg mm/s``: the text after a slash is a unit, or part of one, even if unknown."""
    name, slash, rest = heading.partition("/")
    name, rest = name.rstrip(), rest.strip()
    if not (slash and name and 0 < len(rest) <= _LONGEST and _LIKE_A_UNIT.fullmatch(rest)):
        return None
    before, blank, last = name.rpartition(" ")
    if blank and not heading[: len(name) + 1].endswith(" /") and heading[len(name)] == "/":
        return before.rstrip(), f"{last}/{rest}"  # joined to the previous word: "mm/s"
    return name, rest
