"""The words and numbers of the report, formatted from the document."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from diagnosis.names import plain
from diagnosis.policy import LISTED_PROBABILITY
from diagnosis.printing import held_out_excess, run_words
from identification.printing import (
    UNDETERMINED,
    at_bound,
    coefficient_label,
    significant,
    unit_mark,
    with_std,
)
from tunnel_sim.effects import effect_class, known_effects
from tunnel_sim.vocabulary.campaign import Campaign

Document = Mapping[str, Any]
UNDETERMINED_PLACE = "cannot be determined from these runs"
CONDITIONS = {"always": "with or without wind", "wind_on": "only with the wind on", None: UNDETERMINED_PLACE}


@dataclass(frozen=True)
class Fact:
    """A figure at the head of the page."""

    label: str
    value: str
    note: str = ""


def headline(document: Document) -> tuple[str, str]:
    """The answer in a few words, and its kind for the page's colour.

    Returns:
        Words, and one of ``none``, ``unknown``, ``open``, ``found``.
    """
    causes = document["causes"]
    if not causes:
        return "No gap", "none"
    if not document.get("decided", True):
        common = document["common"]
        known = (
            [plain(*common["effects"])]
            if common["effects"]
            else [f"the {name}" for name in common["channels"]]
        )
        return f"Undecided: {' and '.join(known)}, and more" if known else "Undecided", "open"
    if causes == ["unknown"]:
        return "Unexplained gap", "unknown"
    names = plain(*causes)
    if document["ambiguous_with"]:
        return f"{names}, or {' or '.join(plain(n) for n in document['ambiguous_with'])}", "open"
    if (document.get("rest") or {}).get("material"):
        return f"{names}, in part", "open"
    return names, "found"


def facts(document: Document) -> list[Fact]:
    """The figures at the head of the page."""
    gap, where = document["gap"], document["where"]
    decided = document.get("decided", True)
    added = "the causes" if decided else "the most probable answer"
    listed = [Fact("Gap of the nominal model", excess(gap["excess_before"]), "noise variances")]
    if document["causes"] and document["causes"] != ["unknown"]:
        after = Fact(f"With {added} added", excess(gap["excess_after"]), gap["after_on"])
        listed += [after, Fact("Share closed", percent(gap["closed"]), gap["closed_on"])]
    if document["causes"]:
        listed += [
            Fact("Channel", where["channel"] or UNDETERMINED_PLACE),
            Fact("Condition", CONDITIONS.get(where["condition"], str(where["condition"]))),
        ]
    if document["candidates"]:
        first = document["candidates"][0]
        whose = "answer" if decided else "most probable answer"
        listed.append(Fact(f"Probability of the {whose}", percent(first["probability"])))
    return listed


def percent(value: float) -> str:
    """A share as a percentage.

    Args:
        value: 0 to 1, a fraction.

    Returns:
        Text such as ``98.3 %``; shares close to 0 or 1 are given as bounds.
    """
    if value > 0.9995:
        return "> 99.9 %" if value < 1.0 else "100 %"
    if value < 0.0005:
        return "< 0.1 %" if value > 0.0 else "0 %"
    return f"{100.0 * value:.1f} %"


def excess(value: float) -> str:
    """An excess, which has no meaning below a thousandth of the noise power.

    Args:
        value: in noise variances, a ratio.

    Returns:
        Three significant digits, or three decimals where it is small.
    """
    return minus(f"{value:.3f}" if abs(value) < 1.0 else significant(value, 3))


def minus(text: str) -> str:
    """A number's text with a minus sign in place of a leading hyphen."""
    return "−" + text[1:] if text.startswith("-") else text


def candidate_rows(document: Document) -> list[dict[str, Any]]:
    """The probable answers, at least three, formatted."""
    return [
        {
            "name": plain(c["effect"]),
            "probability": percent(c["probability"]),
            "closed": "–" if c["effect"] in ("none", "unknown") else percent(c["closed"]),
            "excess": excess(c["excess_after"]),
            "parameters": [(plain(n).replace(".", ": "), estimate(v)) for n, v in c["parameters"].items()],
        }
        for c in document["candidates"][: _listed(document)]
    ]


