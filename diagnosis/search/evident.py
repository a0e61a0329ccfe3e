"""Which effects are evident beside a random moment: they lower χ² far beyond its overdispersion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.normal_equations import by_run
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.search.grow import MOST_CAUSES
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.one_more import sets_with_one_more
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import Periodic

EVIDENT_FROM: Final = 20.0
"""Minimum drop of χ² for a further effect beside a random moment to be evident. Judgement. Two parameters
lower χ² by more than 20 by chance once in 22,000 effects tried."""

SHOWN_WITHIN: Final = 1000.0
"""Ratio of the standard deviation of an effect's size without a run to the one with it, above which the other runs
do not show the effect. Judgement. Rounding alone determined a rod in two of three runs, at ratios of 10⁴ to 10⁵."""

_DETERMINED = 1e-12  # minimum eigenvalue of a determined direction, as a share of the greatest


def evident(top: Hypothesis, kinds: Sequence[type[Effect]]) -> list[Hypothesis]:
    """The set with one more effect that is evident beside the random moment; the most evident first.

    The noise is estimated from the residuals, and the real spectrum differs from the model's. The differences
    between the runs therefore show how much of a drop of χ² is chance. An effect with an instant in every run
    must lower χ² for each instant as well.
    """
    if len(top.effects) >= MOST_CAUSES:
        return []
    able = {kind.name: kind for kind in kinds if not issubclass(kind, Periodic)}
    larger = sets_with_one_more([top], list(able.values()))
    gains = [_gain(h, able[h.effects[-1]], top.fit) for h in larger]
    order = sorted(range(len(larger)), key=lambda i: -gains[i])
    return [larger[i] for i in order if gains[i] > EVIDENT_FROM]


def _gain(larger: Hypothesis, kind: type[Effect], without: Fit) -> float:
    """Drop of χ² by an effect per parameter, divided by its overdispersion."""
    drop = without.total - larger.fit.total
    return drop / overdispersion(larger.fit, kind) / _numbers(larger.fit, kind)


def _numbers(fitted: Fit, kind: type[Effect]) -> int:
    """Number of an effect's parameters that chance may fit: its severity, and every run's instants and phases."""
    problem = fitted.problem
    return 1 + len(kind.per_run_parameters(problem.instants)) * len(problem.data.runs)


def needed(top: Hypothesis) -> Hypothesis:
    """The set without effects that are not evident beside the random moment.

    Phases in every run, as vortices have, may add weight to an effect that is not evident.
    """
    known = top.fit
    for kind in known.problem.effects:
        severity = f"{kind.name}.{kind.parameters()[0].name}"
        if severity not in known.problem.names:
            continue
        variance = overdispersion(known, kind) * known.std(severity) ** 2
        if known.value(severity) ** 2 < EVIDENT_FROM * _numbers(known, kind) * variance:
            rest = tuple(name for name in top.effects if name != kind.name)
            start = restricted(known, rest)
            without = try_fit(start.problem, start.point)
            if without is not None and _gain(top, kind, without) < EVIDENT_FROM:
                return needed(replace(top, effects=rest, fit=without, textbook=None))
    return top


def overdispersion(fitted: Fit, kind: type[Effect]) -> float:
    """Factor by which the variance of an effect's parameters exceeds its value in independent noise, 1 or more.

    An effect that one run shows almost alone may be an odd run; the variance is then mostly the disagreement of the
    other runs. Where the other runs hardly show it, none disagrees, and the factor says nothing.

    Returns:
        The mean over the parameters, from the changes of the estimate as each run is left out, by linear theory
        (jackknife with the runs as clusters; Bell and McCaffrey, Survey Methodology 28 (2002) 169).
    """
    matrices, gradients, _ = by_run(fitted.jacobian, fitted.residuals, products=fitted.products)
    own = [i for i, name in enumerate(fitted.problem.names) if name.split(".")[0] == kind.name]
    total = matrices.sum(axis=0)
    size = np.sqrt(np.maximum(np.diag(total), 1e-300))
    by_size, count = np.outer(size, size), len(gradients)
    inverse = np.linalg.pinv(total / by_size, rcond=_DETERMINED, hermitian=True)
    without = np.linalg.pinv((total - matrices) / by_size, rcond=_DETERMINED, hermitian=True)
    precision = np.linalg.pinv(inverse[np.ix_(own, own)])
    wider = np.einsum("ij,rji->r", precision, without[:, own][:, :, own]) / max(len(own), 1)
    changes = np.einsum("rij,rj->ri", without, gradients / size)[wider < SHOWN_WITHIN**2][:, own]
    robust = changes.T @ changes * (count - 1) / count
    return max(1.0, float(np.trace(precision @ robust)) / max(len(own), 1))
