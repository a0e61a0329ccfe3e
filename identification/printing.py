"""The printing of results: numbers with their standard deviations, and an estimate in blocks.

Two significant digits of the standard deviation determine the digits of the value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from identification.show.blocks import Block, Paragraph, TextTable
from identification.show.numbers import concise, significant, unit, unit_mark, with_std
from identification.status import SYSTEMATIC, Remark, Status
from tunnel_sim.vocabulary.errors import counted
from tunnel_sim.vocabulary.freedom import ANGLE, FREEDOMS, Freedom

if TYPE_CHECKING:
    from identification.trade_off import Combination, TradeOff

SYMBOLS: Mapping[str, str] = {
    "cn_beta": "Cnβ",
    "cn_r": "Cnr",
    "yaw_inertia": "Izz",
    "mechanical_damping": "Cr",
}
"""Symbols of the paper for the quantities of an estimate, by their name in its JSON."""

COEFFICIENTS: Mapping[str, str] = {
    "cn_beta": "Cnβ",
    "cn_r": "Cnr",
    "cn_beta_area": "Cnβ·A",
    "cn_r_area": "Cnr·A",
    "cn_beta_length": "Cnβ·l",
    "cn_r_length2": "Cnr·l²",
    "cn_beta_area_length": "Cnβ·A·l",
    "cn_r_area_length2": "Cnr·A·l²",
    "omega_n": "ωn",
    "zeta": "ζ",
    "yaw_inertia": "inertia",
    "mechanical_damping": "damping",
    "added_stiffness": "added stiffness",
    "moment_offset": "constant moment",
    "servo_kp": "kp",
}
"""Symbols of the coefficients of a diagnosis, also of coefficients multiplied by unstated sizes."""


def coefficient_label(name: str, unit: str) -> str:
    """A coefficient's symbol and unit, such as ``Cnβ [1/rad]``."""
    return f"{COEFFICIENTS.get(name, name)} [{unit_mark(unit)}]"


Document = Mapping[str, Any]


SHOWN_RUNS = 16
"""Maximum number of runs listed."""


def estimate_blocks(
    document: Document, conditions: Conditions | None = None, *, windows: bool = False
) -> tuple[Block, ...]:
    """An estimate: the coefficients, the runs, the scatter between them, and a paragraph for each note.

    Args:
        conditions: conditions of the runs, which are then all listed; without them, the first `SHOWN_RUNS` runs
            are.
        windows: whether to add a table of windows for each run.
    """
    count = len(document["runs"]) - SHOWN_RUNS
    more = (
        f"and {counted(count, 'more run')}, which runs_frame() lists" if count > 0 and not conditions else ""
    )
    shown = runs_table(document, conditions)
    blocks: tuple[Block, ...] = (
        coefficients_table(document),
        shown,
        *(map(windows_table, document["runs"]) if windows else ()),
        Paragraph(more),
        Paragraph(BRACKETS if shown.rows else ""),
        *(Paragraph(line) for line in notes(document)),
    )
    return freedom_of(document).texts(blocks, names_in(document))


def freedom_of(document: Document) -> Freedom:
    """The freedom of an estimate."""
    return FREEDOMS[document.get("motion", ANGLE.motion)]


def names_in(document: Document) -> tuple[str, ...]:
    """The names in an estimate that the user chose: of the campaign and of the runs."""
    return document["campaign"], *(run["id"] for run in document["runs"])


def notes(document: Document) -> list[str]:
    """The scatter between runs, what trades off, and the remarks and statuses with their remedies."""
    from identification.trade_off import (
        TradeOff,  # numpy is slow to load, and the help of the command must not wait for it
    )

    remarks = [str(Remark.from_json_dict(remark)) for remark in document["remarks"]]
    beside = [
        *repeatability_lines(document),
        *filter(None, [trade_off_line(TradeOff.from_json_dict(document.get("trade_off")), SYMBOLS)]),
    ]
    lines = [*beside, *(f"Note: {note}" for note in (*remarks, *status_lines(document)))]
    return freedom_of(document).texts(lines, names_in(document))


Conditions = Mapping[str, tuple[float | None, float]]
"""Stiffness of the spring (N m/rad; None: not stated) and wind speed (m/s), by run id."""
BRACKETS = (
    "In brackets: the standard deviation in the last digits; 12.53(10) is 12.53 ± 0.10. It includes the noise, "
    "and is wider where the model departs; tunnel diagnose adds the error of the model."
)
"""Note below tables in the short notation."""


def trade_off_line(found: TradeOff | None, symbols: Mapping[str, str]) -> str:
    """The two most strongly correlated parameters, and the run that would separate them; empty if there are none.

    Args:
        symbols: symbols of the parameters by name, for parameters that have one.
    """
    if found is None:
        return ""
    first, second = (_parameter_label(name, symbols) for name in found.parameters)
    return _together(found.together, second, symbols) + (
        f"What trades off: {first} and {second} are poorly separable in these runs (correlation "
        f"{_correlation(found.correlation)}): {found.remedy}."
    )


