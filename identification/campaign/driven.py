"""Output error of driven and free runs together: maximum likelihood with the input exact between its samples.

Per unit inertia a run i has (aᵢ, kᵢ, gᵢ) = Lᵢ φ: with a stated spring, gᵢ is 1/Izz for a known moment, Kr/Izz for
the motion of the spring's root, and a parameter common to the campaign for an input of unknown gain. The runs' own
fits start the joint fit, as for free decays. A body without a spring gives the inertia by its known moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.campaign.derivatives import (
    Design,
    build_design,
    combine,
    derivatives,
    design_statuses,
    filled_estimate,
    noise_statuses,
)
from identification.estimate import Estimate, Status, by_severity
from identification.printing import with_std
from identification.signal.decay_fit import RunFit
from identification.signal.driven_fit import DrivenRun, Gained, fit_with_inputs
from identification.signal.noise import noise_level
from identification.signal.run_fit import FittedRun, residuals_of
from identification.statistics import determined, eliminate, fisher_covariance
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run
from tunnel_sim.vocabulary.record import Array

_Pairs = Sequence[tuple[Run, FittedRun]]


def driven_estimate(campaign: Campaign, estimate: Estimate, pairs: _Pairs, statuses: set[Status]) -> Estimate:
    """The campaign's coefficients from driven and free runs.

    Args:
        estimate: with the results of the runs.
        pairs: every run and its own fit.
        statuses: of the campaign, from its runs.

    Returns:
        The estimate. The gain of an input, per unit inertia or in N m per unit, is a remark, and so is what a body
        without a spring shows.
    """
    statuses = statuses | noise_statuses([item.noise for _, item in pairs])
    fitted = [(run, item) for run, item in pairs if item.fit is not None]
    joined = joined_runs([run for run, _ in fitted], campaign.rig)
    linked = [(run, item) for run, item in fitted if run.id in joined]
    remarks = tuple(
        run_remark(run, item.gained)
        for run, item in fitted
        if isinstance(item, DrivenRun) and is_remarked(run, joined)
    )
    estimate = replace(estimate, remarks=remarks)
    return (
        _joint(campaign, estimate, linked, statuses)
        if linked
        else replace(estimate, statuses=by_severity(statuses))
    )


def _joint(campaign: Campaign, estimate: Estimate, pairs: _Pairs, statuses: set[Status]) -> Estimate:
    runs = [run for run, _ in pairs]
    design = build_design(runs, campaign.rig)
    linked = with_gains(design, runs)
    start = combine(linked, *_own_coefficients(pairs))
    if start is None:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    own_zeros = campaign.sensor.zero == "per_run" or any(run.unrestrained for run in runs)
    found = fit_with_inputs(runs, linked.links, start[0], own_zeros=own_zeros)
    if not found.converged:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_CONVERGED}))
    information = eliminate(found.normal, np.zeros(len(found.normal)), linked.size)[0]
    if not determined(information):
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    residuals = [
        residuals_of(
            [item.reading],
            [replace(_fit_of(item), residual=residual)],
            float(item.reading.yaw.mean() if run.unrestrained else own[0]),
            2 + own_zeros,
        )[0]
        for (run, item), residual, own in zip(pairs, found.residuals, found.own, strict=True)
    ]
    noise = noise_level(residuals, campaign.sensor)
    covariance = fisher_covariance(information, noise)
    values = derivatives(design, found.parameters[: design.size])
    inner = covariance[: design.size, : design.size]
    statuses = statuses | noise_statuses([noise]) | design_statuses(design, found.parameters[: design.size])
    filled = filled_estimate(
        campaign, estimate, runs, design, values, values.jacobian @ inner @ values.jacobian.T, statuses
    )
    gained = linked.size > design.size
    gain = (gain_remark(runs, found.parameters, covariance, values.get("yaw_inertia")),) if gained else ()
    return replace(filled, noise=noise, remarks=(*gain, *estimate.remarks))


def _fit_of(item: FittedRun) -> RunFit:
    assert item.fit is not None
    return item.fit


def _own_coefficients(pairs: _Pairs) -> tuple[Array, list[Array]]:
    """(a, k, g) of the runs' own fits, shape (r, 3), and their weights; zeros for the gain of a free run."""
    coefficients, weights = np.zeros((len(pairs), 3)), []
    for i, (_, item) in enumerate(pairs):
        if isinstance(item, DrivenRun):
            coefficients[i] = item.gained.coefficients
            weights.append(item.gained.weight)
            continue
        fit, weight = _fit_of(item), np.zeros((3, 3))
        assert item.noise is not None
        coefficients[i, :2] = fit.decay.rate, fit.decay.stiffness
        weight[:2, :2] = fit.reduced(2)[0] / (item.noise.std**2 * item.noise.slow_ratio)
        weights.append(weight)
    return coefficients, weights


