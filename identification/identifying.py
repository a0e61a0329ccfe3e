"""Identification of a campaign."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from identification.campaign.springs import pair_remark
from identification.estimate import Estimate, RunEstimate, Status, by_severity
from identification.estimators import (
    SUMMARIES,
    Estimator,
    estimators_of_driven_runs,
    make_estimator,
    takes_driven,
)
from identification.examination.ambient import is_ambient
from identification.examination.examine import as_angles, examine
from identification.examination.self_excited import in_limit_cycle
from identification.progress import Progress, shown_by
from identification.returned import checked_return
from identification.signal.known_gain import refuse_other_gains
from identification.statistics import widened_by_contradictions, widened_by_rounding, withheld
from identification.status import Examined, Outcome, Remark, left_out_as_asked
from identification.trade_off import of_coefficients
from tunnel_sim.files.as_campaign import as_campaign
from tunnel_sim.processes import one_blas_thread
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError


@one_blas_thread()
def identify(
    campaign: Campaign | Path | str,
    estimator: str | Estimator = "output_error",
    *,
    leave_out: Collection[str] = (),
    throw: bool = True,
    progress: Progress | None = None,
) -> Estimate:
    """Identify a campaign's coefficients and each of its runs.

    The campaign is examined first (`identification.examination.examine`): the estimate's remarks say what was
    left out or cut.

    Args:
        campaign: the runs of one rig; angles in rad, stiffness in N m/rad, speed in m/s. Or its folder, or one file
            of a data logger.
        estimator: a name of `identification.estimators.known_estimators`, or an estimator with its own
            settings, such as ``OutputError(cycles_per_window=5)``, or your own estimator.
        leave_out: ids of runs to leave out; a remark names them.
        throw: raise an error when no run has a result; otherwise the estimate's status says so.
        progress: called with the numbers of identified runs and of all runs; None: nothing is reported.

    Returns:
        The estimate. Values that could not be identified are None; the statuses say why and what to do.

    Raises:
        TunnelError: for an unknown estimator, a campaign without runs, an id in ``leave_out`` that no run has, a
            wind-on run without air density, records that the examination refuses, and, with ``throw``, when no run
            could be identified. A `WrongReturn` where your own estimator does not return an estimate of these runs
            with finite values.
    """
    campaign = as_campaign(campaign).without(leave_out)
    chosen = make_estimator(estimator) if isinstance(estimator, str) else estimator
    freedom = campaign.sensor.freedom
    with freedom.errors(), shown_by(progress):
        found = _identified(campaign, chosen, leave_out, throw=throw)
    asked = {status for status in found.statuses if freedom.windy or status is not Status.NO_WIND_ON}
    found = replace(found, statuses=by_severity(asked), motion=freedom.motion)
    return freedom.document(found, (campaign.name, *(run.id for run in campaign.runs)))


def _identified(
    campaign: Campaign, chosen: Estimator, leave_out: Collection[str], *, throw: bool
) -> Estimate:
    """The estimate in the units of an angle; arguments as in `identify`."""
    if not campaign.runs:
        raise TunnelError("campaign without runs", where=campaign.name, remedy="add at least one run")
    if campaign.driven and not takes_driven(chosen):  # it would mistake them for free decays
        remedy = f"use {' or '.join(estimators_of_driven_runs())}, or leave the driven runs out"
        if chosen.name not in SUMMARIES:
            remedy += "; a class that uses their inputs states takes_driven = True"
        what = f"the run is driven, and {chosen.name} takes free decays only"
        raise TunnelError(what, where=f"{campaign.name}, run '{campaign.driven_runs[0].id}'", remedy=remedy)
    refuse_other_gains(campaign.checked_inputs())
    estimate = identify_examined(examine(campaign).accepted(), chosen, campaign)
    estimate = replace(
        estimate, remarks=(*left_out_as_asked(leave_out), *_assumed(campaign), *estimate.remarks)
    )
    if throw and estimate.status.failed:
        what, _, remedy = estimate.status.value.partition(": ")
        raise TunnelError(what, where=campaign.name, remedy=remedy)
    return estimate


def identify_examined(examined: Examined, chosen: Estimator, campaign: Campaign | None = None) -> Estimate:
    """Identify runs that are examined and accepted, as `identify` does after its own examination.

    Args:
        campaign: all runs before the examination; None: those of ``examined``.

    Raises:
        TunnelError: where the estimator refuses the runs; a `WrongReturn` as by `identify`.
    """
    campaign = examined.campaign if campaign is None else campaign
    remaining = examined.campaign
    # the filter does not need the decay rate, which these runs cannot give
    random = (
        () if chosen.name == "filter_error" else tuple(run.id for run in remaining.runs if is_ambient(run))
    )
    remaining = replace(remaining, runs=tuple(run for run in remaining.runs if run.id not in random))
    found = (
        checked_return(chosen.estimate(remaining), chosen.name, remaining)
        if remaining.runs
        else Estimate(campaign.name, chosen.name, ())
    )
    found = widened_by_rounding(found, remaining.runs)
    found = withheld(widened_by_contradictions(found, remaining, examined.remarks), examined.remarks)
    estimate = as_angles(found, campaign.sensor)
    # the estimate includes these runs and every other run of the campaign, in its order
    if examined.remarks or random:
        of_runs = {run.id: run for run in estimate.runs}
        cycling = {name for one in examined.remarks if in_limit_cycle(one.figures) for name in one.runs}
        why = {run.id: Status.REPEATED_RUN for run in campaign.runs if run.id not in of_runs}
        why |= dict.fromkeys(cycling & why.keys(), Status.LIMIT_CYCLE)
        why |= dict.fromkeys(random, Status.AMBIENT_VIBRATION)
        of_runs |= {name: RunEstimate(name, (status,)) for name, status in why.items()}
        estimate = replace(
            estimate,
            runs=tuple(of_runs[run.id] for run in campaign.runs),
            statuses=by_severity({*estimate.statuses, *why.values()}),
            remarks=(*examined.remarks, *estimate.remarks),
        )
    # the remark names the springs
    contradicted = any("inertias_kg_m2" in one.figures for one in examined.remarks)
    if not contradicted and (pair := pair_remark(remaining, estimate.runs)) is not None:
        estimate = replace(estimate, remarks=(*estimate.remarks, pair))
    return replace(
        estimate, trade_off=of_coefficients(estimate.parameters, estimate.covariance_matrix, remaining)
    )


def _assumed(campaign: Campaign) -> tuple[Remark, ...]:
    """The remark on driven runs with an unstated hold, for which the input is assumed linear between samples."""
    runs = [run for run in campaign.runs if run.drive is not None and run.drive.hold is None]
    if not runs:
        return ()
    half = 500.0 * max(run.record.sample_interval for run in runs)
    what = (
        "drive_hold is not stated, so the input is assumed linear between samples; a held input would act "
        f"half a sample ({half:.3g} ms) later, which changes stiffness and damping"
    )
    remedy = 'state drive_hold = "zero" or "linear"'
    return (Remark(Outcome.NOTED, tuple(run.id for run in runs), what, remedy),)
