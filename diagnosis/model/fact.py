"""Facts: findings whose sentences depend on their kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tunnel_sim.files.from_json import from_json_fields
from tunnel_sim.files.writing import as_json


@dataclass(frozen=True)
class Fact:
    """One finding; its sentence is in `diagnosis.findings`, under its kind.

    Args:
        figures: the quantities in the sentence, by name, in JSON's types; the names of numbers contain their
            units.
    """

    kind: str
    figures: Mapping[str, Any] = field(default_factory=dict)

    def to_json_dict(self) -> dict[str, Any]:
        """The kind, and the figures by name beside it."""
        return {"kind": self.kind, **as_json(self.figures)}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Kind and figures."""
        return {"kind": data["kind"], "figures": {name: data[name] for name in data if name != "kind"}}


def as_stated(words: str, kind: str = "stated", figures: Mapping[str, Any] = {}, *, remedy: str = "") -> Fact:
    """A sentence from a nominal model or a rival, as a fact.

    Args:
        figures: the quantities in the sentence, as in `Fact`.
        remedy: what to do about it, a sentence without its full stop, which is added to the words; empty: nothing.
    """
    said = f"{words} {remedy}." if remedy else words
    return Fact(kind, {**figures, "words": said, "remedy": remedy})


@dataclass(frozen=True)
class Noted:
    """A fact about the noise of some runs, stated among the remarks on the records.

    Args:
        runs: ids of the runs.
    """

    runs: tuple[str, ...]
    fact: Fact

    def to_json_dict(self) -> dict[str, Any]:
        """The fact's fields and ``runs``."""
        return {**self.fact.to_json_dict(), "runs": list(self.runs)}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Runs and fact."""
        return {"runs": data["runs"], "fact": {name: data[name] for name in data if name != "runs"}}
