"""A field of the settings: its value with its unit, its decision, and the origin of the value."""

from __future__ import annotations

from dataclasses import field
from typing import Any, Literal

Origin = Literal["convention", "physics", "estimated", "tuned", "judgement"]
"""*Convention* is a customary level or the meaning of a word; *physics* follows from the rig. *Estimated* is
fitted to campaigns of known causes, *tuned* is set by hand on such campaigns; blind tests use others.
*Judgement* is chosen by reason alone."""

ONE_IN_1000 = "One campaign in a thousand."
BY_CHANCE = "Two parameters lower χ² by more than 20 by chance once in 22,000 effects tried."


def setting(
    default: float, meaning: str, origin: Origin, why: str = "", *, unit: str = "1", decision: str = ""
) -> Any:
    """A field of a dataclass of settings.

    Args:
        default: the value, in ``unit``.
        meaning: meaning of the value, in a sentence.
        why: reason for the value, or the data to which it was fitted, in a sentence or two.
        unit: ``1`` for a share, a ratio or a logarithm.
        decision: number of the document in docs/decisions with the details.
    """
    about = {"unit": unit, "meaning": meaning, "origin": origin, "why": why, "decision": decision}
    return field(default=default, metadata=about)


def rate(of: str, default: float = 0.001, *, why: str | None = None, origin: Origin = "convention") -> Any:
    """A field with the false-alarm rate of a test.

    Args:
        of: the test, without the full stop of its sentence.
        default: the rate, 1.
        why: as in `setting`; None: the rate needs no other reason.
    """
    usual = ONE_IN_1000 if default == 0.001 else ""
    return setting(default, f"False-alarm rate of {of}.", origin, usual if why is None else why)