def _together(given: Combination | None, second: str, symbols: Mapping[str, str]) -> str:
    """The combination of two parameters that the runs determine, and its split, in a sentence; else empty."""
    if given is None:
        return ""
    label = _parameter_label(given.quantity, symbols)
    whole = f"the whole damping ratio, {label}" if given.quantity == "zeta" else label
    ends = given.of_second
    apart = max(ends[1] - ends[0], 1e-6 * abs(ends[1])) or 1.0
    digits = 2 + max(math.floor(math.log10(max(abs(ends[1]), apart) / apart)), 0)
    low, high = (significant(end, digits) for end in ends)
    unit = "" if given.unit == "1" else f" {unit_mark(given.unit)}"
    size = f"{with_std(given.value, given.std)}{unit}"
    return (
        f"What the runs determine: {whole} + {significant(given.factor, 3)} × {second} = {size}; of it "
        f"{second} contributes {low} to {high}{unit}. "
    )


def _correlation(value: float) -> str:
    """A correlation with as many decimals as needed to differ from 1, six at most."""
    apart = max(1.0 - abs(value), 10.0**-_MOST_DECIMALS)
    decimals = min(max(2, math.ceil(-math.log10(apart))), _MOST_DECIMALS)
    return f"{'−' if value < 0.0 else ''}{abs(value):.{decimals}f}"


_MOST_DECIMALS = 6


def _parameter_label(name: str, symbols: Mapping[str, str]) -> str:
    """A parameter in a sentence: its symbol, or its name with its effect's."""
    effect, _, own = name.rpartition(".")
    words = own.replace("_", " ")
    return f"{effect.replace('_', ' ')} ({words})" if effect else symbols.get(name, words)


DEVIATIONS: Mapping[str, str] = {
    "wind_speed": "wind speed",
    "spring_stiffness": "spring stiffness",
    "mechanical_damping": "mechanical damping",
}
"""Words for the deviations of runs, by their name in an estimate's JSON."""


def repeatability_lines(document: Document) -> list[str]:
    """The repeatability of the runs of an estimate: nothing where they show no scatter beyond their noise.

    If there are only as many runs as coefficients, the lines state that the scatter is unknown.
    """
    if "repeatability" not in document:  # from an earlier version
        return []
    scatter, coefficients = document["repeatability"], document["parameters"]
    shown = [run for run in document["runs"] if run["omega_n"] is not None]
    if scatter is None:
        if not coefficients or 2 * len(shown) > len(coefficients):
            return []
        return [
            f"Between runs: {'one run' if len(shown) == 1 else 'runs without a repeat'} cannot show a "
            "scatter, so the intervals include the noise only; repeat a run, or state [repeatability]."
        ]
    stated, seen = [], []
    for name, words in DEVIATIONS.items():
        width = scatter[name]
        if width is None:
            continue
        size = f"{words} by {percent(width['value'])}"
        if name in scatter["stated"]:
            stated.append(size)
        else:
            low, high = width["interval"]
            seen.append(f"{size} ({percent(low)} to {percent(high)})")
    ways = [f"as stated, {', '.join(stated)}"] if stated else []
    told = ""
    if seen:
        pattern = any(remark.get("figures", {}).get(SYSTEMATIC) for remark in document["remarks"])
        ways.append(f"{'as if by chance' if pattern else 'attributed to chance'}, {', '.join(seen)}")
        told = "; tunnel diagnose distinguishes chance from a cause"
        if pattern:
            told = ", and a systematic difference is more likely: see the note"
    differs = (
        f"frequency differs by {percent(scatter['frequency'])} and damping by {percent(scatter['damping'])}"
    )
    return [
        f"Between runs: {differs} beyond the noise (standard deviations): {'; '.join(ways)}. The intervals include "
        f"it{told}."
    ]


def percent(share: float) -> str:
    """A share in per cent with two significant digits, such as ``0.021 %``."""
    return f"{significant(100.0 * share, 2)} %"


def estimate_brief(document: Document) -> str:
    """An estimate in three lines: its coefficients, its runs, and what to call next."""
    names = {**SYMBOLS, "omega_n": "ωn", "zeta": "ζ"}
    run: Document = document["runs"][0] if document["runs"] else {}
    whole = [(name, document[name]) for name in SYMBOLS if document[name] is not None]
    shown = whole or [(name, run[name]) for name in ("omega_n", "zeta") if run.get(name) is not None]
    found = [f"{names[name]} = {quantity_text(given)} {unit_mark(given['unit'])}" for name, given in shown]
    place = "" if whole or not run else f" of {run['id']}"
    status = document["status"].replace("_", " ")
    count = f"{len(document['runs'])} run{'' if len(document['runs']) == 1 else 's'}"
    values = freedom_of(document).words(", ".join(found) + place, names_in(document))
    return (
        f"Estimate of {document['campaign']!r} by {document['estimator']}: {status}, {count}\n"
        f"  {values or 'no value'}\n"
        "  print() shows all; .to_frame(), .runs_frame(), .windows_frame()"
    )


