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
}
"""Factors to s, rad, counts, V, rad/s and rad/s², by kind of quantity and unit."""

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
    "counts": "count counts cts ticks pulses lsb",
    "V": "v volt volts",
    "mV": "mv",
    "rad/s": "rad/s rad/sec rad_s radians/s rads-1",
    "deg/s": "deg/s °/s deg/sec deg_s dps degrees/s",
    "rpm": "rpm",
    "rad/s2": "rad/s2 rad/s^2 rad/s/s rad_s2",
    "deg/s2": "deg/s2 deg/s^2 °/s2 °/s^2 deg_s2",
}
_UNIT_OF = {word: unit for unit, words in _WORDS.items() for word in words.split()}
_BRACKETS = re.compile(r"\s*[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]")
_ENDING = re.compile(r"^(.*?\w)\s*(?:[_,/]|\s)\s*([^\s_,/]+(?:[_/]s(?:2|\^2|²)?)?)$")


def known_unit(text: str) -> str | None:
    """The unit that a text names; None where it names none that is known."""
    word = text.strip().strip("()[]{}<>").strip().lower()
    return _UNIT_OF.get(word.replace("µ", "u").replace("μ", "u").replace("²", "2").replace(" ", ""))


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
    for found in _BRACKETS.finditer(heading):
        name = (heading[: found.start()] + heading[found.end() :]).strip()
        unit = known_unit(found[1])
        if unit is not None and name:
            return name, unit
    ending = _ENDING.match(heading)
    unit = known_unit(ending[2]) if ending else None
    if ending and unit is not None:
        return ending[1].strip(), unit
    last = _BRACKETS.search(heading)
    strange = last is not None and last.start() > 0 and not last[1].isdigit()
    return heading, last[1] if last is not None and strange else ""
