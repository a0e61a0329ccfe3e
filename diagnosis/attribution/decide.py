"""From fitted hypotheses to answers with probabilities (docs/decisions/0007-how-causes-are-weighed.md).

Real effects never have exactly a textbook form, and at the rig's signal-to-noise ratio every misfit of form is
significant. So hypotheses are weighed by the share s of the gap that they leave open, not by χ² itself:

    weight = δ^(γ−1) (s + δ)^−γ [(u + δ)/(max(s, u) + δ)]^2γ

δ is the misfit of form that is common among true causes, γ is `STEEPNESS` and u is `UNKNOWN_SHARE`. A second effect
must close most of what the first leaves. Against a set of n effects ``unknown`` weighs as much as such a set that
leaves the share u `UNKNOWN_FURTHER`^(n−1): effects that do not act close an unknown gap little further.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.policy import (
    CHANCE_STDS,
    EVEN_SHARE,
    EXACT_MISFIT,
    FORM_MISFIT,
    FORM_MISFIT_UP_TO,
    FORM_SHARE,
    NEEDLESS_CHI2,
    PAIR_SHARE,
    PLACE_WRONG,
    STEEPNESS,
    STEEPNESS_BEYOND,
    UNKNOWN_FURTHER,
    UNKNOWN_SHARE,
)
from tunnel_sim.effects import known_effects

UNKNOWN = ("unknown",)


@dataclass(frozen=True)
class Weighed:
    """An answer and its probability.

    Args:
        effects: names, sorted; ``("unknown",)`` for a gap that no effect closes.
        share: share of the gap it leaves open, at least 0.
        probability: among all answers weighed, a fraction.
    """

    effects: tuple[str, ...]
    share: float
    probability: float


def form_floor(excess: float, effects: Sequence[str] = ()) -> float:
    """Share of the gap that a misfit of form may leave.

    Args:
        excess: of the nominal model's block means, above 0.
        effects: that were fitted.
    """
    exact = {kind.name for kind in known_effects() if kind.exact}
    misfit = EXACT_MISFIT if effects and exact.issuperset(effects) else FORM_MISFIT
    return misfit * min(1.0, FORM_MISFIT_UP_TO / excess)


def weigh(
    shares: Sequence[tuple[tuple[str, ...], float]],
    chance: float,
    excess: float,
    outside: float = UNKNOWN_SHARE,
    numbers: Mapping[tuple[str, ...], int] | None = None,
    place: str | None = None,
) -> list[Weighed]:
    """Probabilities of the answers.

    Args:
        shares: effect names and share of the gap they leave open, for sets of any size; below 0 by chance.
        chance: standard deviation of a share by chance alone.
        excess: of the nominal model's block means.
        outside: share that a cause outside the vocabulary leaves open; `UNKNOWN_SHARE` at most counts.
        numbers: as `evidence` takes them, by sorted effect names; 0 where not given.
        place: the channel that the residuals alone show; None: none.

    Returns:
        All answers, ``unknown`` among them, most probable first.
    """
    answers: dict[tuple[str, ...], float] = {}
    for names, share in shares:
        key = tuple(sorted(names))
        answers[key] = min(share, answers.get(key, np.inf))
    least = min((0.0, *answers.values()))
    weights: dict[tuple[str, ...], float] = {}
    odds = 0.0
    for names, share in answers.items():
        further = (numbers or {}).get(names, 0)
        agrees = _agreement(names, answers, place)
        weights[names] = agrees * evidence(names, share - least, further, excess, chance)
        odds += agrees * _odds_against_unknown(names, share, further, outside, excess, chance)
    known = odds / (1.0 + odds) / (sum(weights.values()) or 1.0)
    probabilities = {names: known * weight for names, weight in weights.items()}
    answers = {names: max(share, 0.0) for names, share in answers.items()}
    answers[UNKNOWN], probabilities[UNKNOWN] = min(UNKNOWN_SHARE, max(outside, 0.0)), 1.0 / (1.0 + odds)
    even = EVEN_SHARE / len(answers)
    found = [
        Weighed(names, share, (1.0 - EVEN_SHARE) * probabilities[names] + even)
        for names, share in answers.items()
    ]
    return sorted(found, key=lambda w: -w.probability)


def main_effect(effects: Sequence[str], shares: Mapping[tuple[str, ...], float]) -> str:
    """The effect of a set that leaves least by itself: a small one beside it would agree with any place of the gap.

    Args:
        shares: of the gap that sets leave, fractions, single effects among them.
    """
    return min(effects, key=lambda name: shares.get((name,), np.inf))


def _agreement(effects: Sequence[str], shares: Mapping[tuple[str, ...], float], place: str | None) -> float:
    """Weight of a set by whether its main effect acts in the channel that the residuals show."""
    main = main_effect(effects, shares)
    channel = next((kind.channel for kind in known_effects() if kind.name == main), place)
    return 1.0 if place in (None, channel) else PLACE_WRONG / (1.0 - PLACE_WRONG)


def evidence(effects: Sequence[str], share: float, numbers: int, excess: float, chance: float) -> float:
    """Weight of a set of effects among all sets.

    The sets are fitted to the same noise. What chance adds to the shares is common to them, however much it is, and
    only their differences count: an effect that does not act seldom lowers χ² by more than `NEEDLESS_CHI2`.

    Args:
        share: of the gap that they leave open, a fraction; above that of the best set where that is below 0.
        numbers: how many they have beside their own: freed forms, less a spring that gravity replaces.
        excess: of the nominal model's block means.
        chance: standard deviation of a share by chance alone.
    """
    needless = NEEDLESS_CHI2 * chance**2 * excess / 2.0  # χ² as a share of the gap
    return _density(share, form_floor(excess, effects) + needless) * _prior(len(effects), numbers)


def _odds_against_unknown(
    effects: Sequence[str], share: float, numbers: int, outside: float, excess: float, chance: float
) -> float:
    """Weight of a set of effects over that of ``unknown``; an outsider that closes more weighs as one effect."""
    by_chance = CHANCE_STDS * chance
    known = _density(max(share, 0.0), form_floor(excess, effects) + by_chance) * _prior(len(effects), numbers)
    floor = form_floor(excess) + by_chance
    if outside < UNKNOWN_SHARE:
        return known / _density(max(outside, 0.0), floor)
    further = len(effects) - 1
    return known / (_density(UNKNOWN_SHARE * UNKNOWN_FURTHER**further, floor) * _prior(len(effects), 0))


def _density(share: float, floor: float) -> float:
    """Weight of an answer that leaves a share of the gap: the density of such a share under a true cause.

    Beyond `UNKNOWN_SHARE` it falls three times as steeply, so that many effects that close little do not together
    outweigh ``unknown``.
    """
    known = floor ** (STEEPNESS - 1.0) * (share + floor) ** -STEEPNESS
    beyond = (UNKNOWN_SHARE + floor) / (max(share, UNKNOWN_SHARE) + floor)
    return float(known * beyond**STEEPNESS_BEYOND)


def _prior(count: int, numbers: int) -> float:
    """Prior weight: every further effect and every further number must close so much more of what is left."""
    return float(PAIR_SHARE ** (STEEPNESS * max(0, count - 1)) * FORM_SHARE ** (STEEPNESS * numbers))
