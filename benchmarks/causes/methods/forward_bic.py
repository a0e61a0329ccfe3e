"""Forward selection by BIC on the project's own fits: the most common approach."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.causes.entry import UNKNOWN, About, answer_of, main

MOST, CLOSED = 4, 0.5
ABOUT = About(
    "forward selection by BIC",
    f"all causes tried at every step in their textbook form, up to {MOST}; it stops where BIC rises; "
    f"`unknown` where the chosen "
    f"set leaves {CLOSED:g} of the gap; probabilities are BIC weights of all sets fitted",
)


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    from benchmarks.causes.fits import candidates, nominal

    start, read_off, detected = nominal(folder)
    before = start.coefficients
    if not detected:
        return answer_of(read_off, dict.fromkeys(read_off, 0.99), (), {"before": before, "after": before})
    best, fitted = start, [start]
    while len(best.names) < MOST:
        others = [best.with_one_more(n) for n in candidates() if n not in best.names]
        found = [one for one in others if one is not None]
        fitted += found
        following = min(found, key=lambda f: bic(f.chi2, f.numbers, f.rows), default=best)
        if bic(following.chi2, following.numbers, following.rows) >= bic(best.chi2, best.numbers, best.rows):
            break
        best = following
    coefficients = {"before": before, "after": best.coefficients}
    gap = start.chi2 - start.rows
    if best.chi2 - best.rows > CLOSED * gap and not read_off:
        return answer_of([UNKNOWN], {UNKNOWN: 0.7}, (), coefficients)
    sets, inclusion = weighed(
        [((*one.names, *read_off), bic(one.chi2, one.numbers, one.rows)) for one in fitted]
    )
    return answer_of(sorted({*best.names, *read_off}), inclusion, sets, coefficients)


def weighed(
    fitted: Sequence[tuple[Sequence[str], float]],
) -> tuple[list[tuple[tuple[str, ...], float]], dict[str, float]]:
    """The 40 likeliest sets with their BIC weights, and the inclusion probability of each cause by name.

    Args:
        fitted: names and BIC of every fitted set.
    """
    scores = np.array([score for _, score in fitted])
    weights = np.exp(-0.5 * (scores - scores.min()))
    sets: dict[tuple[str, ...], float] = {}
    for (causes, _), weight in zip(fitted, (weights / weights.sum()).tolist(), strict=True):
        names = tuple(sorted({*causes}))
        sets[names] = sets.get(names, 0.0) + weight
    inclusion = {n: min(sum(p for s, p in sets.items() if n in s), 1.0) for n in {n for s in sets for n in s}}
    return sorted(sets.items(), key=lambda one: -one[1])[:40], inclusion


def bic(chi2: float, numbers: int, rows: int) -> float:
    """Bayesian information criterion for noise of known variance.

    Args:
        chi2: sum of squared residuals, noise variances.
        numbers: number of parameters in addition to the nominal model.
        rows: number of residuals.
    """
    return chi2 + numbers * float(np.log(rows))


if __name__ == "__main__":
    main(answer)
