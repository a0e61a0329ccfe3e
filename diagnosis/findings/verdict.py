"""The answer: in a few words, in one paragraph, cause by cause, and what to do next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from diagnosis.findings.candidates import CauseSize
from diagnosis.findings.causes import advice, known_and_open
from diagnosis.findings.coefficients import consequence
from diagnosis.findings.disturbed_runs import disturbed_step, disturbed_words
from diagnosis.findings.input_hold import hold_step, hold_words
from diagnosis.findings.judgements import Nearly
from diagnosis.findings.misfit import misfit_of, of_swing, rms_shown, unit_of, windy
from diagnosis.findings.next_run import OTHER_INPUT, distinguishes, run_words, too_close
from diagnosis.findings.other_motions import second_mode_words
from diagnosis.findings.patch import model_step, model_words
from diagnosis.findings.remainder import formula_step
from diagnosis.findings.spring_choices import choice_steps, choice_words, two_springs_words
from diagnosis.findings.terms import (
    BETWEEN_RUNS,
    CHANNELS,
    CONDITIONS,
    MISFITS,
    named_answer,
    scattering,
    without_scatter,
)
from diagnosis.findings.whole import Findings
from diagnosis.search.weigh import UNKNOWN
from identification.printing import COEFFICIENTS
from identification.show.numbers import (
    beside_noise,
    listed,
    plain,
    probability,
    rounded_up,
    share,
    significant,
    times_noise,
    unit_shown,
)
from identification.status import Outcome, Remark
from tunnel_sim.effects import effect_class, known_effects, the_effect


def headline(answer: Findings) -> tuple[str, str]:
    """The answer in a few words, and its kind: one of ``none``, ``unknown``, ``open``, ``found``."""
    words, kind = _answer_in_words(answer)
    if answer.found.hold:
        delay = plain(the_effect(delays=True).name)
        words = words.replace(delay, f"{delay} or wrong hold")
    if kind == "found" and not without_scatter(answer.causes) and answer.repeated.systematic(answer):
        words = f"{BETWEEN_RUNS.capitalize()}, not by chance alone"
    found = answer.disturbed
    disturbed = [one.run for one in found if one.at_s is not None]
    odd = [one.run for one in found if one.at_s is None]
    said = f"; {_runs(disturbed)} disturbed" if disturbed else ""
    differ = "differ from the others" if len(odd) > 1 else "differs from the others"
    return words + said + (f"; {_runs(odd)} {differ}" if odd else ""), kind


def _runs(names: Sequence[str]) -> str:
    """Runs by their ids."""
    return f"run{'s' if len(names) > 1 else ''} {', '.join(names)}"


def _answer_in_words(answer: Findings) -> tuple[str, str]:
    causes = answer.causes
    if not causes:
        return "No gap", "none"
    if not answer.decision.decided:
        effects, channels = without_scatter(answer.decision.effects), answer.decision.channels
        known = plain(*effects) if effects else " and ".join(CHANNELS[name] for name in channels)
        return f"Undecided: {known}, and more" if known else "Undecided", "open"
    if causes == UNKNOWN:
        return "Unexplained gap", "unknown"
    names = named_answer(causes)
    if answer.ambiguous_with:
        return known_and_open(answer), "open"
    if answer.rest_is_material:
        return f"{names}, in part", "open"
    return names, "found"


def verdict(answer: Findings, rest: str) -> str:
    """The answer in one paragraph.

    Args:
        rest: the remaining gap, in sentences.
    """
    found = answer.found
    if cycling := found.limit_cycles:
        said = ". ".join(f"{remark.runs[0]}: {remark.what}" for remark in cycling)
        return f"No run is a free decay, so no cause is named. {said}."
    parts = [
        *(disturbed_words(one, no_gap=not answer.causes) for one in answer.disturbed),
        *_with_second_modes(_answer(answer, rest), answer),
        choice_words(answer.found.choices),
        hold_words(answer.found.hold),
        model_words(answer.model, answer),
        *(RIVALS[rival.kind](rival.figures) for rival in found.rivals),
    ]
    return " ".join(filter(None, parts))


def _answer(answer: Findings, rest: str) -> str:
    """The gap, its causes, and the share of the gap that they explain."""
    causes, gap, facts = answer.causes, answer.gap, answer.found
    excess, repeats = gap.excess_before, answer.repeated.words(answer)
    if not causes:
        sentence = (
            "No gap: the nominal model explains the runs down to their noise "
            f"(the residual is {beside_noise(excess)}, root mean square)."
        )
        return " ".join(filter(None, (sentence, repeats)))
    size, misfit = times_noise(excess), misfit_of(answer)
    if misfit is not None:
        size = f"{rms_shown(misfit, excess)} root mean square, {of_swing(misfit, excess)}"
    there_is = f"There is a gap ({size})."
    proper = without_scatter(causes)
    explained = f"{share(gap.closed)} of the gap {gap.closed_on}."
    if not answer.decision.decided:
        sentence = f"{there_is} Its cause is undecided."
        first = f"{_sentence(plain(*proper))} {_explain(proper)}" if proper else "These differences explain"
        by_first = "" if causes == UNKNOWN else f"{first} {explained}"
        return " ".join(filter(None, (sentence, undecided_words(answer), repeats, by_first)))
    if causes == UNKNOWN:
        nearly = "" if facts.nearly is None else _nearly(facts.nearly)
        sentence = (
            "No effect is named as its cause."
            if nearly
            else "No known effect explains it (tunnel effects lists them)."
        )
        return " ".join(filter(None, (there_is, sentence, nearly, rest, repeats)))
    changes = {} if answer.rest_is_material else facts.immaterial
    last = (explained, rest, _immaterial(changes) or consequence(answer.coefficients, answer))
    if not proper:
        return " ".join(filter(None, (there_is, repeats, "These differences explain", *last)))
    acting = []
    for name in proper:  # the channel of each and, where the campaign can show it, the condition
        kind = effect_class(name)
        wind = f", {CONDITIONS[kind.condition]}" if facts.both_winds else ""
        subject = plain(name) if len(proper) > 1 else "the cause"
        acting.append(f"{subject} acts on {CHANNELS[kind.channel]}{wind}")
    they = "They" if len(proper) > 1 else "It"
    part = "part of the gap" if answer.rest_is_material else "the gap"
    if answer.ambiguous_with:
        sentence = f"{_sentence(part)} is explained by {known_and_open(answer, sized=False)}."
    else:
        likely = probability(answer.decision.credible[0][1])
        sentence = f"{_sentence(plain(*proper))} {_explain(proper)} {part} (probability {likely})."
    misfit_words = f"The misfit of the nominal model is {size}."
    acts = f"{_sentence('; '.join(acting))}."
    by_all = f"{they} {_explain(proper)}"
    if len(causes) > len(proper):
        by_all = f"Together with these differences {they.lower()} {_explain(proper)}"
    return " ".join(filter(None, (sentence, misfit_words, acts, repeats, by_all, *last)))


def _sentence(words: str) -> str:
    """The words with a capital at the start."""
    return words[:1].upper() + words[1:]


def _explain(subjects: Sequence[str]) -> str:
    """The verb for one or several subjects."""
    return "explain" if len(subjects) > 1 else "explains"


def undecided_words(answer: Findings) -> str:
    """Sentences on an undecided diagnosis: the common part of its answers and the alternatives."""
    decision, credible = answer.decision, answer.decision.credible
    most_named = answer.settings.words.answers_named
    channels = {kind.name: kind.channel for kind in known_effects()}
    effects = {name: decision.effects[name] for name in without_scatter(decision.effects)}
    named = {channels[name] for name in effects}
    common_to_all = [f"{plain(name)} ({probability(value)})" for name, value in effects.items()]
    parts = [f"contain {listed(common_to_all)}"] if common_to_all else []
    for name, value in decision.channels.items():
        if name not in named:
            parts.append(f"act on {CHANNELS[name]} ({probability(value)})")
    said = f"The likely answers {' and '.join(parts)}. " if parts else ""
    answers = []
    for effect, value in credible[:most_named]:
        answers.append(f"{_among_answers(effect)} ({probability(value)})")
    if len(credible) > most_named:
        answers.append(f"{len(credible) - most_named} more")
    most = answers[0] if len(answers) == 1 else f"{', '.join(answers[:-1])} or {answers[-1]}"
    together = probability(sum(value for _, value in credible))
    if answer.decision.unpredictive:
        best = _among_answers(answer.decision.unpredictive).capitalize()
        doubts = [DOUBTS[one.kind](one.share or 0.0) for one in answer.decision.doubts]
        fit = "fits" if len(without_scatter(answer.decision.unpredictive.split(" + "))) == 1 else "fit"
        said += f"{best} {fit} best, but {' and '.join(doubts)}"
        said += f": look at {_places(answer)} there first. " if in_doubt_of_place(answer) else ". "
    return f"{said}The answer is one of these, with a total probability of {together}: {most}."


def in_doubt_of_place(answer: Findings) -> bool:
    """Whether the answer is undecided because the residuals show another place than its causes."""
    return any(one.kind == "elsewhere" for one in answer.decision.doubts)


def _places(answer: Findings) -> str:
    """The runs that show the gap, by name where not all do."""
    runs, place = answer.where.runs, answer.found.place
    return _runs(runs) if place is not None and 0 < len(runs) < place.runs else "the runs"


def _little(explained: float) -> str:
    return f"explains only {share(explained)}" if explained > 0.0 else "explains nothing"


DOUBTS: Mapping[str, Callable[[float], str]] = {
    "held out": lambda found: f"{_little(found)} of the gap on held-out readings",
    "ahead": lambda found: (
        f"{_little(found)} of the gap in the later half of the runs, fitted to the earlier"
    ),
    "patched": lambda found: f"{_little(found)} of the gap when written into the model and simulated",
    "untested": lambda found: (
        f"leaves {share(found)} of the gap, and the model can have only the mean of its friction under load"
    ),
    "left": lambda found: f"leaves a residual of {share(found)} of the swing",
    "elsewhere": lambda _: "the residuals point elsewhere",
}
"""Reasons not to decide on the answer that fits best, by kind; each takes the share found."""


def _among_answers(effect: str) -> str:
    """An answer by name, without scatter between runs, which is stated for all answers together."""
    names = effect.split(" + ")
    proper = without_scatter(names)
    if effect == "unknown":
        return "an unknown cause"
    return plain(*proper) if proper else BETWEEN_RUNS if scattering(names) else plain(effect)


def _nearly(found: Nearly) -> str:
    """The effects that explain most of a gap without being named, and the reason."""
    said = f"{plain(*found.effects).capitalize()} would explain {share(found.closes)} of the gap"
    if found.noisy:
        return f"{said}, but irregular noise may explain a gap this small."
    said = f"{said} (probability {probability(found.probability)})"
    if found.rival:
        return f"{said}, and {plain(*found.rival)} explains as much ({probability(found.rival_probability)})."
    if found.misfit:
        misfit = " and ".join(MISFITS[name] for name in found.misfit)
        return f"{said}, but leaves a significant misfit of {misfit}."
    return f"{said}, which is too little to name it."


def _immaterial(changes: Mapping[str, float]) -> str:
    """The statement that the causes change no coefficient materially; empty where they do."""
    if not changes:
        return ""
    said = (
        f"{COEFFICIENTS.get(name, name)} by less than {rounded_up(max(100.0 * change, _NO_CHANGE))} %"
        for name, change in changes.items()
    )
    return f"The gap is immaterial: its causes change {' and '.join(said)}."


_NO_CHANGE = 0.01  # %: smaller changes are shown as this


def _with_second_modes(said_first: str, answer: Findings) -> list[str]:
    """The answer and the second modes of single runs; the modes come first where every run has one."""
    modes = answer.found.second_modes
    said = [second_mode_words(one, unit_of(answer)) for one in modes]
    of_all = {one.run for one in modes} >= {run.id for run in answer.gap.runs}
    return [*said, said_first] if of_all else [said_first, *said]


RIVALS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "two springs off": two_springs_words,
    "stated": lambda found: str(found["words"]),
}
"""Sentences on a rival that is not an effect of the vocabulary, by kind."""


_VISIBLE = 0.005  # least change of a damping ratio that is stated
_VISIBLE_FREQUENCY = 5e-5  # least relative change of a frequency that is stated


def size_words(answer: Findings, size: CauseSize) -> str:
    """A cause's effect on a swing, in a sentence; damping and frequency where they change visibly."""
    mark, factor = unit_shown(answer.figure_data.get("unit", "rad"))
    angle = unit_shown("rad")[1]
    changes = []
    zeta, without = size.damping_ratio, size.damping_ratio_without
    if abs(zeta - without) > _VISIBLE * max(abs(zeta), abs(without)):
        changes.append(f"damping ratio {significant(without, 3)} becomes {significant(zeta, 3)}")
    if abs(size.frequency_change) > _VISIBLE_FREQUENCY:
        change = 100.0 * size.frequency_change
        changes.append(f"frequency {'+' if change > 0.0 else ''}{significant(change, 2)} %")
    reading = factor * size.reading_change
    if abs(size.zero_change) > 0.5 * size.reading_change:
        changes.append(f"the middle moves by {significant(factor * size.zero_change, 2)}{_spaced(mark)}")
    if not changes and not reading:  # the run that is simulated does not show it
        return ""
    changes.append(f"the reading changes by {significant(reading, 2)}{_spaced(mark)} root mean square")
    held = angle * size.stands
    stands = f"; it stops the body up to {significant(held, 2)}° from rest" if held > 0.0 else ""
    amplitude = significant(angle * size.amplitude, 2)
    return f"Over three cycles from {amplitude}°: {', '.join(changes)}{stands}"


