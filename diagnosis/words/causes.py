"""What a cause does, in sentences."""

from __future__ import annotations

from diagnosis.words.names import Document
from diagnosis.words.numbers import unit_shown
from identification.printing import significant

_VISIBLE = 0.005  # of a damping ratio: a change that is said
_VISIBLE_FREQUENCY = 5e-5  # as a fraction, likewise


def size_words(document: Document, size: Document) -> str:
    """What a cause of ``sizes`` does to a swing, in a sentence; damping and frequency where they change visibly."""
    mark, factor = unit_shown((document.get("maps") or {}).get("unit", "rad"))
    angle = unit_shown("rad")[1]
    said = []
    zeta, without = size["damping_ratio"], size["damping_ratio_without"]
    if abs(zeta - without) > _VISIBLE * max(abs(zeta), abs(without)):
        said.append(f"damping ratio {significant(without, 3)} becomes {significant(zeta, 3)}")
    if abs(size["frequency_change"]) > _VISIBLE_FREQUENCY:
        change = 100.0 * size["frequency_change"]
        said.append(f"frequency {'+' if change > 0.0 else ''}{significant(change, 2)} %")
    reading = factor * size["reading_change"]
    if abs(size["zero_change"]) > 0.5 * size["reading_change"]:
        said.append(f"the middle moves by {significant(factor * size['zero_change'], 2)}{_spaced(mark)}")
    said.append(f"the reading changes by {significant(reading, 2)}{_spaced(mark)} root mean square")
    held = angle * size["stands_rad"]
    stands = f"; it stops the body up to {significant(held, 2)}° from rest" if held > 0.0 else ""
    amplitude = significant(angle * size["amplitude_rad"], 2)
    return f"Over three cycles from {amplitude}°: {', '.join(said)}{stands}"


def _spaced(mark: str) -> str:
    return mark if mark == "°" else f" {mark}"