def others(document: Document) -> str:
    """The answers that are not listed, in words; empty where all are."""
    probabilities = [c["probability"] for c in document["candidates"][_listed(document) :]]
    if not probabilities:
        return ""
    count = (
        "1 more answer has" if len(probabilities) == 1 else f"{len(probabilities)} more answers have together"
    )
    each = "" if len(probabilities) == 1 else f", none of them more than {percent(max(probabilities))}"
    return f"{count} a probability of {percent(sum(probabilities))}{each}. The JSON document lists all."


def _listed(document: Document) -> int:
    probable = [c for c in document["candidates"] if c["probability"] >= LISTED_PROBABILITY]
    return max(3, len(probable))


def estimate(values: Document) -> str:
    """A value with its standard deviation and unit.

    Args:
        values: ``value``, ``std`` and ``unit``.

    Returns:
        Text such as ``0.00401 ± 0.00002 N m``.
    """
    if not values.get("determined", True):
        return UNDETERMINED
    unit = str(values.get("unit", ""))
    return f"{_number(values)} {'' if unit == '1' else unit_mark(unit)}".strip().replace(" ", "\u00a0")


def _number(values: Document) -> str:
    if not values.get("determined", True):
        return UNDETERMINED
    if values["std"]:
        return minus(with_std(values["value"], values["std"]))
    return minus(significant(values["value"], 5)) + (" (held)" if values["std"] == 0.0 else at_bound(values))


def cause_paragraphs(document: Document) -> list[dict[str, Any]]:
    """What the vocabulary says of every cause and its rivals.

    Returns:
        Name, equation, signature, channel, condition and references of each.
    """
    paragraphs = []
    known = {kind.name for kind in known_effects()}
    for name in [*document["causes"], *document["ambiguous_with"]]:
        if name not in known:
            continue
        kind = effect_class(name)
        paragraphs.append(
            {
                "name": plain(name),
                "meaning": (kind.__doc__ or "").split("\n")[0],
                "equation": kind.equation,
                "signature": kind.signature,
                "where": f"{kind.channel}, {CONDITIONS[kind.condition]}",
                "references": kind.references,
            }
        )
    return paragraphs


def coefficient_rows(document: Document) -> list[dict[str, str]]:
    """The coefficients before and after.

    Returns:
        Symbol with unit, both estimates and the 95 % interval after.
    """
    before, after = document["coefficients"]["before"], document["coefficients"]["after"]
    return [
        {
            "label": coefficient_label(name, (before.get(name) or after[name])["unit"]),
            "before": _number(before[name]) if name in before else "–",
            "after": _number(after[name]) if name in after else "–",
            "interval": _interval95(after.get(name) or before[name]),
        }
        for name in [*before, *(n for n in after if n not in before)]
    ]


def _interval95(values: Document) -> str:
    """The interval, to as many digits as its width deserves."""
    if not values["std"]:
        return "–"
    reach = 1.96 * values["std"]
    width = with_std(values["value"], reach).partition("± ")[2]
    places = len(width.partition(".")[2])
    ends = values.get("interval") or (values["value"] - reach, values["value"] + reach)
    texts = [
        significant(end) if not width.replace(".", "").isdigit() else f"{end:.{places}f}" for end in ends
    ]
    return " to ".join(map(minus, texts))


def next_steps(document: Document) -> list[str]:
    """What to do next, in the order in which to do it."""
    causes, rest = document["causes"], document.get("rest") or {}
    steps = [
        f"{', '.join(remark['runs']) or 'The campaign'}: {remark['remedy']}."
        for remark in document.get("remarks", ())
        if remark["outcome"] != "noted"
    ]
    if document["next_run"] is not None and document["ambiguous_with"]:
        steps.append(
            f"Make the run that distinguishes the answers: {run_words(document['next_run'])}. "
            "Add it to the campaign and diagnose again."
        )
    if not causes:
        return [*steps, "Use the coefficients of the nominal model, within their intervals."]
    if not document.get("decided", True):
        steps.append(
            "Add runs with other springs, wind speeds and release angles, and diagnose again: no answer has a "
            "probability of one half."
        )
        steps.append(
            "Do not repair the rig on this answer, and do not rely on the coefficients of any one cause."
        )
    elif causes == ["unknown"]:
        steps.append("Read where the model departs from the runs, and examine the rig there.")
        steps.append("State the effect that you suspect in a file, and diagnose again with --effects-file.")
    else:
        steps.append(
            f"Repair the rig ({plain(*causes)}), measure again, and compare the two diagnoses (tunnel compare)."
        )
        steps.append("Until then use the coefficients with the causes, not those of the nominal model.")
    if rest.get("material"):
        steps.append(
            "Do not trust the coefficients beyond their intervals: what remains of the gap moves them."
        )
    return steps


