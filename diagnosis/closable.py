"""How much of what no effect explains could be closed, by kind, and the law that would do it, with their JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from identification.printing import TextTable
from tunnel_sim.effects import known_effects
from tunnel_sim.files.json_text import as_json

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
"""Kinds of what may be missing, in words; ``noise`` where none of the others closes much."""


@dataclass(frozen=True)
class Ceiling:
    """How much one kind could close at most.

    Args:
        kind: of `KINDS`.
        closed: share of what is left, on readings held out of the fit; negative where the prediction is worse.
        std: its standard deviation from the scatter of the runs, a share.
        held_out: what was held out, in words.
    """

    kind: str
    closed: float
    std: float
    held_out: str


@dataclass(frozen=True)
class Curve:
    """The missing moment, or error of the reading, where it depends on one quantity or two.

    Args:
        over: the quantities: ``angle`` (rad), ``rate`` (rad/s) or ``time`` (s).
        places: of every quantity, where the curve is given.
        values: at all places, the last quantity running fastest, in ``unit``. A part in proportion to angle or rate
            belongs to the model's own coefficients, and is taken out.
        std: their standard deviations, in ``unit``.
        unit: of values and standard deviations.
    """

    over: tuple[str, ...]
    places: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]
    std: tuple[float, ...]
    unit: str


@dataclass(frozen=True)
class Law:
    """A formula that explains what is missing, fitted like any other effect.

    Args:
        effect: table of an effects file that states it.
        parameters: value and standard deviation by name, in the unit that the table states.
        closed: share of what is left that it closes, on runs held out of the fit.
        std: its standard deviation from the scatter of the runs, a share.
    """

    effect: Mapping[str, Any]
    parameters: Mapping[str, tuple[float, float]]
    closed: float
    std: float

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; of the parameters ``value`` and ``std``."""
        parameters = {name: {"value": value, "std": std} for name, (value, std) in self.parameters.items()}
        effect = as_json(self.effect)
        return {"effect": effect, "parameters": parameters, "closed": self.closed, "std": self.std}


@dataclass(frozen=True)
class Closable:
    """What could be closed of what the answer leaves.

    Args:
        excess: that the answer leaves in the fitted runs, in noise variances of a sample.
        ceilings: by kind.
        kind: the simplest that closes about as much as any, of `KINDS`.
        words: the same in a sentence or two.
        curve: of that kind; None where it has none.
        law: a formula; None where none is supported.
        events: where a kind that differs from run to run lies: ``run``, its ``share``, ``from_s`` and ``to_s``.
    """

    excess: float
    ceilings: tuple[Ceiling, ...]
    kind: str
    words: str
    curve: Curve | None = None
    law: Law | None = None
    events: tuple[Mapping[str, Any], ...] = field(default=())

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, in JSON's types."""
        return {
            "excess": self.excess,
            "ceilings": as_json(self.ceilings),
            "kind": self.kind,
            "words": self.words,
            "events": as_json(self.events),
            "curve": as_json(self.curve),
            "law": as_json(self.law),
        }


def closable_words(document: Mapping[str, Any]) -> str:
    """What could be closed, in words.

    Returns:
        A line; empty where there is no gap, or it was not found.
    """
    if found := document.get("closable"):
        return f"What could be closed: {found['words']}"
    rest = document.get("rest")
    if not rest or not document["causes"]:
        return ""
    if not rest["significant"]:
        return f"What could be closed: nothing beyond chance (p = {rest['p_value']:.2g})."
    if any(kind.random for kind in known_effects() if kind.name in document["causes"]):
        return "What could be closed is not stated: beside a random moment any law would close something."
    return ""


def closable_table(document: Mapping[str, Any]) -> TextTable:
    """How much each kind could close.

    Returns:
        A table of shares in per cent with one standard deviation; without rows where nothing remains beyond chance.
    """
    found = document.get("closable") or {"ceilings": ()}
    rows = [
        (KINDS[one["kind"]], percent(max(one["closed"], 0.0), one["std"]), one["held_out"])
        for one in found["ceilings"]
    ]
    return TextTable(
        "Share of what is left that could be closed at most",
        ("by", "share", "held out"),
        tuple(rows),
        ("share",),
    )


def percent(share: float, std: float | None = None) -> str:
    """A share in per cent with its standard deviation.

    Args:
        share: a fraction.
        std: likewise; None: not given.

    Returns:
        Text such as ``94.2 ± 0.6 %``; a standard deviation beyond 100 % is not resolved further.
    """
    beside = "" if std is None else f" ± {min(max(100.0 * std, 0.1), 100.0):.1f}"
    return f"{min(100.0 * share, 100.0):.1f}{beside} %"
