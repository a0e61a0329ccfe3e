"""Units of quantities as powers of kilogram, metre and second. The radian counts as 1, as in the SI."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from typing import TypeAlias

from tunnel_sim.vocabulary.errors import TunnelError

#: Powers of kg, m and s.
Dimension: TypeAlias = tuple[float, float, float]

NUMBER: Dimension = (0.0, 0.0, 0.0)

_UNITS: dict[str, Dimension] = {
    "1": NUMBER,
    "rad": NUMBER,
    "kg": (1.0, 0.0, 0.0),
    "m": (0.0, 1.0, 0.0),
    "s": (0.0, 0.0, 1.0),
    "Hz": (0.0, 0.0, -1.0),
    "N": (1.0, 1.0, -2.0),
}
_FACTOR = re.compile(r"([A-Za-z]+|1)\^?(\d?)", re.ASCII)
_FORM = "write it of kg, m, s, rad, N and Hz, such as 1, rad, N m/rad, 1/rad2 or rad/(N m)"


def beside(unit: str, joint: str = " ") -> str:
    """A unit in a sentence, such as `` N m`` after a number; empty for a dimensionless quantity.

    Args:
        joint: text before the unit.
    """
    return "" if unit == "1" else f"{joint}{unit}"


def product(one: Dimension, other: Dimension, power: float = 1.0) -> Dimension:
    """The dimension of one quantity times a power of another.

    Args:
        power: exponent of the other quantity, dimensionless.
    """
    kg, m, s = (a + power * b for a, b in zip(one, other, strict=True))
    return kg, m, s


@functools.cache
def dimension(unit: str) -> Dimension:
    """Powers of kg, m and s in a unit.

    A unit has factors separated by spaces with digits for powers, and the denominator after one slash; ``l/V``,
    for a time as a multiple of length over speed, is a number.
    """
    if unit == "l/V":
        return NUMBER
    above, slash, below = unit.partition("/")
    if below.startswith("(") and below.endswith(")"):
        below = below[1:-1]
    found = _factors(above, 1.0)
    of_below = _factors(below, -1.0) if slash else NUMBER
    if found is None or of_below is None:
        raise TunnelError(f"unknown unit {unit!r}", remedy=_FORM)
    return product(found, of_below)


@functools.cache
def angle_power(unit: str) -> float:
    """The exponent with which a quantity scales with all angles and moments: 1 for either, 0 for a stiffness."""
    above, _, below = unit.partition("/")
    return dimension(unit)[0] - _INERTIAS.get(unit, 0.0) + _radians(above) - _radians(below.strip("()"))


_INERTIAS = {"kg m2": 1.0, "1/(kg m2)": -1.0}  # N m s2/rad, of which the SI does not write the radian


def _radians(text: str) -> float:
    """The power of the radian in a product."""
    found = map(_FACTOR.fullmatch, text.split())
    return sum(float(match[2] or 1.0) for match in found if match is not None and match[1] == "rad")


def _factors(text: str, sign: float) -> Dimension | None:
    """The dimension of a product; None if a factor is unknown."""
    found = NUMBER
    for word in text.split() or [""]:
        match = _FACTOR.fullmatch(word)
        if match is None or match[1] not in _UNITS:
            return None
        found = product(found, _UNITS[match[1]], sign * float(match[2] or 1.0))
    return found


def in_si(given: Dimension) -> str:
    """The unit of a dimension in kg, m and s, such as ``kg m2/s2``; ``1`` for a number."""
    return unit_text(dict(zip(("kg", "m", "s"), given, strict=True)))


def unit_text(powers: Mapping[str, float]) -> str:
    """The unit of powers of units, such as ``N m/rad2``; ``1`` for a number."""
    above, below = (
        [
            f"{name}{f'{sign * power:g}' if abs(power) != 1.0 else ''}"
            for name, power in powers.items()
            if sign * power > 0.0
        ]
        for sign in (1.0, -1.0)
    )
    under = f"({' '.join(below)})" if len(below) > 1 else "".join(below)
    return (" ".join(above) or "1") + (f"/{under}" if below else "")


_USUAL = (
    "1", "rad", "s", "s2", "1/s", "1/s2", "1/m", "m/s", "s/m", "s2/m2", "N m", "N m s", "N m s2", "N m s3", "N m/s",
    "N m/s2", "N s", "N s2", "N s3/m", "kg", "kg m",
)  # fmt: skip


def dimension_text(found: Dimension) -> str:
    """A unit of a dimension of whole powers, in the form of `dimension`: a usual unit, or kg, m and s."""
    for unit in _USUAL:
        if dimension(unit) == found:
            return unit
    return in_si(found)