def next_run_rows(document: Document) -> list[tuple[str, str]]:
    """The run expected to distinguish the rivals.

    Returns:
        Labels and values; empty where none is proposed.
    """
    run = document["next_run"] or {}
    units = {
        "spring_stiffness": "N m/rad",
        "wind_speed": "m/s",
        "release_angle": "rad",
        "duration": "s",
        "separation": "standard deviations of the noise, expected",
    }
    return [
        (plain(name).capitalize(), f"{significant(value, 3)} {units.get(name, '')}".strip())
        for name, value in run.items()
        if isinstance(value, int | float)
    ]


def place_rows(document: Document) -> list[tuple[str, str]]:
    """Where the gap is, field by field."""
    where = document["where"]
    return [
        ("Runs that show it", ", ".join(where["runs"]) or "–"),
        ("Time", interval(where["time_s"], "s")),
        ("Amplitude", interval(where["amplitude_rad"], "rad")),
        ("Frequency", interval(where["frequency_hz"], "Hz")),
        ("Channel", where["channel"] or UNDETERMINED_PLACE),
        ("Condition", CONDITIONS.get(where["condition"], str(where["condition"]))),
    ]


def interval(values: list[float] | None, unit: str) -> str:
    """An interval in words.

    Args:
        values: its ends, or None.

    Returns:
        Text such as ``0.00 to 4.20 s``; a dash where there is none.
    """
    if values is None:
        return "–"
    return f"{significant(values[0], 3)} to {significant(values[1], 3)} {unit}"


def step_rows(document: Document) -> list[dict[str, str]]:
    """The gap as the causes are added.

    Returns:
        What is added, what is left, and what is left without it alone; none where no cause is named.
    """
    steps, without = document.get("waterfall", []), document.get("without", {})
    return [
        {
            "name": plain(step["effect"] or "nominal model"),
            "left": minus(held_out_excess(step["excess"])),
            "without": minus(held_out_excess(without[step["effect"]])) if step["effect"] in without else "",
        }
        for step in (steps if len(steps) > 1 else ())
    ]


def run_rows(document: Document, campaign: Campaign) -> list[dict[str, str]]:
    """Every run with its conditions and excess before and after.

    Returns:
        Formatted rows in the campaign's order.
    """
    gap = {run["id"]: run for run in document["gap"]["runs"]}
    rows = []
    for run in campaign.runs:
        excesses = gap.get(run.id)
        rows.append(
            {
                "id": run.id,
                "spring": "–" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
                "wind": f"{run.wind_speed:g}" if run.wind_on else "off",
                "duration": f"{run.record.duration:.3g}",
                "rate": f"{run.record.sample_rate:.4g}",
                "before": "–" if excesses is None else excess(excesses["before"]),
                "after": "–" if excesses is None else excess(excesses["after"]),
                "named": "yes" if run.id in document["where"]["runs"] else "",
            }
        )
    return rows


def line_rows(document: Document) -> list[dict[str, str]]:
    """Narrow lines in the residuals.

    Returns:
        Run, frequency, amplitude and share, formatted.
    """
    return [
        {
            "run": line["run"],
            "frequency": significant(line["frequency_hz"], 4),
            "amplitude": significant(1e3 * line["amplitude_rad"], 2),
            "share": percent(min(line["share"], 1.0)),
        }
        for line in (document.get("maps") or {}).get("lines", [])
    ]
