"""Output error of all runs together: maximum likelihood, with inputs exact between their samples.

Per unit inertia a run i has (aᵢ, kᵢ, gᵢ) = Lᵢ φ + cᵢ: with a stated spring, the gain gᵢ of its input is 1/Izz for a
known moment, Kr/Izz for the motion of the spring's root, −1 for the rotation of the base, and a parameter common to
the campaign for an input of unknown gain; a free decay has none. That gain, and the results for a body without a
spring, are remarks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.campaign.combination import (
    gain_remark,
    is_remarked,
    joined_runs,
    run_remark,
    seen_by,
    with_gains,
)
from identification.campaign.derivatives import (
    Derivatives,
    Design,
    build_design,
    combine,
    derivatives,
    design_statuses,
    filled_estimate,
    noise_statuses,
)
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
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array

_JOINT_UNKNOWNS = 2  # of each run in the joint fit: its initial angle and rate; its own zero is one more


def joint_estimate(
    campaign: Campaign, estimate: Estimate, fitted: Sequence[FittedRun], statuses: set[Status]
) -> Estimate:
    """The campaign's coefficients, without runs that lack a result or a spring stiffness.

    Args:
        fitted: every run's own fit, which starts the joint one, in the campaign's order.
        statuses: those that follow from the runs.
    """
    known = [
        (run, item, item.gained)
        for run, item in zip(campaign.runs, fitted, strict=True)
        if item.gained is not None
    ]
    joined = joined_runs([run for run, *_ in known], campaign.rig)
    remarks = tuple(run_remark(run, gained) for run, _, gained in known if is_remarked(run, joined))
    estimate = replace(estimate, remarks=remarks)
    used = [(run, item, gained) for run, item, gained in known if run.id in joined]
    if not used:
        return replace(estimate, statuses=by_severity(statuses | noise_statuses([i.noise for i in fitted])))
    runs = [run for run, *_ in used]
    design = build_design(runs, campaign.rig)
    linked = with_gains(design, runs)
    # The runs' own (a, k, g), weighted by their information, are within a few standard deviations of the optimum.
    seen = np.array([seen_by(run, gained) for run, _, gained in used])
    start = combine(linked, seen, [gained.weight for *_, gained in used])
    own_zeros = campaign.sensor.zero == "per_run" or any(run.unrestrained for run in runs)
    readings = [item.reading for _, item, _ in used]
    fit = None if start is None else fit_decays(readings, linked.links, start[0], own_zeros=own_zeros)
    if fit is not None and not fit.converged:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_CONVERGED}))
    if fit is None or not determined(fit.normal):
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    residuals = residuals_of(readings, fit.runs, fit.zero, _JOINT_UNKNOWNS + own_zeros)
    noise = noise_of(residuals, campaign.sensor)
    if noise.powers:
        covariance = sandwich_covariance(_systems(fit, linked, own_zeros=own_zeros)[0], noise.powers)
    else:
        covariance = fisher_covariance(fit.normal, noise.variance)
    size = design.size
    values = derivatives(design, fit.parameters[:size])
    covariance_of_values = values.jacobian @ covariance[:size, :size] @ values.jacobian.T
    statuses = (
        statuses
        | noise_statuses([noise.level, *(item.noise for _, item, _ in used)])
        | design_statuses(design, fit.parameters[:size])
    )
    zero = None
    if not campaign.driven:  # neither is stated of driven runs
        if Status.MODEL_DEPARTS in statuses and values.names:
            covariance_of_values = widened_covariance(
                covariance_of_values, _scatter(fit, linked, values, runs, own_zeros=own_zeros)
            )
        zero = None if own_zeros else Quantity(fit.zero, float(np.sqrt(covariance[-1, -1])), "rad")
    if linked.size > size:
        gain = gain_remark(
            runs, fit.parameters, covariance[: linked.size, : linked.size], values.get("yaw_inertia")
        )
        estimate = replace(estimate, remarks=(gain, *remarks))
    filled = filled_estimate(campaign, estimate, runs, design, values, covariance_of_values, statuses)
    return replace(filled, sensor_zero=zero, noise=noise.level)


def _scatter(
    fit: DecayFit, linked: Design, found: Derivatives, runs: Sequence[Run], *, own_zeros: bool
) -> Array:
    """Standard deviations from the contribution of each run's residual to the coefficients, shape (q,)."""
    size = found.jacobian.shape[1]
    windy = sum(run.wind_speed > 0.0 for run in runs)
    informative_runs = np.array([windy if name.startswith("cn_") else len(runs) for name in found.names])
    total, scores = _systems(fit, linked, own_zeros=own_zeros)
    influences = (found.jacobian @ scaled_solve(total.sum(axis=0), scores.T)[:size]).T
    return scatter_of_runs(influences, informative_runs)


def _systems(fit: DecayFit, linked: Design, *, own_zeros: bool) -> tuple[Array, Array]:
    """Information, shape (r, p, p), and score, shape (r, p), of the shared parameters in each run."""
    systems = [
        shared_system([run], [link], "own" if own_zeros else "shared", fit.parameters)
        for run, link in zip(fit.runs, linked.links, strict=True)
    ]
    total, scores = (np.array(one) for one in zip(*systems, strict=True))
    return total, scores