def _spaced(mark: str) -> str:
    return mark if mark == "°" else f" {mark}"


def run_to_make(answer: Findings) -> Mapping[str, Any] | None:
    """The run that distinguishes the answers; None where none is proposed, or the best one would not."""
    run = answer.next_run
    return run if run is not None and distinguishes(run, answer.settings) else None


def unplannable(answer: Findings) -> str:
    """The reason why no run can be planned from these runs, in a sentence; empty where one can."""
    known = answer.coefficients.before
    if answer.found.driven:
        return f"No run is planned for driven runs: {OTHER_INPUT}."
    if not known:
        return "No run can be planned: the nominal model was not fitted to any run."
    if "omega_n" in known:
        return "No run can be planned, because no spring is stated: state spring_stiffness for every run."
    return ""


def rival_lines(answer: Findings) -> list[str]:
    """Effects that the runs cannot distinguish from the causes, and the run that could; none without a rival."""
    decided = answer.decision.decided
    rivals, run = answer.ambiguous_with if decided else (), answer.next_run
    lines = []
    if rivals:
        lines.append(f"These runs cannot distinguish it from {' or '.join(map(plain, rivals))}.")
    if run is not None and run_to_make(answer) is None:
        lines.append(too_close(run))
    elif run is not None:
        which = (
            "A run that would distinguish them"
            if decided
            else "A run that would distinguish the likely answers"
        )
        lines.append(f"{which}: {_run_words(answer, run)}.")
    elif rivals and answer.found.driven:
        lines.append(f"To distinguish them, {OTHER_INPUT}.")
    elif rivals:
        lines.append(
            "A run that would distinguish them cannot be computed: state every spring_stiffness, or add runs."
        )
    return lines


