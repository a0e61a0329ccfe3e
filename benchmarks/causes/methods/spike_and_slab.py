"""Spike-and-slab regression of the residual moment (Nayek, Fuentes, Worden and Cross 2021; BINDy).

The residual is the sum of the included causes' columns, with a unit-information slab on their sizes and an unknown
noise variance. Every set therefore has a closed-form marginal likelihood; Gibbs sampling visits the sets.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.causes.entry import UNKNOWN, About, answer_of, main
from benchmarks.causes.moments import DETECTED, NAMES, NOT_SEEN, Array, Regression, equations

PRIOR, SWEEPS, BURN_IN = 0.1, 600, 100
ABOUT = About(
    "spike-and-slab regression",
    f"prior inclusion {PRIOR}, unit-information slab, variance unknown, {SWEEPS} Gibbs sweeps after "
    f"{BURN_IN}, on the "
    "weak equation of motion (moments.py)",
    (*NAMES, UNKNOWN),
    NOT_SEEN,
)


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    data = Regression.of(equations(folder))
    names = list(data.causes)
    sets = sample(data, np.random.default_rng(0))
    total = sum(sets.values())
    inclusion = {n: sum(c for s, c in sets.items() if n in s) / total for n in names}
    named = data.verdict([n for n in names if inclusion[n] > 0.5])
    if named == [UNKNOWN]:
        return answer_of(named, {**{n: 0.3 * p for n, p in inclusion.items()}, UNKNOWN: 0.7})
    if data.gap < DETECTED:
        return answer_of([], {n: 0.1 * p for n, p in inclusion.items()})
    return answer_of(named, inclusion, [(s, c / total) for s, c in sets.most_common(40)])


def sample(data: Regression, rng: np.random.Generator) -> Counter[tuple[str, ...]]:
    """Number of visits of Gibbs sampling to each set of causes."""
    names = list(data.causes)
    columns = np.column_stack([data.causes[n] for n in names]) if names else np.zeros((data.target.size, 0))
    owner = np.repeat(np.arange(len(names)), [data.causes[n].shape[1] for n in names])
    gram, load, power = columns.T @ columns, columns.T @ data.target, float(data.target @ data.target)
    size, inside = data.target.size, np.zeros(len(names), bool)
    known: dict[bytes, float] = {}

    def weight(which: Array) -> float:
        if which.tobytes() not in known:
            known[which.tobytes()] = log_marginal(gram, load, power, size, which[owner])
        return known[which.tobytes()] + float(which.sum()) * np.log(PRIOR / (1.0 - PRIOR))

    visits: Counter[tuple[str, ...]] = Counter()
    for sweep in range(BURN_IN + SWEEPS):
        for k in rng.permutation(len(names)):
            one, other = inside.copy(), inside.copy()
            one[k], other[k] = True, False
            odds = np.clip(weight(one) - weight(other), -50.0, 50.0)
            inside = one if rng.random() < 1.0 / (1.0 + np.exp(-odds)) else other
        if sweep >= BURN_IN:
            visits[tuple(n for n, on in zip(names, inside, strict=True) if on)] += 1
    return visits


def log_marginal(gram: Array, load: Array, power: float, size: int, which: Array) -> float:
    """Log of the marginal likelihood of a set relative to the empty set, up to a common constant.

    Args:
        gram: products of the columns, shape (k, k).
        load: products with the target, shape (k,).
        power: sum of squares of the target, in noise variances.
        which: included columns, shape (k,).
    """
    if not np.any(which):
        return -0.5 * size * float(np.log(power))
    inner = gram[np.ix_(which, which)]
    fitted = float(load[which] @ np.linalg.lstsq(inner, load[which], rcond=1e-9)[0])
    shrink = size / (size + 1.0)  # of the g-prior with g = rows
    left = max(power - shrink * fitted, 1e-12 * power)
    return -0.5 * float(which.sum()) * float(np.log1p(size)) - 0.5 * size * float(np.log(left))


if __name__ == "__main__":
    main(answer)
