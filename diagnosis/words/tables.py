"""The tables of a diagnosis, from its document. Columns for which only a page has room are details."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from diagnosis.findings.misfit import misfit_text, unit_of
from diagnosis.findings.terms import answer_name
from diagnosis.findings.whole import Findings
from diagnosis.words.answers import ranked, set_out
from identification.printing import coefficient_label
from identification.show.blocks import TextTable
from identification.show.numbers import (
    estimated,
    explained,
    held_out_excess,
    p_text,
    plain,
    probability,
    reading_shown,
    share,
    significant,
    size_change,
    unit_mark,
    with_std,
)
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.dimensions import beside

_IN_BRACKETS = "root mean square (in brackets: mean square over the noise variance)"


def candidates_table(answer: Findings) -> TextTable:
    """The answers considered and their shares of the gap, most probable first; a last row counts the others."""
    rows, given, chosen = [], ranked(answer), answer.settings.words
    probable = [c for c in given[: chosen.answers_listed] if c.probability >= chosen.answer_listed]
    shown = probable or given[:1]
    for candidate in shown:
        fitted = candidate.effect not in ("none", "unknown")
        closed = share(candidate.closed) if fitted else "–"
        name = answer_name(candidate.effect).replace(" + ", " +\n")
        parameters = "\n".join(
            f"{plain(full).replace('.', ': ')} = {_estimate(answer, full, candidate.effect, given)}"
            for full, given in candidate.parameters.items()
        )
        excess = held_out_excess(candidate.excess_after)
        rows.append((name, probability(candidate.probability), closed, excess, parameters))
    if others := given[len(shown) :]:
        together = sum(candidate.probability for candidate in others)
        rows.append((f"{len(others)} more, together", probability(together), "", "", ""))
    detail = ("residual [× noise variance]", "parameters")
    heads = ("answer", "probability", "explained in the fit", *detail)
    return TextTable(
        f"Answers for {answer.campaign}",
        heads,
        tuple(rows),
        heads[1:4],
        names=("answer",),
        detail=detail,
    )


def _estimate(answer: Findings, full: str, candidate: str, given: Quantity) -> str:
    """A parameter of an answer, by its full name."""
    mark = unit_mark(beside(given.unit, ""))
    return answer.repeated.spread_estimate(full.rpartition(".")[0] or candidate, given) or estimated(
        given, mark
    )


def parameters_table(answer: Findings) -> TextTable:
    """The parameters of the answer; a table without rows where it has none."""
    first = answer.candidates[0]
    rows, effect = [], ""
    for full, given in first.parameters.items():
        owner, _, name = full.rpartition(".")
        owner = owner or first.effect
        size = _estimate(answer, full, first.effect, given)
        rows.append((owner if owner != effect else "", name, size))
        effect = owner
    whose = "Parameters" if answer.decision.decided else f"Parameters of the {set_out(answer)}"
    units = explained({given.unit for given in first.parameters.values()})
    heads = ("effect", "parameter", "estimate")
    return TextTable(f"{whose} ± one standard deviation{units}", heads, tuple(rows), names=heads[:2])


def runs_table(answer: Findings, campaign: Campaign | None = None) -> TextTable:
    """The gap before and after, all runs first; a table without rows where no gap was found.

    Args:
        campaign: adds the conditions of the runs, also where no gap was found.
    """
    gap, shows = answer.gap, answer.where.runs
    named = answer.names_effects
    gaps = {run.id: run for run in gap.runs}
    runs = {run.id: run for run in campaign.runs} if campaign else {}
    windy = any(run.wind_on for run in runs.values())
    conditions = (
        ("spring [N m/rad]", *["wind [m/s]"] * windy, "duration [s]", "sample rate [Hz]") if runs else ()
    )

    def after(value: float) -> str:
        return misfit_text(answer, value) if named else "–"

    before = misfit_text(answer, gap.excess_before)
    rows = [("all", *[""] * len(conditions), before, after(gap.excess_after), "")] if gap.detected else []
    for name in runs or (gaps if gap.detected else ()):
        found, stated = gaps.get(name), []
        if run := runs.get(name):
            spring = "–" if run.spring_stiffness is None else f"{run.spring_stiffness:g}"
            wind = [f"{run.wind_speed:g}" if run.wind_on else "off"] if windy else []
            stated = [spring, *wind, f"{run.record.duration:.3g}", f"{run.record.sample_rate:.4g}"]
        fitted = " (fitted)" if found and not found.held_out else ""
        sizes = (misfit_text(answer, found.before), after(found.after)) if found else ("–", "–")
        rows.append((name + fitted, *stated, *sizes, "yes" if name in shows else ""))
    shown = "shows the gap"
    heads = ("run", *conditions, "before", "after", shown)
    detail = (*conditions, shown)
    return TextTable(f"Gap, {_IN_BRACKETS}", heads, tuple(rows), right=heads[1:-1], detail=detail)


def waterfall_table(answer: Findings) -> TextTable:
    """The residual gap with each cause added, and without each; a table without rows where no cause is named."""
    steps, without = answer.waterfall.steps, answer.waterfall.without
    rows = []
    for step in steps if len(steps) > 1 else ():
        alone = misfit_text(answer, without[step.effect]) if step.effect and step.effect in without else ""
        name = answer_name(step.effect) if step.effect else "nominal model"
        rows.append((name, misfit_text(answer, step.excess), alone))
    title = f"Gap {answer.waterfall.held_out} as the causes are added, {_IN_BRACKETS}"
    heads = ("cause added", "residual gap", "without this cause")
    return TextTable(title, heads, tuple(rows), heads[1:], names=heads[:1])


def coefficients_table(answer: Findings) -> TextTable:
    """The coefficients of the nominal model; where causes are named, also with these, and the change of size.

    A terminal shows the 95 % intervals only where one is not the value ± 1.96 standard deviations.
    """
    before, after = answer.coefficients.before, answer.coefficients.after
    named, rows = answer.names_effects, []
    skewed = any(given.interval for given in (after or before).values())
    for label, nominal, with_causes in _rows(answer):
        best = with_causes or nominal
        cells = [_without_interval(given) for given in ([nominal, with_causes] if named else [best])]
        interval = _interval(best)
        if skewed and best is not None and best.std:
            cells[-1] += f"\n({interval})"
        change = "–"
        both = [given for given in (nominal, with_causes) if given and given.determined]
        if len(both) == 2 and both[0].value:
            change = size_change(*(given.value for given in both))
        rows.append((label, *cells, *[interval] * (not skewed), *[change] * named))
    causes = "with the causes" if answer.decision.decided else f"with the {set_out(answer)}"
    detail = () if skewed else ("95 % interval",)
    heads = ("coefficient", "nominal model", *[causes] * named, *detail, *["change of size"] * named)
    title = "Coefficients ± one standard deviation" + " (95 % interval)" * skewed
    return TextTable(title, heads, tuple(rows), right=heads[1:], detail=detail)


def _rows(answer: Findings) -> Iterator[tuple[str, Quantity | None, Quantity | None]]:
    """Label of a coefficient, and its estimates by the nominal model and with the causes.

    The nominal model has no lag, so with a named lag its coefficients compare with those in phase.
    """
    before, after = answer.coefficients.before, answer.coefficients.after
    phase = answer.coefficients.in_phase
    for name in dict.fromkeys([*before, *after]):
        nominal, with_causes = before.get(name), after.get(name)
        label = coefficient_label(name, {**after, **before}[name].unit)
        if name in phase:
            which = "angle" if name.startswith("cn_beta") else "rate"
            yield f"{label}, in phase with the {which}", nominal, phase[name]
            yield f"{label}, beside the lag", None, with_causes
        else:
            yield label, nominal, with_causes


def _without_interval(given: Quantity | None) -> str:
    return "–" if given is None else estimated(replace(given, interval=None))


def _interval(given: Quantity | None) -> str:
    """The central interval of 0.95, with as many digits as its width allows."""
    if given is None or not given.std:
        return "–"
    reach = 1.96 * given.std
    width = with_std(given.value, reach).partition("± ")[2]
    places = len(width.partition(".")[2]) if width.replace(".", "").isdigit() else None
    ends = given.interval or (given.value - reach, given.value + reach)
    return " to ".join(significant(end) if places is None else f"{end:.{places}f}" for end in ends)


SOURCES = {
    "noise": "noise of the readings",
    "scatter": "scatter between the runs",
    "misfit": "model error",
    "small causes": "small causes that are not named",
    "air density": "rounding of the stated air density",
    "unseen form": "form of the cause that free decays cannot show",
    "freed form": "freedom of the causes' forms",
    "rivals": "other answers, weighted by probability",
}
"""The sources of a coefficient's variance."""


