"""The words and numbers of the report, formatted from the document, and what to do next."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from diagnosis.closure import misfit_of, of_swing, rms_shown, unit_shown
from diagnosis.printing import misfit_text, noise_powers, plain, probability, run_words, share
from diagnosis.settings import settings_of
from identification.printing import (
    UNDETERMINED,
    at_bound,
    coefficient_label,
    significant,
    unit_mark,
    with_std,
)
from tunnel_sim.effects import known_effects
from tunnel_sim.vocabulary.campaign import Campaign

Document = Mapping[str, Any]
WITHIN_THE_NOISE = "within the noise"
"""What is left where it is not significant, in the words of the verdict."""
_UNDETERMINED_PLACE = "cannot be determined from these runs"
_CONDITIONS = {
    "always": "with or without wind",
    "wind_on": "only with the wind on",
    None: _UNDETERMINED_PLACE,
}
_CHANNELS = {
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
    """The answer in a few words, and its kind: one of ``none``, ``unknown``, ``open``, ``found``."""
    causes = document["causes"]
    if not causes:
        return "No gap", "none"
    if not document.get("decided", True):
        effects, channels = document["common"]["effects"], document["common"]["channels"]
        known = plain(*effects) if effects else " and ".join(f"the {name}" for name in channels)
        return f"Undecided: {known}, and more" if known else "Undecided", "open"
    if causes == ["unknown"]:
        return "Unexplained gap", "unknown"
    names = plain(*causes)
    if document["ambiguous_with"]:
        return f"{names}, or {' or '.join(plain(n) for n in document['ambiguous_with'])}", "open"
    if (document.get("rest") or {}).get("material"):
        return f"{names}, in part", "open"
    return names, "found"


def facts(document: Document) -> list[Fact]:
    """The figures at the head of the page, each in the form in which the verdict states it."""
    gap, causes = document["gap"], document["causes"]
    decided = document.get("decided", True)
    before, after = gap["excess_before"], gap["excess_after"]
    label = "Misfit of the nominal model"
    if causes:
        listed = [_misfit_fact(document, label, before, times_noise(before))]
    else:
        listed = [Fact(label, WITHIN_THE_NOISE, times_noise(before))]
    if causes and causes != ["unknown"]:
        label = f"With {'the causes' if decided else 'the most probable answer'} added"
        if _calm(document):
            listed.append(Fact(label, WITHIN_THE_NOISE, noise_powers(after)))
        else:
            listed.append(_misfit_fact(document, label, after, typeset(noise_powers(after))))
        listed.append(Fact("Share of the gap closed", percent(gap["closed"]), gap["closed_on"]))
    if document["candidates"]:
        whose = "answer" if decided else "most probable answer"
        first = document["candidates"][0]["probability"]
        listed.append(Fact(f"Probability of the {whose}", probability(first)))
    return listed


def _calm(document: Document) -> bool:
    """Whether what remains is stated to be within the noise."""
    return (document.get("rest") or {}).get("significant") is False


def _misfit_fact(document: Document, label: str, value: float, powers: str) -> Fact:
    """A gap in the units that people use, and in noise powers beside them."""
    misfit = misfit_of(document)
    if misfit is None:
        return Fact(label, powers)
    return Fact(label, rms_shown(misfit, value), f"root mean square; {of_swing(misfit, value)}; {powers}")


def times_noise(value: float) -> str:
    """A gap in noise variances (a ratio), as the verdict states it."""
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
    kind = {kind.name: kind for kind in known_effects()}.get(effect)
    if kind is None:
        return ""
    return f"{_CHANNELS[kind.channel]}{f', {_CONDITIONS[kind.condition]}' if windy(document) else ''}"


def causes_found(document: Document) -> list[dict[str, Any]]:
    """Every cause of the answer with its size.

    Returns:
        Name, what it acts on, its parameters, what it does to a swing, and what its addition closes.
    """
    if document["causes"] in ([], ["unknown"]):
        return []
    answer = document["candidates"][0]
    names = answer["effect"].split(" + ")
    does = {size["effect"]: size_words(document, size) for size in document.get("sizes", ())}
    steps = document.get("waterfall", ())
    left = [misfit_shown(document, step["excess"]) for step in steps]
    if steps and _calm(document):
        left[-1] = WITHIN_THE_NOISE
    closes: dict[str, str] = {}
    for step, (before, after) in zip(steps[1:], pairwise(left), strict=True):
        added = step["effect"].split(" + ")
        together = ", all together" if len(added) > 1 else ""
        closes |= dict.fromkeys(added, f"{before} to {after}{together}")
    return [
        {
            "name": plain(name),
            "acts": acts_on(document, name),
            "parameters": [
                (plain(full.rpartition(".")[2]), estimate(value))
                for full, value in answer["parameters"].items()
                if full.partition(".")[0] == name or len(names) == 1
            ],
            "does": does.get(name, ""),
            "closes": closes.get(name, ""),
        }
        for name in names
    ]


def size_words(document: Document, size: Document) -> str:
    """What a cause of ``sizes`` does to a swing, in a sentence; damping and frequency where they change visibly."""
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
    """A share (a fraction) such as ``98.3 %``; shares close to 0 or 1 are given as bounds."""
    return _minus(share(value))


def excess(value: float) -> str:
    """An excess in noise variances, to three significant digits, or three decimals where it is small."""
    return _minus(f"{value:.3f}" if abs(value) < 1.0 else significant(value, 3))


def _minus(text: str) -> str:
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
    together = probability(sum(probabilities)).replace("<", "less than")
    most = probability(max(probabilities)).replace("<", "less than")
    each = f", each of them {most}" if most.startswith("less") else f", none of them more than {most}"
    if len(probabilities) == 1:
        count, each = "1 more answer has", ""
    else:
        count = f"{len(probabilities)} more answers have together"
    words = f"{count} a probability of {together}{'' if most == together else each}."
    return f"{words} The JSON document lists all."


def _listed(document: Document) -> int:
    least = settings_of(document).words.answer_described
    probable = [c for c in document["candidates"] if c["probability"] >= least]
    return max(3, len(probable))


def estimate(values: Document) -> str:
    """A value with its standard deviation and unit, such as ``0.00401 ± 0.00002 N m``."""
    if not values.get("determined", True):
        return UNDETERMINED
    unit = str(values.get("unit", ""))
    return f"{_number(values)} {'' if unit == '1' else unit_mark(unit)}".strip().replace(" ", "\u00a0")


def _number(values: Document) -> str:
    if not values.get("determined", True):
        return UNDETERMINED
    if values["std"]:
        return _minus(with_std(values["value"], values["std"]))
    return _minus(significant(values["value"], 5)) + (" (held)" if values["std"] == 0.0 else at_bound(values))


def cause_paragraphs(document: Document) -> list[dict[str, Any]]:
    """What the vocabulary says of every cause and its rivals."""
    known = {kind.name: kind for kind in known_effects()}
    return [
        {
            "name": plain(name),
            "meaning": (known[name].__doc__ or "").split("\n")[0],
            "equation": known[name].equation,
            "signature": known[name].signature,
            "where": acts_on(document, name),
            "references": known[name].references,
        }
        for name in [*document["causes"], *document["ambiguous_with"]]
        if name in known
    ]


def coefficient_rows(document: Document) -> list[dict[str, str]]:
    """Symbol with unit, estimates before and after, and the 95 % interval of each coefficient."""
    before, after = document["coefficients"]["before"], document["coefficients"]["after"]
    rows = []
    for name in dict.fromkeys([*before, *after]):
        values, interval = after.get(name) or before[name], "–"
        if values["std"]:  # to as many digits as its width deserves
            reach = 1.96 * values["std"]
            width = with_std(values["value"], reach).partition("± ")[2]
            places = len(width.partition(".")[2]) if width.replace(".", "").isdigit() else None
            ends = values.get("interval") or (values["value"] - reach, values["value"] + reach)
            interval = " to ".join(
                _minus(significant(end) if places is None else f"{end:.{places}f}") for end in ends
            )
        rows.append(
            {
                "label": coefficient_label(name, (before.get(name) or after[name])["unit"]),
                "before": _number(before[name]) if name in before else "–",
                "after": _number(after[name]) if name in after else "–",
                "interval": interval,
            }
        )
    return rows


def place_rows(document: Document) -> list[tuple[str, str]]:
    """Where the gap is, field by field."""
    where, degree = document["where"], unit_shown("rad")[1]
    rows = [("Runs that show it", ", ".join(where["runs"]) or "–")]
    for label, key, factor, unit in (
        ("Time", "time_s", 1.0, " s"),
        ("Amplitude", "amplitude_rad", degree, "°"),
        ("Frequency", "frequency_hz", 1.0, " Hz"),
    ):
        ends = [significant(factor * value, 3) for value in where[key] or ()]
        rows.append((label, f"{' to '.join(ends)}{unit}" if ends else "–"))
    rows.append(("Channel", where["channel"] or _UNDETERMINED_PLACE))
    if windy(document):
        rows.append(("Condition", _CONDITIONS.get(where["condition"], str(where["condition"]))))
    return rows


def step_rows(document: Document) -> list[dict[str, str]]:
    """What is added, what is left, and what is left without it alone; none where no cause is named."""
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
    """Every run with its conditions and excess before and after, in the campaign's order."""
    gap = {run["id"]: run for run in document["gap"]["runs"]}
    return [
        {
            "id": run.id,
            "spring": "–" if run.spring_stiffness is None else f"{run.spring_stiffness:g}",
            "wind": f"{run.wind_speed:g}" if run.wind_on else "off",
            "duration": f"{run.record.duration:.3g}",
            "rate": f"{run.record.sample_rate:.4g}",
            "before": _gap(document, gap.get(run.id, {}).get("before")) or "–",
            "after": _gap(document, gap.get(run.id, {}).get("after")) or "–",
            "named": "yes" if run.id in document["where"]["runs"] else "",
        }
        for run in campaign.runs
    ]


