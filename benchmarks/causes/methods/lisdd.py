"""LISDD's recipe (arXiv 2606.23215) from a summary of it, on the residual moment.

Localise: the regimes of the motion in which the residual exceeds the noise. Identify: by exhaustive search among
the terms that act there, the set of up to three that best predicts a held-out third. Decide: F-tests of its terms
on another third, not used for selection or fit, with the false-discovery rate controlled (Benjamini and Hochberg
1995). Details missing from the summary are chosen here and stated in `ABOUT`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from benchmarks.causes.entry import UNKNOWN, About, answer_of, main
from benchmarks.causes.moments import DETECTED, NAMES, NOT_SEEN, Array, Equations, Regression, equations

LEVEL, MOST, ACTS, GAIN, BLOCKS = 0.05, 3, 0.5, 0.02, 24
ABOUT = About(
    "LISDD's recipe",
    f"regimes: amplitude (3) × quadrant of the phase (4), flagged above {DETECTED} noise variances; "
    f"terms with {ACTS:g} of their "
    f"power there; all sets of up to {MOST}, a larger one where it leaves {GAIN:g} of the gap less on "
    f"the held-out third; "
    f"thirds by blocks of 1/{BLOCKS} of a run; F-tests at a false-discovery rate of {LEVEL}; from a "
    f"summary of the recipe, not from its authors' program",
    (*NAMES, UNKNOWN),
    NOT_SEEN,
)


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    where = equations(folder)
    data = Regression.of(where)
    if data.gap < DETECTED:
        return answer_of([], dict.fromkeys(data.causes, 0.01))
    third = (where.run + np.floor(where.time * BLOCKS).astype(np.int64)) % 3
    chosen = exhaustive(data, localised(where, data), third)
    p = {name: f_test(data, chosen, name, third == 2) for name in chosen}
    named = data.verdict(benjamini_hochberg(p))
    stated = {name: 1.0 - min(value * len(p), 1.0) for name, value in p.items()}
    rest = {name: 0.05 for name in data.causes if name not in stated}
    if named == [UNKNOWN]:
        return answer_of(named, {**{n: 0.3 * v for n, v in (stated | rest).items()}, UNKNOWN: 0.7})
    return answer_of(named, {n: min(v, 0.95) for n, v in (stated | rest).items()})


def localised(where: Equations, data: Regression) -> list[str]:
    """The causes that act where the residual exceeds the noise.

    Args:
        where: amplitude and phase of the rows.
    """
    regime = np.digitize(where.level, (0.25, 0.5)) * 4 + (where.phase // (0.5 * np.pi)).astype(int) % 4
    flagged = np.zeros(regime.size, bool)
    for one in np.unique(regime):
        inside = regime == one
        flagged[inside] = float(np.mean(data.target[inside] ** 2)) > DETECTED
    return [n for n, c in data.causes.items() if float(np.sum(c[flagged] ** 2)) > ACTS * float(np.sum(c**2))]


def exhaustive(data: Regression, names: Sequence[str], third: NDArray[np.int64]) -> tuple[str, ...]:
    """The set that best predicts the second third after a fit to the first; larger sets need a sufficient gain.

    Args:
        third: number of each row's third, shape (rows,).
    """
    fit, held = third == 0, third == 1
    owner = np.array([n for n in names for _ in range(data.causes[n].shape[1])])
    if not owner.size:
        return ()
    columns = np.column_stack([data.causes[n] for n in names])
    gram, load = columns[fit].T @ columns[fit], columns[fit].T @ data.target[fit]
    test, test_load = columns[held].T @ columns[held], columns[held].T @ data.target[held]
    power = float(data.target[held] @ data.target[held])
    best: tuple[str, ...] = ()
    least = power
    for size in range(1, MOST + 1):
        scored = []
        for chosen in combinations(names, size):
            at = np.isin(owner, chosen)
            x = np.linalg.lstsq(gram[np.ix_(at, at)], load[at], rcond=1e-9)[0]
            scored.append(
                (power - 2.0 * float(x @ test_load[at]) + float(x @ test[np.ix_(at, at)] @ x), chosen)
            )
        left, chosen = min(scored, default=(np.inf, ()))
        if left < least - GAIN * power:
            best, least = chosen, left
        else:
            break
    return best


def f_test(data: Regression, chosen: Sequence[str], name: str, rows: Array) -> float:
    """p-value of a term beside the others, on rows not used for its selection or fit.

    Args:
        rows: mask of the rows, shape (rows,).
    """
    others = [n for n in chosen if n != name]
    target = data.target[rows]
    whole = np.column_stack([data.causes[n][rows] for n in (*others, name)])
    small = np.column_stack([np.zeros(target.size), *(data.causes[n][rows] for n in others)])
    left = [
        float(np.sum((target - c @ np.linalg.lstsq(c, target, rcond=1e-9)[0]) ** 2)) for c in (small, whole)
    ]
    free = data.causes[name].shape[1]
    statistic = (left[0] - left[1]) / free / (left[1] / (target.size - whole.shape[1]))
    return float(f_distribution.sf(statistic, free, target.size - whole.shape[1]))


def benjamini_hochberg(p: dict[str, float]) -> list[str]:
    """Terms with a false-discovery rate below the level."""
    ranked = sorted(p, key=p.__getitem__)
    passed = [i for i, name in enumerate(ranked, 1) if p[name] <= LEVEL * i / len(ranked)]
    return ranked[: max(passed, default=0)]


if __name__ == "__main__":
    main(answer)
