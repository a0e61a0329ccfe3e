"""The diagnosis of a campaign, in one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.answer.assemble import assemble, localise
from diagnosis.answer.candidates import cause_sizes
from diagnosis.answer.other_motions import limit_cycle_answer, refused_limit_cycles, second_modes
from diagnosis.answer.units import in_own_units
from diagnosis.diagnosable import (
    NOT_SOUGHT,
    SLIDE,
    comparable_runs,
    diagnosable,
    gain_words,
    kinds_for,
    reach,
    refuse_hopeless,
    refuse_undiagnosable,
    refuse_without_resonance,
    with_law,
)
from diagnosis.noise.gap import noise_remarks
from diagnosis.patched import UNPATCHED
from diagnosis.remainder.explain import closable
from diagnosis.result import Diagnosis
from diagnosis.search.investigate import Progress, investigate
from diagnosis.search.weigh import UNKNOWN
from tunnel_sim.effects import Effect, effect_class, known_effects
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.files.campaign_folder import as_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from diagnosis.patched import PatchedModel
    from diagnosis.search.investigate import Study
    from tunnel_sim.engine.joint_model import JointModel


def diagnose(
    campaign: Campaign | Path | str,
    *,
    kinds: Sequence[type[Effect]] | None = None,
    progress: Progress | None = None,
    model: JointModel | None = None,
) -> Diagnosis:
    """Find where the nominal model departs from the runs, which effect causes it, and how far the gap closes.

    Args:
        campaign: the runs; or their folder, or one file of a data logger.
        kinds: the effects to answer with, registered or not; None: all known ones.
        progress: called with the name of each step.
        model: a model of one's own, from `read_model`, which is then the nominal model.

    Returns:
        The answer, for the runs that one model can be fitted to; its cautions name the others.

    Raises:
        TunnelError: when the examination refuses the records, a run shows no decaying motion, or the nominal model
            cannot be fitted to them.
    """
    campaign = as_campaign(campaign)
    refuse_undiagnosable(campaign, own_model=model is not None)
    kinds = known_effects() if kinds is None else kinds
    campaign = campaign if model is None else with_law(campaign, model.law)
    with answering_with(kinds):
        return _diagnose(campaign, kinds, progress, model)


def read_model(
    path: Path | str,
    joint: str,
    campaign: Campaign,
    free: Sequence[str] | None = None,
    asset_dir: Path | str | None = None,
) -> JointModel:
    """Read a model of one's own for the diagnosis of a campaign.

    Args:
        path: MJCF, or URDF that MuJoCo loads.
        joint: name of the joint recorded, the only one that moves.
        campaign: whose records say how far the joint moves.
        free: what is fitted, of ``inertia``, ``damping``, ``stiffness`` and ``rest``; None: what matters.
        asset_dir: a further folder in which its includes and meshes may be, beside the model's own.

    Returns:
        The model with the law of its joint.

    Raises:
        TunnelError: when the model cannot be the nominal model of the campaign.
    """
    from tunnel_sim.engine.joint_model import read_joint_model  # only here: MuJoCo is slow to load

    assets = None if asset_dir is None else Path(asset_dir)
    return read_joint_model(Path(path), joint, reach(campaign), free, assets)


def _diagnose(
    campaign: Campaign, kinds: Sequence[type[Effect]], progress: Progress | None, model: JointModel | None
) -> Diagnosis:
    found = diagnosable(campaign)
    if not found.limit_cycles:
        refuse_hopeless(found.campaign)
        refuse_without_resonance(found.campaign)
    campaign, left_out = comparable_runs(found.campaign)
    if campaign.sensor.derivative:
        # Their sizes are those of angles, and their ranges too; a mode moves the body.
        kinds = [kind for kind in kinds if kind.channel != "sensor" or kind.line == "ringing"]
        said = f"A second mode is the only effect of the sensor that is tried on {campaign.sensor.quantity}s."
        left_out = (*left_out, said)
    kinds, said_of_drive = kinds_for(campaign, kinds)
    left_out = (*left_out, *said_of_drive)
    if campaign.law is not None and campaign.law.slide:
        left_out = (*left_out, SLIDE)
    try:
        known = () if found.limit_cycles else kinds
        study = investigate(campaign, known, progress)
    except TunnelError as error:
        if not found.limit_cycles:
            raise
        raise refused_limit_cycles(found.remarks) from error
    if progress is not None:
        progress("how far it closes")
    where, maps = localise(study)
    remarks = (*found.remarks, *noise_remarks(study.noise, study.trend))
    patched, unpatched = (None, ()) if model is None else _patched(study, model)
    left_out = (*left_out, *gain_words(campaign, study.chosen))
    assembled = assemble(study, where, maps, (*left_out, *unpatched), patched, known)
    sized = replace(assembled, remarks=remarks, sizes=cause_sizes(study) if study.named else ())
    sized = replace(sized, data=found.campaign)
    answer = in_own_units(sized, study.similarity)
    if found.limit_cycles:
        return limit_cycle_answer(answer, found.remarks)
    if said_of_drive:  # its laws are sought along free decays
        answer = replace(answer, cautions=(*answer.cautions, NOT_SOUGHT))
    else:
        if progress is not None:
            progress("what no effect explains")
        answer = _with_closable(answer, study)
    # below one half a set of effects comes first, though each of them may be less probable than none
    odds = {candidate.effect: candidate.probability for candidate in answer.candidates}
    likeliest = max(odds, key=odds.__getitem__, default="")
    modes = second_modes(campaign) if likeliest in UNKNOWN else ()
    return replace(answer, verdict=" ".join((*modes, answer.verdict)))


def _with_closable(answer: Diagnosis, study: Study) -> Diagnosis:
    """The answer with what could be closed of what remains, or a caution that it was not found.

    Of an undecided diagnosis the whole gap remains.
    """
    decided = answer.decision.decided
    significant = not decided or (answer.rest is not None and answer.rest.significant)
    try:
        with np.errstate(over="raise"):  # a fitted model that runs away
            return replace(answer, closable=closable(study, significant=significant, decided=decided))
    except (np.linalg.LinAlgError, FloatingPointError):  # the answer stands without it
        said = "How much of what remains could be closed was not found: its equations cannot be solved."
        return replace(answer, cautions=(*answer.cautions, said))


def _patched(study: Study, model: JointModel) -> tuple[PatchedModel | None, tuple[str, ...]]:
    """The patched model, or none and a sentence that says why."""
    from diagnosis.patch.patched_model import patched_model  # only here: MuJoCo is slow to load

    try:
        return patched_model(study, model), ()
    except TunnelError as error:
        return None, (f"{UNPATCHED}: {error.what}.",)


def vocabulary(include: Sequence[str] = (), exclude: Sequence[str] = ()) -> tuple[type[Effect], ...]:
    """The effects to answer with.

    Args:
        include: names to restrict to; empty: all.
        exclude: names to withhold.

    Returns:
        Effect classes in the order of the vocabulary.

    Raises:
        TunnelError: when a name is unknown, or nothing is left.
    """
    wanted = {effect_class(name) for name in include} if include else set(known_effects())
    kinds = tuple(
        kind for kind in known_effects() if kind in wanted - {effect_class(name) for name in exclude}
    )
    if not kinds:
        raise TunnelError("no effect is left to answer with", remedy="exclude fewer effects")
    return kinds
