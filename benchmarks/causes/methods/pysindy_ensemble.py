"""Ensemble SINDy of the residual moment (Fasel, Kutz, Brunton and Brunton 2022), by PySINDy's own optimisers."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.causes.entry import UNKNOWN, About, answer_of, main
from benchmarks.causes.moments import DETECTED, NAMES, NOT_SEEN, Regression, equations

THRESHOLD, MODELS, INCLUDED = 0.1, 100, 0.6
ABOUT = About(
    "PySINDy, ensemble SINDy",
    f"EnsembleOptimizer(STLSQ(threshold={THRESHOLD}), bagging, library ensembling, {MODELS} models) on "
    f"columns and target of "
    f"unit power in the weak form (moments.py); a cause is named where {INCLUDED:g} of the models keep it",
    (*NAMES, UNKNOWN),
    NOT_SEEN,
)


def answer(folder: Path) -> dict[str, Any]:
    """Answer one campaign."""
    data = Regression.of(equations(folder))
    names = list(data.causes)
    if not names or data.gap < DETECTED:
        return answer_of([], dict.fromkeys(names, 0.01))
    inclusion = inclusion_of(data)
    named = data.verdict([n for n in names if inclusion[n] > INCLUDED])
    if named == [UNKNOWN]:
        return answer_of(named, {**{n: 0.3 * p for n, p in inclusion.items()}, UNKNOWN: 0.7})
    return answer_of(named, inclusion)


def inclusion_of(data: Regression) -> dict[str, float]:
    """Share of the ensemble's models that keep a column of each cause."""
    import pysindy

    names = list(data.causes)
    rows = np.sqrt(data.target.size)
    columns = np.column_stack([data.causes[n] for n in names]) * rows  # of unit mean square each
    owner = np.repeat(np.arange(len(names)), [data.causes[n].shape[1] for n in names])
    optimiser = pysindy.EnsembleOptimizer(
        opt=pysindy.STLSQ(threshold=THRESHOLD, alpha=1e-6), bagging=True, n_models=MODELS,
        library_ensemble=columns.shape[1] > 2, n_candidates_to_drop=1,
    )  # fmt: skip
    np.random.seed(0)  # noqa: NPY002 — PySINDy draws its bags from NumPy's global generator
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # some models of a bag keep no term
        optimiser.fit(columns, (data.target / np.sqrt(data.gap))[:, None])
    kept = np.array([np.ravel(c) != 0.0 for c in optimiser.coef_list])
    # each model drops one column, and gives no information about it
    drawn = 1.0 - (1.0 / columns.shape[1] if columns.shape[1] > 2 else 0.0)
    return {
        n: min(float(np.mean(np.any(kept[:, owner == i], axis=1))) / drawn, 1.0) for i, n in enumerate(names)
    }


if __name__ == "__main__":
    main(answer)
