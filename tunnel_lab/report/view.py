"""The rows and figures of the report, formatted from the document; its sentences are those of `diagnosis.words`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from diagnosis.words.answers import ranked, set_out
from diagnosis.words.causes import said_size
from diagnosis.words.numbers import (
    ACTS_WHEN,
    PLACES,
    Document,
    acts_on,
    beside_noise,
    left_over,
    misfit_of,
    misfit_shown,
    misfit_text,
    of_swing,
    plain,
    probability,
    reading_shown,
    rms_shown,
    share,
    times_noise,
    unit_of,
    unit_shown,
    windy,
)
from diagnosis.words.scatter import (
    BETWEEN_RUNS,
    SCATTERS,
    answer_name,
    scattering,
    spread_estimate,
    spreads_of,
    width_text,
    without_scatter,
)
from diagnosis.words.tables import listed_answers
from diagnosis.words.verdict import size_words
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

WITHIN_THE_NOISE = "within the noise"
"""What is left where it is not significant, in the words of the verdict."""
_UNDETERMINED_PLACE = "cannot be determined from these runs"
_POWER = re.compile(r"(?<=[\d)])e([+-]\d+)\b")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Fact:
    """A figure at the head of the page."""

    label: str
    value: str
    note: str = ""


def facts(document: Document) -> list[Fact]:
    """The figures at the head of the page, each in the form in which the verdict states it."""
    gap, causes = document["gap"], document["causes"]
    decided = document.get("decided", True)
    before, after = gap["excess_before"], gap["excess_after"]
    label = "Misfit of the nominal model"
    if causes:
        listed = [_misfit_fact(document, label, before, typeset(times_noise(before)))]
    else:
        listed = [Fact(label, WITHIN_THE_NOISE, f"residual {beside_noise(before)}, root mean square")]
    if causes and causes != ["unknown"]:
        label = f"With {'the causes' if decided else f'the {set_out(document)}'} added"
        if _calm(document):
            listed.append(Fact(label, WITHIN_THE_NOISE, left_over(after)))
        else:
            listed.append(_misfit_fact(document, label, after, typeset(left_over(after))))
        listed.append(Fact("Share of the gap closed", percent(gap["closed"]), gap["closed_on"]))
    if document["candidates"]:
        rivals = decided and document["ambiguous_with"]
        whose = "likeliest of these sets" if rivals else set_out(document)
        first = document["candidates"][0]["probability"]
        listed.append(Fact(f"Probability of the {whose}", probability(first)))
    return listed


def _calm(document: Document) -> bool:
    """Whether the residual gap is stated to be within the noise."""
    return (document.get("rest") or {}).get("significant") is False


def _misfit_fact(document: Document, label: str, value: float, powers: str) -> Fact:
    """A gap in customary units, with its power."""
    misfit = misfit_of(document)
    if misfit is None:
        return Fact(label, powers)
    return Fact(label, rms_shown(misfit, value), f"root mean square; {of_swing(misfit, value)}; {powers}")


def causes_found(document: Document) -> list[dict[str, Any]]:
    """Every cause of the answer with its size, and the scatter between runs last.

    Returns:
        Name, object acted on, parameters, effect on a swing, and the part of the gap explained by adding it.
    """
    if document["causes"] in ([], ["unknown"]):
        return []
    answer = document["candidates"][0]
    names = answer["effect"].split(" + ")
    does = {size["effect"]: typeset(size_words(document, size)) for size in document.get("sizes", ())}
    steps = document.get("waterfall", ())
    left = [typeset(misfit_shown(document, step["excess"])) for step in steps]
    if steps and _calm(document):
        left[-1] = WITHIN_THE_NOISE
    closes: dict[str, str] = {}
    for step, (before, after) in zip(steps[1:], pairwise(left), strict=True):
        added = step["effect"].split(" + ")
        together = ", all together" if len(added) > 1 else ""
        closes |= dict.fromkeys(added, f"{before} to {after}{together}")
    found = [
        {
            "name": plain(name),
            "acts": acts_on(document, name),
            "size": typeset(said_size(document, answer, name)),
            "parameters": [
                (plain(full.rpartition(".")[2]), estimate(value))
                for full, value in answer["parameters"].items()
                if full.partition(".")[0] == name or len(names) == 1
            ],
            "does": does.get(name, ""),
            "closes": closes.get(name, ""),
        }
        for name in without_scatter(names)
    ]
    if scatter := scattering(names):
        spreads = [one for one in spreads_of(document) if one["effect"] in scatter]
        widths = [(plain(SCATTERS[one["effect"]]), width_text(one)) for one in spreads]
        closed = closes.get(scatter[0], "").removesuffix(", all together")
        found.append(
            {
                "name": BETWEEN_RUNS,
                "acts": "by chance",
                "size": "",
                "parameters": widths,
                "does": "",
                "closes": closed,
            }
        )
    return found


def typeset(text: str) -> str:
    """A text whose numbers have minus signs instead of leading hyphens, and powers of ten."""
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
            "name": plain(answer_name(c["effect"])),
            "probability": probability(c["probability"]),
            "closed": "–" if c["effect"] in ("none", "unknown") else percent(c["closed"]),
            "excess": excess(c["excess_after"]),
            "parameters": [
                (
                    plain(n).replace(".", ": "),
                    spread_estimate(document, n.rpartition(".")[0] or c["effect"], v) or estimate(v),
                )
                for n, v in c["parameters"].items()
            ],
        }
        for c in ranked(document)[: listed_answers(document)]
    ]


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
    """The vocabulary's descriptions of every cause and its rivals."""
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
        if values["std"]:  # digits according to its width
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
    """The place of the gap, field by field."""
    where, degree = document["where"], unit_shown("rad")[1]
    rows = [("Runs that show it", ", ".join(where["runs"]) or "–")]
    for label, key, factor, unit in (
        ("Time", "time_s", 1.0, " s"),
        ("Amplitude", "amplitude_rad", degree, "°"),
        ("Frequency", "frequency_hz", 1.0, " Hz"),
    ):
        ends = [significant(factor * value, 3) for value in where[key] or ()]
        rows.append((label, f"{' to '.join(ends)}{unit}" if ends else "–"))
    rows.append(("Acts on", PLACES.get(where["channel"] or "", _UNDETERMINED_PLACE)))
    if windy(document):
        condition = where["condition"]
        rows.append(("Acts", _UNDETERMINED_PLACE if condition is None else ACTS_WHEN[condition]))
    return rows


def step_rows(document: Document) -> list[dict[str, str]]:
    """Each added cause, the residual gap after it, and that without this cause alone; empty without causes."""
    steps, without = document.get("waterfall", []), document.get("without", {})
    return [
        {
            "name": plain(answer_name(step["effect"])) if step["effect"] else "nominal model",
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
            "amplitude": reading_shown(line["amplitude_rad"], 2, unit_of(document)),
            "share": percent(min(line["share"], 1.0)),
        }
        for line in (document.get("maps") or {}).get("lines", [])
    ]


def next_run_rows(document: Document) -> list[tuple[str, str]]:
    """Labels and values of the run expected to distinguish the rivals; empty where none is proposed."""
    run = document["next_run"] or {}
    units = {
        "spring_stiffness": "N m/rad",
        "wind_speed": "m/s",
        "duration": "s",
        "separation": "standard deviations of the noise, expected",
    }

    def text(name: str, value: float) -> str:
        if name == "release_angle":
            return reading_shown(value, 3)
        return f"{significant(value, 3)} {units.get(name, '')}".strip()

    return [
        (plain(name).capitalize(), text(name, value))
        for name, value in run.items()
        if isinstance(value, int | float)
    ]
