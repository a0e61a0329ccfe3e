"""A diagnosis in words: how decided it is; and as lines and tables, from its JSON document."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from diagnosis.closure import (
    closable_table,
    closable_words,
    misfit_of,
    of_swing,
    patch_lines,
    patch_table,
    rms_shown,
)
from diagnosis.settings import AnswerSettings, WordsSettings, settings_of
from identification.printing import (
    COEFFICIENTS,
    TextTable,
    coefficient_label,
    estimated,
    significant,
    unit_mark,
)
from identification.status import Remark
from tunnel_sim.effects import known_effects

_ORDINALS = ("half", "third", "quarter", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
_CARDINALS = ("", "", "two", "three", "four", "five", "six", "seven", "eight", "nine")


def part(share: float) -> str:
    """A share above 0 and below 1 as a simple fraction in words, such as ``four fifths``; others in per cent."""
    simple = Fraction(share).limit_denominator(10)
    if abs(float(simple) - share) > 1e-9 or not 0 < simple < 1:
        return f"{100.0 * share:.3g} %"
    ordinal, count = _ORDINALS[simple.denominator - 2], simple.numerator
    if count > 1:
        return f"{_CARDINALS[count]} {ordinal}s"
    return ordinal if ordinal == "half" else f"{'an' if ordinal == 'eighth' else 'a'} {ordinal}"


def plain(*names: str) -> str:
    """Effect names as words: ``mains hum, free play and coulomb friction``."""
    *first, last = (name.replace("_", " ") for name in names)
    return f"{', '.join(first)} and {last}" if first else last


def probability(value: float) -> str:
    """A probability to two decimals, never rounded to 0 or 1, such as ``0.97`` or ``> 0.99``."""
    if value >= 0.995:
        return "> 0.99"
    return f"{value:.2f}" if value >= 0.005 else "< 0.01"


@dataclass(frozen=True)
class Decision:
    """What the probabilities of the answers allow to be said.

    Args:
        decided: whether the answer is probable enough, and predicts the readings held out of the fit.
        credible: the fewest answers that together are credible, with their probabilities, most probable first.
        effects: effects that the likely answers have in common, with their probabilities.
        channels: channels on which the likely answers act in common, with their probabilities.
        unpredictive: the answer, where it is probable enough and does not predict them; else empty.
    """

    decided: bool
    credible: tuple[tuple[str, float], ...]
    effects: Mapping[str, float]
    channels: Mapping[str, float]
    unpredictive: str = ""

    def to_json_dict(self) -> dict[str, Any]:
        """The fields ``decided``, ``credible`` and ``common`` of a document."""
        return {
            "decided": self.decided,
            "credible": [{"effect": effect, "probability": value} for effect, value in self.credible],
            "common": {"effects": dict(self.effects), "channels": dict(self.channels)},
        }


def decision(
    answers: Sequence[tuple[str, float]], chosen: AnswerSettings, closed: float | None = None
) -> Decision:
    """Judge the answers by their probabilities, and the first of them by what it predicts.

    Args:
        answers: names joined by plus signs, ``none`` or ``unknown``, and probabilities, which sum to 1; the answer
            first.
        closed: share of the gap that the answer closes on readings held out of the fit; None: not known.
    """
    credible, together = [], 0.0
    for answer in sorted(answers, key=lambda given: -given[1]):
        credible.append(answer)
        together += answer[1]
        if together >= chosen.credible_from:
            break
    channel_of = {kind.name: kind.channel for kind in known_effects()}
    causes = [(set(effect.split(" + ")) & channel_of.keys(), value) for effect, value in answers]
    first, probable = answers[0][0], answers[0][1] >= chosen.decided_from
    names_effects = first not in ("none", "unknown")
    predicts = not names_effects or closed is None or closed >= chosen.predicted_from
    return Decision(
        decided=probable and predicts,
        unpredictive=first if probable and not predicts else "",
        credible=tuple(credible),
        effects=_common(causes, chosen.in_common),
        channels=_common(
            [({channel_of[name] for name in names}, value) for names, value in causes], chosen.in_common
        ),
    )


def _common(held: Iterable[tuple[set[str], float]], least: float) -> dict[str, float]:
    """What answers of ``least`` of the probability hold, with that probability, the most probable first."""
    found: dict[str, float] = {}
    for names, value in held:
        for name in sorted(names):
            found[name] = min(found.get(name, 0.0) + value, 1.0)
    ranked = sorted(found.items(), key=lambda item: -item[1])
    return {name: value for name, value in ranked if value >= least}


def undecided_words(found: Decision, chosen: WordsSettings) -> str:
    """What an undecided diagnosis does say, in sentences."""
    channels = {kind.name: kind.channel for kind in known_effects()}
    named = {channels[name] for name in found.effects}
    parts = [f"contain {plain(name)} ({probability(value)})" for name, value in found.effects.items()]
    for name, value in found.channels.items():
        if name not in named:
            parts.append(f"act on the {name} ({probability(value)})")
    common = f"The likely answers {' and '.join(parts or ['have no effect and no channel in common'])}."
    answers = []
    for effect, value in found.credible[: chosen.answers_named]:
        words = "no effect of the vocabulary" if effect == "unknown" else plain(*effect.split(" + "))
        answers.append(f"{words} ({probability(value)})")
    if len(found.credible) > chosen.answers_named:
        answers.append(f"{len(found.credible) - chosen.answers_named} more")
    most = answers[0] if len(answers) == 1 else f"{', '.join(answers[:-1])} or {answers[-1]}"
    together = probability(sum(value for _, value in found.credible))
    if found.unpredictive:
        best = plain(*found.unpredictive.split(" + ")).capitalize()
        common += f" {best} fits best, but does not predict readings held out of the fit."
    return f"{common} The answer is one of these, with probability {together} together: {most}."


Document = Mapping[str, Any]


def diagnosis_parts(document: Document) -> list[str | TextTable]:
    """What is printed of a diagnosis, in order."""
    return [
        str(document["verdict"]),
        where_line(document),
        *rival_lines(document),
        candidates_table(document),
        parameters_table(document),
        inclusion_line(document),
        waterfall_table(document),
        closable_words(document),
        closable_table(document),
        coefficients_table(document),
        patch_table(document),
        *patch_lines(document),
        *closing_lines(document),
    ]


def diagnosis_brief(document: Document) -> str:
    """An answer in three lines: its causes, its gap, and where to go from here."""
    gap, first = document["gap"], document["candidates"][0]
    causes = document["causes"]
    named = plain(*causes) if causes else "no gap"
    undecided = "" if document.get("decided", True) else "undecided, most probably "
    misfit, excess = misfit_of(document), gap["excess_before"]
    size = f"{held_out_excess(excess)} noise powers"
    if misfit is not None:
        size = f"{rms_shown(misfit, excess)} root mean square, {of_swing(misfit, excess)} ({size})"
    closed = (
        f", {share(gap['closed'])} of it closed {gap['closed_on']}" if causes not in ([], ["unknown"]) else ""
    )
    likely = probability(first["probability"])
    return (
        f"Diagnosis of {document['campaign']!r}: {undecided}{named} (probability {likely})\n"
        f"  gap {size}{closed}\n"
        "  print() shows all; .plot(), .write_report(path), .to_frame()"
    )


def candidates_table(document: Document) -> TextTable:
    """The answers considered and the shares that they close, most probable first; a last row counts the others."""
    rows, given, chosen = [], document["candidates"], settings_of(document).words
    probable = [c for c in given[: chosen.answers_listed] if c["probability"] >= chosen.answer_listed]
    shown = probable or given[:1]
    for candidate in shown:
        fitted = candidate["effect"] not in ("none", "unknown")
        closed = share(candidate["closed"]) if fitted else "–"
        name = candidate["effect"].replace(" + ", " +\n")
        rows.append((name, probability(candidate["probability"]), closed))
    if left := given[len(shown) :]:
        together = sum(candidate["probability"] for candidate in left)
        rows.append((f"{len(left)} more, together", probability(together), ""))
    heads = ("answer", "probability", "share closed")
    return TextTable(f"Answers for {document['campaign']}", heads, tuple(rows), right=heads[1:])


def parameters_table(document: Document) -> TextTable:
    """The parameters of the answer; a table without rows where it has none."""
    answer = document["candidates"][0]
    rows, effect = [], ""
    for full, given in answer["parameters"].items():
        owner, _, name = full.rpartition(".")
        owner = owner or answer["effect"]
        mark = "" if given["unit"] == "1" else unit_mark(given["unit"])
        rows.append((owner if owner != effect else "", name, estimated(given, mark)))
        effect = owner
    whose = "Parameters" if document.get("decided", True) else "Parameters of the most probable answer"
    return TextTable(f"{whose} ± one standard deviation", ("effect", "parameter", "estimate"), tuple(rows))


def gap_table(document: Document) -> TextTable:
    """The gap before and after, all runs first; a table without rows where no gap was found."""
    gap = document["gap"]
    named = document["causes"] != ["unknown"]
    listed = [("all", gap["excess_before"], gap["excess_after"])]
    for run in gap["runs"]:
        listed.append((run["id"] + ("" if run["held_out"] else " (fitted)"), run["before"], run["after"]))
    rows = [
        (name, misfit_text(document, before), misfit_text(document, after) if named else "–")
        for name, before, after in (listed if gap["detected"] else ())
    ]
    head = "Gap, root mean square (× noise power)"
    return TextTable(head, ("run", "before", "after"), tuple(rows), right=("before", "after"))


def misfit_text(document: Document, excess: float) -> str:
    """A gap in the units that people use, and in multiples of the noise power.

    Args:
        excess: in noise powers, a ratio.

    Returns:
        Text such as ``0.134° (19.34)``; the multiple alone for a document without ``misfit``.
    """
    misfit, times = misfit_of(document), held_out_excess(excess)
    return times if misfit is None else f"{rms_shown(misfit, excess)} ({times})"


def inclusion_line(document: Document) -> str:
    """The effects that may be among the causes, most probable first; empty where none is probable enough."""
    least = settings_of(document).words.effect_listed
    found = sorted(document.get("inclusion", {}).items(), key=lambda item: -item[1])
    shown = [f"{name} {probability(value)}" for name, value in found if value >= least]
    return f"Among the causes, with probability: {', '.join(shown)}" if shown else ""


def waterfall_table(document: Document) -> TextTable:
    """How far the gap closes with each cause, and without each; a table without rows where no cause is named."""
    steps, without = document.get("waterfall", ()), document.get("without", {})
    rows = []
    for step in steps if len(steps) > 1 else ():
        alone = misfit_text(document, without[step["effect"]]) if step["effect"] in without else ""
        rows.append((step["effect"] or "nominal model", misfit_text(document, step["excess"]), alone))
    title = "Gap as the causes are added, root mean square (× noise power)"
    heads = ("added", "left", "left without it alone")
    return TextTable(f"{title}, {document.get('waterfall_on', '')}", heads, tuple(rows), heads[1:])


def excess_std(document: Document) -> float | None:
    """Standard deviation of the campaign's excess by chance, in noise powers; None where there are no maps."""
    runs = (document.get("maps") or {"runs": []})["runs"]
    return math.sqrt(sum(run["std"] ** 2 for run in runs)) / len(runs) if runs else None