def with_gains(design: Design, runs: Sequence[Run]) -> Design:
    """A design whose links give the gains of the inputs too.

    Args:
        design: of the runs, links of shape (2, p).
        runs: in the order of the links.

    Returns:
        Links of shape (3, p): (aᵢ, kᵢ, gᵢ) = Lᵢ φ with gᵢ 0 in free runs. Where the gain of an input is unknown, φ
        has it, per unit inertia and common to the runs, as last number: shape (3, p + 1).
    """
    place = design.columns.get("g")
    unknown = any(run.drive is not None and (run.input_gain is None or place is None) for run in runs)
    links = []
    for link, run in zip(design.links, runs, strict=True):
        whole = np.zeros((3, design.size + unknown))
        whole[:2, : design.size] = link
        if run.drive is not None and run.input_gain is not None and place is not None:
            whole[2, place] = run.input_gain
        elif run.drive is not None:
            whole[2, -1] = 1.0
        links.append(whole)
    return replace(design, links=tuple(links))


def joined_runs(runs: Sequence[Run], rig: RigProperties) -> set[str]:
    """Ids of the runs that are fitted together: those of stated stiffness.

    Without a known moment or a spring in any of them, a body without a spring says nothing on the inertia.
    """
    stated = [run for run in runs if run.spring_stiffness is not None]
    if stated and "g" not in build_design(stated, rig).columns:
        stated = [run for run in stated if run.spring_stiffness]
    return {run.id for run in stated}


def is_remarked(run: Run, joined: set[str]) -> bool:
    """Whether a note says what a driven run shows by itself: without a spring, or where it gives no coefficient."""
    apart = run.id not in joined and run.drive is not None and run.drive.on_body
    return run.unrestrained or apart


def run_remark(run: Run, gained: Gained) -> Remark:
    """What a driven run shows by itself, per unit inertia, and what it does not show."""
    (rate, _, gain), (rate_std, _, gain_std) = gained.coefficients, gained.deviations
    said = f"the gain of the input is {with_std(gain, gain_std)} rad/s² per unit"
    if gained.offset is None:
        return Remark(Outcome.NOTED, (run.id,), said, "state spring_stiffness for a gain in N m per unit")
    known, offset = run.input_gain is not None, gained.offset
    return Remark(
        Outcome.NOTED,
        (run.id,),
        f"without a spring {said}, the damping over the inertia {with_std(2.0 * rate, 2.0 * rate_std)} 1/s and a "
        f"constant moment beside the input {with_std(offset.value, offset.std)} {offset.unit}; "
        f"{'' if known else 'the inertia, '}omega_n, zeta and the sensor's zero are not determined",
        "add a run with a spring if they are needed" if known else "state drive_gain for the inertia",
        {
            "damping_over_inertia_per_s": 2.0 * float(rate),
            "gain_per_inertia": float(gain),
            "offset_in_units_of_the_input": offset.value,
        },
    )


def gain_remark(runs: Sequence[Run], parameters: Array, covariance: Array, inertia: float | None) -> Remark:
    """The gain that is common to the inputs of unknown gain.

    Args:
        parameters: φ with the gain last, per unit inertia, shape (p + 1,).
        covariance: of them, shape (p + 1, p + 1).
        inertia: kg m²; None where it was not found.
    """
    value, std = float(parameters[-1]), float(np.sqrt(covariance[-1, -1]))
    absolute = "" if inertia is None else f", {value * inertia:.5g} N m per unit"
    return Remark(
        Outcome.NOTED,
        tuple(run.id for run in runs if run.drive is not None),
        f"the gain of the input is {with_std(value, std)} rad/s² per unit{absolute}",
        "state drive_gain if it is known",
    )
