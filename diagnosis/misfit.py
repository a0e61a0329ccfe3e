"""A gap in the units that people use: root mean square, in degrees where the readings are angles."""

from __future__ import annotations

import math

DEGREE = "°"


def unit_shown(unit: str) -> tuple[str, float]:
    """The unit in which readings are shown to people.

    Args:
        unit: of the readings: ``rad``, ``rad/s`` or ``rad/s2``.

    Returns:
        Its mark, and the factor on values in ``unit``.
    """
    return {"rad": DEGREE, "rad/s": "°/s", "rad/s2": "°/s²"}[unit], math.degrees(1.0)
