"""The tables and single lines of a diagnosis, from its document."""

from __future__ import annotations

from diagnosis.settings import settings_of
from diagnosis.words.answers import ranked, set_out
from diagnosis.words.numbers import (
    KINDS,
    Document,
    explained,
    held_out_excess,
    listed,
    misfit_of,
    misfit_text,
    of_swing,
    percent,
    plain,
    probability,
    reading_shown,
    rms_shown,
    share,
    size_change,
    unit_of,
)
from diagnosis.words.remainder import ceiling, closable_line
from diagnosis.words.scatter import (
    answer_name,
    named_answer,
    repeatability_line,
    repeatability_table,
    repeats,
    scattering,
    spread_estimate,
)
from diagnosis.words.verdict import rival_lines
from identification.printing import (
    COEFFICIENTS,
    TextTable,
    coefficient_label,
    estimated,
    significant,
    trade_off_line,
    unit_mark,
)
from identification.status import Remark

_IN_BRACKETS = "root mean square (in brackets: its power over that of the noise)"


def candidates_table(document: Document) -> TextTable:
    """The answers considered and their shares of the gap, most probable first; a last row counts the others."""
    rows, given, chosen = [], ranked(document), settings_of(document).words
    probable = [c for c in given[: chosen.answers_listed] if c["probability"] >= chosen.answer_listed]
    shown = probable or given[:1]
    for candidate in shown:
        fitted = candidate["effect"] not in ("none", "unknown")
        closed = share(candidate["closed"]) if fitted else "–"
        name = answer_name(candidate["effect"]).replace(" + ", " +\n")
        rows.append((name, probability(candidate["probability"]), closed))
    if left := given[len(shown) :]:
        together = sum(candidate["probability"] for candidate in left)
        rows.append((f"{len(left)} more, together", probability(together), ""))
    heads = ("answer", "probability", "closed in the fit")
    return TextTable(f"Answers for {document['campaign']}", heads, tuple(rows), right=heads[1:])


def parameters_table(document: Document) -> TextTable:
    """The parameters of the answer; a table without rows where it has none."""
    answer = document["candidates"][0]
    rows, effect = [], ""
    for full, given in answer["parameters"].items():
        owner, _, name = full.rpartition(".")
        owner = owner or answer["effect"]
        mark = "" if given["unit"] == "1" else unit_mark(given["unit"])
        size = spread_estimate(document, owner, given) or estimated(given, mark)
        rows.append((owner if owner != effect else "", name, size))
        effect = owner
    whose = "Parameters" if document.get("decided", True) else f"Parameters of the {set_out(document)}"
    units = explained({given["unit"] for given in answer["parameters"].values()})
    return TextTable(
        f"{whose} ± one standard deviation{units}", ("effect", "parameter", "estimate"), tuple(rows)
    )


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
    head = f"Gap, {_IN_BRACKETS}"
    return TextTable(head, ("run", "before", "after"), tuple(rows), right=("before", "after"))


def waterfall_table(document: Document) -> TextTable:
    """How far the gap closes with each cause, and without each; a table without rows where no cause is named."""
    steps, without = document.get("waterfall", ()), document.get("without", {})
    rows = []
    for step in steps if len(steps) > 1 else ():
        alone = misfit_text(document, without[step["effect"]]) if step["effect"] in without else ""
        name = answer_name(step["effect"]) if step["effect"] else "nominal model"
        rows.append((name, misfit_text(document, step["excess"]), alone))
    title = f"Gap {document.get('waterfall_on', '')} as the causes are added, {_IN_BRACKETS}"
    heads = ("added", "left", "left without it alone")
    return TextTable(title, heads, tuple(rows), heads[1:])


