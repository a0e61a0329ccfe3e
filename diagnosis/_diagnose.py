"""The diagnosis of a campaign, in one call."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.answer.assemble import assemble, localise
from diagnosis.answer.candidates import cause_sizes
from diagnosis.answer.closing import Closing, confirmed
from diagnosis.answer.judgements import zeros_apart
from diagnosis.answer.other_motions import limit_cycle_answer, refused_limit_cycles, second_modes
from diagnosis.answer.units import in_own_units
from diagnosis.diagnosable import Chosen, choose, gain_words, refuse_undiagnosable, without_short
from diagnosis.facts.disturbance import Disturbance
from diagnosis.facts.found import Fact, as_stated
from diagnosis.facts.patch import PatchedModel
from diagnosis.facts.repeatability import AnswerWithout, RunRepeatability
from diagnosis.model.choose import nominal_model
from diagnosis.model.joint import recorded, with_law
from diagnosis.model.nominal import NominalModel
from diagnosis.noise.gap import noise_noted
from diagnosis.noise.mains import hum_noted
from diagnosis.remainder.ways import way_for
from diagnosis.result import Coefficients, Diagnosis
from diagnosis.search.clock import Progress
from diagnosis.search.disturbed import together
from diagnosis.search.investigate import investigate
from diagnosis.search.odd_run import replaceable
from diagnosis.search.rivals import RIVALS
from diagnosis.search.rivals.rival import Rival
from diagnosis.search.study import Study
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import Settings
from identification import identify
from identification.estimate import Estimate
from identification.status import left_out_as_asked
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
        campaign: the runs; or their folder, or one file of a data logger.
        leave_out: ids of runs to leave out; a remark and ``provenance`` name them.
        kinds: the effects to answer with, registered or not; None: all known ones.
        progress: called with the name of each step.
        model: your own model, from `read_model`, whose joint is then the nominal model; or a nominal model of your
            own kind.
        settings: every number that decides.
        rivals: causes from outside the vocabulary, weighed with it; their probability is added to that of
            ``unknown``.

    Returns:
        The answer, for the runs that one model can be fitted to; its cautions name the others.

    Raises:
        TunnelError: when the examination refuses the records, a run shows no decaying motion, the nominal model
            cannot be fitted to them, or no run has an id in ``leave_out``.
    """
    campaign = as_campaign(campaign).without(leave_out)
    joint, own = (None, model) if isinstance(model, NominalModel) else (model, None)
    if joint is not None:
        campaign, own = with_law(campaign, joint.law)
    campaign, short = without_short(campaign)
    refuse_undiagnosable(campaign, own)
    kinds = known_effects() if kinds is None else kinds
    say = progress or (lambda _: None)
    with answering_with(kinds):
        judged = not isinstance(model, NominalModel)
        chosen = choose(campaign, kinds, settings.selection, own, judged=judged)
        study = _studied(chosen, progress, settings, rivals)
        answer = _answered(study, chosen, joint, say)
        runs = answer.repeatability
        if runs is not None and runs.outlier:
            say(f"without run {runs.outlier}")
            others = _without_outlier(study, runs, chosen, settings, rivals)
            if others is not None and _explained_without(others, study):
                answer = _answered(others, chosen, joint, say)
            elif others is not None:
                known = 1.0 if others.answer is None else others.answer.probability
                without = AnswerWithout(others.causes, known)
                answer = replace(answer, repeatability=replace(runs, without_outlier=without))
        answer = replace(_withheld(answer), remarks=(*short, *answer.remarks))
        return _without(answer, leave_out).in_words()


def _answered(study: Study, chosen: Chosen, joint: JointModel | None, say: Progress) -> Diagnosis:
    """The answer of a study."""
    say("explained share")  # the place, and the answer without the remainder
    study, closes = confirmed(study)
    patched, unpatched = (None, ()) if joint is None else _patched(study, joint)
    answer = _assembled(study, chosen, closes, patched, unpatched)
    if chosen.limit_cycles:
        return limit_cycle_answer(answer, chosen.remarks, study.settings.answer)
    return _with_remainder(answer, study, chosen, say)


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


def _explained_without(others: Study, study: Study) -> bool:
    """Whether the gap vanishes without the runs that one study leaves out and another does not.

    A run that alone has its wind state or its spring may differ for that reason.
    """
    data = study.nominal.problem.data
    able = {data.runs[index].id for index in replaceable(data)}
    kept = {run.id for run in others.campaign.runs}
    return not others.gap.test.detected and all(run.id in able | kept for run in data.runs)


def _withheld(answer: Diagnosis) -> Diagnosis:
    """The answer without coefficients where the examination says that a unit makes them wrong by decades."""
    if not any(remark.withholds for remark in answer.remarks):
        return answer
    return replace(answer, coefficients=Coefficients({}, {}), hidden=(), trade_off=None)


