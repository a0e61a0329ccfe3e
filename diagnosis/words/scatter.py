"""Repeatability of the runs, in sentences: chance differences, and the run that deviates far beyond them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from diagnosis.settings import WordsSettings, settings_of
from diagnosis.words.numbers import listed, plain, probability, rounded_up
from identification.blocks import TextTable
from identification.printing import Document, concise, significant, with_std
from identification.status import SYSTEMATIC
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.vocabulary.quantities import Share

SCATTERS = {kind.name: kind.scatters for kind in ALL_EFFECTS if kind.scatters}
"""The quantity that differs between runs, by the name of the scatter."""
NUMBERS = {
    "wind_speed": "the wind speed",
    "spring_stiffness": "the spring",
    "mechanical_damping": "the damping",
}
"""The quantities that may differ between runs, in words."""
BETWEEN_RUNS = "scatter between runs"
"""Chance differences between runs, in any quantity, in a few words."""
_MEANT = (
    "These are standard deviations between runs, with 90 % intervals; the intervals of the coefficients allow for "
    "them."
)
_ALONG = {
    "spring_stiffness": "stiffness of the spring",
    "wind_speed": "wind speed",
    "air_density": "air density",
    "amplitude": "amplitude",
}
_DRIFTS = {
    "wind_speed": "does the lab warm up, or the fan drift?",
    "spring_stiffness": "does the spring warm up, or creep?",
    "mechanical_damping": "does the bearing run in, or the cable creep?",
}


def without_scatter(names: Iterable[str]) -> list[str]:
    """Causes proper: those that are not chance differences between runs."""
    return [name for name in names if name not in SCATTERS]


def scattering(names: Iterable[str]) -> list[str]:
    """Chance differences between runs among some causes."""
    return [name for name in names if name in SCATTERS]


def spreads_of(document: Document) -> list[Mapping[str, Any]]:
    """The chance differences between the runs, from the document; none for a document without them."""
    return list((document.get("repeatability") or {"spreads": ()})["spreads"])


def scatters(document: Document) -> bool:
    """Whether the runs show scatter, or some is stated."""
    return any(one["width"] for one in spreads_of(document))


def repeats(document: Document) -> bool:
    """Whether a test that could see scatter between the runs saw none, and none is stated."""
    return not scatters(document) and not _undetermined(document)


def _undetermined(document: Document) -> str:
    """The reason why it is not known whether the runs repeat, as a clause; empty where it is known.

    Scatter is measured against the noise, so the answer must explain the runs down to their noise.
    """
    if document["causes"] == ["unknown"]:
        return "since no known effect explains the gap"
    if not document.get("decided", True):
        return "since the answer is undecided"
    if (document.get("rest") or {}).get("significant"):
        return "since the answer leaves a gap beyond the noise"
    if (document.get("closable") or {}).get("kind") == "between":
        return "since a difference between the runs could explain the rest"
    found = document.get("repeatability") or {}
    limits = found.get("limits")
    if limits is None or all(limit is None for limit in limits.values()):
        return "since these runs would not show usual scatter"
    return ""


def percent_of(value: Share, digits: int = 2, *, sign: bool = False) -> str:
    """A fraction in per cent, such as ``0.29 %`` or ``−0.6 %``.

    Args:
        digits: significant ones (a count).
        sign: whether a plus sign is written.
    """
    text = significant(100.0 * abs(value), digits) if value else "0"
    return f"{'−' if value < 0.0 else '+' if sign else ''}{text} %"


def _stated(spread: Mapping[str, Any]) -> str:
    """The scatter stated by the campaign, in its own form."""
    return f"{100.0 * spread['stated']:.4g} %"


def width_text(spread: Mapping[str, Any]) -> str:
    """A width with its interval, such as ``0.29 % (0.13 to 0.62 %)``; without it for a stated width."""
    low, high = spread["interval"]
    text = percent_of(spread["width"])
    return text if low == high else f"{text} ({percent_of(low).removesuffix(' %')} to {percent_of(high)})"


def named_answer(causes: Sequence[str]) -> str:
    """The causes in a few words, such as ``coulomb friction, and scatter between runs``."""
    proper = without_scatter(causes)
    if not scattering(causes):
        return plain(*proper)
    return f"{plain(*proper)}, and {BETWEEN_RUNS}" if proper else BETWEEN_RUNS.capitalize()


def answer_name(effect: str) -> str:
    """Names of effects joined by plus signs, with every scatter between runs as one part."""
    names = effect.split(" + ")
    return " + ".join([*without_scatter(names), *([BETWEEN_RUNS] if scattering(names) else [])])


def spread_estimate(document: Document, effect: str, given: Mapping[str, Any]) -> str | None:
    """The parameter of a scatter in per cent, with its interval in the answer; None for other effects.

    Args:
        effect: that the parameter belongs to.
        given: the parameter, from the document.
    """
    if effect not in SCATTERS:
        return None
    spread = next((one for one in spreads_of(document) if one["effect"] == effect), None)
    return percent_of(given["value"]) if spread is None else width_text(spread)


def repeats_words(document: Document) -> str:
    """Repeatability of the runs, in sentences; empty where they repeat, or it is not known."""
    return " ".join(filter(None, (scatter_words(document), outlier_words(document))))


def scatter_words(document: Document) -> str:
    """Chance differences or drifts of the runs and their meaning; empty where there are none."""
    spreads = spreads_of(document)
    shown = [one for one in spreads if one["shown"]]
    if not shown:
        return stated_words(document)
    trends = {one["effect"]: one for one in document["repeatability"].get("trends", ())}
    drifting = {effect for effect, one in trends.items() if one.get("only")}
    said = []
    if scattered := [one for one in shown if one["effect"] not in drifting]:
        parts = "; ".join(_differs(one, trends) for one in scattered)
        said.append(f"{_start(document)}: {parts}. {_MEANT}")
    said += map(trend_words, trends.values())
    if not scattered:
        said.append("The intervals of the coefficients allow for it.")
    return " ".join([*said, *_told_apart(spreads, settings_of(document).words)])


def systematic(document: Document) -> list[str]:
    """Words for what the examination found of a pattern in the runs' differences; and the patterns' effects."""
    remarks = [remark.get("figures", {}).get(SYSTEMATIC) for remark in document.get("remarks", ())]
    trends = [one["effect"] for one in (document.get("repeatability") or {}).get("trends", ())]
    return [*filter(None, remarks), *trends]


def _start(document: Document) -> str:
    if not document.get("decided", True):
        return "With every answer the runs differ from each other by chance"
    if without_scatter(document["causes"]):
        return "In addition the runs differ by chance"
    likely = probability(document["credible"][0]["probability"])
    if systematic(document):
        return f"The runs differ from each other, and not by chance alone (probability {likely})"
    only = "" if document["rest"]["material"] else " only"
    return f"The runs differ from each other by chance{only} (probability {likely})"


def _differs(spread: Mapping[str, Any], trends: Mapping[str, Any]) -> str:
    """One quantity that differs: its width, the reference, and the runs that deviate most."""
    text = f"{NUMBERS[SCATTERS[spread['effect']]]} by {width_text(spread)}"
    if spread["stated"] is not None:
        text += f", beyond the {_stated(spread)} stated"
    if spread["effect"] in trends:
        return text
    most = sorted(spread["deviations"].items(), key=lambda one: -abs(one[1]))[:2]
    return f"{text}, {' and '.join(f'{run} {percent_of(own, 1, sign=True)}' for run, own in most)} most"


def trend_words(trend: Mapping[str, Any]) -> str:
    """The drift of a quantity over the campaign, in a sentence."""
    number = SCATTERS[trend["effect"]]
    change, std = 100.0 * abs(trend["change"]), 100.0 * trend["std"]
    goes = "rises" if trend["change"] > 0.0 else "falls"
    moved = f"{NUMBERS[number]} {goes} by {with_std(change, std)} % from the first to the last run"
    along = trend.get("along", "order")
    if along != "order":
        moved = f"{with_std(change, std)} % {'higher' if trend['change'] > 0.0 else 'lower'}"
        return (
            f"Part of this is not by chance: {NUMBERS[number]} is {moved} at the greatest {_ALONG[along]} than at "
            f"the least. The remaining scatter is {percent_of(trend['left'])}."
        )
    if trend.get("only"):
        return f"The runs drift but do not scatter: {moved} ({_DRIFTS[number]})."
    return (
        f"Part of this is a drift: {moved} ({_DRIFTS[number]}). "
        f"The remaining scatter is {percent_of(trend['left'])}."
    )


def stated_words(document: Document) -> str:
    """The statement that the runs differ no more than the campaign states; empty where it states nothing."""
    stated = [one for one in spreads_of(document) if one["stated"]]
    if not stated or document["causes"] == ["unknown"]:
        return ""
    sizes = listed([f"{NUMBERS[SCATTERS[one['effect']]]} {_stated(one)}" for one in stated])
    return f"The runs differ no more than stated ({sizes}); the intervals allow for it."


def _told_apart(spreads: Sequence[Mapping[str, Any]], chosen: WordsSettings) -> list[str]:
    """The statement that the runs hardly distinguish two quantities, where so."""
    both = [one for one in spreads if SCATTERS[one["effect"]] in ("wind_speed", "spring_stiffness")]
    if len(both) < 2 or not any(one["shown"] for one in both):
        return []
    poorly = [one for one in both if _ratio(one["interval"]) > chosen.width_known_within and one["shown"]]
    hidden = [one for one in both if not one["shown"] and one["stated"] is None]
    if hidden:
        other = NUMBERS[SCATTERS[hidden[0]["effect"]]]
        bound = percent_of(hidden[0]["interval"][1])
        return [
            f"{other[0].upper()}{other[1:]} may also differ, by up to {bound}; these runs do not show it."
        ]
    if poorly:
        return [
            "These runs hardly distinguish the wind speed from the spring: add wind-off runs, or log the wind "
            "speed."
        ]
    return []


def _ratio(interval: Sequence[float]) -> float:
    low, high = interval
    return high / low if low > 0.0 else float("inf")


def outlier_words(document: Document) -> str:
    """The run that deviates far beyond the others, with its deviation; empty without one."""
    found = document.get("repeatability") or {}
    run = found.get("outlier")
    if not run:
        return ""
    own = next(one for one in found["runs"] if one["id"] == run)
    parts = []
    for name in ("frequency", "damping"):
        usual = max(own[f"{name}_band"], own[f"{name}_std"], 1e-300)
        parts.append((abs(own[name]) / usual, f"{name} {percent_of(own[name], sign=True)}"))
    least = settings_of(document).words.deviation_named
    far = [text for stds, text in parts if stds >= least] or [max(parts)[1]]
    said = f"Run {run} deviates far beyond the others: {' and '.join(far)} relative to the model of all runs."
    return " ".join(filter(None, (said, _without_outlier(document, found.get("without_outlier")))))


def _without_outlier(document: Document, other: Document | None) -> str:
    """The answer of the other runs; empty where it is not known."""
    if not other:
        return ""
    causes, known = other["causes"], probability(other["probability"])
    if causes == document["causes"]:
        return f"Without it the causes are the same ({known})."
    if not causes:
        return "Without it there is no gap."
    if causes == ["unknown"]:
        return f"Without it no known effect explains the gap ({known})."
    return f"Without it the answer is {plain(*causes)} ({known})."


def repeat_steps(document: Document) -> list[str]:
    """Next steps for a run that deviates far beyond the others, and for poorly distinguished quantities."""
    run = (document.get("repeatability") or {}).get("outlier")
    steps = (
        [f"Repeat run {run}, or look for a disturbance: it deviates far beyond the others."] if run else []
    )
    poorly = _told_apart(spreads_of(document), settings_of(document).words)
    named = {SCATTERS[name] for name in scattering(document["causes"])}
    if poorly and "wind_speed" not in named:  # whose advice includes this
        steps.append("Log the wind speed of every run: the runs do not distinguish it from the spring.")
    return steps


def repeatability_line(document: Document) -> str:
    """Repeatability of the runs, in a line; empty for a document without it."""
    found = document.get("repeatability")
    if not found or len(found["runs"]) < 2:
        return ""
    if repeats(document):
        return f"Repeatability: no run-to-run scatter detected: {_limits(found['limits'])}."
    if not scatters(document):
        own = [f"{name} by {_root_mean_square(found['runs'], name, '')}" for name in ("frequency", "damping")]
        return (
            f"Repeatability: not determined, {_undetermined(document)}. The runs, one by one, deviate from the "
            f"model in {' and in '.join(own)} (root mean square)."
        )
    each = [f"{name} ± {_root_mean_square(found['runs'], name)}" for name in ("frequency", "damping")]
    beyond = f"; outlier: {found['outlier']}" if found["outlier"] else ""
    return f"Repeatability: between runs {', '.join(each)} (one standard deviation){beyond}."


def _limits(limits: Mapping[str, float | None]) -> str:
    """Upper limits of scatter that is not detected, such as ``frequency less than 0.05 %``."""
    said = [
        f"{name} not determined, since these runs would not show usual scatter"
        if limit is None
        else f"{name} less than {rounded_up(100.0 * limit)} %"
        for name, limit in limits.items()
    ]
    return f"{', '.join(said)} (one standard deviation; 95 % limits)"


def _root_mean_square(runs: Sequence[Mapping[str, Any]], name: str, of: str = "_band") -> str:
    """Root mean square of a quantity over the runs, in per cent.

    Args:
        of: ``_band``: of its scatter between runs; empty: of the runs' own deviations.
    """
    return percent_of((sum(one[f"{name}{of}"] ** 2 for one in runs) / len(runs)) ** 0.5)


def repeatability_table(document: Document) -> TextTable:
    """Every run against the model; a table without rows where the runs repeat."""
    found, rows = document.get("repeatability"), []
    known = scatters(document)
    for run in found["runs"] if found and not repeats(document) else ():
        deviations = [
            f"{_signed(run[name], run[f'{name}_std'])}{_band(run[f'{name}_band']) if known else ''}"
            for name in ("frequency", "damping")
        ]
        remark = "deviates far beyond the others" if found and run["id"] == found["outlier"] else ""
        rows.append((run["id"], "on" if run["windy"] else "off", *deviations, remark))
    heads = ("run", "wind", "frequency [%]", "damping [%]", "remark")
    last = None if any(row[-1] for row in rows) else -1
    title = "Every run against the model"
    if known:
        title += ", and its scatter by chance (one standard deviation)"
    return TextTable(title, heads[:last], tuple(row[:last] for row in rows), heads[2:4])


def _band(width: Share) -> str:
    """The scatter of a quantity by chance, such as `` (± 0.039)``."""
    return f" (± {percent_of(width).removesuffix(' %')})"


def _signed(value: float, std: float) -> str:
    """A deviation in per cent with its sign."""
    text = concise(100.0 * abs(value), 100.0 * std)
    return f"{'−' if value < 0.0 else '+'}{text}"
