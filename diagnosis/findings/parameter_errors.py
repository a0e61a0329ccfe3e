"""Errors of the causes' parameters that the answer itself names: of the integrator, and of the causes' form."""

from __future__ import annotations

import math

import numpy as np

from diagnosis.answer.linear_theory import move_of_halves, parameter_shift
from diagnosis.findings.closing import Closing
from diagnosis.search.study import Study


def parameter_errors(study: Study, closes: Closing) -> dict[str, float]:
    """Standard deviations of the parameters of the answer beside those of the noise, by ``effect.parameter``.

    Returns:
        In the parameters' units, those of the similar campaign. They are the change by MuJoCo's integrator, where
        it and that of the fits disagree; and the difference between the halves of the data, which differ by more
        than chance where the form of a cause is not exact (`move_of_halves`).
    """
    fit = study.chosen
    problem = fit.problem
    if not study.named or fit is study.nominal:
        return {}
    stepped = np.zeros(len(problem.names))
    if not closes.confirmation.agrees and not closes.confirmation.failure:
        stepped = parameter_shift(fit, [closes.shifts[run.id] for run in problem.data.runs])
    found = {}
    for place, name in enumerate(problem.names):
        if name in problem.effect_names and fit.bound(name) is None:
            halves = move_of_halves(fit, np.eye(len(problem.names))[place])
            found[name] = math.hypot(float(stepped[place]), halves)
    return found