def held_out_excess(value: float) -> str:
    """An excess in noise powers, a ratio: three decimals where it is small, or four significant digits."""
    return f"{round(value, 3) + 0.0:.3f}" if abs(value) < 10.0 else significant(value, 4)


def coefficients_table(document: Document) -> TextTable:
    """The coefficients of the nominal model before and after the causes are added, and their changes."""
    rows = []
    before, after = document["coefficients"]["before"], document["coefficients"]["after"]
    for name in before:
        if name in after:
            one, two = before[name], after[name]
            change = 100.0 * (two["value"] - one["value"]) / abs(one["value"]) if one["value"] else 0.0
            known = all(given.get("determined", True) for given in (one, two))
            moved = f"{change:+.2g} %" if known else "–"
            rows.append((coefficient_label(name, one["unit"]), estimated(one), estimated(two), moved))
    skewed = any(given.get("interval") for given in after.values())
    title = "Coefficients ± one standard deviation" + " (central 95 %)" * skewed
    return TextTable(title, ("", "before", "after", "change"), tuple(rows), ("change",))


def where_line(document: Document) -> str:
    """Where the gap is, in a line; empty where the document has no words on it."""
    words = document["where"]["words"]
    return f"Where: {words}" if words else ""


def rival_lines(document: Document) -> list[str]:
    """Effects that the runs cannot distinguish from the causes, and the run that could; none without a rival."""
    decided = document.get("decided", True)
    rivals, run = document["ambiguous_with"] if decided else (), document["next_run"]
    lines = []
    if rivals:
        lines.append(f"These runs cannot distinguish it from: {', '.join(rivals)}")
    if run is not None:
        which = "A run that could" if decided else "A run that would distinguish the likely answers"
        lines.append(f"{which}: {run_words(run)}")
    elif rivals:
        lines.append(
            "The run that could cannot be computed from these runs: state every spring_stiffness, or add runs"
        )
    return lines