def closable_table(document: Document) -> TextTable:
    """Share that each kind could explain, in per cent, the named kind first.

    A table without rows where nothing remains beyond chance.
    """
    found, chosen = document.get("closable") or {"ceilings": ()}, settings_of(document).remainder
    ceilings = sorted(map(ceiling, found["ceilings"]), key=lambda one: one.kind != found.get("kind"))
    rows = [
        (
            KINDS[one.kind],
            percent(max(one.closed, 0.0), one.std) if one.determined(chosen) else "not determined",
            one.held_out,
        )
        for one in ceilings
    ]
    title = "Share of what is left that each kind could close, estimated without a formula"
    return TextTable(title, ("by", "share", "held out"), tuple(rows), ("share",))


def coefficients_table(document: Document) -> TextTable:
    """The coefficients of the nominal model before and after the causes are added, and how their sizes change."""
    rows = []
    before, after = document["coefficients"]["before"], document["coefficients"]["after"]
    for name in before:
        if name in after:
            one, two = before[name], after[name]
            known = all(given.get("determined", True) for given in (one, two))
            moved = size_change(one["value"], two["value"]) if known and one["value"] else "–"
            rows.append((coefficient_label(name, one["unit"]), estimated(one), estimated(two), moved))
    skewed = any(given.get("interval") for given in after.values())
    title = "Coefficients ± one standard deviation" + " (central 95 %)" * skewed
    return TextTable(title, ("", "before", "after", "change of size"), tuple(rows), ("change of size",))


SOURCES = {
    "noise": "noise of the readings",
    "misfit": "what the model leaves unexplained",
    "small causes": "small causes that are not named",
    "hidden effects": "effects that could hide",
    "air density": "rounding of the stated air density",
    "unseen form": "form of the cause that no free decay shows",
    "freed form": "freedom of the causes' forms",
    "rivals": "other answers, by their probability",
}
"""The sources of a coefficient's variance."""
_MOST = 0.5  # of a variance: more than all its other sources together
_COUNTS = 0.005  # of a variance: a smaller share changes no digit of its root


def coefficients_line(document: Document) -> str:
    """Contributions to the coefficients' standard deviations that those of ``identify`` do not include.

    Empty where none is known.
    """
    after = {name: one for name, one in document["coefficients"]["after"].items() if one["std"]}
    if not after:
        return ""
    parts = []
    for source, words in SOURCES.items():
        shares = {name: given.get("shares", {}).get(source, 0.0) for name, given in after.items()}
        if max(shares.values()) >= _COUNTS:
            mostly = listed(
                [COEFFICIENTS.get(name, name) for name, share in shares.items() if share > _MOST] or [""]
            )
            parts.append(f"{words} (most of that of {mostly})" if mostly else words)
    if not parts:
        return ""
    return (
        f"± includes {listed(parts)}. tunnel identify includes the noise, the scatter between runs and what its "
        "own model misses, so that its ± may be far smaller or larger."
    )


def hidden_table(document: Document) -> TextTable:
    """The effects that could hide: the largest size that the runs do not exclude, and the moves it makes."""
    hidden, rows = document.get("hidden", ()), []
    names = [name for name in document["coefficients"]["after"] if hidden and name in hidden[0]["moves"]]
    for one in hidden:
        size = f"{significant(one['size']['value'], 2)} {unit_mark(one['size']['unit'])}"
        moves = [significant(one["moves"][name]["value"], 2) for name in names]
        rows.append((plain(one["effect"]), size, *moves))
    heads = [f"moves {coefficient_label(name, hidden[0]['moves'][name]['unit'])} by" for name in names]
    title = f"What could hide{explained({one['size']['unit'] for one in hidden})}"
    return TextTable(title, ("effect", "up to", *heads), tuple(rows), ("up to", *heads))


def patch_table(document: Document) -> TextTable:
    """The changes of the patch; a table without rows where no model was given."""
    model = document.get("model") or {"written": (), "file": ""}
    rows = []
    for one in model["written"]:
        mark = "" if one["unit"] == "1" else unit_mark(one["unit"])
        rows.append((one["name"], _numbers(one["before"]), _numbers(one["after"]), mark))
    heads = ("", "before", "after", "")
    return TextTable(f"Changes to {model['file']}", heads, tuple(rows), ("before", "after"))


