"""From fitted sets of effects to answers with probabilities (docs/decisions/0007-how-causes-are-weighed.md).

The odds of the sets against an unknown cause come from a logistic regression.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.likelihood.residuals import ChannelMisfit
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.weights import (
    ALL_CHANNELS,
    FittedSet,
    common_misfit,
    least_excess,
    log_misfit,
    log_weight,
    misfit_scale,
)
from diagnosis.settings import WeighingSettings


def weigh(
    sets: Sequence[FittedSet],
    nominal: ChannelMisfit,
    chosen: WeighingSettings,
    whole: ChannelMisfit | None = None,
) -> list[Answer]:
    """Probabilities of the answers.

    Args:
        sets: fitted sets of effects; of two with the same effects the better set counts.
        nominal: misfit of the nominal model, with the same chance differences between runs as the sets.
        whole: misfit of the nominal model without chance differences; None: the sets have none.

    Returns:
        All answers, ``unknown`` among them: the answer first, then the most probable ones. ``unknown`` competes
        with all sets together, and is the answer only where it is more probable than their sum.
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
                s.shown_between_runs,
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
        Answer(key, max(given.share, 0.0), float(probability) + even)
        for (key, given), probability in zip(best.items(), known, strict=True)
        if not given.outside
    ]
    beyond = (1.0 - chosen.even_share) / (1.0 + odds) + float(known[~inside].sum())
    unknown = Answer(UNKNOWN, 1.0, beyond + even)
    if unknown.probability < chosen.unknown_from:
        first = max(found, key=lambda w: w.probability)
        rest = [unknown, *(w for w in found if w is not first)]
    else:
        first, rest = unknown, found
    return [first, *sorted(rest, key=lambda w: -w.probability)]
