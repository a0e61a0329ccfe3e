"""The reported figures, from the MuJoCo model: full-rate residuals of a fitted campaign."""

from __future__ import annotations

import dataclasses

import numpy as np

from diagnosis.least_squares import Fit
from diagnosis.problem import campaign_rig, condensed, held_end
from tunnel_sim.campaign import Campaign
from tunnel_sim.effects import Effect
from tunnel_sim.record import Array
from tunnel_sim.run_settings import RunSettings
from tunnel_sim.simulate import simulate_motions

_TIMESTEP = 1e-3  # s at the most: RK4 then errs by 1e-9 rad


def full_rate_residuals(fit: Fit, campaign: Campaign) -> dict[str, Array]:
    """Reading minus the MuJoCo model's prediction at the sensor's own rate.

    Args:
        fit: parameter values.
        campaign: the records they were fitted to.

    Returns:
        Residuals by run id, rad.
    """
    problem = fit.problem
    effects = problem.effects_at(fit.point.common)
    zero = fit.value("zero")
    by_rate: dict[float, list[int]] = {}
    for index, run in enumerate(campaign.runs):
        by_rate.setdefault(round(run.record.sample_rate, 6), []).append(index)
    residuals: dict[str, Array] = {}
    for rate, indices in by_rate.items():
        stated = [_stated(fit, i, campaign, rate) for i in indices]
        physics = [
            _with_effects(fit, i, settings, effects) for i, settings in zip(indices, stated, strict=True)
        ]
        motions = simulate_motions(campaign_rig(problem.data), physics, rate)
        for i, settings, motion in zip(indices, stated, motions, strict=True):
            angle = motion.angle
            draws = problem.draws(fit.point.release[i])
            for effect, draw in zip(effects, draws, strict=True):
                angle = effect.on_angle(angle, motion.time_s, settings, draw)
            predicted = angle + zero
            for effect in effects:
                predicted = effect.on_reading(predicted)
            record = campaign.runs[i].record
            residuals[campaign.runs[i].id] = record.yaw_rad - predicted[: record.yaw_rad.size]
    return residuals


def _stated(fit: Fit, index: int, campaign: Campaign, rate: float) -> RunSettings:
    run = fit.problem.data.runs[index]
    settings = fit.problem.stated(fit.point.common, fit.point.release[index], run)
    steps = int(np.ceil(1.0 / (rate * _TIMESTEP) - 1e-9))
    samples = campaign.runs[index].record.yaw_rad.size
    return dataclasses.replace(settings, timestep=1.0 / (rate * steps), duration=samples / rate)


def _with_effects(fit: Fit, index: int, stated: RunSettings, effects: tuple[Effect, ...]) -> RunSettings:
    physics = stated
    for effect, draw in zip(effects, fit.problem.draws(fit.point.release[index]), strict=True):
        physics = effect.on_run(physics, stated, draw)
    return held_end(condensed(physics, fit.problem.data))
