"""The answer: in a few words, in one paragraph, cause by cause, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from diagnosis.findings.coefficients import consequence
from diagnosis.findings.disturbed_runs import disturbed_words, odd_runs
from diagnosis.findings.other_motions import second_mode_words
from diagnosis.findings.patch import model_words
from diagnosis.findings.place import runs_of_the_gap
from diagnosis.findings.spring_choices import choice_words
from diagnosis.findings.terms import (
    BETWEEN_RUNS,
    CHANNELS,
    CONDITIONS,
    named_answer,
    part_of_gap,
    without_scatter,
)
from diagnosis.findings.whole import Findings
from diagnosis.search.answer import UNKNOWN
from identification.printing import COEFFICIENTS
from identification.show.numbers import (
    beside_noise,
    plain,
    probability,
    rounded_up,
    share,
)
from tunnel_sim.effects import effect_class


def headline(answer: Findings) -> tuple[str, str]:
    """The answer in a few words, and its kind: one of ``none``, ``unknown``, ``open``, ``found``."""
    words, kind = _answer_in_words(answer)
    for one in answer.found.readings:
        words = words.replace(plain(one.cause), f"{plain(one.cause)} or {one.instead}")
    if kind == "found" and not without_scatter(answer.causes) and answer.repeated.systematic(answer):
        words = f"{BETWEEN_RUNS.capitalize()}, not by chance alone"
    return words + odd_runs(answer.disturbed), kind


def _answer_in_words(answer: Findings) -> tuple[str, str]:
    causes = answer.causes
    if not causes:
        return "No gap", "none"
    if not answer.decided:
        effects, channels = without_scatter(answer.decision.effects), answer.decision.channels
        known = plain(*effects) if effects else " and ".join(CHANNELS[name] for name in channels)
        return f"Undecided: {known}, and more" if known else "Undecided", "open"
    if causes == UNKNOWN:
        return "Unexplained gap", "unknown"
    names = named_answer(causes)
    if answer.ambiguous_with:
        return answer.named_causes.known_and_open(), "open"
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
        *(one.words for one in found.readings),
        model_words(answer.model, answer),
        *(str(rival.figures["words"]) for rival in found.rivals),
    ]
    return " ".join(filter(None, parts))


_SMALL = "There is a gap, but its root mean square is within the noise."


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
    size = f"{gap.misfit.rms_words(excess)} root mean square, {gap.misfit.swing_words(excess)}"
    there_is = f"There is a gap ({size})." if gap.misfit.shows(excess) else _SMALL
    proper = without_scatter(causes)
    explained = f"{share(gap.closed)} of the gap {gap.closed_on}."
    if not answer.decided:
        sentence = f"{there_is} Its cause is undecided."
        first = f"{_sentence(plain(*proper))} {_explain(proper)}" if proper else "These differences explain"
        by_first = "" if causes == UNKNOWN else f"{first} {explained}"
        likely = answer.decision.words(runs_of_the_gap(answer.where, facts.place))
        return " ".join(filter(None, (sentence, likely, repeats, by_first)))
    if causes == UNKNOWN:
        nearly = "" if facts.nearly is None or facts.rivals else facts.nearly.words
        # a cause from outside the vocabulary explains the differences between the runs as well
        repeats = "" if facts.rivals else repeats
        sure = answer.surely_beside
        beside = (
            f"{_sentence(plain(*sure))} {'are' if len(sure) > 1 else 'is'} a part of it. " if sure else ""
        )
        explained = f"No known effect explains {'the rest' if sure else 'it'} (tunnel effects lists them)."
        sentence = beside + ("No effect is named as its cause." if nearly else explained)
        return " ".join(filter(None, (there_is, sentence, nearly, rest, repeats)))
    left = answer.rest
    small = left is None or (not left.material and left.is_small(answer.coefficients_after))
    changes = facts.immaterial if small else {}
    last = (explained, rest, _immaterial(changes) or consequence(answer.coefficients, answer))
    if not proper:
        return " ".join(filter(None, (there_is, repeats, "These differences explain", *last)))
    acting = []
    for name in proper:  # the channel of each cause and, if the campaign can show it, the condition
        kind = effect_class(name)
        wind = f", {CONDITIONS[kind.condition]}" if facts.both_winds else ""
        subject = plain(name) if len(proper) > 1 else "the cause"
        acting.append(f"{subject} acts on {CHANNELS[kind.channel]}{wind}")
    they = "They" if len(proper) > 1 else "It"
    part = part_of_gap(gap.closed) if answer.rest is not None and answer.rest.remains else "the gap"
    if answer.ambiguous_with:
        sentence = f"{_sentence(part)} is explained by {answer.named_causes.known_and_open(sized=False)}."
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
    said = second_mode_words(modes, answer.misfit.unit)
    of_all = {one.run for one in modes} >= {run.id for run in answer.gap.runs}
    return [said, said_first] if of_all else [said_first, said]