def run_words(run: Mapping[str, float]) -> str:
    """A run to make, in words.

    Args:
        run: spring stiffness (N m/rad), wind speed (m/s), release angle (rad), duration (s) and separation in
            standard deviations of the noise.
    """
    wind = "wind off" if run["wind_speed"] == 0.0 else f"wind at {run['wind_speed']:g} m/s"
    return (
        f"spring of {run['spring_stiffness']:g} N m/rad, {wind}, released at {run['release_angle']:.2g} rad, "
        f"{run['duration']:g} s long (the two then differ by {run['separation']:.0f} standard deviations)"
    )


def closing_lines(document: Document) -> list[str]:
    """Notes below the tables: noise, check by MuJoCo, meaning of the coefficients, caveats and blind spots."""
    noise, note = document["noise"], document["coefficients"]["note"]
    lines = [f"Noise: {noise['std']:.3g} rad, {noise['source']} ({noise['reason']})"]
    checked = document["confirmation"]
    if checked["agrees"]:
        apart = f"{checked['largest_difference_rad']:.1e} rad"
        lines.append(f"Excesses are computed by the MuJoCo model, which agrees with the fits within {apart}")
    if hidden := hidden_line(document):
        lines.append(hidden)
    if note:
        lines.append(f"Note: {note}")
    remarks = [str(Remark.from_json_dict(remark)) for remark in document.get("remarks", ())]
    if caveats := [*remarks, *document["cautions"]]:
        lines.append("Caveats:")
        lines += [f"- {text}" for text in caveats]
    if document["blind_spots"]:
        lines.append("These runs cannot show:")
        lines += [f"- {text}" for text in document["blind_spots"]]
    return lines


