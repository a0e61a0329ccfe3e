"""The runs in still air beside a random moment, fitted alone: the steady causes must explain them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from diagnosis.likelihood.least_squares import Fit, try_fit
from diagnosis.likelihood.part_of_fit import restricted
from diagnosis.model.parameters import Point
from diagnosis.search.hypothesis import Hypothesis, polish
from diagnosis.search.study import Study


def left_in_still_air(study: Study) -> float | None:
    """The share of the gap that the steady causes leave in the runs in which no random moment acts, fitted alone.

    A random moment takes up what the steady causes leave in the other runs, so these runs are the test of a cause
    that is missing.

    Returns:
        A fraction, 0 within chance. None where the answer has no random moment or no steady cause in these runs,
        where there are no such runs, and where they cannot be fitted or show no gap.
    """
    moment, fit = study.moment, study.chosen
    if moment is None:
        return None
    acts = {kind.name for kind in fit.problem.effects if kind.condition == "always"}
    keep = [place for place, run in enumerate(fit.problem.data.runs) if run.id not in moment.process.runs]
    steady = _alone(fit, acts, keep) if acts and keep else None
    none = None if steady is None else _alone(study.nominal, set(), keep)
    if steady is None or none is None:
        return None
    best = polish(Hypothesis(tuple(sorted(acts)), steady)).fit
    rate = study.settings.answer.remains_rate
    if float(chdtrc(none.count, none.total)) >= rate:
        return None
    if float(chdtrc(best.count, best.total)) >= rate:
        return 0.0
    return max(best.excess, 0.0) / none.excess


def _alone(whole: Fit, effects: set[str], keep: list[int]) -> Fit | None:
    """Some runs of a fit with some of its effects, and with only the parameters that they show.

    Args:
        keep: places of the runs.
    """
    known = restricted(whole, effects)
    data = known.problem.data.alone(tuple(known.problem.data.runs[place].id for place in keep))
    own = known.problem.parameters.own_names
    problem = replace(known.problem, data=data, scatter=())
    values = dict(zip(known.problem.names, known.point.common.tolist(), strict=True))
    per_run = known.point.per_run[np.ix_(keep, [own.index(name) for name in problem.parameters.own_names])]
    return try_fit(problem, Point(np.array([values[name] for name in problem.names]), per_run))
