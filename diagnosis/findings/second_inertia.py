"""The sentence on a second inertia of a joint behind a spring, and on its evidence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identification.show.numbers import for_people, plain


def second_inertia_words(found: Mapping[str, Any]) -> str:
    """A second inertia that would explain the gap, the frequencies that show it, and where the sensor is."""
    beside = f" beside {plain(*found['beside'])}" if found["beside"] else ""
    first = (
        "A second inertia behind a spring, between motor and link, would explain the gap"
        f"{beside}; it is not in the vocabulary. From moment to angle there is "
    )
    resonance = f"a resonance at {_hertz(found['resonance'])}"
    if "ratio" not in found:
        return (
            f"{first}{resonance} without an antiresonance: the angle is measured at the link. A resonance of the "
            "actuator or the sensor would look alike. Measure the angle at the motor, too."
        )
    ratio = for_people(found["ratio"]["value"], found["ratio"]["std"], "1")
    return (
        f"{first}an antiresonance at {_hertz(found['antiresonance'])} and {resonance}: the angle is measured at "
        f"the motor, and the link's inertia is {ratio} times the motor's. Lock the link, or measure its angle, too."
    )


def _hertz(found: Mapping[str, float]) -> str:
    return for_people(found["frequency_hz"], found["std_hz"], "Hz")
