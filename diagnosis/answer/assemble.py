"""From a study to the answer: the place, the gap on held-out runs, coefficients, rivals and facts."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version

import numpy as np

from diagnosis.answer.candidates import candidates, inclusion
from diagnosis.answer.closing import Closing, closing
from diagnosis.answer.coefficients import (
    Answers,
    as_identified,
    before_the_causes,
    coefficients,
    correlation,
    in_phase,
    possible_answers,
)
from diagnosis.answer.friction_curve import friction_curve
from diagnosis.answer.held_out import excess_base
from diagnosis.answer.judgements import beside_the_numbers, cautions, outside_the_fits, remainder
from diagnosis.answer.linear_theory import coefficient_move, coefficients_of
from diagnosis.answer.next_run import separating_run
from diagnosis.answer.parameter_errors import parameter_errors
from diagnosis.answer.passive import within_bounds
from diagnosis.answer.repeatability import repeatability
from diagnosis.answer.trade_off import least_separated
from diagnosis.answer.units import own_estimate, own_hidden, sized_coefficients
from diagnosis.facts.closure import NoiseSummary, Waterfall
from diagnosis.facts.decision import Predictions, decision
from diagnosis.facts.found import Fact, Found, Nowhere, PlaceFound
from diagnosis.facts.patch import PatchedModel
from diagnosis.facts.remainder import Remainder
from diagnosis.likelihood.compression import in_shorter_blocks
from diagnosis.result import Coefficients, Diagnosis, GapSummary, Where
from diagnosis.search.study import Answer, Study
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import AnswerSettings
from diagnosis.where.described import described, nowhere
from diagnosis.where.maps import Maps
from diagnosis.where.place import blow_interval
from diagnosis.where.survey import with_answer
from identification.estimate import Estimate
from tunnel_sim.effects import Effect, effect_class


def localise(study: Study, explained: float = 0.0) -> tuple[Where, Maps, PlaceFound | Nowhere]:
    """Locate the departure of the nominal model from the runs, with the reason.

    The place follows from the residuals alone. The causes only have to agree with it.

    Args:
        explained: share of the gap that they explain on held-out readings.
    """
    place, chosen = study.gap.place or study.prepared.place(), study.settings.where
    survey = place.survey
    answer = None if study.chosen is study.nominal else study.chosen
    maps = survey.maps
    if answer is not None:
        both = in_shorter_blocks(study.nominal), in_shorter_blocks(answer)
        friction = friction_curve(answer, study.similarity) if study.causes else None
        maps = replace(with_answer(survey, study.campaign, *both), friction=friction)
    if not study.causes:
        return Where(None, None), maps, nowhere(survey, within_step=study.gap.test.within_step)
    compared = (*study.fitted, *study.read_off) if study.named else ()  # the whole set is judged
    where = Where(
        channel=place.channel.value,
        condition=place.condition.value,
        runs=place.runs,
        time_s=blow_interval(survey, chosen.interval_share, chosen)
        or survey.maps.time.interval(chosen.interval_share),
        amplitude_rad=survey.maps.amplitude.interval(chosen.interval_share),
        frequency_hz=survey.frequency_interval,
    )
    kinds, scattering = [effect_class(name) for name in compared], bool(study.scattering)
    said = described(where, place, kinds, study.settings, scattering=scattering, explained=explained)
    return where, maps, said


_PACKAGES = ("virtual-wind-tunnel", "mujoco", "numpy", "scipy")


def assemble(
    study: Study,
    where: Where,
    maps: Maps,
    said: PlaceFound | Nowhere,
    left_out: Sequence[Fact] = (),
    patched: PatchedModel | None = None,
    kinds: Sequence[type[Effect]] = (),
    closes: Closing | None = None,
    identified: Estimate | None = None,
) -> Diagnosis:
    """Compose the answer.

    Args:
        said: the reasons for the place of the gap.
        left_out: caveats on runs and effects that were left out.
        patched: the given model with the causes written into it.
        kinds: the effects that may act unnamed beside those of an answer.
        closes: the explained share of the gap; None: it is computed.
        identified: the estimate of the same runs, where no cause but scatter acts.
    """
    chosen, settings, similarity = study.chosen, study.settings, study.similarity
    closes = closes or closing(study)
    weighed = candidates(study, excess_base(study), parameter_errors(study, closes))
    begun = time.perf_counter()
    rig = study.campaign.rig
    answers = possible_answers(study, kinds)
    after = within_bounds(coefficients(answers, study.campaign), study)
    if identified is not None:
        after = as_identified(after, identified, study.campaign, similarity)
    phase, covariance = in_phase(study.stated)
    before = before_the_causes(study.nominal, {**after, **phase}) if study.causes else after
    found = Coefficients(
        sized_coefficients(before, rig),
        sized_coefficients(after, rig),
        sized_coefficients(phase, rig),
        covariance,
        correlation=correlation(answers, after),
    )
    seconds = {**study.seconds, **closes.seconds, "coefficients": time.perf_counter() - begun}
    rivals = _rivals(study)
    fitted = [answer.hypothesis.fit for answer in rivals if answer.hypothesis is not None]
    noise = study.prepared.noise
    of_answer = cautions(
        study.campaign, noise, closes.gap.runs, closes.confirmation, named=study.named, settings=settings
    )
    caveats = (*left_out, *of_answer, *outside_the_fits(study))
    rest = _remains(study, found, answers, closes.steps)
    beside = beside_the_numbers(study, said, before, after, caveats, rest)
    return Diagnosis(
        campaign=study.campaign.name,
        causes=study.causes,
        gap=closes.gap,
        where=where,
        maps=maps.to_json_dict(),
        candidates=weighed,
        decision=decision(
            [(one.effect, one.probability) for one in weighed],
            settings.answer,
            _predictions(closes.gap, patched, beside, settings.answer),
        ),
        ambiguous_with=tuple(
            sorted({name for answer in rivals for name in answer.effects} - set(study.causes))
        ),
        next_run=separating_run(chosen, fitted[0]) if fitted and chosen is not study.nominal else None,
        coefficients=found,
        confirmation=closes.confirmation,
        noise=NoiseSummary(
            noise.std,
            None if noise.stated_variance is None else float(np.sqrt(noise.stated_variance)),
            noise.source,
        ),
        hidden=own_hidden(answers.hidden, after, study.campaign, similarity, study.model),
        trade_off=least_separated(chosen, study.campaign),
        blind_spots=study.model.blind_spots(study.nominal.problem.data),
        seconds=seconds,
        provenance={
            "versions": {name: version(name) for name in _PACKAGES},
            "settings": settings.differences(),
        },
        inclusion=inclusion(weighed, study.beside, settings.gap),
        waterfall=closes.steps,
        disturbed=study.disturbed,
        rest=rest,
        # with an unknown cause, the runs may still differ in a way that no effect of the vocabulary describes
        repeatability=repeatability(chosen if study.causes != UNKNOWN else study.between_runs or chosen),
        model=patched,
        found=beside,
    )


def _predictions(
    gap: GapSummary, patched: PatchedModel | None, found: Found, chosen: AnswerSettings
) -> Predictions:
    """The success of the answer's predictions."""
    return Predictions(
        held_out=gap.closed,
        ahead=gap.closed_ahead,
        patched=None if patched is None else patched.judged(chosen),
        left=None if gap.misfit is None else gap.misfit.of_swing(gap.excess_after),
        elsewhere=found.place is not None and found.place.elsewhere,
    )


def _remains(study: Study, found: Coefficients, answers: Answers, steps: Waterfall) -> Remainder:
    """The residual gap of the answer, and its possible influence on the coefficients."""
    similarity, chosen = study.similarity, study.chosen
    stated = {name: own_estimate(given, similarity) for name, given in found.after.items()}
    moved = {
        name: similarity.own(coefficient_move(chosen, coefficient), given.unit)
        for (name, given), coefficient in zip(found.after.items(), coefficients_of(chosen), strict=False)
    }
    return remainder(study, stated, moved, steps.steps[-1].excess, answers.hidden)


def _rivals(study: Study) -> list[Answer]:
    """The probable answers beside the first that do not contain it; none where nothing is named."""
    return [
        answer
        for answer in study.answers[1:]
        if study.named
        and answer.probability >= study.settings.answer.rivals_from
        and answer.effects != UNKNOWN
        and not set(study.fitted) <= set(answer.effects)
    ]