def _without(answer: Diagnosis, left_out: Collection[str]) -> Diagnosis:
    """The answer with the runs that were left out on request."""
    provenance = {**answer.provenance, "left_out": list(left_out)}
    return replace(answer, remarks=(*left_out_as_asked(left_out), *answer.remarks), provenance=provenance)


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


def _patched(study: Study, model: JointModel) -> tuple[PatchedModel | None, tuple[Fact, ...]]:
    """The model with the causes written into it; None with a caveat where that fails."""
    from diagnosis.patch.patched_model import patched_model  # only here: MuJoCo is slow to load

    try:
        return patched_model(study, model), ()
    except TunnelError as error:
        return None, (Fact("unpatched", {"reason": error.what}),)


def _assembled(
    study: Study, chosen: Chosen, closes: Closing, patched: PatchedModel | None, unpatched: tuple[Fact, ...]
) -> Diagnosis:
    """The answer in the units of the campaign, without the remainder and without words."""
    in_view = (Fact(study.caution),) if study.caution else ()
    gain = map(as_stated, gain_words(chosen.campaign, study.chosen))
    lead = map(as_stated, study.model.lead_words(study.similarity))
    beyond = () if study.left_by_all is None else (Fact("beyond reach", {"left": study.left_by_all}),)
    left_out = (*chosen.left_out, *in_view, *gain, *unpatched, *lead, *beyond)
    identified = _identified(study, chosen)
    answer = assemble(
        study, *localise(study, closes.gap.closed), left_out, patched, chosen.kinds, closes, identified
    )
    noted = (
        *noise_noted(study.prepared.noise, study.prepared.trend, study.gap.test, named=study.named),
        *hum_noted(study.campaign, study.prepared.hum, study.similarity),
    )
    sized = replace(
        answer,
        remarks=chosen.remarks,
        sizes=cause_sizes(study) if study.named else (),
        found=replace(answer.found, noted=noted),
        data=chosen.examined,
    )
    return in_own_units(sized, study.similarity)


def _identified(study: Study, chosen: Chosen) -> Estimate | None:
    """The estimate by `identify`; None where a cause acts, or it would be of another model or other runs."""
    scatter_alone = study.causes != UNKNOWN and all(effect_class(name).scatters for name in study.causes)
    own_model = study.model.of_robot or type(study.model) is not type(nominal_model(chosen.campaign, None))
    if not scatter_alone or study.disturbed or chosen.limit_cycles or own_model:
        return None
    try:
        return identify(chosen.campaign, throw=False)
    except TunnelError:  # the examination refuses what the diagnosis may still compare
        return None


def _with_remainder(answer: Diagnosis, study: Study, chosen: Chosen, say: Progress) -> Diagnosis:
    """The answer with the explainable part of the remainder, and other possible explanations."""
    decided, way = answer.decision.decided, way_for(study)
    caution = (Fact(way.caution),) if way.caution else ()
    say("remainder")
    # in an undecided diagnosis the whole gap remains
    significant = not decided or (answer.rest is not None and answer.rest.significant)
    try:
        with np.errstate(over="raise"):  # a fitted model that runs away
            left = way.closable(study, significant=significant, decided=decided)
        answer = replace(answer, closable=left)
    except (np.linalg.LinAlgError, FloatingPointError):  # the answer is given without it
        caution = (Fact("remainder not solved"),)
    # below one half a set of effects comes first, though each may be less probable than none
    odds = {candidate.effect: candidate.probability for candidate in answer.candidates}
    unknown = max(odds, key=odds.__getitem__, default="") in UNKNOWN
    if unknown or not decided:
        caution = (*caution, *zeros_apart(study))
    found = replace(
        answer.found,
        second_modes=second_modes(chosen.campaign, study.settings.words)
        if unknown and _tried_mode(study)
        else (),
        rivals=_rivals(study) if unknown or not decided else (),
        cautions=(*answer.found.cautions, *caution),
    )
    return replace(answer, found=found)


def _tried_mode(study: Study) -> bool:
    """Whether a set with a second mode was weighed: only then its share of the gap is known."""
    modes = {kind.name for kind in known_effects() if kind.line == "ringing"}
    return any(modes.intersection(answer.effects) for answer in study.answers)


def _rivals(study: Study) -> tuple[Fact, ...]:
    """The facts about rivals from outside the vocabulary that would explain the gap."""
    said = (one.fact(study.nominal, study.similarity) for one in study.rivals)
    return tuple(fact for fact in said if fact is not None)


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
        joint: name of the joint recorded, the only one that moves.
        campaign: whose records give the range of the joint.
        free: parameters to fit, of ``inertia``, ``damping``, ``stiffness`` and ``rest``; None: those that matter.
            For a joint without a spring, ``rest`` is a constant moment.
        asset_dir: a further folder for its includes and meshes, beside the model's own.
        actuator: name of the actuator whose control is the column ``drive``; None: the joint has only one.

    Returns:
        The model with the law of its joint.

    Raises:
        TunnelError: when the model cannot be the nominal model of the campaign.
    """
    from tunnel_sim.engine.joint_model import read_joint_model  # only here: MuJoCo is slow to load

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
