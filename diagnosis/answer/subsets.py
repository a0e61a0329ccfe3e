"""Fits of some of an answer's causes, started from the fit of all of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from contextlib import suppress

import numpy as np

from diagnosis.fitting.least_squares import Fit, FitError, fit
from diagnosis.fitting.problem import Point, Problem
from diagnosis.study import Study

_ITERATIONS = 6  # the fit of all causes is close for the parameters that are left

Names = frozenset[str]


class Subsets:
    """Fits by the set of causes in them, each made once."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self.causes: Names = frozenset(kind.name for kind in study.chosen.problem.effects)
        self._fits: dict[Names, Fit] = {self.causes: study.chosen, frozenset(): study.nominal}

    def __call__(self, names: Collection[str]) -> Fit:
        """The best fit found with these causes.

        Args:
            names: some of the causes.

        Returns:
            The study's own fit, or else one started from the fit of all causes; a fit of fewer of them where that
            is better: a cause that gains nothing leaves the fit as it was.
        """
        key = frozenset(names)
        if key not in self._fits:
            own = self._study.hypothesis(sorted(key))
            fewer = [known for subset, known in self._fits.items() if subset < key]
            tried = [*fewer, *(self._refitted(key) if own is None else [own.fit])]
            self._fits[key] = min(tried, key=lambda found: found.total)
        return self._fits[key]

    def _refitted(self, names: Names) -> list[Fit]:
        start = restricted(self._study.chosen, names)
        with suppress(FitError, np.linalg.LinAlgError):
            found = fit(start.problem, start.point, base=start, tolerance=1e-3, max_iterations=_ITERATIONS)
            if np.isfinite(found.total):
                return [found]
        return []


def restricted(whole: Fit, names: Names) -> Fit:
    """A fit with some effects taken out and everything else as it was; its residuals are still those of the whole.

    Args:
        whole: with more effects.
        names: of the effects to keep.

    Returns:
        A start, with its sensitivities, for the fit of the smaller problem.
    """
    large = whole.problem
    problem = Problem(
        large.data,
        tuple(kind for kind in large.effects if kind.name in names),
        tuple((name, value) for name, value in large.fixed if name.split(".")[0] in names),
        tuple(name for name in large.free_forms if name in names),
    )
    common = [large.names.index(name) for name in problem.names]
    own = [0, 1, *(2 + large.phased.index(name) for name in problem.phased)]
    return dataclasses.replace(
        whole,
        problem=problem,
        point=Point(whole.point.common[common], whole.point.release[:, own]),
        covariance=whole.covariance[np.ix_(common, common)],
        jacobian=[(c[:, common], r[:, own]) for c, r in whole.jacobian],
    )
