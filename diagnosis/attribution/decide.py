"""From fitted hypotheses to an answer with probabilities.

Real effects never have exactly a textbook form, and at rig signal-to-noise every misfit of form is significant.
So hypotheses are weighed by the share of the gap they leave open, not by χ² itself: the weight of a hypothesis
that leaves the share s is (s + δ)^−γ; δ stands for the misfit of form that is common among true causes. One name
is preferred to two unless the second closes most of what the first leaves, and ``unknown`` weighs as much as a
cause that leaves the share `UNKNOWN_SHARE`. The constants come from a tuning set made by another integrator with
other forms (docs/blind-check.md); test sets are drawn with other seeds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tunnel_sim.effects import ALL_EFFECTS

_EXACT = frozenset(kind.name for kind in ALL_EFFECTS if kind.exact)

#: Exponent of the share left open.
STEEPNESS = 3.0
#: Misfit of form that counts as none, as a share of the gap.
FORM_MISFIT = 0.005
#: The same of effects that have no form to miss.
EXACT_MISFIT = 0.001
#: Excess of block means beyond which that share no longer grows with the gap: a motion missed grossly is no
#: reason to overlook a second effect a thousand times the noise.
FORM_MISFIT_UP_TO = 1000.0
#: Share at which a cause is as likely as an unknown one.
UNKNOWN_SHARE = 0.2
#: A second effect must leave less than this share of what the first leaves.
PAIR_SHARE = 0.40
#: A freed form must leave less than this share of what is left without it.
FORM_SHARE = 0.80
#: Share of the probability that is spread evenly over all answers: how often one of overwhelming weight was wrong
#: on the tuning sets, where something was at work that neither fits nor rivals know.
LAPSE = 0.03
#: Answers less likely than this are not called rivals.
RIVAL_PROBABILITY = 0.05


@dataclass(frozen=True)
class Weighed:
    """An answer and its probability.

    Args:
        effects: names, sorted; ``("unknown",)`` for a gap nothing closes.
        share: share of the gap it leaves open, at least 0.
        probability: among all answers weighed, a fraction.
    """

    effects: tuple[str, ...]
    share: float
    probability: float


def form_floor(excess: float, effects: Sequence[str] = ()) -> float:
    """Share of the gap that a misfit of form may leave.

    Args:
        excess: of the nominal model's block means.
        effects: that were fitted.

    Returns:
        The share.
    """
    misfit = EXACT_MISFIT if effects and _EXACT.issuperset(effects) else FORM_MISFIT
    return misfit * min(1.0, FORM_MISFIT_UP_TO / max(excess, 1e-9))


def weigh(
    shares: Sequence[tuple[tuple[str, ...], float]],
    chance: float,
    excess: float,
    outside: float = UNKNOWN_SHARE,
    forms: Mapping[tuple[str, ...], int] | None = None,
) -> list[Weighed]:
    """Probabilities of the answers.

    Args:
        shares: effect names and share of the gap they leave open, for singles and pairs.
        chance: standard deviation of a share by chance alone.
        excess: of the nominal model's block means.
        outside: share that something outside the vocabulary leaves open; counts where it is below `UNKNOWN_SHARE`.
        forms: how many forms were freed, by sorted effect names; 0 where not given.

    Returns:
        All answers, ``unknown`` among them, most probable first.
    """

    def floor(names: Sequence[str]) -> float:
        return form_floor(excess, names) + 2.0 * chance

    answers: dict[tuple[str, ...], float] = {}
    for names, share in shares:
        key = tuple(sorted(names))
        answers[key] = min(max(share, 0.0), answers.get(key, np.inf))
    freed = forms or {}
    weights = {
        names: _evidence(share, floor(names)) * _prior(len(names), freed.get(names, 0))
        for names, share in answers.items()
    }
    answers[("unknown",)] = min(UNKNOWN_SHARE, max(outside, 0.0))
    weights[("unknown",)] = _evidence(answers[("unknown",)], floor(()))
    total, even = sum(weights.values()), LAPSE / len(weights)
    found = [
        Weighed(names, answers[names], (1.0 - LAPSE) * weight / total + even)
        for names, weight in weights.items()
    ]
    return sorted(found, key=lambda w: -w.probability)


def _evidence(share: float, floor: float) -> float:
    """Weight of an answer that leaves a share of the gap: the density of such a share under a true cause.

    Beyond `UNKNOWN_SHARE` it falls three times as steeply: many effects that close little must not together
    outweigh the unknown one.
    """
    known = floor ** (STEEPNESS - 1.0) * (share + floor) ** -STEEPNESS
    beyond = (UNKNOWN_SHARE + floor) / (max(share, UNKNOWN_SHARE) + floor)
    return float(known * beyond ** (2.0 * STEEPNESS))


def _prior(count: int, forms: int) -> float:
    """A pair, and a freed form, start behind by what they must close more than one textbook effect."""
    return float(PAIR_SHARE ** (STEEPNESS * max(0, count - 1)) * FORM_SHARE ** (STEEPNESS * forms))