def hidden_table(answer: Findings) -> TextTable:
    """Upper limits on undetected effects, and the change of each coefficient at that size."""
    hidden, rows = answer.hidden, []
    names = [name for name in answer.coefficients.after if hidden and name in hidden[0].moves]
    for one in hidden:
        size = f"{significant(one.size.value, 2)}{unit_mark(beside(one.size.unit))}"
        moves = [significant(one.moves[name].value, 2) for name in names]
        rows.append((plain(one.effect), size, *moves))
    heads = [f"would change {coefficient_label(name, hidden[0].moves[name].unit)} by" for name in names]
    units = explained({one.size.unit for one in hidden})
    title = f"Upper limits on undetected effects (95 %), which ± does not include{units}"
    return TextTable(title, ("effect", "at most", *heads), tuple(rows), ("at most", *heads))


def patch_table(answer: Findings) -> TextTable:
    """The changes of the patch; a table without rows where no model was given."""
    model, rows = answer.model, []
    for one in model.written if model else ():
        numbers = _numbers(one.before), _numbers(one.after)
        rows.append((one.name, *numbers, unit_mark(beside(one.unit, ""))))
    heads = ("attribute", "before", "after", "unit")
    return TextTable(f"Changes to {model.file if model else ''}", heads, tuple(rows), heads[1:3])


