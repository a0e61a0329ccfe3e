"""The lead of the motion over its input, where the nominal model may have one.

In integrators of first order the position of a step is already moved by the rate at its end, so that all motion
leads its input by half a step. Records simulated in this way show it, measured ones do not, and the model cannot
say which is right. It is therefore sought only where something is missed, and is not a cause.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis.likelihood.least_squares import try_fit
from diagnosis.model.parameters import Point
from diagnosis.search.study import Study
from diagnosis.search.weigh import UNKNOWN


def explains_more(again: Study, found: Study) -> bool:
    """Whether a study with a lead is better than one without: it explains more with no more causes."""
    unexplained = again.causes == UNKNOWN and found.causes != ()
    fewer = found.causes == UNKNOWN or len(again.causes) <= len(found.causes)
    return fewer and not unexplained


def likeliest_lead(study: Study) -> float:
    """The lead with which the answer's effects, without a delay, leave least, s of the measured campaign.

    Returns:
        0 where it is not clear, there is no gap, or the runs have no input.
    """
    from scipy.special import chdtri  # only here: slow to load

    problem, point = study.chosen.problem, study.chosen.point
    leads, totals = np.array(study.model.possible_leads()), []
    if not (leads.size and study.campaign.driven and study.gap.test.detected):
        return 0.0
    effects = tuple(kind for kind in problem.effects if not kind.driven)
    whole = dict(zip(problem.names, point.common.tolist(), strict=True))
    for lead in leads:
        runs = tuple(
            r if r.drive is None else replace(r, drive=replace(r.drive, delay=-lead))
            for r in problem.data.runs
        )
        tried = replace(problem, data=problem.data.with_runs(runs), effects=effects)
        fitted = try_fit(tried, Point(np.array([whole[name] for name in tried.names]), point.release))
        if fitted is None:
            return 0.0
        totals.append(fitted.total)
    curve = np.polyfit(leads, totals, 2)
    best = float(leads[np.argmin(totals)])
    if curve[0] > 0.0:
        best = float(np.clip(-0.5 * curve[1] / curve[0], 0.0, leads[-1]))
    least = chdtri(1.0, study.settings.read_off.lead_rate)
    clear = totals[0] - float(np.polyval(curve, best)) > least
    return study.similarity.own(best, "s") if clear else 0.0