def _numbers(values: list[float]) -> str:
    last = max((i for i, value in enumerate(values) if value), default=0)
    return " ".join(significant(value, 4) for value in values[: last + 1])


def diagnosis_parts(document: Document) -> list[str | TextTable]:
    """The printed parts of a diagnosis, in order."""
    return [
        str(document["verdict"]),
        where_line(document),
        *rival_lines(document),
        candidates_table(document),
        parameters_table(document),
        inclusion_line(document),
        "" if repeats(document) else repeatability_line(document),
        repeatability_table(document),
        waterfall_table(document),
        closable_line(document),
        closable_table(document),
        coefficients_table(document),
        coefficients_line(document),
        patch_table(document),
        *patch_lines(document),
        *closing_lines(document),
    ]


def diagnosis_brief(document: Document) -> str:
    """An answer in three lines: its causes, its gap, and the next step."""
    gap, first = document["gap"], document["candidates"][0]
    causes = document["causes"]
    named = named_answer(causes).lower() if causes else "no gap"
    decided = document.get("decided", True)
    undecided = "" if decided else f"undecided, the {set_out(document)} is "
    misfit, excess = misfit_of(document), gap["excess_before"]
    size = f"{held_out_excess(excess)} times the noise power"
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
    """The place of the gap, in a line; empty where the document does not give one."""
    words = document["where"]["words"]
    return f"Where: {words}" if words else ""


def listed_answers(document: Document) -> int:
    """Number of the answers that are listed: the probable ones, at least three."""
    least = settings_of(document).words.answer_described
    probable = [c for c in document["candidates"] if c["probability"] >= least]
    return max(3, len(probable))


def other_answers(document: Document) -> str:
    """The answers that are not listed, in words; empty where all are."""
    probabilities = [c["probability"] for c in ranked(document)[listed_answers(document) :]]
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
    listed = [name for name, value in found if value >= least]
    last = scattering(listed)  # scatter is common to every answer
    likely = dict(found)
    shown = [f"{name} {probability(likely[name])}" for name in [n for n in listed if n not in last] + last]
    return f"Among the causes, with probability: {', '.join(shown)}" if shown else ""


def patch_lines(document: Document) -> list[str]:
    """The share of the gap that the patched model closes, and its differences; none without a model."""
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
    zero = f"{'−' if model['zero_rad'] < 0.0 else '+'} {reading_shown(abs(model['zero_rad']), 3)}"
    reading = f"The reading is the position of {model['joint']} {zero}."
    return [f"{said} {reading}", *(f"- {note}" for note in model["notes"])]


def closing_lines(document: Document) -> list[str]:
    """Notes below the tables: noise, check by MuJoCo, meaning of the coefficients, caveats and blind spots."""
    noise, note = document["noise"], document["coefficients"]["note"]
    unit = unit_of(document)
    size = f"{reading_shown(noise['std'], 3, unit)} (noise_std = {noise['std']:.3g} {unit_mark(unit)})"
    lines = [f"Noise: {size}, {noise['source']} ({noise['reason']})"]
    checked = document["confirmation"]
    if checked["agrees"]:
        apart = reading_shown(checked["largest_difference_rad"], 2, unit)
        lines.append(f"The gaps are computed by the MuJoCo model, which agrees with the fits within {apart}")
    lines += [line for line in (trade_off_line(document, COEFFICIENTS), hidden_line(document)) if line]
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
            by = f"{significant(move['value'], 2)} {'' if given['unit'] == '1' else unit_mark(given['unit'])}"
            moved.append(f"{COEFFICIENTS.get(name, name)} by {by.strip()}")
    if not moved:
        return ""
    mark = "" if first["size"]["unit"] == "1" else unit_mark(first["size"]["unit"])
    size = f"{significant(abs(first['size']['value']), 2)} {mark}".strip()
    return (
        f"What could hide: {plain(first['effect'])} of up to {size}{explained({first['size']['unit']})}, which "
        f"these runs do not exclude, would move {' and '.join(moved)}. The intervals allow for it."
    )
