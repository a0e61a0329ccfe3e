"""The lines that are printed around and below the tables of a diagnosis, and all parts in order."""

from __future__ import annotations

from diagnosis.settings import settings_of
from diagnosis.words.names import Document, plain
from diagnosis.words.next_steps import rival_lines
from diagnosis.words.numbers import (
    held_out_excess,
    misfit_of,
    of_swing,
    probability,
    rms_shown,
    share,
)
from diagnosis.words.remainder import closable_line
from diagnosis.words.tables import (
    candidates_table,
    closable_table,
    coefficients_table,
    parameters_table,
    patch_table,
    waterfall_table,
)
from identification.printing import COEFFICIENTS, TextTable, significant, unit_mark
from identification.status import Remark


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
        closable_line(document),
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


def where_line(document: Document) -> str:
    """Where the gap is, in a line; empty where the document has no words on it."""
    words = document["where"]["words"]
    return f"Where: {words}" if words else ""


def listed_answers(document: Document) -> int:
    """Number of the answers that are listed: the probable ones, at least three."""
    least = settings_of(document).words.answer_described
    probable = [c for c in document["candidates"] if c["probability"] >= least]
    return max(3, len(probable))


def other_answers(document: Document) -> str:
    """The answers that are not listed, in words; empty where all are."""
    probabilities = [c["probability"] for c in document["candidates"][listed_answers(document) :]]
    if not probabilities:
        return ""
    together = probability(sum(probabilities)).replace("<", "less than")
    most = probability(max(probabilities)).replace("<", "less than")
    each = f", each of them {most}" if most.startswith("less") else f", none of them more than {most}"
    if len(probabilities) == 1:
        count, each = "1 more answer has", ""
    else:
        count = f"{len(probabilities)} more answers have together"
    words = f"{count} a probability of {together}{'' if most == together else each}."
    return f"{words} The JSON document lists all."


def inclusion_line(document: Document) -> str:
    """The effects that may be among the causes, most probable first; empty where none is probable enough."""
    least = settings_of(document).words.effect_listed
    found = sorted(document.get("inclusion", {}).items(), key=lambda item: -item[1])
    shown = [f"{name} {probability(value)}" for name, value in found if value >= least]
    return f"Among the causes, with probability: {', '.join(shown)}" if shown else ""


def patch_lines(document: Document) -> list[str]:
    """How far the patched model closes the gap, and each difference from the law found; none without a model."""
    model = document.get("model")
    if model is None:
        return []
    if document["causes"] in ([], ["unknown"]):
        said = f"No cause is written into the patched model, only what was free: {', '.join(model['free'])}."
    else:
        closed, by_fit = (f"{100.0 * model[name]:.1f} %" for name in ("closed", "closed_by_fit"))
        said = (
            f"The patched model, simulated by MuJoCo as it stands, closes {closed} of the gap "
            f"{model['closed_on']}; the fit itself {by_fit}."
        )
    reading = f"The reading is the position of {model['joint']} {model['zero_rad']:+.4g} rad."
    return [f"{said} {reading}", *(f"- {note}" for note in model["notes"])]


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
