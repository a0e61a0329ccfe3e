"""The words and numbers of the report, formatted from the document."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from diagnosis.closure import misfit_of, of_swing, rms_shown, unit_shown
from diagnosis.policy import LISTED_PROBABILITY
from diagnosis.printing import misfit_text, noise_powers, plain, probability, share
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
WITHIN_THE_NOISE = "within the noise"
"""What is left where it is not significant, in the words of the verdict."""
CONDITIONS = {"always": "with or without wind", "wind_on": "only with the wind on", None: UNDETERMINED_PLACE}


CHANNELS = {
    "stiffness": "the restoring moment",
    "damping": "the damping",
    "forcing": "an imposed moment",
    "sensor": "the reading",
    "calibration": "a stated value",
}
_POWER = re.compile(r"(?<=[\d)])e([+-]\d+)\b")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_VISIBLE = 0.005  # of a damping ratio: a change that is said
_VISIBLE_FREQUENCY = 5e-5  # as a fraction, likewise


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


def verdict_words(document: Document) -> str:
    """The verdict, with minus signs and powers of ten."""
    return typeset(str(document["verdict"]))


def facts(document: Document) -> list[Fact]:
    """The figures at the head of the page, each in the form in which the verdict states it."""
    gap = document["gap"]
    decided = document.get("decided", True)
    added = "the causes" if decided else "the most probable answer"
    before = misfit_fact(document, "Misfit of the nominal model", gap["excess_before"])
    if not document["causes"]:
        before = Fact(before.label, WITHIN_THE_NOISE, times_noise(gap["excess_before"]))
    listed = [before]
    if document["causes"] and document["causes"] != ["unknown"]:
        after = misfit_fact(document, f"With {added} added", gap["excess_after"], left=True)
        if _calm(document):
            after = Fact(after.label, WITHIN_THE_NOISE, noise_powers(gap["excess_after"]))
        listed += [after, Fact("Share of the gap closed", percent(gap["closed"]), gap["closed_on"])]
    if document["candidates"]:
        first = document["candidates"][0]
        whose = "answer" if decided else "most probable answer"
        listed.append(Fact(f"Probability of the {whose}", probability(first["probability"])))
    return listed


def _calm(document: Document) -> bool:
    """Whether what remains is stated to be within the noise."""
    return (document.get("rest") or {}).get("significant") is False


def misfit_fact(document: Document, label: str, value: float, *, left: bool = False) -> Fact:
    """A gap in the units that people use, and in noise powers beside them.

    Args:
        label: of the figure.
        value: the gap as an excess, in noise variances, a ratio.
        left: whether it is what is left with the causes.
    """
    misfit = misfit_of(document)
    powers = typeset(noise_powers(value)) if left else times_noise(value)
    if misfit is None:
        return Fact(label, powers)
    return Fact(label, rms_shown(misfit, value), f"root mean square; {of_swing(misfit, value)}; {powers}")


def times_noise(value: float) -> str:
    """A gap against the noise, as the verdict states it.

    Args:
        value: the gap as an excess, in noise variances, a ratio.
    """
    text = significant(value, 4) if value >= 10.0 else f"{value:.{3 if abs(value) < 0.1 else 2}f}"
    return f"{typeset(text)} times the noise power"


def misfit_shown(document: Document, value: float) -> str:
    """A gap as a root mean square; in noise powers for a document without ``misfit``.

    Args:
        value: the gap as an excess, in noise variances, a ratio.
    """
    misfit = misfit_of(document)
    return times_noise(value) if misfit is None else rms_shown(misfit, value)


def windy(document: Document) -> bool:
    """Whether any run had wind; True where the document does not say."""
    runs = (document.get("maps") or {}).get("runs")
    return not runs or any(run["wind_speed"] > 0.0 for run in runs)


def acts_on(document: Document, effect: str) -> str:
    """What an effect acts on and when, such as ``the damping, with or without wind``; empty for an unknown one."""
    if effect not in {kind.name for kind in known_effects()}:
        return ""
    kind = effect_class(effect)
    return f"{CHANNELS[kind.channel]}{f', {CONDITIONS[kind.condition]}' if windy(document) else ''}"


def causes_found(document: Document) -> list[dict[str, Any]]:
    """Every cause of the answer with its size.

    Returns:
        Name, what it acts on, its parameters, what it does to a swing, and what its addition closes.
    """
    if document["causes"] in ([], ["unknown"]):
        return []
    answer = document["candidates"][0]
    names = answer["effect"].split(" + ")
    sizes = {size["effect"]: size for size in document.get("sizes", ())}
    steps = {step["effect"]: (old, step) for old, step in pairwise(document.get("waterfall", ()))}
    found = []
    for name in names:
        mine = {
            plain(full.rpartition(".")[2]): estimate(value)
            for full, value in answer["parameters"].items()
            if full.partition(".")[0] == name or len(names) == 1
        }
        old, new = steps.get(name, (None, None))
        closes = "" if new is None else f"{_left(document, old)} to {_left(document, new)}"
        found.append(
            {
                "name": plain(name),
                "acts": acts_on(document, name),
                "parameters": list(mine.items()),
                "does": size_words(document, sizes[name]) if name in sizes else "",
                "closes": closes,
            }
        )
    return found


def _left(document: Document, step: Document) -> str:
    """What a step of the waterfall leaves."""
    last = step["effect"] == document["waterfall"][-1]["effect"]
    return WITHIN_THE_NOISE if last and _calm(document) else misfit_shown(document, step["excess"])


def size_words(document: Document, size: Document) -> str:
    """What a cause does to a swing, in a sentence.

    Args:
        size: an entry of ``sizes``.

    Returns:
        Its damping and frequency where the cause changes them visibly, its zero and its reading.
    """
    mark, factor = unit_shown((document.get("maps") or {}).get("unit", "rad"))
    angle = unit_shown("rad")[1]
    said = []
    zeta, without = size["damping_ratio"], size["damping_ratio_without"]
    if abs(zeta - without) > _VISIBLE * max(abs(zeta), abs(without)):
        said.append(f"damping ratio {significant(without, 3)} becomes {significant(zeta, 3)}")
    if abs(size["frequency_change"]) > _VISIBLE_FREQUENCY:
        change = 100.0 * size["frequency_change"]
        said.append(f"frequency {'+' if change > 0.0 else ''}{significant(change, 2)} %")
    reading = factor * size["reading_change"]
    if abs(size["zero_change"]) > 0.5 * size["reading_change"]:
        said.append(f"the middle moves by {significant(factor * size['zero_change'], 2)}{_spaced(mark)}")
    said.append(f"the reading changes by {significant(reading, 2)}{_spaced(mark)} root mean square")
    held = angle * size["stands_rad"]
    stands = f"; it stops the body up to {significant(held, 2)}° from rest" if held > 0.0 else ""
    amplitude = significant(angle * size["amplitude_rad"], 2)
    return typeset(f"Over three cycles from {amplitude}°: {', '.join(said)}{stands}")


def _spaced(mark: str) -> str:
    return mark if mark == "°" else f" {mark}"


def typeset(text: str) -> str:
    """A text in which numbers have a minus sign in place of a leading hyphen, and powers of ten."""
    text = re.sub(r"(?<![\w.])-(?=\d)", "−", text)
    return _POWER.sub(lambda found: f" × 10{str(int(found[1])).translate(_RAISED)}", text)


def percent(value: float) -> str:
    """A share as a percentage, as the terminal prints it.

    Args:
        value: at most 1, a fraction.

    Returns:
        Text such as ``98.3 %``; shares close to 0 or 1 are given as bounds.
    """
    return minus(share(value))


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
            "probability": probability(c["probability"]),
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
    together, most = (
        probability(value).replace("<", "less than") for value in (sum(probabilities), max(probabilities))
    )
    least = f", each of them {most}" if most.startswith("less") else f", none of them more than {most}"
    each = "" if len(probabilities) == 1 or most == together else least
    return f"{count} a probability of {together}{each}. The JSON document lists all."


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
                "where": acts_on(document, name),
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


def place_rows(document: Document) -> list[tuple[str, str]]:
    """Where the gap is, field by field."""
    where = document["where"]
    return [
        ("Runs that show it", ", ".join(where["runs"]) or "–"),
        ("Time", interval(where["time_s"], "s")),
        ("Amplitude", interval(where["amplitude_rad"], "°", unit_shown("rad")[1])),
        ("Frequency", interval(where["frequency_hz"], "Hz")),
        ("Channel", where["channel"] or UNDETERMINED_PLACE),
        *(
            [("Condition", CONDITIONS.get(where["condition"], str(where["condition"])))]
            if windy(document)
            else ()
        ),
    ]


def interval(values: list[float] | None, unit: str, factor: float = 1.0) -> str:
    """An interval in words.

    Args:
        values: its ends, or None.
        factor: on the ends, to have them in ``unit``; dimensionless.

    Returns:
        Text such as ``0.00 to 4.20 s``; a dash where there is none.
    """
    if values is None:
        return "–"
    low, high = (significant(factor * value, 3) for value in values)
    return f"{low} to {high}{_spaced(unit)}"


def step_rows(document: Document) -> list[dict[str, str]]:
    """The gap as the causes are added.

    Returns:
        What is added, what is left, and what is left without it alone; none where no cause is named.
    """
    steps, without = document.get("waterfall", []), document.get("without", {})
    return [
        {
            "name": plain(step["effect"] or "nominal model"),
            "left": _gap(document, step["excess"]),
            "without": _gap(document, without.get(step["effect"])),
        }
        for step in (steps if len(steps) > 1 else ())
    ]


def _gap(document: Document, value: float | None) -> str:
    """A gap in words; empty for none."""
    return "" if value is None else typeset(misfit_text(document, value))


def run_rows(document: Document, campaign: Campaign) -> list[dict[str, str]]:
    """Every run with its conditions and excess before and after.

    Returns:
        Formatted rows in the campaign's order.
    """
    gap = {run["id"]: run for run in document["gap"]["runs"]}
    rows = []
    for run in campaign.runs:
        excesses = gap.get(run.id, {})
        rows.append(
            {
                "id": run.id,
                "spring": "–" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
                "wind": f"{run.wind_speed:g}" if run.wind_on else "off",
                "duration": f"{run.record.duration:.3g}",
                "rate": f"{run.record.sample_rate:.4g}",
                "before": _gap(document, excesses.get("before")) or "–",
                "after": _gap(document, excesses.get("after")) or "–",
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