def line_rows(document: Document) -> list[dict[str, str]]:
    """Narrow lines in the residuals."""
    return [
        {
            "run": line["run"],
            "frequency": significant(line["frequency_hz"], 4),
            "amplitude": significant(1e3 * line["amplitude_rad"], 2),
            "share": percent(min(line["share"], 1.0)),
        }
        for line in (document.get("maps") or {}).get("lines", [])
    ]


LEAST_SEPARATION = 3.0
"""Standard deviations between two answers below which a run does not distinguish them: odds of about 100:1."""


def run_to_make(document: Document) -> Document | None:
    """The run that distinguishes the answers; None where none is proposed, or the best one would not."""
    run: Document | None = document["next_run"]
    return run if run is not None and run["separation"] >= LEAST_SEPARATION else None


def unplannable(document: Document) -> str:
    """Why no run can be planned from these runs, in a sentence; empty where one can."""
    known = document["coefficients"]["before"]
    if not known:
        return "No run can be planned: the nominal model was not fitted to any run."
    if "omega_n" in known:
        return "No run can be planned, because no spring is stated: state spring_stiffness for every run."
    return ""


def next_steps(document: Document) -> list[str]:
    """What to do next, in the order in which to do it."""
    causes = document["causes"]
    steps = [
        f"{', '.join(remark['runs']) or 'The campaign'}: {remark['remedy']}."
        for remark in document.get("remarks", ())
        if remark["outcome"] != "noted"
    ]
    if (run := run_to_make(document)) is not None and document["ambiguous_with"]:
        words = f"Make the run that distinguishes the answers: {run_words(run)}."
        steps.append(f"{words} Add it to the campaign and diagnose again.")
    if not causes:
        return [*steps, "Use the coefficients of the nominal model, within their intervals."]
    if not document.get("decided", True):
        springs = not unplannable(document) and document.get("model") is None  # stated, and can be chosen
        kinds = ["springs"] * springs + ["wind speeds"] * windy(document) + ["release angles"]
        steps += [
            f"Add runs with other {plain(*kinds)}, and diagnose again: no answer has a probability of one half.",
            "Do not repair the rig on this answer, and do not rely on the coefficients of any one cause.",
        ]
    elif causes == ["unknown"]:
        steps += [
            "Read where the model departs from the runs, and examine the rig there.",
            "State the effect that you suspect in a file, and diagnose again with --effects-file.",
        ]
    else:
        known = {kind.name: kind.advice for kind in known_effects()}
        steps += [
            *(f"{known.get(name) or f'Repair or model what {plain(name)} stands for'}." for name in causes),
            "Measure again, and compare the two diagnoses (tunnel compare).",
            "Until then use the coefficients with the causes, not those of the nominal model.",
        ]
    if (document.get("rest") or {}).get("material"):
        steps.append(
            "Do not trust the coefficients beyond their intervals: what remains of the gap moves them."
        )
    return steps


def next_run_rows(document: Document) -> list[tuple[str, str]]:
    """Labels and values of the run expected to distinguish the rivals; empty where none is proposed."""
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
