"""Which runs of a campaign can be diagnosed together, and with which effects; the rest is refused."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.nondimensional import Similarity, free_frequency, frequency, response_to_input
from diagnosis.noise.sensor_noise import LEAST_SAMPLES
from diagnosis.policy import ANOTHER_MODE, SAME_SPRING
from identification.estimate import Status
from identification.examination.examine import examine, with_clocks
from identification.examination.self_excited import in_limit_cycle
from identification.signal.run_fit import NO_WINDOWS, identify_run
from identification.status import Outcome, Remark
from tunnel_sim.effects import Effect, the_effect
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.drive import Drive
from tunnel_sim.vocabulary.errors import TunnelError, one_line
from tunnel_sim.vocabulary.rig import JointLaw

if TYPE_CHECKING:
    from tunnel_sim.engine.joint_model import Recorded

_SAME_GAIN = 1e-3  # relative: within it a stated gain, or a limit, is the model's

SLIDE = "The joint slides: read m for rad, N for N m and kg for kg m2 throughout."


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
    if not campaign.driven or campaign.sensor.derivative:  # rates of driven runs are refused later
        return Recorded(reach(campaign), 0.0 if campaign.driven else None, controlled, actuator)
    middle = float(
        np.median([np.nanmean(run.record.yaw_rad) for run in campaign.runs])
    )  # as similar campaigns
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
        slack = _SAME_GAIN * max(abs(low), abs(high)) if np.isfinite([low, high]).any() else 0.0
        far = values[np.argmax(np.maximum(values - high, low - values))]
        if not low - slack <= far <= high + slack:
            what = f"the {name} of {said} reaches {far:.4g}, outside {low:.4g} to {high:.4g} {unit}"
            remedy = (
                "correct the range or the unit of the input, or leave out the run: clipping is not diagnosed"
            )
            raise TunnelError(what, where=where, remedy=remedy)
    return replace(drive, gain=actuator.gain)


_LEFT_OUT = "left out of the diagnosis, which compares free decays"


@dataclass(frozen=True)
class Diagnosable:
    """The runs to diagnose.

    Args:
        limit_cycles: whether they are all in limit cycles, so that no decay remains.
    """

    campaign: Campaign
    remarks: tuple[Remark, ...]
    limit_cycles: bool = False


def diagnosable(campaign: Campaign) -> Diagnosable:
    """Examine a campaign, and separate its free decays from runs in a limit cycle.

    Where all are in one, their whole records remain.

    Raises:
        TunnelError: when the examination refuses the records.
    """
    examined = examine(campaign).accepted()
    cycling = {name for r in examined.remarks if in_limit_cycle(r.figures) for name in r.runs}
    if not cycling:
        return Diagnosable(examined.campaign, examined.remarks)
    decays = tuple(run for run in examined.campaign.runs if run.id not in cycling)
    if decays:
        remarks = tuple(
            replace(r, outcome=Outcome.LEFT_OUT, remedy=_LEFT_OUT) if in_limit_cycle(r.figures) else r
            for r in examined.remarks
        )
        return Diagnosable(replace(examined.campaign, runs=decays), remarks)
    whole, _ = with_clocks(replace(campaign, runs=tuple(r for r in campaign.runs if r.id in cycling)))
    return Diagnosable(whole, examined.remarks, limit_cycles=True)


@dataclass(frozen=True)
class Chosen:
    """What is diagnosed.

    Args:
        examined: all runs that show the kind of motion diagnosed.
        campaign: those of them that one model can be fitted to.
        kinds: the effects to answer with; none where all runs are in limit cycles.
        left_out: sentences that say which runs and effects were left out, and why.
    """

    examined: Campaign
    campaign: Campaign
    kinds: tuple[type[Effect], ...]
    remarks: tuple[Remark, ...]
    left_out: tuple[str, ...]
    limit_cycles: bool


def choose(campaign: Campaign, kinds: Sequence[type[Effect]]) -> Chosen:
    """Choose the runs of a campaign that are diagnosed together, and the effects to answer with.

    Raises:
        TunnelError: when the examination refuses the records, or a run shows no motion that can be diagnosed.
    """
    found = diagnosable(campaign)
    if not found.limit_cycles:
        refuse_motionless(found.campaign)
    compared, left_out = comparable_runs(found.campaign)
    if compared.sensor.derivative:
        # Their sizes are those of angles, and their ranges too; a mode moves the body.
        kinds = [kind for kind in kinds if kind.channel != "sensor" or kind.line == "ringing"]
        said = f"A second mode is the only effect of the sensor that is tried on {compared.sensor.quantity}s."
        left_out = (*left_out, said)
    kinds, said_of_drive = kinds_for(compared, kinds)
    left_out = (*left_out, *said_of_drive)
    if compared.law is not None and compared.law.slide:
        left_out = (*left_out, SLIDE)
    known = () if found.limit_cycles else kinds
    return Chosen(found.campaign, compared, known, found.remarks, left_out, found.limit_cycles)


def comparable_runs(campaign: Campaign) -> tuple[Campaign, tuple[str, ...]]:
    """Leave out the runs that cannot be fitted together with the others, and say in sentences which and why.

    Where some runs state ``spring_stiffness`` and others do not, the larger group remains (those that state it, if
    equal). Of runs that do not state it, those with the same frequency at the same wind speed remain: only they can
    have one spring. A wind-on run that swings in another mode than the wind-off runs of its spring is left out.
    """
    stated = [run for run in campaign.runs if run.spring_stiffness is not None]
    bare = [run for run in campaign.runs if run.spring_stiffness is None]
    said = []
    kept = stated if len(stated) >= len(bare) else bare
    if stated and bare:
        other, what = (bare, "state no") if kept is stated else (stated, "state their")
        said.append(
            f"Left out, since they {what} spring_stiffness and the others "
            f"{'do' if kept is stated else 'do not'}: {_ids(other)}. State it for all runs, or diagnose these "
            f"separately."
        )
    if kept is bare:
        same = _of_one_spring(bare)
        if len(same) < len(bare):
            other = [run for run in bare if run not in same]
            said.append(
                f"Left out, since different frequencies at one wind speed show more than one spring, and these "
                f"runs may not have the spring of the rest: {_ids(other)}. State spring_stiffness, or diagnose "
                f"these separately."
            )
        kept = same
    still: dict[float | None, list[float]] = defaultdict(list)
    for run in kept:
        if not run.wind_on:
            still[run.spring_stiffness].append(free_frequency(run))
    elsewhere = [
        run
        for run in kept
        if run.wind_on
        and run.spring_stiffness in still
        and free_frequency(run) > ANOTHER_MODE * median(still[run.spring_stiffness])
    ]
    if elsewhere:
        said.append(
            f"Left out, since they swing in another mode, {ANOTHER_MODE:g} times as fast as the same spring with "
            f"the wind off or faster: {_ids(elsewhere)}. Diagnose these separately."
        )
        kept = [run for run in kept if run not in elsewhere]
    order = {run.id for run in kept}
    return replace(campaign, runs=tuple(run for run in campaign.runs if run.id in order)), tuple(said)


def _ids(runs: Sequence[Run]) -> str:
    return ", ".join(run.id for run in runs)


def _of_one_spring(runs: Sequence[Run]) -> list[Run]:
    """The largest group of runs that may have one spring.

    The air reduces the stiffness of every spring by the same amount, so that the order of the frequencies is the
    same at each speed.
    """
    by_speed: dict[float, list[tuple[float, Run]]] = defaultdict(list)
    for run in runs:
        by_speed[run.wind_speed].append((free_frequency(run), run))
    # by speed, groups of runs with about the same frequency, lowest first
    groups: list[list[list[Run]]] = []
    for alike in by_speed.values():
        ranked = sorted(alike, key=lambda pair: pair[0])
        found = [[ranked[0][1]]]
        for (last, _), (now, run) in itertools.pairwise(ranked):
            if now > SAME_SPRING * last:
                found.append([])
            found[-1].append(run)
        groups.append(found)
    counts = {len(found) for found in groups}
    if counts == {1}:
        return list(runs)
    if len(counts) == 1:
        return max(([run for group in rank for run in group] for rank in zip(*groups, strict=True)), key=len)
    return max((group for found in groups for group in found), key=len)


_ROD = the_effect(channel="stiffness", condition="always", autonomous=False)
_NOT_TRIED = "On driven runs these effects are not tried yet: {}."
_MOVING_ROOT = "Where the spring's root moves, its loss depends on that motion, and is not tried: {}."
_OF_SERVO = "The actuator is a servo, from whose command these effects of a spring would act; not tried: {}."
_NO_MOMENT = "Without a spring these effects have no moment, and are not tried: {}."
_NO_ZERO = (
    "Without a spring the sensor's zero is not determined, and these effects of the sensor are not tried: {}."
)

#: Said where effects are compared in this way.
BY_MOMENT = (
    "Nothing holds the body, so that small errors of the moment add up in its angle, which departs from every "
    "model. Effects are therefore compared by the moment that they leave. It counts as random noise beside the "
    "answer: parameters, coefficients and the shares in the table of answers come from fits with that noise. All "
    "other sizes and shares are those of the angle."
)

#: Said of a campaign with driven runs.
NOT_SOUGHT = (
    "What could be closed of what remains, and by which formula, is not sought where a run is driven."
)


def refuse_undiagnosable(campaign: Campaign) -> None:
    """Refuse driven runs that the diagnosis does not treat yet, and free ones of a joint that nothing holds.

    Raises:
        TunnelError: for the first such run.
    """
    driven = [run for run in campaign.runs if run.drive is not None]
    for run in driven:
        assert run.drive is not None
        where = f"{campaign.name}, run '{run.id}'"
        why = ""
        if run.spring_stiffness == 0.0 and not run.drive.on_body:
            raise TunnelError(
                "the motion of the root acts through the spring, and spring_stiffness = 0 states none",
                where=where,
                remedy="state the spring's stiffness, or name the input moment_nm or drive",
            )
        if run.spring_stiffness == 0.0 and run.wind_on:
            why = "is driven and has no spring, and the wind blows"
        elif campaign.sensor.derivative:
            why = f"is driven, and its sensor reads {campaign.sensor.quantity}s"
        elif not run.record.uniform:
            why = "is driven, and its samples are not evenly spaced"
        elif run.record.yaw_rad.size < LEAST_SAMPLES:
            raise TunnelError(
                f"the run is driven and has {run.record.yaw_rad.size} samples: too few to tell its noise from its "
                "response",
                where=where,
                remedy=f"record {LEAST_SAMPLES} samples or more, or leave the run out",
            )
        if why:
            what = f"the run {why}, which is not diagnosed yet"
            raise TunnelError(what, where=where, remedy="leave the run out")
    on_body = [run.drive for run in driven if run.drive is not None and run.drive.on_body]
    mixed = {drive.column == "moment_nm" or drive.gain is not None for drive in on_body}
    if len(mixed) > 1 and any(run.spring_stiffness is None for run in campaign.runs):
        raise TunnelError(
            "without spring_stiffness, inputs of known and of unknown gain cannot be diagnosed together",
            where=campaign.name,
            remedy="state spring_stiffness, or diagnose the two kinds of runs separately",
        )
    free = [run for run in campaign.runs if run.drive is None]
    if campaign.law is not None and campaign.law.stiffness == 0.0 and free:
        raise TunnelError(
            f"nothing holds the joint of the model, and nothing drives {_ids(free)}",
            where=campaign.name,
            remedy="leave these runs out, or add the spring, or gravity, that restores it",
        )
    loose = [run for run in campaign.runs if run.unrestrained]
    if loose and not campaign.unrestrained:
        raise TunnelError(
            f"runs with a spring and without one ({_ids(loose)}) cannot be diagnosed together yet",
            where=campaign.name,
            remedy="diagnose the two kinds of runs separately",
        )
    if any(run.input_gain is None for run in loose):
        raise TunnelError(
            "without a spring, an input of unknown gain shows no inertia, and no moment in N m",
            where=campaign.name,
            remedy="state drive_gain, or record the moment as moment_nm",
        )
    mixed = {run.drive.column == "moment_nm" or run.drive.gain is not None for run in driven if run.drive}
    if len(mixed) > 1 and any(run.spring_stiffness is None for run in campaign.runs):
        raise TunnelError(
            "without spring_stiffness, inputs of known and of unknown gain cannot be diagnosed together",
            where=campaign.name,
            remedy="state spring_stiffness, or diagnose the two kinds of runs separately",
        )


def refuse_motionless(campaign: Campaign) -> None:
    """Refuse a run that shows no motion to diagnose; the estimators leave out the same free decays.

    Raises:
        TunnelError: for the first run without a decaying motion, or the first driven one whose motion does not
            follow from its input, as an oscillation where there is a spring.
    """
    for run in campaign.runs:
        if run.drive is not None:
            continue
        status = identify_run(run, campaign.sensor, cycles_per_window=NO_WINDOWS).estimate.status
        if status in (Status.NO_OSCILLATION, Status.NOT_DETERMINED):
            what, _, remedy = status.value.partition(": ")
            raise TunnelError(what, where=f"run {run.id}", remedy=f"{remedy}; or leave the run out")
    for run in campaign.runs:
        if run.drive is None:
            continue
        found = response_to_input(run)
        own = campaign.law is not None  # whose resonance is known, and need not be seen
        if (run.unrestrained or own) and (found is None or not found[2] * (run.input_gain or 1.0) > 0.0):
            raise TunnelError(
                "the motion does not follow the moment of the input",
                where=f"run {run.id}",
                remedy="check its sign, and that all moments on the body are in it; or leave the run out",
            )
        if not (run.unrestrained or own) and (found is None or not found[1] > 0.0):
            raise TunnelError(
                "no resonance between input and motion",
                where=f"run {run.id}",
                remedy="drive it over a band that includes the natural frequency; or leave the run out",
            )


def kinds_for(
    campaign: Campaign, kinds: Sequence[type[Effect]]
) -> tuple[tuple[type[Effect], ...], tuple[str, ...]]:
    """The effects, of those to answer with, that can be fitted to a campaign, and sentences that name the others.

    Where no run is driven, they are those that act on free decays, without a sentence.
    """
    if not campaign.driven:
        return tuple(kind for kind in kinds if not kind.driven), ()
    kept = tuple(kind for kind in kinds if not (kind.line == "ringing" or kind.skips or kind is _ROD))
    gone = {_NOT_TRIED: [kind for kind in kinds if kind not in kept]}
    if any(run.drive is not None and not run.drive.on_body for run in campaign.runs):
        gone[_MOVING_ROOT] = [kind for kind in kept if kind.on_spring and kind.channel == "damping"]
        kept = tuple(kind for kind in kept if kind not in gone[_MOVING_ROOT])
    actuator = None if campaign.law is None else campaign.law.actuator
    if actuator is not None and actuator.servo[1] != 0.0:
        gone[_OF_SERVO] = [kind for kind in kept if kind.on_spring]
        kept = tuple(kind for kind in kept if kind not in gone[_OF_SERVO])
    if campaign.unrestrained:
        gone[_NO_MOMENT] = [kind for kind in kept if kind.on_spring]
        gone[_NO_ZERO] = [kind for kind in kept if kind.channel == "sensor" and kind.fitted]
        kept = tuple(kind for kind in kept if kind not in (*gone[_NO_MOMENT], *gone[_NO_ZERO]))
    said = [why.format(", ".join(kind.name for kind in some)) for why, some in gone.items() if some]
    return kept, tuple(said)


def gain_words(campaign: Campaign, fit: Fit) -> tuple[str, ...]:
    """The gain of the input by the model or the fit, in a sentence; none where the campaign states it."""
    actuator = None if campaign.law is None else campaign.law.actuator
    if actuator is not None:
        said = f"gives {actuator.gain:.5g} N m per unit of control"
        return (f"By the model, actuator {one_line(actuator.name)!r} {said}.",)
    if "drive_gain" not in fit.problem.names:
        return ()
    data = fit.problem.data
    known = any(
        r.drive is not None and (r.drive.column == "moment_nm" or r.drive.gain) for r in campaign.runs
    )
    unit = "kg m2" if known else "N m"
    value, std = fit.value("drive_gain"), fit.std("drive_gain")
    value, std = (data.similarity.own(1.0, unit) ** (-1 if known else 1) * one for one in (value, std))
    if known:
        return (f"Per N m of the input the angular acceleration is {value:.5g} ± {std:.2g} rad/s².",)
    per = "rad/s²" if data.normalised else "N m"
    return (f"The gain of the input is {value:.5g} ± {std:.2g} {per} per unit.",)


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


def refuse_indefinite(fit: Fit) -> None:
    """Refuse a nominal fit that the runs do not determine.

    Raises:
        TunnelError: when a parameter or its standard deviation is not finite, or the inertia is not positive.
    """
    values = dict(zip(fit.problem.names, fit.point.common.tolist(), strict=True))
    numbers = np.concatenate(
        (fit.point.common, fit.point.release.ravel(), fit.covariance.ravel(), [fit.total])
    )
    if not np.isfinite(numbers).all():
        raise TunnelError(
            "the runs do not determine the nominal model",
            remedy="check that they are free decays of springs and wind speeds that differ",
        )
    if values.get("yaw_inertia", 1.0) <= 0.0:
        what, _, remedy = Status.INERTIA_NOT_POSITIVE.value.partition(": ")
        raise TunnelError(what, remedy=remedy)
