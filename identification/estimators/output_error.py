"""Output error: maximum likelihood of the motion, for each run and jointly for the campaign.

The fits of the runs (ωn, ζ, initial state, zero) start the joint fit, in which Izz, Cr, Cnβ, Cnr and the sensor's
zero are common. Runs that scatter are combined with their scatter instead. Sources: the equation of motion (2)–(6)
of the paper; Jategaonkar, Flight Vehicle System Identification, 2nd ed. (2015), ch. 4, doi 10.2514/4.102790.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from identification.campaign.combination import driven_estimate, scattering_estimate
from identification.campaign.derivatives import (
    build_design,
    combine,
    derivatives,
    design_statuses,
    filled_estimate,
    loads,
    noise_statuses,
    statuses_of_runs,
)
from identification.estimate import Estimate, Quantity, Status, by_severity
from identification.progress import counted
from identification.signal.decay_fit import fit_decays
from identification.signal.driven_fit import driven_run
from identification.signal.noise import noise_level
from identification.signal.run_fit import identify_run, residuals_of
from identification.statistics import (
    determined,
    embed,
    fisher_covariance,
    scaled_solve,
    scatter_of_runs,
    widened_covariance,
)
from tunnel_sim.vocabulary.campaign import Campaign

_JOINT_UNKNOWNS = 2  # of each run in the joint fit: its initial angle and rate; its own zero is one more


@dataclass(frozen=True)
class OutputError:
    """Maximum likelihood with white measurement noise and no process noise.

    Args:
        cycles_per_window: periods in each window of a run; where None three, or one in a record of fewer than
            twelve cycles.
    """

    name: ClassVar[str] = "output_error"
    takes_driven: ClassVar[bool] = True
    cycles_per_window: int | None = None

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign, without runs that lack a result or a spring stiffness.

        Raises:
            TunnelError: when a wind-on run states no air density.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)  # refuses a wind-on run without density before the fits
        fitted = [
            identify_run(run, campaign.sensor, cycles_per_window=self.cycles_per_window)
            if run.drive is None
            else driven_run(run, campaign.sensor)
            for run in counted(campaign.runs)
        ]
        estimate = Estimate(campaign.name, self.name, tuple(item.estimate for item in fitted))
        statuses = statuses_of_runs(campaign, estimate.runs)
        if Status.NO_RUN_IDENTIFIED in statuses:
            return replace(estimate, statuses=by_severity(statuses))
        scattering = scattering_estimate(campaign, self.name, fitted)
        if scattering is not None:
            return scattering
        if campaign.driven:
            pairs = list(zip(campaign.runs, fitted, strict=True))
            return driven_estimate(campaign, estimate, pairs, statuses)
        pairs = [
            (run, item)
            for run, item in zip(campaign.runs, fitted, strict=True)
            if item.fit is not None and run.spring_stiffness is not None
        ]
        if not pairs:
            return replace(
                estimate, statuses=by_severity(statuses | noise_statuses([i.noise for i in fitted]))
            )
        runs = [run for run, _ in pairs]
        design = build_design(runs, campaign.rig)
        own_zeros = campaign.sensor.zero == "per_run"
        # The runs' own (a, k), weighted by their information, are within a few standard deviations of the optimum.
        fits = [item.fit for _, item in pairs if item.fit is not None]
        decays = np.array([[fit.decay.rate, fit.decay.stiffness] for fit in fits])
        start = combine(design, decays, [fit.reduced(2)[0] for fit in fits])
        readings = [item.reading for _, item in pairs]
        fit = None if start is None else fit_decays(readings, design.links, start[0], own_zeros=own_zeros)
        if fit is not None and not fit.converged:
            return replace(estimate, statuses=by_severity(statuses | {Status.NOT_CONVERGED}))
        if fit is None or not determined(fit.normal):
            return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
        unknowns = _JOINT_UNKNOWNS + own_zeros
        noise = noise_level(residuals_of(readings, fit.runs, fit.zero, unknowns), campaign.sensor)
        covariance = fisher_covariance(fit.normal, noise)
        found = derivatives(design, fit.parameters)
        size = fit.parameters.size
        own = found.jacobian @ covariance[:size, :size] @ found.jacobian.T
        statuses = (
            statuses
            | noise_statuses([noise, *(item.noise for _, item in pairs)])
            | design_statuses(design, fit.parameters)
        )
        if Status.MODEL_DEPARTS in statuses and found.names:
            windy = sum(run.wind_speed > 0.0 for run in runs)
            informative_runs = np.array(
                [windy if name.startswith("cn_") else len(runs) for name in found.names]
            )
            # The contribution of each run's residual to the parameters, shape (runs, q).
            total, scores = np.zeros((size + (not own_zeros),) * 2), []
            for run_fit, link in zip(fit.runs, design.links, strict=True):
                information, score = run_fit.reduced(2 if own_zeros else 3)
                extended = embed(link, with_zero=not own_zeros)
                total += extended.T @ information @ extended
                scores.append(extended.T @ score)
            influences = (found.jacobian @ scaled_solve(total, np.array(scores).T)[:size]).T
            own = widened_covariance(own, scatter_of_runs(influences, informative_runs))
        zero = None if own_zeros else Quantity(fit.zero, float(np.sqrt(covariance[-1, -1])), "rad")
        return replace(
            filled_estimate(campaign, estimate, runs, design, found, own, statuses),
            sensor_zero=zero,
            noise=noise,
        )
