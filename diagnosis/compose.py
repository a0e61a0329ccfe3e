"""From a study to the answer: every finding in the units of the measured campaign, composed once."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.answer.held_out import Waterfall, excess_base
from diagnosis.answer.linear_theory import coefficient_move, coefficients_of
from diagnosis.answer.own_motion import with_own_motions
from diagnosis.answer.runs_in_still_air import left_in_still_air
from diagnosis.confirmed import Confirmed
from diagnosis.diagnosable import Chosen, gain_words
from diagnosis.findings.averaged_coefficients import (
    Answers,
    as_identified,
    before_the_causes,
    coefficients,
    correlation,
    in_phase,
    possible_answers,
)
from diagnosis.findings.candidates import Candidate, candidates, inclusion, parameter_errors
from diagnosis.findings.cause_sizes import cause_sizes
from diagnosis.findings.closing import Closing
from diagnosis.findings.closure import GapSummary, NoiseSummary
from diagnosis.findings.coefficients import Coefficients
from diagnosis.findings.decision import Decision, Predictions, decision
from diagnosis.findings.finding import Answered
from diagnosis.findings.friction_curve import FrictionCurve, friction_curve
from diagnosis.findings.hidden import Hidden
from diagnosis.findings.input_hold import other_hold
from diagnosis.findings.judgements import cautions, immaterial, nearly, outside_the_fits, zeros_apart
from diagnosis.findings.next_run import FurtherRuns, NextRun
from diagnosis.findings.other_motions import TwoModes, recognised_limit_cycles, second_modes
from diagnosis.findings.passive import within_bounds
from diagnosis.findings.remainder import Remainder, remainder
from diagnosis.findings.repeatability import AnswerWithout
from diagnosis.findings.spring_choices import other_inertia, spring_choices
from diagnosis.findings.trade_off import least_separated
from diagnosis.findings.units import (
    own_estimates,
    own_fact,
    own_hidden,
    own_repeatability,
    sized_coefficients,
)
from diagnosis.findings.whole import Found, findings_of
from diagnosis.likelihood.compression import in_shorter_blocks
from diagnosis.model.choose import nominal_model
from diagnosis.model.fact import Fact, as_stated
from diagnosis.noise.gap import noise_noted
from diagnosis.noise.mains import hum_noted
from diagnosis.patch.written_model import PatchedModel
from diagnosis.remainder.closable import Closable
from diagnosis.remainder.ways import way_for
from diagnosis.result import Diagnosis
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.clock import Progress
from diagnosis.search.rivals.rival import rival_facts
from diagnosis.search.study import Study
from diagnosis.settings import AnswerSettings
from diagnosis.where.described import Nowhere, PlaceFound, Where, described, nowhere
from diagnosis.where.maps import Maps
from diagnosis.where.place import blow_interval
from diagnosis.where.survey import with_answer
from identification.estimate import Estimate
from identification.estimators import make_estimator
from identification.identifying import identify_examined
from identification.show.quantity import Quantity
from identification.status import Examined, Remark, left_out_as_asked
from tunnel_sim.effects import BetweenRuns, effect_class
from tunnel_sim.effects.capabilities import SecondOscillation
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import unit_of_frequency

if TYPE_CHECKING:
    from tunnel_sim.engine.joint_model import JointModel

_PACKAGES = ("virtual-wind-tunnel", "mujoco", "numpy", "scipy")


@dataclass(frozen=True)
class Question:
    """The question of a diagnosis, apart from the runs.

    Args:
        joint: the user's model of a joint, in which the causes are written; None: none.
        remarks: on runs that were left out before the examination.
        left_out: ids of the runs left out on request.
        say: called with the name of each step.
    """

    joint: JointModel | None
    remarks: tuple[Remark, ...]
    left_out: Sequence[str]
    say: Progress


@dataclass(frozen=True)
class _Named:
    """The answer in numbers: causes, place, probabilities, coefficients.

    Args:
        immaterial: by coefficient, the relative change by the causes if none is material.
    """

    causes: tuple[str, ...]
    where: Where
    place: PlaceFound | Nowhere | None
    candidates: tuple[Candidate, ...]
    decision: Decision
    coefficients: Coefficients
    hidden: tuple[Hidden, ...]
    rest: Remainder | None
    immaterial: Mapping[str, float]
    limit_cycles: tuple[Remark, ...] = ()

    @property
    def unsure(self) -> bool:
        """Whether free decays leave the answer undecided, or ``no effect`` is the most likely answer."""
        return not self.limit_cycles and (not self.decision.decided or _unknown(self.candidates))


def composed(
    answered: Confirmed, chosen: Chosen, asked: Question, without_outlier: AnswerWithout | None = None
) -> Diagnosis:
    """The answer of a study.

    Args:
        chosen: the examined campaign, its effects and its model.
        without_outlier: the answer from the other runs, if one run is an outlier; None: not known.
    """
    study, closes, repeats = answered.study, answered.closes, answered.repeats
    patched, unpatched = (None, ()) if asked.joint is None else _patched(study, asked.joint)
    similarity, fitted, cycling = study.similarity, study.chosen, chosen.limit_cycles
    begun = time.perf_counter()
    where, maps, place = localise(study, closes.gap.closed)
    named = _named(answered, chosen, patched, (where, place))
    seconds = {**study.seconds, **closes.seconds, "coefficients": time.perf_counter() - begun}
    if cycling:
        named = _cycling(closes.gap, chosen.remarks, study.settings.answer)
    closable, of_remainder = (None, ()) if cycling else _closable(study, named, asked.say)
    remarks = (*left_out_as_asked(asked.left_out), *asked.remarks, *chosen.remarks)
    withheld = any(remark.withholds for remark in remarks)
    rivals = _rivals(study)
    steady = (answer.hypothesis for answer in rivals if answer.moment is None)
    beside = [one.fit for one in steady if one is not None]
    next_run = NextRun.between(fitted, beside[0]) if beside and fitted is not study.nominal else None
    further = None
    if not (withheld or cycling):
        further = FurtherRuns.narrowing(study.stated, named.coefficients.after)
    caveats = _caveats(study, chosen, closes, unpatched, of_remainder, named)
    return Diagnosis(
        campaign=study.campaign.name,
        causes=named.causes,
        gap=closes.gap,
        where=named.where,
        candidates=named.candidates,
        decision=named.decision,
        ambiguous_with=tuple(
            sorted({name for answer in rivals for name in answer.effects} - set(study.causes))
        ),
        next_run=None if next_run is None else next_run.own(similarity),
        further_runs=None if further is None else further.own(similarity),
        coefficients=Coefficients({}, {}) if withheld else named.coefficients,
        confirmation=closes.confirmation.scaled(similarity.own(1.0, similarity.reading)),
        noise=_noise(study),
        hidden=() if withheld else named.hidden,
        trade_off=None if withheld or cycling else least_separated(fitted, study.campaign),
        blind_spots=() if cycling else study.model.blind_spots(study.nominal.problem.data),
        seconds=seconds,
        maps=maps.rounded(),
        friction=_friction(study),
        provenance={
            "versions": {name: version(name) for name in _PACKAGES},
            "settings": study.settings.differences(),
            "left_out": list(asked.left_out),
        },
        disturbed=with_own_motions(study, chosen.campaign),
        remarks=remarks,
        inclusion={}
        if cycling
        else inclusion(named.candidates, study.beside, study.settings.gap, study.campaign.sensor.freedom),
        waterfall=closes.steps,
        rest=named.rest,
        repeatability=None
        if repeats is None or cycling
        else replace(own_repeatability(repeats, similarity), without_outlier=without_outlier),
        model=patched,
        closable=closable,
        sizes=cause_sizes(study) if study.named else (),
        found=_beside(study, chosen, named, caveats),
        data=chosen.examined,
        motion=chosen.examined.sensor.freedom.motion,
        motion_scale=similarity.angle,
        **findings_of(
            Answered(
                chosen.examined,
                study,
                named.coefficients.before,
                named.coefficients.comparable,
                answered.sizes,
            )
        ),
    )


def _caveats(
    study: Study,
    chosen: Chosen,
    closes: Closing,
    unpatched: tuple[Fact, ...],
    of_remainder: tuple[Fact, ...],
    named: _Named,
) -> tuple[Fact, ...]:
    """All caveats of an answer, in the order in which they are listed."""
    noise, data = study.prepared.noise, study.campaign
    of_answer = cautions(
        data, noise, closes.gap.runs, closes.confirmation, named=study.named, decays=not chosen.limit_cycles
    )
    zeros = zeros_apart(study) if named.unsure else ()
    return (
        *chosen.left_out,
        *_of_model(study, unpatched),
        *of_answer,
        *outside_the_fits(study),
        *of_remainder,
        *zeros,
    )


def _beside(study: Study, chosen: Chosen, named: _Named, caveats: tuple[Fact, ...]) -> Found:
    """The facts of an answer that are not numeric results."""
    data, noise = study.nominal.problem.data, study.prepared.noise
    unknown = named.unsure and _unknown(named.candidates)
    return Found(
        place=named.place if isinstance(named.place, PlaceFound) else None,
        nowhere=named.place if isinstance(named.place, Nowhere) else None,
        both_winds=bool(data.in_wind and data.in_still_air),
        robot=study.model.of_robot and not data.in_wind,
        driven=not data.decays,
        nearly=nearly(study),
        immaterial=named.immaterial,
        choices=spring_choices(study),
        readings=tuple(filter(None, (other_inertia(study), other_hold(study)))),
        rivals=tuple(rival_facts(study.rivals, study.nominal, study.similarity)) if named.unsure else (),
        second_modes=_second_modes(study, chosen) if unknown else (),
        limit_cycles=named.limit_cycles,
        noise=own_fact(noise.reason, study.similarity),
        cautions=tuple(own_fact(one, study.similarity) for one in caveats),
        noted=tuple(
            replace(one, fact=own_fact(one.fact, study.similarity))
            for one in (
                *noise_noted(noise, study.prepared.trend, study.gap.test, named=study.named),
                *hum_noted(study.campaign, study.prepared.hum, study.similarity),
            )
        ),
    )


def _unknown(weighed: Sequence[Candidate]) -> bool:
    """Whether ``no effect`` is the most likely answer; below one half, a set of effects may still come first."""
    odds = {candidate.effect: candidate.probability for candidate in weighed}
    return max(odds, key=odds.__getitem__, default="") in UNKNOWN


def localise(study: Study, explained: float = 0.0) -> tuple[Where, Maps, PlaceFound | Nowhere]:
    """Locate the departure of the nominal model from the runs: the place, its maps, the reason.

    The place follows from the residuals alone; the causes are only compared with it.

    Args:
        explained: share of the gap that the causes explain on held-out readings.
    """
    place, chosen = study.gap.place or study.prepared.place(), study.settings.where
    survey = place.survey
    answer = None if study.chosen is study.nominal else study.chosen
    maps = survey.maps
    if answer is not None:
        maps = with_answer(
            survey, study.campaign, in_shorter_blocks(study.nominal), in_shorter_blocks(answer)
        )
    if not study.causes:
        return Where(None, None), maps, nowhere(survey, within_step=study.gap.test.within_step)
    compared = (*study.fitted, *study.read_off) if study.named else ()  # the set is judged as a whole
    where = Where(
        channel=place.channel.value,
        condition=place.condition.value,
        runs=place.runs,
        time_s=blow_interval(survey, chosen.interval_share) or survey.time_interval,
        amplitude_rad=survey.amplitude_interval,
        frequency_hz=survey.frequency_interval,
    )
    kinds, scattering = [effect_class(name) for name in compared], bool(study.scattering)
    said = described(where, place, kinds, chosen, scattering=scattering, explained=explained)
    return where, maps, said


def _friction(study: Study) -> FrictionCurve | None:
    """The friction of the answer against the rate; None without friction."""
    named = bool(study.causes) and study.chosen is not study.nominal
    return friction_curve(study.chosen, study.similarity) if named else None


def _named(
    answered: Confirmed,
    chosen: Chosen,
    patched: PatchedModel | None,
    located: tuple[Where, PlaceFound | Nowhere],
) -> _Named:
    """The causes with their probabilities and coefficients, and whether the answer is decided."""
    study, closes = answered.study, answered.closes
    similarity, rig, settings = study.similarity, study.campaign.rig, study.settings
    where, place = located
    weighed = candidates(study, excess_base(study), parameter_errors(study, closes, answered.sizes))
    answers = possible_answers(study, chosen.kinds)
    after = within_bounds(coefficients(answers, study.campaign), study)
    identified = _identified(study, chosen)
    if identified is not None:
        after = as_identified(after, identified, study.campaign, similarity)
    phase, covariance = in_phase(study.stated)
    before = before_the_causes(study.nominal, {**after, **phase}) if study.causes else after
    by_field = {"before": before, "after": after, "in_phase": phase}
    sized = {name: sized_coefficients(given, rig) for name, given in by_field.items()}
    rest = _remains(study, sized["after"], answers, closes.steps)
    material = not study.named or rest.material
    return _Named(
        causes=study.causes,
        where=where,
        place=place,
        candidates=weighed,
        decision=decision(
            [(one.effect, one.probability) for one in weighed],
            settings.answer,
            _predictions(answered, patched, place, settings.answer),
        ),
        coefficients=Coefficients(
            own_estimates(sized["before"], similarity),
            own_estimates(sized["after"], similarity),
            own_estimates(sized["in_phase"], similarity),
            covariance,
            correlation=correlation(answers, after),
        ),
        hidden=own_hidden(answers.hidden, after, study.campaign, similarity, study.model),
        rest=rest,
        immaterial={} if material else immaterial(before, after),
    )


def _cycling(gap: GapSummary, remarks: Sequence[Remark], chosen: AnswerSettings) -> _Named:
    """The answer ``unknown`` without coefficients, for runs that are all in a limit cycle."""
    return _Named(
        causes=UNKNOWN,
        where=Where(None, None, tuple(run.id for run in gap.runs)),
        place=None,
        candidates=(Candidate("unknown", 1.0, gap.excess_before, 0.0),),
        decision=decision([("unknown", 1.0)], chosen),
        coefficients=Coefficients({}, {}),
        hidden=(),
        rest=None,
        immaterial={},
        limit_cycles=recognised_limit_cycles(remarks),
    )


def _predictions(
    answered: Confirmed, patched: PatchedModel | None, place: PlaceFound | Nowhere, chosen: AnswerSettings
) -> Predictions:
    """The success of the answer's predictions."""
    closes, repeats = answered.closes, answered.repeats
    gap, patterns = closes.gap, () if repeats is None else repeats.trends
    followed = {one.effect for one in patterns}  # what follows a pattern is not said to be scatter
    spreads = () if repeats is None else (one for one in repeats.spreads if one.effect not in followed)
    return Predictions(
        held_out=gap.closed,
        ahead=gap.closed_ahead,
        patched=None if patched is None else patched.judged(chosen),
        under_load=None if patched is None else patched.under_load(chosen),
        left=gap.misfit.of_swing(gap.excess_after),
        part=closes.steps.of_a_part,
        still_air=left_in_still_air(answered.study),
        size=max((one.differs_by for one in answered.sizes), default=None),
        pattern=max((abs(one.change) for one in patterns if one.of_condition), default=None),
        scatter=max((one.over_expected for one in spreads if one.shown), default=None),
        elsewhere=isinstance(place, PlaceFound) and place.elsewhere,
    )


