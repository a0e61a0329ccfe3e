"""The diagnosis of a campaign, in one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from diagnosis.answer.assemble import assemble
from diagnosis.answer.limit_cycles import limit_cycle_answer, refused_limit_cycles
from diagnosis.answer.other_modes import second_modes
from diagnosis.answer.own_units import in_own_units
from diagnosis.detection.comparable import comparable_runs
from diagnosis.detection.limit_cycles import diagnosable
from diagnosis.detection.noise_remarks import noise_remarks
from diagnosis.detection.refusal import refuse_hopeless
from diagnosis.investigate import Progress, investigate
from diagnosis.law.explain import closable
from diagnosis.localisation.localise import localise
from diagnosis.result import Diagnosis
from tunnel_sim.effects import Effect, effect_class, known_effects
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError


def diagnose(
    campaign: Campaign, *, kinds: Sequence[type[Effect]] | None = None, progress: Progress | None = None
) -> Diagnosis:
    """Find where the nominal model departs from the runs, which effect causes it, and how far the gap closes.

    Args:
        campaign: measured or simulated runs.
        kinds: the effects to answer with, registered or not; None: all known ones.
        progress: called with the name of each step.

    Returns:
        The answer, for the runs that one model can be fitted to; its cautions name the others.

    Raises:
        TunnelError: when the examination refuses the records, a run shows no decaying motion, or the nominal model
            cannot be fitted to them.
    """
    kinds = known_effects() if kinds is None else kinds
    with answering_with(kinds):
        return _diagnose(campaign, kinds, progress)


def _diagnose(campaign: Campaign, kinds: Sequence[type[Effect]], progress: Progress | None) -> Diagnosis:
    found = diagnosable(campaign)
    if not found.limit_cycles:
        refuse_hopeless(found.campaign)
    campaign, left_out = comparable_runs(found.campaign)
    if campaign.sensor.derivative:
        # Their sizes are those of angles, and their ranges too.
        kinds = [kind for kind in kinds if kind.channel != "sensor"]
        left_out = (*left_out, f"Effects of the sensor are not tried on {campaign.sensor.quantity}s.")
    try:
        study = investigate(campaign, () if found.limit_cycles else kinds, progress)
    except TunnelError as error:
        if not found.limit_cycles:
            raise
        raise refused_limit_cycles(found.remarks) from error
    if progress is not None:
        progress("where, and how far it closes")
    where, maps = localise(study)
    remarks = (*found.remarks, *noise_remarks(study.noise, study.trend))
    answer = in_own_units(replace(assemble(study, where, maps, left_out), remarks=remarks), study.similarity)
    if found.limit_cycles:
        return limit_cycle_answer(answer, found.remarks)
    if progress is not None:
        progress("what no effect explains")
    significant = answer.rest is not None and answer.rest.significant
    answer = replace(answer, closable=closable(study, significant=significant))
    if answer.causes == ("unknown",):
        return replace(answer, cautions=(*answer.cautions, *second_modes(campaign)))
    return answer


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
