"""Output error of all runs together: maximum likelihood, with inputs exact between their samples.

Per unit inertia a run i has (aᵢ, kᵢ, gᵢ) = Lᵢ φ + cᵢ. A free decay has no gain gᵢ. With a stated spring, the
gain of an input is 1/Izz for a known moment, Kr/Izz for the motion of the spring's root, −1 for the rotation of
the base, and a parameter common to the campaign for an input of unknown gain. That gain, and the results for a
body without a spring, are remarks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.campaign.derivatives import Derivatives, noise_statuses
from identification.campaign.linked_runs import LinkedRuns
from identification.estimate import Estimate, Status, by_severity
from identification.show.quantity import Quantity
from identification.signal.decay_fit import DecayFit, fit_decays, shared_system
from identification.signal.noise import noise_of
from identification.signal.run_fit import FittedRun, residuals_of
from identification.statistics import (
    determined,
    fisher_covariance,
    sandwich_covariance,
    scaled_solve,
    scatter_of_runs,
    widened_covariance,
)
from tunnel_sim.vocabulary.campaign import Run
from tunnel_sim.vocabulary.record import Array

# unknowns of each run in the joint fit: its initial angle and rate; its own zero is one more
_JOINT_UNKNOWNS = 2


def joint_estimate(
    linked: LinkedRuns, estimate: Estimate, fitted: Sequence[FittedRun], statuses: set[Status]
) -> Estimate:
    """The campaign's coefficients, without runs that lack a result or a spring stiffness.

    Args:
        fitted: every run's own fit, which starts the joint one, in the campaign's order.
        statuses: the statuses that follow from the runs.
    """
    campaign, runs = linked.campaign, linked.runs
    estimate = replace(estimate, remarks=linked.remarks)
    if not runs:
        return replace(estimate, statuses=by_severity(statuses | noise_statuses([i.noise for i in fitted])))
    used = [fitted[place] for place in linked.places]
    # The runs' own (a, k, g), weighted by their information, are within a few standard deviations of the optimum.
    own_zeros = campaign.sensor.zero == "per_run" or any(run.unrestrained for run in runs)
    readings, links = [item.reading for item in used], linked.linked.links
    start = linked.least_squares
    fit = None if start is None else fit_decays(readings, links, start[0], own_zeros=own_zeros)
    if fit is not None and not fit.converged:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_CONVERGED}))
    if fit is None or not determined(fit.normal):
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    residuals = residuals_of(readings, fit.runs, fit.zero, _JOINT_UNKNOWNS + own_zeros)
    noise = noise_of(residuals, campaign.sensor)
    if noise.powers:
        covariance = sandwich_covariance(_systems(fit, links, own_zeros=own_zeros)[0], noise.powers)
    else:
        covariance = fisher_covariance(fit.normal, noise.variance)
    values, covariance_of_values = linked.values(fit.parameters, covariance)
    statuses = statuses | noise_statuses([noise.level, *(item.noise for item in used)])
    zero = None
    if not campaign.driven:  # neither is stated for driven runs
        if Status.MODEL_DEPARTS in statuses and values.names:
            covariance_of_values = widened_covariance(
                covariance_of_values, _scatter(fit, links, values, runs, own_zeros=own_zeros)
            )
        zero = None if own_zeros else Quantity(fit.zero, float(np.sqrt(covariance[-1, -1])), "rad")
    size = linked.linked.size
    filled = linked.filled(
        estimate, values, covariance_of_values, fit.parameters, covariance[:size, :size], statuses
    )
    return replace(filled, sensor_zero=zero, noise=noise.level)


def _scatter(
    fit: DecayFit, links: Sequence[Array], found: Derivatives, runs: Sequence[Run], *, own_zeros: bool
) -> Array:
    """Standard deviations from the contribution of each run's residual to the coefficients, shape (q,)."""
    size = found.jacobian.shape[1]
    windy = sum(run.wind_speed > 0.0 for run in runs)
    informative_runs = np.array([windy if name.startswith("cn_") else len(runs) for name in found.names])
    total, scores = _systems(fit, links, own_zeros=own_zeros)
    influences = (found.jacobian @ scaled_solve(total.sum(axis=0), scores.T)[:size]).T
    return scatter_of_runs(influences, informative_runs)


def _systems(fit: DecayFit, links: Sequence[Array], *, own_zeros: bool) -> tuple[Array, Array]:
    """Information, shape (r, p, p), and score, shape (r, p), of the shared parameters in each run."""
    systems = [
        shared_system([run], [link], "own" if own_zeros else "shared", fit.parameters)
        for run, link in zip(fit.runs, links, strict=True)
    ]
    total, scores = (np.array(one) for one in zip(*systems, strict=True))
    return total, scores
