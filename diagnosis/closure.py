"""How far the gap closes with each cause, and what remains after all of them, and their JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tunnel_sim.files.json_text import as_json


def share_closed(before: float, after: float) -> float:
    """Share of a gap that closes, 0 to 1.

    Args:
        before: excess of the nominal model, in noise variances of a sample.
        after: excess with the causes, in noise variances of a sample.
    """
    return min(max(1.0 - max(after, 0.0) / before, 0.0), 1.0) if before > 0.0 else 0.0


@dataclass(frozen=True)
class Step:
    """The model with one more cause.

    Args:
        effect: name of the cause added; None for the nominal model.
        excess: with it and all causes before it, on readings held out of the fit, in noise variances of a sample.
    """

    effect: str | None
    excess: float


@dataclass(frozen=True)
class Waterfall:
    """How far the gap closes as the causes are added one after another.

    Args:
        steps: the nominal model first; then the cause that closes most, and so on.
        without: excess by cause, when it alone is taken out and the others are refitted, likewise held out. A cause
            beside a random moment has none: the random moment would absorb it.
        held_out: what was held out, in words.
    """

    steps: tuple[Step, ...] = ()
    without: Mapping[str, float] = field(default_factory=dict)
    held_out: str = ""

    def to_json_dict(self) -> dict[str, Any]:
        """The fields of a document: ``waterfall``, ``waterfall_on`` and ``without``."""
        return {
            "waterfall": as_json(self.steps),
            "waterfall_on": self.held_out,
            "without": dict(self.without),
        }


@dataclass(frozen=True)
class Move:
    """How far what remains moves a coefficient.

    Args:
        value: half the difference between the halves of the data that differ most, beyond chance, in ``unit``.
        relative: the same over the coefficient's absolute value, a fraction; None where the coefficient is zero.
        std: standard deviation stated for the coefficient, in ``unit``; None where the runs do not determine it.
        unit: of the coefficient.
    """

    value: float
    relative: float | None
    std: float | None
    unit: str


@dataclass(frozen=True)
class Rest:
    """What remains after the named causes; the whole gap where none is named.

    Args:
        significant: whether it is beyond chance, by the tests of the gap.
        excess: on readings held out of the fit, in noise variances of a sample.
        p_value: of the strongest test, corrected for the number of tests.
        material: whether it is significant and moves a coefficient by more than its standard deviation or by 1 %.
        moves: by coefficient.
        words: the same in a sentence.
    """

    significant: bool
    excess: float
    p_value: float
    material: bool
    moves: Mapping[str, Move]
    words: str
