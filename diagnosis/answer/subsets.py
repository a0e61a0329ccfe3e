"""Fits of some of an answer's causes, started from the fit of all of them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from functools import partial

import numpy as np

from diagnosis.attribution.hypothesis import restricted
from diagnosis.fitting.least_squares import Fit, FitError, fit
from diagnosis.fitting.starting_points import starting_points
from diagnosis.study import Study
from tunnel_sim.effects import Effect

_ITERATIONS = 6  # the fit of all causes is close for the parameters that are left
_NO_GAIN = 0.999  # of the χ² of a fit of fewer causes: another start may do better

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
            The study's own fit, or else one started from the fit of all causes. Where a fit of fewer of them is
            better, the missing cause is added to that; a cause that gains nothing leaves the fit as it was.
        """
        key = frozenset(names)
        if key not in self._fits:
            fewer = min((known for known in self._fits if known < key), key=lambda k: self._fits[k].total)
            own = self._study.hypothesis(sorted(key))
            found = self._from_all(key) if own is None else own.fit
            if found is None or found.total > _NO_GAIN * self._fits[fewer].total:
                found = self._from_fewer(fewer, key) or found
            known = self._fits[fewer]
            self._fits[key] = known if found is None or found.total > known.total else found
        return self._fits[key]

    def _from_all(self, names: Names) -> Fit | None:
        """A fit started from that of all causes, with its sensitivities."""
        start = restricted(self._study.chosen, names)
        return _fitted(
            lambda: fit(start.problem, start.point, base=start, tolerance=1e-3, max_iterations=_ITERATIONS)
        )

    def _from_fewer(self, fewer: Names, names: Names) -> Fit | None:
        """A fit in which the missing causes are added to a fit of fewer, one after another."""
        kinds = [kind for kind in self._study.chosen.problem.effects if kind.name in names - fewer]
        found: Fit | None = self._fits[fewer]
        for kind in kinds:
            found = None if found is None else one_more(found, kind)
        return found


def one_more(base: Fit, kind: type[Effect]) -> Fit | None:
    """A fit with one more effect.

    Args:
        base: the fit without it.
        kind: the effect to add.

    Returns:
        The better of the fits from its first two starting points; None where none succeeds.
    """
    starts = starting_points(base, kind)[:2]
    tried = [_fitted(partial(fit, start.problem, start.point)) for start in starts]
    return min((found for found in tried if found), key=lambda found: found.total, default=None)


def _fitted(attempt: Callable[[], Fit]) -> Fit | None:
    """The result of a fit; None where it fails."""
    with suppress(FitError, np.linalg.LinAlgError):
        found = attempt()
        return found if np.isfinite(found.total) else None
    return None
