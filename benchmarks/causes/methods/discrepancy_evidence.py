"""Evidence with the model's error integrated out, on the sets of causes that the project's diagnosis grows.

Every set has its log evidence under a model error of rms η; η has a half-Cauchy prior; every cause after
the first has the same prior odds. Where the model error explains more than a fifth of the gap, the cause is
unknown.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import logsumexp

from benchmarks.causes.discrepancy import ETA, Discrepancy, ErrorEvidence, linear
from benchmarks.causes.entry import UNKNOWN, About, answer_of, main

SCALE, ODDS, LEFT = 0.05, 0.1, 0.2
RANDOM_NUMBERS = 9.0  # price in nats for the three numbers of a random moment
ABOUT = About(
    "discrepancy evidence",
    f"on all sets that `tunnel diagnose` fits, with its test of the gap; half-Cauchy η of scale {SCALE:g} of the "
    f"gap's rms, prior odds {ODDS:g} for every cause after the first, `unknown` where the model's error takes "
    f"{LEFT:g} of the gap, as set before on other campaigns",
)

Names = tuple[str, ...]


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    from benchmarks.causes.fits import grown

    found = grown(folder)
    before = found.nominal.coefficients
    if found.settled is not None:
        sure = 0.97 if found.read_off else 0.999
        stated = {n: sure for n in found.settled}
        return answer_of(
            found.settled,
            stated,
            [(found.settled, sure), ((UNKNOWN,), 1.0 - sure)] if found.settled != (UNKNOWN,) else (),
            {"before": before, "after": before},
        )
    error = Discrepancy.of(found.nominal.fit)
    alone = error.evidence(linear(found.nominal.fit, error.along))
    sets = {one.names: error.evidence(linear(one.fit, error.along)) for one in found.sets}
    random = {names: (sets.get(beside, alone), drop) for names, beside, drop in found.random}
    weights = weigh(alone, sets, random)
    stated = {n if n == (UNKNOWN,) else tuple(sorted({*n, *found.read_off})): p for n, p in weights.items()}
    best = max(weights, key=weights.__getitem__)
    causes = max(stated, key=stated.__getitem__)
    inclusion = {
        n: min(sum(p for s, p in stated.items() if n in s), 1.0) for n in {n for s in stated for n in s}
    }
    fitted = {one.names: one.coefficients for one in found.sets}
    order = sorted(stated.items(), key=lambda one: -one[1])[:40]
    return answer_of(causes, inclusion, order, {"before": before, "after": fitted.get(best, before)})


def weigh(
    nominal: ErrorEvidence,
    sets: Mapping[Names, ErrorEvidence],
    random: Mapping[Names, tuple[ErrorEvidence, float]],
) -> dict[Names, float]:
    """Probability of every set and of ``("unknown",)``.

    Args:
        nominal: evidence of the nominal model.
        sets: evidence by names of the causes.
        random: for sets with a random moment, by names of the causes: the evidence of the other causes, and the
            decrease of −2 ln L by the moment.
    """
    hyper = np.log(ETA) - np.log1p((ETA / SCALE) ** 2)  # density of log η
    hyper -= logsumexp(hyper)
    known: dict[Names, float] = {}
    unknown = [float(logsumexp(nominal.log + hyper))]
    for names, found in sets.items():
        log = found.log + hyper + np.log(ODDS) * (len(names) - 1)
        small = found.error_share <= LEFT
        known[names] = float(logsumexp(log, b=small)) if small.any() else -np.inf
        unknown.append(float(logsumexp(log, b=~small)) if not small.all() else -np.inf)
    for names, (beside, drop) in random.items():
        log_random = -0.5 * (beside.alone - drop) + beside.occam - RANDOM_NUMBERS
        log_random += np.log(ODDS) * (len(names) - 1)
        known[names] = max(known.get(names, -np.inf), log_random)
    logs = known | {(UNKNOWN,): float(logsumexp(unknown))}
    weights = np.exp(np.array(list(logs.values())) - logsumexp(list(logs.values())))
    return dict(zip(logs, weights.tolist(), strict=True))


if __name__ == "__main__":
    main(answer)