def _identified(study: Study, chosen: Chosen) -> Estimate | None:
    """The estimate as by `identify`; None if a cause acts, or it would be of another model or other runs."""
    scatter_alone = study.causes != UNKNOWN and all(
        issubclass(effect_class(name), BetweenRuns) for name in study.causes
    )
    own_model = study.model.of_robot or type(study.model) is not type(nominal_model(chosen.campaign, None))
    if not scatter_alone or study.disturbed or chosen.limit_cycles or own_model:
        return None
    try:
        examined = Examined(chosen.campaign.as_angle, chosen.remarks)
        return identify_examined(examined, make_estimator("output_error"))
    except TunnelError:  # the diagnosis may compare runs that cannot be identified
        return None


def _patched(study: Study, model: JointModel) -> tuple[PatchedModel | None, tuple[Fact, ...]]:
    """The model with the causes written into it; None with a caveat where that fails."""
    from diagnosis.patch.patched_model import patched_model  # imported here because MuJoCo is slow to load

    try:
        return patched_model(study, model), ()
    except TunnelError as error:
        return None, (Fact("unpatched", {"reason": error.what}),)


def _of_model(study: Study, unpatched: tuple[Fact, ...]) -> tuple[Fact, ...]:
    """Caveats on the view of the search, the model and the patch, and on a gap beyond every effect."""
    return (
        *((Fact(study.caution),) if study.caution else ()),
        *map(as_stated, gain_words(study.campaign, study.chosen)),
        *unpatched,
        *map(as_stated, study.model.lead_words(study.similarity)),
        *(
            ()
            if study.unexplained_floor is None
            else (Fact("beyond reach", {"left": study.unexplained_floor}),)
        ),
    )


