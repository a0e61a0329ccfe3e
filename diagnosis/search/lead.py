"""The lead of the motion over its input, where the nominal model may have one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.likelihood.least_squares import try_fit
from diagnosis.model.choose import nominal_model
from diagnosis.model.nominal import NominalModel
from diagnosis.model.parameters import Point
from diagnosis.search.investigate import Progress, Study, investigate
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import Settings
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.campaign import Campaign


def investigate_with_lead(
    campaign: Campaign,
    kinds: Sequence[type[Effect]],
    progress: Progress | None = None,
    model: NominalModel | None = None,
    settings: Settings = Settings(),
) -> Study:
    """The study of a campaign; with the lead of the motion where it explains more with no more causes.

    In integrators of first order the position of a step is already moved by the rate at its end, so that all motion
    leads its input by half a step. Records simulated in this way show it, measured ones do not, and the model
    cannot say which is right. It is therefore sought only where something is missed, and is not a cause.

    Args:
        campaign: in its own units.
        model: its nominal model, in the same units; None: that of its kind.
        settings: of the diagnosis.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """
    model = model or nominal_model(campaign)
    found = investigate(campaign, kinds, progress, model, settings)
    if not (campaign.driven and found.test.detected):
        return found
    lead = found.similarity.own(_lead(found), "s")
    if lead == 0.0:
        return found
    again = investigate(campaign, kinds, progress, model.with_lead(lead), settings)
    unexplained = again.causes == UNKNOWN and found.causes != ()
    fewer = found.causes == UNKNOWN or len(again.causes) <= len(found.causes)
    return again if fewer and not unexplained else found


def _lead(study: Study) -> float:
    """The lead with which the answer's effects, without a delay, leave least, similar s; 0 if not clear."""
    from scipy.special import chdtri  # only here: slow to load

    problem, point = study.chosen.problem, study.chosen.point
    leads, totals = np.array(problem.data.model.possible_leads()), []
    if not leads.size:
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
    return best if totals[0] - float(np.polyval(curve, best)) > least else 0.0
