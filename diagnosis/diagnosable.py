"""The runs of a campaign that can be diagnosed together, and their effects; other runs are refused."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Final

import numpy as np

from diagnosis.likelihood.least_squares import Fit
from diagnosis.model.choose import nominal_model
from diagnosis.model.fact import Fact, as_stated
from diagnosis.model.nominal import NominalModel
from diagnosis.model.similarity import free_frequency, response_to_input
from diagnosis.model.untried_effects import untried_by_inputs
from diagnosis.noise.sensor_noise import LEAST_SAMPLES
from identification.estimate import Status
from identification.examination.examine import examine, with_clocks
from identification.examination.self_excited import in_limit_cycle
from identification.show.numbers import unit_mark, with_std
from identification.signal.known_gain import refuse_other_gains
from identification.signal.run_fit import NO_WINDOWS, identify_run
from identification.status import Outcome, Remark
from tunnel_sim.effects import Effect
from tunnel_sim.effects.capabilities import SecondOscillation
from tunnel_sim.effects.drives import ActuatorEffect
from tunnel_sim.vocabulary.campaign import Campaign, Run, speed_groups
from tunnel_sim.vocabulary.errors import TunnelError, counted

OTHER_MODE: Final = 1.5
"""Minimum ratio of the frequencies with and without wind at which a run counts as another mode. Judgement."""
SAME_SPRING: Final = 1.1
"""Maximum ratio of the frequencies of one spring's runs at one wind speed. Judgement. The stiffnesses then
differ by a fifth. Effects of the amplitude change a frequency gradually, and seldom by as much."""

_LEFT_OUT = "left out of the diagnosis, which compares free decays"


@dataclass(frozen=True)
class Diagnosable:
    """The runs to diagnose.

    Args:
        limit_cycles: whether all runs are in limit cycles, so that no decay remains.
    """

    campaign: Campaign
    remarks: tuple[Remark, ...]
    limit_cycles: bool = False


def diagnosable(campaign: Campaign, *, judged: bool = True) -> Diagnosable:
    """Examine a campaign, and separate its free decays from runs in a limit cycle.

    If all runs are in limit cycles, their whole records are kept.

    Args:
        judged: whether stated values are judged by the rig's own model; a model of your own may have other
            values.

    Raises:
        TunnelError: when the examination refuses the records.
    """
    sensor = campaign.sensor if judged else replace(campaign.sensor, plausible=False)
    examined = examine(replace(campaign, sensor=sensor)).accepted()
    sensor = replace(examined.campaign.sensor, plausible=campaign.sensor.plausible)
    examined = replace(examined, campaign=replace(examined.campaign, sensor=sensor))
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
    """The selection to be diagnosed.

    Args:
        examined: all runs with the right kind of motion.
        campaign: the runs that one model can be fitted to.
        model: the model fitted to these runs.
        kinds: the effects to answer with; none where all runs are in limit cycles.
        left_out: runs and effects that were left out, with reasons.
    """

    examined: Campaign
    campaign: Campaign
    model: NominalModel
    kinds: tuple[type[Effect], ...]
    remarks: tuple[Remark, ...]
    left_out: tuple[Fact, ...]
    limit_cycles: bool


def choose(
    campaign: Campaign,
    kinds: Sequence[type[Effect]],
    given: NominalModel | None = None,
    *,
    judged: bool = True,
) -> Chosen:
    """Choose the runs that are diagnosed together, their nominal model, and the effects to answer with.

    Args:
        given: your own nominal model; None: the model of the campaign's kind.
        judged: as in `diagnosable`.

    Raises:
        TunnelError: when the examination refuses the records, or a run shows no motion that can be diagnosed.
    """
    usable = diagnosable(campaign, judged=judged)
    if not usable.limit_cycles:
        refuse_motionless(usable.campaign, nominal_model(usable.campaign, given))
    compared, left_out = comparable_runs(usable.campaign)
    model = nominal_model(compared, given)
    if compared.sensor.derivative:
        # the sizes and ranges of these effects are angles; a mode moves the body
        kinds = [kind for kind in kinds if kind.channel != "sensor" or issubclass(kind, SecondOscillation)]
        tried = "no sensor effect tried" if compared.driven else "only a second mode tried"
        left_out = (*left_out, Fact(tried, {"quantity": compared.sensor.quantity}))
    kinds, said_of_drive = kinds_for(compared, kinds, model)
    left_out = (*left_out, *map(as_stated, (*said_of_drive, *model.notes())))
    known = () if usable.limit_cycles else kinds
    return Chosen(usable.campaign, compared, model, known, usable.remarks, left_out, usable.limit_cycles)


def comparable_runs(campaign: Campaign) -> tuple[Campaign, tuple[Fact, ...]]:
    """Leave out the runs that cannot be fitted together with the others, with reasons.

    If some runs state ``spring_stiffness`` and others do not, the larger group remains (if equal, the runs that
    state it). Of the runs that do not state it, those with the same frequency at the same wind speed remain:
    they can have one spring. A wind-on run that swings in another mode than the wind-off runs of its spring is
    left out.
    """
    stated = [run for run in campaign.runs if run.spring_stiffness is not None]
    bare = [run for run in campaign.runs if run.spring_stiffness is None]
    left_out = []
    compared, derivative = stated if len(stated) >= len(bare) else bare, campaign.sensor.derivative
    if stated and bare:
        other, why = (bare, "stiffness not stated") if compared is stated else (stated, "stiffness stated")
        left_out.append(Fact(why, {"runs": [run.id for run in other]}))
    if compared is bare:
        same = _of_one_spring(bare, derivative)
        if len(same) < len(bare):
            left_out.append(Fact("other springs", {"runs": [run.id for run in bare if run not in same]}))
        compared = same
    still: dict[float | None, list[float]] = defaultdict(list)
    for run in compared:
        if not run.wind_on:
            still[run.spring_stiffness].append(free_frequency(run, derivative))
    elsewhere = [
        run
        for run in compared
        if run.wind_on
        and run.spring_stiffness in still
        and free_frequency(run, derivative) > OTHER_MODE * median(still[run.spring_stiffness])
    ]
    if elsewhere:
        figures = {"ratio": OTHER_MODE, "runs": [run.id for run in elsewhere]}
        left_out.append(Fact("another mode", figures))
        compared = [run for run in compared if run not in elsewhere]
    order = {run.id for run in compared}
    return replace(campaign, runs=tuple(run for run in campaign.runs if run.id in order)), tuple(left_out)


def _ids(runs: Sequence[Run]) -> str:
    return ", ".join(run.id for run in runs)


def _of_one_spring(runs: Sequence[Run], derivative: int) -> list[Run]:
    """The largest group of runs that may have one spring.

    The air reduces the stiffness of every spring by the same amount, so the order of the frequencies is the same
    at each speed. Frequencies at one speed within `SAME_SPRING` belong to one spring.
    """
    by_speed: dict[float, list[tuple[float, Run]]] = defaultdict(list)
    setting = speed_groups(run.wind_speed for run in runs)
    for run in runs:
        by_speed[setting[run.wind_speed]].append((free_frequency(run, derivative), run))
    # by wind speed, groups of runs with similar frequency, lowest first
    groups: list[list[list[Run]]] = []
    for alike in by_speed.values():
        ranked = sorted(alike, key=lambda pair: pair[0])
        clusters = [[ranked[0][1]]]
        for (last, _), (now, run) in itertools.pairwise(ranked):
            if now > SAME_SPRING * last:
                clusters.append([])
            clusters[-1].append(run)
        groups.append(clusters)
    counts = {len(clusters) for clusters in groups}
    if counts == {1}:
        return list(runs)
    if len(counts) == 1:
        return max(([run for group in rank for run in group] for rank in zip(*groups, strict=True)), key=len)
    return max((group for clusters in groups for group in clusters), key=len)


def without_short(campaign: Campaign) -> tuple[Campaign, tuple[Remark, ...]]:
    """Leave out the runs that are too short to be diagnosed, with a remark, if other runs remain.

    A driven run needs `LEAST_SAMPLES` samples to separate noise from response. A free decay with fewer samples is
    left out where it shows no motion that can be diagnosed.
    """
    short = [
        run
        for run in campaign.runs
        if run.record.yaw_rad.size < LEAST_SAMPLES
        and (run.drive is not None or _motion(run, campaign) in _NOT_DIAGNOSABLE)
    ]
    if not short or len(short) == len(campaign.runs):
        return campaign, ()
    ids = tuple(run.id for run in short)
    most = counted(max(run.record.yaw_rad.size for run in short), "sample")
    what = f"too short for the diagnosis ({'' if len(short) == 1 else 'at most '}{most}), so left out"
    remedy = f"record {LEAST_SAMPLES} samples or more"
    return campaign.without(ids), (Remark(Outcome.LEFT_OUT, ids, what, remedy),)


_NOT_DIAGNOSABLE = (Status.NO_OSCILLATION, Status.NOT_DETERMINED)


def _motion(run: Run, campaign: Campaign) -> Status:
    """The result of the fit of one free decay to a run."""
    return identify_run(run, campaign.sensor, cycles_per_window=NO_WINDOWS).estimate.status


def refuse_undiagnosable(campaign: Campaign, given: NominalModel | None = None) -> None:
    """Refuse driven runs that the diagnosis cannot treat, and runs that the nominal model cannot describe.

    Args:
        given: your own nominal model; None: the model of the campaign's kind.

    Raises:
        TunnelError: for the first such run.
    """
    for run in campaign.checked_inputs().driven_runs:
        where = f"{campaign.name}, run '{run.id}'"
        if run.spring_stiffness == 0.0 and run.wind_on:
            what = "driven runs without a spring are not diagnosed with the wind on"
            raise TunnelError(what, where=where, remedy="leave the run out")
        if run.record.yaw_rad.size < LEAST_SAMPLES:
            size = counted(run.record.yaw_rad.size, "sample")
            raise TunnelError(
                f"the run is driven and has {size}: too few to separate noise from response",
                where=where,
                remedy=f"record {LEAST_SAMPLES} samples or more, or leave the run out",
            )
    refuse_other_gains(campaign)
    loose = [run for run in campaign.runs if run.unrestrained]
    if loose and not campaign.unrestrained:
        raise TunnelError(
            f"runs with a spring and without one ({_ids(loose)}) cannot be diagnosed together: the first show the "
            "sensor's zero, the others a constant moment instead",
            where=campaign.name,
            remedy="diagnose the two kinds of runs separately; tunnel identify takes them together",
        )
    nominal_model(campaign, given).refuse(campaign)


def refuse_motionless(campaign: Campaign, model: NominalModel) -> None:
    """Refuse a run that shows no motion to diagnose; the estimators leave out the same free decays.

    Raises:
        TunnelError: for the first run without a decaying motion, or the first driven run with a motion that
            does not follow from its input, as an oscillation if there is a spring.
    """
    for run in campaign.decays:
        status = _motion(run, campaign)
        if status in _NOT_DIAGNOSABLE:
            what, _, remedy = status.value.partition(": ")
            raise TunnelError(what, where=f"run {run.id}", remedy=f"{remedy}; or leave the run out")
    known = model.resonance_known
    for run, drive in zip(campaign.driven_runs, campaign.inputs, strict=True):
        found = response_to_input(run, campaign.sensor.derivative)
        if known and (found is None or not found[2] * (run.input_gain or drive.kind.scale) > 0.0):
            raise TunnelError(
                "the motion does not follow the moment of the input",
                where=f"run {run.id}",
                remedy="check its sign, and that it includes all moments on the body; or leave the run out",
            )
        if not known and (found is None or not found[1] > 0.0):
            raise TunnelError(
                "no resonance between input and motion",
                where=f"run {run.id}",
                remedy="drive it over a band that includes the natural frequency; or leave the run out",
            )


def kinds_for(
    campaign: Campaign, kinds: Sequence[type[Effect]], model: NominalModel
) -> tuple[tuple[type[Effect], ...], tuple[str, ...]]:
    """The effects to answer with that can be fitted to a campaign, and sentences that name the other effects.

    Effects of driven runs are omitted without a sentence if no run is driven, and effects of a moment if no run
    has a moment as its input.
    """
    if not campaign.driven:
        return tuple(kind for kind in kinds if not kind.driven), ()
    moments = any(drive.kind.by_actuator for drive in campaign.inputs)
    kept = tuple(kind for kind in kinds if moments or not issubclass(kind, ActuatorEffect))
    gone = untried_by_inputs(campaign, kept)
    kept = tuple(kind for kind in kept if not any(kind in some for some in gone.values()))
    for why, some in model.untried(campaign, kept).items():
        gone[why], kept = some, tuple(kind for kind in kept if kind not in some)
    said = [why.format(", ".join(kind.name for kind in some)) for why, some in gone.items() if some]
    return kept, tuple(said)


def gain_words(campaign: Campaign, fit: Fit) -> tuple[str, ...]:
    """The gain of the input by the model or the fit, in a sentence; none if the campaign states it."""
    data = fit.problem.data
    if said := data.model.gain_words():
        return (said,)
    if "drive_gain" not in fit.problem.names:
        return ()
    fitted = [drive for drive in campaign.inputs if data.model.fits_gain(drive)]
    known = any(drive.gain_stated for drive in fitted)
    unit = "kg m2" if known else "N m"
    value, std = fit.value("drive_gain"), fit.std("drive_gain")
    value, std = (data.similarity.own(1.0, unit) ** (-1 if known else 1) * one for one in (value, std))
    if known:
        return (f"Per N m of the input the angular acceleration is {with_std(value, std)} rad/s².",)
    per = unit_mark(data.model.moment_unit)
    return (f"The gain of the input is {with_std(value, std)} {per} per unit.",)


def refuse_indefinite(fit: Fit) -> None:
    """Refuse a nominal fit that the runs do not determine.

    Raises:
        TunnelError: when a parameter or its standard deviation is not finite, or the inertia is not positive.
    """
    values = dict(zip(fit.problem.names, fit.point.common.tolist(), strict=True))
    numbers = np.concatenate(
        (fit.point.common, fit.point.per_run.ravel(), fit.covariance.ravel(), [fit.total])
    )
    if not np.isfinite(numbers).all():
        raise TunnelError(
            "the runs do not determine the nominal model",
            remedy="use free decays with different springs and wind speeds",
        )
    if values.get("yaw_inertia", 1.0) <= 0.0:
        what, _, remedy = Status.INERTIA_NOT_POSITIVE.value.partition(": ")
        raise TunnelError(what, remedy=remedy)
