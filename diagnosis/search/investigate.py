"""Investigate a campaign: measure its noise, test for a gap, find sets of causes and weigh them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.likelihood.least_squares import try_fit
from diagnosis.model.choose import nominal_model
from diagnosis.model.nominal import NominalModel
from diagnosis.model.parameters import Point
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.clock import Progress, StepClock
from diagnosis.search.disturbed import prepared_undisturbed, together, undisturbed
from diagnosis.search.odd_run import DISTURBED_SHARE, odd_runs
from diagnosis.search.rivals import RIVALS
from diagnosis.search.rivals.rival import Rival
from diagnosis.search.sets import Sets, with_near_rivals
from diagnosis.search.study import Gap, Study
from diagnosis.search.views import VIEWS
from diagnosis.search.views.view import View
from diagnosis.settings import Settings
from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.capabilities import InputClock
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError


def investigate(
    campaign: Campaign,
    kinds: Sequence[type[Effect]] = ALL_EFFECTS,
    progress: Progress | None = None,
    model: NominalModel | None = None,
    settings: Settings = Settings(),
    *,
    rivals: Sequence[Rival] = RIVALS,
    views: Sequence[type[View]] = VIEWS,
) -> Study:
    """Test a campaign for a gap, and weigh the effects that may cause it.

    Args:
        campaign: the measured campaign, in its own units.
        kinds: the effects that may be named.
        progress: called with the name of each step.
        model: the nominal model of the campaign, in the same units; None: the model of its kind.
        settings: settings of the diagnosis.
        rivals: causes from outside the vocabulary, weighed beside the effects.
        views: the views in which sets of effects are found, in order of preference.

    Returns:
        The study. Disturbed runs end at their disturbance. The study allows the motion to lead its input if
        that explains more without more causes.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """
    model = model or nominal_model(campaign)

    def study(campaign: Campaign, model: NominalModel) -> Study:
        clock = StepClock(progress)
        prepared, test, disturbed = prepared_undisturbed(campaign, model, kinds, clock, settings)
        with clock.step("where" if test.detected else "nominal fit"):
            prepared = prepared.in_wider_blocks()
        if not test.detected:
            return Study(prepared, Gap(test), disturbed=disturbed, seconds=clock.seconds)
        with clock.step("where"):
            gap = Gap(test, prepared.place())
        sets: Sets | None = None
        for kind in views:
            view = kind.after(prepared, sets, clock)
            if view is not None:
                sets = with_near_rivals(view.sets(clock), rivals, clock)
        if sets is None:
            raise ValueError("no view of the runs applies")
        return replace(Study.of_sets(sets, gap, clock), disturbed=disturbed)

    found = study(campaign, model)
    lead = likeliest_lead(found)
    again = found if lead == 0.0 else study(campaign, model.with_lead(lead))
    return without_odd_runs(again if explains_more(again, found) else found, campaign, model, study)


def without_odd_runs(
    found: Study, campaign: Campaign, model: NominalModel, study: Callable[[Campaign, NominalModel], Study]
) -> Study:
    """The study without the runs that differ from the others as a whole.

    Args:
        found: the study of all runs.
        model: the nominal model of all runs.
        study: makes the study of a campaign.

    Returns:
        With the left-out runs among the disturbed ones; unchanged where no set explains the other runs.
    """
    for _ in range(max(1, int(DISTURBED_SHARE * len(campaign.runs)))):
        odd = odd_runs(campaign, found)
        if not odd:
            break
        try:
            campaign = undisturbed(campaign, odd)
            again = study(campaign, model.of(campaign))
        except TunnelError:  # the other runs do not determine the model
            break
        if again.causes == UNKNOWN:
            break
        disturbed = together(found.disturbed, odd, again.disturbed)
        found = replace(again, disturbed=disturbed, seconds=_sum(found, again))
    return found


def _sum(one: Study, other: Study) -> dict[str, float]:
    """Wall time by step of two studies, s."""
    return {
        step: one.seconds.get(step, 0.0) + other.seconds.get(step, 0.0)
        for step in {**one.seconds, **other.seconds}
    }


def nominal_study(
    campaign: Campaign, kinds: Sequence[type[Effect]], settings: Settings = Settings()
) -> Study:
    """Test a campaign for a gap without fitting effects: the study up to the fit of the nominal model.

    Args:
        kinds: the effects that may be detected in the records.
        settings: settings of the diagnosis.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """
    model, clock = nominal_model(campaign), StepClock()
    prepared, test, disturbed = prepared_undisturbed(campaign, model, kinds, clock, settings)
    return Study(prepared, Gap(test), disturbed=disturbed)


def explains_more(again: Study, found: Study) -> bool:
    """Whether a study with a lead explains more than one without, with no more causes."""
    unexplained = again.causes == UNKNOWN and found.causes != ()
    fewer = found.causes == UNKNOWN or len(again.causes) <= len(found.causes)
    return fewer and not unexplained


def likeliest_lead(study: Study) -> float:
    """The lead with the least residual for the answer's effects, without a delay, s of the measured campaign.

    Returns:
        0 where it is not determined, there is no gap, the runs have no input, or a rival explains as much without.
    """
    from scipy.special import chdtri  # imported here because it is slow to load

    problem, point = study.chosen.problem, study.chosen.point
    leads, totals = np.array(study.model.possible_leads()), []
    if not (leads.size and study.campaign.driven and study.gap.test.detected):
        return 0.0
    effects = tuple(kind for kind in problem.effects if not issubclass(kind, InputClock))
    whole = dict(zip(problem.names, point.common.tolist(), strict=True))
    for lead in leads:
        tried = replace(problem, data=problem.data.with_inputs(delay=-lead), effects=effects)
        fitted = try_fit(tried, Point(np.array([whole[name] for name in tried.names]), point.per_run))
        if fitted is None:
            return 0.0
        totals.append(fitted.total)
    if min((one.best.fit.total for one in study.rivals), default=np.inf) <= min(totals):
        return 0.0
    curve = np.polyfit(leads, totals, 2)
    best = float(leads[np.argmin(totals)])
    if curve[0] > 0.0:
        best = float(np.clip(-0.5 * curve[1] / curve[0], 0.0, leads[-1]))
    least = chdtri(1.0, study.settings.read_off.lead_rate)
    clear = totals[0] - float(np.polyval(curve, best)) > least
    return study.similarity.own(best, "s") if clear else 0.0
