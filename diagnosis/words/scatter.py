"""Repeatability of the runs, in sentences: chance differences, and the run that deviates far beyond them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from diagnosis.findings.repeatability import AnswerWithout, RunRepeat, ScatterLimits, Spread, Trend
from diagnosis.findings.whole import Findings
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import WordsSettings
from diagnosis.words.numbers import listed, plain, probability, rounded_up
from identification.estimate import Quantity
from identification.printing import concise, significant, with_std
from identification.show.blocks import TextTable
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


def spreads_of(answer: Findings) -> tuple[Spread, ...]:
    """The chance differences between the runs, from the document; none for a document without them."""
    return () if answer.repeatability is None else answer.repeatability.spreads


def trends_of(answer: Findings) -> tuple[Trend, ...]:
    """The quantities that differ between the runs by a pattern."""
    return () if answer.repeatability is None else answer.repeatability.trends


def scatters(answer: Findings) -> bool:
    """Whether the runs show scatter, or some is stated."""
    return any(one.width for one in spreads_of(answer))


def repeats(answer: Findings) -> bool:
    """Whether a test that could see scatter between the runs saw none, and none is stated."""
    return not scatters(answer) and not _undetermined(answer)


def _undetermined(answer: Findings) -> str:
    """The reason why it is not known whether the runs repeat, as a clause; empty where it is known.

    Scatter is measured against the noise, so the answer must explain the runs down to their noise.
    """
    if answer.causes == UNKNOWN:
        return "since no known effect explains the gap"
    if not answer.decision.decided:
        return "since the answer is undecided"
    if answer.rest is not None and answer.rest.significant:
        return "since the answer leaves a gap beyond the noise"
    if answer.closable is not None and answer.closable.kind == "between":
        return "since a difference between the runs could explain the rest"
    limits = None if answer.repeatability is None else answer.repeatability.limits
    if limits is None or (limits.frequency is None and limits.damping is None):
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


def _stated(spread: Spread) -> str:
    """The scatter stated by the campaign, in its own form; nothing stated is none."""
    return f"{100.0 * (spread.stated or 0.0):.4g} %"


def width_text(spread: Spread) -> str:
    """A width with its interval, such as ``0.29 % (0.13 to 0.62 %)``; without it for a stated width."""
    low, high = spread.interval
    text = percent_of(spread.width)
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


def spread_estimate(answer: Findings, effect: str, given: Quantity) -> str | None:
    """The parameter of a scatter in per cent, with its interval in the answer; None for other effects.

    Args:
        effect: that the parameter belongs to.
        given: the parameter, from the document.
    """
    if effect not in SCATTERS:
        return None
    spread = next((one for one in spreads_of(answer) if one.effect == effect), None)
    return percent_of(given.value) if spread is None else width_text(spread)


def repeats_words(answer: Findings) -> str:
    """Repeatability of the runs, in sentences; empty where they repeat, or it is not known."""
    return " ".join(filter(None, (scatter_words(answer), outlier_words(answer))))


def scatter_words(answer: Findings) -> str:
    """Chance differences or drifts of the runs and their meaning; empty where there are none."""
    spreads = spreads_of(answer)
    shown = [one for one in spreads if one.shown]
    if not shown:
        return stated_words(answer)
    trends = {one.effect: one for one in trends_of(answer)}
    drifting = {effect for effect, one in trends.items() if one.only}
    said = []
    if scattered := [one for one in shown if one.effect not in drifting]:
        parts = "; ".join(_differs(one, trends) for one in scattered)
        said.append(f"{_start(answer)}: {parts}. {_MEANT}")
    said += map(trend_words, trends.values())
    if not scattered:
        said.append("The intervals of the coefficients allow for it.")
    return " ".join([*said, *_told_apart(spreads, answer.settings.words)])


def systematic(answer: Findings) -> list[str]:
    """Words for what the examination found of a pattern in the runs' differences; and the patterns' effects."""
    remarks = [remark.figures.get(SYSTEMATIC) for remark in answer.remarks]
    return [*filter(None, remarks), *(one.effect for one in trends_of(answer))]


def _start(answer: Findings) -> str:
    if not answer.decision.decided:
        return "With every answer the runs differ from each other by chance"
    if without_scatter(answer.causes):
        return "In addition the runs differ by chance"
    likely = probability(answer.decision.credible[0][1])
    if systematic(answer):
        return f"The runs differ from each other, and not by chance alone (probability {likely})"
    only = "" if answer.rest_is_material else " only"
    return f"The runs differ from each other by chance{only} (probability {likely})"


def _differs(spread: Spread, trends: Mapping[str, Trend]) -> str:
    """One quantity that differs: its width, the reference, and the runs that deviate most."""
    text = f"{NUMBERS[SCATTERS[spread.effect]]} by {width_text(spread)}"
    if spread.stated is not None:
        text += f", beyond the {_stated(spread)} stated"
    if spread.effect in trends:
        return text
    most = sorted(spread.deviations.items(), key=lambda one: -abs(one[1]))[:2]
    return f"{text}, {' and '.join(f'{run} {percent_of(own, 1, sign=True)}' for run, own in most)} most"


def trend_words(trend: Trend) -> str:
    """The drift of a quantity over the campaign, in a sentence."""
    number = SCATTERS[trend.effect]
    change, std = 100.0 * abs(trend.change), 100.0 * trend.std
    goes = "rises" if trend.change > 0.0 else "falls"
    moved = f"{NUMBERS[number]} {goes} by {with_std(change, std)} % from the first to the last run"
    along = trend.along
    if along != "order":
        moved = f"{with_std(change, std)} % {'higher' if trend.change > 0.0 else 'lower'}"
        return (
            f"Part of this is not by chance: {NUMBERS[number]} is {moved} at the greatest {_ALONG[along]} than at "
            f"the least. The remaining scatter is {percent_of(trend.left)}."
        )
    if trend.only:
        return f"The runs drift but do not scatter: {moved} ({_DRIFTS[number]})."
    return (
        f"Part of this is a drift: {moved} ({_DRIFTS[number]}). "
        f"The remaining scatter is {percent_of(trend.left)}."
    )


def stated_words(answer: Findings) -> str:
    """The statement that the runs differ no more than the campaign states; empty where it states nothing."""
    stated = [one for one in spreads_of(answer) if one.stated]
    if not stated or answer.causes == UNKNOWN:
        return ""
    sizes = listed([f"{NUMBERS[SCATTERS[one.effect]]} {_stated(one)}" for one in stated])
    return f"The runs differ no more than stated ({sizes}); the intervals allow for it."


def _told_apart(spreads: Sequence[Spread], chosen: WordsSettings) -> list[str]:
    """The statement that the runs hardly distinguish two quantities, where so."""
    both = [one for one in spreads if SCATTERS[one.effect] in ("wind_speed", "spring_stiffness")]
    if len(both) < 2 or not any(one.shown for one in both):
        return []
    poorly = [one for one in both if _ratio(one.interval) > chosen.width_known_within and one.shown]
    hidden = [one for one in both if not one.shown and one.stated is None]
    if hidden:
        other = NUMBERS[SCATTERS[hidden[0].effect]]
        bound = percent_of(hidden[0].interval[1])
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


def outlier_words(answer: Findings) -> str:
    """The run that deviates far beyond the others, with its deviation; empty without one."""
    found = answer.repeatability
    if found is None or not found.outlier:
        return ""
    run = found.outlier
    own = next(one for one in found.runs if one.id == run)
    parts = []
    for name in ("frequency", "damping"):
        value, std, band = own.deviation(name)
        usual = max(band, std, 1e-300)
        parts.append((abs(value) / usual, f"{name} {percent_of(value, sign=True)}"))
    least = answer.settings.words.deviation_named
    far = [text for stds, text in parts if stds >= least] or [max(parts)[1]]
    said = f"Run {run} deviates far beyond the others: {' and '.join(far)} relative to the model of all runs."
    return " ".join(filter(None, (said, _without_outlier(answer, found.without_outlier))))


def _without_outlier(answer: Findings, other: AnswerWithout | None) -> str:
    """The answer of the other runs; empty where it is not known."""
    if not other:
        return ""
    causes, known = other.causes, probability(other.probability)
    if causes == answer.causes:
        return f"Without it the causes are the same ({known})."
    if not causes:
        return "Without it there is no gap."
    if causes == UNKNOWN:
        return f"Without it no known effect explains the gap ({known})."
    return f"Without it the answer is {plain(*causes)} ({known})."


def repeat_steps(answer: Findings) -> list[str]:
    """Next steps for a run that deviates far beyond the others, and for poorly distinguished quantities."""
    run = "" if answer.repeatability is None else answer.repeatability.outlier
    steps = (
        [f"Repeat run {run}, or look for a disturbance: it deviates far beyond the others."] if run else []
    )
    poorly = _told_apart(spreads_of(answer), answer.settings.words)
    named = {SCATTERS[name] for name in scattering(answer.causes)}
    if poorly and "wind_speed" not in named:  # whose advice includes this
        steps.append("Log the wind speed of every run: the runs do not distinguish it from the spring.")
    return steps


def repeatability_line(answer: Findings) -> str:
    """Repeatability of the runs, in a line; empty for a document without it."""
    found = answer.repeatability
    if not found or len(found.runs) < 2:
        return ""
    if found.limits is not None and repeats(answer):
        return f"Repeatability: no run-to-run scatter detected: {_limits(found.limits)}."
    if not scatters(answer):
        own = [f"{name} by {_root_mean_square(found.runs, name)}" for name in ("frequency", "damping")]
        return (
            f"Repeatability: not determined, {_undetermined(answer)}. The runs, one by one, deviate from the "
            f"model in {' and in '.join(own)} (root mean square)."
        )
    each = [
        f"{name} ± {_root_mean_square(found.runs, name, of_scatter=True)}"
        for name in ("frequency", "damping")
    ]
    beyond = f"; outlier: {found.outlier}" if found.outlier else ""
    return f"Repeatability: between runs {', '.join(each)} (one standard deviation){beyond}."


def _limits(limits: ScatterLimits) -> str:
    """Upper limits of scatter that is not detected, such as ``frequency less than 0.05 %``."""
    said = [
        f"{name} not determined, since these runs would not show usual scatter"
        if limit is None
        else f"{name} less than {rounded_up(100.0 * limit)} %"
        for name, limit in (("frequency", limits.frequency), ("damping", limits.damping))
    ]
    return f"{', '.join(said)} (one standard deviation; 95 % limits)"


def _root_mean_square(runs: Sequence[RunRepeat], name: str, *, of_scatter: bool = False) -> str:
    """Root mean square over the runs of their own deviations of a quantity, or of its scatter, in per cent."""
    place = 2 if of_scatter else 0
    return percent_of((sum(one.deviation(name)[place] ** 2 for one in runs) / len(runs)) ** 0.5)


def repeatability_table(answer: Findings) -> TextTable:
    """Every run against the model; a table without rows where the runs repeat."""
    found, rows = answer.repeatability, []
    known = scatters(answer)
    for run in found.runs if found and not repeats(answer) else ():
        deviations = [
            f"{_signed(value, std)}{_band(band) if known else ''}"
            for value, std, band in (run.deviation("frequency"), run.deviation("damping"))
        ]
        remark = "deviates far beyond the others" if found and run.id == found.outlier else ""
        rows.append((run.id, "on" if run.windy else "off", *deviations, remark))
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
