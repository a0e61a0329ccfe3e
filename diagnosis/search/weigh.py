"""From fitted sets of effects to answers with probabilities (docs/decisions/0007-how-causes-are-weighed.md).

Real effects never have exactly a textbook form, and at the rig's signal-to-noise ratio every misfit of form is
significant. So sets are weighed by what they leave in every channel of the residuals relative to a scale, and the
odds against an unknown cause are those of a logistic regression.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.residuals import CHANNELS, ChannelMisfit
from diagnosis.settings import WeighingSettings
from tunnel_sim.vocabulary.record import Array

UNKNOWN = ("unknown",)
#: The channels between which a misfit leaks where sets are compared, 1 or 0, shape (6,): an error of the phase,
#: squared, is one of the amplitude. A misfit of the zero or of the harmonics is no error of the phase.
OF_MOTION = np.array([0.0 if name in ("zero", "harmonics") else 1.0 for name in CHANNELS])
#: The same for the odds against ``unknown``, which were fitted with a leak between all channels.
ALL_CHANNELS = np.ones(len(CHANNELS))


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


@dataclass(frozen=True, eq=False)
class FittedSet:
    """What a fitted set of effects leaves.

    Args:
        effects: names, in any order.
        share: of the gap that it leaves open, a fraction; below 0 by chance.
        excess: χ² beyond that of noise by channel, shape (6,), dimensionless.
        numbers: how many it has beside its own: freed forms and instants, less two where gravity replaces a spring.
        outside: whether it is from outside the vocabulary: what is probable of it is probable of ``unknown``.
        scatter_cost: −2 ln of the evidence of chance differences between the runs that it takes, dimensionless.
        compared: how many of the effects are known by the comparison of runs.
    """

    effects: tuple[str, ...]
    share: float
    excess: Array
    numbers: int = 0
    outside: bool = False
    scatter_cost: float = 0.0
    compared: int = 0


def weigh(
    sets: Sequence[FittedSet],
    nominal: ChannelMisfit,
    chosen: WeighingSettings,
    whole: ChannelMisfit | None = None,
) -> list[Weighed]:
    """Probabilities of the answers.

    Args:
        sets: fitted sets of effects; of two with the same effects the better one counts.
        nominal: what the nominal model leaves, with the chance differences between runs that the sets have.
        whole: what it leaves without them; None: there are none.

    Returns:
        All answers, ``unknown`` among them: the answer first, then the most probable ones. ``unknown`` speaks of
        all sets, and is the answer only where it is more probable than all of them together.
    """
    best: dict[tuple[str, ...], FittedSet] = {}
    for given in sets:
        key = tuple(sorted(given.effects))
        if key not in best or given.share < best[key].share:
            best[key] = given
    excesses = [given.excess for given in best.values()]
    least, common = least_excess(excesses), common_misfit(excesses)
    scale = misfit_scale(nominal, chosen, common)
    logs = np.array(
        [
            log_weight(
                s.excess - least,
                scale,
                len(key),
                s.numbers,
                chosen,
                (s.scatter_cost, nominal.scatter_cost),
                s.compared,
            )
            for key, s in best.items()
        ]
    )
    weights = np.exp(logs - logs.max(initial=-np.inf))
    # odds of each set against an unknown cause
    by_chance = misfit_scale(nominal, chosen, common, chosen.chance_stds * np.sqrt(2.0 * nominal.count))
    left_at_first = (nominal if whole is None else whole).excess
    gap, against = log_misfit(left_at_first, by_chance, ALL_CHANNELS, chosen.leak), []
    for given in best.values():
        left = log_misfit(given.excess, by_chance, ALL_CHANNELS, chosen.leak)
        closed = max(1.0 - left / gap, 0.0) if gap > 0.0 else 0.0
        doubt = chosen.unknown_left * (np.log1p(left) - np.log(closed + chosen.least_closed))
        against.append(float(chosen.unknown_at + chosen.unknown_gap * gap - doubt))
    odds = float(weights @ np.exp(against) / weights.sum()) if best else 0.0
    known = (1.0 - chosen.even_share) * odds / (1.0 + odds) * weights / (weights.sum() or 1.0)
    inside = np.array([not given.outside for given in best.values()], bool)
    even = chosen.even_share / (int(inside.sum()) + 1)
    found = [
        Weighed(key, max(given.share, 0.0), float(probability) + even)
        for (key, given), probability in zip(best.items(), known, strict=True)
        if not given.outside
    ]
    beyond = (1.0 - chosen.even_share) / (1.0 + odds) + float(known[~inside].sum())
    unknown = Weighed(UNKNOWN, 1.0, beyond + even)
    if unknown.probability < chosen.unknown_from:
        first = max(found, key=lambda w: w.probability)
        rest = [unknown, *(w for w in found if w is not first)]
    else:
        first, rest = unknown, found
    return [first, *sorted(rest, key=lambda w: -w.probability)]


def least_excess(excesses: Sequence[Array]) -> Array:
    """By channel the least that any set leaves, or 0, shape (6,).

    What chance adds is common to all sets, because they are fitted to the same noise; only differences count.

    Args:
        excesses: χ² beyond noise, each of shape (6,).
    """
    return np.asarray(np.min([np.zeros(6), *excesses], axis=0), np.float64)


def common_misfit(excesses: Sequence[Array]) -> float:
    """The largest χ² of a channel that all sets leave beyond noise: an error of the model that none of them is.

    Args:
        excesses: χ² beyond noise, each of shape (6,).
    """
    return max(0.0, float(np.max(np.min(excesses, axis=0)))) if excesses else 0.0


def misfit_scale(
    nominal: ChannelMisfit,
    chosen: WeighingSettings,
    common: float = 0.0,
    chance: float | Array | None = None,
) -> Array:
    """χ² by channel that needs no cause, shape (6,).

    Beside chance it is that of an error of the model: a share of the amplitude of the gap, since no real effect has
    its textbook form, or what all sets leave if that is more, and a share of the motion at most. Where the runs
    differ by chance, it is also an answer that nothing else acts, and the likelihood decides between them: the
    weight of a small χ² is half of it.

    Args:
        nominal: what the nominal model leaves, and the motion.
        common: χ² of a channel that all sets leave (`common_misfit`), dimensionless.
        chance: χ² that chance explains, by channel or common to all; None: that of a needless effect.
    """
    needless = chosen.needless_chi2 if nominal.repeats else 2.0 * chosen.steepness
    by_chance = needless if chance is None else chance
    by_form = chosen.form_error**2 * float(np.sum(np.maximum(nominal.excess, 0.0)))
    error = min(max(by_form, common), chosen.model_error**2 * nominal.motion)
    return np.asarray(np.broadcast_to(by_chance, 6) + error, np.float64)


def log_weight(
    left: Array,
    scale: Array,
    effects: int,
    numbers: int,
    chosen: WeighingSettings,
    scatter_cost: tuple[float, float] = (0.0, 0.0),
    compared: int = 0,
) -> float:
    """Logarithm of the weight of a set among all sets.

    Args:
        left: χ² by channel beyond that of the best set, shape (6,).
        scale: from `misfit_scale`, shape (6,).
        effects: how many it has.
        numbers: how many it has beside their own.
        scatter_cost: −2 ln of the evidence of chance differences between the runs that it takes, and that the
            nominal model takes. What needless effects may lower it by does not count.
        compared: how many effects could lower it: those known by the comparison of runs.
    """
    own, nominal = scatter_cost
    cost = min(own + chosen.needless_scatter * compared, max(own, nominal))
    price = chosen.set_price * effects + chosen.form_price * numbers + 0.5 * chosen.scatter_exponent * cost
    return -chosen.steepness * log_misfit(left, scale, OF_MOTION, chosen.leak) - price


def log_misfit(left: Array, scale: Array, leaking: Array, leak: float) -> float:
    """Sum over the channels of the logarithm of the misfit, 0 where there is none.

    Args:
        left: χ² by channel, shape (6,), dimensionless.
        scale: from `misfit_scale`, shape (6,).
        leaking: 1 for the channels between which a misfit leaks, else 0, shape (6,): `OF_MOTION` or
            `ALL_CHANNELS`.
        leak: share of the misfit in other channels that counts in a channel.
    """
    above = np.maximum(left, 0.0)
    shared = leaking * above
    return float(np.sum(np.log1p((above + leak * leaking * (shared.sum() - shared)) / scale)))