def _run_words(answer: Findings, run: Mapping[str, float]) -> str:
    """As `run_words`, for the rig of a document."""
    return run_words(run, robot=bool(answer.found.robot))


def _remedies(remarks: Sequence[Remark]) -> list[str]:
    """What to do about runs that are left out or refused, or whose units are wrong, each remedy once.

    A cut run is used and needs nothing.
    """
    runs: dict[str, list[str]] = {}
    for remark in remarks:
        if remark.outcome in (Outcome.LEFT_OUT, Outcome.REFUSED) or remark.withholds:
            runs.setdefault(remark.remedy, []).extend(remark.runs)
    return [f"{', '.join(names) or 'The campaign'}: {remedy}." for remedy, names in runs.items()]


_SUSPECT = "State the suspected effect in a file, and diagnose again with --effects-file"


def next_steps(answer: Findings) -> list[str]:
    """What to do next, in the order in which to do it."""
    causes = answer.causes
    steps = [disturbed_step(one) for one in answer.disturbed]
    steps += _remedies(answer.remarks)
    steps += answer.repeated.steps(answer)
    if causes != UNKNOWN and answer.decision.decided:
        steps += choice_steps(answer.found.choices)
    if (run := run_to_make(answer)) is not None and answer.ambiguous_with:
        words = f"Make the run that distinguishes the answers: {_run_words(answer, run)}."
        steps.append(f"{words} Add it to the campaign and diagnose again.")
    if step := model_step(answer.model, answer):
        steps.append(f"{step}.")
    if not causes and any(remark.withholds for remark in answer.remarks):
        return [*steps, "Diagnose again: no coefficients are given."]
    if not causes:
        return [*steps, "Use the coefficients of the nominal model, within their intervals."]
    if not answer.decision.decided:
        robot, driven = answer.found.robot, answer.found.driven
        # stated, and can be chosen
        springs = not robot and not unplannable(answer) and answer.model is None
        kinds = ["springs"] * springs + ["wind speeds"] * windy(answer)
        kinds += ["inputs" if driven else "release angles"]
        if in_doubt_of_place(answer):
            steps.append(f"Look at {_places(answer)} where the residuals point (Where), before any cause.")
        steps += [
            f"Add runs with other {plain(*kinds)}, and diagnose again: these runs leave the answer undecided.",
            "Do not repair the rig on this answer, and do not rely on the coefficients of any one cause.",
        ]
    elif causes == UNKNOWN:
        steps += [
            "Read where the model departs from the runs, and examine the rig there.",
            f"{formula_step(answer.closable) or _SUSPECT}.",
        ]
    else:
        of_spring = {kind.name for kind in known_effects() if kind.chosen_spring()}
        to_mend = [name for name in causes if name not in of_spring or not answer.found.choices]
        steps += [
            *(f"{step}." for step in [hold_step(answer.found.hold)] if step),
            *(f"{advice(answer, name)}." for name in to_mend),
            *(f"{step}." for step in [formula_step(answer.closable)] if step),
            "Measure again, and compare the two diagnoses (tunnel compare).",
            "Until then use the coefficients with the causes, not those of the nominal model.",
        ]
    if answer.rest_is_material:
        steps.append("Do not trust the coefficients beyond their intervals: the residual gap changes them.")
    return steps
