"""The tables of a diagnosis, from its document."""

from __future__ import annotations

from diagnosis.settings import settings_of
from diagnosis.words.names import KINDS, Document, plain
from diagnosis.words.numbers import misfit_text, percent, probability, share
from diagnosis.words.remainder import ceiling
from identification.printing import TextTable, coefficient_label, estimated, significant, unit_mark


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


def closable_table(document: Document) -> TextTable:
    """Share that each kind could close, in per cent; a table without rows where nothing remains beyond chance."""
    found, chosen = document.get("closable") or {"ceilings": ()}, settings_of(document).remainder
    rows = [
        (
            KINDS[one.kind],
            percent(max(one.closed, 0.0), one.std) if one.determined(chosen) else "not determined",
            one.held_out,
        )
        for one in map(ceiling, found["ceilings"])
    ]
    title = "Share of what is left that could be closed at most"
    return TextTable(title, ("by", "share", "held out"), tuple(rows), ("share",))


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


def patch_table(document: Document) -> TextTable:
    """What the patch changes; a table without rows where no model was given."""
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
