"""Whether half of the records alone confirms each effect of a set.

Stretches held out of a fit have the same amplitudes as the fitted ones, so they test interpolation only. A real
effect shows at large amplitudes alone, or at small ones alone; an effect that only joins the two halves does
not.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from diagnosis.likelihood.least_squares import Fit, fit_at
from diagnosis.likelihood.normal_equations import Products, normal_equations
from diagnosis.likelihood.partial import fit_seen
from tunnel_sim.vocabulary.record import Array

RESOLVED_STDS: Final = 2.0
"""Minimum distance of an effect from zero in a fit to one half of the records for that half to confirm it, in
standard deviations. Convention."""

_ROUNDS = 4  # rounds of the fit of a half
_SETTLED = 0.5  # maximum move of a parameter in the last round, in standard deviations
_RIDGE = 1e-12  # ridge on the scaled normal matrix: undetermined parameters get a huge variance


def unresolved(whole: Fit) -> tuple[str, ...]:
    """The effects that neither the early nor the late half of the records confirms with the sign of the whole.

    Amplitudes are large in the early half of a free decay and small in the late half. Each half is fitted
    separately, with the forms of the fit to whole runs. An effect is confirmed where its severity is enough
    standard deviations from zero, including the misfit of the half.

    Args:
        whole: fit of a set of effects to whole runs.

    Returns:
        Names, in the order of the fit. Empty where a run is driven: its amplitudes have no order in time.
    """
    problem = whole.problem
    if problem.data.driven:
        return ()
    severities = {kind.name: f"{kind.name}.{kind.parameters()[0].name}" for kind in problem.effects}
    left = {name: full for name, full in severities.items() if full in problem.names}
    for values, stds in _halves(whole):
        for name, full in list(left.items()):
            place = problem.names.index(full)
            same_sign = values[place] * whole.value(full) > 0.0
            if same_sign and abs(values[place]) > RESOLVED_STDS * stds[place]:
                del left[name]
    return tuple(left)


def _halves(whole: Fit) -> Iterator[tuple[Array, Array]]:
    """Common parameters of the early and of the late half and their standard deviations, shape (common,)."""
    problem = whole.problem
    forms = [f"{kind.name}.{i.name}" for kind in problem.effects for i in kind.parameters() if i.form]
    for early in (True, False):
        seen = [(np.arange(r.size) < r.size // 2) == early for r in whole.residuals]
        fitted = whole
        for _ in range(_ROUNDS):  # the sensitivities of the whole run may differ much from the half's
            before = fitted.point.common
            fitted = fit_at(problem, fit_seen(fitted, seen, held=forms)[0])
            stds = _stds(fitted, seen, forms)
            if np.all(np.abs(fitted.point.common - before) < _SETTLED * stds):
                break
        yield fitted.point.common, stds


def _stds(fitted: Fit, seen: Sequence[NDArray[np.bool_]], held: Collection[str]) -> Array:
    """Standard deviations from some blocks, their misfit as noise, shape (common,); infinite: undetermined."""
    names = fitted.problem.names
    free = np.array([name not in held and fitted.bound(name) is None for name in names])
    rows = [(c[s] * free, r[s]) for (c, r), s in zip(fitted.jacobian, seen, strict=True)]
    left = [r[s] for r, s in zip(fitted.residuals, seen, strict=True)]
    products = Products.of(rows, fitted.problem.parameters.precision)
    matrix, _, _ = normal_equations(rows, left, products=products)
    shown = np.diag(matrix) > 0.0
    scale = np.sqrt(np.where(shown, np.diag(matrix), 1.0))
    inverse = np.linalg.inv(matrix / np.outer(scale, scale) + _RIDGE * np.eye(scale.size))
    misfit = sum(float(r @ r) for r in left) / max(sum(r.size for r in left), 1)
    stds = np.sqrt(np.maximum(np.diag(inverse), 0.0) * max(misfit, 1.0)) / scale
    return np.where(shown, stds, np.inf)