def _remains(study: Study, after: Mapping[str, Quantity], answers: Answers, steps: Waterfall) -> Remainder:
    """The residual gap of the answer, and its possible influence on the coefficients.

    Args:
        after: the coefficients with the causes, times the sizes that the rig does not state.
    """
    similarity, chosen = study.similarity, study.chosen
    stated = own_estimates(after, similarity)
    moved = {
        name: similarity.own(coefficient_move(chosen, coefficient), unit_of_frequency(name, given.unit))
        for (name, given), coefficient in zip(after.items(), coefficients_of(chosen), strict=False)
    }
    return remainder(study, stated, moved, steps.steps[-1].excess, answers.hidden)


def _rivals(study: Study) -> list[Answer]:
    """The probable answers beside the first that do not contain it; none if nothing is named."""
    return [
        answer
        for answer in study.answers[1:]
        if study.named
        and answer.probability >= study.settings.answer.rivals_from
        and answer.effects != UNKNOWN
        and not set(study.fitted) <= set(answer.effects)
    ]


def _noise(study: Study) -> NoiseSummary:
    """The reference noise, in the unit of the measured readings."""
    noise, similarity = study.prepared.noise, study.similarity
    stated = None if noise.stated_variance is None else float(np.sqrt(noise.stated_variance))
    return NoiseSummary(
        similarity.own(noise.std, similarity.reading),
        None if stated is None else similarity.own(stated, similarity.reading),
        noise.source,
    )


def _closable(study: Study, named: _Named, say: Progress) -> tuple[Closable | None, tuple[Fact, ...]]:
    """The explainable part of the remainder, and a caveat if it is not sought or not found."""
    decided, way = named.decision.decided, way_for(study)
    say("remainder")
    # in an undecided diagnosis the whole gap remains
    significant = not decided or (named.rest is not None and named.rest.significant)
    try:
        with np.errstate(over="raise"):  # a fitted model may diverge
            left = way.closable(study, significant=significant, decided=decided)
    except (np.linalg.LinAlgError, FloatingPointError):  # the answer is given without this part
        return None, (Fact("remainder not solved"),)
    return left, (Fact(way.caution),) if way.caution else ()


def _second_modes(study: Study, chosen: Chosen) -> tuple[TwoModes, ...]:
    """Second modes of single runs, if one may be named: sets of stretches have none."""
    able = any(issubclass(kind, SecondOscillation) for kind in study.prepared.kinds)
    hum = study.prepared.hum
    mains = None if hum is None else study.similarity.own(hum.frequency, "Hz")
    return second_modes(chosen.campaign, mains) if able else ()
