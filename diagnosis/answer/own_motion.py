"""The frequency and the damping of a run that differs from all others, against the model of the others."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import fdtrc

from diagnosis.likelihood.least_squares import Fit, FitError, fit_at
from diagnosis.likelihood.partial import refit_releases
from diagnosis.likelihood.sensitivities import sensitivities
from diagnosis.model.blocks import prepare
from diagnosis.model.data import Data
from diagnosis.model.parameters import Point
from diagnosis.model.similar import similar_run
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.scatter import usual, with_deviations, without_deviations
from diagnosis.search.study import Study
from identification.show.quantity import Quantity
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.vocabulary.campaign import Campaign

OWN_WIDTH: Final = 0.2
"""Prior standard deviation of the stiffness and the damping of a run that differs from the others, relative to
theirs. Convention. It is so wide that the run alone determines both."""

_ROUNDS = 3  # rounds of slopes and fits
_COMPARED = ("spring_stiffness", "mechanical_damping")


def with_own_motions(study: Study, measured: Campaign) -> tuple[Disturbance, ...]:
    """The disturbed runs of a study, those that differ as a whole with their own frequency and damping.

    Args:
        measured: the campaign with all runs, in its own units.

    Returns:
        Without these numbers where no effect explains the other runs, and where the run holds more than its motion
        and white noise: a hum, coloured noise, a random moment, or phases and instants of its own.
    """
    runs, problem = {run.id: run for run in measured.runs}, study.chosen.problem
    plain = study.prepared.hum is None and study.moment is None and not problem.parameters.of_effects
    known = study.causes != UNKNOWN and plain and all(run.noise.plain for run in problem.data.runs)
    found = []
    for one in study.disturbed:
        if known and one.as_a_whole and one.left_out:
            campaign = replace(study.campaign, runs=(similar_run(runs[one.run], study.similarity),))
            noise = {one.run: float(np.mean([*study.prepared.noise.variance.values()]))}
            data = prepare(campaign, noise, study.similarity, model=study.model, settings=study.settings)
            found.append(_with_own_motion(one, study.chosen, data))
        else:
            found.append(one)
    return tuple(found)


def _with_own_motion(odd: Disturbance, others: Fit, data: Data) -> Disturbance:
    """The run with its own frequency and damping; unchanged where its spring or its damping cannot differ.

    Args:
        others: the fit to the other runs.
        data: the run.
    """
    problem, _ = without_deviations(others)
    problem = replace(problem, data=data)
    able = {kind.scatters: kind for kind in data.model.may_scatter(ALL_EFFECTS) if data.acts(kind).any()}
    if not able.keys() >= {*_COMPARED}:
        return odd
    start = Point(others.point.common, np.zeros((1, len(problem.parameters.own))))
    start.per_run[0, 0] = data.runs[0].reading[0]
    try:
        alone = fit_at(problem, start)
        scatter = tuple(usual(alone, able[name]).as_wide_as(OWN_WIDTH) for name in _COMPARED)
        own, best = with_deviations(alone.problem, alone.point, scatter)
        for _ in range(_ROUNDS):
            slopes = [slope for _, slope in sensitivities(own, best)]
            best, (residual,) = refit_releases(own, best, slopes)
        ((_, slope),) = sensitivities(own, best)
        covariance = np.linalg.inv(slope.T @ slope + np.diag(own.parameters.precision))
    except (FitError, np.linalg.LinAlgError):
        return odd
    level, noise = max(float(np.mean(residual**2)), 1.0), max(others.total / others.count, 1.0)
    _, damping, stiffness = alone.linear[0]
    stated = own.stated(best.common, best.per_run[0], data.runs[0])
    stiffer, damped = (one.change(stated.table, data) for one in scatter)
    per_stiffness, per_damping = stiffer[0, 0] / stiffness, damped[0, 1] / damping
    places = own.parameters.places(scatter)
    by_stiffness, by_damping = best.per_run[0, places] * [per_stiffness, per_damping]
    stds = np.sqrt(level * np.diag(covariance)[places]) * np.abs([0.5 * per_stiffness, per_damping])
    frequency = float(np.sqrt(1.0 + by_stiffness)) - 1.0
    ratio = float((1.0 + by_damping) / (1.0 + frequency)) - 1.0
    p_value = float(fdtrc(residual.size, others.count, float(np.mean(residual**2)) / noise))
    return replace(
        odd,
        frequency=Quantity(frequency, float(stds[0]), "1"),
        damping=Quantity(ratio, float(np.hypot(*stds)), "1"),
        as_they=p_value > others.settings.selection.disturbed_rate,
    )
