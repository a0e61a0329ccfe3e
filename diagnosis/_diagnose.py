"""The diagnosis of a campaign, in one call."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from diagnosis.compose import Question, composed
from diagnosis.confirmed import Confirmed
from diagnosis.diagnosable import Chosen, choose, refuse_undiagnosable, without_short
from diagnosis.findings.other_motions import refused_limit_cycles
from diagnosis.findings.repeatability import AnswerWithout, RunRepeatability
from diagnosis.model.joint import recorded, with_law
from diagnosis.model.nominal import NominalModel
from diagnosis.model.similar import similar_campaign
from diagnosis.result import Diagnosis
from diagnosis.search.clock import Progress
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.disturbed import together
from diagnosis.search.investigate import investigate
from diagnosis.search.odd_run import replaceable
from diagnosis.search.rivals import RIVALS
from diagnosis.search.rivals.rival import Rival
from diagnosis.search.study import Study
from diagnosis.settings import Settings
from tunnel_sim.effects import Effect, effect_class, known_effects
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.files.as_campaign import as_campaign
from tunnel_sim.processes import one_blas_thread
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.engine.joint_model import JointModel


@one_blas_thread()
def diagnose(
    campaign: Campaign | Path | str,
    *,
    leave_out: Collection[str] = (),
    kinds: Sequence[type[Effect]] | None = None,
    progress: Progress | None = None,
    model: JointModel | NominalModel | None = None,
    settings: Settings = Settings(),
    rivals: Sequence[Rival] = RIVALS,
) -> Diagnosis:
    """Find where the nominal model departs from the runs, which effect causes it, and the share that it explains.

    Args:
        campaign: the runs, their folder, or one file of a data logger.
        leave_out: ids of runs to leave out; a remark and ``provenance`` name them.
        kinds: the effects to answer with, registered or not; None: all known ones.
        progress: called with the name of each step.
        model: your own model, from `read_model`: its joint is then the nominal model; or a nominal model of
            your own kind.
        settings: the numbers that weigh answers, and the rates of the tests.
        rivals: causes from outside the vocabulary, weighed with the effects; their probability is added to
            ``unknown``.

    Returns:
        The answer for the runs that one model can be fitted to; its cautions name the other runs.

    Raises:
        TunnelError: when the examination refuses the records, a run shows no decaying motion, the nominal model
            cannot be fitted to them, or no run has an id in ``leave_out``.
    """
    campaign = as_campaign(campaign).without(leave_out)
    joint, own = (None, model) if isinstance(model, NominalModel) else (model, None)
    if joint is not None:
        campaign, own = with_law(campaign, joint.law)
    freedom, names = campaign.sensor.freedom, (campaign.name, *(run.id for run in campaign.runs))
    kinds = [kind for kind in (known_effects() if kinds is None else kinds) if kind.possible(freedom)]
    for kind in (kind for kind in kinds if kind.motion not in ("", freedom.motion)):
        what = f"is stated with motion = '{kind.motion}', and the campaign has motion = '{freedom.motion}'"
        raise TunnelError(
            what, where=f"effect {kind.name}", remedy="state it in the units of the campaign's motion"
        )
    with freedom.errors(), answering_with(kinds):
        found = _diagnosed(campaign, leave_out, kinds, progress, (joint, own), settings, rivals)
        return freedom.document(found, names).in_words()


def _diagnosed(
    campaign: Campaign,
    leave_out: Collection[str],
    kinds: Sequence[type[Effect]],
    progress: Progress | None,
    models: tuple[JointModel | None, NominalModel | None],
    settings: Settings,
    rivals: Sequence[Rival],
) -> Diagnosis:
    """The answer in the units of an angle, without its texts; other arguments as in `diagnose`.

    Args:
        models: the user's joint, which gives the campaign its law, and the nominal model; None: the model of
            its kind.
    """
    joint, own = models
    campaign, short = without_short(campaign)
    refuse_undiagnosable(campaign, own)
    say = progress or (lambda _: None)
    judged = joint is not None or own is None
    chosen = choose(campaign, kinds, own, judged=judged)
    if any(kind.motion for kind in chosen.kinds):  # their sizes are the campaign's
        change = similar_campaign(chosen.campaign, chosen.model)[1].similar
        chosen = replace(chosen, kinds=tuple(kind.similar(change) for kind in chosen.kinds))
    with answering_with(chosen.kinds):
        return _answered(chosen, Question(joint, short, tuple(leave_out), say), progress, settings, rivals)


def _answered(
    chosen: Chosen, asked: Question, progress: Progress | None, settings: Settings, rivals: Sequence[Rival]
) -> Diagnosis:
    """The answer from the runs and effects that are chosen."""
    say = asked.say
    study = _studied(chosen, progress, settings, rivals)
    say("explained share")
    found, without = Confirmed.of(study), None
    if found.repeats is not None and found.repeats.outlier:
        say(f"without run {found.repeats.outlier}")
        others = _without_outlier(study, found.repeats, chosen, settings, rivals)
        if others is not None and _only_odd(others, study):
            found = Confirmed.of(others)
        elif others is not None:
            without = AnswerWithout(
                others.causes, 1.0 if others.answer is None else others.answer.probability
            )
    return composed(found, chosen, asked, without)


def _without_outlier(
    study: Study, runs: RunRepeatability, chosen: Chosen, settings: Settings, rivals: Sequence[Rival]
) -> Study | None:
    """The study without the run that deviates far beyond the others; None where these cannot be diagnosed."""
    p_value = next(one.p_value for one in runs.runs if one.id == runs.outlier)
    odd = Disturbance(runs.outlier, None, None, p_value)
    try:
        campaign = chosen.campaign.without([runs.outlier])
        found = _studied(replace(chosen, campaign=campaign), None, settings, rivals)
    except TunnelError:
        return None
    return replace(found, disturbed=together(study.disturbed, found.disturbed, [odd]))


def _only_odd(others: Study, study: Study) -> bool:
    """Whether the gap, or all scatter, vanishes without the runs that only one of two studies leaves out.

    Scatter by chance shows in more than one run. A run that alone has its wind state or its spring may differ for
    that reason.
    """
    data = study.nominal.problem.data
    able = {data.runs[index].id for index in replaceable(data)}
    kept = {run.id for run in others.campaign.runs}
    repeats = study.scattering and not others.scattering and others.fitted == study.fitted
    vanishes = not others.gap.test.detected or bool(repeats)
    return vanishes and all(run.id in able | kept for run in data.runs)


def _studied(chosen: Chosen, progress: Progress | None, settings: Settings, rivals: Sequence[Rival]) -> Study:
    """Noise, nominal fit, place, search.

    Raises:
        TunnelError: when the nominal model cannot be fitted.
    """
    try:
        return investigate(chosen.campaign, chosen.kinds, progress, chosen.model, settings, rivals=rivals)
    except TunnelError as error:
        if not chosen.limit_cycles:
            raise
        raise refused_limit_cycles(chosen.remarks) from error


def read_model(
    path: Path | str,
    joint: str,
    campaign: Campaign,
    free: Sequence[str] | None = None,
    asset_dir: Path | str | None = None,
    actuator: str | None = None,
) -> JointModel:
    """Read your own model for the diagnosis of a campaign.

    Args:
        path: MJCF, or URDF that MuJoCo loads.
        joint: name of the recorded joint, the only one that moves.
        campaign: its records give the range of the joint.
        free: parameters to fit, of ``inertia``, ``damping``, ``stiffness`` and ``rest``; None: all that matter.
            For a joint without a spring, ``rest`` is a constant moment.
        asset_dir: a further folder for the model's includes and meshes, beside the model's own.
        actuator: name of the actuator with the column ``drive`` as its control; None: the joint has only one.

    Returns:
        The model with the law of its joint.

    Raises:
        TunnelError: when the model cannot be the nominal model of the campaign.
    """
    from tunnel_sim.engine.joint_model import read_joint_model  # imported here because MuJoCo is slow to load

    assets = None if asset_dir is None else Path(asset_dir)
    return read_joint_model(Path(path), joint, recorded(campaign, actuator), free, assets)


def vocabulary(include: Sequence[str] = (), exclude: Sequence[str] = ()) -> tuple[type[Effect], ...]:
    """The effects to answer with.

    Args:
        include: names to restrict to; empty: all.
        exclude: names to withhold.

    Returns:
        Effect classes in the order of the vocabulary.

    Raises:
        TunnelError: when a name is unknown, or no effect remains.
    """
    wanted = {effect_class(name) for name in include} if include else set(known_effects())
    kinds = tuple(
        kind for kind in known_effects() if kind in wanted - {effect_class(name) for name in exclude}
    )
    if not kinds:
        raise TunnelError("no effect is left in the vocabulary", remedy="exclude fewer effects")
    return kinds