def _numbers(values: Sequence[float]) -> str:
    last = max((i for i, value in enumerate(values) if value), default=0)
    return " ".join(significant(value, 4) for value in values[: last + 1])


def lines_table(answer: Findings) -> TextTable:
    """Narrow lines in the residuals."""
    rows = tuple(
        (
            line["run"],
            significant(line["frequency_hz"], 4),
            reading_shown(line["amplitude_rad"], 2, unit_of(answer)),
            share(min(line["share"], 1.0)),
        )
        for line in answer.figure_data.get("lines", [])
    )
    heads = ("run", "frequency [Hz]", "amplitude", "share of the run's gap")
    return TextTable("Narrow lines in the residuals", heads, rows, right=heads[1:])


def budget_table(answer: Findings) -> TextTable:
    """The uncertainty budget of the coefficients of the answer; no rows where the document has no shares.

    A row for each source: its standard deviation and its share of the variance, by coefficient.
    """
    heads: list[str] = []
    columns = [[*SOURCES.values(), "combined standard deviation"]]
    for name, given in answer.coefficients.after.items():
        std, shares = given.std, given.shares
        if std is None or not shares:
            continue
        heads.append(coefficient_label(name, given.unit))
        cells = []
        for part in (shares.get(source, 0.0) for source in SOURCES):
            shown = f"{significant(std * math.sqrt(part), 2)} ({100.0 * part:.1f} %)"
            cells.append("–" if part < 5e-4 else shown)
        columns.append([*cells, significant(std, 2)])
    title = "Uncertainty budget with the causes: standard deviation by source, and share of the variance"
    rows = tuple(zip(*columns, strict=True)) if heads else ()
    return TextTable(title, ("source", *heads), rows, right=tuple(heads))


TESTS = {
    "below": "residual power below half the frequency f₀ of the oscillation",
    "f0": "residual power at f₀, from 0.5 to 1.5 f₀: the oscillation itself",
    "2f0": "residual power at its second harmonic, from 1.5 to 2.5 f₀",
    "3f0": "residual power at its third harmonic, from 2.5 to 3.5 f₀",
    "above": "residual power above 3.5 f₀",
    "offset": "whether the runs have a common zero",
    "noise against amplitude": "whether the noise grows or shrinks with the amplitude of the motion",
    "noise against rate": "whether the noise grows or shrinks with the rate of the motion",
    "noise in bursts": "whether the noise comes in bursts",
    "noise level": "whether the noise is above the level that the campaign states",
}
"""The tested properties, by the names of the tests."""


def tests_table(answer: Findings) -> TextTable:
    """The tests of the gap: name, tested property, and p-value."""
    tests = answer.gap.tests.items()
    rows = tuple((name, TESTS.get(name, "–"), p_text(value).removeprefix("= ")) for name, value in tests)
    title = "Tests of the gap; p is the probability that noise alone gives as much"
    return TextTable(title, ("test", "tested property", "p"), rows, right=("p",))
