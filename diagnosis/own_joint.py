"""Campaigns of the joint of a model of one's own, with its law and its actuator in place of a spring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.likelihood.least_squares import try_fit
from diagnosis.likelihood.nondimensional import Similarity, frequency
from diagnosis.likelihood.problem import Point
from diagnosis.search.investigate import Progress, Study, investigate
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import Settings
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.drive import Drive
from tunnel_sim.vocabulary.errors import TunnelError, one_line
from tunnel_sim.vocabulary.rig import JointLaw

if TYPE_CHECKING:
    from tunnel_sim.engine.joint_model import Recorded

_SAME_GAIN = 1e-3  # relative: within it a stated gain, or a limit, is the model's


def reach(campaign: Campaign) -> float:
    """The greatest displacement in the records, rad; by way of the frequency where the sensor reads a rate."""
    found = []
    for run in campaign.runs:
        readings = run.record.yaw_rad[np.isfinite(run.record.yaw_rad)]
        turn = 2.0 * np.pi * frequency(run.record) if campaign.sensor.derivative else 1.0
        found.append(float(np.max(np.abs(readings - np.mean(readings)))) / turn**campaign.sensor.derivative)
    return max(found)


def recorded(campaign: Campaign, actuator: str | None = None) -> Recorded:
    """What the records say of the motion of a joint: where it moves, and whether a control drives it.

    Args:
        actuator: its name; None: the only one of the joint.
    """
    from tunnel_sim.engine.joint_model import Recorded  # only here: MuJoCo is slow to load

    controlled = any(run.drive is not None and run.drive.column == "drive" for run in campaign.runs)
    if not campaign.driven or campaign.sensor.derivative:  # driven runs of rates are refused later
        return Recorded(reach(campaign), 0.0 if campaign.driven else None, controlled, actuator)
    means = [np.nanmean(run.record.yaw_rad) for run in campaign.runs]
    middle = float(np.median(means))  # which similar campaigns take off
    far = max(float(np.nanmax(np.abs(run.record.yaw_rad - middle))) for run in campaign.runs)
    return Recorded(far, middle, controlled, actuator)


def with_law(campaign: Campaign, law: JointLaw) -> Campaign:
    """The campaign with a joint's law in place of a spring; its runs state the stiffness at rest.

    The gain of a control is that of the model's actuator.

    Raises:
        TunnelError: when the runs state more than one spring, the wind blows and a reference size is missing, or an
            input cannot be that of the joint.
    """
    springs = {run.spring_stiffness for run in campaign.runs} - {None}
    if len(springs) > 1:
        raise TunnelError(
            f"the runs state {len(springs)} springs, and a model has one",
            where="--model",
            remedy="diagnose the runs of each spring separately",
        )
    rig = campaign.rig
    if any(run.wind_on for run in campaign.runs) and None in (rig.frontal_area, rig.reference_length):
        raise TunnelError(
            "runs with a wind speed need the rig's sizes beside the model",
            where="--model",
            remedy="state frontal_area and reference_length under [rig] in campaign.toml",
        )
    runs = tuple(
        replace(run, spring_stiffness=law.stiffness, drive=run.drive and _of_joint(run, run.drive, law))
        for run in campaign.runs
    )
    return replace(campaign, runs=runs, law=law)


def _of_joint(run: Run, drive: Drive, law: JointLaw) -> Drive:
    """The input of a run with the gain of the joint's actuator; refused where the actuator could not follow it."""
    where, actuator = f"run {run.id}", law.actuator
    if drive.column == "base_rad":
        what, remedy = "the joint of a model has no root that moves", "name the input moment_nm or drive"
        raise TunnelError(f"{what}, and the input is base_rad", where=where, remedy=remedy)
    if drive.column == "moment_nm":
        return drive
    if actuator is None:
        if drive.gain is None:
            what = "the joint has no actuator in the model that the column drive could be the control of"
            raise TunnelError(
                what, where=where, remedy="add it to the model, state drive_gain, or give moment_nm"
            )
        return drive
    said = f"actuator {one_line(actuator.name)!r}"
    if drive.gain is not None and abs(drive.gain - actuator.gain) > _SAME_GAIN * abs(actuator.gain):
        what = f"drive_gain = {drive.gain:g} is stated, and {said} gives {actuator.gain:g} N m per unit of control"
        raise TunnelError(
            what, where=where, remedy="leave drive_gain out, or correct gear and gain of the model"
        )
    moments = actuator.gain * drive.values + actuator.servo[0] + actuator.servo[1] * run.record.yaw_rad
    for values, (low, high), name, unit in (
        (drive.values, actuator.control, "control", "of its ctrlrange"),
        (moments, actuator.moment, "moment", "N m of its force range"),
    ):
        slack = _SAME_GAIN * max(abs(low), abs(high))
        far = values[np.argmax(np.maximum(values - high, low - values))]
        if not low - slack <= far <= high + slack:
            what = f"the {name} of {said} reaches {far:.4g}, outside {low:.4g} to {high:.4g} {unit}"
            remedy = (
                "correct the range or the unit of the input, or leave out the run: clipping is not diagnosed"
            )
            raise TunnelError(what, where=where, remedy=remedy)
    return replace(drive, gain=actuator.gain)


def lead_words(law: JointLaw | None, similarity: Similarity) -> tuple[str, ...]:
    """The lead of the motion in a sentence; none where there is none.

    Args:
        law: of the similar campaign.
    """
    if law is None or law.lead == 0.0:
        return ()
    lead, step = (1e3 * similarity.own(value, "s") for value in (law.lead, law.step))
    return (
        f"The motion leads its input by {lead:.2g} ms, at most half of the model's step of {step:.3g} ms, as that "
        "of MuJoCo's integrators of first order does. This is taken off and is not counted as a cause.",
    )


def investigate_joint(
    campaign: Campaign, kinds: Sequence[type[Effect]], progress: Progress | None, settings: Settings
) -> Study:
    """The study of a campaign; with the lead of the motion where it explains more with no more causes.

    In integrators of first order the position of a step is already moved by the rate at its end, so that all motion
    leads its input by half a step. Records simulated in this way show it, measured ones do not, and the model
    cannot say which is right. It is therefore sought only where something is missed, and is not a cause.

    Args:
        campaign: in its own units, whose law may be that of a joint.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """
    found, law = investigate(campaign, kinds, progress, settings), campaign.law
    if law is None or not (law.step and campaign.driven and found.test.detected):
        return found
    lead = found.similarity.own(_lead(found), "s")
    if lead == 0.0:
        return found
    again = investigate(replace(campaign, law=replace(law, lead=lead)), kinds, progress, settings)
    unexplained = again.causes == UNKNOWN and found.causes != ()
    fewer = found.causes == UNKNOWN or len(again.causes) <= len(found.causes)
    return again if fewer and not unexplained else found


def _lead(study: Study) -> float:
    """The lead with which the answer's effects, without a delay, leave least, similar s; 0 if not clear."""
    from scipy.special import chdtri  # only here: slow to load

    problem, point, law = study.chosen.problem, study.chosen.point, study.campaign.law
    assert law is not None
    effects = tuple(kind for kind in problem.effects if not kind.driven)
    whole = dict(zip(problem.names, point.common.tolist(), strict=True))
    leads, totals = 0.5 * law.step * np.array([0.0, 0.5, 1.0]), []
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
