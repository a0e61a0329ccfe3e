"""The answer in four lines: the fault, its probability, its cost, and the first remedy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from diagnosis.findings.candidates import Candidate
from diagnosis.findings.cautions import CAUTIONS, sentence_of
from diagnosis.findings.closure import shares_of_gap
from diagnosis.findings.coefficients import UNCHANGED
from diagnosis.findings.disturbed_runs import odd_runs
from diagnosis.findings.next_steps import next_steps
from diagnosis.findings.terms import (
    BETWEEN_RUNS,
    CHANNELS,
    CONDITIONS,
    answer_name,
    part_of_gap,
    scattering,
    without_scatter,
)
from diagnosis.findings.verdict import headline
from diagnosis.findings.whole import Findings
from diagnosis.search.answer import UNKNOWN
from identification.printing import COEFFICIENTS
from identification.show.blocks import Pairs, Paragraph, Section
from identification.show.numbers import (
    change_up_to,
    explained_in,
    listed,
    percent_of,
    plain,
    probability,
    sentence_case,
    to_interval,
    unit_mark,
)
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.dimensions import beside


@dataclass(frozen=True)
class Head:
    """The head of an answer.

    Args:
        what: the fault.
        sure: the probability of the answer, and the next likely answer.
        costs: the coefficients with 95 % intervals, and their values without the causes.
        first: the step with the largest gain.
        warnings: caveats that may change the answer.
        kind: ``none``, ``unknown``, ``open`` or ``found``.
    """

    what: str
    sure: str
    costs: str
    first: str
    warnings: tuple[str, ...]
    kind: str

    @classmethod
    def of(cls, answer: Findings) -> Head:
        """The head of a diagnosis, from its fields."""
        first = next(iter(next_steps(answer)), "")
        return cls(
            sentence_case(_what(answer)),
            sentence_case(_sure(answer)),
            _costs(answer),
            first,
            tuple(_warnings(answer)),
            headline(answer)[1],
        )

    @property
    def section(self) -> Section:
        """The lines with their labels, and the warnings."""
        lines = (
            ("What", self.what),
            ("How sure", self.sure),
            ("What it costs", self.costs),
            ("Do this first", self.first),
        )
        warnings = (Paragraph(one, "Caveat", "warning") for one in self.warnings)
        return Section(
            "head", "The answer in short", (Pairs(tuple(one for one in lines if one[1])), *warnings)
        )


# ---- what


def _what(answer: Findings) -> str:
    if answer.cycling:
        return "No run is a free decay, so no cause is named"
    causes, odd = answer.causes, odd_runs(answer.disturbed)
    if not causes:
        return f"No gap: the model agrees with the runs{odd}"
    if not answer.decided:
        known = without_scatter(answer.decision.effects)
        part = f": {plain(*known)}, and perhaps more" if known else ""
        return f"A gap of undecided cause{part}{odd}"
    if causes == UNKNOWN:
        unknown = (
            "A gap that no known effect explains" if answer.found.nearly is None else "A gap of unknown cause"
        )
        beside = f"{plain(*answer.surely_beside)}, and " if answer.surely_beside else ""
        return f"{beside}{unknown if not beside else unknown[:1].lower() + unknown[1:]}{_place(answer)}{odd}"
    parts, most = shares_of_gap(answer.waterfall), _MOST_SIZED
    certain: list[str] = without_scatter(causes)
    alternatives: list[tuple[str, float]] = []
    if answer.ambiguous_with:
        certain, alternatives = answer.named_causes.certain_and_open(sized=False)
    certain = sorted(certain, key=lambda name: -parts.get(name, (0.0, ""))[0])
    sized = [_sized(answer, name) if len(certain) <= most else plain(name) for name in certain]
    several = [text for text, _ in alternatives]
    if len(several) > 1:
        sized.append(f"either {', '.join(several[:-1])} or {several[-1]}")
    if scattering(causes):
        sized.append(BETWEEN_RUNS if sized else _scatter(answer))
    words = "; and ".join(["; ".join(sized[:-1]), sized[-1]]) if len(sized) > 1 else sized[0]
    explains = "explain" if len(sized) > 1 else "explains"
    partly = f", which {explains} {part_of_gap(answer.gap.closed)}" if answer.rest_is_material else ""
    return f"{words}{partly}{odd}"


_MOST_SIZED = 3  # maximum number of causes named with their sizes


def _sized(answer: Findings, name: str) -> str:
    """A cause with its size, or its name."""
    size = answer.named_causes.said_size(answer.candidates[0], name, deviations=False)
    return plain(name) if not size or explained_in(size) else size.partition(" (")[0]


def _called(answer: Findings, name: str) -> str:
    """A cause without its size, as in the first line."""
    return _sized(answer, name).partition(" of ")[0]


def _scatter(answer: Findings) -> str:
    systematic = answer.repeated.systematic(answer)
    return "the runs differ from each other" + (", and not by chance alone" if systematic else " by chance")


def _place(answer: Findings) -> str:
    """Where a gap of unknown cause acts; empty where the runs do not show it."""
    channel, condition = answer.where.channel, answer.where.condition
    if channel is None:
        return ""
    wind = f", {CONDITIONS[condition]}" if condition == "wind_on" else ""
    return f"; it acts on {CHANNELS[channel]}{wind}"


def _likeliest(answer: Findings) -> list[str]:
    """The two likeliest answers with their probabilities, and the number of the others."""
    credible = answer.decision.credible
    shown = [f"{probability(value)} {_joined(effect)}" for effect, value in credible[:2]]
    rest, more = sum(value for _, value in credible[2:]), len(credible) - 2
    others = "another" if more == 1 else f"one of {more} more"
    return shown + ([f"{probability(rest)} {others}"] if more > 0 else [])


def _joined(effect: str) -> str:
    """An answer as a sum of its effects: a list of them would merge with the list of answers."""
    if effect in ("unknown", "none"):
        return _NAMES[effect]
    return answer_name(effect).replace("_", " ")


_NAMES = {"unknown": "an unknown cause", "none": "no gap"}


# ---- how sure


def _sure(answer: Findings) -> str:
    if answer.cycling:
        return "Every run grows, or oscillates steadily"
    if answer.found.nowhere is not None and answer.found.nowhere.within_step:
        return "The residual is not noise, but smaller than the steps of the readings"
    if not answer.causes:
        chance = percent_of(answer.gap.p_value)
        return f"Nothing beyond chance: noise alone departs as much in {chance} of campaigns"
    if not answer.decided:
        return f"Not yet: {'; '.join(_likeliest(answer))}"
    rest = (
        "; from one run, so a fault of this run may be the cause"
        if answer.names_effects and len(answer.gap.runs) == 1
        else ""
    )
    if answer.rest_is_material and answer.names_effects:
        rest += f"; {answer.misfit.words(answer.gap.excess_after)} of misfit remains"
    if answer.ambiguous_with:
        certain, alternatives = answer.named_causes.certain_and_open(sized=False)
        known = [f"{answer.named_causes.included(name)} for {_called(answer, name)}" for name in certain]
        several = [f"{probability(value)} for {text}" for text, value in alternatives]
        return "; ".join([*known, " or ".join(several)]) + rest
    first, *others = answer.candidates
    likely = sum(one.probability for one in others)
    others = sorted((one for one in others if one.probability >= _COUNTS), key=lambda one: -one.probability)
    if not others:
        next_one = "no other answer has 1 %"
    else:
        alone = likely - others[0].probability < _COUNTS
        which = "the only other reading" if alone else "the next likeliest"
        next_one = f"{which}: {_against(others[0], first)} ({probability(others[0].probability)})"
    return f"{probability(first.probability)}; {next_one}{rest}"


_COUNTS = 0.005  # probability that is shown as 1 %


def _against(other: Candidate, first: Candidate) -> str:
    """Another answer; by its difference from the first answer where they share effects."""
    mine, theirs = set(first.effect.split(" + ")), set(other.effect.split(" + "))
    if theirs > mine:
        return f"{plain(*sorted(theirs - mine))} as well"
    if theirs < mine:
        return f"the same without {plain(*sorted(mine - theirs))}"
    return _joined(other.effect)


# ---- what it costs


def _costs(answer: Findings) -> str:
    given, causes = answer.coefficients, answer.causes
    after = given.comparable
    compared = answer.names_effects
    parts = [
        f"{COEFFICIENTS.get(name, name)} {_coefficient(one, given.before.get(name) if compared else None)}"
        for name, one in after.items()
        if one.determined and name != "moment_offset"
    ][:_MOST_STATED]
    open_ones = [COEFFICIENTS.get(name, name) for name, one in after.items() if not one.determined]
    if open_ones:
        parts.append(f"{listed(open_ones)} not determined")
    if not parts:
        return "These runs give no coefficients"
    per = "per rad, " if any(one.unit == "1/rad" for one in after.values()) else ""
    lines = ";\n".join(parts)
    stated = f"{lines} ({per}95 %)"
    if not causes:
        return f"Nothing: {stated}"
    if causes == UNKNOWN:
        return f"Not corrected: {stated}{_further(answer)}"
    return f"{stated}{_further(answer)}" if answer.decided else f"Over the likely answers: {stated}"


_MOST_STATED = 3  # maximum number of coefficients


def _coefficient(one: Quantity, before: Quantity | None) -> str:
    """A coefficient with its 95 % interval, and its value without the causes."""
    text, places = to_interval(one)
    unit = "" if one.unit in ("1", "1/rad") else unit_mark(beside(one.unit))
    if before is None or not before.determined:
        return f"{text}{unit}"
    if abs(one.value - before.value) < UNCHANGED * abs(before.value):
        return f"{text}{unit}, unchanged"
    inside = " (within the interval)" if one.agrees(before.value) else ""
    return f"{text}{unit} instead of {before.value:.{places}f}{inside}"


def _further(answer: Findings) -> str:
    """The change that the residual gap may add; empty where it is not material."""
    if answer.rest is None or not answer.rest_is_material:
        return ""
    after = answer.coefficients.after
    moves = [
        f"{COEFFICIENTS.get(name, name)} by {change_up_to(one.value, after[name])}"
        for name, one in answer.rest.moves.items()
        if name != "moment_offset" and one.material
    ]
    return f"; the gap that remains could change {listed(moves)}" if moves else ""


def _warnings(answer: Findings) -> Iterator[str]:
    """Caveats that may change the answer."""
    for remark in answer.remarks:
        if remark.withholds:
            yield str(remark)
    for fact in answer.found.cautions:
        if fact.kind in _CHANGES:
            yield sentence_of(CAUTIONS, fact, answer.misfit.unit)


_CHANGES = {"not followed", "only one run", "more noise than stated", "zeros apart"}
"""Kinds of caveats that may change the answer."""