def hidden_table(document: Document) -> TextTable:
    """The effects that could hide: the largest size that the runs do not exclude, and the moves it makes."""
    hidden, rows = document.get("hidden", ()), []
    names = [name for name in document["coefficients"]["after"] if hidden and name in hidden[0]["moves"]]
    for one in hidden:
        size = f"{significant(one['size']['value'], 2)} {unit_mark(one['size']['unit'])}"
        moves = [significant(one["moves"][name]["value"], 2) for name in names]
        rows.append((plain(one["effect"]), size, *moves))
    heads = [f"moves {coefficient_label(name, hidden[0]['moves'][name]['unit'])} by" for name in names]
    return TextTable("What could hide", ("effect", "up to", *heads), tuple(rows), ("up to", *heads))


def hidden_line(document: Document) -> str:
    """The effect that could hide and moves a coefficient most, in a sentence; empty where none moves it."""
    hidden, after = document.get("hidden", ()), document["coefficients"]["after"]
    if not hidden:
        return ""
    first, moved = hidden[0], []
    for name, given in after.items():
        move = first["moves"].get(name)
        if move is not None and given.get("std") and move["value"] > given["std"]:
            by = f"{significant(move['value'], 2)} {unit_mark(given['unit'])}"
            moved.append(f"{COEFFICIENTS.get(name, name)} by {by}")
    if not moved:
        return ""
    size = f"{significant(abs(first['size']['value']), 2)} {unit_mark(first['size']['unit'])}"
    return (
        f"What could hide: {plain(first['effect'])} of up to {size.strip()}, which these runs do not exclude, "
        f"would move {' and '.join(moved)}. The intervals allow for it."
    )


def noise_powers(excess: float) -> str:
    """What is left, in noise powers, a ratio, as the verdict states it."""
    return "less than 0.001 noise powers" if excess < 1e-3 else f"{significant(excess, 2)} noise powers"


def share(value: float) -> str:
    """A share in per cent, never rounded to 0 or 100 %: text such as ``98.2 %`` or ``> 99.9 %``."""
    if value > 0.9995:
        return "> 99.9 %" if value < 1.0 else "100 %"
    if 0.0 <= value < 0.0005:
        return "< 0.1 %" if value > 0.0 else "0 %"
    return f"{100.0 * value:.1f} %"
