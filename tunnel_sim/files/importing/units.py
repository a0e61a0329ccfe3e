"""Units as instruments write them, and their conversion to SI and radians."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi

UNITS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0, "turns": 2.0 * pi},
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
    "s": "s sec secs second seconds sek sekunden",
    "ms": "ms msec millisecond milliseconds millis",
    "us": "us usec microsecond microseconds micros",
    "ns": "ns nanoseconds",
    "min": "min minutes",
    "h": "h hr hours",
    "rad": "rad rads radian radians",
    "mrad": "mrad",
    "deg": "deg degs degree degrees °",
    "turns": "turn turns rev revs revolution revolutions",
    "counts": "count counts cts ticks pulse pulses lsb digit digits ink inkr inkrement inkremente incr increment "
    "increments imp impulse schritte",
    "V": "v volt volts",
    "mV": "mv",
    "rad/s": "rad/s rad/sec rad_s radians/s rads-1",
    "deg/s": "deg/s °/s deg/sec deg_s dps degrees/s",
    "rpm": "rpm",
    "rad/s2": "rad/s2 rad/s^2 rad/s/s rad_s2",
    "deg/s2": "deg/s2 deg/s^2 °/s2 °/s^2 deg_s2",
    "m/s": "m/s m/sec m_s ms-1 ms^-1",
    "km/h": "km/h kmh kmph kph km_h kmh-1 kmh^-1",
    "mph": "mph",
    "kn": "kn knot knots kts",
    "ft/s": "ft/s ft_s fps",
    "N m/rad": "nm/rad n-m/rad nm_rad n_m_rad n_m/rad nmrad-1 nmrad^-1",
    "N cm/rad": "ncm/rad n-cm/rad",
    "N mm/rad": "nmm/rad n-mm/rad mnm/rad",
    "N m/deg": "nm/deg nm/° n-m/deg nm_deg",
    "kg/m3": "kg/m3 kg/m^3 kgm-3 kgm^-3 kg_m3",
    "g/cm3": "g/cm3 g/cm^3",
}
_UNIT_OF = {word: unit for unit, words in _WORDS.items() for word in words.split()}
_BRACKETS = re.compile(r"\s*[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]")
_SEPARATOR = re.compile(r"(?<=\w)[\s_,]*[\s_,/][\s_,]*")
_PER = re.compile(r"(?i)[\s_]per[\s_]")
_PER_TIME = ("s", "sec", "min", "h")
_ALIKE = str.maketrans({"µ": "u", "μ": "u", "²": "2", "³": "3", **dict.fromkeys(" ·⋅*")})


def known_unit(text: str) -> str | None:
    """The unit that a text names; None where it names none that is known."""
    word = text.strip().strip("()[]{}<>").strip().lower().translate(_ALIKE)
    return _UNIT_OF.get(word) or _UNIT_OF.get(word.removesuffix("."))


def kind_of(unit: str) -> str:
    """The kind of quantity that a unit measures, a key of `UNITS`; empty where the unit is not known."""
    return next((kind for kind, factors in UNITS.items() if unit in factors), "")


def split_unit(heading: str) -> tuple[str, str]:
    """A heading as name and unit.

    Args:
        heading: such as ``Angle (deg) Run #1``, ``yaw_rad`` or ``t / s``.

    Returns:
        The name without its unit, and the unit: one of `UNITS`, the text in brackets where it is another one, or
        an empty text.
    """
    heading = " ".join(heading.split())
    if "/" in heading and known_unit(heading):  # a unit alone, such as "m/s"
        return heading, ""
    for found in _BRACKETS.finditer(heading):
        name = (heading[: found.start()].rstrip(" /") + heading[found.end() :]).strip()
        unit = known_unit(found[1])
        if unit is not None and name:
            return name, unit
    bracket = _BRACKETS.search(heading)
    if bracket is not None:  # what ends in one, such as "[kN/s]", does not end in a unit
        return heading, "" if bracket.start() == 0 or bracket[1].isdigit() else bracket[1]
    text = _PER.sub("/", heading)
    for place, found in enumerate(_SEPARATOR.finditer(text)):
        word = text[found.end() :]
        unit = known_unit(word)
        # "t/s" is a time in s, and neither "F N/s" nor "flow_kg_s" is.
        if unit is not None and not (place and "," not in found[0] and word.lower() in _PER_TIME):
            return text[: found.start()], unit
    return heading, ""
