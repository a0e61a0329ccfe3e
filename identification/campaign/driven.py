"""Output error of driven and free runs together: maximum likelihood with the input exact between its samples.

Per unit inertia a run i has (aᵢ, kᵢ, gᵢ) = Lᵢ φ: with a stated spring, gᵢ is 1/Izz for a known moment, Kr/Izz for
the motion of the spring's root, and a parameter common to the campaign for an input of unknown gain. The runs' own
fits start the joint fit, as for free decays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.campaign.derivatives import (
    build_design,
    combine,
    derivatives,
    design_statuses,
    filled_estimate,
    noise_statuses,
    statuses_of_runs,
)
from identification.estimate import Estimate, RunEstimate, Status, by_severity
from identification.signal.decay_fit import Reading, RunFit
from identification.signal.driven import driven_rows, driven_start
from identification.signal.free_decay import Decay, response_rows, sensitivity_weights
from identification.signal.noise import noise_level
from identification.signal.run_fit import (
    FittedRun,
    decay_covariance_of,
    describe_run,
    identify_run,
    noise_and_failure,
    residuals_of,
)
from identification.statistics import determined, eliminate, fisher_covariance, inverse, scaled_solve
from identification.status import Outcome, Remark
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array

_MOST_STEPS = 60
_SETTLED = 1e-10  # share of the sum of squares by which a last step may lower it
_OWN = 3  # numbers of each run: zero, initial angle, initial rate


@dataclass(frozen=True, eq=False)
class _Fit:
    """Runs at the optimum.

    Args:
        parameters: φ, shape (p,).
        own: zero (rad), initial angle (rad) and rate (rad/s) of each run, shape (r, 3).
        residuals: reading less model, by run, rad.
        normal: information of φ, of the common zero where there is one, and then of the runs' own numbers.
        converged: whether a last step no longer paid.
    """

    parameters: Array
    own: Array
    residuals: list[Array]
    normal: Array
    converged: bool


def driven_estimate(campaign: Campaign, name: str) -> Estimate:
    """Identify every run, then the campaign.

    Args:
        campaign: at least one run, some of them driven, each with a spring or none stated.
        name: of the estimator.

    Returns:
        The estimate. The gain of an input, per unit inertia or in N m per unit, is a remark.
    """
    fitted = [
        identify_run(run, campaign.sensor) if run.drive is None else _driven_run(run, campaign.sensor)
        for run in campaign.runs
    ]
    estimate = Estimate(campaign.name, name, tuple(item.estimate for item in fitted))
    statuses = statuses_of_runs(campaign, estimate.runs)
    if Status.NO_RUN_IDENTIFIED in statuses:
        return replace(estimate, statuses=by_severity(statuses))
    pairs = [
        (run, item)
        for run, item in zip(campaign.runs, fitted, strict=True)
        if item.fit is not None and run.spring_stiffness
    ]
    statuses |= noise_statuses([item.noise for item in fitted])
    if not pairs:
        gains = [
            _own_gain_remark(run, item)
            for run, item in zip(campaign.runs, fitted, strict=True)
            if run.drive is not None and run.drive.on_body and item.fit is not None
        ]
        return replace(estimate, statuses=by_severity(statuses), remarks=tuple(gains))
    return _joint(campaign, estimate, pairs, statuses)


def _driven_run(run: Run, sensor: SensorProperties) -> FittedRun:
    reading = Reading.from_record(run.record)
    assert run.drive is not None
    start = driven_start(reading.time, reading.yaw, run.drive.values)
    if start is None or not start[1] > 0.0:
        return FittedRun(reading, None, None, RunEstimate(run.id, (Status.NO_OSCILLATION,)))
    tied = not run.drive.on_body  # the root's motion acts through the spring: its gain is k
    link = np.eye(3)[:, :2] + (np.eye(3, 2, -1) * [[0.0], [0.0], [1.0]]) if tied else np.eye(3)
    found = _fit([run], [link], np.array(start)[: link.shape[1]], own_zeros=True)
    # a record shows no resonance above half its sample rate
    fastest = np.pi / float(np.diff(reading.time).min())
    if not found.converged or not 0.0 < found.parameters[1] < fastest**2:
        return FittedRun(reading, None, None, RunEstimate(run.id, (Status.NOT_CONVERGED,)))
    size = link.shape[1]
    order = [0, 1, *range(size, size + _OWN), *range(2, size)]
    information = found.normal[np.ix_(order, order)]
    if not tied:  # the gain of the run's own
        information = eliminate(information, np.zeros(len(order)), 2 + _OWN)[0]
    decay = Decay(*found.parameters[:2].tolist())
    zero, angle, rate = found.own[0].tolist()
    fit = RunFit(decay, angle, rate, found.residuals[0], information, np.zeros(2 + _OWN))
    noise, failure = noise_and_failure(reading, fit, zero, sensor)
    if failure is not None:
        return FittedRun(reading, None, None, RunEstimate(run.id, (failure,)))
    variance = noise.std**2 * noise.slow_ratio
    covariance = decay_covariance_of(fit) * variance
    estimate = describe_run(run, reading, fit, zero, covariance, variance, noise=noise)
    return FittedRun(reading, None if estimate.omega_n is None else fit, noise, estimate)


def _joint(
    campaign: Campaign, estimate: Estimate, pairs: Sequence[tuple[Run, FittedRun]], statuses: set[Status]
) -> Estimate:
    runs = [run for run, _ in pairs]
    design = build_design(runs, campaign.rig)
    own = [item.fit for _, item in pairs if item.fit is not None]
    decays = np.array([[fit.decay.rate, fit.decay.stiffness] for fit in own])
    start = combine(design, decays, [eliminate(fit.information, fit.score, 2)[0] for fit in own])
    if start is None:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    links = [_with_gain(link, run, design.columns) for link, run in zip(design.links, runs, strict=True)]
    known = [run for run in runs if run.drive is not None and _is_known(run, design.columns)]
    gains = [_driven_gain(run) for run in runs if run.drive is not None and run not in known]
    parameters = np.append(start[0], float(np.median(gains)) if gains else 0.0)
    size = parameters.size if gains else design.size
    own_zeros = campaign.sensor.zero == "per_run"
    found = _fit(runs, [link[:, :size] for link in links], parameters[:size], own_zeros=own_zeros)
    if not found.converged:
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_CONVERGED}))
    information = eliminate(found.normal, np.zeros(len(found.normal)), size)[0]
    if not determined(information):
        return replace(estimate, statuses=by_severity(statuses | {Status.NOT_DETERMINED}))
    readings = [item.reading for _, item in pairs]
    fits = [
        replace(fit, residual=residual, angle=float(own[1]), rate=float(own[2]))
        for fit, residual, own in zip(own, found.residuals, found.own, strict=True)
    ]
    noise = noise_level(
        residuals_of(readings, fits, float(np.mean(found.own[:, 0])), 2 + own_zeros), campaign.sensor
    )
    covariance = fisher_covariance(information, noise)
    values = derivatives(design, found.parameters[: design.size])
    inner = covariance[: design.size, : design.size]
    statuses |= noise_statuses([noise]) | design_statuses(design, found.parameters[: design.size])
    filled = filled_estimate(
        campaign, estimate, runs, design, values, values.jacobian @ inner @ values.jacobian.T, statuses
    )
    remarks = (
        () if not gains else (_gain_remark(runs, found.parameters, covariance, values.get("yaw_inertia")),)
    )
    return replace(filled, noise=noise, remarks=remarks)


def _is_known(run: Run, columns: dict[str, int]) -> bool:
    """Whether the gain of a driven run per unit inertia follows from the other parameters."""
    drive = run.drive
    return drive is not None and "g" in columns and (drive.column != "drive" or drive.gain is not None)


def _with_gain(link: Array, run: Run, columns: dict[str, int]) -> Array:
    """The link of a run with a row for its gain, and a column for the unknown one, shape (3, p + 1)."""
    whole = np.zeros((3, link.shape[1] + 1))
    whole[:2, :-1] = link
    if run.drive is None:
        return whole
    if not _is_known(run, columns):
        whole[2, -1] = 1.0
        return whole
    factor = {"moment_nm": 1.0, "drive": run.drive.gain, "base_rad": run.spring_stiffness}[run.drive.column]
    assert factor is not None
    whole[2, columns["g"]] = factor
    return whole


def _driven_gain(run: Run) -> float:
    assert run.drive is not None
    start = driven_start(run.record.time_s, run.record.yaw_rad, run.drive.values)
    return 0.0 if start is None else start[2]


def _own_gain_remark(run: Run, item: FittedRun) -> Remark:
    """The gain of one run's input per unit inertia, at the run's own fit."""
    assert item.fit is not None
    assert item.noise is not None
    start = np.array([item.fit.decay.rate, item.fit.decay.stiffness, _driven_gain(run)])
    found = _fit([run], [np.eye(3)], start, own_zeros=True)
    information = eliminate(found.normal, np.zeros(len(found.normal)), 3)[0]
    std = float(np.sqrt(inverse(information)[2, 2] * item.noise.slow_ratio)) * item.noise.std
    return Remark(
        Outcome.NOTED,
        (run.id,),
        f"the gain of the input is {found.parameters[2]:.5g} ± {std:.2g} rad/s² per unit",
        "state spring_stiffness for a gain in N m per unit",
    )


def _gain_remark(runs: Sequence[Run], parameters: Array, covariance: Array, inertia: float | None) -> Remark:
    value, std = float(parameters[-1]), float(np.sqrt(covariance[-1, -1]))
    absolute = "" if inertia is None else f", {value * inertia:.5g} N m per unit"
    return Remark(
        Outcome.NOTED,
        tuple(run.id for run in runs if run.drive is not None),
        f"the gain of the input is {value:.5g} ± {std:.2g} rad/s² per unit{absolute}",
        "state drive_gain if it is known",
    )


def _fit(runs: Sequence[Run], links: Sequence[Array], start: Array, *, own_zeros: bool) -> _Fit:
    """Least squares by Levenberg and Marquardt; ``links`` are of shape (3, p)."""
    parameters, own = start.astype(np.float64), np.zeros((len(runs), _OWN))
    for i, (run, link) in enumerate(zip(runs, links, strict=True)):
        residual, jacobian = _linearised(run, link, parameters, own[i])
        own[i] = np.linalg.lstsq(jacobian[:, -_OWN:], residual, rcond=None)[0]
    if not own_zeros:
        own[:, 0] = own[:, 0].mean()
    damping, converged = 1e-9, False
    residuals, normal, gradient = _system(runs, links, parameters, own, own_zeros)
    cost = sum(float(r @ r) for r in residuals)
    for _ in range(_MOST_STEPS):
        try:
            step = scaled_solve(normal + damping * np.diag(np.diag(normal)), gradient)
        except np.linalg.LinAlgError:
            break
        moved, moved_own = _moved(parameters, own, step, own_zeros)
        with np.errstate(all="ignore"):  # a trial far off may overflow; it is rejected then
            trial = _system(runs, links, moved, moved_own, own_zeros)
        after = sum(float(r @ r) for r in trial[0])
        if np.isfinite(after) and after <= cost:
            converged = cost - after <= _SETTLED * cost
            parameters, own, cost, damping = moved, moved_own, after, damping / 10.0
            residuals, normal, gradient = trial
        else:
            damping = max(10.0 * damping, 1e-6)
            converged = damping > 1e6
        if converged:
            break
    return _Fit(parameters, own, residuals, normal, converged)


def _moved(parameters: Array, own: Array, step: Array, own_zeros: bool) -> tuple[Array, Array]:
    size = parameters.size
    changed = own.copy()
    if own_zeros:
        changed += step[size:].reshape(-1, _OWN)
    else:
        changed[:, 0] += step[size]
        changed[:, 1:] += step[size + 1 :].reshape(-1, _OWN - 1)
    return parameters + step[:size], changed


def _system(
    runs: Sequence[Run], links: Sequence[Array], parameters: Array, own: Array, own_zeros: bool
) -> tuple[list[Array], Array, Array]:
    """Residuals, information and score of φ, the common zero where there is one, and the runs' own numbers."""
    shared = parameters.size + (not own_zeros)
    width = _OWN if own_zeros else _OWN - 1
    normal = np.zeros((shared + width * len(runs),) * 2)
    gradient, residuals = np.zeros(len(normal)), []
    for i, (run, link) in enumerate(zip(runs, links, strict=True)):
        residual, jacobian = _linearised(run, link, parameters, own[i])
        places = np.r_[np.arange(shared), shared + width * i + np.arange(width)]
        normal[np.ix_(places, places)] += jacobian.T @ jacobian
        gradient[places] += jacobian.T @ residual
        residuals.append(residual)
    return residuals, normal, gradient


def _linearised(run: Run, link: Array, parameters: Array, own: Array) -> tuple[Array, Array]:
    """Residual and Jacobian of one run: φ, zero, initial angle, initial rate."""
    time = run.record.time_s - run.record.time_s[0]
    rate, stiffness, gain = (float(value) for value in link @ parameters)
    zero, angle, initial = own.tolist()
    decay = Decay(rate, stiffness)
    rows = response_rows(time, decay)
    local = np.zeros((3, time.size))
    local[:2] = sensitivity_weights(decay, angle, initial) @ rows
    model = zero + angle * rows[0] + initial * rows[1]
    if run.drive is not None:
        driven = driven_rows(time, run.drive.values, rate, stiffness, held=run.drive.hold == "zero")
        model = model + gain * driven[0]
        local[:2] += gain * driven[1:]
        local[2] = driven[0]
    jacobian = np.column_stack([local.T @ link, np.ones(time.size), rows[0], rows[1]])
    return run.record.yaw_rad - model, jacobian