def coefficients_table(document: Document) -> TextTable:
    """The identified coefficients of the campaign; no rows if there are none."""
    names = {**SYMBOLS, "wind_off_inertia": "Izz, gradient of Kr over ωn²"}
    rows = tuple(
        (f"{symbol} {unit(document[name]['unit'])}", quantity_text(document[name]))
        for name, symbol in names.items()
        if document[name] is not None
    )
    title = f"{document['campaign']} by {document['estimator']}"
    return TextTable(title, ("quantity", "estimate ± std"), rows)


def runs_table(document: Document, conditions: Conditions | None = None) -> TextTable:
    """Natural frequency and damping ratio of all runs with their conditions, or of `SHOWN_RUNS` runs."""
    runs = document["runs"][: None if conditions else SHOWN_RUNS]
    stated = ("Kr\n[N m/rad]", *["V\n[m/s]"] * freedom_of(document).windy) if conditions else ()
    rows = tuple(
        (
            run["id"],
            *(_stated(*conditions[run["id"]])[: len(stated)] if conditions else ()),
            _concise(run["omega_n"]),
            _concise(run["zeta"]),
            run["status"].replace("_", " "),
        )
        for run in runs
    )
    return TextTable(
        f"Runs of {document['campaign']}",
        ("run", *stated, "ωn\n[rad/s]", "ζ\n[1]", "status"),
        rows,
        right=stated,
    )


def _stated(spring: float | None, wind: float) -> tuple[str, str]:
    return "not stated" if spring is None else f"{spring:g}", f"{wind:g}"


def windows_table(run: Document) -> TextTable:
    """Estimates of consecutive windows of a run, the largest amplitude first, as in the paper's Table III."""
    cycles = run["windows"][0]["cycles"] if run["windows"] else 0
    rows = tuple(
        (
            f"{window['start_s']:.2f}",
            f"{window['start_s'] + window['duration_s']:.2f}",
            *(_concise(window[name]) for name in ("amplitude", "zeta", "omega_n")),
        )
        for window in run["windows"]
    )
    heads = ("from [s]", "to [s]", "amplitude [rad]", "ζ [1]", "ωn [rad/s]")
    return TextTable(f"{run['id']}: windows of {counted(cycles, 'cycle')}", heads, rows, right=heads[:2])


def budget_blocks(document: Document) -> tuple[Block, ...]:
    """The uncertainty budget of an estimate: its sources, the dominant one of each quantity, and their notes.

    A negative value in the table is the reduction by a correlation. Quantities are in their units.

    Args:
        document: of an estimate, with its ``budget``.
    """
    budget = document["budget"]
    components, combined = budget["components"], budget["combined_std"]
    names = [name for name in SYMBOLS if name in combined]
    headings = tuple(f"{SYMBOLS[name]}\n{unit(document[name]['unit'])}" for name in names)
    rows = [(part["name"], *(_budget_cell(part, name) for name in names)) for part in components]
    rows.append(("all together", *(significant(combined[name], 2) for name in names)))
    title = "Uncertainty budget: one standard uncertainty each"
    blocks: tuple[Block, ...] = (
        TextTable(title, ("source", *headings), tuple(rows), right=headings),
        *(Paragraph(_dominant(components, name)) for name in names),
        *(Paragraph(f"{part['name']}: {part['note']}") for part in components if part["note"]),
    )
    return freedom_of(document).texts(blocks, names_in(document))


def _budget_cell(component: Document, name: str) -> str:
    variance = float(component["variance"][name])
    if variance == 0.0:
        return "0" if component["known"] else "–"
    return f"{'−' if variance < 0.0 else ''}{significant(math.sqrt(abs(variance)), 2)}"


def _dominant(components: Sequence[Document], name: str) -> str:
    """The largest source of a quantity; it dominates if it exceeds all others together."""
    variances = [float(component["variance"][name]) for component in components]
    largest, total = max(variances), sum(variances)
    share = largest / total if total > 0.0 else 0.0
    verb = "dominates" if share > 0.5 else "is the largest source"
    source = components[variances.index(largest)]["name"]
    return f"{SYMBOLS[name]}: {source} {verb}, {100.0 * share:.0f} % of the variance"


def status_lines(document: Document) -> list[str]:
    """The statuses of the estimate and its runs, the gravest first, each once with its runs and the remedy."""
    runs: dict[str, list[str]] = {name: [] for name in document["statuses"] if name != "ok"}
    for run in document["runs"]:
        for name in run["statuses"]:
            if name != "ok":
                runs.setdefault(name, []).append(run["id"])
    count, gravity = len(document["runs"]), [status.name.lower() for status in Status]
    return [
        Status[name.upper()].value + (f" ({', '.join(ids)})" if ids and len(ids) < count else "")
        for name, ids in sorted(runs.items(), key=lambda one: gravity.index(one[0]))
    ]


def quantity_text(quantity: Document | None) -> str:
    """A quantity with its standard deviation, without its unit; a dash where there is none."""
    return "–" if quantity is None else with_std(quantity["value"], quantity["std"])


def _concise(quantity: Document | None) -> str:
    """A quantity without its unit, which is in the heading."""
    return "–" if quantity is None else concise(quantity["value"], quantity["std"])
