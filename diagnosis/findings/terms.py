"""Words for the places, conditions, channels and kinds of law that findings name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from diagnosis.findings.finding import Judged
from identification.show.numbers import plain
from tunnel_sim.effects import BetweenRuns
from tunnel_sim.effects.registry import ALL_EFFECTS, known_effects
from tunnel_sim.vocabulary.quantities import Share

CHANNELS = {
    "stiffness": "the restoring moment",
    "damping": "the damping",
    "forcing": "the forcing moment",
    "sensor": "the sensor reading",
    "calibration": "a stated value",
}
"""The object on which a cause or a gap acts."""


CONDITIONS = {"always": "with the wind on and off", "wind_on": "only with the wind on"}
"""The condition under which a cause acts or a gap shows."""


BANDS = {
    "0": "slower than the oscillation",
    "f0": "at the oscillation itself",
    "2f0": "at twice its frequency",
    "3f0": "at three times its frequency",
    "above": "faster than its third harmonic",
}
"""Bands of frequency, in multiples of the motion's frequency."""


MISFITS = {
    "damping": "the damping along the runs",
    "frequency": "the frequency along the runs",
    "damping of runs": "the damping of single runs",
    "frequency of runs": "the frequency of single runs",
    "zero": "the zero",
    "harmonics": "the harmonics",
}
"""Channels in which a set of effects may have a misfit."""


KINDS: Mapping[str, str] = {
    "angle": "a moment of the angle alone",
    "rate": "a moment of the rate alone",
    "state": "a moment of angle and rate",
    "wind": "a moment of angle and rate with the wind",
    "time": "a moment in time, equal in all runs",
    "reading": "an error of the reading, equal in all runs",
    "line": "a steady line in the reading, with its own phase in every run",
    "between": "a stiffness, damping or moment of each run",
    "event": "a moment in time of each run",
    "wander": "a wandering or jumping zero of each run",
    "noise": "nothing smooth: the rest is noise",
}
"""Kinds of missing law (`diagnosis.likelihood.ceiling.KINDS`)."""


def acts_on(answer: Judged, effect: str) -> str:
    """The object and condition of an effect, such as ``the damping, only with the wind on``; empty if unknown."""
    kind = {kind.name: kind for kind in known_effects()}.get(effect)
    if kind is None:
        return ""
    return f"{CHANNELS[kind.channel]}{f', {CONDITIONS[kind.condition]}' if answer.windy else ''}"


SCATTERS = {kind.name: kind.scatters for kind in ALL_EFFECTS if issubclass(kind, BetweenRuns)}
"""The quantity that differs between runs, by the name of the scatter."""


NUMBERS = {
    "wind_speed": "the wind speed",
    "spring_stiffness": "the spring",
    "mechanical_damping": "the mechanical damping",
}
"""The quantities that may differ between runs, in words."""


BETWEEN_RUNS = "scatter between runs"
"""Chance differences between runs, in any quantity, in a few words."""


def without_scatter(names: Iterable[str]) -> list[str]:
    """Causes proper, without chance differences between runs."""
    return [name for name in names if name not in SCATTERS]


def scattering(names: Iterable[str]) -> list[str]:
    """Chance differences between runs among some causes."""
    return [name for name in names if name in SCATTERS]


def named_runs(names: Sequence[str]) -> str:
    """Runs by their ids, such as ``runs r01, r02``."""
    return f"run{'s' if len(names) > 1 else ''} {', '.join(names)}"


def among_answers(effect: str) -> str:
    """An answer by name; its scatter between runs is omitted, because it is stated for all answers together."""
    names = effect.split(" + ")
    proper = without_scatter(names)
    if effect == "unknown":
        return "an unknown cause"
    return plain(*proper) if proper else BETWEEN_RUNS if scattering(names) else plain(effect)


def named_answer(causes: Sequence[str]) -> str:
    """The causes in a few words, such as ``coulomb friction, and scatter between runs``."""
    proper = without_scatter(causes)
    if not scattering(causes):
        return plain(*proper)
    return f"{plain(*proper)}, and {BETWEEN_RUNS}" if proper else BETWEEN_RUNS.capitalize()


def part_of_gap(closed: Share) -> str:
    """The part of a gap that its causes explain, where a part remains."""
    return f"{'nearly all' if closed >= _NEARLY_ALL else 'most' if closed > 0.5 else 'only part'} of the gap"


_NEARLY_ALL = 0.95


def answer_name(effect: str) -> str:
    """Names of effects joined by plus signs; all kinds of scatter between runs are one name."""
    names = effect.split(" + ")
    return " + ".join([*without_scatter(names), *([BETWEEN_RUNS] if scattering(names) else [])])
