"""How effects, channels, conditions and kinds of laws are called in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tunnel_sim.effects import known_effects

Document = Mapping[str, Any]
"""A diagnosis in JSON's types (`Diagnosis.to_json_dict`)."""

CHANNELS = {
    "stiffness": "the restoring moment",
    "damping": "the damping",
    "forcing": "an imposed moment",
    "sensor": "the angle sensor",
    "calibration": "a stated value",
}
"""What a cause acts on, in the verdict."""

PLACES = {
    "stiffness": "the restoring moment (stiffness)",
    "damping": "the damping",
    "forcing": "the rig as a moment that does not depend on its motion (forcing)",
    "sensor": "the reading of the sensor",
    "calibration": "a value stated for the runs (calibration)",
}
"""What a gap acts on, by its residuals."""

CONDITIONS = {"always": "with the wind on and off", "wind_on": "only with the wind on"}
"""When a gap shows."""

BANDS = {
    "0": "slower than the oscillation",
    "f0": "at the oscillation itself",
    "2f0": "at twice its frequency",
    "3f0": "at three times its frequency",
    "above": "faster than its third harmonic",
}
"""Bands of frequency, in multiples of that of the motion."""

MISFITS = {
    "damping": "the damping along the runs",
    "frequency": "the frequency along the runs",
    "damping of runs": "the damping of single runs",
    "frequency of runs": "the frequency of single runs",
    "zero": "the zero",
    "harmonics": "the harmonics",
}
"""Channels in which a set of effects may leave a misfit."""

KINDS: Mapping[str, str] = {
    "angle": "a moment of the angle alone",
    "rate": "a moment of the rate alone",
    "state": "a moment of angle and rate",
    "wind": "a moment of angle and rate with the wind",
    "time": "a moment in time, alike in all runs",
    "reading": "an error of the reading, alike in all runs",
    "line": "a steady line in the reading, of a phase of its own in every run",
    "between": "a stiffness, damping or moment of each run's own",
    "event": "a moment in time of each run's own",
    "wander": "a wandering or jumping zero of each run's own",
    "noise": "nothing smooth: the rest is noise",
}
"""Kinds of what may be missing (`diagnosis.facts.remainder.KINDS`)."""

_ACTS_ON = {**CHANNELS, "sensor": "the reading"}
ACTS_WHEN = {"always": "with or without wind", "wind_on": "only with the wind on"}
"""When a cause acts, beside what it acts on."""


def plain(*names: str) -> str:
    """Effect names as words: ``mains hum, free play and coulomb friction``."""
    *first, last = (name.replace("_", " ") for name in names)
    return f"{', '.join(first)} and {last}" if first else last


def windy(document: Document) -> bool:
    """Whether any run had wind; True where the document does not say."""
    runs = (document.get("maps") or {}).get("runs")
    return not runs or any(run["wind_speed"] > 0.0 for run in runs)


def acts_on(document: Document, effect: str) -> str:
    """What an effect acts on and when, such as ``the damping, with or without wind``; empty for an unknown one."""
    kind = {kind.name: kind for kind in known_effects()}.get(effect)
    if kind is None:
        return ""
    return f"{_ACTS_ON[kind.channel]}{f', {ACTS_WHEN[kind.condition]}' if windy(document) else ''}"
