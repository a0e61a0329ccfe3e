"""For every effect the probability that it is among the causes."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.policy import GAP_FALSE_ALARM_RATE
from diagnosis.result import Candidate
from tunnel_sim.effects import known_effects


def inclusion(candidates: Sequence[Candidate], read_off: Sequence[str]) -> dict[str, float]:
    """Probabilities by effect of the vocabulary.

    Args:
        candidates: the answers with their probabilities.
        read_off: causes read off the records before any fit.

    Returns:
        The sum of the probabilities of the answers that name the effect; of a cause read off the records 1 minus
        the rate at which a campaign without a gap is said to have one.
    """
    names = [frozenset(candidate.effect.split(" + ")) for candidate in candidates]
    found = {}
    for kind in known_effects():
        named = [c.probability for c, own in zip(candidates, names, strict=True) if kind.name in own]
        found[kind.name] = min(sum(named), 1.0)
    return found | dict.fromkeys(read_off, 1.0 - GAP_FALSE_ALARM_RATE)
